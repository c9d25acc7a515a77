//! Values of objects as people write and read them: in the table's unit, refused by name and limit; host.

use super::entry::Entry;
use super::error::RemoteError;
use joint_firmware::objects::table::DataType;

/// A value in the unit of its entry.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// BOOLEAN.
    Bool(bool),
    /// A whole number that has no scale.
    Integer(i128),
    /// A scaled number, or a REAL32.
    Real(f64),
    /// VISIBLE_STRING.
    Text(String),
    /// DOMAIN.
    Bytes(Vec<u8>),
}

impl Value {
    /// JSON value: bytes as an array of numbers; what JSON has no number for as null.
    #[must_use]
    pub fn json(&self) -> serde_json::Value {
        match self {
            Self::Bool(value) => (*value).into(),
            Self::Integer(value) => {
                i64::try_from(*value).map_or_else(|_| u64::try_from(*value).unwrap_or(u64::MAX).into(), Into::into)
            }
            // A REAL32 is told by as many digits as it has.
            Self::Real(value) => format!("{}", *value as f32).parse::<f64>().unwrap_or(*value).into(),
            Self::Text(text) => text.as_str().into(),
            Self::Bytes(bytes) => bytes.as_slice().into(),
        }
    }

    /// Number, where it is one.
    pub fn number(&self) -> Option<f64> {
        match self {
            Self::Bool(value) => Some(f64::from(u8::from(*value))),
            Self::Integer(value) => Some(*value as f64),
            Self::Real(value) => Some(*value),
            Self::Text(_) | Self::Bytes(_) => None,
        }
    }
}

/// Bits and sign of a type of whole numbers.
pub fn integer(data_type: DataType) -> Option<(u32, bool)> {
    Some(match data_type {
        DataType::I8 => (8, true),
        DataType::I16 => (16, true),
        DataType::I32 => (32, true),
        DataType::U8 => (8, false),
        DataType::U16 => (16, false),
        DataType::U32 => (32, false),
        DataType::U64 => (64, false),
        DataType::Bool | DataType::F32 | DataType::Text | DataType::Domain => return None,
    })
}

/// The whole number in the low `bits` of `raw`.
fn signed(raw: u64, bits: u32, signed: bool) -> i128 {
    let shift = 64 - bits;
    if signed { i128::from(((raw << shift) as i64) >> shift) } else { i128::from((raw << shift) >> shift) }
}

/// Least and greatest number of a type.
fn span(bits: u32, signed: bool) -> (i128, i128) {
    if signed { (-(1 << (bits - 1)), (1 << (bits - 1)) - 1) } else { (0, (1 << bits) - 1) }
}

impl Entry {
    /// Value of bytes of the bus; none where they are not as many as the type has.
    pub fn decode(&self, bytes: &[u8]) -> Option<Value> {
        let Some(length) = self.object.data_type.bytes() else {
            return Some(match self.object.data_type {
                DataType::Text => Value::Text(String::from_utf8_lossy(bytes).into_owned()),
                _ => Value::Bytes(bytes.to_vec()),
            });
        };
        if bytes.len() != usize::from(length) {
            return None;
        }
        let raw = bytes.iter().rev().fold(0u64, |raw, byte| raw << 8 | u64::from(*byte));
        Some(self.decode_raw(raw))
    }

    /// Value of the low bits of a PDO's content. The entry has a fixed length, as everything has that can be mapped.
    pub fn decode_raw(&self, raw: u64) -> Value {
        match (self.object.data_type, integer(self.object.data_type)) {
            (DataType::F32, _) => Value::Real(f32::from_bits(raw as u32).into()),
            (_, Some((bits, sign))) if self.text.scale == 1.0 => Value::Integer(signed(raw, bits, sign)),
            (_, Some((bits, sign))) => Value::Real(signed(raw, bits, sign) as f64 * self.text.scale),
            _ => Value::Bool(raw & 1 != 0),
        }
    }

    /// Value of what a person wrote.
    pub fn parse(&self, text: &str) -> Result<Value, RemoteError> {
        let text = text.trim();
        let wrong = |wanted: &str| self.refuse(format!("'{text}' is no {wanted}"));
        match self.object.data_type {
            DataType::Bool => match text {
                "0" | "false" => Ok(Value::Bool(false)),
                "1" | "true" => Ok(Value::Bool(true)),
                _ => Err(wrong("0 or 1")),
            },
            DataType::Text | DataType::Domain => Err(self.refuse("cannot be set from the command line".into())),
            DataType::F32 => text.parse().map(Value::Real).map_err(|_| wrong("number")),
            _ if self.text.scale == 1.0 => {
                let hexadecimal = text.strip_prefix("0x").or(text.strip_suffix('h'));
                let whole = match hexadecimal {
                    Some(digits) => i128::from_str_radix(digits, 16),
                    None => text.parse(),
                };
                whole.map(Value::Integer).map_err(|_| wrong("whole number"))
            }
            _ => text.parse().map(Value::Real).map_err(|_| wrong("number")),
        }
    }

    /// A value as it goes over the bus. What is outside the table's limits, or the type's, is refused.
    pub fn encode(&self, value: &Value) -> Result<Vec<u8>, RemoteError> {
        let kind = self.object.data_type;
        let length = usize::from(kind.bytes().unwrap_or(0));
        let Some(number) = value.number().filter(|_| length > 0) else {
            return match (value, kind) {
                (Value::Bytes(bytes), DataType::Domain) => Ok(bytes.clone()),
                _ => Err(self.refuse(format!("takes {}", kind.name()))),
            };
        };
        if !number.is_finite() {
            return Err(self.refuse(format!("{number} is no finite number")));
        }
        if let Some((low, high)) = self.text.limits
            && !(low..=high).contains(&number)
        {
            return Err(self.outside(number, low, high));
        }
        let bytes = match (value, integer(kind)) {
            (_, None) if kind == DataType::F32 => (number as f32).to_bits().to_le_bytes().to_vec(),
            (_, None) if number == 0.0 || number == 1.0 => vec![number as u8],
            (_, None) => return Err(self.outside(number, 0.0, 1.0)),
            (_, Some((bits, sign))) => {
                let scale = self.text.scale;
                let (low, high) = span(bits, sign);
                let raw = match value {
                    Value::Integer(whole) if scale == 1.0 => *whole,
                    _ if scale == 1.0 && number.fract() != 0.0 => {
                        return Err(self.refuse(format!("{number} is no whole number")));
                    }
                    _ => (number / scale).round() as i128,
                };
                if !(low..=high).contains(&raw) {
                    return Err(self.outside(number, low as f64 * scale, high as f64 * scale));
                }
                raw.to_le_bytes().to_vec()
            }
        };
        Ok(bytes.into_iter().take(length).collect())
    }

    /// A number as the raw value that comes nearest, held at the ends of the type: for set-points, which are limited by
    /// the joint. The entry is a whole number.
    pub fn saturate(&self, number: f64) -> u64 {
        let (low, high) = integer(self.object.data_type).map_or((0, 1), |(bits, sign)| span(bits, sign));
        let raw = (number / self.text.scale).round() as i128;
        raw.clamp(low, high) as u64
    }

    /// A value with its unit.
    pub fn show(&self, value: &Value) -> String {
        let unit = self.text.unit;
        let number = match value {
            Value::Bool(value) => return if *value { "yes".into() } else { "no".into() },
            Value::Text(text) => return text.clone(),
            Value::Bytes(bytes) => return format!("{} bytes", bytes.len()),
            Value::Real(_) if self.is_unknown(value) => return "not known".into(),
            Value::Integer(whole) if unit.is_empty() && *whole > 9 => format!("{whole} ({whole:X}h)"),
            Value::Integer(whole) => whole.to_string(),
            Value::Real(real) if self.object.data_type == DataType::F32 => (*real as f32).to_string(),
            Value::Real(real) => {
                let decimals = (-self.text.scale.log10()).ceil().max(0.0) as usize;
                format!("{real:.decimals$}")
            }
        };
        format!("{number} {unit}").trim_end().to_owned()
    }

    /// A temperature that nothing measures.
    pub fn is_unknown(&self, value: &Value) -> bool {
        let lowest = f64::from(i16::MIN) * self.text.scale;
        self.object.data_type == DataType::I16 && self.text.unit == "°C" && value.number() == Some(lowest)
    }

    fn refuse(&self, problem: String) -> RemoteError {
        RemoteError::Value { object: self.described(), problem }
    }

    fn outside(&self, number: f64, low: f64, high: f64) -> RemoteError {
        let unit = self.text.unit;
        let problem = format!("{number} {unit} is outside {low} to {high} {unit}");
        self.refuse(problem.split_whitespace().collect::<Vec<_>>().join(" "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(name: &str) -> Entry {
        Entry::one(name).unwrap()
    }

    fn refused(name: &str, text: &str) -> String {
        let entry = entry(name);
        entry.parse(text).and_then(|value| entry.encode(&value)).unwrap_err().to_string()
    }

    #[test]
    fn a_value_survives_the_way_to_the_bus_and_back_and_is_shown_with_its_unit() {
        for (name, text, bytes, shown) in [
            ("target-position", "-1.5", (-1_500_000i32).to_le_bytes().to_vec(), "-1.500000 rad"),
            ("target-velocity", "0.25", 250i32.to_le_bytes().to_vec(), "0.250 rad/s"),
            ("torque-limit", "12.5", 12.5f32.to_le_bytes().to_vec(), "12.5 Nm"),
            ("modes-of-operation", "-1", vec![0xFF], "-1"),
            ("controlword", "0x80", vec![0x80, 0], "128 (80h)"),
            ("pole-pairs", "7", vec![7, 0, 0, 0], "7"),
            ("producer-heartbeat-time", "0.1", vec![100, 0], "0.100 s"),
            ("electrical-zero", "0.25", (1u32 << 30).to_le_bytes().to_vec(), "0.2500000000 turns"),
            (
                "impedance-frame",
                "0x8000000000000001",
                vec![1, 0, 0, 0, 0, 0, 0, 0x80],
                "9223372036854775809 (8000000000000001h)",
            ),
        ] {
            let entry = entry(name);
            let value = entry.parse(text).unwrap();
            assert_eq!(entry.encode(&value).unwrap(), bytes, "{name}");
            assert_eq!(entry.show(&entry.decode(&bytes).unwrap()), shown, "{name}");
        }
        assert_eq!(
            entry("bridge-temperature").show(&entry("bridge-temperature").decode(&[0, 0x80]).unwrap()),
            "not known"
        );
        assert_eq!(entry("key-present").show(&Value::Bool(true)), "yes");
        assert_eq!(entry("statusword").decode(&[1]), None);
    }

    #[test]
    fn a_set_point_is_held_at_the_ends_of_its_type() {
        let torque = entry("target-torque");
        assert_eq!(
            [1.0, -0.5, 1e3, -1e3, f64::NAN].map(|part| torque.saturate(part) as i16),
            [1_000, -500, i16::MAX, i16::MIN, 0]
        );
        assert_eq!(entry("controlword").saturate(15.0), 15);
    }

    #[test]
    fn what_does_not_fit_is_refused_by_name_with_the_limit() {
        for (name, text, expected) in [
            ("torque-limit", "5000", "torque-limit (2103h:1): 5000 Nm is outside 0.01 to 2000 Nm"),
            ("torque-limit", "much", "torque-limit (2103h:1): 'much' is no number"),
            ("torque-limit", "nan", "no finite number"),
            ("pole-pairs", "0", "pole-pairs (2101h:6): 0 is outside 1 to 64"),
            ("pole-pairs", "1.5", "'1.5' is no whole number"),
            ("target-velocity", "3e6", "3000000 rad/s is outside -2147483.648 to 2147483.647 rad/s"),
            ("controlword", "65536", "65536 is outside 0 to 65535"),
            ("image-staging", "x", "cannot be set from the command line"),
        ] {
            let message = refused(name, text);
            assert!(message.contains(expected), "{message}");
        }
    }
}
