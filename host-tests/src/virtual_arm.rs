//! A virtual arm as its owner would identify it: moved by its joints' own position control, recorded, fitted by
//! `jointctl robot fit`'s pipeline; then moved by computed torque with what came out. Its joints may share drives.

use crate::driving::COMMAND_STEPS;
use friction_compensation::compensation::Request;
use friction_compensation::friction::FrictionModel;
use friction_compensation::parameters::image::Image;
use identification::fit::Options as JointOptions;
use identification::joint_model::{firmware_states, fixed_point, regimes};
use identification::progress::Silent;
use joint_firmware::joint::state_machine::{Controlword, State};
use joint_firmware::joint::{Command, Coupled, Demand, Mode, Telemetry};
use nalgebra::{Matrix3, Unit, Vector3};
use plant::actuator::ActuatorParameters;
use plant::fourier::FourierSeries;
use plant::load::LoadParameters;
use plant::virtual_joint::Setup;
use plant::{Arm, Pair, VirtualJoint};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rigid_body::newton_euler::inverse_dynamics;
use rigid_body::random_tree::urdf;
use rigid_body::{Joint, JointKind, LinkInertia, Placement, Robot, Tree};
use robot::controller::Share;
use robot::{Controller, Options, Recording, fit, record};
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
fn arm(request: Request, models: &[FrictionModel], seed: u64, pairs: &[Pair]) -> Result<Arm, String> {
    let joint = |(i, (parameters, setup)): (usize, &(ActuatorParameters, Setup))| {
        let setup = setup.compensating(request);
        let mut joint = VirtualJoint::new(*parameters, &setup, TEMPERATURE, seed + i as u64)?;
        joint.set_friction(models.get(i).cloned());
        Ok::<_, plant::virtual_joint::VirtualJointError>(joint)
    };
    let joints = actuators().iter().enumerate().map(joint).collect::<Result<_, _>>().map_err(|e| e.to_string())?;
    let arm = Arm::new(links(), joints).and_then(|arm| arm.with_pairs(pairs.to_vec()));
    let mut arm = arm.map_err(|error| error.to_string())?;
    arm.enable().map_err(|error| error.to_string())?;
    Ok(arm)
}

/// Moves the arm; `command` gives the commands of all joints every millisecond, from the time and what the joints told,
/// and `look` sees every control step. With its command a joint that shares its drive is told the velocity that the
/// other one told, as by object 2030h:1.
fn drive(
    arm: &mut Arm,
    duration: f64,
    mut command: impl FnMut(f64, &[Telemetry]) -> Vec<Command>,
    mut look: impl FnMut(f64, &Arm, &[Telemetry]),
) -> Result<(), String> {
    let mut told = arm.step(&vec![demand(Command::NOTHING, 1); JOINTS], &[]);
    let partners: Vec<Option<usize>> = (0..JOINTS).map(|joint| partner(arm.pairs(), joint)).collect();
    let mut demands = Vec::new();
    for n in 0..(duration / arm.period()) as u64 {
        let time = n as f64 * arm.period();
        if n % COMMAND_STEPS == 0 {
            let sequence = (n / COMMAND_STEPS) as u32 + 2;
            let coupled = |other: usize| Coupled { velocity: told[other].motion.velocity, sequence };
            let one = |(command, partner): (&Command, &Option<usize>)| Demand {
                coupled: partner.map_or_else(Coupled::default, coupled),
                ..demand(*command, sequence)
            };
            demands = command(time, &told).iter().zip(&partners).map(one).collect();
        }
        told = arm.step(&demands, &[]);
        if let Some(i) = told.iter().position(|telemetry| telemetry.state != State::OperationEnabled) {
            return Err(format!("joint {i} at {time:.3} s: {:?}, {:?}", told[i].state, told[i].faults));
        }
        look(time, arm, &told);
    }
    Ok(())
}

/// The joint that shares the drive of another.
pub fn partner(pairs: &[Pair], joint: usize) -> Option<usize> {
    pairs.iter().find_map(|pair| {
        let own = pair.joints.iter().position(|one| *one == joint)?;
        Some(pair.joints[1 - own])
    })
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
    pairs: Vec<Pair>,
    /// The recording that it was identified from.
    pub recording: Recording,
    /// Image of each joint.
    pub images: Vec<Image>,
    /// Relief of each joint's dry friction by the one that shares its drive; None where the model has none.
    pub reliefs: Vec<Option<f64>>,
    /// Means over the joints of the errors on the test run, % of the effort's RMS: simplest, bodies, images.
    pub percent: [f64; 3],
}

/// Records the arm and identifies it.
///
/// # Errors
/// Refusals of plant, firmware or fit.
pub fn identified() -> Result<IdentifiedArm, String> {
    identified_from(&recorded(&[])?, &[], false)
}

/// Identifies the arm from its recording, whose joints share drives in `pairs`; `described`: the robot's file says so.
///
/// # Errors
/// Refusals of plant, firmware or fit.
pub fn identified_from(log: &str, pairs: &[Pair], described: bool) -> Result<IdentifiedArm, String> {
    let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).map_err(|e| e.to_string());
    write("log.csv", log)?;
    write("arm.urdf", &urdf(&prior(), (-3.0, 3.0), 10.0))?;
    let each = |text: &dyn Fn(usize) -> String| (0..JOINTS).map(text).collect::<String>();
    let named = |pair: &Pair| format!("[[pair]]\njoints = ['joint_{}', 'joint_{}']\n", pair.joints[0], pair.joints[1]);
    let shared = pairs.iter().filter(|_| described).map(named).collect::<String>();
    write("robot.toml", &format!("urdf = 'arm.urdf'\n{}{shared}", each(&|i| format!("[joint.joint_{i}]\n"))))?;
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
    let robot = Robot { tree: tree.clone(), ..recording.robot.clone() };
    let controller = Controller::new(robot, &fitted.rotors, BANDWIDTH);
    let relief = |joint: &identification::fit::Fitted| {
        let found = joint.report.parameters.iter().find(|parameter| parameter.symbol == "r");
        found.map(|parameter| parameter.value)
    };
    Ok(IdentifiedArm {
        controller,
        tree,
        rotors: fitted.rotors.clone(),
        models,
        pairs: pairs.to_vec(),
        recording,
        reliefs: fitted.joints.iter().map(relief).collect(),
        percent: fitted.mean_percent(),
        images: fitted.joints.into_iter().map(|joint| joint.image).collect(),
    })
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

/// The recording of an arm whose joints share drives in `pairs`: means of what the joints measure over each sample's
/// time.
///
/// # Errors
/// Refusals of plant or firmware.
pub fn recorded(pairs: &[Pair]) -> Result<String, String> {
    let mut text = "run,t".to_owned();
    (0..JOINTS).for_each(|i| text += &format!(",q{i},t{i}"));
    text.push('\n');
    for (run, duration) in RUNS.into_iter().enumerate() {
        let motion = ArmMotion::random(duration, 10 + run as u64);
        let mut arm = arm(Request::Off, &[], 100 * run as u64, pairs)?;
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
    /// Friction of each joint and sample by equation (2) of 003: the effort less that of the true links and rotors, Nm.
    pub fn measured_friction(&self) -> Vec<Vec<f64>> {
        let (links, rotors) = (links(), actuators().map(|(parameters, _)| parameters.joint.inertia()));
        let mut friction = vec![Vec::new(); JOINTS];
        for i in 0..self.recording.len() {
            let [q, v, a] = self.recording.state(i);
            let rigid = inverse_dynamics(&links, &q, &v, &a);
            for (j, all) in friction.iter_mut().enumerate() {
                all.push(self.recording.joints[j].samples.effort[i] - rigid[j] - rotors[j] * a[j]);
            }
        }
        friction
    }

    /// Friction of each joint and sample as its image says, in the firmware's arithmetic, Nm.
    ///
    /// # Errors
    /// A sample that does not fit the firmware's quantities.
    pub fn image_friction(&self) -> Result<Vec<Vec<f64>>, String> {
        let of = |(image, joint): (&Image, &identification::dataset::Prepared)| {
            let samples = &joint.samples;
            let states = firmware_states(samples).map_err(|error| error.to_string())?;
            let sets = regimes(&image.friction.selector, &states, samples);
            let friction = fixed_point(&image.friction, &states, &sets, samples);
            Ok(friction.into_iter().map(|(physical, network)| physical + network).collect())
        };
        self.images.iter().zip(&self.recording.joints).map(of).collect()
    }

    /// RMS position error of each joint along a motion by computed torque (003, eq. 9), rad: the identified links and
    /// rotors, and a controller of low bandwidth. With the images, or without compensation.
    ///
    /// # Errors
    /// A fault on the way.
    pub fn tracked(&self, request: Request, by: Loop) -> Result<Vec<f64>, String> {
        let motion = ArmMotion::random(MOTION, 20);
        let mut arm = arm(request, &self.models, 900, &self.pairs)?;
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
