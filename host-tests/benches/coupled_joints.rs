//! Writes docs/coupled-joints.md: an arm with two joints that share their drives, its friction by the models of 003 and
//! by this project's images, and computed torque with them.
//!
//! `cargo bench -p host-tests --bench coupled_joints > docs/coupled-joints.md`; some minutes.

use comparison::hysteresis::{Equation, Model, Regimes, Sample, leads};
use friction_compensation::compensation::Request;
use host_tests::virtual_arm::{IdentifiedArm, JOINTS, Loop, identified_from, partner, recorded};
use identification::metrics::{Metrics, metrics};
use identification::samples::Part;
use plant::Pair;

/// Joints of the arm that share their drives, with the speed by which one has to be the faster one, rad/s.
const JOINED: [usize; 2] = [1, 2];
const BAND: f64 = 0.04;
/// Factor of the dry friction of the joint that the other one outruns.
const RELIEF: f64 = 0.5;
/// Band of the models of 003, rad/s: the default of `robot.toml`, which ours have.
const MODEL_BAND: f64 = 0.05;

/// Least factor by which the images make the position error smaller.
const LEAST_GAIN: f64 = 14.4;

/// Largest part of the image's error that is left with the pair, and largest multiple of that of 003's last model.
const LEFT: f64 = 0.6;
const BESIDE: f64 = 1.3;

/// One model of one joint, judged on the other motion.
struct Row {
    name: String,
    errors: Metrics,
}

fn main() {
    if !std::env::args().any(|argument| argument == "--bench") {
        return;
    }
    let pairs = [Pair::new(JOINED, BAND, RELIEF)];
    let log = recorded(&pairs).unwrap();
    let [without, with] = [false, true].map(|described| identified_from(&log, &pairs, described).unwrap());
    introduction(&with);
    let judged = JOINED.map(|joint| judged(joint, &without, &with));
    friction(&judged);
    computed_torque(&without, &with);
}

/// Errors of all models of a joint.
fn judged(joint: usize, without: &IdentifiedArm, with: &IdentifiedArm) -> Vec<Row> {
    let samples = &with.recording.joints[joint].samples;
    let measured = &with.measured_friction()[joint];
    let all: Vec<Sample> = (0..samples.len())
        .map(|i| Sample {
            position: samples.position[i],
            velocity: samples.velocity[i],
            acceleration: samples.acceleration[i],
            friction: measured[i],
        })
        .collect();
    let other = &with.recording.joints[partner(&[Pair::new(JOINED, BAND, RELIEF)], joint).unwrap()].samples.velocity;
    let leads = leads(&samples.velocity, other, &samples.run, MODEL_BAND);
    let part = |i: &usize, test: bool| match samples.part[*i] {
        Part::Train | Part::Validation => !test,
        Part::Test => test,
        Part::Unused => false,
    };
    let trained: Vec<usize> = (0..all.len()).filter(|i| part(i, false)).collect();
    let tested: Vec<usize> = (0..all.len()).filter(|i| part(i, true)).collect();
    let row = |name: String, predicted: &dyn Fn(usize) -> f64| {
        let measured: Vec<f64> = tested.iter().map(|&i| measured[i]).collect();
        let predicted: Vec<f64> = tested.iter().map(|&i| predicted(i)).collect();
        Row { name, errors: metrics(&measured, &predicted, 0.0).unwrap().unwrap() }
    };
    let training: Vec<Sample> = trained.iter().map(|&i| all[i]).collect();
    let mut rows = vec![row("no model".into(), &|_| 0.0)];
    for equation in Equation::ALL {
        let model = Model::fit(equation, &training).unwrap();
        rows.push(row(format!("003, ({})", equation.number()), &|i| model.friction(&all[i])));
    }
    let regimes: Vec<bool> = trained.iter().map(|&i| leads[i]).collect();
    let model = Regimes::fit(Equation::Advanced, &training, &regimes).unwrap();
    rows.push(row("003, (5) by regime".into(), &|i| model.friction(&all[i], leads[i])));
    for (name, arm) in [("image, without the pair", without), ("image, with the pair", with)] {
        let image = &arm.image_friction().unwrap()[joint];
        rows.push(row(name.into(), &|i| image[i]));
    }
    rows
}

fn introduction(with: &IdentifiedArm) {
    println!("# Joints that share a drive\n");
    println!(
        "Written by `cargo bench -p host-tests --bench coupled_joints`: simulation, no hardware. The virtual arm of\n\
         [robot.md](robot.md) with two joints that share their drives (003, section II-C): the dry friction of each, load\n\
         included, is {RELIEF} times itself from when the other one is faster by {BAND} rad/s until it is faster by as much\n\
         itself. All joints are recorded at once and identified by `robot fit`, with and without `[[pair]]` in `robot.toml`.\n"
    );
    println!("| joint | part of its dry friction that is lost | found |\n|---|---|---|");
    for joint in JOINED {
        let found = with.reliefs[joint].expect("the relief of a joint of the pair is found");
        println!("| {} | {:.2} | {found:.2} |", joint + 1, 1.0 - RELIEF);
    }
    println!(
        "\nFound is the part that one parameter set has less of Coulomb, Stribeck and hysteresis terms than the other. Pre-sliding\n\
         and ripple are common to both ([model-choice.md](model-choice.md)): what they do not lose, these terms lose for them."
    );
}

fn friction(judged: &[Vec<Row>]) {
    println!(
        "\n## Friction torque\n\nOn a motion that no model has seen. Friction is that of 003, eq. (2), with the true links \
         and rotors. The models of\n003 are fitted to it by least squares; `robot fit` knows neither links nor rotors. \"By \
         regime\" is the paper's last model:\n(5) once for the samples in which the joint leads, once for the others.\n"
    );
    for (joint, rows) in JOINED.iter().zip(judged) {
        println!("| joint | model | MAE, Nm | MSE, Nm² | maximum error, Nm |\n|---|---|---|---|---|");
        for Row { name, errors } in rows {
            println!("| {} | {name} | {:.4} | {:.5} | {:.3} |", joint + 1, errors.mae, errors.mse, errors.max_error);
        }
        let [.., regimes, without, with] = &rows[..] else { panic!("too few models") };
        let [regimes, without, with] = [regimes, without, with].map(|row| row.errors.mae);
        println!(
            "\nJoint {}: the pair takes {:.0} % off the mean absolute error of the image, which is then {:.2} times that of 003's\n\
             last model.\n",
            joint + 1,
            100.0 * (1.0 - with / without),
            with / regimes
        );
        assert!(with < LEFT * without, "joint {}: MAE {with} Nm, {without} Nm without the pair", joint + 1);
        assert!(with < BESIDE * regimes, "joint {}: MAE {with} Nm, 003's last model {regimes} Nm", joint + 1);
    }
    println!(
        "The program fails above {LEFT} of the error without the pair, and above {BESIDE} times that of 003's model."
    );
}

fn computed_torque(without: &IdentifiedArm, with: &IdentifiedArm) {
    println!(
        "\n## Computed torque\n\nRMS position error, mrad, of another motion by 003, eq. (9), with low gains, the loop closed \
         in the joints. A controller\ntells each joint of the pair the other one's measured velocity (2030h:1) every \
         millisecond.\n"
    );
    println!("| | joint 1 | joint 2 | joint 3 | all |\n|---|---|---|---|---|");
    let all = [
        ("no compensation", with, Request::Off),
        ("images without the pair", without, Request::PhysicalAndNetwork),
        ("images with the pair", with, Request::PhysicalAndNetwork),
    ]
    .map(|(name, arm, request)| {
        let errors = arm.tracked(request, Loop::Joints).unwrap();
        let all = (errors.iter().map(|error| error * error).sum::<f64>() / JOINTS as f64).sqrt();
        let each: Vec<String> = errors.iter().map(|error| format!("{:.2}", 1e3 * error)).collect();
        println!("| {name} | {} | {:.2} |", each.join(" | "), 1e3 * all);
        all
    });
    let [off, alone, pair] = all;
    println!(
        "\nWith the pair the error becomes {:.1} times smaller, without it {:.1} times. The program fails below \
         {LEAST_GAIN} times.",
        off / pair,
        off / alone
    );
    assert!(off / pair >= LEAST_GAIN, "{} times", off / pair);
}
