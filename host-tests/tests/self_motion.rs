//! Compensation never moves a joint by itself: over many random joints, with a model that is wrong by 50 % in every
//! parameter and sensors up to two periods late, a joint that is not commanded to move does not start, and one that was
//! pushed comes to rest: free, held by a spring of its own or of its master's, with a payload that swings or is borne.
//! `JOINT_SAMPLES=all` judges every joint of the published figures, else the first tenth of them.

use host_tests::in_the_loop::for_seeds;
use host_tests::left_alone::{Alone, ERROR, Kind, Knowledge, judged};
use host_tests::samples::count;
use host_tests::variant::{ADAPTIVE, DEFAULT, Variant};

/// Random joints: a part, and all.
const JOINTS: (u64, u64) = (100, 1000);
/// Random joints that are less like the firmware's model.
const JUDGING: (u64, u64) = (50, 1000);
/// Random joints whose feedforward bears their payload.
const BEARING: (u64, u64) = (10, 100);
/// Random joints that have learned before.
const EXPERIENCED: (u64, u64) = (20, 200);

/// Joint and situation that does, as docs/judging-joints.md says.
const KNOWN: &str = "(Judging, 654), Sprung: ";

#[test]
fn no_joint_starts_to_move_or_keeps_moving_by_itself() {
    leave_alone(Kind::Randomised, JOINTS, &Alone::ALL, &DEFAULT, Knowledge::Wrong);
}

#[test]
fn neither_does_one_whose_feedforward_bears_a_gravity_that_is_wrong_by_30_percent_or_reversed() {
    leave_alone(Kind::Randomised, BEARING, &Alone::BEARING, &DEFAULT, Knowledge::Wrong);
}

#[test]
fn neither_does_one_that_has_learned_its_friction_before() {
    leave_alone(Kind::Randomised, EXPERIENCED, &Alone::ALL, &ADAPTIVE, Knowledge::Experienced);
}

#[test]
fn neither_does_one_that_gives_way_or_has_backlash_and_is_configured_by_its_data_sheet_but_one() {
    leave_alone(Kind::Judging, JUDGING, &Alone::ALL, &DEFAULT, Knowledge::Wrong);
}

#[test]
fn neither_does_such_a_joint_that_has_learned_its_friction_before() {
    leave_alone(Kind::Judging, EXPERIENCED, &Alone::ALL, &ADAPTIVE, Knowledge::Experienced);
}

fn leave_alone(
    kind: Kind,
    (part, all): (u64, u64),
    situations: &[Alone],
    variant: &Variant,
    knowledge: Knowledge<'static>,
) {
    let joints = count(part, all);
    let judged = for_seeds(0..joints, |seed| judged((kind, seed), situations, variant, knowledge));
    let drift = judged.iter().fold(0.0f64, |largest, (drift, _)| largest.max(*drift));
    let bad: Vec<String> = judged.into_iter().flat_map(|(_, bad)| bad).collect();
    println!(
        "{joints} joints, model wrong by {ERROR} in every parameter: largest drift {drift:.2e} rad, bad {} of {}",
        bad.len(),
        joints as usize * situations.len()
    );
    let unknown: Vec<&str> = bad.iter().map(String::as_str).filter(|case| !case.starts_with(KNOWN)).collect();
    assert!(unknown.is_empty(), "{}", unknown.join("\n"));
}
