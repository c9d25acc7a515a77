//! 2022h: friction by its parts.

use super::*;
use friction_compensation::compensation::Parts;
use friction_compensation::quantity::Torque;

#[test]
fn friction_is_told_by_its_parts_and_adaptation_by_what_it_adds() {
    let mut node = Node::operational();
    let of = |value: f32| Torque::from_bits((value * 65_536.0) as i32);
    let compensated = &mut node.observed.telemetry.compensated;
    compensated.output.parts = [Parts { physical: of(1.5), network: of(-0.25), pre_sliding: of(0.75) }];
    // Half of the image's 2 Nm is permitted; a quarter more is adaptation's.
    (compensated.output.torque, compensated.permitted, compensated.torque) = (of(2.0), 0.5, 1.25);
    let told = [1, 2, 3, 4].map(|sub_index| node.number(0x2022, sub_index) as i16);
    assert_eq!(told, [1_500, -250, 750, 250]);
    node.observed.telemetry.compensated.output.parts = [Parts { physical: of(-40.0), ..Parts::default() }];
    assert_eq!(node.number(0x2022, 1) as i16, i16::MIN);
}
