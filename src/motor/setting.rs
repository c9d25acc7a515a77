//! Refusal of a setting of the current loop that is out of its range; task, host.

/// Names of settings and units of their numbers, in the order of their numbers on the bus (object 2100h:3), and index
/// and sub-index of the object that sets it or what it is computed from; zeros where that is nobody's to set over the
/// bus. New ones come last.
const NAMES: [(&str, &str, u16, u8); 77] = [
    ("", "", 0x0000, 0),
    ("control rate", "Hz", 0x0000, 0),
    ("dead time", "s", 0x0000, 0),
    ("torque constant", "Nm/A", 0x2101, 4),
    ("current limit", "A", 0x2101, 5),
    ("encoder's latency", "s", 0x2101, 9),
    ("gear ratio's magnitude", "", 0x2102, 1),
    ("joint's zero", "rad", 0x2102, 2),
    ("torque limit", "Nm", 0x2103, 1),
    ("velocity limit", "rad/s", 0x2103, 2),
    ("lowest position", "rad", 0x2103, 3),
    ("highest position", "rad", 0x2103, 4),
    ("margin beyond the position limits", "rad", 0x2103, 5),
    ("over-current limit", "A", 0x2103, 6),
    ("lowest supply voltage", "V", 0x2103, 7),
    ("highest supply voltage", "V", 0x2103, 8),
    ("bridge temperature limit", "°C", 0x2103, 9),
    ("winding temperature limit", "°C", 0x2103, 10),
    ("command deadline", "s", 0x2103, 11),
    ("stiffness", "Nm/rad", 0x2104, 3),
    ("damping", "Nm s/rad", 0x2104, 4),
    ("integral gain", "Nm/rad", 0x2104, 5),
    ("acceleration", "rad/s²", 0x2104, 6),
    ("quick-stop deceleration", "rad/s²", 0x2104, 7),
    ("braking time", "s", 0x2104, 8),
    ("compensation gain", "", 0x2200, 3),
    ("compensation clamp", "Nm", 0x2200, 4),
    ("compensation slew limit", "Nm/s", 0x2200, 5),
    ("standstill velocity", "rad/s", 0x2200, 10),
    ("current loop's bandwidth", "Hz", 0x2104, 1),
    ("phase resistance", "Ω", 0x2101, 1),
    ("inductance along d", "H", 0x2101, 2),
    ("inductance along q", "H", 0x2101, 3),
    ("flux linkage", "Wb", 0x2101, 4),
    ("highest voltage", "V", 0x2103, 8),
    ("observer's bandwidth", "Hz", 0x2104, 2),
    ("highest velocity", "rad/s", 0x2103, 2),
    ("highest acceleration", "rad/s²", 0x0000, 0),
    ("voltage fraction", "", 0x2104, 9),
    ("minimum duty", "", 0x0000, 0),
    ("maximum duty", "", 0x0000, 0),
    ("dead time in PWM periods", "", 0x0000, 0),
    ("dead-time compensation band", "A", 0x0000, 0),
    ("least supply voltage", "V", 0x2103, 7),
    ("duty range left by the dead time", "", 0x0000, 0),
    ("thermal model's rate", "Hz", 0x0000, 0),
    ("thermal resistance from winding to housing", "K/W", 0x2106, 3),
    ("thermal resistance from housing to ambient", "K/W", 0x2106, 4),
    ("winding's heat capacity", "J/K", 0x2106, 1),
    ("housing's heat capacity", "J/K", 0x2106, 2),
    ("ambient temperature", "°C", 0x2106, 5),
    ("sensor's correction time", "s", 0x0000, 0),
    ("warning temperature", "°C", 0x2103, 10),
    ("limit temperature", "°C", 0x2103, 10),
    ("start temperature", "°C", 0x0000, 0),
    ("rate of evaluations", "", 0x0000, 0),
    ("node id", "", 0x0000, 0),
    ("pole pairs", "", 0x2101, 6),
    ("encoder counts", "", 0x2101, 10),
    ("limit damping", "Nm s/rad", 0x2103, 12),
    ("regeneration band", "V", 0x2103, 13),
    ("loss current", "A", 0x2101, 12),
    ("field-weakening current", "A", 0x2101, 13),
    ("voltage induced where over-speed is a fault", "V", 0x2103, 2),
    ("oscillator trim", "", 0x2105, 1),
    ("friction uncertainty", "", 0x2200, 11),
    ("brake chopper's voltage", "V", 0x2103, 14),
    ("brake chopper's share of the time", "", 0x2103, 15),
    ("holding brake's release time", "s", 0x2109, 1),
    ("holding brake's apply time", "s", 0x2109, 2),
    ("inertia of the load", "kg m²", 0x2202, 2),
    ("gravity torque", "Nm", 0x2202, 3),
    ("hanging position", "rad", 0x2202, 4),
    ("payload's mass", "kg", 0x2202, 5),
    ("payload's arm", "m", 0x2202, 6),
    ("collision threshold", "Nm", 0x2203, 1),
    ("uncertainty of the load", "", 0x2203, 3),
];

/// The name of a setting. A board has its number only: texts and units are linked where somebody formats them, on a
/// host.
#[derive(Clone, Copy, Default, PartialEq, Eq)]
pub struct Name(u8);

impl Name {
    /// The name with this text and unit. While compiling: a text that is in no table does not compile.
    pub const fn of(text: &str, unit: &str) -> Self {
        let mut number = 0;
        while number < NAMES.len() {
            if same(NAMES[number].0, text) && same(NAMES[number].1, unit) {
                return Self(number as u8);
            }
            number += 1;
        }
        panic!("no such setting")
    }

    /// Text of the name; empty for none.
    pub fn text(self) -> &'static str {
        NAMES.get(usize::from(self.0)).map_or("", |(text, ..)| text)
    }

    /// Unit of its numbers; empty for a ratio.
    pub fn unit(self) -> &'static str {
        NAMES.get(usize::from(self.0)).map_or("", |(_, unit, ..)| unit)
    }

    /// Code as object 2100h:3 carries it: index of its object in bits 16 to 31, sub-index in bits 8 to 15, the name's
    /// number in bits 0 to 7.
    pub fn code(self) -> u32 {
        /// Objects of the names, without texts.
        static PLACES: [u16; NAMES.len()] = places();
        let place = PLACES.get(usize::from(self.0)).copied().unwrap_or(0);
        let index = if place == 0 { 0 } else { 0x2000 + u32::from(place >> SUB_INDEX_BITS) };
        index << 16 | u32::from(place & ((1 << SUB_INDEX_BITS) - 1)) << 8 | u32::from(self.0)
    }

    /// The name in such a code; one that is not known here is an empty one.
    pub const fn from_code(code: u32) -> Self {
        let number = code as u8;
        if (number as usize) < NAMES.len() { Self(number) } else { Self(0) }
    }
}

const SUB_INDEX_BITS: u16 = 4;

/// Index from 2000h on and sub-index of every name's object, in 14 bits.
const fn places() -> [u16; NAMES.len()] {
    let mut places = [0; NAMES.len()];
    let mut number = 0;
    while number < NAMES.len() {
        let (_, _, index, sub_index) = NAMES[number];
        if index != 0 {
            assert!(index >= 0x2000 && index < 0x2400 && sub_index < 1 << SUB_INDEX_BITS);
            places[number] = (index - 0x2000) << SUB_INDEX_BITS | sub_index as u16;
        }
        number += 1;
    }
    places
}

/// Returns `true` if two texts are the same, while compiling.
const fn same(a: &str, b: &str) -> bool {
    let (a, b) = (a.as_bytes(), b.as_bytes());
    let mut at = 0;
    while at < a.len() && at < b.len() && a[at] == b[at] {
        at += 1;
    }
    at == a.len() && at == b.len()
}

impl core::fmt::Debug for Name {
    fn fmt(&self, f: &mut core::fmt::Formatter) -> core::fmt::Result {
        f.write_str(self.text())
    }
}

impl PartialEq<&str> for Name {
    fn eq(&self, text: &&str) -> bool {
        self.text() == *text
    }
}

/// A setting beyond its range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SettingError {
    /// Name of the setting.
    pub name: Name,
    /// The refused value.
    pub value: f32,
    /// Least value that is possible here.
    pub low: f32,
    /// Greatest value that is possible here.
    pub high: f32,
}

impl core::fmt::Display for SettingError {
    fn fmt(&self, f: &mut core::fmt::Formatter) -> core::fmt::Result {
        let Self { name, value, low, high } = self;
        let (name, unit) = (name.text(), name.unit());
        let space = if unit.is_empty() { "" } else { " " };
        write!(f, "{name} is {value}{space}{unit}, must lie in {low} to {high}{space}{unit}")
    }
}

impl core::error::Error for SettingError {}

/// [`within_range`] for a setting that is named by its text and unit.
macro_rules! in_range {
    ($name:literal, $unit:literal, $value:expr, $low:expr, $high:expr $(,)?) => {
        crate::motor::setting::within_range(
            const { crate::motor::setting::Name::of($name, $unit) },
            $value,
            $low,
            $high,
        )
    };
}
pub(crate) use in_range;

/// The value, where it lies in `low..=high`. NaN never does. A function of its own: it is called some sixty times.
#[inline(never)]
pub(crate) fn within_range(name: Name, value: f32, low: f32, high: f32) -> Result<f32, SettingError> {
    if value >= low && value <= high { Ok(value) } else { Err(SettingError { name, value, low, high }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_message_says_what_was_wrong_and_what_is_possible() {
        let error = in_range!("phase resistance", "Ω", -1.0, 0.001, 100.0).unwrap_err();
        assert_eq!(error.to_string(), "phase resistance is -1 Ω, must lie in 0.001 to 100 Ω");
        let error = in_range!("compensation gain", "", 2.0, 0.0, 1.0).unwrap_err();
        assert_eq!(error.to_string(), "compensation gain is 2, must lie in 0 to 1");
    }

    #[test]
    fn nan_is_in_no_range() {
        assert!(in_range!("phase resistance", "Ω", f32::NAN, f32::NEG_INFINITY, f32::INFINITY).is_err());
    }

    #[test]
    fn every_name_comes_back_from_its_code_and_its_object_is_a_setting() {
        use crate::objects::field::Field;
        for (number, (text, unit, index, sub_index)) in NAMES.into_iter().enumerate() {
            let name = Name::of(text, unit);
            let code = name.code();
            assert_eq!(code, u32::from(index) << 16 | u32::from(sub_index) << 8 | number as u32, "{text}");
            assert_eq!((Name::from_code(code), Name::from_code(code).text()), (name, text));
            let object = crate::objects::table::find(index, sub_index);
            let setting = object.is_some_and(|o| matches!(o.field, Field::Setting(_) | Field::AtOnce(_)));
            assert!(index == 0 || setting, "{text}");
        }
        assert_eq!(Name::from_code(NAMES.len() as u32), Name::default());
        assert_eq!(Name::default().text(), "");
    }
}
