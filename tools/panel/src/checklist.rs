//! Checklist of what a board still misses on its way from unboxing to a joint that moves and learns:
//! docs/on-a-board.md; host.

use joint_firmware::default_configuration::B_G431B_ESC1;
use joint_firmware::joint::state_machine::State;
use joint_firmware::objects::field::{Actual, Field, HardwareField, OwnerField, ResetField, StorageField};
use joint_firmware::objects::settings::Setting;
use jointctl::remote::configured::{self, Configured};
use jointctl::remote::{RemoteError, RemoteJoint, condition, info, words};
use serde::Serialize;

/// One thing to look at.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Item {
    /// Name.
    pub name: &'static str,
    /// `true` if it is as it should be.
    pub done: bool,
    /// The value that says so.
    pub found: String,
    /// Remedy where it is not done; empty where it is.
    pub remedy: &'static str,
}

/// A number that the joint may not have an object for.
fn optional(joint: &RemoteJoint, field: Field) -> Result<Option<u64>, RemoteError> {
    match joint.raw(field) {
        Ok(raw) => Ok(Some(raw)),
        Err(error) if error.is_absent() => Ok(None),
        Err(error) => Err(error),
    }
}

/// The list, in the order in which a board is set up.
///
/// # Errors
/// The bus, or no answer.
pub fn checklist(joint: &RemoteJoint) -> Result<Vec<Item>, RemoteError> {
    let mut items = Vec::new();
    let mut item = |name, done: bool, found: String, remedy| {
        items.push(Item { name, done, found, remedy: if done { "" } else { remedy } });
    };
    if let Some(wrong) = optional(joint, Field::Hardware(HardwareField::OptionsWrong))? {
        let found = if wrong == 0 { "as needed".into() } else { format!("wrong: bits {wrong:03b} of 2303h:3") };
        item("chip options", wrong == 0, found, "jointctl set set-chip-options 0x4254504F");
    }
    if let Some(missing) = optional(joint, Field::Hardware(HardwareField::DriverSetup))? {
        let found = if missing == 0 { "ready".into() } else { format!("incomplete: {missing:X}h") };
        item("gate driver", missing == 0, found, "docs/boards.md, part Gate driver; then a power-up");
    }
    let stop = joint.raw(Field::Reset(ResetField::Stop))?;
    let found =
        if stop == 0 { "the program ran until the last reset".into() } else { format!("stop {stop} of 2301h:2") };
    item("last start", stop == 0, found, "jointctl info shows where the program stopped");
    let damaged = joint.raw(Field::Storage(StorageField::Damaged))?;
    let found = if damaged == 0 { "whole".into() } else { format!("damaged: bits {damaged:03b} of 2304h:1") };
    item("storage", damaged == 0, found, "check the settings, then Store; or jointctl restore");
    let stored = configured::read(joint)?;
    if stored != Configured::Untold {
        item("configuration", stored != Configured::Differs, stored.to_string(), "Store, below, once it is as wanted");
    }
    let setting = |setting| joint.number(Field::Setting(setting));
    let (low, high) = (setting(Setting::LowestBusVoltage)?, setting(Setting::HighestBusVoltage)?);
    let supply = joint.number(Field::Actual(Actual::BusVoltage))?;
    let shown = |setting| info::show(joint, Field::Setting(setting));
    let ends = (shown(Setting::LowestBusVoltage)?, shown(Setting::HighestBusVoltage)?);
    let found = format!("{supply:.2} V of {} to {}", ends.0, ends.1);
    item("supply", (low..=high).contains(&supply), found, "the supply, or lowest-bus-voltage and highest-bus-voltage");
    let faults = joint.faults()?;
    let found = if faults.is_empty() { "none".into() } else { condition::list(&faults) };
    item("faults", faults.is_empty(), found, "docs/faults.md; once the cause is gone, move with reset");
    let state = joint.state()?;
    let remedy = "turn the rotor once by hand, or jointctl commission --index-only";
    item("encoder", state != State::NotReadyToSwitchOn, condition::name(state).into(), remedy);
    // The placeholders of every board: `jointctl commission` tells a new joint by them as well.
    let mut new = true;
    for setting in [Setting::InductanceD, Setting::InductanceQ, Setting::TorqueConstant] {
        let placeholder = f64::from(f32::from_bits(setting.get(&B_G431B_ESC1.joint)));
        new &= (joint.number(Field::Setting(setting))? / placeholder - 1.0).abs() < 1e-6;
    }
    let found = if new { "placeholders of the program" } else { "set" };
    item("motor and encoder", !new, found.into(), "jointctl commission --current A");
    let version = joint.raw(Field::Actual(Actual::ImageVersion))?;
    let found = if version == 0 { "no image".into() } else { format!("version {version}") };
    item("friction image", version != 0, found, "Learning, below; or jointctl retrain");
    let (gain, clamp) = (Field::AtOnce(Setting::CompensationGain), Field::AtOnce(Setting::Clamp));
    let some = joint.number(gain)? > 0.0 && joint.number(clamp)? > 0.0;
    let found = format!("gain {}, at most {}", info::show(joint, gain)?, info::show(joint, clamp)?);
    item("compensation permitted", some, found, "gain and clamp of friction-compensation, below");
    let request = joint.raw(Field::AtOnce(Setting::Request))?;
    item("compensation requested", request != 0, words::model(request).into(), "Compensation in Learning, below");
    if let Some(present) = optional(joint, Field::Owner(OwnerField::KeyPresent))? {
        let found = if present == 0 { "belongs to nobody" } else { "has a key" };
        item("owner", present != 0, found.into(), "jointctl key; see docs/ownership.md");
    }
    Ok(items)
}
