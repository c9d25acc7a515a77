//! The electronic data sheet of a joint, CiA 306-1; host.
//!
//! Unit, factor and description are no keys of CiA 306, and strict readers (Lely's dcfchk) refuse what they do not
//! know: they are comments. Limits are raw values, as the object has them on the bus. Those of REAL32 are comments,
//! too: Lely's tools want the bit pattern there, which python-canopen takes for a number.

use super::plain;
use crate::remote::Entry;
use canopen_node::{Access, CommunicationParameters, PDOS, PdoParameters};
use joint_firmware::objects::Operation;
use joint_firmware::objects::default_communication;
use joint_firmware::objects::field::{Constant, Field};
use joint_firmware::objects::table::{DataType, wants_room};
use std::fmt::Write;
use std::time::Duration;
use time::UtcDateTime;

/// Object types of CiA 306.
const DOMAIN: u8 = 2;
const VARIABLE: u8 = 7;
const RECORD: u8 = 9;

/// Reason for which a file has no vendor.
const NO_VENDOR: &str = "VendorNumber: joints answer 0 (1018h:1), as this project has no vendor ID of CiA";
/// Reason for which a file that was made without a joint has no product.
const ANY_PRODUCT: &str =
    "ProductNumber, RevisionNumber: 0 is any; each board has its own, which --bus BUS --node N reads (1018h:2, 3)";

/// Identity of a joint, as its object 1018h says; of a joint that is not known everything is 0, which masters take for
/// any.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Identity {
    /// 1018h:1.
    pub vendor: u32,
    /// 1018h:2.
    pub product: u32,
    /// 1018h:3.
    pub revision: u32,
    /// 6502h of a joint that is known.
    pub modes: Option<u32>,
}

impl Identity {
    /// The objects that the joint has. Of a record that it does not have sub-index 0 is not there either.
    fn entries(&self) -> Vec<Entry> {
        let all = Entry::all().collect::<Vec<_>>();
        let has = |entry: &Entry| self.modes.is_none_or(Operation::has_profiles) || !wants_room(entry.object);
        let contents = |index| all.iter().filter(move |entry| entry.object.index == index && entry.is_content());
        let there = |entry: &&Entry| has(entry) && contents(entry.object.index).any(has);
        all.iter().filter(there).copied().collect()
    }
}

/// The file's content. `name` is that of the file, `now` the time since 1970-01-01 UTC for the file's dates; `identity`
/// is of the joint that the file is for.
pub fn text(name: &str, now: Duration, identity: Identity) -> String {
    let mut text = String::new();
    // Writing to a string does not fail.
    let _ = write(&mut text, name, now, identity);
    text
}

fn write(text: &mut String, name: &str, now: Duration, identity: Identity) -> std::fmt::Result {
    let now = i64::try_from(now.as_secs()).ok().and_then(|now| UtcDateTime::from_unix_timestamp(now).ok());
    let now = now.unwrap_or(UtcDateTime::UNIX_EPOCH);
    let (date, time) = (date(now), time(now));
    writeln!(text, "[FileInfo]\nFileName={}\nFileVersion=1\nFileRevision=0\nEDSVersion=4.0", plain(name))?;
    writeln!(text, "Description=Robot joint with learned friction compensation, CiA 402 subset")?;
    for what in ["Creation", "Modification"] {
        writeln!(text, "{what}Time={time}\n{what}Date={date}")?;
    }
    let program = concat!("jointctl ", env!("CARGO_PKG_VERSION"));
    writeln!(text, "CreatedBy={program}\nModifiedBy={program}\n")?;

    let Identity { vendor, product, revision, .. } = identity;
    writeln!(text, "[DeviceInfo]")?;
    if vendor == 0 {
        writeln!(text, ";{NO_VENDOR}")?;
    }
    if product == 0 && revision == 0 {
        writeln!(text, ";{ANY_PRODUCT}")?;
    }
    writeln!(text, "VendorName=\nVendorNumber=0x{vendor:X}\nProductName=joint")?;
    writeln!(text, "ProductNumber=0x{product:X}\nRevisionNumber=0x{revision:X}\nOrderCode=")?;
    for rate in [10, 20, 50, 125, 250, 500, 800, 1000] {
        writeln!(text, "BaudRate_{rate}={}", u8::from(rate == 1000))?;
    }
    writeln!(text, "SimpleBootUpMaster=0\nSimpleBootUpSlave=1\nGranularity=8\nDynamicChannelsSupported=0")?;
    writeln!(text, "CompactPDO=0\nGroupMessaging=0\nNrOfRXPDO={PDOS}\nNrOfTXPDO={PDOS}\nLSS_Supported=1\n")?;
    writeln!(text, "[DummyUsage]")?;
    for dummy in 1..=7 {
        // Every whole number can be skipped in an RPDO; a BOOLEAN, of one bit, cannot.
        writeln!(text, "Dummy{dummy:04}={}", u8::from(dummy != 1))?;
    }
    writeln!(text)?;

    let entries = identity.entries();
    let mut indices = entries.iter().map(|entry| entry.object.index).collect::<Vec<_>>();
    indices.dedup();
    let is_mandatory = |index: &u16| matches!(*index, 0x1000 | 0x1001 | 0x1018);
    let is_manufacturers = |index: &u16| (0x2000..0x6000).contains(index);
    list(text, "MandatoryObjects", indices.iter().copied().filter(is_mandatory))?;
    let is_optional = |index: &u16| !is_mandatory(index) && !is_manufacturers(index);
    list(text, "OptionalObjects", indices.iter().copied().filter(is_optional))?;
    list(text, "ManufacturerObjects", indices.iter().copied().filter(is_manufacturers))?;

    let defaults = default_communication(0);
    for index in indices {
        let of_index = entries.iter().filter(|entry| entry.object.index == index).collect::<Vec<_>>();
        match of_index[..] {
            [] => {}
            [entry] => object(text, &format!("{index:04X}"), entry.text.object, entry, &defaults, identity)?,
            [first, ..] => {
                writeln!(text, "[{index:04X}]\nParameterName={}", plain(first.text.object))?;
                writeln!(text, "ObjectType=0x{RECORD:X}\nSubNumber=0x{:X}\n", of_index.len())?;
                for entry in of_index {
                    object(
                        text,
                        &format!("{index:04X}sub{:X}", entry.object.sub_index),
                        entry.text.name,
                        entry,
                        &defaults,
                        identity,
                    )?;
                }
            }
        }
    }
    Ok(())
}

fn list(text: &mut String, title: &str, indices: impl Iterator<Item = u16>) -> std::fmt::Result {
    let indices = indices.collect::<Vec<_>>();
    writeln!(text, "[{title}]\nSupportedObjects={}", indices.len())?;
    for (index, number) in indices.iter().zip(1..) {
        writeln!(text, "{number}=0x{index:04X}")?;
    }
    writeln!(text)
}

fn object(
    text: &mut String,
    section: &str,
    name: &str,
    entry: &Entry,
    defaults: &CommunicationParameters,
    identity: Identity,
) -> std::fmt::Result {
    let object = entry.object;
    let object_type = if object.data_type == DataType::Domain { DOMAIN } else { VARIABLE };
    let constant = matches!(object.field, Field::Constant(_) | Field::Highest(_));
    // CiA 306: a value that may be written both ways says which PDO it may be part of.
    let access = match (object.access, object.mappable.receive, object.mappable.transmit) {
        (Access::ReadOnly, ..) if constant && !object.mappable.transmit => "const",
        (Access::ReadOnly, ..) => "ro",
        (Access::WriteOnly, ..) => "wo",
        (Access::ReadWrite, true, false) => "rww",
        (Access::ReadWrite, false, true) => "rwr",
        (Access::ReadWrite, ..) => "rw",
    };
    let mapped = u8::from(object.mappable.receive || object.mappable.transmit);
    writeln!(text, "[{section}]\nParameterName={}\nObjectType=0x{object_type:X}", plain(name))?;
    writeln!(text, "DataType=0x{:04X}\nAccessType={access}", object.data_type as u8)?;
    // CiA 306 knows the key for variables alone, and node-canopen refuses it elsewhere.
    if object_type == VARIABLE {
        writeln!(text, "PDOMapping={mapped}")?;
    }
    if let Some(default) = default(entry, defaults, identity) {
        writeln!(text, "DefaultValue={default}")?;
    }
    if let Some((low, high)) = entry.text.limits {
        let raw = |value: f64| match object.data_type {
            DataType::F32 => value.to_string(),
            _ => format!("{:.0}", value / entry.text.scale),
        };
        let comment = if object.data_type == DataType::F32 { ";" } else { "" };
        writeln!(text, "{comment}LowLimit={}\n{comment}HighLimit={}", raw(low), raw(high))?;
    }
    if !entry.text.unit.is_empty() {
        writeln!(text, ";Unit={}", plain(entry.text.unit))?;
    }
    if entry.text.scale != 1.0 {
        writeln!(text, ";Factor={:e}", entry.text.scale)?;
    }
    if !entry.text.description.is_empty() {
        writeln!(text, ";Description={}", plain(entry.text.description))?;
    }
    writeln!(text)
}

/// Value in a joint that nobody has set up; none where that is a matter of the joint.
fn default(entry: &Entry, defaults: &CommunicationParameters, identity: Identity) -> Option<String> {
    let object = entry.object;
    // Parameters were made for node id 0: what depends on it is said as CiA 306 does.
    let by_node = |cob_id: u32| Some(format!("$NODEID+0x{cob_id:X}"));
    let number = |number: u32| Some(format!("0x{number:X}"));
    match (object.field, object.index, object.sub_index) {
        (Field::Constant(constant @ Constant::SupportedModes), ..) => {
            Some(identity.modes.map_or(constant.number().to_string(), |modes| modes.to_string()))
        }
        (Field::Highest(highest), ..) => number(highest.into()),
        (Field::Server, 0x1000, 0) => number(crate::remote::joint::DEVICE_TYPE),
        (Field::Server, 0x1005, 0) => number(defaults.sync_cob_id),
        (Field::Server, 0x1014, 0) => by_node(defaults.emergency_cob_id),
        (Field::Server, 0x1015, 0) => number(defaults.emergency_inhibit.into()),
        (Field::Server, 0x1016, 1..) => number(0),
        (Field::Server, 0x1017, 0) => number(defaults.heartbeat.into()),
        (Field::Server, 0x1018, 1..=3) if identity == Identity::default() => None,
        (Field::Server, 0x1018, 1) => number(identity.vendor),
        (Field::Server, 0x1018, 2) => number(identity.product),
        (Field::Server, 0x1018, 3) => number(identity.revision),
        (Field::Server, 0x1019, 0) | (Field::Server, 0x1020, 1..) => number(0),
        (Field::Server, 0x1029, 1) => number(defaults.error_behaviour.into()),
        (Field::Server, 0x1200, 1) => by_node(0x600),
        (Field::Server, 0x1200, 2) => by_node(0x580),
        (Field::Server, 0x1400..=0x15FF | 0x1800..=0x19FF, sub_index @ 1..) => {
            let parameters = pdo(object.index, defaults)?;
            match sub_index {
                1 => by_node(parameters.cob_id),
                2 => number(parameters.transmission.into()),
                3 => number(parameters.inhibit.into()),
                6 => number(parameters.sync_start.into()),
                _ => number(parameters.event_timer.into()),
            }
        }
        (Field::Server, 0x1600..=0x17FF | 0x1A00..=0x1BFF, 0) => number(pdo(object.index, defaults)?.count.into()),
        (Field::Server, 0x1600..=0x17FF | 0x1A00..=0x1BFF, sub_index) => {
            number(pdo(object.index, defaults)?.mapping.get(usize::from(sub_index) - 1)?.0)
        }
        // The number of entries that CiA 301 calls highest sub-index supported; that of 1003h counts errors.
        (Field::Server, 0x1003, 0) => number(0),
        (Field::Server, index, 0) if entry.text.description.is_empty() => {
            let of_index = identity.entries().into_iter().filter(|other| other.object.index == index);
            number(of_index.map(|other| other.object.sub_index).max()?.into())
        }
        _ => None,
    }
}

fn pdo(index: u16, defaults: &CommunicationParameters) -> Option<&PdoParameters> {
    let all = if index < 0x1800 { &defaults.receive } else { &defaults.transmit };
    all.get(usize::from(index & 0x1FF))
}

/// mm-dd-yyyy, as CiA 306 writes it.
fn date(now: UtcDateTime) -> String {
    format!("{:02}-{:02}-{:04}", u8::from(now.month()), now.day(), now.year())
}

/// hh:mmAM, as CiA 306 writes it.
fn time(now: UtcDateTime) -> String {
    let half = if now.hour() < 12 { "AM" } else { "PM" };
    format!("{:02}:{:02}{half}", (now.hour() + 11) % 12 + 1, now.minute())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_moment_is_written_as_the_standard_wants_it() {
        let at = |seconds| {
            let now = UtcDateTime::from_unix_timestamp(seconds).unwrap();
            (date(now), time(now))
        };
        assert_eq!(at(0), ("01-01-1970".into(), "12:00AM".into()));
        assert_eq!(at(951_827_696), ("02-29-2000".into(), "12:34PM".into()));
        assert_eq!(at(1_700_000_000), ("11-14-2023".into(), "10:13PM".into()));
    }

    #[test]
    fn the_file_is_ascii_and_has_a_section_for_every_entry() {
        let identity = Identity { vendor: 0, product: 0x564A_6E74, revision: 1, modes: None };
        let text = text("joint.eds", Duration::ZERO, identity);
        assert!(text.is_ascii());
        assert!(text.contains("\nVendorNumber=0x0\nProductName=joint\nProductNumber=0x564A6E74\nRevisionNumber=0x1\n"));
        assert!(text.contains(NO_VENDOR) && !text.contains(ANY_PRODUCT));
        for entry in Entry::all() {
            let (index, sub_index) = (entry.object.index, entry.object.sub_index);
            let section = format!("\n[{index:04X}sub{sub_index:X}]\n");
            assert!(text.contains(&section) || text.contains(&format!("\n[{index:04X}]\n")), "{section}");
        }
        let of = |section: &str| {
            let (_, rest) = text.split_once(&format!("[{section}]\n")).unwrap();
            rest.split_once("\n\n").unwrap().0.to_owned()
        };
        assert!(of("1A00sub3").contains("DefaultValue=0x60640020"), "{}", of("1A00sub3"));
        assert!(of("1403sub1").contains("DefaultValue=$NODEID+0x80000500"), "{}", of("1403sub1"));
        assert!(of("2212sub7").contains("LowLimit=1\nHighLimit=3600000\n;Unit=s\n;Factor=1e-3"), "{}", of("2212sub7"));
        assert!(of("2103subB").contains("\n;LowLimit=0.001\n;HighLimit=10\n"), "{}", of("2103subB"));
        assert!(!of("2210").contains("PDOMapping"), "{}", of("2210"));
        assert!(of("1018sub2").contains("DefaultValue=0x564A6E74"), "{}", of("1018sub2"));
        assert!(of("6502").contains(&format!("DefaultValue={}\n", Operation::SUPPORTED)), "{}", of("6502"));
        assert!(of("6060").contains("AccessType=rww\nPDOMapping=1\nLowLimit=-2\nHighLimit=10"), "{}", of("6060"));
    }

    #[test]
    fn a_file_for_any_joint_says_why_it_has_no_identity() {
        let of = |identity| text("joint.eds", Duration::ZERO, identity);
        let any = of(Identity::default());
        assert!(any.contains(&format!(";{NO_VENDOR}\n;{ANY_PRODUCT}\nVendorName=\nVendorNumber=0x0\n")), "{any}");
        assert!(any.contains("\nProductNumber=0x0\nRevisionNumber=0x0\n") && any.is_ascii());
        let known = of(Identity { vendor: 0x0123, product: 4, revision: 5, modes: None });
        assert!(!known.contains(NO_VENDOR) && !known.contains(ANY_PRODUCT));
    }

    #[test]
    fn a_joint_without_profile_modes_has_none_of_their_objects() {
        let without = Identity { modes: Some(0x0003_0380), ..Identity::default() };
        let [with, without] =
            [Identity::default(), without].map(|identity| text("joint.eds", Duration::ZERO, identity));
        let sections = |text: &str| text.lines().filter(|line| line.starts_with('[')).count();
        let room = Entry::all().filter(|entry| wants_room(entry.object)).count();
        // Seven records more, and sub-index 0 of three of them: those of 1020h, 2022h, 2203h and 2305h are among those.
        assert_eq!(sections(&with) - sections(&without), room + 7 + 3 + 1);
        assert!(with.contains("[1801sub0]\nParameterName=highest sub-index supported\nObjectType=0x7\nDataType=0x0005\nAccessType=ro\nPDOMapping=0\nDefaultValue=0x6"));
        assert!(without.contains("[1801sub0]\nParameterName=highest sub-index supported\nObjectType=0x7\nDataType=0x0005\nAccessType=ro\nPDOMapping=0\nDefaultValue=0x5"));
        for index in ["2202sub5", "6081", "607Dsub0", "6099sub2", "60F4", "6072", "1019", "1020sub2", "1803sub6"] {
            assert!(
                with.contains(&format!("\n[{index}]\n")) && !without.contains(&format!("\n[{index}]\n")),
                "{index}"
            );
        }
        assert!(!without.contains("=0x6081\n") && without.contains("=0x607A\n"));
        assert!(without.contains("DefaultValue=197504\n"), "6502h");
    }
}
