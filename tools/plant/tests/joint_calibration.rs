//! A joint that nobody has described calibrates its own motor, instead of moving, and then runs with what it found; host.

mod rig;

use joint_firmware::joint::commissioning::calibration_settings;
use joint_firmware::joint::fault::Fault;
use joint_firmware::joint::state_machine::{Controlword, State};
use joint_firmware::motor::angle::{Direction, ElectricalAngle, EncoderAlignment};
use joint_firmware::motor::calibration::{Calibration, CalibrationSettings, Failure, Progress};
use plant::actuator::{ActuatorParameters, Fault as Broken};
use plant::virtual_joint::Setup;
use rig::{Rig, break_down, velocity};

/// Rounds of `run` in which every calibration ends.
const ROUNDS: u32 = 60;

/// An actuator that nobody has aligned, and a configuration that is wrong in everything that a calibration finds.
fn unknown(seed: u64) -> (ActuatorParameters, Setup) {
    let parameters = ActuatorParameters::randomised(seed).without_payload();
    let mut setup = Setup::of(&parameters);
    let motor = &mut setup.configuration.motor;
    motor.resistance *= 1.7;
    motor.inductance_d *= 0.6;
    motor.inductance_q *= 0.6;
    motor.alignment =
        EncoderAlignment { pole_pairs: 3, direction: Direction::Reverse, electrical_zero: ElectricalAngle(1 << 30) };
    (parameters, setup)
}

fn settings(setup: &Setup, share: f32) -> CalibrationSettings {
    let configuration = &setup.configuration;
    calibration_settings(configuration, &setup.bridge, share * configuration.motor.current_limit).unwrap()
}

/// A joint that is off and has begun a calibration.
fn begun(seed: u64, share: f32) -> (Rig, Setup) {
    let (parameters, setup) = unknown(seed);
    let mut rig = Rig::off(parameters, &setup);
    rig.run(0.1);
    assert_eq!(rig.state(), State::SwitchOnDisabled);
    rig.joint.calibrate(Some(&settings(&setup, share))).unwrap();
    (rig, setup)
}

fn progress(rig: &Rig) -> Progress {
    rig.joint.joint().calibration().expect("a calibration was begun")
}

/// Goes on until a stage is reached.
fn until(rig: &mut Rig, stage: Progress) {
    for _ in 0..100 * ROUNDS {
        rig.run(0.01);
        if progress(rig) == stage {
            rig.run(0.01);
            return;
        }
    }
    panic!("{stage:?} is not reached: {:?}", progress(rig));
}

/// What is found, with half of the current where the first is too much for the motor's saliency.
fn found(seed: u64) -> (Calibration, Rig, Setup) {
    for share in [0.5, 0.25, 0.125] {
        let (mut rig, setup) = begun(seed, share);
        for _ in 0..ROUNDS {
            rig.run(1.0);
            match progress(&rig) {
                Progress::Done(found) => return (found, rig, setup),
                Progress::Failed(Failure::RotorBesideField { .. }) => break,
                Progress::Failed(failure) => panic!("seed {seed}: {failure}"),
                _ => {}
            }
        }
    }
    panic!("seed {seed}: no end");
}

#[test]
fn a_joint_that_nobody_has_described_calibrates_itself_and_runs() {
    for seed in 0..6 {
        let (found, mut rig, setup) = found(seed);
        assert!(!rig.is_switching() && rig.latched().is_empty(), "seed {seed}: {:?}", rig.latched());
        let temperature = rig.joint.measured().winding_temperature;
        let calibrated = setup.configuration.calibrated(&found, temperature);
        rig.joint.set_active(calibrated.prepare(&setup.bridge).unwrap());
        rig.enable();
        let speed = 0.5 * setup.configuration.limits.velocity;
        rig.follow(velocity(speed), 0.4);
        let reached = rig.joint.joint().telemetry().motion.velocity;
        assert!((reached / speed - 1.0).abs() < 0.1, "seed {seed}: {reached} of {speed} rad/s");
    }
}

#[test]
fn without_its_calibration_the_same_joint_does_not_run() {
    let (parameters, setup) = unknown(0);
    let mut rig = Rig::enabled(parameters, &setup);
    rig.demand.command = velocity(0.5 * setup.configuration.limits.velocity);
    assert!(rig.steps_to_fault(rig.steps_in(0.4)).is_some());
}

#[test]
fn whatever_takes_the_joint_out_of_switch_on_disabled_gives_the_calibration_up_with_the_bridge_off() {
    for stage in [Progress::Resistance, Progress::Inductance, Progress::Alignment] {
        let way_out: [&dyn Fn(&mut Rig); 4] = [
            &|rig| rig.demand.controlword = Controlword::SHUTDOWN,
            &|rig| break_down(rig, Broken::GateDriver),
            &|rig| rig.always_late = true,
            &|rig| rig.joint.calibrate(None).unwrap(),
        ];
        for (n, out) in way_out.into_iter().enumerate() {
            let (mut rig, _) = begun(1, 0.25);
            until(&mut rig, stage);
            assert!(rig.is_switching(), "{stage:?}");
            out(&mut rig);
            rig.step();
            assert!(!rig.is_switching(), "{stage:?}, way {n}");
            assert_eq!(progress(&rig), Progress::Failed(Failure::Aborted), "{stage:?}, way {n}");
            // It does not begin again by itself.
            rig.demand.controlword = Controlword::DISABLE_VOLTAGE;
            for _ in 0..1000 {
                rig.step();
                assert!(!rig.is_switching(), "{stage:?}, way {n}");
            }
        }
    }
}

#[test]
fn an_enabled_joint_is_not_calibrated() {
    let parameters = rig::reference();
    let setup = Setup::of(&parameters);
    let mut rig = Rig::enabled(parameters, &setup);
    rig.follow(velocity(0.5), 0.2);
    rig.joint.calibrate(Some(&settings(&setup, 0.25))).unwrap();
    rig.follow(velocity(0.5), 0.2);
    rig.demand.controlword = Controlword::DISABLE_VOLTAGE;
    rig.run(0.2);
    assert!(!rig.is_switching(), "it does not begin later either");
    assert_eq!(progress(&rig), Progress::Failed(Failure::Aborted));
}

#[test]
fn a_supply_that_is_too_low_gives_the_calibration_up() {
    let (mut rig, _) = begun(1, 0.25);
    until(&mut rig, Progress::Resistance);
    break_down(&mut rig, Broken::SourceVoltage(0.0));
    rig.run(0.5);
    assert!(!rig.is_switching());
    assert!(matches!(progress(&rig), Progress::Failed(_)));
    assert!(rig.latched().contains(&Fault::UnderVoltage), "{:?}", rig.latched());
}
