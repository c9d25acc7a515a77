//! Objects by the names that the one table gives them; host.
//!
//! A name is what docs/objects.md says, small, with dashes for blanks: `torque-limit`. Where several objects share it,
//! the record goes before it: `image-life-cycle.command`. An index does as well: `2103:1`, `2103h:1`, `0x2103:1`.

use super::error::RemoteError;
use canopen_node::Access;
use joint_firmware::objects::field::Field;
use joint_firmware::objects::settings::Setting;
use joint_firmware::objects::table::{Object, Text, communication, described};

/// Suggestions for a name that does not exist.
const SUGGESTIONS: usize = 3;

/// An entry of the object dictionary, with what people are told of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    /// Index, type, access.
    pub object: &'static Object,
    /// Name, unit, limits.
    pub text: &'static Text,
}

impl Entry {
    /// All entries, sorted by index and sub-index.
    pub fn all() -> impl Iterator<Item = Self> {
        communication().chain(described()).map(|(object, text)| Self { object, text })
    }

    /// The entry at an index and a sub-index.
    pub fn at(index: u16, sub_index: u8) -> Option<Self> {
        Self::all().find(|entry| (entry.object.index, entry.object.sub_index) == (index, sub_index))
    }

    /// The entry that is about `field`.
    ///
    /// # Panics
    /// For the fields that have many objects: [`Field::Server`], [`Field::Highest`] of a length that no record has.
    pub fn of(field: Field) -> Self {
        let found = Self::all().find(|entry| entry.object.field == field);
        found.unwrap_or_else(|| unreachable!("{field:?} has no object in the table"))
    }

    /// The entry of a setting, whether it is staged or acts at once.
    ///
    /// # Panics
    /// For a setting that has no object of its own.
    pub fn of_setting(setting: Setting) -> Self {
        let found = Self::all()
            .find(|entry| matches!(entry.object.field, Field::Setting(own) | Field::AtOnce(own) if own == setting));
        found.unwrap_or_else(|| unreachable!("{setting:?} has no object in the table"))
    }

    /// The entries that a person means: one, or all of a record but its sub-index 0.
    pub fn find(name: &str) -> Result<Vec<Self>, RemoteError> {
        let found = match number(name) {
            Some((index, Some(sub_index))) => Self::all()
                .filter(|entry| (entry.object.index, entry.object.sub_index) == (index, sub_index))
                .collect::<Vec<_>>(),
            Some((index, None)) => {
                Self::all().filter(|entry| entry.object.index == index && entry.is_content()).collect()
            }
            None => return Self::named(name),
        };
        if found.is_empty() { Err(unknown(name)) } else { Ok(found) }
    }

    /// The one entry that a person means.
    pub fn one(name: &str) -> Result<Self, RemoteError> {
        match Self::find(name)?.as_slice() {
            [entry] => Ok(*entry),
            several => {
                let names = several.iter().map(Self::name).collect();
                Err(RemoteError::Record { name: name.into(), names })
            }
        }
    }

    fn named(name: &str) -> Result<Vec<Self>, RemoteError> {
        let wanted = name.split('.').map(slug).collect::<Vec<_>>().join(".");
        let contents = || Self::all().filter(Self::is_content);
        let record = contents().filter(|entry| slug(entry.text.object) == wanted).collect::<Vec<_>>();
        let entries = contents()
            .filter(|entry| entry.full_name() == wanted || slug(entry.text.name) == wanted)
            .collect::<Vec<_>>();
        match (record.as_slice(), entries.as_slice()) {
            // "device type" is both; "gear ratio" an entry alone, "gear" a record alone.
            (_, [_]) => Ok(entries),
            ([], []) => Err(unknown(name)),
            (_, []) => Ok(record),
            (_, several) => {
                let names = several.iter().map(Self::full_name).collect();
                Err(RemoteError::AmbiguousName { name: name.into(), names })
            }
        }
    }

    /// Returns `true` if it carries something beside the number of a record's entries.
    pub fn is_content(&self) -> bool {
        !self.text.description.is_empty()
    }

    /// Returns `true` if it can be read.
    pub fn is_readable(&self) -> bool {
        self.object.access != Access::WriteOnly
    }

    /// The shortest name that is this entry's alone.
    pub fn name(&self) -> String {
        let own = slug(self.text.name);
        let namesakes = Self::all().filter(|entry| entry.is_content() && slug(entry.text.name) == own).count();
        if namesakes == 1 { own } else { self.full_name() }
    }

    /// Record and entry; the name alone where there is no record.
    pub fn full_name(&self) -> String {
        let own = slug(self.text.name);
        if self.object.sub_index == 0 && self.is_content() { own } else { format!("{}.{own}", slug(self.text.object)) }
    }

    /// Index and sub-index, as `2103h:1`.
    pub fn place(&self) -> String {
        format!("{:04X}h:{}", self.object.index, self.object.sub_index)
    }

    fn access(&self) -> &'static str {
        match self.object.access {
            Access::ReadOnly => "ro",
            Access::WriteOnly => "wo",
            Access::ReadWrite => "rw",
        }
    }

    /// JSON object of what [`Self::listed`] tells.
    pub fn json(&self) -> serde_json::Value {
        let limits = self.text.limits.map(|(low, high)| [low, high]);
        serde_json::json!({
            "name": self.name(),
            "object": self.place(),
            "type": self.object.data_type.name(),
            "access": self.access(),
            "limits": limits,
            "unit": self.text.unit,
        })
    }

    /// A line of a list: name, place, type, access, unit, limits.
    pub fn listed(&self) -> String {
        let access = self.access();
        let limits = self.text.limits.map_or(String::new(), |(low, high)| format!("{low} to {high} "));
        let (name, place, kind) = (self.name(), self.place(), self.object.data_type.name());
        let line = format!("{name:<52} {place:<9} {kind:<14} {access}  {limits}{}", self.text.unit);
        line.trim_end().to_owned()
    }

    /// Name and place, for messages.
    pub fn described(&self) -> String {
        format!("{} ({})", self.name(), self.place())
    }
}

/// A name as people type it: small letters, digits, dashes.
pub fn slug(name: &str) -> String {
    let mut slug = String::new();
    for character in name.chars().filter(|character| *character != '\'') {
        if character.is_alphanumeric() {
            slug.extend(character.to_lowercase());
        } else if !slug.is_empty() && !slug.ends_with('-') {
            slug.push('-');
        }
    }
    slug.trim_end_matches('-').to_owned()
}

/// An index of four hexadecimal digits, and a sub-index where there is one.
fn number(name: &str) -> Option<(u16, Option<u8>)> {
    let (index, sub_index) = match name.split_once(':') {
        Some((index, sub_index)) => (index, Some(sub_index)),
        None => (name, None),
    };
    let digits = index.strip_prefix("0x").or(index.strip_prefix("0X")).unwrap_or(index);
    let digits = digits.strip_suffix(['h', 'H']).unwrap_or(digits);
    let whole = digits.len() == 4 && digits.bytes().all(|digit| digit.is_ascii_hexdigit());
    let index = u16::from_str_radix(digits, 16).ok().filter(|_| whole)?;
    match sub_index {
        None => Some((index, None)),
        Some(text) => Some((index, Some(text.parse().ok()?))),
    }
}

/// The names that are most like one that does not exist.
fn unknown(name: &str) -> RemoteError {
    let wanted = name.split('.').map(slug).collect::<Vec<_>>().join(".");
    let likeness = |candidate: &str| {
        let contained = !wanted.is_empty() && candidate.contains(&wanted);
        strsim::jaro_winkler(candidate, &wanted) + if contained { 1.0 } else { 0.0 }
    };
    let mut candidates = Vec::new();
    for entry in Entry::all().filter(Entry::is_content) {
        let own = slug(entry.text.name);
        let best =
            [own, entry.full_name(), slug(entry.text.object)].iter().map(|name| likeness(name)).fold(0.0, f64::max);
        if best > 0.8 {
            candidates.push((best, entry.name()));
        }
    }
    // The sort is stable: of those alike, the first of the table.
    candidates.sort_by(|a, b| b.0.total_cmp(&a.0));
    let near = candidates.into_iter().map(|(_, name)| name).take(SUGGESTIONS).collect();
    RemoteError::UnknownName { name: name.into(), near }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_entry_is_found_by_each_of_its_names_and_by_its_place() {
        for entry in Entry::all().filter(Entry::is_content) {
            for name in [entry.place(), format!("0x{:04x}:{}", entry.object.index, entry.object.sub_index)] {
                assert_eq!(Entry::one(&name).unwrap(), entry, "{name}");
            }
            // The PDOs' mapping entries have their number in the record's name.
            assert_eq!(Entry::one(&entry.name()).unwrap(), entry, "{}", entry.name());
            assert_eq!(Entry::one(&entry.full_name()).unwrap(), entry, "{}", entry.full_name());
        }
    }

    #[test]
    fn names_are_taken_as_people_write_them() {
        for name in
            ["torque-limit", "Torque limit", "torque_limit", "limits.torque-limit", "2103:1", "2103h:1", "0x2103:1"]
        {
            assert_eq!(Entry::one(name).unwrap().place(), "2103h:1", "{name}");
        }
        assert_eq!(Entry::one("joint's zero").unwrap().place(), "2102h:2");
        assert_eq!(Entry::one("6064").unwrap().place(), "6064h:0");
        assert_eq!(Entry::find("gear").unwrap().len(), 2);
        assert_eq!(Entry::find("2104").unwrap().len(), 9);
    }

    #[test]
    fn a_wrong_name_is_answered_with_near_ones_and_a_shared_one_with_its_owners() {
        let message = |name: &str| Entry::one(name).unwrap_err().to_string();
        assert!(message("torque-limt").contains("did you mean torque-limit"), "{}", message("torque-limt"));
        assert!(message("postion").contains("position"), "{}", message("postion"));
        assert!(message("voltage").contains("bus-voltage"), "{}", message("voltage"));
        assert!(message("xyzzy").contains("--list"), "{}", message("xyzzy"));
        let shared = message("command");
        assert!(shared.contains("configuration.command") && shared.contains("image-life-cycle.command"), "{shared}");
        assert!(message("2103").contains("velocity-limit"), "{}", message("2103"));
        assert!(message("2103:77").contains("is no object"), "{}", message("2103:77"));
        assert!(message("6042").contains("is no object"), "{}", message("6042"));
    }
}
