//! A motion of all joints: within every limit, and better than a random one.

use super::synthetic::{EffortNoise, Measured, RATE, Truth, rows};
use crate::excite::check::check;
use crate::excite::files::{COEFFICIENTS, files};
use crate::excite::search::{Found, search};
use crate::excite::{Effort, Task};
use crate::friction_columns::Friction;
use crate::least_squares::{Weighting, base, solve};
use excitation::Excitation;
use plant::excitation::Reference;
use rigid_body::Robot;
use rigid_body::random_tree::{Shape, tree, urdf};
use std::path::Path;
use std::sync::OnceLock;

/// Enough for a test.
const QUICK: Effort = Effort { duration: 10.0, harmonics: 3, draws: 16, restarts: 2, rounds: 5, seed: 1 };
/// Enough to see what does not depend on the search.
const LEAST: Effort = Effort { draws: 4, restarts: 1, rounds: 1, ..QUICK };

fn described(joints: usize, seed: u64, more: &str) -> Robot {
    let tree = tree(Shape { joints, branches: false, prismatic: 0.0, armature: false }, seed);
    let mut text = format!("urdf = 'robot.urdf'\n{more}");
    for joint in &tree.joints {
        text += &format!("[joint.{}]\ngain = 0.1\nratio = 50.0\nacceleration = 8.0\n", joint.name);
    }
    Robot::new(&text, "robot.toml", &urdf(&tree, (-2.0, 1.5), 2.5), "robot.urdf").unwrap()
}

fn task(robot: &Robot) -> Task<'_> {
    Task::of(robot, Path::new("robot.toml"), None).unwrap()
}

/// A random arm of six joints with its motion: found once.
fn arm() -> &'static (Robot, Found) {
    static ARM: OnceLock<(Robot, Found)> = OnceLock::new();
    ARM.get_or_init(|| {
        let robot = described(6, 11, "");
        let found = search(&task(&robot), &QUICK).unwrap();
        (robot, found)
    })
}

/// Standard errors of all unknowns from a recording of the motion with noise of the same size.
fn standard_errors(robot: &Robot, motion: &[Excitation]) -> Vec<f64> {
    let n = robot.tree.len();
    let truth = Truth { robot: robot.clone(), rotors: vec![1e-4; n], friction: vec![[0.05, 0.05, 0.02]; n] };
    let sampled: Vec<Vec<Reference>> =
        motion.iter().map(|excitation| excitation.samples(1.0 / RATE).map(|(_, m)| m).collect()).collect();
    let measured = Measured { friction: 1.0, effort: EffortNoise::Size(vec![0.05; n]), position: 0.0 };
    let rows = rows(&truth, &sampled, Friction::Simple, &measured, 1);
    solve(&rows, &base(robot, 1), Weighting::ByJoint).standard_errors
}

#[test]
fn standard_errors_of_a_six_joint_arm_are_smaller_than_with_a_random_motion() {
    let (robot, found) = arm();
    let (own, random) = (standard_errors(robot, &found.excitations), standard_errors(robot, &found.random));
    let ratios: Vec<f64> = own.iter().zip(&random).map(|(own, random)| own / random).collect();
    let mean = (ratios.iter().map(|ratio| ratio.ln()).sum::<f64>() / ratios.len() as f64).exp();
    let smaller = ratios.iter().filter(|ratio| **ratio < 1.0).count();
    println!(
        "condition number {:.1}, at random {:.1}; sigma_min {:.4}, {:.4}; standard errors {mean:.3} of those at random, {smaller} of {} \
         are smaller",
        found.score.condition,
        found.random_score.condition,
        found.score.least,
        found.random_score.least,
        ratios.len()
    );
    assert!(found.score.condition < 0.8 * found.random_score.condition);
    assert!(mean < 0.8, "{mean}");
    assert!(smaller * 4 >= 3 * ratios.len(), "{ratios:?}");
}

#[test]
fn a_motion_holds_every_limit_and_a_limit_that_is_lower_by_a_millionth_is_exceeded() {
    let (robot, found) = arm();
    let task = task(robot);
    let refused = |task: &Task| check(task, &found.excitations, 1e-3).defects;
    assert_eq!(refused(&task), Vec::<String>::new());
    let (inside, outside) = (1e-6, -1e-6);
    for (j, extremes) in found.findings.joints.iter().enumerate() {
        let with = |part: f64, limit: usize| {
            let mut task = task.clone();
            let bounds = &mut task.bounds[j];
            match limit {
                0 => bounds.position.0 = extremes.position.0 - part,
                1 => bounds.position.1 = extremes.position.1 + part,
                2 => bounds.velocity = (1.0 + part) * extremes.velocity,
                _ => bounds.acceleration = (1.0 + part) * extremes.acceleration,
            }
            refused(&task)
        };
        for (limit, expected) in [
            (0, format!("joint joint_{j} reaches")),
            (1, format!("joint joint_{j} reaches")),
            (2, format!("velocity of joint joint_{j} reaches")),
            (3, format!("acceleration of joint joint_{j} reaches")),
        ] {
            assert_eq!(with(inside, limit), Vec::<String>::new());
            let defects = with(outside, limit);
            assert!(defects.len() == 1 && defects[0].starts_with(&expected), "{defects:?}");
        }
    }
    let lowest = found.findings.lowest.as_ref().unwrap();
    let floor = |floor: f64| refused(&Task { floor: Some(floor), ..task.clone() });
    assert_eq!(floor(lowest.height - 1e-6), Vec::<String>::new());
    let defects = floor(lowest.height + 1e-6);
    assert!(
        defects.len() == 1 && defects[0].starts_with(&format!("frame {} comes down to", lowest.frame)),
        "{defects:?}"
    );
    // It uses the limits: every joint touches one of its own.
    for (extremes, bounds) in found.findings.joints.iter().zip(&task.bounds) {
        let used = (extremes.position.0 / bounds.position.0)
            .max(extremes.position.1 / bounds.position.1)
            .max(extremes.velocity / bounds.velocity)
            .max(extremes.acceleration / bounds.acceleration);
        assert!((0.97..=1.0).contains(&used), "{used}");
    }
}

#[test]
fn the_same_seed_gives_the_same_motion_and_another_seed_another() {
    let robot = described(3, 5, "");
    let excitations = |seed| search(&task(&robot), &Effort { seed, ..LEAST }).unwrap().excitations;
    assert_eq!(excitations(1), excitations(1));
    assert_ne!(excitations(1), excitations(2));
    // Every joint has phases of its own.
    let one = excitations(1);
    assert_ne!(one[0].series, one[1].series);
}

#[test]
fn a_motion_stays_above_the_floor_and_a_floor_without_room_is_told_with_the_frame_that_is_too_low() {
    let robot = described(3, 5, "");
    let free = search(&task(&robot), &LEAST).unwrap().findings.lowest.unwrap();
    let highest = task(&robot).lowest(&[-0.25; 3]).0;
    let floor = free.height + 0.5 * (highest - free.height);
    assert!(floor > free.height);
    let described = described(3, 5, &format!("floor = {floor}\n"));
    let task = task(&described);
    assert_eq!(task.floor, Some(floor));
    let found = search(&task, &LEAST).unwrap();
    assert!(found.findings.lowest.unwrap().height >= floor);
    let error = search(&Task { floor: Some(5.0), ..task }, &LEAST).unwrap_err().to_string();
    for expected in
        ["above the floor of 5 m", "in the highest pose frame link_", "lower the floor, or narrow `position`"]
    {
        assert!(error.contains(expected), "{error}");
    }
}

#[test]
fn every_joint_has_a_table_that_is_its_series_and_all_coefficients_are_one_file() {
    let robot = described(3, 5, "");
    let task = task(&robot);
    let found = search(&task, &LEAST).unwrap();
    let files = files(&task, &LEAST, &found).unwrap();
    let names: Vec<String> = files.iter().map(|file| file.path.display().to_string()).collect();
    assert_eq!(names, ["joint_0.csv", "joint_1.csv", "joint_2.csv", COEFFICIENTS]);
    for (file, excitation) in files.iter().zip(&found.excitations) {
        let text = String::from_utf8(file.contents.clone()).unwrap();
        let mut lines = text.lines();
        assert_eq!(lines.next(), Some("time_s,position_rad,velocity_rad_s,acceleration_rad_s2"));
        assert_eq!(text.lines().count(), 10_002);
        for line in lines.step_by(997) {
            let row: Vec<f64> = line.split(',').map(|word| word.parse().unwrap()).collect();
            let exact = excitation.at(row[0]);
            assert!((row[1] - exact.position).abs() < 1e-6 && (row[2] - exact.velocity).abs() < 1e-5, "{line}");
        }
    }
    let all: toml::Table = toml::from_str(std::str::from_utf8(&files[3].contents).unwrap()).unwrap();
    let cosine = all["joint"]["joint_1"]["cosine"].as_array().unwrap();
    let cosine: Vec<f64> = cosine.iter().map(|value| value.as_float().unwrap()).collect();
    assert_eq!(cosine, found.excitations[1].series.cosine);
    assert_eq!(all["condition_number"].as_float(), Some(found.score.condition));
}

#[test]
fn limits_that_are_missing_or_leave_no_room_and_choices_out_of_range_are_refused() {
    let tree = tree(Shape { joints: 2, branches: false, prismatic: 0.0, armature: false }, 5);
    let refused = |urdf: &str, own: &str, acceleration: Option<f64>| -> String {
        let text = format!("urdf = 'robot.urdf'\n[joint.joint_0]\n{own}\n[joint.joint_1]\nacceleration = 1.0\n");
        let robot = Robot::new(&text, "robot.toml", urdf, "robot.urdf").unwrap();
        Task::of(&robot, Path::new("robot.toml"), acceleration).err().map_or(String::new(), |error| error.to_string())
    };
    let limited = urdf(&tree, (-2.0, 1.5), 2.5);
    let free = limited.replacen("revolute", "continuous", 1);
    let start = "robot.toml: joint joint_0";
    for (found, expected) in [
        (
            refused(&limited, "", None),
            " has no limit of its acceleration: write acceleration in [joint.joint_0], or give --acceleration",
        ),
        (refused(&limited, "", Some(3.0)), ""),
        (
            refused(&free, "", Some(3.0)),
            " has no limit of its position: write position = [low, high] in [joint.joint_0]",
        ),
        (refused(&free, "position = [-1.0, 1.0]", Some(3.0)), ""),
        (refused(&urdf(&tree, (-2.0, 1.5), 0.0), "", Some(3.0)), " has no limit of its velocity"),
        (refused(&limited, "velocity = 0.0011", Some(3.0)), ": velocity is 0.00099"),
        (refused(&limited, "velocity = 0.0012", Some(3.0)), ""),
    ] {
        let expected = if expected.is_empty() { String::new() } else { format!("{start}{expected}") };
        assert!(
            found.starts_with(&expected) && found.is_empty() == expected.is_empty(),
            "{found}, expected {expected}"
        );
    }
    let robot = described(2, 5, "");
    let task = task(&robot);
    for (effort, expected) in [
        (Effort { duration: 3.99, ..LEAST }, "duration is 3.99, must lie in 4 to 600 s"),
        (Effort { harmonics: 21, ..LEAST }, "harmonics is 21, must lie in 1 to 20"),
        (Effort { draws: 0, ..LEAST }, "draws is 0, must lie in 1 to 10000"),
        (Effort { restarts: 5, ..LEAST }, "restarts is 5, must lie in 1 to 4"),
        (Effort { rounds: 1001, ..LEAST }, "rounds is 1001, must lie in 0 to 1000"),
    ] {
        assert_eq!(search(&task, &effort).unwrap_err().to_string(), expected);
    }
    for effort in [Effort { duration: 4.0, ..LEAST }, Effort { rounds: 0, ..LEAST }] {
        assert!(search(&task, &effort).is_ok());
    }
}
