//! The windings obey the laws of a synchronous motor.

use plant::ActuatorParameters;
use plant::actuator::frame::Frame;
use plant::actuator::legs::{Leg, Rails};
use plant::actuator::windings::{Flow, Rotation, WindingParameters, Windings};

const RAILS: Rails = Rails { voltage: 36.0, diode_drop: 0.8 };

fn windings() -> (Windings, WindingParameters, f64, f64) {
    let parameters = ActuatorParameters::reference();
    let motor = parameters.joint.motor;
    let windings = Windings::new(parameters.windings, motor).unwrap();
    let resistance = windings.phase_resistance(25.0);
    (windings, parameters.windings, resistance, parameters.windings.flux_linkage(&motor))
}

/// The rotor at `velocity`, `time` after its d axis was before phase A; a step centred there.
fn rotation(velocity: f64, time: f64) -> Rotation {
    Rotation { frame: Frame::at(velocity * time), velocity }
}

fn legs(voltages: [f64; 3]) -> [Leg; 3] {
    voltages.map(|voltage| Leg::Driven { voltage: 18.0 + voltage, duty: 0.5 + voltage / 36.0 })
}

/// Applies `voltage` along d and q for `duration` while the rotor turns at `velocity`.
fn apply(windings: &mut Windings, voltage: [f64; 2], velocity: f64, duration: f64, step: f64) -> Flow {
    let resistance = windings.phase_resistance(25.0);
    let mut flow = Flow::NONE;
    for n in 0..(duration / step).round() as usize {
        let rotation = rotation(velocity, (n as f64 + 0.5) * step);
        let legs = legs(rotation.frame.phases(voltage));
        flow = windings.advance(&legs, &RAILS, &rotation, resistance, 0.0, step);
    }
    flow
}

#[test]
fn phases_to_dq_and_back_lose_nothing_but_what_is_common_to_all_three() {
    let frame = Frame::at(1.234);
    let dq = frame.dq([3.0 + 7.0, -1.0 + 7.0, -2.0 + 7.0]);
    for (phase, expected) in frame.phases(dq).into_iter().zip([3.0, -1.0, -2.0]) {
        assert!((phase - expected).abs() < 1e-12);
    }
    // The d axis before phase A; then B lies a third of a turn ahead.
    assert!((Frame::at(0.0).dq([1.0, -0.5, -0.5])[0] - 1.0).abs() < 1e-12);
    assert!((Frame::at(2.0 * std::f64::consts::PI / 3.0).dq([-0.5, 1.0, -0.5])[0] - 1.0).abs() < 1e-12);
}

#[test]
fn a_still_rotor_takes_voltage_over_resistance_in_the_end() {
    let (mut windings, _, resistance, _) = windings();
    apply(&mut windings, [1.0, 0.6], 0.0, 0.03, 2.5e-5);
    let [d, q] = windings.current();
    assert!((d - 1.0 / resistance).abs() < 1e-6, "{d} A");
    assert!((q - 0.6 / resistance).abs() < 1e-6, "{q} A");
}

#[test]
fn the_current_rises_with_the_time_constants_of_both_axes() {
    for (axis, voltage) in [(0, [1.0, 0.0]), (1, [0.0, 1.0])] {
        let (mut windings, parameters, resistance, _) = windings();
        let inductance = [parameters.inductance_d, parameters.inductance_q][axis];
        let time_constant = inductance / resistance;
        apply(&mut windings, voltage, 0.0, time_constant, time_constant / 40.0);
        let expected = (1.0 - (-1.0_f64).exp()) / resistance;
        assert!((windings.current()[axis] / expected - 1.0).abs() < 1e-3, "{:?} A", windings.current());
        assert!(windings.current()[1 - axis].abs() < 1e-12);
    }
}

#[test]
fn a_turning_motor_settles_where_the_voltage_equations_say() {
    let (mut windings, parameters, resistance, flux) = windings();
    let velocity = 900.0;
    let [d, q] = [-3.0, 8.0];
    let voltage = [
        resistance * d - velocity * parameters.inductance_q * q,
        resistance * q + velocity * (parameters.inductance_d * d + flux),
    ];
    apply(&mut windings, voltage, velocity, 0.02, 1e-5);
    let settled = windings.current();
    assert!((settled[0] - d).abs() < 2e-3 && (settled[1] - q).abs() < 2e-3, "{settled:?} A");
}

#[test]
fn torque_is_three_halves_pole_pairs_flux_current_and_so_the_torque_constant() {
    let (mut windings, parameters, resistance, flux) = windings();
    let pole_pairs = parameters.pole_pairs as f64;
    let flow = apply(&mut windings, [0.0, resistance * 10.0], 0.0, 0.05, 2.5e-5);
    assert!((flow.torque - 1.5 * pole_pairs * flux * 10.0).abs() < 1e-6);
    assert!((flow.torque - ActuatorParameters::reference().joint.motor.torque_constant * 10.0).abs() < 1e-6);
    // With a current along d the different inductances give torque too.
    let flow = apply(&mut windings, [resistance * -10.0, resistance * 10.0], 0.0, 0.05, 2.5e-5);
    let reluctance = 1.5 * pole_pairs * (parameters.inductance_d - parameters.inductance_q) * -100.0;
    assert!((flow.torque - 0.9 - reluctance).abs() < 1e-6 && reluctance > 0.01, "{} Nm", flow.torque);
}

#[test]
fn copper_loss_is_the_joints_resistance_times_the_square_of_the_current_and_rises_with_temperature() {
    let (mut windings, _, resistance, _) = windings();
    let flow = apply(&mut windings, [0.0, resistance * 10.0], 0.0, 0.05, 2.5e-5);
    assert!((flow.copper_loss - ActuatorParameters::reference().joint.motor.copper_loss(10.0)).abs() < 1e-6);
    let warm = windings.phase_resistance(125.0) / resistance;
    assert!((warm - 1.385).abs() < 1e-9, "{warm}");
}

#[test]
fn power_in_is_copper_loss_and_mechanical_power_and_magnetic_energy_to_rounding_at_any_step() {
    for step in [5e-6, 2.5e-5, 1e-4] {
        let (mut windings, parameters, resistance, _) = windings();
        let velocity = 1200.0;
        let mut spent = 0.0;
        for n in 0..2000 {
            let rotation = rotation(velocity, (f64::from(n) + 0.5) * step);
            // Voltages that have nothing to do with the rotor's angle: transients all the time.
            let phase = 3000.0 * f64::from(n) * step;
            let voltages = [0.0, 2.0, 4.5].map(|shift| 12.0 * (phase + shift).sin());
            let before = windings.magnetic_energy();
            let flow = windings.advance(&legs(voltages), &RAILS, &rotation, resistance, 0.0, step);
            let input: f64 = voltages.iter().zip(flow.phase_currents).map(|(v, i)| v * i).sum();
            let mechanical = flow.torque * velocity / parameters.pole_pairs as f64;
            let stored = (windings.magnetic_energy() - before) / step;
            assert!((input - flow.copper_loss - mechanical - stored).abs() < 1e-8, "at {n}: {input} W");
            spent += input.abs() * step;
        }
        assert!(spent > 1.0, "{spent} J went through");
    }
}

#[test]
fn series_resistance_of_the_bridge_takes_its_share_of_the_voltage() {
    let (mut windings, _, resistance, _) = windings();
    let still = rotation(0.0, 0.0);
    let legs = legs(still.frame.phases([2.0, 0.0]));
    for _ in 0..4000 {
        windings.advance(&legs, &RAILS, &still, resistance, 0.05, 2.5e-5);
    }
    assert!((windings.current()[0] - 2.0 / (resistance + 0.05)).abs() < 1e-6);
}

#[test]
fn an_open_lead_carries_no_current_and_leaves_the_other_two_in_series() {
    let (mut windings, parameters, resistance, _) = windings();
    let still = rotation(0.0, 0.0);
    let driven = |voltage| Leg::Driven { voltage, duty: 0.0 };
    let legs = [Leg::Open, driven(20.0), driven(18.0)];
    let mut flow = Flow::NONE;
    for _ in 0..10_000 {
        flow = windings.advance(&legs, &RAILS, &still, resistance, 0.0, 5e-6);
    }
    let [a, b, c] = flow.phase_currents;
    assert!(a.abs() < 1e-12 && (b + c).abs() < 1e-12);
    assert!((b - 2.0 / (2.0 * resistance)).abs() < 1e-6, "{b} A");
    assert!(parameters.inductance_q > 0.0);
}

#[test]
fn diodes_rectify_a_back_emf_beyond_the_rails_and_nothing_below() {
    let (_, _, resistance, flux) = windings();
    // Line to line, the back-EMF has sqrt(3) w psi of peak.
    let limit = (RAILS.voltage + 2.0 * RAILS.diode_drop) / (3.0_f64.sqrt() * flux);
    let peak = |velocity: f64| {
        let (mut windings, ..) = windings();
        let (mut peak, mut fed): (f64, f64) = (0.0, 0.0);
        for n in 0..20_000 {
            let rotation = rotation(velocity, f64::from(n) * 5e-6);
            let flow = windings.advance(&[Leg::Diodes; 3], &RAILS, &rotation, resistance, 0.0, 5e-6);
            peak = flow.phase_currents.iter().fold(peak, |peak, current| peak.max(current.abs()));
            fed += flow.phase_currents.iter().map(|current| -current.min(0.0)).sum::<f64>() / 20_000.0;
            assert!(flow.torque * velocity <= 1e-9, "diodes only brake");
        }
        (peak, fed)
    };
    assert_eq!(peak(0.99 * limit), (0.0, 0.0));
    let (above, fed) = peak(1.3 * limit);
    assert!(above > 1.0 && fed > 0.5, "{above} A of peak, {fed} A into the bus");
}
