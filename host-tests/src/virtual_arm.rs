//! A virtual arm as its owner would identify it: moved by its joints' own position control, recorded, fitted by
//! `jointctl robot fit`'s pipeline; then moved by computed torque with what came out.

use crate::driving::COMMAND_STEPS;
use friction_compensation::compensation::Request;
use friction_compensation::friction::FrictionModel;
use identification::fit::Options as JointOptions;
use identification::progress::Silent;
use joint_firmware::joint::state_machine::{Controlword, State};
use joint_firmware::joint::{Command, Demand, Mode, Telemetry};
use nalgebra::{Matrix3, Unit, Vector3};
use plant::actuator::ActuatorParameters;
use plant::fourier::FourierSeries;
use plant::load::LoadParameters;
use plant::virtual_joint::Setup;
use plant::{Arm, VirtualJoint};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rigid_body::newton_euler::inverse_dynamics;
use rigid_body::random_tree::urdf;
use rigid_body::{Joint, JointKind, LinkInertia, Placement, Robot, Tree};
use robot::controller::Share;
use robot::{Controller, Options, fit, record};
use std::fmt::Write;

/// Joints.
pub const JOINTS: usize = 3;
/// Durations of the recorded runs, s; the last one is for testing.
const RUNS: [f64; 3] = [10.0, 10.0, 6.0];
/// Duration of the motion by computed torque, s.
const MOTION: f64 = 6.0;
/// Samples a second of the recording.
const RATE: u64 = 250;
/// Bandwidth of the controller around the computed torque, rad/s: low, so that what the model lacks shows.
const BANDWIDTH: f64 = 6.0;
/// Largest velocity of the motions, rad/s, and distance from the middle, rad.
const FASTEST: f64 = 2.5;
const FURTHEST: f64 = 0.8;
/// Temperature of room and arm, °C.
const TEMPERATURE: f64 = 25.0;

/// A motion of all joints.
#[derive(Clone, Debug)]
pub struct ArmMotion {
    series: Vec<FourierSeries>,
    duration: f64,
}

impl ArmMotion {
    /// Fourier series of random coefficients, a joint each, within 2.5 rad/s and 0.8 rad.
    pub fn random(duration: f64, seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut draw = || (0..5).map(|_| random.random_range(-1.0..1.0)).collect::<Vec<f64>>();
        let series = (0..JOINTS).map(|_| {
            let mut one = FourierSeries { fundamental: 2.0, cosine: draw(), sine: draw() };
            let most = (0..2_000)
                .map(|n| one.faded(f64::from(n) * duration / 2_000.0, duration))
                .fold(0.0, |most: f64, at| most.max(at.velocity.abs() / FASTEST).max(at.position.abs() / FURTHEST));
            one.cosine.iter_mut().chain(&mut one.sine).for_each(|coefficient| *coefficient /= most);
            one
        });
        Self { series: series.collect(), duration }
    }

    /// Positions, velocities and accelerations.
    fn at(&self, time: f64) -> [Vec<f64>; 3] {
        let all: Vec<_> = self.series.iter().map(|series| series.faded(time, self.duration)).collect();
        [
            all.iter().map(|at| at.position).collect(),
            all.iter().map(|at| at.velocity).collect(),
            all.iter().map(|at| at.acceleration).collect(),
        ]
    }
}

/// Yaw, pitch and pitch, with links of 3 kg.
fn links() -> Tree {
    let link = |length: f64| {
        let about = Matrix3::from_diagonal(&Vector3::new(0.02, 0.02, 0.005));
        LinkInertia::from_centre(3.0, Vector3::new(0.01, 0.02, -0.5 * length), about)
    };
    let joint = |i: usize, axis: Vector3<f64>, at: f64| Joint {
        name: format!("joint_{i}"),
        parent: i.checked_sub(1),
        placement: Placement::from_xyz_rpy([0.0, 0.0, at], [0.0; 3]),
        kind: JointKind::Revolute,
        axis: Unit::new_normalize(axis),
        link: link(0.3),
        armature: 0.0,
    };
    let joints = vec![joint(0, Vector3::z(), 1.0), joint(1, Vector3::y(), 0.0), joint(2, Vector3::y(), -0.35)];
    Tree { joints, gravity: Vector3::new(0.0, 0.0, -9.80665) }
}

/// Actuators with frictions of their own: the reference's, scaled.
fn actuators() -> [(ActuatorParameters, Setup); JOINTS] {
    [1.0, 0.7, 1.4].map(|scale| {
        let mut parameters = ActuatorParameters::reference().aligned();
        let friction = &mut parameters.joint.friction;
        for both in [&mut friction.coulomb, &mut friction.breakaway, &mut friction.viscous] {
            (both.forward, both.backward) = (scale * both.forward, scale * both.backward);
        }
        // Gains and limits are those of a joint with a typical link.
        let setup = Setup::of(&parameters);
        parameters.joint.load = LoadParameters { inertia: 0.0, mass: 0.0, length: 0.0 };
        (parameters, setup)
    })
}

/// The arm, enabled, compensating as asked for.
fn arm(request: Request, models: &[FrictionModel], seed: u64) -> Result<Arm, String> {
    let joint = |(i, (parameters, setup)): (usize, &(ActuatorParameters, Setup))| {
        let setup = setup.compensating(request);
        let mut joint = VirtualJoint::new(*parameters, &setup, TEMPERATURE, seed + i as u64)?;
        joint.set_friction(models.get(i).cloned());
        Ok::<_, plant::virtual_joint::VirtualJointError>(joint)
    };
    let joints = actuators().iter().enumerate().map(joint).collect::<Result<_, _>>().map_err(|e| e.to_string())?;
    let mut arm = Arm::new(links(), joints).map_err(|error| error.to_string())?;
    arm.enable().map_err(|error| error.to_string())?;
    Ok(arm)
}

/// Moves the arm; `command` gives the commands of all joints every millisecond, from the time and what the joints told,
/// and `look` sees every control step.
fn drive(
    arm: &mut Arm,
    duration: f64,
    mut command: impl FnMut(f64, &[Telemetry]) -> Vec<Command>,
    mut look: impl FnMut(f64, &Arm, &[Telemetry]),
) -> Result<(), String> {
    let mut told = arm.step(&vec![demand(Command::NOTHING, 1); JOINTS], &[]);
    let mut commands = Vec::new();
    for n in 0..(duration / arm.period()) as u64 {
        let time = n as f64 * arm.period();
        if n % COMMAND_STEPS == 0 {
            commands = command(time, &told);
        }
        let sequence = (n / COMMAND_STEPS) as u32 + 2;
        let demands: Vec<Demand> = commands.iter().map(|command| demand(*command, sequence)).collect();
        told = arm.step(&demands, &[]);
        if let Some(i) = told.iter().position(|telemetry| telemetry.state != State::OperationEnabled) {
            return Err(format!("joint {i} at {time:.3} s: {:?}, {:?}", told[i].state, told[i].faults));
        }
        look(time, arm, &told);
    }
    Ok(())
}

fn demand(command: Command, sequence: u32) -> Demand {
    Demand { controlword: Controlword::ENABLE_OPERATION, command, sequence, ..Demand::default() }
}

/// An identified arm.
pub struct IdentifiedArm {
    controller: Controller,
    /// Links, and rotor inertias on the joints' side.
    tree: Tree,
    rotors: Vec<f64>,
    models: Vec<FrictionModel>,
    /// Means over the joints of the errors on the test run, % of the effort's RMS: simplest, bodies, images.
    pub percent: [f64; 3],
}

/// Records the arm and identifies it.
///
/// # Errors
/// Refusals of plant, firmware or fit.
pub fn identified() -> Result<IdentifiedArm, String> {
    let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).map_err(|e| e.to_string());
    write("log.csv", &recorded()?)?;
    write("arm.urdf", &urdf(&prior(), (-3.0, 3.0), 10.0))?;
    let each = |text: &dyn Fn(usize) -> String| (0..JOINTS).map(text).collect::<String>();
    write("robot.toml", &format!("urdf = 'arm.urdf'\n{}", each(&|i| format!("[joint.joint_{i}]\n"))))?;
    let columns = |i: usize| {
        format!("[joints.joint_{i}]\nposition = {{ column = 'q{i}' }}\neffort = {{ column = 't{i}', unit = 'Nm' }}\n")
    };
    write("recording.toml", &format!("{RECORDING}{}", each(&columns)))?;
    let mut recording = record(&folder.path().join("recording.toml"), &|_| None).map_err(|error| error.to_string())?;
    let joint = JointOptions { trainer: None, reference: false, ..JointOptions::default() };
    let fitted = fit(&mut recording, &Options { joint, seconds: None }, &Silent).map_err(|error| error.to_string())?;
    let mut tree = recording.robot.tree.clone();
    tree.joints.iter_mut().zip(&fitted.links).for_each(|(joint, link)| joint.link = *link);
    let rate = actuators()[0].1.bridge.motion_rate();
    let models = fitted.joints.iter().map(|joint| FrictionModel::new(&joint.image.friction, rate)).collect();
    let robot = Robot { tree: tree.clone(), ..recording.robot };
    let controller = Controller::new(robot, &fitted.rotors, BANDWIDTH);
    Ok(IdentifiedArm { controller, tree, rotors: fitted.rotors.clone(), models, percent: fitted.mean_percent() })
}

/// Links by their data sheet: masses a third too large, centres a fifth too near.
fn prior() -> Tree {
    let mut tree = links();
    for joint in &mut tree.joints {
        let link = joint.link;
        joint.link = LinkInertia::from_centre(1.3 * link.mass, 0.8 * link.centre(), 1.3 * link.about_centre());
    }
    tree
}

const RECORDING: &str = "name = 'virtual arm'
robot = 'robot.toml'
[source]
files = ['log.csv']
[columns]
run = 'run'
time = { column = 't' }
[filter]
position = { order = 4, cutoff_hz = 25.0 }
effort = { order = 4, cutoff_hz = 25.0 }
[split]
test = [{ name = 'another motion', where = [{ column = 'run', equals = 2 }] }]
validation = { fraction = { of = 0.2, length = 0.75, seed = 1 } }
";

/// The recording: means of what the joints measure over each sample's time.
fn recorded() -> Result<String, String> {
    let mut text = "run,t".to_owned();
    (0..JOINTS).for_each(|i| text += &format!(",q{i},t{i}"));
    text.push('\n');
    for (run, duration) in RUNS.into_iter().enumerate() {
        let motion = ArmMotion::random(duration, 10 + run as u64);
        let mut arm = arm(Request::Off, &[], 100 * run as u64)?;
        let gains: Vec<_> = arm.joints().iter().map(|joint| joint.active().motion).collect();
        let per_row = (1.0 / (RATE as f64 * arm.period())).round() as u64;
        let mut sums = [[0.0; 2]; JOINTS];
        let mut steps = 0;
        let follow = |time: f64, _: &[Telemetry]| {
            let [q, v, _] = motion.at(time);
            let command = |i: usize| Command {
                mode: Mode::Impedance,
                position: q[i] as f32,
                velocity: v[i] as f32,
                stiffness: gains[i].stiffness,
                damping: gains[i].damping,
                ..Command::NOTHING
            };
            (0..JOINTS).map(command).collect()
        };
        drive(&mut arm, duration, follow, |time, _, told| {
            for (sum, telemetry) in sums.iter_mut().zip(told) {
                sum[0] += f64::from(telemetry.motion.position);
                sum[1] += f64::from(telemetry.measured_torque);
            }
            steps += 1;
            if steps % per_row == 0 {
                // Writing to a string cannot fail.
                let _ = write!(text, "{run},{time:.4}");
                for sum in &mut sums {
                    let [position, torque] = sum.map(|sum| sum / per_row as f64);
                    let _ = write!(text, ",{position:.6},{torque:.4}");
                    *sum = [0.0; 2];
                }
                text.push('\n');
            }
        })?;
    }
    Ok(text)
}

/// Place in which the controller around the computed torque closes its loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Loop {
    /// Loop in the joints, by impedance mode with low gains: they know the reference velocity.
    Joints,
    /// Loop in the master, by torque mode at 1 kHz.
    Master,
}

impl IdentifiedArm {
    /// RMS position error of each joint along a motion by computed torque (003, eq. 9), rad: the identified links and
    /// rotors, and a controller of low bandwidth. With the images, or without compensation.
    ///
    /// # Errors
    /// A fault on the way.
    pub fn tracked(&self, request: Request, by: Loop) -> Result<Vec<f64>, String> {
        let motion = ArmMotion::random(MOTION, 20);
        let mut arm = arm(request, &self.models, 900)?;
        let (mut squares, mut count) = (vec![0.0; JOINTS], 0.0);
        let commands = |time: f64, told: &[Telemetry]| match by {
            Loop::Joints => self.in_the_joints(motion.at(time)),
            Loop::Master => self.in_the_master(motion.at(time), told),
        };
        drive(&mut arm, MOTION, commands, |time, arm, _| {
            let ([wanted, ..], [position, _]) = (motion.at(time), arm.state());
            squares.iter_mut().zip(wanted.iter().zip(position)).for_each(|(sum, (a, b))| *sum += (a - b).powi(2));
            count += 1.0;
        })?;
        Ok(squares.into_iter().map(|sum| (sum / count).sqrt()).collect())
    }

    /// The model's torque of the reference, and gains by the inertia of each joint there.
    fn in_the_joints(&self, [q, v, a]: [Vec<f64>; 3]) -> Vec<Command> {
        let command = |(i, share): (usize, &Share)| Command {
            mode: Mode::Impedance,
            position: q[i] as f32,
            velocity: v[i] as f32,
            torque: share.torque as f32,
            stiffness: share.stiffness as f32,
            damping: share.damping as f32,
            ..Command::NOTHING
        };
        self.controller.at(&q, &v, &a).iter().enumerate().map(command).collect()
    }

    /// The torque of what the master wants by what the joints told; what is not gravity is told as a push.
    fn in_the_master(&self, [qd, vd, ad]: [Vec<f64>; 3], told: &[Telemetry]) -> Vec<Command> {
        let of = |value: fn(&Telemetry) -> f32| told.iter().map(|one| f64::from(value(one))).collect::<Vec<_>>();
        let (q, v) = (of(|one| one.motion.position), of(|one| one.motion.velocity));
        let wanted: Vec<f64> =
            (0..JOINTS).map(|i| ad[i] + BANDWIDTH * (BANDWIDTH * (qd[i] - q[i]) + 2.0 * (vd[i] - v[i]))).collect();
        let still = vec![0.0; JOINTS];
        let gravity = inverse_dynamics(&self.tree, &q, &still, &still);
        let all = inverse_dynamics(&self.tree, &q, &v, &wanted);
        let command = |i: usize| Command {
            mode: Mode::Torque,
            torque: (all[i] + self.rotors[i] * wanted[i]) as f32,
            push: (all[i] - gravity[i] + self.rotors[i] * wanted[i]) as f32,
            ..Command::NOTHING
        };
        (0..JOINTS).map(command).collect()
    }
}
