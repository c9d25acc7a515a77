//! A joint on one page: what an engineer looks at first; host.

use super::condition;
use super::configured;
use super::entry::Entry;
use super::error::RemoteError;
use super::image::{ImageStatus, StoredImage};
use super::joint::RemoteJoint;
use super::motion;
use super::value::Value;
use super::words;
use bus::client::{Abort, ClientError};
use friction_compensation::parameters::life_cycle::State;
use joint_firmware::joint::adaptation::{Factors, Learning, Report};
use joint_firmware::joint::fault::Fault;
use joint_firmware::objects::field::{
    Actual, Field, ImageField, LogField, OwnerField, ResetField, SetPoint, StorageField,
};
use joint_firmware::objects::settings::Setting;
use joint_firmware::objects::{emergency, fault_log};
use std::fmt::Write;

/// Columns of a line's title.
pub const TITLE: usize = 16;

/// The page; reads some fifty objects.
pub fn page(joint: &RemoteJoint) -> Result<String, RemoteError> {
    let mut page = String::new();
    let mut line = |title: &str, text: String| {
        // Writing to a string does not fail.
        let _ = writeln!(page, "{title:<TITLE$}{text}");
    };
    let text = |index| joint.node().upload(index, 0).map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
    let word = |sub_index| joint.node().number(0x1018, sub_index).map(u32::from_le_bytes);
    line("node", format!("{}: {}", joint.id(), text(0x1008)?));
    line(
        "identity",
        format!(
            "product {:08X}h, revision {}, serial number {}, vendor {:08X}h",
            word(2)?,
            word(3)?,
            word(4)?,
            word(1)?
        ),
    );
    line("program", format!("{} on {}", text(0x100A)?, text(0x1009)?));
    line("started", started(joint)?);
    line("state", motion::left(joint, joint.state()?)?);
    line("mode", mode(joint.raw(Field::SetPoint(SetPoint::Mode))? as i8));
    let faults = joint.faults()?;
    line("faults", if faults.is_empty() { "none".into() } else { condition::list(&faults) });

    let actual = |actual| show(joint, Field::Actual(actual));
    line("position", format!("{}, velocity {}", actual(Actual::Position)?, actual(Actual::Velocity)?));
    let rated = joint.number(Field::Actual(Actual::RatedTorque))?;
    let torque = |signal| joint.number(Field::Actual(signal)).map(|part| part * rated);
    line("torque", format!("{:.3} Nm of at most {rated} Nm", torque(Actual::Torque)?));
    line("bus voltage", actual(Actual::BusVoltage)?);
    line(
        "temperatures",
        format!(
            "winding {}, bridge {}, gear {}",
            actual(Actual::WindingTemperature)?,
            actual(Actual::BridgeTemperature)?,
            actual(Actual::GearTemperature)?
        ),
    );

    let ImageStatus { state, left, active, previous } = joint.image_status()?;
    line("image", stored(active));
    line("previous", stored(previous));
    line("life cycle", life(state, left));
    line("authentication", authentication(joint)?);
    line("storage", storage(joint)?);
    line("configuration", configured::read(joint)?.to_string());
    let logged = logged(joint)?;
    line("fault log", logged.0);
    logged.1.into_iter().for_each(|fault| line("", fault));
    let setting = |setting| show(joint, Field::Setting(setting));
    let compensation = |setting| show(joint, Field::AtOnce(setting));
    line(
        "compensation",
        format!(
            "requested {}, acting {}: {}",
            match joint.raw(Field::AtOnce(Setting::Request))? {
                0 => "off",
                request => words::model(request),
            },
            words::model(joint.raw(Field::Actual(Actual::ActingModel))?),
            words::reason(joint.raw(Field::Actual(Actual::Reason))?)
        ),
    );
    line(
        "",
        format!(
            "gain {}, clamp {}, left the trained range {} times, shadow RMS {}",
            compensation(Setting::CompensationGain)?,
            compensation(Setting::Clamp)?,
            joint.raw(Field::Actual(Actual::Violations))?,
            actual(Actual::ShadowRms)?
        ),
    );
    line("adaptation", adaptation(joint)?);
    line(
        "limits",
        format!(
            "torque {}, velocity {}, position {} to {}",
            setting(Setting::TorqueLimit)?,
            setting(Setting::VelocityLimit)?,
            setting(Setting::LowestPosition)?,
            setting(Setting::HighestPosition)?
        ),
    );
    line(
        "",
        format!(
            "current {}, bus {} to {}, command deadline {}",
            setting(Setting::CurrentLimit)?,
            setting(Setting::LowestBusVoltage)?,
            setting(Setting::HighestBusVoltage)?,
            setting(Setting::CommandDeadline)?
        ),
    );
    line(
        "drive",
        format!(
            "gear ratio {}, {} pole pairs, {} at the rotor, stiffness {}, damping {}",
            setting(Setting::GearRatio)?,
            joint.raw(Field::Setting(Setting::PolePairs))?,
            setting(Setting::TorqueConstant)?,
            setting(Setting::Stiffness)?,
            setting(Setting::Damping)?
        ),
    );
    Ok(page)
}

/// Object 2201h in words.
fn adaptation(joint: &RemoteJoint) -> Result<String, RemoteError> {
    let request = match joint.raw(Field::AtOnce(Setting::Adaptation))? {
        0 => return Ok("off".into()),
        1 => "in shadow",
        _ => "on",
    };
    let learning = joint.raw(Field::Actual(Actual::Learning))?;
    let factor = joint.number(Field::Actual(Actual::AdaptedFactor))?;
    let deviation = joint.number(Field::Actual(Actual::FactorDeviation))?;
    let found = Report {
        factors: Factors { factor: factor as f32, viscous: 0.0 },
        deviation: deviation as f32,
        learning: Learning::Off,
    };
    Ok(format!(
        "{request}: {}; friction {factor:.2} times the image's, deviation {deviation:.2}, and {} more{}",
        words::learning(learning),
        show(joint, Field::Actual(Actual::AdaptedViscous))?,
        if found.misfits() { ": make a new image (retrain)" } else { "" }
    ))
}

/// The page as JSON: its lines by their titles, those of several lines as an array.
pub fn json(page: &str) -> serde_json::Value {
    let mut lines: Vec<(String, Vec<String>)> = Vec::new();
    for line in page.lines() {
        let (title, text) = line.split_at_checked(TITLE).unwrap_or((line, ""));
        match (title.trim_end(), lines.last_mut()) {
            ("", Some((_, texts))) => texts.push(text.to_owned()),
            (title, _) => lines.push((title.to_owned(), vec![text.to_owned()])),
        }
    }
    let value = |texts: Vec<String>| match <[String; 1]>::try_from(texts) {
        Ok([text]) => serde_json::Value::String(text),
        Err(texts) => texts.into(),
    };
    lines.into_iter().map(|(title, texts)| (title, value(texts))).collect()
}

/// A value with its unit.
pub fn show(joint: &RemoteJoint, field: Field) -> Result<String, RemoteError> {
    let entry = Entry::of(field);
    Ok(entry.show(&joint.read(entry)?))
}

/// The value of an object as it is printed: parts of the rated torque in Nm, too.
pub fn show_entry(joint: &RemoteJoint, entry: Entry) -> Result<String, RemoteError> {
    let value = joint.read(entry)?;
    let shown = entry.show(&value);
    Ok(match (entry.text.unit, &value) {
        ("of 6076h", Value::Real(part)) => {
            format!("{shown}, {:.3} Nm", part * joint.number(Field::Actual(Actual::RatedTorque))?)
        }
        _ => shown,
    })
}

/// Causes of the chip's reset, in the order of the bits of object 2301h:1.
const CAUSES: [&str; 7] =
    ["option bytes", "reset pin", "power", "the program", "the watchdog", "the window watchdog", "low-power mode"];
/// Causes of a program's stop, by its number in object 2301h:2, from 1 on.
const STOPS: [&str; 4] = ["a panic", "a hard fault", "a non-maskable interrupt", "an interrupt without a handler"];

/// Object 2301h in words.
fn started(joint: &RemoteJoint) -> Result<String, RemoteError> {
    let raw = |part| joint.raw(Field::Reset(part));
    let causes = raw(ResetField::Causes)?;
    let causes = CAUSES.iter().enumerate().filter(|(bit, _)| causes >> bit & 1 == 1).map(|(_, cause)| *cause);
    let mut text = format!("by {}", causes.collect::<Vec<_>>().join(", "));
    let stop = raw(ResetField::Stop)?;
    if stop != 0 {
        let stop = (stop as usize).checked_sub(1).and_then(|number| STOPS.get(number)).copied();
        let _ = write!(
            text,
            "; {} stopped it {} times in a row, last at {:08X}h, detail {}, {}",
            stop.unwrap_or("something"),
            raw(ResetField::Repeats)?,
            raw(ResetField::Address)?,
            raw(ResetField::Detail)?,
            show(joint, Field::Reset(ResetField::Place))?
        );
    }
    Ok(text)
}

fn mode(number: i8) -> String {
    match number {
        8 => "position".into(),
        9 => "velocity".into(),
        10 => "torque".into(),
        -1 => "impedance".into(),
        _ => format!("{number}"),
    }
}

fn stored(image: Option<StoredImage>) -> String {
    let Some(StoredImage { version, checksum, network, slot, created }) = image else { return "none".into() };
    let model = if network { "physical and network" } else { "physical" };
    let created = if created == 0 { String::new() } else { format!(", created {created} s after 1970") };
    format!("version {version}, {model}, CRC-32 {checksum:08X}h, slot {slot}{created}")
}

/// State of a staged image, in words.
pub fn life(state: State, left: f64) -> String {
    match state {
        State::Empty => "nothing staged, none in use".into(),
        State::Staged => "an image is staged, not verified".into(),
        State::Verified => "an image is verified, not in use".into(),
        State::Shadow => format!("an image is computed in shadow for another {left:.1} s"),
        State::Trial => format!("an image is on trial for another {left:.1} s"),
        State::Storing => "flash is being written".into(),
        State::Committed => "stored, not in use yet".into(),
        State::Active => "in use, nothing staged".into(),
    }
}

fn authentication(joint: &RemoteJoint) -> Result<String, RemoteError> {
    let raw = |field| joint.raw(Field::Image(field));
    let of_owner = |field| joint.raw(Field::Owner(field));
    if of_owner(OwnerField::KeyPresent)? == 0 {
        return Ok("no key: belongs to nobody, images need no tag and may have any version".into());
    }
    let number = of_owner(OwnerField::KeyNumber)?;
    if number == 0 {
        return Ok("the stored key is damaged: nothing that needs it is taken, `jointctl key forget` repairs it".into());
    }
    let floor = raw(ImageField::Floor)?;
    let mut text = format!("key {number:08x}: images need its tag, settings a session; version {floor} or newer");
    let failures = raw(ImageField::Failures)?;
    if failures > 0 {
        let _ = write!(text, "; {failures} wrong tags so far");
    }
    Ok(text)
}

/// Object 2304h in words.
fn storage(joint: &RemoteJoint) -> Result<String, RemoteError> {
    const DAMAGED: [&str; 3] =
        ["an image", "the configuration, so it is not enabled before `store` or `restore`", "the key"];
    let raw = |part| joint.raw(Field::Storage(part));
    let (damaged, left) = (raw(StorageField::Damaged)?, raw(StorageField::StoresLeft)?);
    let damaged = DAMAGED.iter().enumerate().filter(|(bit, _)| damaged >> bit & 1 == 1).map(|(_, what)| *what);
    let damaged = damaged.collect::<Vec<_>>().join(", ");
    let found = if damaged.is_empty() { "whole".to_owned() } else { format!("damaged: {damaged}") };
    Ok(format!("{found}; {left} stores left"))
}

/// Faults of the log that are shown.
const SHOWN: usize = 3;

/// Object 2305h in words, and its newest faults.
fn logged(joint: &RemoteJoint) -> Result<(String, Vec<String>), RemoteError> {
    let object = Entry::of(Field::Log(LogField::Faults)).object;
    let bytes = match joint.node().upload(object.index, object.sub_index) {
        Err(ClientError::Aborted { abort: Abort::NO_OBJECT, .. }) => {
            return Ok(("none, for want of room".into(), Vec::new()));
        }
        bytes => bytes?,
    };
    let raw = |part| joint.raw(Field::Log(part));
    let faults: Vec<_> = fault_log::decode(&bytes).collect();
    let mut text = format!("{} faults, {} power-ups", faults.len(), raw(LogField::PowerUps)?);
    let missed = raw(LogField::Missed)?;
    if missed > 0 {
        let _ = write!(text, "; {missed} more came too fast to be kept");
    }
    if faults.len() > SHOWN {
        let _ = write!(text, "; the newest {SHOWN}:");
    }
    let shown = faults.iter().take(SHOWN).map(|logged| {
        let fault = Fault::ALL.into_iter().find(|fault| *fault as u8 == logged.fault);
        let name = match (fault, logged.code) {
            (Some(fault), _) => condition::list(&[fault]),
            (None, emergency::WATCHDOG) => format!("stopped by the watchdog ({:04X}h)", logged.code),
            (None, emergency::STOPPED) => format!("stopped by the program ({:04X}h)", logged.code),
            (None, code) => format!("error {code:04X}h"),
        };
        format!("{name}, {} s after the start, power-up {}", logged.time, logged.power_up)
    });
    Ok((text, shown.collect()))
}
