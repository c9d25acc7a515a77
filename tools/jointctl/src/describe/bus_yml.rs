//! The configuration of a ros2_canopen master, bus.yml, for joints on a bus; host.
//!
//! Written by a few lines of its own: a YAML serializer writes no comments, and all values here are numbers and names
//! that are made here. ros2_canopen reads it with yaml-cpp, dcfgen with PyYAML.
//!
//! The PDOs are not those of a joint that nobody has set up. There the controlword is part of two RPDOs: a master that
//! writes it into one of them only sends 0 in the other, which switches the joint off. Here an object is part of one
//! RPDO at most.

use super::eds::Identity;
use crate::remote::Entry;
use canopen_node::PdoParameters;
use joint_firmware::objects::default_communication;
use std::fmt::Write;

/// Shortest and longest period of a master, ms. Longer ones leave less than one missing set-point to the command
/// deadline that a joint has at first, 100 ms.
pub const PERIODS: (u16, u16) = (1, 50);
/// Distance of the heartbeats of master and joints, ms.
const HEARTBEAT: u16 = 100;
/// Objects of RPDOs 1 and 2: every set-point that `Cia402Driver` writes and a joint has.
const RECEIVE: [&[u16]; 2] = [&[0x6040, 0x6060, 0x607A], &[0x60FF, 0x6071]];
/// Objects of TPDOs 1 and 2: what `Cia402Driver` reads in every period, and the torque.
const TRANSMIT: [&[u16]; 2] = [&[0x6041, 0x6061, 0x6064], &[0x606C, 0x6077]];
/// Each SYNC, of TPDOs.
const EACH_SYNC: u8 = 1;

/// A joint of the file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Joint {
    /// Node id.
    pub node: u8,
    /// Vendor, product and revision; of the default any.
    pub identity: Identity,
    /// 1018h:4; 0 for any.
    pub serial: u32,
    /// Name of its EDS, in the folder of the file.
    pub eds: String,
}

/// The master.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Master {
    /// Node id.
    pub node: u8,
    /// Distance of two SYNCs, and period of the joints' drivers, ms.
    pub period: u16,
}

/// The file's content.
pub fn text(master: Master, joints: &[Joint]) -> String {
    let mut text = String::new();
    // Writing to a string does not fail.
    let _ = write(&mut text, master, joints);
    text
}

fn write(text: &mut String, master: Master, joints: &[Joint]) -> std::fmt::Result {
    let Master { node, period } = master;
    writeln!(text, "# Written by jointctl {}, for ros2_canopen and dcfgen -rS.", env!("CARGO_PKG_VERSION"))?;
    // generate_dcf of ros2_canopen puts the installed folder there.
    writeln!(text, "options:\n  dcf_path: \"@BUS_CONFIG_PATH@\"\n")?;
    writeln!(text, "master:\n  node_id: {node}\n  driver: \"ros2_canopen::MasterDriver\"")?;
    writeln!(text, "  package: \"canopen_master_driver\"\n  sync_period: {} # us", u32::from(period) * 1000)?;
    writeln!(text, "  heartbeat_producer: {HEARTBEAT} # ms")?;
    for joint in joints {
        write_joint(text, period, joint)?;
    }
    Ok(())
}

fn write_joint(text: &mut String, period: u16, joint: &Joint) -> std::fmt::Result {
    let Joint { node, identity, serial, eds } = joint;
    writeln!(text, "\njoint_{node}:\n  node_id: {node}\n  dcf: \"{eds}\"")?;
    writeln!(text, "  driver: \"ros2_canopen::Cia402Driver\"\n  package: \"canopen_402_driver\"")?;
    writeln!(text, "  period: {period} # ms\n  enable_lazy_load: false\n  boot: true")?;
    if *identity != Identity::default() {
        // dcfgen knows no keys for these two, it takes them from the EDS.
        writeln!(text, "  # vendor 0x{:X}, product 0x{:X}: in the EDS", identity.vendor, identity.product)?;
        writeln!(text, "  revision_number: 0x{:X}", identity.revision)?;
    }
    if *serial != 0 {
        writeln!(text, "  serial_number: 0x{serial:X}")?;
    }
    writeln!(text, "  heartbeat_producer: {HEARTBEAT} # ms")?;
    writeln!(text, "  heartbeat_consumer: true # the joint brakes where the master's heartbeat is lost")?;
    for (quantity, target, actual) in [("pos", 0x607A, 0x6064), ("vel", 0x60FF, 0x606C)] {
        let (target, actual) = (entry(target), entry(actual));
        writeln!(
            text,
            "  scale_{quantity}_to_dev: {} # {} to steps of {}",
            float(1.0 / target.text.scale),
            target.text.unit,
            target.text.name
        )?;
        writeln!(text, "  scale_{quantity}_from_dev: {} # {}", float(actual.text.scale), actual.text.name)?;
    }
    writeln!(text, "  sdo: # dcfgen leaves out what the EDS has as a default; a joint may have stored another value")?;
    writeln!(text, "    - {{index: 0x1017, sub_index: 0, value: {HEARTBEAT}}}")?;
    let defaults = default_communication(*node);
    for (first, parameters, used) in
        [(0x1400, &defaults.receive, RECEIVE.len()), (0x1800, &defaults.transmit, TRANSMIT.len())]
    {
        for (index, parameters) in (first..).zip(parameters).take(used) {
            let transmission = if first == 0x1800 { EACH_SYNC } else { parameters.transmission };
            writeln!(text, "    - {{index: 0x{index:04X}, sub_index: 2, value: {transmission}}} # transmission type")?;
        }
    }
    writeln!(text, "  tpdo:")?;
    for ((number, objects), parameters) in (1..).zip(TRANSMIT).zip(&defaults.transmit) {
        pdo(text, number, parameters, Some(EACH_SYNC), objects)?;
    }
    writeln!(text, "  rpdo:")?;
    for ((number, objects), parameters) in (1..).zip(RECEIVE).zip(&defaults.receive) {
        pdo(text, number, parameters, None, objects)?;
    }
    for (number, parameters) in (1..).zip(&defaults.receive).skip(RECEIVE.len()) {
        // `enabled: false` would leave it in the master, which would send it.
        let off = PdoParameters::unused(parameters.cob_id as u16).cob_id;
        writeln!(text, "    {number}:\n      enabled: false\n      cob_id: 0x{off:X} # off")?;
    }
    Ok(())
}

fn pdo(
    text: &mut String,
    number: u8,
    parameters: &PdoParameters,
    transmission: Option<u8>,
    objects: &[u16],
) -> std::fmt::Result {
    writeln!(text, "    {number}:\n      enabled: true\n      cob_id: 0x{:X}", parameters.cob_id)?;
    if let Some(transmission) = transmission {
        writeln!(text, "      transmission: {transmission} # each SYNC")?;
    }
    writeln!(text, "      mapping:")?;
    for &index in objects {
        let name = entry(index).text.name;
        writeln!(text, "        - {{index: 0x{index:04X}, sub_index: 0}} # {name}")?;
    }
    Ok(())
}

/// An object of the profile, all of which have sub-index 0 alone.
fn entry(index: u16) -> Entry {
    Entry::at(index, 0).unwrap_or_else(|| unreachable!("{index:04X}h is in the table"))
}

/// Number without an exponent: PyYAML takes 1e-6 for a text.
fn float(number: f64) -> String {
    let text = number.to_string();
    if text.contains('.') { text } else { format!("{text}.0") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    fn joint(node: u8, identity: Identity, serial: u32) -> Joint {
        Joint { node, identity, serial, eds: "joint.eds".into() }
    }

    #[test]
    fn a_joint_is_written_with_its_identity_its_scales_and_its_pdos() {
        let identity = Identity { vendor: 0, product: 0x564A_6E74, revision: 1, modes: None };
        let text = text(Master { node: 1, period: 10 }, &[joint(5, identity, 12), joint(7, Identity::default(), 0)]);
        let (master, rest) = text.split_once("\njoint_5:\n").unwrap();
        let (five, seven) = rest.split_once("\njoint_7:\n").unwrap();
        assert!(master.contains("sync_period: 10000 # us"), "{master}");
        for line in [
            "  node_id: 5\n",
            "product 0x564A6E74: in the EDS\n",
            "  revision_number: 0x1\n  serial_number: 0xC\n",
            "  scale_pos_to_dev: 1000000.0 #",
            "  scale_pos_from_dev: 0.000001 #",
            "  scale_vel_to_dev: 1000.0 #",
            "  scale_vel_from_dev: 0.001 #",
            "      cob_id: 0x205\n",
            "      cob_id: 0x80000405 # off\n",
            "      cob_id: 0x80000505 # off\n",
            "        - {index: 0x607A, sub_index: 0} # target position\n",
        ] {
            assert!(five.contains(line), "{line} is not in\n{five}");
        }
        // Of a joint that is not known, nothing that a master would insist on.
        assert!(!seven.contains("revision_number") && !seven.contains("serial_number"), "{seven}");
    }

    #[test]
    fn scales_are_those_of_the_table_and_turn_back() {
        for (target, actual) in [(0x607A, 0x6064), (0x60FF, 0x606C)] {
            let to = float(1.0 / entry(target).text.scale).parse::<f64>().unwrap();
            assert_eq!(to * float(entry(actual).text.scale).parse::<f64>().unwrap(), 1.0, "{target:04X}h");
        }
    }

    #[test]
    fn every_object_is_mappable_fits_and_is_part_of_one_pdo_at_most() {
        for (pdos, receive) in [(RECEIVE, true), (TRANSMIT, false)] {
            let mut seen = BTreeSet::new();
            for objects in pdos {
                let mapped = objects.iter().map(|index| entry(*index).object).collect::<Vec<_>>();
                let bits = mapped.iter().map(|object| 8 * object.data_type.bytes().unwrap()).sum::<u8>();
                assert!(bits <= 64, "{bits} bits");
                for object in mapped {
                    assert!(seen.insert(object.index), "{:04X}h twice", object.index);
                    assert!(if receive { object.mappable.receive } else { object.mappable.transmit });
                }
            }
        }
    }
}
