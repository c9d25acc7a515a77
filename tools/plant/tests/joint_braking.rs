//! Braking into a supply that takes nothing back: the braking current fades before over-voltage has to switch off, and what the rotor loses is found again.

mod rig;

use joint_firmware::joint::fault::Fault;
use joint_firmware::joint::state_machine::Controlword;
use plant::actuator::ActuatorParameters;
use plant::virtual_joint::Setup;
use rig::{Rig, torque, velocity};
use std::f64::consts::PI;

/// A random joint without a payload on a supply that takes nothing back. Its highest supply is 130 % of the supply's voltage, as [`Setup`] has it.
fn one_way(seed: u64) -> ActuatorParameters {
    let mut parameters = ActuatorParameters::randomised(seed).aligned().without_payload();
    parameters.bus.takes_back = false;
    parameters
}

/// Time in which the full braking power, at the speed limit and the current limit, would charge the capacitor over the band of the setup, s.
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

/// What a braking move did.
struct Braked {
    faults: Vec<Fault>,
    highest: f64,
    /// Energies, J: what motion lost, what the capacitor gained, what became heat or was taken by the board.
    lost: f64,
    stored: f64,
    heat: f64,
    speed_left: f64,
}

/// How a joint is stopped.
#[derive(Clone, Copy, Debug)]
enum Stop {
    /// Along the quick stop's ramp.
    Quick,
    /// All of its torque at once.
    Torque,
}

/// Up to nine tenths of the speed limit, then a quick stop, which brakes as hard as it may, for `time` s or until it ends.
fn braked(parameters: &ActuatorParameters, setup: &Setup, stop: Stop, time: f64) -> Braked {
    let mut setup = *setup;
    setup.configuration.limits.position = (-1000.0, 1000.0);
    let mut rig = Rig::enabled(*parameters, &setup);
    let full = parameters.joint.motor.torque_limit() as f32;
    let speed = 0.9 * parameters.joint.limits.speed;
    rig.demand.command = velocity(speed as f32);
    rig.run(0.6);
    let start = *rig.joint.actuator().state();
    let motion = |rig: &Rig| rig.joint.actuator().joint().stored_energy();
    let before = motion(&rig);
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
    Braked {
        faults: rig.latched(),
        highest,
        lost: before - motion(&rig) + start.magnetic_energy - end.magnetic_energy + supplied,
        stored: end.bus_energy - start.bus_energy,
        heat,
        speed_left: (end.joint.velocity / speed).abs(),
    }
}

/// Whether the supply was what ended it.
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

/// The current cannot follow the supply faster than its loop: where all of the braking power charges the capacitor over the band in less than two of its
/// time constants, over-voltage switches off.
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
