//! Compensation never moves a joint by itself: over many random joints, with a model that is wrong by 30 % in every parameter and sensors
//! up to two periods late, a joint that is not commanded does not start, and one that was pushed comes to rest.

use host_tests::in_the_loop::for_seeds;
use host_tests::left_alone::{ERROR, judged};
use host_tests::variant::{DEFAULT, SPREAD, Variant};

/// Random joints.
const JOINTS: u64 = 1000;

#[test]
fn no_joint_starts_to_move_or_keeps_moving_by_itself() {
    moves_nothing(JOINTS, &DEFAULT);
}

#[test]
fn nor_does_one_with_friction_spread_over_two_steps() {
    moves_nothing(JOINTS / 10, &SPREAD);
}

fn moves_nothing(joints: u64, variant: &Variant) {
    let judged = for_seeds(0..joints, |seed| judged(seed, variant));
    let drift = judged.iter().fold(0.0f64, |largest, (drift, _)| largest.max(*drift));
    let bad: Vec<String> = judged.into_iter().flat_map(|(_, bad)| bad).collect();
    println!(
        "{joints} joints, {}: model wrong by {ERROR} in every parameter: largest drift {drift:.2e} rad, bad cases {}",
        variant.name,
        bad.len()
    );
    assert!(bad.is_empty(), "{}", bad.join("\n"));
}
