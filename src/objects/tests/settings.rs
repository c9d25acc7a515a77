//! The configuration: staged, taken as a whole, stored, restored.

use super::*;
use crate::joint::configuration::LoadFeedforwardRequest;
use crate::joint::state_machine::State;
use crate::motor::setting::Name;
use crate::objects::field::{Field, Range};
use crate::objects::stored::communication_parameters;
use crate::objects::table::{DataType, described};
use canopen_node::CommunicationParameters;

const TAKE: (u16, u8) = (0x2100, 1);

fn take(node: &mut Node) -> Result<(), u32> {
    node.download(TAKE.0, TAKE.1, &[1])
}

#[test]
fn what_is_staged_counts_once_it_is_taken() {
    let mut node = Node::new();
    node.set_real(0x2103, 1, 0.03).unwrap();
    node.set_real(0x2104, 3, 0.5).unwrap();
    assert_eq!((node.number(0x2100, 7), node.objects.program().configured.len()), (1, 0));
    take(&mut node).unwrap();
    let taken = *node.objects.program().configured.last().unwrap();
    assert_eq!((taken.limits.torque, taken.gains.stiffness), (0.03, 0.5));
    assert_eq!((node.number(0x2100, 7), node.number(0x2100, 2), node.number(0x6076, 0)), (0, 0, 30));
}

#[test]
fn a_refused_configuration_says_which_setting_and_why() {
    let mut node = Node::new();
    node.set_real(0x2101, 4, 7.0).unwrap();
    assert_eq!(take(&mut node), Err(0x0609_0030));
    assert_eq!(node.number(0x2100, 2), 1);
    let refused = node.number(0x2100, 3) as u32;
    assert_eq!((refused >> 8, Name::from_code(refused).text()), (0x21_0104, "torque constant"));
    assert_eq!((node.real(0x2100, 4), node.real(0x2100, 5), node.real(0x2100, 6)), (7.0, 1e-3, 5.0));
    assert!(node.objects.program().configured.is_empty());
    node.download(TAKE.0, TAKE.1, &[2]).unwrap();
    assert_eq!((node.real(0x2101, 4), node.number(0x2100, 3)), (BOARD.joint.motor.torque_constant, 0));
}

#[test]
fn every_limit_in_the_table_is_one_that_the_joint_keeps() {
    for (object, text) in described() {
        let (setting, (low, high)) = match (object.field, text.limits) {
            (Field::Setting(setting) | Field::AtOnce(setting), Some(limits)) => (setting, limits),
            (Field::Setting(_) | Field::AtOnce(_), None) => continue,
            _ => continue,
        };
        for outside in [low - 1e-3 * (1.0 + low.abs()), high + 1e-3 * (1.0 + high.abs())] {
            let mut configuration = BOARD.joint;
            let bits = match object.data_type {
                DataType::F32 => (outside as f32).to_bits(),
                _ => (outside + if outside > 0.0 { 1.0 } else { 0.0 }) as i64 as u32,
            };
            // Unsigned numbers cannot go below zero.
            if object.data_type != DataType::F32 && bits == low as u32 {
                continue;
            }
            let refused = !setting.set(&mut configuration, bits) || configuration.prepare(&BOARD.bridge).is_err();
            assert!(refused, "{}: {outside}", text.name);
        }
    }
}

#[test]
fn every_setting_keeps_the_number_it_was_given() {
    for (object, text) in described() {
        let (Field::Setting(setting) | Field::AtOnce(setting)) = object.field else { continue };
        let number = if object.data_type == DataType::F32 { 0.123f32.to_bits() } else { 1 };
        let mut configuration = BOARD.joint;
        assert!(setting.set(&mut configuration, number));
        assert_eq!(setting.get(&configuration), number, "{}", text.name);
        // And nothing else changed.
        assert!(setting.set(&mut configuration, setting.get(&BOARD.joint)));
        assert_eq!(configuration, BOARD.joint, "{}", text.name);
    }
}

#[test]
fn compensation_acts_at_once_also_under_way_and_the_rest_does_not() {
    let mut node = Node::operational();
    node.observed.telemetry.state = State::OperationEnabled;
    node.set_real(0x2200, 3, 0.8).unwrap();
    node.download(0x2200, 1, &[2]).unwrap();
    assert_eq!(node.objects.program().configured.last().unwrap().compensation.gain, 0.8);
    assert_eq!(node.set_real(0x2200, 3, 1.5), Err(0x0609_0030));
    assert_eq!(node.number(0x2100, 3) >> 8, 0x22_0003, "index and sub-index of the compensation gain");
    assert_eq!(node.real(0x2200, 3), 0.8);
    assert_eq!(node.download(0x2200, 1, &[4]), Err(0x0609_0030));
    node.set_real(0x2103, 1, 0.03).unwrap();
    assert_eq!(take(&mut node), Err(0x0800_0022));
    assert_eq!(node.set_real(0x2012, 5, 9.0), Err(0x0800_0022));
}

#[test]
fn a_payload_acts_at_once_also_under_way_and_leaves_what_is_staged() {
    let mut node = Node::operational();
    node.set_real(0x2104, 3, 0.5).unwrap();
    node.observed.telemetry.state = State::OperationEnabled;
    node.set_real(0x2202, 6, 0.4).unwrap();
    node.set_real(0x2202, 5, 2.5).unwrap();
    node.download(0x2202, 1, &[3]).unwrap();
    let load = node.objects.program().configured.last().unwrap().load;
    assert_eq!((load.payload_mass, load.payload_arm, load.request), (2.5, 0.4, LoadFeedforwardRequest::Both));
    for (sub_index, value) in [(2, -1e-3), (3, 2_000.5), (4, f32::NAN), (5, 1_001.0), (6, 10.1)] {
        assert_eq!(node.set_real(0x2202, sub_index, value), Err(0x0609_0030), "{value}");
        assert_eq!(node.number(0x2100, 3) >> 8, 0x22_0200 | u64::from(sub_index), "index and sub-index of the setting");
    }
    assert_eq!(node.download(0x2202, 1, &[4]), Err(0x0609_0030));
    for (sub_index, least, most) in [(1, 0.0, 2_000.0), (3, 0.0, 0.9f32)] {
        for value in [least, most] {
            node.set_real(0x2203, sub_index, value).unwrap();
        }
        for value in [-1e-3, most.next_up(), f32::NAN] {
            assert_eq!(node.set_real(0x2203, sub_index, value), Err(0x0609_0030), "{value}");
            let named = node.number(0x2100, 3) >> 8;
            assert_eq!(named, 0x22_0300 | u64::from(sub_index), "index and sub-index of the setting");
        }
    }
    for reaction in 0..=4 {
        node.download(0x2203, 2, &[reaction]).unwrap();
        let load = node.objects.program().configured.last().unwrap().load;
        assert_eq!((load.collision_reaction as u8, node.number(0x2203, 2)), (reaction, reaction.into()));
    }
    assert_eq!(node.download(0x2203, 2, &[5]), Err(0x0609_0030));
    assert_eq!((node.real(0x2202, 5), node.number(0x2202, 1), node.real(0x2104, 3)), (2.5, 3, 0.5));
    node.observed.telemetry.state = State::SwitchOnDisabled;
    take(&mut node).unwrap();
    let taken = *node.objects.program().configured.last().unwrap();
    assert_eq!((taken.gains.stiffness, taken.load.payload_mass), (0.5, 2.5));
}

#[test]
fn a_control_step_that_takes_nothing_is_told_from_a_refusal() {
    let mut node = Node::new();
    node.objects.program().busy = true;
    assert_eq!(take(&mut node), Err(0x0800_0022));
    assert_eq!(node.number(0x2100, 2), 2);
}

#[test]
fn ranges_are_positive_and_no_wider_than_a_command_may_be() {
    let mut node = Node::new();
    for range in Range::ALL {
        let sub_index = range as u8 + 1;
        for value in [0.0, -1.0, f32::NAN, f32::INFINITY, 1.001 * range.widest()] {
            assert_eq!(node.set_real(0x2012, sub_index, value), Err(0x0609_0030), "{range:?} {value}");
        }
        node.set_real(0x2012, sub_index, range.widest()).unwrap();
        assert_eq!(node.real(0x2012, sub_index), range.widest());
    }
}

#[test]
fn the_oscillator_is_trimmed_by_ten_steps_to_either_side_and_no_further() {
    for (trim, taken) in [(53, false), (54, true), (64, true), (74, true), (75, false)] {
        let mut node = Node::new();
        node.download(0x2105, 1, &[trim]).unwrap();
        assert_eq!(take(&mut node).is_ok(), taken, "{trim}");
        let refused = Name::from_code(node.number(0x2100, 3) as u32).text();
        assert_eq!(refused, if taken { "" } else { "oscillator trim" });
        let low_and_high = if taken { (0.0, 0.0) } else { (54.0, 74.0) };
        assert_eq!((node.real(0x2100, 5), node.real(0x2100, 6)), low_and_high);
    }
}

#[test]
fn what_is_stored_is_there_after_a_reset_and_restored_it_is_not() {
    let mut node = Node::new();
    node.set_real(0x2104, 3, 0.5).unwrap();
    take(&mut node).unwrap();
    node.set_real(0x2012, 5, 9.0).unwrap();
    node.set_real(0x2200, 3, 0.25).unwrap();
    node.download(0x1017, 0, &[50, 0]).unwrap();
    node.download(0x1802, 5, &[20, 0]).unwrap();
    // Staged, not taken: not stored.
    node.set_real(0x2104, 4, 0.9).unwrap();
    node.download(0x1010, 1, b"save").unwrap();
    let again = |node: &mut Node| {
        let record = node.objects.program().record.clone().unwrap();
        Node::with(Some(record), false)
    };
    let mut node = again(&mut node);
    assert_eq!((node.real(0x2104, 3), node.real(0x2012, 5), node.real(0x2200, 3)), (0.5, 9.0, 0.25));
    assert_eq!((node.number(0x1017, 0), node.number(0x1802, 5)), (50, 20));
    assert_eq!(node.real(0x2104, 4), BOARD.joint.gains.damping);
    node.download(0x1011, 3, b"load").unwrap();
    assert_eq!(node.real(0x2104, 3), 0.5, "only after the next reset");
    // Storing communication does not bring back what was restored.
    node.download(0x1010, 2, b"save").unwrap();
    let mut node = again(&mut node);
    assert_eq!((node.real(0x2104, 3), node.real(0x2012, 5)), (BOARD.joint.gains.stiffness, DEFAULT_RANGES[4]));
    assert_eq!(node.number(0x1017, 0), 50);
    node.download(0x1011, 1, b"load").unwrap();
    assert_eq!(again(&mut node).number(0x1017, 0), 0);
}

/// A record with everything in it.
fn whole() -> Vec<u8> {
    let mut communication = default_communication(9);
    communication.heartbeat = 50;
    let joint = crate::default_configuration::MOTEUS_R4.joint;
    let update = Update {
        node_id: Some(17),
        application: Part::New((&joint, [1.0, 2.0, 3.0, 4.0, 5.0])),
        communication: Part::New((9, &communication)),
    };
    let mut record = [0; RECORD];
    let length = update.encode(None, false, &mut record).unwrap();
    record[..length].to_vec()
}

#[test]
fn the_whole_record_comes_back_and_fits() {
    let record = whole();
    assert_eq!(record.len(), 1_319);
    let configuration = Configuration { node_id: 17, ..crate::default_configuration::MOTEUS_R4.joint };
    let stored = Stored::decode(&record, &BOARD.joint).unwrap();
    assert_eq!((stored.configuration(&BOARD.joint), stored.ranges()), (configuration, [1.0, 2.0, 3.0, 4.0, 5.0]));
    assert_eq!(communication_parameters(Some(&record), 9).heartbeat, 50);
    assert_eq!(communication_parameters(Some(&record), 10), default_communication(10), "for another node id");
    assert_eq!(communication_parameters(None, 9), default_communication(9));
    // Date and time of the configuration are stored where there are any, and fit too.
    let communication = CommunicationParameters { verification: [1, 2], ..default_communication(9) };
    let update = Update { node_id: None, application: Part::Kept, communication: Part::New((9, &communication)) };
    let mut dated = [0; RECORD];
    let length = update.encode(Some(&record), false, &mut dated).unwrap();
    assert_eq!((length, communication_parameters(Some(&dated[..length]), 9)), (1_333, communication));
    assert_eq!(Stored::decode(&[2], &BOARD.joint), None);
    assert_eq!(Stored::decode(&[2, 255, 0], &BOARD.joint), None);
    assert_eq!(Stored::decode(&[1, 255, 0], &BOARD.joint), Some(Stored::NOTHING));
}

#[test]
fn what_an_update_keeps_of_a_record_are_the_same_bytes_but_for_objects_that_nobody_knows() {
    let before = whole();
    let update = |node_id, application, communication, before: &[u8]| {
        let mut record = [0; RECORD];
        let length = Update { node_id, application, communication }.encode(Some(before), false, &mut record).unwrap();
        record[..length].to_vec()
    };
    assert_eq!(update(None, Part::Kept, Part::Kept, &before), before);
    let other = update(Some(18), Part::Kept, Part::Kept, &before);
    assert_eq!((other[1], &other[2..]), (18, &before[2..]));

    let (application, communication) =
        (update(None, Part::Kept, Part::Removed, &before), update(None, Part::Removed, Part::Kept, &before));
    assert_eq!((application[2], communication[2]), (0, 9));
    assert_eq!([&before[..3], &application[3..], &communication[3..]].concat(), before);
    assert_eq!(update(None, Part::Removed, Part::Removed, &before), [1, 17, 0]);

    let unknown = [&before[..], &[0xFF, 0x2F, 1, 1, 2, 3, 4]].concat();
    assert_eq!(update(None, Part::Kept, Part::Kept, &unknown), before);
    // A record in another format is not kept.
    assert_eq!(update(None, Part::Kept, Part::Kept, &[2, 17, 9]), [1, 255, 0]);
}

#[test]
fn a_record_without_limit_damping_gets_the_least_that_its_limits_permit() {
    let mut node = Node::new();
    for (sub_index, value) in [(1, 90.0), (2, 6.0), (12, 200.0)] {
        node.set_real(0x2103, sub_index, value).unwrap();
    }
    take(&mut node).unwrap();
    node.download(0x1010, 1, b"save").unwrap();
    let record = node.objects.program().record.clone().unwrap();
    let damping = |record: &[u8]| {
        let (configuration, _) = Stored::decode(record, &BOARD.joint).unwrap().application.unwrap();
        configuration.prepare(&BOARD.bridge).unwrap().limits.damping
    };
    assert_eq!(damping(&record), 200.0);
    let items = record[3..].chunks(7).filter(|item| item[..3] != [0x03, 0x21, 12]);
    let older: Vec<u8> = record[..3].iter().chain(items.flatten()).copied().collect();
    assert_eq!((older.len(), damping(&older)), (record.len() - 7, 75.0));
}

#[test]
fn a_joint_of_one_bank_stores_only_with_its_motor_off() {
    for (single_bank, expected) in [(true, Err(0x0800_0022)), (false, Ok(()))] {
        let mut node = Node::with(None, single_bank);
        node.observed.telemetry.state = State::SwitchedOn;
        assert_eq!(node.download(0x1010, 1, b"save"), expected);
        node.observed.telemetry.state = State::Fault;
        assert_eq!(node.download(0x1010, 1, b"save"), Ok(()));
    }
}

#[test]
fn a_joint_of_one_bank_stores_only_where_no_turn_of_its_encoder_is_lost_meanwhile() {
    // A quarter turn of the rotor in the 30 ms that a page may take.
    let limit = 0.25 * core::f32::consts::TAU / 0.03 / BOARD.joint.gear.ratio;
    for (single_bank, velocity, expected) in [
        (true, 0.99 * limit, Ok(())),
        (true, 1.01 * limit, Err(0x0800_0022)),
        (true, -1.01 * limit, Err(0x0800_0022)),
        (true, f32::NAN, Err(0x0800_0022)),
        (false, 1.01 * limit, Ok(())),
    ] {
        let mut node = Node::with(None, single_bank);
        node.observed.telemetry.motion.velocity = velocity;
        assert_eq!(node.download(0x1010, 1, b"save"), expected, "{velocity} rad/s");
    }
}

#[test]
fn a_joint_of_one_bank_takes_a_key_only_with_its_motor_off() {
    let key: [u8; 32] = core::array::from_fn(|place| place as u8);
    for (single_bank, expected) in [(true, Err(0x0800_0022)), (false, Ok(()))] {
        let mut node = Node::with(None, single_bank);
        node.observed.telemetry.state = State::OperationEnabled;
        assert_eq!(node.download(0x2215, 6, &key), expected);
        assert_eq!(node.objects.program().kept.pop().is_some(), expected.is_ok());
        node.observed.telemetry.state = State::SwitchOnDisabled;
        assert_eq!(node.download(0x2215, 6, &key).is_ok(), single_bank, "once");
    }
}

#[test]
fn a_flash_that_fails_is_reported_and_nothing_counts_as_stored() {
    let mut node = Node::new();
    node.objects.program().fails = Some(SlotError::NoPrevious);
    assert_eq!(node.download(0x1010, 1, b"save"), Err(0x0606_0000));
    assert_eq!(node.number(0x1003, 1) as u16, emergency::FLASH);
}

#[test]
fn an_option_code_acts_at_once_also_under_way_and_comes_back_after_a_reset() {
    let codes: [(u16, &[u16], &[u16]); 6] = [
        (0x6007, &[3, 1], &[0, 2, 4, 0xFFFF]),
        (0x605A, &[0, 1, 5, 6], &[3, 4, 7, 0xFFFF, 0x0106]),
        (0x605B, &[0, 1], &[2, 0xFFFF]),
        (0x605C, &[0, 1], &[2]),
        (0x605D, &[1, 2], &[0, 3]),
        (0x605E, &[0, 1, 2], &[3, 0xFFFF]),
    ];
    let mut node = Node::operational();
    node.observed.telemetry.state = State::OperationEnabled;
    for (index, taken, refused) in codes {
        for &code in taken {
            node.download(index, 0, &code.to_le_bytes()).unwrap();
            assert_eq!(node.number(index, 0) as u16, code, "{index:04X}h");
        }
        let before = *node.objects.program().configured.last().unwrap();
        for &code in refused {
            assert_eq!(node.download(index, 0, &code.to_le_bytes()), Err(0x0609_0030), "{index:04X}h = {code}");
        }
        assert_eq!(*node.objects.program().configured.last().unwrap(), before);
    }
    assert_eq!(node.objects.program().configured.last().unwrap().stops.quick_stop, 6);
}
