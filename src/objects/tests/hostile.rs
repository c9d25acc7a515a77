//! Random frames: nothing panics, and no torque is asked for outside OPERATIONAL.

use super::*;
use crate::joint::Command;
use crate::joint::state_machine::Controlword;
use crate::objects::table::OBJECTS;
use proptest::prelude::*;

/// Frames that might mean something: requests for objects that exist, PDOs, NMT, SYNC, and anything else.
fn frame() -> impl Strategy<Value = (u16, Vec<u8>)> {
    let request = (any::<[u8; 8]>(), 0..OBJECTS.len(), 0u8..16).prop_map(|(mut data, at, command)| {
        let commands = [0x20, 0x21, 0x22, 0x23, 0x27, 0x2B, 0x2F, 0x40, 0x60, 0x70, 0x00, 0x10, 0xA0, 0xC2, 0x01, 0x80];
        data[0] = commands[usize::from(command)];
        [data[1], data[2]] = OBJECTS[at].index.to_le_bytes();
        data[3] = OBJECTS[at].sub_index;
        (0x605, data.to_vec())
    });
    let small = (any::<u8>(), 0..OBJECTS.len()).prop_map(|(value, at)| {
        let [low, high] = OBJECTS[at].index.to_le_bytes();
        (0x605, vec![0x2F, low, high, OBJECTS[at].sub_index, value & 7, 0, 0, 0])
    });
    let pdo = (0u16..4, prop::collection::vec(any::<u8>(), 0..=8)).prop_map(|(pdo, data)| (0x205 + 0x100 * pdo, data));
    let nmt = prop::sample::select(vec![1u8, 1, 1, 2, 0x80, 0x81, 0x82]).prop_map(|command| (0, vec![command, NODE]));
    let other = (0u16..0x800, prop::collection::vec(any::<u8>(), 0..=8));
    prop_oneof![6 => request, 3 => small, 6 => pdo, 2 => nmt, 1 => Just((0x80, vec![])), 1 => other]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2_000))]
    #[test]
    fn whatever_comes_no_torque_is_asked_for_outside_operational(
        frames in prop::collection::vec((frame(), any::<f32>(), 0u32..20_000), 1..150),
    ) {
        let mut node = Node::operational();
        for ((id, data), value, time) in frames {
            node.now = node.now.wrapping_add(time);
            node.observed.telemetry.motion.position = value;
            (node.observed.telemetry.measured_torque, node.observed.telemetry.mean_torque) = (value, value);
            let before = (node.bus.state(), node.image.demand());
            node.receive(id, &data);
            let demand = node.image.demand();
            let Command { position, velocity, torque, stiffness, damping, .. } = demand.command;
            prop_assert!([position, velocity, torque, stiffness, damping].iter().all(|number| number.is_finite()));
            if node.bus.state() != NmtState::Operational {
                prop_assert_eq!((demand.controlword, demand.command), (Controlword::QUICK_STOP, Command::default()));
            }
            // A reset ends where it began, with transitions between.
            if id != 0 && before.0 != NmtState::Operational && node.bus.state() == before.0 {
                prop_assert_eq!(demand, before.1, "{:03x} {:02x?}", id, data);
            }
            // What is configured is always something that the joint can be.
            prop_assert!(node.objects.configuration().prepare(&BOARD.bridge).is_ok());
        }
    }
}
