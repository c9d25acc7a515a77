//! The external torque on random joints whose friction model and load are right, and wrong by 30 %: its error and
//! whether the stated uncertainty covers it, no collision where nothing touches a joint, and time and torque at which a
//! push, a hand and a wall are found. docs/external-torque.md has the figures.

use host_tests::in_the_loop::{for_seeds, median};
use host_tests::samples::{count, every};
use host_tests::touched::{Touch, Wrong, touched, untouched};

/// Median and worst.
type Spread = (f64, f64);

/// Joints.
const JOINTS: (u64, u64) = (8, 20);
/// Threshold of a collision, as a part of the torque limit.
const THRESHOLD: f64 = 0.03;

/// Errors of friction and load as parts of the truth, and with them the RMS of the external torque's error at rest and
/// in moves, % of the torque limit, median and worst of docs/external-torque.md.
const ERRORS: [(f64, f64, Spread, Spread); 4] = [
    (0.0, 0.0, (0.9, 9.8), (0.7, 10.1)),
    (0.3, 0.0, (1.1, 10.1), (1.0, 10.1)),
    (0.0, 0.3, (1.6, 8.0), (2.3, 7.7)),
    (0.3, 0.3, (1.6, 7.7), (2.5, 8.0)),
];
/// Least share of the time in which the uncertainty covers the error, %, of every joint.
const COVERED: f64 = 99.4;

/// Touches, and time until they are found and torque by then, s and % of the torque limit, median and worst of
/// docs/external-torque.md.
const TOUCHES: [(Touch, Spread, Spread); 5] = [
    (Touch::Push(0.2), (0.0105, 0.038), (20.0, 20.0)),
    (Touch::Push(0.4), (0.007, 0.013), (40.0, 40.0)),
    (Touch::Wall(2.0), (0.0495, 0.150), (17.4, 33.6)),
    (Touch::Wall(20.0), (0.014, 0.024), (48.5, 93.0)),
    (Touch::Wall(200.0), (0.006, 0.009), (202.4, 393.2)),
];

fn seeds() -> std::ops::Range<u64> {
    1..1 + count(JOINTS.0, JOINTS.1)
}

/// Median and worst.
fn both(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let values: Vec<f64> = values.collect();
    (median(values.clone()), values.into_iter().fold(f64::MIN, f64::max))
}

/// True where it is as published, and a tenth of it; the median where every joint was judged.
fn held((middle, worst): (f64, f64), limits: (f64, f64)) -> bool {
    (!every() || middle <= 1.1 * limits.0) && worst <= 1.1 * limits.1
}

fn of<T>(results: Vec<Result<T, String>>) -> Vec<T> {
    results.into_iter().map(Result::unwrap).collect()
}

#[test]
fn the_uncertainty_covers_the_error_and_nothing_is_a_collision_where_nothing_touches() {
    for (friction, load, rest, moves) in ERRORS {
        let found = of(for_seeds(seeds(), |seed| untouched(seed, Wrong { friction, load }, THRESHOLD)));
        let collisions: u16 = found.iter().map(|found| found.collisions).sum();
        for (name, moving, published) in [("at rest", false, rest), ("in moves", true, moves)] {
            let errors = || found.iter().map(|found| if moving { &found.moving } else { &found.at_rest });
            let rms = both(errors().map(|errors| errors.rms()));
            let bound = both(errors().map(|errors| errors.bound()));
            let covered = errors().map(|errors| errors.covered()).fold(100.0, f64::min);
            let what = format!("friction {friction} and load {load} wrong, {name}");
            println!("{what}: RMS {rms:.1?} %, uncertainty {bound:.1?} %, covers {covered:.2} %");
            assert!(held(rms, published), "{what}: {rms:?} % of the torque limit");
            assert!(covered >= COVERED, "{what}: covers {covered} % of the time");
        }
        assert_eq!(collisions, 0, "friction {friction} and load {load} wrong");
    }
}

#[test]
fn a_push_a_hand_and_a_wall_are_found_in_time_where_friction_and_load_are_wrong_by_30_percent() {
    for (touch, published, torques) in TOUCHES {
        let found = of(for_seeds(seeds(), |seed| touched(seed, Wrong { friction: 0.3, load: 0.3 }, THRESHOLD, touch)));
        let missed = found.iter().filter(|found| found.after.is_none()).count();
        let after = both(found.iter().filter_map(|found| found.after));
        let torque = both(found.iter().map(|found| found.torque));
        println!("{touch:?}: {missed} missed, after {after:.4?} s, at {torque:.1?} % of the torque limit");
        assert_eq!(missed, 0, "{touch:?}");
        assert!(held(after, published) && held(torque, torques), "{touch:?}: {after:?} s, {torque:?} %");
    }
}
