//! Compensation that is switched off is compensation that was never there: the same duties, bit for bit.

use friction_compensation::compensation::Request;
use friction_compensation::friction::FrictionModel;
use host_tests::driving::{demand, enabled};
use host_tests::informed::informed;
use joint_firmware::joint::Bridge;
use plant::actuator::ActuatorParameters;
use plant::excitation::Excitation;
use plant::virtual_joint::{Build, Setup};

fn bits(bridge: &Bridge) -> [u32; 3] {
    [bridge.duties.a, bridge.duties.b, bridge.duties.c].map(f32::to_bits)
}

/// Steps of a recording run in which the two builds' duties differ, and steps in all.
fn differences(request: Request) -> (u64, u64) {
    let parameters = ActuatorParameters::reference().aligned();
    let setup = Setup::of(&parameters).compensating(request);
    let run = &Excitation::for_joint(&parameters.joint, 1).unwrap().runs[0];
    let model = FrictionModel::new(&informed(&parameters, &parameters.joint.friction), 20_000);
    let mut whole = enabled(&parameters, &setup, 0.0, 1).unwrap();
    whole.set_friction(Some(model));
    let mut without = enabled(&parameters, &setup, 0.0, 1).unwrap().with_build(Build::WithoutCompensation);
    let steps = (run.trajectory.duration() / whole.period()) as u64;
    let mut different = 0;
    for n in 0..steps {
        let demand = demand(&whole, &run.trajectory, n);
        whole.step(&demand, 0.0);
        without.step(&demand, 0.0);
        different += u64::from(bits(whole.bridge()) != bits(without.bridge()));
    }
    (different, steps)
}

#[test]
fn switched_off_the_duties_of_a_whole_scenario_are_those_of_a_build_without_it() {
    let (different, steps) = differences(Request::Off);
    println!("{different} of {steps} control steps differ");
    assert!(steps > 400_000);
    assert_eq!(different, 0);
}

#[test]
fn switched_on_the_duties_differ() {
    let (different, steps) = differences(Request::Physical);
    assert!(different > steps / 2, "{different} of {steps}");
}
