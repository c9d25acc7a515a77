//! Writes docs/eight-motions.md: the table of 001 on a machine of four virtual joints, each of which goes eight motions
//! that its image was not learned from.
//!
//! `cargo bench -p host-tests --bench eight_motions > docs/eight-motions.md`; some minutes. It fails where the mean is
//! above what is promised.

use host_tests::in_the_loop::{RandomJoint, for_seeds};
use plant::ActuatorParameters;
use plant::excitation::{Segment, Trajectory};
use plant::fourier::FourierSeries;
use std::f64::consts::TAU;
use std::ops::Range;

/// Joints of the machine; nothing was developed with them.
const JOINTS: Range<u64> = 601..605;
/// Each motion is repeated until it takes as long, s.
const DURATION: f64 = 8.0;
/// Largest mean error with compensation, %.
const PROMISED: f64 = 12.0;

fn main() {
    // Cargo passes `--bench`; tests, which pass nothing, have no minutes for it.
    if !std::env::args().any(|argument| argument == "--bench") {
        return;
    }
    let joints = for_seeds(JOINTS, |seed| {
        let joint = RandomJoint::commissioned(seed).unwrap();
        motions(&joint.parameters).map(|(name, segments)| (name, joint.along(&repeated(segments)).unwrap()))
    });
    println!("# Eight motions of four joints\n");
    println!(
        "Written by `cargo bench -p host-tests --bench eight_motions`: simulation, no hardware. Table 3 of\n\
         [001](bibliography.md#p001) in form: a machine of four joints, which are drawn at random, commissioned, excited without\n\
         compensation, recorded and fitted by `jointctl fit`'s pipeline, then moved in eight ways, none of which was recorded.\n\
         Relative torque error (eq. 11), %: mean of |friction - compensation| / |motor torque| where the motor torque is at least a\n\
         tenth of its RMS. A: without compensation, B: with it, as in the paper, whose means are 57 to 61 and 25.5 to 31.\n"
    );
    let heads: Vec<_> = (1..=joints.len()).map(|joint| format!(" joint {joint}, A | B |")).collect();
    println!("| |{}\n|---|{}", heads.concat(), "---|".repeat(2 * joints.len()));
    for motion in 0..joints[0].len() {
        let cells: Vec<_> = joints.iter().map(|joint| cells(joint[motion].1)).collect();
        println!("| {} |{}", joints[0][motion].0, cells.concat());
    }
    let means: Vec<_> = joints.iter().map(|joint| [0, 1].map(|way| mean(joint.iter().map(|(_, e)| e[way])))).collect();
    println!("| mean |{}", means.iter().map(|means| cells(*means)).collect::<String>());
    let [without, with] = [0, 1].map(|way| mean(means.iter().map(|means| means[way])));
    println!("\nMean of all: {without:.1} % without, {with:.1} % with; at most {PROMISED} % are permitted.");
    assert!(with <= PROMISED, "{with} %");
}

fn cells([without, with]: [f64; 2]) -> String {
    format!(" {without:.1} | {with:.1} |")
}

fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len() as f64;
    values.sum::<f64>() / count
}

/// The segments again and again.
fn repeated(segments: Vec<Segment>) -> Trajectory {
    let once = Trajectory::new(segments.clone()).unwrap();
    let times = (DURATION / once.duration()).ceil() as usize;
    Trajectory::new(std::iter::repeat_n(segments, times).flatten().collect()).unwrap()
}

/// Eight motions by shares of a joint's travel and speed.
fn motions(parameters: &ActuatorParameters) -> [(&'static str, Vec<Segment>); 8] {
    let limits = &parameters.joint.limits;
    let acceleration = 0.4 * parameters.joint.usable_acceleration().min(20.0);
    let go = |to: f64, speed: f64| Segment::Move { to: to * limits.travel, speed: speed * limits.speed, acceleration };
    let there_and_back = |to: f64, speed: f64| vec![go(to, speed), go(-to, speed), go(0.0, speed)];
    let rest = Segment::Rest { duration: 0.3 };
    let stairs = [0.15, 0.3, 0.45, 0.3, 0.15, 0.0].map(|to| [go(to, 0.25), rest.clone()]).concat();
    let wave = |period: f64, amplitude: f64| {
        let fundamental = TAU / period;
        let fastest = (0.3 * acceleration / fundamental).min(amplitude * limits.travel * fundamental);
        // Two harmonics, the second a third of the first.
        let speed = fastest.min(0.6 * limits.speed);
        let series = FourierSeries { fundamental, cosine: vec![0.0, 0.3 * speed], sine: vec![speed, 0.0] };
        vec![Segment::Fourier { series, duration: 2.0 * period }]
    };
    [
        ("to and fro, half of the speed limit", there_and_back(0.7, 0.5)),
        ("to and fro, a fifth", there_and_back(0.5, 0.2)),
        ("to and fro, a twentieth", there_and_back(0.1, 0.05)),
        ("one way further than the other", vec![go(0.8, 0.4), go(-0.2, 0.15), go(0.0, 0.3)]),
        ("short strokes", there_and_back(0.06, 0.3)),
        ("stairs with rests", stairs),
        ("two harmonics, 2 s", wave(2.0, 0.3)),
        ("two harmonics, 6 s", wave(6.0, 0.5)),
    ]
}
