//! A robot from files: fitted, written, and judged on another recording.

use super::synthetic::{RATE, Truth, fourier, robot};
use crate::evaluate::{Judged, evaluate, external_table, table};
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

/// Times between which somebody pushes, s.
const PUSHED: [f64; 2] = [5.0, 7.0];

/// A recording of one motion, with noise of 2 % of each effort's RMS, and torques of somebody who pushes at the joints.
fn write_log(truth: &Truth, path: &Path, seconds: f64, seed: u64, pushes: &[f64]) {
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
    let spared = &to_efforts * nalgebra::DVector::from_row_slice(pushes);
    let rms = |j: usize| super::synthetic::rms(&efforts.iter().map(|all| all[j]).collect::<Vec<_>>());
    let noise: Vec<f64> = (0..n).map(|j| 0.02 * rms(j)).collect();
    for (i, efforts) in efforts.iter().enumerate() {
        let time = i as f64 / RATE;
        let pushed = if (PUSHED[0]..PUSHED[1]).contains(&time) { 1.0 } else { 0.0 };
        write!(text, "{time}").unwrap();
        for j in 0..n {
            let normal: f64 = StandardNormal.sample(&mut random);
            let effort = efforts[j] + noise[j] * normal - pushed * spared[j];
            write!(text, ",{},{effort}", motion[j][i].position).unwrap();
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
    write_log(&truth, &at("a.csv"), 12.0, 1, &[0.0; 2]);
    write_log(&truth, &at("b.csv"), 12.0, 2, &[0.0; 2]);
    let pushes = [-40.0, 25.0];
    write_log(&truth, &at("pushed.csv"), 12.0, 2, &pushes);
    std::fs::write(at("first.toml"), description(&truth, &["a.csv"])).unwrap();
    std::fs::write(at("second.toml"), description(&truth, &["b.csv"])).unwrap();
    std::fs::write(at("pushed.toml"), description(&truth, &["pushed.csv"])).unwrap();
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
    let own = evaluate(&at("fitted"), &mut again, Judged::Test).unwrap().errors;
    for (own, expected) in own.iter().zip(&fitted.errors) {
        assert!((own.image / expected.image - 1.0).abs() < 1e-6, "{own:?} {expected:?}");
        assert!((own.effort / expected.effort - 1.0).abs() < 1e-9, "{own:?} {expected:?}");
    }
    let mut second = record(&at("second.toml"), &|_| None).unwrap();
    let evaluation = evaluate(&at("fitted"), &mut second, Judged::All).unwrap();
    let other = evaluation.errors;
    println!("{}", table(&other));
    for errors in &other {
        assert!(errors.relative_percent < 3.0 && errors.image < 0.5 * errors.bodies, "{}", table(&other));
    }
    assert!(other[0].samples > own[0].samples && other[0].samples == second.len());

    // The same motion while somebody pushes: the motors give less by what comes from outside, and nothing else changed.
    let mut pushed = record(&at("pushed.toml"), &|_| None).unwrap();
    let external = evaluate(&at("fitted"), &mut pushed, Judged::All).unwrap().external;
    let time = &pushed.joints[0].samples.time;
    let edge = |time: f64| PUSHED.iter().any(|edge| (time - edge).abs() < 0.3);
    let mut compared = [0; 2];
    for (joint, push) in pushes.iter().enumerate() {
        for (i, time) in time.iter().enumerate().filter(|(_, time)| !edge(**time)) {
            let inside = *time > PUSHED[0] && *time < PUSHED[1];
            compared[usize::from(inside)] += 1;
            let expected = if inside { *push } else { 0.0 };
            let found = external[joint][i] - evaluation.external[joint][i];
            assert!((found - expected).abs() < 0.02 * push.abs(), "{joint}, {time} s: {found}, expected {expected}");
        }
    }
    assert!(compared.iter().all(|count| *count > 100), "{compared:?}");
    let text = external_table(&pushed, &external);
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines[0], "run,time_s,joint_0.external_torque_Nm,joint_1.external_torque_Nm");
    assert_eq!(lines.len(), 1 + pushed.len());
    let row: Vec<f64> = lines[7].split(',').map(|cell| cell.parse().unwrap()).collect();
    assert_eq!(row[0], 0.0);
    for (found, expected) in row[1..].iter().zip([time[6], external[0][6], external[1][6]]) {
        assert!((found - expected).abs() < 1e-5, "{row:?}");
    }

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
