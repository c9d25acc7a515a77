//! Writes docs/temperatures.md: moves of random joints that begin at 0 to 60 °C, without and with the image that they
//! learned at room temperature and above.
//!
//! `cargo bench -p host-tests --bench temperatures > docs/temperatures.md`; some minutes. It fails where compensation
//! makes a joint's error larger.

use host_tests::in_the_loop::{RandomJoint, for_seeds, median};
use host_tests::variant::DEFAULT;
use std::ops::Range;

/// Joints; nothing was developed with them.
const JOINTS: Range<u64> = 621..641;
/// Temperatures of the whole joint at the begin of its moves, °C.
const TEMPERATURES: [f64; 7] = [0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0];

/// Part of the error beyond which compensation is as good as off.
const STAYS: f64 = 0.9;
/// Change of the error that is none, % of the motor's torque.
const WORSE: f64 = 0.1;

fn main() {
    // Cargo passes `--bench`; tests, which pass nothing, have no minutes for it.
    if !std::env::args().any(|argument| argument == "--bench") {
        return;
    }
    let joints = for_seeds(JOINTS, |seed| {
        let joint = RandomJoint::commissioned(seed).unwrap();
        (joint.found.recorded, TEMPERATURES.map(|temperature| joint.begun_at(&DEFAULT, temperature).unwrap()))
    });
    let lowest = joints.iter().map(|(recorded, _)| recorded[0]).fold(f64::MAX, f64::min);
    let highest = joints.iter().map(|(recorded, _)| recorded[1]).fold(f64::MIN, f64::max);
    println!("# Temperatures\n");
    println!(
        "Written by `cargo bench -p host-tests --bench temperatures`: simulation, no hardware. {} joints, drawn at random and used\n\
         for nothing else, learn their image from recordings of {lowest:.0} to {highest:.0} °C by the board's sensor, all joints taken together, and\n\
         begin moves with motor, gear and board at another temperature, in their room. The firmware knows the\n\
         board's own sensor alone. Relative torque error of the moves ([001](bibliography.md#p001), eq. 11), %.\n",
        joints.len()
    );
    println!("| begin at | without, median | worst | with, median | worst | joints whose error stays |");
    println!("|---|---|---|---|---|---|");
    let mut harmed = Vec::new();
    for (n, temperature) in TEMPERATURES.iter().enumerate() {
        let errors: Vec<[f64; 2]> = joints.iter().map(|(_, errors)| errors[n]).collect();
        let column = |way: usize| errors.iter().map(|errors| errors[way]).collect::<Vec<_>>();
        let worst = |values: Vec<f64>| values.into_iter().fold(0.0, f64::max);
        let stays = errors.iter().filter(|[without, with]| with / without > STAYS).count();
        println!(
            "| {temperature} °C | {:.1} | {:.1} | {:.1} | {:.1} | {stays} |",
            median(column(0)),
            worst(column(0)),
            median(column(1)),
            worst(column(1))
        );
        harmed.extend(
            JOINTS
                .zip(&errors)
                .filter(|(_, [without, with])| *with > without + WORSE)
                .map(|(seed, _)| (seed, temperature)),
        );
    }
    println!(
        "\nFar above the temperatures of its recording a joint's compensation is off, and its error stays what it is without. The\n\
         program fails where an error becomes larger by more than {WORSE} %."
    );
    assert!(harmed.is_empty(), "worse with compensation, joint and °C: {harmed:?}");
}
