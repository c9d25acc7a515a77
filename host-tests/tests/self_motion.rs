//! Compensation never moves a joint by itself: over many random joints, with a model that is wrong by 50 % in every
//! parameter and sensors up to two periods late, a joint that is not commanded to move does not start, and one that was
//! pushed comes to rest: free, held by a spring of its own or of its master's, with a payload that swings or is borne.

use host_tests::in_the_loop::for_seeds;
use host_tests::left_alone::{Alone, ERROR, judged};
use host_tests::variant::DEFAULT;

/// Random joints.
const JOINTS: u64 = 1000;

#[test]
fn no_joint_starts_to_move_or_keeps_moving_by_itself() {
    let judged = for_seeds(0..JOINTS, |seed| judged(seed, &DEFAULT));
    let drift = judged.iter().fold(0.0f64, |largest, (drift, _)| largest.max(*drift));
    let bad: Vec<String> = judged.into_iter().flat_map(|(_, bad)| bad).collect();
    println!(
        "{JOINTS} joints, model wrong by {ERROR} in every parameter: largest drift {drift:.2e} rad, bad cases {} of {}",
        bad.len(),
        JOINTS as usize * Alone::ALL.len()
    );
    assert!(bad.is_empty(), "{}", bad.join("\n"));
}
