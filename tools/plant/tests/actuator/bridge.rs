//! Bridge and supply: what becomes of the duties, and of the energy.

use crate::support::{PERIOD, actuator, coast, hold_current};
use plant::ActuatorParameters;
use plant::actuator::Effect;
use plant::actuator::bus::{Bus, BusParameters};
use plant::actuator::frame::Frame;
use plant::actuator::freewheel::ImplicitStep;
use plant::actuator::inverter::{Inverter, InverterParameters};
use plant::actuator::legs::{Leg, Rails};

const RAILS: Rails = Rails { voltage: 36.0, diode_drop: 0.8 };

fn parameters() -> InverterParameters {
    ActuatorParameters::reference().inverter
}

fn voltage(leg: Leg) -> f64 {
    match leg {
        Leg::Driven { voltage, .. } => voltage,
        other => panic!("{other:?}"),
    }
}

#[test]
fn duties_are_limited_and_come_in_whole_steps_of_the_timer_a_period_late() {
    let mut inverter = Inverter::new(InverterParameters { duty_steps: 100, ..parameters() }, 25.0).unwrap();
    assert_eq!(inverter.load([0.1234, 1.7, -0.2]), [0.5; 3]);
    assert_eq!(inverter.load([0.5, f64::NAN, 0.998]), [0.12, 1.0, 0.0]);
    assert_eq!(inverter.load([0.5; 3]), [0.5, 0.0, 1.0]);
    let mut prompt = Inverter::new(InverterParameters { duty_steps: 0, duty_delay: 0, ..parameters() }, 25.0).unwrap();
    assert_eq!(prompt.load([0.1234, 0.7, 0.3]), [0.1234, 0.7, 0.3]);
    let mut late = Inverter::new(InverterParameters { duty_delay: 3, ..parameters() }, 25.0).unwrap();
    let acting: Vec<f64> = [0.0, 1.0, 0.0, 1.0, 0.0].map(|duty| late.load([duty; 3])[0]).to_vec();
    assert_eq!(acting, [0.5, 0.5, 0.5, 0.0, 1.0]);
}

#[test]
fn dead_time_takes_its_share_of_the_bus_against_the_current_and_is_linear_near_zero() {
    let inverter = Inverter::new(parameters(), 25.0).unwrap();
    // 1 H and 1 us: so stiff a winding that the clamping current stays the one of the parameters.
    let dead_time = inverter.dead_time(&RAILS, PERIOD, 1.0, 1e-6);
    let lost = |current: f64| 18.0 - voltage(dead_time.leg(0.5, current, &RAILS));
    // 0.5 us of 50 us is 1 % of 36 V, and 2 % of the 0.8 V of a diode.
    assert!((lost(5.0) - (0.36 + 0.016)).abs() < 1e-12, "{} V", lost(5.0));
    assert!((lost(-5.0) + lost(5.0)).abs() < 1e-12);
    assert!((lost(0.05) - 0.5 * lost(5.0)).abs() < 1e-12 && lost(0.0) == 0.0);
    // A leg that does not switch loses nothing, one with a pulse shorter than the dead time loses the pulse.
    assert_eq!(voltage(dead_time.leg(1.0, 5.0, &RAILS)), 36.0);
    assert_eq!(voltage(dead_time.leg(0.0, 5.0, &RAILS)), 0.0);
    assert!(voltage(dead_time.leg(0.004, 5.0, &RAILS)) <= 0.0);
}

#[test]
fn without_dead_time_the_voltage_is_the_duty_of_the_bus() {
    let ideal = ActuatorParameters::reference().without(Effect::DeadTime).inverter;
    let inverter = Inverter::new(ideal, 25.0).unwrap();
    let dead_time = inverter.dead_time(&RAILS, PERIOD, 1e-4, 2.5e-5);
    for current in [-5.0, -0.01, 0.0, 0.01, 5.0] {
        assert_eq!(voltage(dead_time.leg(0.25, current, &RAILS)), 9.0);
    }
}

/// Amplitude of the fifth and seventh harmonic over the fundamental of phase A, under a slowly turning voltage.
fn distortion(parameters: ActuatorParameters) -> f64 {
    let mut parameters = parameters.aligned();
    // A rotor too heavy to move: the windings alone.
    parameters.joint.load.inertia = 100.0;
    parameters.windings.inductance_q = parameters.windings.inductance_d;
    let mut actuator = actuator(parameters);
    let periods = 2000;
    let mut sums = [[0.0; 2]; 3];
    for n in 0..2 * periods {
        let angle = std::f64::consts::TAU * f64::from(n) / f64::from(periods);
        let voltages = Frame::at(-angle).phases([0.8, 0.0]);
        actuator.advance(true, crate::support::duties(voltages, actuator.state().bus_voltage), 0.0, PERIOD);
        if n >= periods {
            for (sum, order) in sums.iter_mut().zip([1.0, 5.0, 7.0]) {
                let (sine, cosine) = (order * angle).sin_cos();
                sum[0] += actuator.state().phase_currents[0] * sine;
                sum[1] += actuator.state().phase_currents[0] * cosine;
            }
        }
    }
    let [first, fifth, seventh] = sums.map(|[sine, cosine]| sine.hypot(cosine));
    (fifth + seventh) / first
}

#[test]
fn dead_time_distorts_the_currents_and_the_distortion_is_gone_without_it() {
    let parameters = ActuatorParameters::reference();
    let (with, without) = (distortion(parameters), distortion(parameters.without(Effect::DeadTime)));
    assert!(with > 0.08, "{with}");
    assert!(without < 0.002, "{without}");
}

#[test]
fn a_freewheeling_current_decays_against_the_bus_and_stays_zero() {
    let mut actuator = actuator(ActuatorParameters::reference().ideal().aligned());
    // 2.5 Nm at most: it does not break away.
    hold_current(&mut actuator, [0.5, 0.4], 0.05);
    hold_current(&mut actuator, [8.0, 0.4], 0.05);
    let before = *actuator.state();
    assert!((before.dq_current[0] - 8.0).abs() < 0.05, "{:?}", before.dq_current);
    let mut periods = 0;
    let mut returned = 0.0;
    let mut burnt = 0.0;
    while actuator.state().dq_current != [0.0; 2] {
        coast(&mut actuator, 0.0, PERIOD);
        returned -= actuator.state().powers.input * PERIOD;
        burnt += (actuator.state().powers.copper_loss + actuator.state().powers.bridge_loss) * PERIOD;
        periods += 1;
        assert!(periods < 10, "the current does not decay");
    }
    // About 7 A go in at one phase and out at another, against 37.6 V over twice 0.18 mH: 67 us.
    assert_eq!(periods, 2);
    assert!(
        (returned + burnt) / before.magnetic_energy > 0.98,
        "{returned} J, {burnt} J of {} J",
        before.magnetic_energy
    );
    assert!((returned + burnt) / before.magnetic_energy < 1.0);
    assert!(returned > 0.8 * before.magnetic_energy, "most of it goes back into the bus");
    coast(&mut actuator, 0.0, 0.01);
    assert_eq!(actuator.state().phase_currents, [0.0; 3]);
    assert_eq!(actuator.state().joint.motor_torque, 0.0);
}

#[test]
fn a_coasting_motor_below_the_rails_has_back_emf_only_and_no_torque() {
    let mut actuator = actuator(ActuatorParameters::reference().ideal()).released_at(0.0, 4.0);
    coast(&mut actuator, 0.0, 0.05);
    assert!(actuator.state().joint.velocity > 1.0);
    assert_eq!(actuator.state().dq_current, [0.0; 2]);
    assert_eq!(actuator.state().joint.motor_torque, 0.0);
}

#[test]
fn the_freewheeling_step_is_the_minimum_of_its_convex_problem() {
    // A deterministic scatter of problems; every neighbour of the solution costs more.
    let mut seed = 0.123_f64;
    let mut draw = || {
        seed = (seed * 997.0 + 0.371).fract();
        seed
    };
    let mut kinds = [0; 3];
    for _ in 0..20_000 {
        let problem = ImplicitStep {
            impedance: [1.0 + 50.0 * draw(), 1.0 + 50.0 * draw()],
            voltage: [200.0 * (draw() - 0.5), 200.0 * (draw() - 0.5)],
            directions: Frame::at(6.0 * draw()).directions,
            against: [0.0; 3].map(|_: f64| if draw() < 0.2 { 0.0 } else { 30.0 * draw() }),
            open: [false; 3],
        };
        let cost = |i: [f64; 2]| {
            let kinks: f64 = (0..3)
                .map(|k| problem.against[k] * (problem.directions[k][0] * i[0] + problem.directions[k][1] * i[1]).abs())
                .sum();
            (0..2).map(|x| 0.5 * problem.impedance[x] * i[x] * i[x] - problem.voltage[x] * i[x]).sum::<f64>() + kinks
        };
        let solution = problem.solve();
        let floating =
            Frame { directions: problem.directions }.phases(solution).iter().filter(|i| i.abs() < 1e-9).count();
        kinds[[0, 1, 2, 2][floating]] += 1;
        assert_eq!(problem.rests(), solution == [0.0; 2], "{problem:?}");
        for n in 0..24 {
            let (sine, cosine) = (0.2618 * f64::from(n)).sin_cos();
            for size in [1e-5, 1e-2, 1.0] {
                let neighbour = [solution[0] + size * cosine, solution[1] + size * sine];
                assert!(cost(neighbour) >= cost(solution) - 1e-9, "{problem:?}");
            }
        }
    }
    assert!(kinds.iter().all(|kind| *kind > 500), "all kinds of solution occur: {kinds:?}");
}

#[test]
fn the_bus_sags_by_the_source_resistance_and_rises_when_current_comes_back() {
    let parameters =
        BusParameters { source_voltage: 36.0, source_resistance: 0.1, capacitance: 5e-4, takes_back: true };
    let mut bus = Bus::new(parameters).unwrap();
    (0..200).for_each(|_| bus.advance(10.0, 0.0, PERIOD));
    assert!((bus.voltage() - 35.0).abs() < 1e-9 && (bus.source_current() - 10.0).abs() < 1e-9);
    (0..200).for_each(|_| bus.advance(-10.0, 0.0, PERIOD));
    assert!((bus.voltage() - 37.0).abs() < 1e-9);
    // One time constant, R C = 50 us: a step of the load is not felt at once.
    let mut bus = Bus::new(parameters).unwrap();
    (0..50).for_each(|_| bus.advance(10.0, 0.0, 1e-6));
    assert!((36.0 - bus.voltage() - (1.0 - (-1.0_f64).exp())).abs() < 0.01, "{} V", bus.voltage());
}

#[test]
fn a_source_that_takes_nothing_back_lets_the_capacitor_charge_by_the_energy() {
    let parameters =
        BusParameters { source_voltage: 36.0, source_resistance: 0.1, capacitance: 5e-4, takes_back: false };
    let mut bus = Bus::new(parameters).unwrap();
    (0..1000).for_each(|_| bus.advance(-1.0, 0.0, 1e-5));
    assert!((bus.voltage() - (36.0 + 0.01 / 5e-4)).abs() < 1e-9, "{} V", bus.voltage());
    assert_eq!(bus.source_current(), 0.0);
    // And it supplies again once the charge is used.
    (0..1100).for_each(|_| bus.advance(1.0, 0.0, 1e-5));
    assert!((bus.voltage() - 35.9).abs() < 1e-6);
}

#[test]
fn braking_raises_the_bus_by_the_energy_that_friction_and_copper_leave() {
    let mut parameters = ActuatorParameters::reference().aligned().without_payload().without(Effect::Cogging);
    parameters.joint.load.inertia = 0.5;
    parameters.bus.takes_back = false;
    parameters.bus.capacitance = 5e-3;
    let mut actuator = actuator(parameters).released_at(0.0, 4.0);
    let before = *actuator.state();
    let kinetic = actuator.joint().stored_energy();
    let (mut heat, mut idle, mut supplied) = (0.0, 0.0, 0.0);
    let mut controller = crate::support::CurrentController::new(actuator.parameters());
    while actuator.state().joint.velocity > 0.2 {
        let duties = controller.duties(&actuator, [0.0, -5.0]);
        actuator.advance(true, duties, 0.0, PERIOD);
        let state = actuator.state();
        assert!(state.time < 1.0, "it does not brake");
        heat += (state.powers.copper_loss + state.powers.bridge_loss + state.joint.friction_loss) * PERIOD;
        idle += parameters.inverter.idle_power * PERIOD;
        supplied += state.source_current * state.bus_voltage * PERIOD;
    }
    let after = *actuator.state();
    let released =
        kinetic - actuator.joint().stored_energy() + before.magnetic_energy - after.magnetic_energy + supplied;
    let gained = after.bus_energy - before.bus_energy;
    assert!(after.bus_voltage > 37.0, "{} V", after.bus_voltage);
    assert!((gained + heat + idle - released).abs() < 0.01 * released, "{gained} + {heat} + {idle} J of {released} J");
    assert!(gained > 0.2 * released && supplied < 0.02 * released, "{gained} J, {supplied} J");
}

#[test]
fn a_load_makes_the_bus_sag_and_a_stiff_bus_does_not() {
    let sag = |parameters: ActuatorParameters| {
        let mut actuator = actuator(parameters.aligned());
        hold_current(&mut actuator, [0.0, 15.0], 0.1);
        parameters.bus.source_voltage - actuator.state().bus_voltage
    };
    let parameters = ActuatorParameters::reference();
    let soft = sag(parameters);
    assert!(soft > 0.2, "{soft} V");
    assert!(sag(parameters.without(Effect::BusImpedance)) < 0.01 * soft);
}

#[test]
fn the_bridge_warms_by_its_thermal_resistance_with_its_time_constant() {
    let parameters = parameters();
    let mut inverter = Inverter::new(parameters, 25.0).unwrap();
    // 4 J/K x 8 K/W = 32 s.
    (0..3200).for_each(|_| inverter.heat(2.0, 25.0, 0.01));
    assert!((inverter.temperature() - (25.0 + 16.0 * 0.632)).abs() < 0.05, "{} °C", inverter.temperature());
}
