//! Braking into a supply that takes nothing back: the braking current fades before over-voltage has to switch off, and
//! what the rotor loses is found again.

use crate::rig::{Rig, torque, velocity};
use joint_firmware::joint::fault::Fault;
use joint_firmware::joint::state_machine::Controlword;
use plant::actuator::{Accessories, ActuatorParameters};
use plant::virtual_joint::Setup;
use std::f64::consts::PI;

/// A random joint without a payload on a supply that takes nothing back. Its highest supply is 130 % of the supply's
/// voltage, as [`Setup`] has it.
fn one_way(seed: u64) -> ActuatorParameters {
    let mut parameters = ActuatorParameters::randomised(seed).aligned().without_payload();
    parameters.bus.takes_back = false;
    parameters
}

/// Time in which the full braking power, at the speed limit and the current limit, would charge the capacitor over the
/// band of the setup, s.
fn charging_time(parameters: &ActuatorParameters, setup: &Setup) -> f64 {
    let motor = &parameters.joint.motor;
    let highest = f64::from(setup.configuration.limits.bus_voltage.1);
    let power = motor.torque_constant * motor.current_limit * motor.gear_ratio * parameters.joint.limits.speed;
    parameters.bus.capacitance * highest * f64::from(setup.configuration.limits.regeneration_band) / power
}

/// The same with next to no band.
fn narrow(setup: &Setup) -> Setup {
    let mut narrow = *setup;
    narrow.configuration.limits.regeneration_band = 0.1;
    narrow
}

/// Results of a braking move.
struct Braked {
    faults: Vec<Fault>,
    highest: f64,
    /// Energies, J: what motion lost, what the capacitor gained, what became heat or was taken by the board.
    lost: f64,
    stored: f64,
    heat: f64,
    /// Energy burnt by a chopper's resistor.
    burnt: f64,
    speed_left: f64,
}

/// Way in which a joint is stopped.
#[derive(Clone, Copy, Debug)]
enum Stop {
    /// Along the quick stop's ramp.
    Quick,
    /// All of its torque at once.
    Torque,
}

/// Acceleration to nine tenths of the speed limit, then a quick stop, which brakes as hard as it may, for `time` s or
/// until it ends.
fn braked(parameters: &ActuatorParameters, setup: &Setup, stop: Stop, time: f64) -> Braked {
    braked_with(parameters, setup, stop, time, 0.0)
}

/// The same with a chopper's resistor, 1/ohm.
fn braked_with(parameters: &ActuatorParameters, setup: &Setup, stop: Stop, time: f64, chopper: f64) -> Braked {
    let mut setup = *setup;
    setup.configuration.limits.position = (-1000.0, 1000.0);
    let mut rig = Rig::enabled(*parameters, &setup);
    rig.joint.actuator_mut().fit(Accessories { chopper, ..Accessories::default() });
    let full = parameters.joint.motor.torque_limit() as f32;
    let speed = 0.9 * parameters.joint.limits.speed;
    rig.demand.command = velocity(speed as f32);
    rig.run(0.6);
    let start = *rig.joint.actuator().state();
    let motion = |rig: &Rig| rig.joint.actuator().joint().stored_energy();
    let before = motion(&rig);
    let before_burnt = rig.joint.actuator().fitted().burnt();
    match stop {
        Stop::Quick => rig.demand.controlword = Controlword::QUICK_STOP,
        Stop::Torque => rig.demand.command = torque(-full),
    }
    let (mut heat, mut highest, mut supplied) = (0.0, 0.0_f64, 0.0);
    let period = rig.joint.period();
    for _ in 0..rig.steps_in(time) {
        let voltage = rig.joint.actuator().state().bus_voltage;
        rig.step();
        if !rig.is_switching() || rig.velocity() < 0.0 {
            break;
        }
        let state = rig.joint.actuator().state();
        heat += period * (state.powers.copper_loss + state.powers.bridge_loss + state.joint.friction_loss);
        heat += period * parameters.inverter.idle_power;
        supplied += period * state.source_current * voltage;
        highest = highest.max(state.bus_voltage);
    }
    let end = rig.joint.actuator().state();
    let burnt = rig.joint.actuator().fitted().burnt() - before_burnt;
    Braked {
        faults: rig.latched(),
        highest,
        lost: before - motion(&rig) + start.magnetic_energy - end.magnetic_energy + supplied,
        stored: end.bus_energy - start.bus_energy,
        heat,
        burnt,
        speed_left: (end.joint.velocity / speed).abs(),
    }
}

/// Returns `true` if the supply was what ended it.
fn tripped(braked: &Braked) -> bool {
    assert!(braked.faults.is_empty() || braked.faults == [Fault::OverVoltage], "{:?}", braked.faults);
    !braked.faults.is_empty()
}

#[test]
fn what_braking_takes_from_the_motion_is_in_the_capacitor_or_heat() {
    let mut charged = 0;
    for seed in 0..40 {
        let parameters = one_way(seed);
        let mut setup = Setup::of(&parameters);
        setup.configuration.motor.loss_current =
            if seed % 2 == 0 { 0.0 } else { setup.configuration.motor.current_limit };
        let braked = braked(&parameters, &setup, Stop::Quick, 0.3);
        charged += u32::from(braked.stored > 0.05 * braked.lost);
        let found = braked.stored + braked.heat;
        assert!((found / braked.lost - 1.0).abs() < 0.02, "seed {seed}: {} J lost, {found} J found", braked.lost);
    }
    assert!(charged >= 8, "{charged} of 40 charged the capacitor by a twentieth of what they lost");
}

#[test]
fn a_quick_stop_never_raises_the_supply_to_its_limit() {
    let mut needed = 0;
    for seed in 0..100 {
        let parameters = one_way(seed);
        let setup = Setup::of(&parameters);
        let faded = braked(&parameters, &setup, Stop::Quick, 1.0);
        let highest = setup.configuration.limits.bus_voltage.1;
        assert!(!tripped(&faded), "seed {seed}: {:.1} of {highest:.1} V", faded.highest);
        needed += u32::from(tripped(&braked(&parameters, &narrow(&setup), Stop::Quick, 1.0)));
    }
    assert!(needed >= 30, "with next to no band {needed} of 100 switch off");
}

/// The current cannot follow the supply faster than its loop: where all of the braking power charges the capacitor over
/// the band in less than two of its time constants, over-voltage switches off.
#[test]
fn all_torque_at_once_raises_it_to_the_limit_only_where_the_current_cannot_follow() {
    let (mut needed, mut slow) = (0, 0);
    for seed in 0..100 {
        let parameters = one_way(seed);
        let setup = Setup::of(&parameters);
        let follows = 1.0 / (PI * f64::from(setup.configuration.gains.current_bandwidth));
        if charging_time(&parameters, &setup) < follows {
            continue;
        }
        slow += 1;
        let faded = braked(&parameters, &setup, Stop::Torque, 1.0);
        let highest = setup.configuration.limits.bus_voltage.1;
        assert!(!tripped(&faded), "seed {seed}: {:.1} of {highest:.1} V", faded.highest);
        needed += u32::from(tripped(&braked(&parameters, &narrow(&setup), Stop::Torque, 1.0)));
    }
    assert!(slow >= 60 && needed >= 15, "with next to no band {needed} of {slow} switch off");
}

#[test]
fn a_d_current_burns_what_the_supply_does_not_take() {
    let mut helped = 0;
    for seed in 0..40 {
        let parameters = one_way(seed);
        let mut setup = Setup::of(&parameters);
        let without = braked(&parameters, &setup, Stop::Quick, 0.3);
        setup.configuration.motor.loss_current = setup.configuration.motor.current_limit;
        let with = braked(&parameters, &setup, Stop::Quick, 0.3);
        assert!(!tripped(&with) && with.speed_left < without.speed_left + 0.02, "seed {seed}: {}", with.speed_left);
        if without.speed_left > 0.2 {
            helped += u32::from(with.speed_left < 0.8 * without.speed_left);
            println!("{seed}: {:.2} of the speed left, with losses {:.2}", without.speed_left, with.speed_left);
        }
    }
    assert!(helped >= 5, "{helped}");
}

/// A resistor that takes the largest braking power at the chopper's voltage.
#[test]
fn a_chopper_takes_what_the_supply_does_not_and_braking_loses_none_of_its_torque() {
    let (mut needed, mut helped) = (0, 0);
    for seed in 0..130 {
        let parameters = one_way(seed);
        let mut setup = Setup::of(&parameters);
        let without = braked(&parameters, &setup, Stop::Quick, 0.5);
        let limits = &mut setup.configuration.limits;
        let onset = limits.bus_voltage.1 - limits.regeneration_band;
        // Half-way between the supply's own voltage and where the torque begins to fade.
        limits.chopper_voltage = 0.5 * (parameters.bus.source_voltage as f32 + onset);
        limits.chopper_share = 1.0;
        let (onset, band) = (f64::from(onset), f64::from(limits.regeneration_band));
        let motor = &parameters.joint.motor;
        let power = motor.torque_limit() * parameters.joint.limits.speed;
        let conductance = power / f64::from(limits.chopper_voltage).powi(2);
        let with = braked_with(&parameters, &setup, Stop::Quick, 0.5, conductance);
        assert!(!tripped(&with) && with.burnt >= 0.0, "seed {seed}: {:.1} V", with.highest);
        // The fade has hardly begun.
        let most = onset + 0.25 * band;
        assert!(with.highest < most, "seed {seed}: {:.2} V of {onset:.2} V, {most:.2}", with.highest);
        let found = with.stored + with.heat + with.burnt;
        // The plant's supply is stepped once a period, and loses some where the resistor discharges it in a few.
        assert!((found / with.lost - 1.0).abs() < 0.05, "seed {seed}: {} J lost, {found} J found", with.lost);
        if without.speed_left > 0.1 {
            needed += 1;
            helped += u32::from(with.speed_left < 0.02);
        }
    }
    assert!(needed >= 10 && helped == needed, "{helped} of {needed}");
}

/// A resistor that bears little: what it does not take, the fade of the torque does.
#[test]
fn a_chopper_whose_share_is_used_up_leaves_the_rest_to_the_fade() {
    let charges = |seed: &u64| braked(&one_way(*seed), &Setup::of(&one_way(*seed)), Stop::Quick, 0.5).speed_left > 0.1;
    for (seed, conductance) in (0..130).filter(charges).zip([0.03, 0.1, 0.3].into_iter().cycle()) {
        let parameters = one_way(seed);
        let mut setup = Setup::of(&parameters);
        let limits = &mut setup.configuration.limits;
        limits.chopper_voltage = 1.05 * parameters.bus.source_voltage as f32;
        limits.chopper_share = 1e-3;
        let braked = braked_with(&parameters, &setup, Stop::Quick, 2.0, conductance);
        assert!(!tripped(&braked), "seed {seed}");
        // 10 s ln of it at once, and its part of 2.6 s.
        let longest = 10.0 * 1e-3 + 2.6 * 1e-3;
        let most = conductance * braked.highest.powi(2) * longest;
        assert!(braked.burnt > 0.05 * most && braked.burnt < 1.05 * most, "{} of {most} J", braked.burnt);
    }
}
