//! Writes docs/in-the-loop.md: the random joints, every joint's result, and what each layer of compensation costs and
//! prevents.
//!
//! `cargo bench -p host-tests --bench in_the_loop > docs/in-the-loop.md`; some minutes.

use host_tests::in_the_loop::{Moved, RandomJoint, for_seeds, median};
use host_tests::left_alone::{Alone, ERROR, Kind, Knowledge, judged};
use host_tests::variant::{ALL, DEFAULT, Variant};
use plant::actuator::ActuatorParameters;
use std::ops::Range;

/// Commissioned joints.
const JOINTS: Range<u64> = 1..21;
/// Joints that are left alone with a wrong model.
const ALONE: Range<u64> = 0..200;

fn main() {
    let commissioned = for_seeds(JOINTS, |seed| RandomJoint::commissioned(seed).unwrap());
    let run = |variant: Option<&Variant>| -> Vec<Moved> {
        let index = |seed: u64| &commissioned[(seed - JOINTS.start) as usize];
        let moved = |seed| variant.map_or_else(|| index(seed).without(), |variant| index(seed).with(variant));
        for_seeds(JOINTS, moved).into_iter().map(Result::unwrap).collect()
    };
    let without = run(None);
    let with: Vec<Vec<Moved>> = ALL.iter().map(|variant| run(Some(variant))).collect();
    let alone: Vec<usize> = ALL
        .iter()
        .map(|variant| {
            for_seeds(ALONE, |seed| judged((Kind::Randomised, seed), &Alone::ALL, variant, Knowledge::Wrong).1.len())
                .into_iter()
                .sum()
        })
        .collect();

    println!("# In the loop\n");
    println!(
        "Written by `cargo bench -p host-tests --bench in_the_loop`: simulation, no hardware. {} joints are drawn at random, excited \
         without\ncompensation, recorded with 4 ms samples, fitted by `jointctl fit`'s pipeline and moved with the image that came out.\n",
        commissioned.len()
    );
    ranges(&commissioned);
    joints(&commissioned, &without, &with[0]);
    layers(&without, &with, &alone);
}

/// Ranges in which the joints differ.
fn ranges(joints: &[RandomJoint]) {
    type Value = fn(&ActuatorParameters) -> f64;
    let rows: [(&str, Value); 16] = [
        ("supply, V", |p| p.bus.source_voltage),
        ("current limit, A", |p| p.joint.motor.current_limit),
        ("phase resistance, Ohm", |p| p.joint.motor.resistance / 1.5),
        ("inductance along q, mH", |p| 1e3 * p.windings.inductance_q),
        ("pole pairs", |p| p.windings.pole_pairs as f64),
        ("dead time, us", |p| 1e6 * p.inverter.dead_time),
        ("gear ratio", |p| p.joint.motor.gear_ratio),
        ("torque limit, Nm", |p| p.joint.motor.torque_limit()),
        ("inertia at the link, kg m^2", |p| p.joint.inertia()),
        ("speed limit, rad/s", |p| p.joint.limits.speed),
        ("Coulomb friction forward, % of the torque limit", |p| {
            100.0 * p.joint.friction.coulomb.forward / p.joint.motor.torque_limit()
        }),
        ("breakaway over Coulomb friction", |p| p.joint.friction.breakaway.forward / p.joint.friction.coulomb.forward),
        ("Stribeck velocity, rad/s", |p| p.joint.friction.stribeck_velocity),
        ("encoder, counts a turn of the rotor", |p| p.sensors.encoder.counts_per_turn as f64),
        ("encoder delay, periods", |p| p.sensors.encoder.delay as f64),
        ("current noise, % of the current limit", |p| 100.0 * p.sensors.currents.noise / p.joint.motor.current_limit),
    ];
    println!(
        "## The joints\n\nAll ranges are in `tools/plant/src/randomised.rs` and `tools/plant/src/actuator/randomised.rs`; these were drawn:\n"
    );
    println!("| | least | median | greatest |\n|---|---|---|---|");
    for (name, value) in rows {
        let values: Vec<f64> = joints.iter().map(|joint| value(&joint.parameters)).collect();
        let (low, high) = values.iter().fold((f64::MAX, f64::MIN), |(low, high), v| (low.min(*v), high.max(*v)));
        println!("| {name} | {low:.3} | {:.3} | {high:.3} |", median(values));
    }
}

fn joints(joints: &[RandomJoint], without: &[Moved], with: &[Moved]) {
    println!(
        "\n## Every joint\n\nTorque error: mean of |friction - compensation| / |motor torque| over moves, where the motor torque is at least a tenth \
         of its RMS\n(paper 001, eq. 11). Position error: RMS over slow reversals at a hundredth of the speed limit, equal gains.\n"
    );
    println!("| joint | network | torque error without, % | with, % | position error without, mrad | with, mrad | |");
    println!("|---|---|---|---|---|---|---|");
    for ((joint, off), on) in joints.iter().zip(without).zip(with) {
        println!(
            "| {} | {} | {:.1} | {:.1} | {:.3} | {:.3} | {:.1}x |",
            joint.seed,
            if joint.found.network { "yes" } else { "no" },
            off.moves.torque,
            on.moves.torque,
            1e3 * off.reversals.tracking,
            1e3 * on.reversals.tracking,
            off.reversals.tracking / on.reversals.tracking
        );
    }
}

fn layers(without: &[Moved], with: &[Vec<Moved>], alone: &[usize]) {
    let torque = |moved: &[Moved]| -> (f64, f64) {
        let errors: Vec<f64> = moved.iter().map(|moved| moved.moves.torque).collect();
        (median(errors.clone()), errors.into_iter().fold(0.0, f64::max))
    };
    println!(
        "\n## Every layer\n\nThe same with one layer taken away. \"Moves by itself\": {} joints ({} cases: free, held by a spring, with a payload) that nobody \
         moves,\npushed once, with a physical model that is {:.0} % wrong in every parameter and friction computed for the measured velocity,\n\
         the source that feeds back; cases that start, keep or gain motion, judged by energy.\n",
        ALONE.end - ALONE.start,
        Alone::ALL.len() as u64 * (ALONE.end - ALONE.start),
        100.0 * ERROR
    );
    println!("| | torque error, median, % | worst, % | slow reversals, median | moves by itself |");
    println!("|---|---|---|---|---|");
    let (middle, worst) = torque(without);
    println!("| no compensation | {middle:.1} | {worst:.1} | | 0 by definition |");
    for ((variant, moved), alone) in ALL.iter().zip(with).zip(alone) {
        let (middle, worst) = torque(moved);
        let gains = without.iter().zip(moved).map(|(off, on)| off.reversals.tracking / on.reversals.tracking);
        let gain = median(gains.collect());
        println!("| {} | {middle:.1} | {worst:.1} | {gain:.1}x | {alone} |", variant.name);
    }
    println!(
        "\nThe guard is what keeps a feedback of the measured velocity from becoming motion; with the command's velocity as the source there is \
         nothing to\nguard. Clamp, slew limit and fades change little here because these models are good and stay in their trained box: they bound \
         what a bad one\ncan do (`compensation.rs`)."
    );
    println!(
        "\nHow often a layer acts in \"{}\", median and most of the joints, % of the control steps:\n",
        DEFAULT.name
    );
    println!("| | moves | slow reversals |\n|---|---|---|");
    type Share = fn(&host_tests::in_the_loop::Shares) -> f64;
    let shares: [(&str, Share); 3] = [
        ("clamp or slew limit", |shares| shares.limited),
        ("a signal outside the trained box", |shares| shares.outside),
        ("fade at standstill", |shares| shares.withheld),
    ];
    for (name, share) in shares {
        let cell = |values: Vec<f64>| {
            let most = values.iter().fold(0.0f64, |most, value| most.max(*value));
            format!("{:.1}, {most:.1}", median(values))
        };
        let moves = with[0].iter().map(|moved| share(&moved.moves.shares)).collect();
        let reversals = with[0].iter().map(|moved| share(&moved.reversals.shares)).collect();
        println!("| {name} | {} | {} |", cell(moves), cell(reversals));
    }
}
