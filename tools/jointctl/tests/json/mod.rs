//! Tables as JSON, of the commands without a bus; and the list of all commands that print one.

use super::{ARM, jointctl, tables};

/// Recording of the robot.
const RECORDING: &str = r#"
name = "arm"
robot = "robot.toml"
[source]
files = ["arm.csv"]
[columns]
time = { column = "t" }
[joints.one]
position = { column = "q1" }
effort = { column = "tau1", unit = "Nm" }
[joints.two]
position = { column = "q2" }
effort = { column = "tau2", unit = "Nm" }
"#;

/// Two joints that swing without minding each other, with inertia, gravity and friction.
fn swings() -> String {
    let mut text = "t,q1,tau1,q2,tau2\n".to_owned();
    for i in 0..6_000 {
        let t = 0.005 * f64::from(i);
        let swing = |waves: [(f64, f64); 2]| {
            waves.iter().fold([0.0; 3], |[q, v, a], (size, rate)| {
                let (sine, cosine) = (rate * t).sin_cos();
                [q + size * sine, v + size * rate * cosine, a - size * rate * rate * sine]
            })
        };
        let effort = |[q, v, a]: [f64; 3]| 0.3 * a + 2.0 * q.sin() + 0.5 * (40.0 * v).tanh() + 0.2 * v;
        let (one, two) = (swing([(0.4, 2.1), (0.2, 5.3)]), swing([(0.3, 1.7), (0.25, 4.4)]));
        text += &format!("{t:.3},{},{},{},{}\n", one[0], effort(one), two[0], effort(two));
    }
    text
}

#[test]
fn every_table_is_json_where_that_is_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in [
        ("arm.urdf", ARM),
        ("robot.toml", "urdf = 'arm.urdf'\n[joint.one]\n[joint.two]\n"),
        ("recording.toml", RECORDING),
        ("arm.csv", &swings()),
    ] {
        std::fs::write(folder.path().join(name), text).unwrap();
    }
    for line in tables::WITHOUT_BUS {
        tables::assert_is_table(line, &jointctl(folder.path(), &line.split(' ').collect::<Vec<_>>()));
    }
    // What is refused is a table, too.
    let slow = jointctl(folder.path(), &["excite", "--check", "motion.csv", "--velocity", "0.5", "--json"]);
    let told: serde_json::Value = serde_json::from_slice(&slow.stdout).unwrap();
    assert!(slow.status.code() == Some(1) && told["defects"][0].as_str().unwrap().contains("permitted are 0.5"));
}

#[test]
fn no_command_that_prints_json_is_left_out_of_the_tests_that_try_them() {
    fn below(command: &clap::Command, above: &str, found: &mut Vec<String>) {
        for command in command.get_subcommands() {
            let path = format!("{above}{} ", command.get_name());
            if command.get_arguments().any(|argument| argument.get_long() == Some("json")) {
                found.push(path.clone());
            }
            below(command, &path, found);
        }
    }
    let mut paths = Vec::new();
    below(&jointctl::commands::arguments(), "", &mut paths);
    assert!(paths.len() > 20, "{paths:?}");
    let lines = [&tables::WITHOUT_BUS[..], &tables::OF_A_JOINT, &tables::OF_A_FLEET].concat();
    let lines = [&lines[..], &[tables::ADDRESS, tables::COMMISSION, tables::ROBOT_MOVE]].concat();
    assert!(lines.iter().all(|line| line.contains("--json")), "{lines:?}");
    let missing: Vec<_> = paths.iter().filter(|path| !lines.iter().any(|line| line.starts_with(*path))).collect();
    assert!(missing.is_empty(), "not tried: {missing:?}");
}
