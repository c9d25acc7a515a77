//! Cost of a control step on the host, whole and by its parts, and how many times faster than real time the closed loop
//! runs.

use divan::{Bencher, black_box};
use friction_compensation::compensation::{Acting, Request};
use friction_compensation::friction::common::CommonTerms;
use friction_compensation::friction::domain::{Domain, Range};
use friction_compensation::friction::network::{NetworkParameters, Neuron};
use friction_compensation::friction::physical::{Coefficients, PhysicalParameters, Terms};
use friction_compensation::friction::regime::Selector;
use friction_compensation::friction::state::{JointState, SIGNALS};
use friction_compensation::friction::{FrictionModel, FrictionParameters, ParameterSet};
use joint_firmware::joint::state_machine::{Controlword, State};
use joint_firmware::joint::{Command, Demand, Joint, Mode};
use joint_firmware::motor::angle::ElectricalAngle;
use joint_firmware::motor::field_oriented::{FieldOriented, FieldOrientedInput};
use joint_firmware::motor::observer::Observer;
use joint_firmware::motor::phases::Phases;
use joint_firmware::motor::transform::{AlphaBeta, Dq};
use nalgebra::{Matrix3, Unit, Vector3};
use plant::actuator::ActuatorParameters;
use plant::load::LoadParameters;
use plant::virtual_joint::Setup;
use plant::{Arm, VirtualJoint, actuator::Actuator};
use rigid_body::{JointKind, LinkInertia, Placement, Tree};
use std::time::Instant;

/// Least factor by which an arm of six joints runs faster than real time on one core (docs/robot.md).
const LEAST: f64 = 2.0;

fn main() {
    divan::main();
    // Cargo passes `--bench`; tests, which pass nothing, measure no time.
    if std::env::args().any(|argument| argument == "--bench") {
        let factor = arm_of_six_over_real_time();
        println!("six joints of an arm run {factor:.1} times faster than real time");
        assert!(factor >= LEAST, "{factor} times, at least {LEAST} are promised");
    }
}

/// Two seconds of an arm's time over the time that they take.
fn arm_of_six_over_real_time() -> f64 {
    let (mut arm, mut demand) = (arm_of_six(), swinging());
    let steps = (2.0 / arm.period()) as u32;
    let begin = Instant::now();
    (0..steps).for_each(|_| swing(&mut arm, &mut demand));
    f64::from(steps) * arm.period() / begin.elapsed().as_secs_f64()
}

/// Every term, and a network with no weight zero.
fn friction() -> FrictionModel {
    let range = Range { low: -(64 << 16), high: 64 << 16 };
    let neuron = Neuron { weights: [3000, -7000, 5000, 900, -4000, 1500], fraction: 13 };
    let network = NetworkParameters {
        first: [[9 << 24, 20 << 26, -(7 << 24), 3 << 24, 5 << 24, 1 << 22]; 5],
        hidden: [[neuron; 5]; 2],
        output: neuron,
        scale: 2 << 16,
    };
    let coefficients = Coefficients::from_array(std::array::from_fn(|i| 4000 + 97 * i as i32));
    let set = ParameterSet { physical: PhysicalParameters { terms: Terms::ALL, coefficients }, network: Some(network) };
    let parameters = FrictionParameters {
        domain: Domain { ranges: [range; SIGNALS], margin: 1 << 15, reference_temperature: 0 },
        selector: Selector::default(),
        common: CommonTerms::NONE,
        sets: [set, ParameterSet::default(), ParameterSet::default(), ParameterSet::default()],
    };
    FrictionModel::new(&parameters, 20_000)
}

fn moving() -> (VirtualJoint, Demand) {
    let parameters = ActuatorParameters::reference().aligned();
    let setup = Setup::of(&parameters).compensating(Request::PhysicalAndNetwork);
    let mut joint = VirtualJoint::new(parameters, &setup, 25.0, 1).expect("the reference joint");
    joint.set_friction(Some(friction()));
    joint.enable().expect("a sound joint");
    let command = Command { mode: Mode::Velocity, velocity: 0.1, ..Command::default() };
    (joint, Demand { controlword: Controlword::ENABLE_OPERATION, command, ..Demand::default() })
}

#[divan::bench]
fn transforms(bencher: Bencher) {
    let currents = Phases { a: 1.0, b: -0.4, c: -0.6 };
    bencher.bench_local(|| {
        let sin_cos = black_box(ElectricalAngle(123_456_789)).sin_cos();
        AlphaBeta::from_phases(black_box(currents)).to_rotor(sin_cos).to_stationary(sin_cos).to_phases()
    });
}

#[divan::bench]
fn observer(bencher: Bencher) {
    let (joint, _) = moving();
    let mut observer = Observer::default();
    let mut angle = 0u32;
    bencher.bench_local(|| {
        angle = angle.wrapping_add(100_000);
        observer.step(&joint.active().observer, Some(angle), 0.0)
    });
}

#[divan::bench]
fn current_control(bencher: Bencher) {
    let (joint, _) = moving();
    let mut control = FieldOriented::default();
    let input = FieldOrientedInput {
        phase_currents: Phases { a: 1.0, b: -0.4, c: -0.6 },
        angle: ElectricalAngle(123_456_789),
        speed: 100.0,
        bus_voltage: 36.0,
        reference: Dq { d: 0.0, q: 2.0 },
    };
    bencher.bench_local(|| control.step(&joint.active().field_oriented, black_box(&input)));
}

#[divan::bench]
fn friction_model(bencher: Bencher) {
    let model = friction();
    let state = JointState::from_signals([1 << 16, 1 << 15, 3 << 16, 3 << 16, 30 << 16, 1 << 14]);
    bencher.bench_local(|| model.evaluate(0, black_box(&state)));
}

/// A thousand steps: a recorded closed loop, which goes on as it did because the step gives the same bits.
/// (Measurements that do not follow are a fault, and a joint in fault has less to do.)
#[divan::bench]
fn thousand_control_steps(bencher: Bencher) {
    let (mut virtual_joint, mut demand) = moving();
    let (active, start) = (virtual_joint.active().clone(), virtual_joint.joint().clone());
    let recorded: Vec<_> = (0..1000)
        .map(|_| {
            demand.sequence = demand.sequence.wrapping_add(1);
            let slow = *virtual_joint.slow();
            virtual_joint.step(&demand, 0.0);
            (demand, slow, *virtual_joint.measured())
        })
        .collect();
    bencher.with_inputs(|| start.clone()).bench_local_values(|mut joint: Joint| {
        for (demand, slow, measured) in &recorded {
            black_box(joint.control_step(&active, demand, slow, black_box(measured)));
        }
        let telemetry = joint.telemetry();
        assert_eq!(
            (telemetry.state, telemetry.compensated.output.acting),
            (State::OperationEnabled, Acting::PhysicalAndNetwork)
        );
        joint
    });
}

#[divan::bench]
fn plant_period(bencher: Bencher) {
    let mut actuator = Actuator::new(ActuatorParameters::reference().aligned(), 25.0, 1).expect("the reference joint");
    bencher.bench_local(|| {
        actuator.advance(true, black_box([0.5, 0.51, 0.49]), 0.0, 5e-5);
        actuator.measure()
    });
}

/// One period of the closed loop; 50 µs of joint time.
#[divan::bench(sample_size = 1000)]
fn closed_loop(bencher: Bencher) {
    let (mut joint, mut demand) = moving();
    bencher.bench_local(|| {
        demand.sequence = demand.sequence.wrapping_add(1);
        // Back and forth, so that it never reaches a limit.
        demand.command.velocity = if demand.sequence % 40_000 < 20_000 { 0.1 } else { -0.1 };
        let state = joint.step(&demand, 0.0).state;
        assert_eq!(state, State::OperationEnabled);
        state
    });
}

/// Six joints with links of 2 kg, hanging, with friction of every term.
fn arm_of_six() -> Arm {
    let about = Matrix3::from_diagonal(&Vector3::new(0.02, 0.02, 0.005));
    let link = LinkInertia::from_centre(2.0, Vector3::new(0.01, 0.02, -0.1), about);
    let axes = [Vector3::z(), Vector3::y(), Vector3::y(), Vector3::x(), Vector3::y(), Vector3::x()];
    let joint = |(i, axis): (usize, Vector3<f64>)| rigid_body::Joint {
        name: format!("joint_{i}"),
        parent: i.checked_sub(1),
        placement: Placement::from_xyz_rpy([0.0, 0.0, if i == 0 { 2.0 } else { -0.2 }], [0.0; 3]),
        kind: JointKind::Revolute,
        axis: Unit::new_normalize(axis),
        link,
        armature: 0.0,
    };
    let links =
        Tree { joints: axes.into_iter().enumerate().map(joint).collect(), gravity: Vector3::new(0.0, 0.0, -9.806_65) };
    let mut parameters = ActuatorParameters::reference().aligned();
    let setup = Setup::of(&parameters).compensating(Request::PhysicalAndNetwork);
    parameters.joint.load = LoadParameters { inertia: 0.0, mass: 0.0, length: 0.0 };
    let actuator = |seed| {
        let mut joint = VirtualJoint::new(parameters, &setup, 25.0, seed).expect("the reference joint");
        joint.set_friction(Some(friction()));
        joint
    };
    let mut arm = Arm::new(links, (1..=6).map(actuator).collect()).expect("joints without load of their own");
    arm.enable().expect("sound joints");
    arm
}

/// One period of six joints on one tree of links, each with its control step; 50 µs of the arm's time.
#[divan::bench(sample_size = 1000)]
fn six_joints_of_an_arm(bencher: Bencher) {
    let (mut arm, mut demand) = (arm_of_six(), swinging());
    bencher.bench_local(|| swing(&mut arm, &mut demand));
}

/// The first demand of joints that swing.
fn swinging() -> Demand {
    let command = Command { mode: Mode::Velocity, ..Command::default() };
    Demand { controlword: Controlword::ENABLE_OPERATION, command, ..Demand::default() }
}

/// One period of all joints, back and forth, so that none reaches a limit.
fn swing(arm: &mut Arm, demand: &mut Demand) {
    demand.sequence = demand.sequence.wrapping_add(1);
    demand.command.velocity = if demand.sequence % 40_000 < 20_000 { 0.1 } else { -0.1 };
    let told = arm.step(&[*demand; 6], &[]);
    assert!(told.iter().all(|telemetry| telemetry.state == State::OperationEnabled));
}
