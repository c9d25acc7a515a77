//! Writes docs/temperatures.md: moves of random joints that begin at 0 to 60 °C, without and with the image that they
//! learned at room temperature and above.
//!
//! `cargo bench -p host-tests --bench temperatures > docs/temperatures.md`; some minutes. It fails where compensation
//! makes a joint's error larger.

use host_tests::in_the_loop::{RandomJoint, for_seeds, median};
use host_tests::variant::DEFAULT;
use std::ops::Range;

/// Joints; nothing was developed with them.
const JOINTS: Range<u64> = 641..661;
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
        let errors = TEMPERATURES.map(|temperature| joint.begun_at(&DEFAULT, temperature).unwrap());
        (joint.found.recorded, joint.found.network, errors)
    });
    let lowest = joints.iter().map(|(recorded, ..)| recorded[0]).fold(f64::MAX, f64::min);
    let highest = joints.iter().map(|(recorded, ..)| recorded[1]).fold(f64::MIN, f64::max);
    println!("# Temperatures\n");
    println!(
        "Written by `cargo bench -p host-tests --bench temperatures`: simulation, no hardware. {} joints, drawn at random and used\n\
         for nothing else, learn their image from recordings of {lowest:.0} to {highest:.0} °C by the board's sensor, all joints taken together, and\n\
         begin moves with motor, gear and board at another temperature, in their room. The firmware knows the\n\
         board's own sensor alone. Relative torque error of the moves ([001](bibliography.md#p001), eq. 11), %.\n",
        joints.len()
    );
    println!(
        "| begin at | without, median | worst | with, median | worst | joints whose error stays | of these with a network |"
    );
    println!("|---|---|---|---|---|---|---|");
    let mut harmed = Vec::new();
    for (n, temperature) in TEMPERATURES.iter().enumerate() {
        let errors: Vec<[f64; 2]> = joints.iter().map(|(.., errors)| errors[n]).collect();
        let column = |way: usize| errors.iter().map(|errors| errors[way]).collect::<Vec<_>>();
        let worst = |values: Vec<f64>| values.into_iter().fold(0.0, f64::max);
        let stays = |[without, with]: &[f64; 2]| with / without > STAYS;
        let stay: Vec<bool> = joints.iter().zip(&errors).filter(|(_, e)| stays(e)).map(|(joint, _)| joint.1).collect();
        let networks = stay.iter().filter(|network| **network).count();
        println!(
            "| {temperature} °C | {:.1} | {:.1} | {:.1} | {:.1} | {} | {networks} |",
            median(column(0)),
            worst(column(0)),
            median(column(1)),
            worst(column(1)),
            stay.len()
        );
        harmed.extend(
            JOINTS
                .zip(&errors)
                .filter(|(_, [without, with])| *with > without + WORSE)
                .map(|(seed, _)| (seed, temperature)),
        );
    }
    println!(
        "\nWhere friction falls with heat and no network of the image takes the temperature as an input, the image counts up to twice as far\n\
         above the coldest temperature of its recording as the warmest is, unless its slope leaves less than a tenth of a friction there; other\n\
         images count up to the warmest one. Beyond, compensation fades and is off, and the error stays what it is without. The program fails\n\
         where an error becomes larger by more than {WORSE} %."
    );
    assert!(harmed.is_empty(), "worse with compensation, joint and °C: {harmed:?}");
}
