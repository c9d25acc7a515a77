//! The frames of joints as a DBC file, for cantools, SavvyCAN and the like; host.
//!
//! PDOs are those that a joint has at first; whoever maps others needs another file. The impedance frame is told by its
//! five parts, with the ranges that a joint has at first (2012h).

use super::plain;
use crate::remote::entry::{Entry, slug};
use crate::remote::pdo::objects;
use crate::remote::value::integer;
use canopen_node::PdoParameters;
use joint_firmware::objects::field::{Field, SetPoint};
use joint_firmware::objects::table::DataType;
use joint_firmware::objects::{DEFAULT_RANGES, default_communication};
use std::fmt::Write;

/// "Does not exist" in a PDO's COB-ID.
const INVALID: u32 = 1 << 31;

/// Position of a signal in its frame.
struct Place {
    /// Least significant bit first, or most significant bit first with the number of that bit.
    start: u32,
    bits: u32,
    intel: bool,
    signed: bool,
}

struct Signal {
    name: String,
    place: Place,
    factor: f64,
    offset: f64,
    unit: String,
    comment: String,
    choices: Vec<(u64, String)>,
}

struct Message {
    id: u32,
    name: String,
    sender: String,
    length: u32,
    signals: Vec<Signal>,
}

/// The file's content, for joints with these node ids. Torques are parts of the rated torque (6076h), or with
/// `rated_torque` in Nm.
pub fn text(nodes: &[u8], rated_torque: Option<f64>) -> String {
    let messages = nodes.iter().flat_map(|node| messages(*node, rated_torque)).collect::<Vec<_>>();
    let mut text = String::new();
    // Writing to a string does not fail.
    let _ = write(&mut text, nodes, &messages);
    text
}

fn write(text: &mut String, nodes: &[u8], messages: &[Message]) -> std::fmt::Result {
    let joints = nodes.iter().map(|node| format!("joint{node}")).collect::<Vec<_>>().join(" ");
    writeln!(text, "VERSION \"\"\n\nNS_ :\n\nBS_:\n\nBU_: master {joints}\n")?;
    for message in messages {
        let Message { id, name, sender, length, signals } = message;
        writeln!(text, "BO_ {id} {name}: {length} {sender}")?;
        let receiver = if sender == "master" { name.split('_').next().unwrap_or("master") } else { "master" };
        for signal in signals {
            let Place { start, bits, intel, signed } = signal.place;
            let (order, sign) = (u8::from(intel), if signed { '-' } else { '+' });
            let (factor, offset) = (signal.factor, signal.offset);
            let steps = 2f64.powi(bits as i32);
            let (least, most) = if signed { (-steps / 2.0, steps / 2.0 - 1.0) } else { (0.0, steps - 1.0) };
            let (low, high) = (short(least * factor + offset), short(most * factor + offset));
            writeln!(
                text,
                " SG_ {} : {start}|{bits}@{order}{sign} ({},{}) [{low}|{high}] \"{}\" {receiver}",
                signal.name,
                short(factor),
                short(offset),
                signal.unit
            )?;
        }
        writeln!(text)?;
    }
    for Message { id, signals, .. } in messages {
        for signal in signals.iter().filter(|signal| !signal.comment.is_empty()) {
            writeln!(text, "CM_ SG_ {id} {} \"{}\";", signal.name, signal.comment)?;
        }
    }
    for Message { id, signals, .. } in messages {
        for signal in signals.iter().filter(|signal| !signal.choices.is_empty()) {
            let choices = signal.choices.iter().map(|(number, words)| format!("{number} \"{words}\" "));
            writeln!(text, "VAL_ {id} {} {};", signal.name, choices.collect::<String>())?;
        }
    }
    Ok(())
}

/// A number without the noise of binary fractions.
fn short(number: f64) -> String {
    let text = format!("{number:.12e}").parse().unwrap_or(number);
    format!("{text}")
}

fn messages(node: u8, rated_torque: Option<f64>) -> Vec<Message> {
    let joint = format!("joint{node}");
    let defaults = default_communication(node);
    let mut messages = Vec::new();
    for (kind, pdos) in [("TPDO", &defaults.transmit), ("RPDO", &defaults.receive)] {
        for (pdo, number) in pdos.iter().zip(1..).filter(|(pdo, _)| pdo.cob_id & INVALID == 0) {
            let sender = if kind == "TPDO" { joint.clone() } else { "master".to_owned() };
            let length = objects(pdo).map(|object| object.bits()).sum::<u32>().div_ceil(8);
            let signals = signals(pdo, rated_torque);
            messages.push(Message {
                id: pdo.cob_id & 0x7FF,
                name: format!("{joint}_{kind}{number}"),
                sender,
                length,
                signals,
            });
        }
    }
    let plain = |name: &str, start, bits, comment: &str| Signal {
        name: name.into(),
        place: Place { start, bits, intel: true, signed: false },
        factor: 1.0,
        offset: 0.0,
        unit: String::new(),
        comment: comment.into(),
        choices: Vec::new(),
    };
    let emergency = vec![
        plain("error_code", 0, 16, "docs/faults.md and docs/objects.md, 0 once there is no error any more"),
        plain("error_register", 16, 8, "1001h"),
        plain(
            "information",
            24,
            40,
            "Of a fault its number and all latched ones, of a refused image the number of the reason",
        ),
    ];
    let id = defaults.emergency_cob_id;
    messages.push(Message { id, name: format!("{joint}_EMCY"), sender: joint.clone(), length: 8, signals: emergency });
    let mut state = plain("nmt_state", 0, 8, "Heartbeat");
    state.choices = [(0, "boot-up"), (4, "stopped"), (5, "operational"), (127, "pre-operational")]
        .map(|(number, words)| (number, words.to_owned()))
        .to_vec();
    let id = 0x700 + u32::from(node);
    messages.push(Message { id, name: format!("{joint}_heartbeat"), sender: joint, length: 1, signals: vec![state] });
    messages
}

fn signals(pdo: &PdoParameters, rated_torque: Option<f64>) -> Vec<Signal> {
    let mut start = 0;
    let mut signals = Vec::new();
    for object in objects(pdo) {
        let at = start;
        start += object.bits();
        // A dummy is no signal.
        let Some(entry) = Entry::at(object.index(), object.sub_index()) else { continue };
        if entry.object.field == Field::SetPoint(SetPoint::ImpedanceFrame) {
            signals.extend(impedance());
            continue;
        }
        let signed = integer(entry.object.data_type).is_some_and(|(_, signed)| signed);
        let torque = (entry.text.unit == "of 6076h").then_some(rated_torque).flatten();
        let unit = match (entry.text.unit, torque) {
            (_, Some(_)) => "Nm".to_owned(),
            ("of 6076h", None) => "of rated torque".to_owned(),
            (unit, None) => plain(unit),
        };
        signals.push(Signal {
            name: slug(&entry.name()).replace('-', "_"),
            place: Place { start: at, bits: object.bits(), intel: true, signed },
            factor: entry.text.scale * torque.unwrap_or(1.0),
            offset: 0.0,
            unit,
            comment: plain(entry.text.description),
            choices: choices(&entry),
        });
    }
    signals
}

/// The five parts of the impedance frame, most significant bit first (`objects::set_points`).
fn impedance() -> [Signal; 5] {
    let [position, velocity, stiffness, damping, torque] = DEFAULT_RANGES.map(f64::from);
    // Start bits count within a byte from its least significant bit: DBC's numbering of Motorola signals.
    [
        ("impedance_position", 7, 16, 2.0 * position / 65_535.0, -position, "rad"),
        ("impedance_velocity", 23, 12, 2.0 * velocity / 4_095.0, -velocity, "rad/s"),
        ("impedance_stiffness", 27, 12, stiffness / 4_095.0, 0.0, "Nm/rad"),
        ("impedance_damping", 47, 12, damping / 4_095.0, 0.0, "Nm s/rad"),
        ("impedance_torque", 51, 12, 2.0 * torque / 4_095.0, -torque, "Nm"),
    ]
    .map(|(name, start, bits, factor, offset, unit)| Signal {
        name: name.into(),
        place: Place { start, bits, intel: false, signed: false },
        factor,
        offset,
        unit: unit.into(),
        comment: "With the range that a joint has at first, 2012h".into(),
        choices: Vec::new(),
    })
}

/// Numbers that the description names one by one: "0 nothing, 1 physical"; none where it says anything else.
fn choices(entry: &Entry) -> Vec<(u64, String)> {
    if entry.object.data_type == DataType::F32 {
        return Vec::new();
    }
    let choice = |part: &str| {
        let (number, words) = part.split_once(' ')?;
        Some((number.parse().ok()?, plain(words)))
    };
    entry.text.description.split(", ").map(choice).collect::<Option<Vec<_>>>().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_told_with_the_tables_scales() {
        let text = text(&[5, 6], None);
        assert!(text.is_ascii());
        for line in [
            "BU_: master joint5 joint6",
            "BO_ 389 joint5_TPDO1: 8 joint5",
            " SG_ position_actual_value : 32|32@1- (0.000001,0) [-2147.483648|2147.483647] \"rad\" master",
            " SG_ torque_actual_value : 16|16@1- (0.001,0) [-32.768|32.767] \"of rated torque\" master",
            "BO_ 1030 joint6_RPDO3: 8 master",
            " SG_ impedance_stiffness : 27|12@0+ (0.1221001221001,0) [0|500] \"Nm/rad\" joint6",
            "VAL_ 1157 acting_model 0 \"nothing\" 1 \"physical\" 2 \"physical and network\" ;",
        ] {
            assert!(text.contains(line), "{line}\n{text}");
        }
        assert!(!text.contains("RPDO4"), "it does not exist at first");
        assert!(super::text(&[5], Some(20.0)).contains("(0.02,0) [-655.36|655.34] \"Nm\""));
    }
}
