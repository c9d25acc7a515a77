//! Friction in motion, step by step: it changes once a round of the motion loop, and where the model is replaced
//! meanwhile the torque stays within its slew limit.

use friction_compensation::compensation::Request;
use friction_compensation::friction::FrictionModel;
use host_tests::driving::{demand, enabled};
use host_tests::informed::informed;
use joint_firmware::joint::configuration::MOTION_STEPS;
use joint_firmware::joint::state_machine::State;
use plant::actuator::ActuatorParameters;
use plant::excitation::{Segment, Trajectory};
use plant::friction_factors::FrictionFactors;
use plant::virtual_joint::Setup;

#[test]
fn the_torque_moves_by_no_more_than_the_slew_limit_when_models_are_swapped_in_motion() {
    let parameters = ActuatorParameters::reference().aligned();
    let setup = Setup::of(&parameters).compensating(Request::Physical);
    let rate = setup.bridge.motion_rate();
    let model = |factor: f64| {
        let friction = parameters.joint.friction.scaled(&FrictionFactors::uniform(factor)).unwrap();
        FrictionModel::new(&informed(&parameters, &friction), rate)
    };
    // Weak, strong, none at all: what an upload, a roll back and a refusal do.
    let models = [Some(model(0.5)), Some(model(1.3)), None];
    let mut joint = enabled(&parameters, &setup, 0.0, 1).unwrap();
    let trajectory = Trajectory::new(vec![Segment::Move { to: 1.2, speed: 1.0, acceleration: 20.0 }]).unwrap();
    // The torque moves once a round of the motion loop.
    let slew = f64::from(setup.configuration.compensation.slew) / f64::from(rate);
    let steps = (trajectory.duration() / joint.period()) as u64;
    let (mut before, mut largest, mut swaps) = (0.0, 0.0f64, 0);
    let mut at_swap = 0.0f64;
    for n in 0..steps {
        // Between all stages of a round.
        if n % 4_001 == 2_000 {
            joint.set_friction(models[swaps % 3].clone());
            swaps += 1;
        }
        let demand = demand(&joint, &trajectory, n);
        let telemetry = joint.step(&demand, 0.0);
        assert_eq!(telemetry.state, State::OperationEnabled);
        let torque = f64::from(telemetry.compensated.torque);
        largest = largest.max((torque - before).abs());
        if n % 4_001 == 2_500 {
            at_swap = at_swap.max(torque.abs());
        }
        before = torque;
    }
    assert!(swaps >= 6 && at_swap > 2.0, "{swaps} swaps, compensation up to {at_swap} Nm");
    println!("{swaps} swaps, largest step {largest:.4} Nm, slew limit {slew:.4} Nm a round");
    assert!(largest <= slew * 1.001, "{largest} Nm in a step, slew limit {slew} Nm");
}

#[test]
fn the_torque_of_a_round_is_held_until_the_next_one_is_done() {
    let parameters = ActuatorParameters::reference().aligned();
    let setup = Setup::of(&parameters).compensating(Request::Physical);
    let model = FrictionModel::new(&informed(&parameters, &parameters.joint.friction), setup.bridge.motion_rate());
    let mut joint = enabled(&parameters, &setup, 0.0, 1).unwrap();
    joint.set_friction(Some(model));
    let trajectory = Trajectory::new(vec![Segment::Move { to: 1.2, speed: 1.0, acceleration: 20.0 }]).unwrap();
    let steps = (trajectory.duration() / joint.period()) as u64;
    let outputs: Vec<_> = (0..steps)
        .map(|n| {
            let demand = demand(&joint, &trajectory, n);
            joint.step(&demand, 0.0).compensated.output
        })
        .collect();
    let changes: Vec<usize> = (1..outputs.len()).filter(|n| outputs[*n] != outputs[n - 1]).collect();
    let gaps: Vec<usize> = changes.windows(2).map(|pair| pair[1] - pair[0]).collect();
    assert!(gaps.iter().all(|gap| gap % MOTION_STEPS as usize == 0), "{gaps:?}");
    // While the velocity changes, so does friction.
    let at_once = gaps.iter().filter(|gap| **gap == MOTION_STEPS as usize).count();
    assert!(at_once > 1000, "{at_once} of {} rounds gave another torque than the one before", gaps.len());
}
