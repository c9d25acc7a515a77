//! Every fault shows, from when it is there to when it is gone, and nothing else changes with it.

use crate::support::{CurrentController, PERIOD, actuator, coast, hold_current};
use plant::actuator::{Channel, DriveSample, Failure, Fault, Phase};
use plant::{Actuator, ActuatorParameters, ParameterError};

fn quiet() -> ActuatorParameters {
    ActuatorParameters::reference().ideal().aligned()
}

/// An actuator with several ampere in every phase that turns and is warm.
fn running(parameters: ActuatorParameters) -> Actuator {
    let mut actuator = actuator(parameters).released_at(0.3, 1.5);
    hold_current(&mut actuator, [1.0, 6.0], 0.02);
    actuator
}

fn reading(sample: &DriveSample, channel: Channel) -> f64 {
    match channel {
        Channel::CurrentA => sample.phase_currents[0],
        Channel::CurrentB => sample.phase_currents[1],
        Channel::CurrentC => sample.phase_currents[2],
        Channel::Encoder => f64::from(sample.encoder) / 4_294_967_296.0,
        Channel::BusVoltage => sample.bus_voltage,
        Channel::WindingTemperature => sample.winding_temperature,
        Channel::BridgeTemperature => sample.bridge_temperature,
    }
}

/// Readings of `channel` before and during `failure`, each with what a healthy twin reads.
fn with_failure(channel: Channel, failure: Failure) -> Vec<(DriveSample, DriveSample)> {
    let mut broken = running(quiet());
    let mut healthy = broken.clone();
    broken.measure();
    broken.inject(Fault::Sensor(channel, failure)).unwrap();
    let mut controller = CurrentController::new(&quiet());
    (0..200)
        .map(|_| {
            let duties = controller.duties(&healthy, [1.0, 6.0]);
            broken.advance(true, duties, 0.0, PERIOD);
            healthy.advance(true, duties, 0.0, PERIOD);
            assert_eq!(broken.state(), healthy.state(), "a sensor does not change the truth");
            (broken.measure(), healthy.measure())
        })
        .collect()
}

fn others_agree(pairs: &[(DriveSample, DriveSample)], channel: Channel) {
    for other in Channel::ALL.into_iter().filter(|other| *other != channel) {
        assert!(pairs.iter().all(|(broken, healthy)| reading(broken, other) == reading(healthy, other)), "{other:?}");
    }
}

#[test]
fn a_stuck_sensor_repeats_its_last_reading() {
    for channel in Channel::ALL {
        let pairs = with_failure(channel, Failure::Stuck);
        let first = reading(&pairs[0].0, channel);
        assert!(pairs.iter().all(|(broken, _)| reading(broken, channel) == first), "{channel:?}");
        assert!(pairs.iter().any(|(_, healthy)| reading(healthy, channel) != first), "{channel:?}");
        others_agree(&pairs, channel);
    }
}

#[test]
fn an_open_sensor_reads_the_low_end_of_its_range_and_an_open_encoder_is_not_valid() {
    for (channel, low) in Channel::ALL.into_iter().zip([-60.0, -60.0, -60.0, 1.0, 0.0, -50.0, -50.0]) {
        let pairs = with_failure(channel, Failure::Open);
        assert!(pairs.iter().all(|(broken, _)| (reading(broken, channel) - low).abs() < 1e-9), "{channel:?}");
        assert!(pairs.iter().all(|(broken, _)| broken.encoder_valid == (channel != Channel::Encoder)));
        others_agree(&pairs, channel);
    }
}

#[test]
fn a_shorted_sensor_reads_the_high_end_of_its_range_and_a_shorted_encoder_zero_without_a_hint() {
    for (channel, high) in Channel::ALL.into_iter().zip([60.0, 60.0, 60.0, 0.0, 73.0, 250.0, 200.0]) {
        let pairs = with_failure(channel, Failure::Shorted);
        assert!(pairs.iter().all(|(broken, _)| reading(broken, channel) == high), "{channel:?}");
        assert!(pairs.iter().all(|(broken, _)| broken.encoder_valid));
        others_agree(&pairs, channel);
    }
}

#[test]
fn a_jump_shifts_every_reading_by_its_size() {
    for channel in Channel::ALL {
        let size = if channel == Channel::Encoder { 0.01 } else { 2.0 };
        let pairs = with_failure(channel, Failure::Offset(size));
        for (broken, healthy) in &pairs {
            let shift = reading(broken, channel) - reading(healthy, channel);
            let shift = if channel == Channel::Encoder { shift - shift.round() } else { shift };
            assert!((shift - size).abs() < 1e-7, "{channel:?}: {shift}");
        }
        others_agree(&pairs, channel);
    }
}

#[test]
fn a_noisy_sensor_has_noise_of_the_deviation_asked_for() {
    for channel in Channel::ALL {
        let size = if channel == Channel::Encoder { 0.01 } else { 1.0 };
        let pairs = with_failure(channel, Failure::Noisy(size));
        let square: f64 = pairs
            .iter()
            .map(|(broken, healthy)| {
                let noise = reading(broken, channel) - reading(healthy, channel);
                if channel == Channel::Encoder { (noise - noise.round()).powi(2) } else { noise * noise }
            })
            .sum();
        let deviation = (square / pairs.len() as f64).sqrt();
        assert!((deviation / size - 1.0).abs() < 0.2, "{channel:?}: {deviation}");
        others_agree(&pairs, channel);
    }
}

#[test]
fn an_open_phase_carries_no_current_driven_or_not() {
    for phase in Phase::ALL {
        let mut actuator = running(quiet());
        assert!(actuator.state().phase_currents[phase.index()].abs() > 0.1);
        actuator.inject(Fault::PhaseOpen(phase)).unwrap();
        let mut controller = CurrentController::new(&quiet());
        let mut others: f64 = 0.0;
        for _ in 0..200 {
            let duties = controller.duties(&actuator, [0.0, 6.0]);
            actuator.advance(true, duties, 0.0, PERIOD);
            let currents = actuator.state().phase_currents;
            let largest = currents.iter().fold(0.0_f64, |most, i| i.abs().max(most));
            // The remaining current is the rotor's change of speed within a period.
            assert!(currents[phase.index()].abs() < 3e-4 * largest + 1e-9, "{currents:?}");
            assert!(currents.iter().sum::<f64>().abs() < 1e-9);
            others = others.max(largest);
        }
        assert!(others > 3.0, "the other two still do: {others} A");
        coast(&mut actuator, 0.0, 5e-3);
        assert_eq!(actuator.state().dq_current, [0.0; 2]);
    }
}

#[test]
fn a_shorted_phase_brakes_a_turning_motor_even_with_the_bridge_off() {
    let coasting = |fault: Option<Fault>| {
        let mut actuator = actuator(quiet().without_payload()).released_at(0.0, 4.0);
        fault.into_iter().for_each(|fault| actuator.inject(fault).unwrap());
        let mut peak: f64 = 0.0;
        for _ in 0..400 {
            coast(&mut actuator, 0.0, PERIOD);
            peak = actuator.state().phase_currents.iter().fold(peak, |peak, i| peak.max(i.abs()));
        }
        (actuator.state().joint.velocity, peak)
    };
    let (free, none) = coasting(None);
    let (braked, current) = coasting(Some(Fault::PhaseShorted(Phase::B)));
    assert_eq!(none, 0.0);
    assert!(current > 5.0, "{current} A");
    assert!(braked < 0.8 * free, "{braked} rad/s against {free} rad/s");
}

#[test]
fn a_shorted_phase_that_switches_breaks_the_bus_down() {
    let mut actuator = actuator(ActuatorParameters::reference());
    actuator.inject(Fault::PhaseShorted(Phase::C)).unwrap();
    for _ in 0..20 {
        actuator.advance(true, [0.5; 3], 0.0, PERIOD);
    }
    // Half of 1/(2 x 5 mOhm) behind 60 mOhm.
    assert!(actuator.state().bus_voltage < 10.0, "{} V", actuator.state().bus_voltage);
    for _ in 0..200 {
        actuator.advance(false, [0.5; 3], 0.0, PERIOD);
    }
    assert!(actuator.state().bus_voltage > 35.0, "it recovers once the bridge is off");
}

#[test]
fn the_source_can_rise_and_fall() {
    for voltage in [60.0, 12.0, 0.0] {
        let mut actuator = running(ActuatorParameters::reference().aligned());
        actuator.inject(Fault::SourceVoltage(voltage)).unwrap();
        coast(&mut actuator, 0.0, 0.01);
        assert!((actuator.measure().bus_voltage - voltage).abs() < 1.0, "{} V", actuator.measure().bus_voltage);
        actuator.clear_faults();
        coast(&mut actuator, 0.0, 0.01);
        assert!((actuator.state().bus_voltage - 36.0).abs() < 0.1);
    }
}

#[test]
fn the_gate_driver_reports_and_the_bridge_works_on() {
    let mut actuator = running(quiet());
    assert!(!actuator.measure().bridge_fault);
    actuator.inject(Fault::GateDriver).unwrap();
    assert!(actuator.measure().bridge_fault);
    hold_current(&mut actuator, [0.0, 4.0], 0.02);
    assert!((actuator.state().dq_current[1] - 4.0).abs() < 0.3);
}

#[test]
fn a_blocked_load_does_not_move_under_full_torque_and_moves_again_when_released() {
    let mut actuator = running(quiet());
    actuator.inject(Fault::LoadBlocked).unwrap();
    let held = actuator.state().joint.position;
    hold_current(&mut actuator, [0.0, 20.0], 0.2);
    assert!((actuator.state().joint.position - held).abs() < 1e-3, "{} rad", actuator.state().joint.position - held);
    assert!(actuator.state().joint.velocity.abs() < 1e-3);
    assert!(actuator.state().joint.motor_torque > 80.0);
    actuator.clear_faults();
    hold_current(&mut actuator, [0.0, 20.0], 0.05);
    assert!(actuator.state().joint.position > held + 0.05);
}

#[test]
fn an_external_torque_pushes_the_link() {
    let mut actuator = actuator(quiet());
    actuator.inject(Fault::ExternalTorque(12.0)).unwrap();
    actuator.inject(Fault::ExternalTorque(-2.0)).unwrap();
    coast(&mut actuator, 0.0, 0.01);
    let mut pushed = crate::support::actuator(quiet());
    coast(&mut pushed, 10.0, 0.01);
    assert_eq!(actuator.state().joint, pushed.state().joint);
    assert!(pushed.state().joint.velocity > 0.01);
}

#[test]
fn faults_come_and_go_at_their_times() {
    let mut actuator = actuator(quiet());
    actuator.schedule(Fault::GateDriver, 0.01, 0.02).unwrap();
    actuator.schedule(Fault::Sensor(Channel::Encoder, Failure::Open), 0.015, 0.03).unwrap();
    for n in 0..1000 {
        let sample = actuator.measure();
        let time = actuator.state().time;
        assert!((time - f64::from(n) * PERIOD).abs() < 1e-9);
        assert_eq!(sample.bridge_fault, (0.01..0.02).contains(&time), "at {time} s");
        assert_eq!(sample.encoder_valid, !(0.015..0.03).contains(&time), "at {time} s");
        actuator.advance(false, [0.5; 3], 0.0, PERIOD);
    }
}

#[test]
fn a_fault_with_an_impossible_number_is_refused() {
    let mut actuator = actuator(quiet());
    let name = |result: Result<(), ParameterError>| match result.unwrap_err() {
        ParameterError::OutOfRange { name, .. } | ParameterError::CountOutOfRange { name, .. } => name,
    };
    assert_eq!(name(actuator.inject(Fault::SourceVoltage(-1.0))), "fault.source_voltage");
    assert_eq!(name(actuator.inject(Fault::ExternalTorque(f64::NAN))), "fault.external_torque");
    assert_eq!(name(actuator.inject(Fault::Sensor(Channel::Encoder, Failure::Offset(1e9)))), "fault.offset");
    assert_eq!(name(actuator.inject(Fault::Sensor(Channel::Encoder, Failure::Noisy(-1.0)))), "fault.noisy");
    assert_eq!(name(actuator.schedule(Fault::GateDriver, 2.0, 1.0)), "fault.end");
    assert_eq!(name(actuator.schedule(Fault::GateDriver, f64::NAN, 1.0)), "fault.start");
    assert_eq!(*actuator.faults(), Default::default());
}
