//! Joints whose gear gives way, configured by a data sheet, keep the promises of those of the model's kind: no fault in
//! ordinary motion, and no way through a limit.

use crate::rig::{Rig, position, torque, velocity};
use joint_firmware::joint::Command;
use joint_firmware::joint::state_machine::State;
use plant::actuator::ActuatorParameters;
use plant::virtual_joint::Setup;

/// Actuators drawn at random that each promise is tried on.
const JOINTS: u64 = 60;

fn judging(seed: u64) -> (ActuatorParameters, Setup) {
    let parameters = ActuatorParameters::judging(seed).aligned();
    (parameters, Setup::by_data_sheet(&parameters, seed))
}

/// Reversals at nine tenths of the speed limit, moves over most of the travel, half of the torque either way, and a
/// stop; 2 s.
fn motion(parameters: &ActuatorParameters) -> [(Command, f64); 9] {
    let joint = &parameters.joint;
    let (speed, travel) = (0.9 * joint.limits.speed as f32, 0.8 * joint.limits.travel as f32);
    let half = 0.5 * joint.motor.torque_limit() as f32;
    [
        (velocity(speed), 0.3),
        (velocity(-speed), 0.4),
        (position(travel), 0.5),
        (position(-0.5 * travel), 0.4),
        (torque(half), 0.05),
        (torque(-half), 0.1),
        (torque(half), 0.05),
        (velocity(0.0), 0.15),
        (position(0.0), 0.05),
    ]
}

#[test]
fn hard_motion_has_no_fault() {
    for seed in 0..JOINTS {
        let (parameters, setup) = judging(seed);
        let mut rig = Rig::enabled(parameters, &setup);
        for (command, time) in motion(&parameters) {
            rig.demand.command = command;
            for _ in 0..rig.steps_in(time) {
                let state = rig.step();
                assert_eq!(state, State::OperationEnabled, "seed {seed}, {command:?}: {:?}", rig.latched());
            }
        }
        assert!(rig.worst_torque > 0.4 * rig.torque_limit(), "seed {seed}: {} Nm", rig.worst_torque);
    }
}

/// Driven outwards with the whole torque: motor and link stay within the margin, the motor's speed within the fault's,
/// and at the limit all but one of them stand.
#[test]
fn joints_driven_outwards_with_all_they_have_stop_within_the_margin() {
    let (mut farthest, mut fastest, mut trembling) = (0.0f64, 0.0f64, 0);
    for seed in 0..JOINTS {
        let (parameters, mut setup) = judging(seed);
        let gains = &mut setup.configuration.gains;
        (gains.stiffness, gains.damping, gains.integral) = (0.0, 0.0, 0.0);
        let mut rig = Rig::enabled(parameters, &setup);
        let limits = rig.joint.active().limits;
        rig.demand.command = torque(limits.torque);
        let end = f64::from(limits.position.1);
        for _ in 0..rig.steps_in(3.0) {
            rig.step();
            let state = rig.joint.actuator().state().joint;
            let passed = state.position.max(state.link_position) - end;
            farthest = farthest.max(passed / f64::from(limits.position_margin));
            fastest = fastest.max(state.velocity.abs() / f64::from(limits.velocity));
        }
        assert!(rig.latched().is_empty(), "{seed}: {:?}", rig.latched());
        assert!(farthest < 0.75, "{seed}: {farthest} of the margin");
        assert!(fastest < 1.2, "{seed}: {fastest} of the velocity limit");
        let state = rig.joint.actuator().state().joint;
        let still = state.link_velocity.abs() / parameters.joint.limits.speed;
        assert!(still < 0.1, "{seed}: {still} of its speed at the limit");
        trembling += u32::from(still > 0.01);
    }
    // A rotor of little inertia rattles in its backlash.
    assert!(trembling <= 1, "{trembling} of {JOINTS} do not come to rest at the limit");
    println!("{farthest:.2} of the margin, {fastest:.2} of the velocity limit at the most");
}
