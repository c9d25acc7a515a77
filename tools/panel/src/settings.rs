//! A joint's objects by name, and its configuration as joint.toml; host.

use crate::message::With;
use canopen_node::{Access, Group};
use joint_firmware::default_configuration::{BOARDS, MOTEUS_R4};
use joint_firmware::joint::BoardLimits;
use joint_firmware::joint::configuration::{BridgeConfiguration, Configuration};
use joint_firmware::objects::field::Field;
use joint_firmware::objects::settings::Setting;
use joint_firmware::objects::table::DataType;
use jointctl::joint_text;
use jointctl::remote::{Entry, RemoteError, RemoteJoint, configuration};
use serde_json::{Value, json};
use std::path::Path;

/// Ends what takes long, with a word about it.
const STOPPED: &str = "stopped before it was complete";

/// Returns `true` if an object is a number that a person may look at.
fn is_shown(entry: &Entry) -> bool {
    entry.is_content() && !matches!(entry.object.data_type, DataType::Domain)
}

/// Objects of the joint's own part (2000h on) that are numbers or text, with their values; what the joint does not have
/// is left out. `over` ends it.
///
/// # Errors
/// The bus, no answer, or `over`.
pub fn objects(joint: &RemoteJoint, over: &dyn Fn() -> bool) -> Result<Value, String> {
    let mut list = Vec::new();
    for entry in Entry::all().filter(|entry| entry.object.index >= 0x2000 && is_shown(entry)) {
        if over() {
            return Err(STOPPED.into());
        }
        let value = match entry.is_readable() {
            true => match joint.read(entry) {
                Ok(value) => Some(value),
                Err(error) if error.is_absent() => continue,
                Err(error) => return Err(error.to_string()),
            },
            false => None,
        };
        let mut object = entry.json();
        object["record"] = entry.text.object.into();
        object["text"] = entry.text.description.into();
        object["value"] = value.as_ref().map_or(Value::Null, jointctl::remote::Value::json);
        object["shown"] = value.as_ref().map_or(String::new(), |value| entry.show(value)).into();
        object["setting"] = setting_of(&entry).is_some().into();
        object["writable"] = (entry.object.access != Access::ReadOnly).into();
        list.push(object);
    }
    Ok(list.into())
}

/// Sets objects by name. Settings among them are taken together, or none is. The values that the joint then has.
///
/// # Errors
/// Name, value or limit, in words.
pub fn set(joint: &RemoteJoint, values: &[(String, String)]) -> Result<Value, RemoteError> {
    let mut wanted = Vec::new();
    for (name, text) in values {
        let entry = Entry::one(name)?;
        wanted.push((entry, entry.parse(text)?));
    }
    configuration::set(joint, &wanted)?;
    let mut list = Vec::new();
    for (entry, _) in wanted.iter().filter(|(entry, _)| entry.is_readable()) {
        let value = joint.read(*entry)?;
        list.push(json!({ "name": entry.name(), "value": value.json(), "shown": entry.show(&value) }));
    }
    Ok(list.into())
}

/// Keeps what is in use.
///
/// # Errors
/// The joint's refusal.
pub fn store(joint: &RemoteJoint) -> Result<Value, RemoteError> {
    configuration::store(joint, Group::All)?;
    Ok("stored".into())
}

fn setting_of(entry: &Entry) -> Option<Setting> {
    match entry.object.field {
        Field::Setting(setting) | Field::AtOnce(setting) => Some(setting),
        _ => None,
    }
}

/// Objects of the settings, and the numbers in them; those that the joint does not have are left out.
fn settings(joint: &RemoteJoint, over: &dyn Fn() -> bool) -> Result<Vec<(Entry, Setting, u32)>, String> {
    let mut list = Vec::new();
    for entry in Entry::all() {
        let Some(setting) = setting_of(&entry) else { continue };
        if over() {
            return Err(STOPPED.into());
        }
        match joint.raw(entry.object.field) {
            Ok(raw) => list.push((entry, setting, raw as u32)),
            Err(error) if error.is_absent() => {}
            Err(error) => return Err(error.to_string()),
        }
    }
    Ok(list)
}

/// The joint's configuration. Settings that it has no object for are those of a new moteus r4, which are all off.
fn read(joint: &RemoteJoint, over: &dyn Fn() -> bool) -> Result<Configuration, String> {
    let mut configuration = Configuration { node_id: joint.id(), ..MOTEUS_R4.joint };
    for (entry, setting, raw) in settings(joint, over)? {
        if !setting.set(&mut configuration, raw) {
            return Err(format!("{}: {raw} stands for nothing that this program knows", entry.described()));
        }
    }
    Ok(configuration)
}

/// The configuration in use as joint.toml.
///
/// # Errors
/// The bus, no answer, or `over`.
pub fn export(joint: &RemoteJoint, over: &dyn Fn() -> bool) -> Result<String, String> {
    joint_text::to_text(&read(joint, over)?).map_err(|error| error.to_string())
}

/// A board that bears everything: limits of the board are the joint's to check.
fn any_board() -> BridgeConfiguration {
    let limits = BoardLimits {
        supply: 100.0,
        over_current: 500.0,
        current: 200.0,
        bridge_temperature: 150.0,
        command_deadline: 10.0,
        current_range: (-1e3, 1e3),
        supply_end: 100.0,
    };
    BridgeConfiguration { limits, has_chopper_output: true, ..MOTEUS_R4.bridge }
}

/// Settings in which the joint's configuration is not `wanted`, with the values there. The node id stays.
fn differences(
    joint: &RemoteJoint,
    wanted: &Configuration,
    over: &dyn Fn() -> bool,
) -> Result<Vec<(Entry, jointctl::remote::Value)>, String> {
    let differs = |(entry, setting, raw): (Entry, Setting, u32)| {
        let number = setting.get(wanted);
        (number != raw).then(|| (entry, entry.decode_raw(number.into())))
    };
    Ok(settings(joint, over)?.into_iter().filter_map(differs).collect())
}

fn parsed(text: &str) -> Result<Configuration, String> {
    joint_text::from_text(text, Path::new("joint.toml"), &any_board()).map_err(|error| error.to_string())
}

/// Names of the boards that a joint can be compared with.
#[must_use]
pub fn boards() -> [&'static str; BOARDS.len()] {
    BOARDS.map(|(name, _)| name)
}

/// Names what differs, with the values of the other configuration. Nothing is set.
///
/// # Errors
/// Line and reason of the file, a board that is none, the bus, or no answer.
pub fn compare(joint: &RemoteJoint, with: &With, over: &dyn Fn() -> bool) -> Result<Value, String> {
    let wanted = match with {
        With::File(text) => parsed(text)?,
        With::Board(name) => {
            let board = BOARDS.iter().find(|(known, _)| known == name);
            board.ok_or_else(|| format!("'{name}' is no board; there are {}", boards().join(" and ")))?.1.joint
        }
    };
    let told = |(entry, value): (Entry, jointctl::remote::Value)| json!({ "name": entry.name(), "value": value.json(), "shown": entry.show(&value) });
    Ok(differences(joint, &wanted, over)?.into_iter().map(told).collect())
}

/// Sets what differs from the joint's configuration in a joint.toml, all of it or nothing. The node id stays.
///
/// # Errors
/// Line and reason of the file, or the joint's refusal.
pub fn import(joint: &RemoteJoint, text: &str, over: &dyn Fn() -> bool) -> Result<Value, String> {
    let changes = differences(joint, &parsed(text)?, over)?;
    configuration::set(joint, &changes).map_err(|error| error.to_string())?;
    let changed = changes.iter().map(|(entry, value)| json!({ "name": entry.name(), "shown": entry.show(value) }));
    Ok(changed.collect())
}
