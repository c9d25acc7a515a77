//! All joints of an arm at once: moved and recorded, refused, and stopped.

use crate::served::{DEADLINE, Running, Served, program};
use crate::tables::ROBOT_MOVE;
use bus::client::{Network, Subscription};
use joint_firmware::joint::state_machine::State;
use joint_firmware::objects::field::{Field, Range};
use jointctl::joint_text;
use jointctl::remote::RemoteJoint;
use jointctl::remote::robot_motion::RobotMotion;
use plant::ActuatorParameters;
use plant::excitation::Reference;
use plant::virtual_joint::Setup;
use rigid_body::pairs::Pair;
use robot::{Controller, read_robot, record};
use std::fmt::Write;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Output, Stdio};
use std::time::Instant;

/// Joints that share a drive.
const SHARING: [usize; 2] = [1, 2];
const NAMES: [&str; 3] = ["yaw", "shoulder", "elbow"];

fn arm() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("robots/arm/robot.toml")
}

/// A swing out and back of 0.2 rad, 1 kHz, s.
fn swing(reach: f64, duration: f64) -> Vec<Reference> {
    let turns = std::f64::consts::TAU / duration;
    let at = |n: usize| {
        let time = 1e-3 * n as f64;
        Reference {
            position: 0.5 * reach * (1.0 - (turns * time).cos()),
            velocity: 0.5 * reach * turns * (turns * time).sin(),
            acceleration: 0.5 * reach * turns * turns * (turns * time).cos(),
        }
    };
    (0..=(1e3 * duration) as usize).map(at).collect()
}

/// Place of the position among the signals of a row.
const POSITION: usize = 0;

/// Checks that a joint made the swing of 0.3 rad: it stands at 0 before it.
fn swung(positions: impl Iterator<Item = f64>, joint: &str) {
    let furthest = positions.fold(f64::NEG_INFINITY, f64::max);
    assert!((0.1..0.5).contains(&furthest), "{joint} came to {furthest} rad");
}

/// Joints with one client, as SYNC is for all of them.
fn joints(served: &Served) -> Vec<RemoteJoint> {
    let first = served.joint_at(1);
    let on = |node| RemoteJoint::on(first.network(), node).unwrap();
    vec![first.clone(), on(2), on(3)]
}

/// Checks that each joint of the pair, and no other one, was told the velocity of its partner's swing.
fn told(coupled: &Subscription) {
    let mut fastest = [None; 3];
    while let Some(received) = coupled.try_next().unwrap() {
        let velocity = i32::from_le_bytes(received.frame.data()[..4].try_into().unwrap());
        let place = &mut fastest[usize::from(received.frame.id() - 0x501)];
        *place = (*place).max(Some(velocity));
    }
    // The swing's is 471 mrad/s at the most; a machine that is busy leaves set-points out.
    let is = fastest.map(|most| most.is_some_and(|most| (200..=472).contains(&most)));
    assert_eq!(is, [0, 1, 2].map(|joint| SHARING.contains(&joint)), "{fastest:?} mrad/s");
}

fn off(joints: &[RemoteJoint]) {
    for joint in joints {
        assert_eq!(joint.state().unwrap(), State::SwitchOnDisabled, "node {}", joint.id());
        assert_eq!(joint.faults().unwrap(), []);
    }
}

pub fn all_joints_of_an_arm_move_together_and_are_left_disabled() {
    let served = Served::arm(&arm());
    let joints = joints(&served);
    let mut robot = read_robot(&arm(), &|_| None).unwrap();
    robot.pairs = vec![Pair { joints: SHARING, band: 0.05 }];
    let controller = Controller::of_urdf(robot, 30.0);
    let motion = |reach| RobotMotion {
        controller: &controller,
        references: vec![swing(reach, 2.0); 3],
        rate: 100.0,
        acknowledge: false,
    };
    let ranges = || joints.iter().map(|joint| joint.number(Field::Range(Range::Damping)).unwrap()).collect::<Vec<_>>();
    let before = ranges();
    // Somebody else's ears: one's own frames are not heard.
    let others = Network::new(bus::open(served.bus()).unwrap());
    let coupled = others.subscribe(|frame| (0x501..0x504).contains(&frame.id()));
    // More damping than the impedance frame carries as a joint has it.
    assert!(controller.at(&[0.0; 3], &[0.0; 3], &[0.0; 3])[1].damping > before[1], "{before:?}");
    let moved = motion(0.3).run(&joints, &|| true).unwrap().unwrap();
    off(&joints);
    assert_eq!(ranges(), before);
    told(&coupled);
    for joint in &joints {
        let cob_id = u32::from_le_bytes(joint.node().number(0x1403, 1).unwrap());
        assert!(cob_id >> 31 == 1, "node {}: {cob_id:08x}", joint.id());
    }
    let tracked = moved.tracked();
    // A machine that is busy is late with all of it: what is followed how closely is measured by a benchmark. That all
    // joints make the swing is not about time.
    assert!(tracked.len() == 3 && tracked.iter().all(|of| of.rms > 0.0 && of.torque > 0.0), "{tracked:?}");
    for joint in 0..3 {
        let positions = moved.rows.iter().map(|row| row.values[joint][POSITION]);
        swung(positions, &format!("joint {joint}"));
    }

    // Beyond the second joint's limit: nothing is enabled.
    let mut beyond = motion(0.1);
    let far = Reference { position: 9.0, ..Reference::default() };
    beyond.references[1] = vec![far; beyond.references[0].len()];
    let refused = beyond.run(&joints, &|| true).unwrap_err().to_string();
    assert!(refused.contains(" is outside ") && refused.contains("node 2"), "{refused}");
    off(&joints);

    let began = Instant::now();
    let interrupted = motion(0.3).run(&joints, &|| began.elapsed().as_secs_f64() < 0.5).unwrap();
    assert_eq!(interrupted, None);
    off(&joints);
}

/// A line of the program on a bus, with more arguments.
fn moved(folder: &Path, bus: &str, line: &str, more: &[&str]) -> Output {
    program().current_dir(folder).args(line.split(' ')).args(["--bus", bus]).args(more).output().unwrap()
}

pub fn an_arm_of_the_program_is_moved_and_recorded_by_the_program() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let mut setup = Setup::of(&ActuatorParameters::reference());
    setup.configuration.limits.command_deadline = DEADLINE;
    let configuration = joint_text::to_text(&setup.configuration).unwrap();
    std::fs::create_dir(path.join("motion")).unwrap();
    for file in ["robot.toml", "arm.urdf"] {
        std::fs::copy(arm().with_file_name(file), path.join(file)).unwrap();
    }
    for name in NAMES {
        std::fs::create_dir_all(path.join("actuators").join(name)).unwrap();
        std::fs::write(path.join("actuators").join(name).join("joint.toml"), &configuration).unwrap();
        let mut table = "time_s,position_rad,velocity_rad_s,acceleration_rad_s2\n".to_owned();
        for (n, at) in swing(0.3, 2.0).iter().enumerate() {
            let Reference { position, velocity, acceleration } = at;
            writeln!(table, "{:.4},{position:.7},{velocity:.6},{acceleration:.5}", 1e-3 * n as f64).unwrap();
        }
        std::fs::write(path.join("motion").join(format!("{name}.csv")), table).unwrap();
    }
    let bus = format!("udp:239.74.163.2:{}", bus::free_port().unwrap());
    let arguments = ["sim", "--robot", "robot.toml", "--actuators", "actuators", "--bus", &bus];
    let mut sim = program();
    sim.current_dir(path).args(arguments).args(["--node", "5", "--node", "6", "--node", "7"]);
    let mut sim = Running(sim.stderr(Stdio::piped()).spawn().unwrap());
    let told = BufReader::new(sim.0.stderr.take().unwrap()).lines().take(3).map(Result::unwrap).collect::<Vec<_>>();
    for (name, line) in NAMES.iter().zip(&told) {
        assert!(line.contains(&format!("{bus}: {name}, serial ")), "{line}");
    }

    let nodes = ["--node", "5", "--node", "6", "--node", "7"];
    let error = |line: &str, more: &[&str], code: i32| {
        let output = moved(path, &bus, line, more);
        assert_eq!(output.status.code(), Some(code));
        String::from_utf8(output.stderr).unwrap()
    };
    let text = error("robot move robot.toml --motion motion", &nodes[..2], 2);
    assert!(text.contains("it has 3 joints, --node is given 1 times"), "{text}");
    let text = error("robot move robot.toml --motion motion", &["--node", "5", "--node", "6", "--node", "5"], 2);
    assert!(text.contains("--node 5 is given for two joints"), "{text}");
    let text = error("robot move robot.toml --motion nowhere", &nodes, 1);
    assert!(text.contains("yaw.csv: cannot be read"), "{text}");
    let text = error("robot move robot.toml --motion motion --bandwidth 101", &nodes, 2);
    assert!(text.contains("--bandwidth is 101 rad/s, must lie in 1 to 100 rad/s"), "{text}");

    let output = moved(path, &bus, ROBOT_MOVE, &nodes);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let told: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    for (joint, (name, node)) in told.as_array().unwrap().iter().zip(NAMES.iter().zip(5..)) {
        assert_eq!((&joint["joint"], &joint["node"]), (&(*name).into(), &node.into()));
        for run in ["without", "with"] {
            let rms = joint[run]["rms_rad"].as_f64().unwrap();
            assert!(rms > 0.0 && joint[run]["largest_rad"].as_f64().unwrap() >= rms, "{told}");
        }
    }
    let table = std::fs::read_to_string(path.join("recorded/log.csv")).unwrap();
    assert!(table.starts_with("time_s,yaw.position_rad,yaw.velocity_rad_s,yaw.torque_Nm,yaw.temperature_C,shoulder."));
    for (at, name) in NAMES.iter().enumerate() {
        let column = 1 + 4 * at + POSITION;
        swung(table.lines().skip(1).filter_map(|line| line.split(',').nth(column)?.parse().ok()), name);
    }
    let text = error(ROBOT_MOVE, &nodes, 2);
    assert!(text.contains("log.csv") && text.contains("--force"), "{text}");
    // What was recorded is a recording of this robot.
    match record(&path.join("recorded/recording.toml"), &|_| None) {
        Ok(recording) => assert_eq!(recording.robot.tree.len(), 3),
        // On a machine that is too busy too little of it came.
        Err(error) => assert!(table.lines().count() < 150, "{error}"),
    }
}
