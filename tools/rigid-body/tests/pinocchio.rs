//! The dynamics beside Pinocchio's, on random trees and states, through URDF.
//!
//! Without Python, or where Pinocchio cannot be installed, reported as ignored by name; with `CI` set it runs, and
//! fails.

use libtest_mimic::{Arguments, Failed, Trial};
use nalgebra::DVector;
use python::Packages;
use rigid_body::Robot;
use rigid_body::mass_matrix::mass_matrix;
use rigid_body::newton_euler::inverse_dynamics;
use rigid_body::random_tree::{Shape, state, tree, urdf};
use rigid_body::regressor::regressor;
use serde_json::{Value, json};
use std::path::Path;
use std::process::Command;

const PINOCCHIO: Packages =
    Packages { folder: "python-pinocchio", install: &["pin==4.1.0", "numpy==2.3.5"], import: "pinocchio, numpy" };
/// Largest departure, relative to the largest value of a kind.
const MARGIN: f64 = 1e-9;

fn main() {
    let arguments = Arguments::from_args();
    let must_run = std::env::var_os("CI").is_some();
    let python = if arguments.list { None } else { PINOCCHIO.python(env!("CARGO_TARGET_TMPDIR")) };
    let ignored = !must_run && python.is_none();
    let name = "torques_mass_matrix_regressor_and_accelerations_are_those_of_pinocchio";
    let trial = Trial::test(name, move || as_pinocchio(python.as_deref())).with_ignored_flag(ignored);
    libtest_mimic::run(&arguments, vec![trial]).exit();
}

fn as_pinocchio(python: Option<&Path>) -> Result<(), Failed> {
    let python = PINOCCHIO.required(python)?;
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("pinocchio");
    std::fs::create_dir_all(&folder)?;
    let mut cases = Vec::new();
    let mut robots = Vec::new();
    for seed in 0..24u64 {
        let shape = Shape { joints: 1 + seed as usize % 12, branches: seed % 2 == 1, prismatic: 0.25, armature: false };
        let urdf = urdf(&tree(shape, seed), (-9.0, 9.0), 1.0);
        let drives: String = (0..shape.joints).map(|i| format!("[joint.joint_{i}]\n")).collect();
        let robot = Robot::new(&format!("urdf = ''\n{drives}"), "robot.toml", &urdf, "random.urdf")?;
        let [q, v, a] = state(shape.joints, 100 + seed);
        let names: Vec<&str> = robot.tree.joints.iter().map(|joint| joint.name.as_str()).collect();
        cases.push(json!({ "urdf": urdf, "names": names, "q": q, "v": v, "a": a }));
        robots.push((robot.tree, q, v, a));
    }
    let file = folder.join("cases.json");
    std::fs::write(&file, serde_json::to_vec(&cases)?)?;
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/dynamics.py");
    let output = Command::new(python).arg(script).arg(&file).output()?;
    if !output.status.success() {
        return Err(String::from_utf8_lossy(&output.stderr).into_owned().into());
    }
    let answers: Vec<Value> = serde_json::from_slice(&output.stdout)?;
    if answers.len() != robots.len() {
        return Err(format!("{} answers to {} robots", answers.len(), robots.len()).into());
    }
    for ((tree, q, v, a), answer) in robots.iter().zip(&answers) {
        let torque = inverse_dynamics(tree, q, v, a);
        let linear = regressor(tree, q, v, a);
        let accelerations = rigid_body::articulated_body::forward_dynamics(tree, q, v, &torque).ok_or("no inertia")?;
        let by_row = |matrix: &nalgebra::DMatrix<f64>| matrix.transpose().as_slice().to_vec();
        for (what, found) in [
            ("torque", torque.clone()),
            ("mass_matrix", by_row(&mass_matrix(tree, q))),
            ("regressor", by_row(&linear)),
            ("acceleration", accelerations),
            ("torque", (&linear * DVector::from_vec(tree.parameters())).as_slice().to_vec()),
        ] {
            let expected: Vec<f64> = serde_json::from_value(answer[what].clone())?;
            let most = expected.iter().fold(1.0, |most: f64, x| most.max(x.abs()));
            let worst = found.iter().zip(&expected).fold(0.0, |worst: f64, (a, b)| worst.max((a - b).abs()));
            if found.len() != expected.len() || worst.is_nan() || worst > MARGIN * most {
                return Err(format!("{what} of {} joints: {worst:e} of {most}", tree.len()).into());
            }
        }
    }
    Ok(())
}
