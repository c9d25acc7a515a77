//! Forward dynamics beside MuJoCo's, on random trees and states, through MJCF.
//!
//! Without Python, or where MuJoCo cannot be installed, reported as ignored by name; with `CI` set it runs, and fails.

use libtest_mimic::{Arguments, Failed, Trial};
use python::Packages;
use rigid_body::articulated_body::forward_dynamics;
use rigid_body::mjcf::{JointFriction, mjcf};
use rigid_body::newton_euler::inverse_dynamics;
use rigid_body::random_tree::{Shape, state, tree};
use serde::Deserialize;
use serde_json::json;
use std::path::Path;
use std::process::Command;

const MUJOCO: Packages =
    Packages { folder: "python-mujoco", install: &["mujoco==3.3.7", "numpy==2.3.5"], import: "mujoco, numpy" };
/// Largest departure, relative to the largest acceleration: MuJoCo finds the principal axes of every link itself, to
/// some 1e-7.
const MARGIN: f64 = 1e-6;

#[derive(Deserialize)]
struct Answer {
    acceleration: Vec<f64>,
    mass: f64,
    joints: usize,
}

fn main() {
    let arguments = Arguments::from_args();
    let must_run = std::env::var_os("CI").is_some();
    let python = if arguments.list { None } else { MUJOCO.python(env!("CARGO_TARGET_TMPDIR")) };
    let ignored = !must_run && python.is_none();
    let name = "accelerations_are_those_of_mujoco";
    let trial = Trial::test(name, move || as_mujoco(python.as_deref())).with_ignored_flag(ignored);
    libtest_mimic::run(&arguments, vec![trial]).exit();
}

fn as_mujoco(python: Option<&Path>) -> Result<(), Failed> {
    let python = MUJOCO.required(python)?;
    let (mut cases, mut robots) = (Vec::new(), Vec::new());
    for seed in 0..24u64 {
        let shape = Shape { joints: 1 + seed as usize % 12, branches: seed % 2 == 1, prismatic: 0.25, armature: true };
        let tree = tree(shape, seed);
        let [q, v, a] = state(shape.joints, 100 + seed);
        // A torque that moves it somehow; MuJoCo takes the damping off itself.
        let torque = inverse_dynamics(&tree, &q, &v, &a);
        let damping = 0.1 * (seed % 3) as f64;
        let left: Vec<f64> = torque.iter().zip(&v).map(|(torque, v)| torque - damping * v).collect();
        let expected = forward_dynamics(&tree, &q, &v, &left).ok_or("no inertia")?;
        let friction = vec![JointFriction { damping, frictionloss: 0.0 }; shape.joints];
        let names: Vec<String> = (0..shape.joints).map(|i| format!("link_{i}")).collect();
        let text = mjcf(&tree, &names, &friction, &[], "random");
        let joints: Vec<&str> = tree.joints.iter().map(|joint| joint.name.as_str()).collect();
        cases.push(json!({ "mjcf": text, "names": joints, "q": q, "v": v, "torque": torque }));
        robots.push((tree, expected));
    }
    let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join("mujoco-cases.json");
    std::fs::write(&file, serde_json::to_vec(&cases)?)?;
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/accelerations.py");
    let output = Command::new(python).arg(script).arg(&file).output()?;
    if !output.status.success() {
        return Err(String::from_utf8_lossy(&output.stderr).into_owned().into());
    }
    let answers: Vec<Answer> = serde_json::from_slice(&output.stdout)?;
    if answers.len() != robots.len() {
        return Err(format!("{} answers to {} robots", answers.len(), robots.len()).into());
    }
    for ((tree, expected), answer) in robots.iter().zip(&answers) {
        let mass: f64 = tree.joints.iter().map(|joint| joint.link.mass).sum();
        let most = expected.iter().fold(1.0, |most: f64, x| most.max(x.abs()));
        let worst = answer.acceleration.iter().zip(expected).fold(0.0, |worst: f64, (a, b)| worst.max((a - b).abs()));
        let same = answer.joints == tree.len() && (answer.mass / mass - 1.0).abs() < 1e-9;
        if !same || worst.is_nan() || worst > MARGIN * most {
            return Err(format!("{} joints: {worst:e} of {most}, {} kg of {mass}", tree.len(), answer.mass).into());
        }
    }
    Ok(())
}
