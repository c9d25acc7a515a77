//! A robot from files: fitted, written, and judged on another recording.

use super::synthetic::{RATE, Truth, fourier, robot};
use crate::evaluate::{Judged, evaluate, table};
use crate::{Options, files, fit, record};
use identification::fit::Options as JointOptions;
use identification::presets::Preset;
use identification::progress::Silent;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rigid_body::JointKind;
use rigid_body::random_tree::urdf;
use std::fmt::Write;
use std::path::Path;

/// Files of a robot in a folder.
fn write_robot(truth: &Truth, folder: &Path) {
    let (robot, n) = (&truth.robot, truth.robot.tree.len());
    let mut text = "urdf = 'robot.urdf'\n".to_owned();
    let coupled = robot.coupling[(n - 1, n - 2)] != 0.0;
    for (j, joint) in robot.tree.joints.iter().enumerate() {
        let ratio = if coupled && j + 2 >= n { 1.0 } else { robot.coupling[(j, j)] };
        writeln!(text, "[joint.{}]\ngain = {}\nratio = {ratio}", joint.name, robot.drives[j].gain).unwrap();
        if let Some(rotor) = robot.drives[j].rotor_inertia {
            writeln!(text, "rotor_inertia = {rotor:e}").unwrap();
        }
    }
    if coupled {
        let at = |i: usize, j: usize| robot.coupling[(n - 2 + i, n - 2 + j)];
        writeln!(text, "[coupling]\njoints = ['joint_{}', 'joint_{}']", n - 2, n - 1).unwrap();
        writeln!(text, "matrix = [[{:?}, {:?}], [{:?}, {:?}]]", at(0, 0), at(0, 1), at(1, 0), at(1, 1)).unwrap();
    }
    std::fs::write(folder.join("robot.toml"), text).unwrap();
    std::fs::write(folder.join("robot.urdf"), urdf(&robot.tree, (-9.0, 9.0), 50.0)).unwrap();
}

/// A recording of one motion, with noise of 2 % of each effort's RMS.
fn write_log(truth: &Truth, path: &Path, seconds: f64, seed: u64) {
    let n = truth.robot.tree.len();
    let motion = fourier(&truth.robot, seconds, 6, seed);
    let to_efforts = truth.robot.gains().try_inverse().unwrap();
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut text = "t".to_owned();
    (0..n).for_each(|j| write!(text, ",q{j},i{j}").unwrap());
    text.push('\n');
    let efforts: Vec<Vec<f64>> = (0..motion[0].len())
        .map(|i| {
            let state = [
                motion.iter().map(|joint| joint[i].position).collect(),
                motion.iter().map(|joint| joint[i].velocity).collect(),
                motion.iter().map(|joint| joint[i].acceleration).collect(),
            ];
            truth.efforts(&to_efforts, &state, 1.0)
        })
        .collect();
    let rms = |j: usize| super::synthetic::rms(&efforts.iter().map(|all| all[j]).collect::<Vec<_>>());
    let noise: Vec<f64> = (0..n).map(|j| 0.02 * rms(j)).collect();
    for (i, efforts) in efforts.iter().enumerate() {
        write!(text, "{}", i as f64 / RATE).unwrap();
        for j in 0..n {
            let normal: f64 = StandardNormal.sample(&mut random);
            write!(text, ",{},{}", motion[j][i].position, efforts[j] + noise[j] * normal).unwrap();
        }
        text.push('\n');
    }
    std::fs::write(path, text).unwrap();
}

fn description(truth: &Truth, logs: &[&str]) -> String {
    let mut text = format!(
        "name = 'random'\nrobot = 'robot.toml'\n[source]\nfiles = {logs:?}\n[columns]\ntime = {{ column = 't' }}\n\
         [select]\ntrim_start = 0.6\ntrim_end = 0.6\n[filter]\nposition = {{ order = 4, cutoff_hz = 10.0 }}\n\
         effort = {{ order = 4, cutoff_hz = 10.0 }}\ndecimate = {{ factor = 5 }}\n"
    );
    for (j, joint) in truth.robot.tree.joints.iter().enumerate() {
        let unit = if joint.kind == JointKind::Prismatic { "m" } else { "rad" };
        writeln!(text, "[joints.{}]\nposition = {{ column = 'q{j}', unit = '{unit}' }}", joint.name).unwrap();
        writeln!(text, "effort = {{ column = 'i{j}', unit = 'A' }}").unwrap();
    }
    text
}

#[test]
fn a_fitted_robot_is_judged_as_it_was_written_on_its_own_recording_and_on_another() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    // Two joints, of which one motor moves both.
    let truth = robot(33);
    assert!(truth.robot.tree.len() == 2 && truth.robot.coupling[(1, 0)] != 0.0);
    write_robot(&truth, folder.path());
    write_log(&truth, &at("a.csv"), 12.0, 1);
    write_log(&truth, &at("b.csv"), 12.0, 2);
    std::fs::write(at("first.toml"), description(&truth, &["a.csv"])).unwrap();
    std::fs::write(at("second.toml"), description(&truth, &["b.csv"])).unwrap();
    let mut first = record(&at("first.toml"), &|_| None).unwrap();
    let joint = JointOptions {
        trainer: None,
        reference: false,
        presets: vec![Preset::CoulombViscous],
        ..JointOptions::default()
    };
    let fitted = fit(&mut first, &Options { joint, seconds: None }, &Silent).unwrap();
    files::write(&at("fitted"), &first, &fitted).unwrap();

    let mut again = record(&at("first.toml"), &|_| None).unwrap();
    let own = evaluate(&at("fitted"), &mut again, Judged::Test).unwrap();
    for (own, expected) in own.iter().zip(&fitted.errors) {
        assert!((own.image / expected.image - 1.0).abs() < 1e-6, "{own:?} {expected:?}");
        assert!((own.effort / expected.effort - 1.0).abs() < 1e-9, "{own:?} {expected:?}");
    }
    let mut second = record(&at("second.toml"), &|_| None).unwrap();
    let other = evaluate(&at("fitted"), &mut second, Judged::All).unwrap();
    println!("{}", table(&other));
    for errors in &other {
        assert!(errors.relative_percent < 3.0 && errors.image < 0.5 * errors.bodies, "{}", table(&other));
    }
    assert!(other[0].samples > own[0].samples && other[0].samples == second.len());

    let refused = |folder: &str| -> String {
        let mut second = record(&at("second.toml"), &|_| None).unwrap();
        evaluate(&at(folder), &mut second, Judged::All).unwrap_err().to_string()
    };
    assert!(refused("nowhere").contains("cannot read") && refused("nowhere").contains("robot.json"));
    let summary = std::fs::read_to_string(at("fitted/robot.json")).unwrap();
    std::fs::write(at("fitted/robot.json"), summary.replace("\"bodies\":{\"joint_0\"", "\"bodies\":{\"elbow\""))
        .unwrap();
    let found = refused("fitted");
    for expected in ["robot.json: joint joint_0 of", "second.toml is not in it, it has elbow, joint_1"] {
        assert!(found.contains(expected), "{found}");
    }
    std::fs::write(at("fitted/robot.json"), "{}").unwrap();
    assert!(refused("fitted").contains("robot.json: missing field `bodies`"), "{}", refused("fitted"));
    std::fs::write(at("fitted/robot.json"), &summary).unwrap();
    std::fs::remove_file(at("fitted/joint_1/friction.img")).unwrap();
    assert!(refused("fitted").contains("friction.img"), "{}", refused("fitted"));
    let newton = description(&truth, &["b.csv"]).replace("unit = 'A'", "unit = 'Nm'");
    std::fs::write(at("second.toml"), newton).unwrap();
    let found = refused("fitted");
    assert!(found.contains("the image is in A, the effort of joint joint_0 in"), "{found}");
}
