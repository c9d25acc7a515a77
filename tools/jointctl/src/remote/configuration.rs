//! Settings of a joint: changed as a whole, stored, restored; host.
//!
//! Settings of the configuration (2101h to 2106h) are staged by being written and taken together by a command. [`set`]
//! does both, and forgets what it staged where the joint refuses it: a joint never stays half configured.

use super::configured;
use super::entry::Entry;
use super::error::RemoteError;
use super::joint::RemoteJoint;
use super::value::Value;
use bus::client::{Abort, ClientError};
use canopen_node::{Access, Group};
use joint_firmware::motor::setting::Name;
use joint_firmware::objects::field::{ConfigurationField, Field, ImageField, OwnerField};
use time::UtcDateTime;

/// Commands of object 2100h:1.
const TAKE: u64 = 1;
const FORGET: u64 = 2;

/// Writes objects, in their order. Settings of the configuration among them are taken together, or none of them is.
pub fn set(joint: &RemoteJoint, wanted: &[(Entry, Value)]) -> Result<(), RemoteError> {
    let refuse =
        |entry: &Entry, problem: &str| RemoteError::Value { object: entry.described(), problem: problem.into() };
    // Values that can be refused from here are refused before anything is sent.
    for (entry, value) in wanted {
        match (entry.object.field, entry.object.access) {
            (Field::Image(ImageField::Staging), _) => return Err(refuse(entry, "`jointctl upload` writes it")),
            (Field::Owner(OwnerField::Key | OwnerField::Response | OwnerField::Forget), _) => {
                return Err(refuse(entry, "`jointctl key` writes it"));
            }
            (_, Access::ReadOnly) => return Err(refuse(entry, "is read-only")),
            _ => {}
        }
        entry.encode(value)?;
    }
    let is_setting = |entry: &Entry| matches!(entry.object.field, Field::Setting(_));
    let stages = wanted.iter().any(|(entry, _)| is_setting(entry));
    if stages {
        if joint.raw(Field::Configuration(ConfigurationField::Changed))? != 0 {
            return Err(RemoteError::Staged { node: joint.id() });
        }
        joint.require_off("a change of the configuration")?;
        let settings = wanted.iter().filter(|(entry, _)| is_setting(entry));
        let taken = stage(joint, settings);
        if taken.is_err() {
            // If this fails too, the first error is the one that says why.
            let _ = joint.write_raw(Field::Configuration(ConfigurationField::Command), FORGET);
        }
        taken?;
    }
    for (entry, value) in wanted.iter().filter(|(entry, _)| !is_setting(entry)) {
        joint.write(*entry, value).map_err(|error| match entry.object.field {
            Field::AtOnce(_) => explained(joint, error),
            _ => error,
        })?;
    }
    Ok(())
}

fn stage<'a>(joint: &RemoteJoint, settings: impl Iterator<Item = &'a (Entry, Value)>) -> Result<(), RemoteError> {
    for (entry, value) in settings {
        joint.write(*entry, value)?;
    }
    let taken = joint.write_raw(Field::Configuration(ConfigurationField::Command), TAKE);
    taken.map_err(|error| explained(joint, error))
}

/// The setting that was refused, and what would be possible; where the joint does not say, the error itself.
pub(super) fn explained(joint: &RemoteJoint, error: RemoteError) -> RemoteError {
    if !matches!(error, RemoteError::Client(ClientError::Aborted { abort: Abort::VALUE, .. })) {
        return error;
    }
    let details = || -> Result<RemoteError, RemoteError> {
        let number = |part| joint.number(Field::Configuration(part));
        let code = joint.raw(Field::Configuration(ConfigurationField::RefusedSetting))? as u32;
        let setting = match Name::from_code(code).text() {
            _ if code == 0 => return Ok(error.clone()),
            // A newer program's.
            "" => format!("{:04X}h:{}", code >> 16, (code >> 8) as u8),
            name => name.to_owned(),
        };
        Ok(RemoteError::Setting {
            node: joint.id(),
            setting,
            value: number(ConfigurationField::RefusedValue)?,
            low: number(ConfigurationField::Lowest)?,
            high: number(ConfigurationField::Highest)?,
        })
    };
    details().unwrap_or(error)
}

/// Sub-index of 1010h and 1011h.
fn sub_index(group: Group) -> u8 {
    match group {
        Group::All => 1,
        Group::Communication => 2,
        Group::Application => 3,
    }
}

/// Keeps what is in use over a loss of power (1010h); all of it with its date ([`configured`]). The motor has to be
/// off.
pub fn store(joint: &RemoteJoint, group: Group) -> Result<(), RemoteError> {
    joint.require_off("storing")?;
    match group {
        Group::All => configured::store(joint, UtcDateTime::now()),
        Group::Communication | Group::Application => joint.download(0x1010, sub_index(group), b"save"),
    }
}

/// Forgets what was stored (1011h): the joint has its defaults after the next reset. The motor has to be off.
pub fn restore(joint: &RemoteJoint, group: Group) -> Result<(), RemoteError> {
    joint.require_off("restoring")?;
    joint.download(0x1011, sub_index(group), b"load")
}
