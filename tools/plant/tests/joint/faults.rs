//! Every fault of the joint, produced in the virtual joint: it reaches the state that docs/faults.md defines within the
//! time that stands there, the torque stays within its limit on the way, and it is left by a reset when the
//! documentation says so.

use crate::rig::table::{Reset, documented, documented_faults};
use crate::rig::{Rig, break_down, mend, position, reference, reset, torque, velocity};
use joint_firmware::joint::configuration::Limits;
use joint_firmware::joint::fault::{Fault, Reaction};
use joint_firmware::joint::state_machine::{Controlword, RESET_STEPS, State};
use plant::actuator::{Channel, Failure, Fault as Broken, Phase};
use plant::virtual_joint::Setup;

/// Factor by which the motor's torque may exceed its limit: gain errors of the current sensors and overshoot of the
/// current loop.
const TORQUE_TOLERANCE: f64 = 1.05;

fn moving() -> Rig {
    Rig::following(velocity(1.0), 0.4)
}

/// Half way through a move.
fn positioning() -> Rig {
    Rig::following(position(1.0), 0.3)
}

/// Holds the arm up: at rest, with torque.
fn holding() -> Rig {
    Rig::following(position(0.6), 1.2)
}

/// The reference joint with other limits, in torque mode without torque.
fn limited(change: impl Fn(&mut Limits)) -> Rig {
    let parameters = reference();
    let mut setup = Setup::of(&parameters);
    change(&mut setup.configuration.limits);
    let mut rig = Rig::enabled(parameters, &setup);
    rig.follow(torque(0.0), 0.05);
    rig
}

/// A fault from its cause to the joint's return into service. `shows` tells whether the signals of the last step show
/// the cause.
fn runs_its_course(
    mut rig: Rig,
    fault: Fault,
    cause: impl FnOnce(&mut Rig),
    shows: impl Fn(&Rig) -> bool,
    remedy: impl FnOnce(&mut Rig),
) {
    let row = documented(fault);
    rig.worst_torque = 0.0;
    cause(&mut rig);
    let mut shown = 0;
    for _ in 0..20_000 {
        rig.step();
        shown += u32::from(shows(&rig));
        if !rig.latched().is_empty() {
            break;
        }
    }
    assert!(rig.latched().contains(&fault), "{:?} instead of {fault:?}, shown for {shown} steps", rig.latched());
    assert!((1..=row.steps).contains(&shown), "{fault:?} took {shown} steps");
    assert!(rig.worst_torque < TORQUE_TOLERANCE * rig.torque_limit(), "{fault:?}: {} Nm before it", rig.worst_torque);

    // The history ends with this very step.
    let joint = rig.joint.joint();
    let last = joint.history().iter().last().unwrap();
    assert!(joint.history().is_frozen() && last.faults.contains(fault) && last.state == rig.state(), "{last:?}");
    assert_eq!(last.position, joint.telemetry().motion.position);

    match row.reaction {
        Reaction::SwitchOff => assert_eq!((rig.state(), rig.is_switching()), (State::Fault, false), "{fault:?}"),
        Reaction::Brake => {
            assert_eq!((rig.state(), rig.is_switching()), (State::FaultReactionActive, true), "{fault:?}");
            let most = rig.joint.active().motion.braking_steps + 1;
            let off = (1..=most).find(|_| rig.step() == State::Fault);
            assert!(off.is_some() && !rig.is_switching(), "{fault:?}: {:?}", rig.state());
        }
    }
    for _ in 0..4_000 {
        rig.step();
        assert_eq!((rig.state(), rig.is_switching()), (State::Fault, false), "{fault:?}");
    }
    assert!(rig.worst_torque < TORQUE_TOLERANCE * rig.torque_limit(), "{fault:?}: {} Nm after it", rig.worst_torque);
    let frozen = rig.joint.joint().history().iter().last().unwrap();
    assert!(frozen.faults.contains(fault), "the history stays: {frozen:?}");

    if row.reset != Reset::AnyTime {
        reset(&mut rig);
        assert_eq!(rig.state(), State::Fault, "{fault:?} was reset with its cause present");
    }
    if row.reset == Reset::Waits {
        for _ in 0..RESET_STEPS {
            assert_eq!(rig.step(), State::Fault, "{fault:?} was reset with its cause present");
        }
    }
    remedy(&mut rig);
    rig.run(0.1);
    assert_eq!(rig.state(), State::Fault, "{fault:?} went by itself");
    reset(&mut rig);
    if row.reset == Reset::Restart {
        assert_eq!(rig.state(), State::Fault, "{fault:?} was reset");
        return;
    }
    assert_eq!(rig.state(), State::SwitchOnDisabled, "{fault:?}: {:?}", rig.joint.joint().telemetry().faults);
    assert!(rig.latched().is_empty() && !rig.joint.joint().history().is_frozen());
    rig.silent = false;
    rig.enable();
    rig.follow(torque(0.0), 0.05);
}

/// A fault that `what` causes from the next step on, in every motion.
fn is_caused_in_motion_and_at_rest(fault: Fault, what: Broken) {
    for rig in [moving(), positioning(), holding()] {
        runs_its_course(rig, fault, |rig| break_down(rig, what), |_| true, mend);
    }
}

fn largest_current(rig: &Rig) -> f32 {
    let currents = rig.joint.measured().phase_currents;
    // The sensors' offsets are a fifth of an ampere at most.
    [currents.a, currents.b, currents.c].map(f32::abs).into_iter().fold(0.0, f32::max) + 0.2
}

#[test]
fn over_current() {
    is_caused_in_motion_and_at_rest(Fault::OverCurrent, Broken::Sensor(Channel::CurrentB, Failure::Shorted));
}

#[test]
fn over_current_by_a_load_that_drives_the_motor_beyond_the_supply() {
    let mut rig = holding();
    break_down(&mut rig, Broken::ExternalTorque(200.0));
    rig.steps_to_fault(4_000).unwrap();
    assert_eq!(rig.latched(), [Fault::OverCurrent]);
    assert!(largest_current(&rig) > rig.joint.active().limits.over_current && !rig.is_switching());
}

#[test]
fn current_sensor() {
    is_caused_in_motion_and_at_rest(Fault::CurrentSensor, Broken::Sensor(Channel::CurrentA, Failure::Offset(10.0)));
}

#[test]
fn current_not_followed() {
    for phase in [Phase::A, Phase::B, Phase::C] {
        let opened = |rig: &mut Rig| break_down(rig, Broken::PhaseOpen(phase));
        runs_its_course(moving(), Fault::CurrentNotFollowed, opened, |_| true, mend);
    }
    let opened = |rig: &mut Rig| break_down(rig, Broken::PhaseOpen(Phase::A));
    runs_its_course(holding(), Fault::CurrentNotFollowed, opened, |_| true, mend);
}

/// The time until it shows depends on the current that flows in the phase as it opens; where it is small, the current
/// hardly misses its reference, and the other name is given.
#[test]
fn an_open_phase_is_found_wherever_the_rotor_stands() {
    for n in 0..24 {
        let speed = [0.3, 0.6, 1.0, 3.0][n % 4];
        let mut rig = Rig::following(velocity(speed), 0.4 + 0.0013 * n as f64);
        rig.worst_torque = 0.0;
        break_down(&mut rig, Broken::PhaseOpen([Phase::A, Phase::B, Phase::C][n % 3]));
        let steps = rig.steps_to_fault(documented(Fault::CurrentNotFollowed).steps);
        let found = rig.latched();
        assert!(
            found == [Fault::CurrentNotFollowed] || found == [Fault::EncoderImplausible],
            "{speed} rad/s: {found:?}"
        );
        assert!(steps.is_some() && !rig.is_switching());
        assert!(rig.worst_torque < 0.5 * rig.torque_limit(), "{} Nm", rig.worst_torque);
    }
}

#[test]
fn over_voltage() {
    let shows = |rig: &Rig| rig.joint.measured().bus_voltage > rig.joint.active().limits.bus_voltage.1;
    for rig in [moving(), positioning(), holding()] {
        runs_its_course(rig, Fault::OverVoltage, |rig| break_down(rig, Broken::SourceVoltage(50.0)), shows, mend);
    }
}

#[test]
fn over_voltage_by_braking_into_a_supply_that_takes_nothing_back() {
    let mut parameters = reference();
    parameters.bus.takes_back = false;
    let mut setup = Setup::of(&parameters);
    // Next to nothing: the braking current cannot fade in time.
    setup.configuration.limits.regeneration_band = 0.1;
    let mut rig = Rig::enabled(parameters, &setup);
    rig.follow(velocity(3.0), 0.4);
    rig.demand.controlword = Controlword::QUICK_STOP;
    rig.steps_to_fault(4_000).unwrap();
    assert_eq!(rig.latched(), [Fault::OverVoltage]);
    let highest = f64::from(rig.joint.active().limits.bus_voltage.1);
    rig.run(0.5);
    let voltage = rig.joint.actuator().state().bus_voltage;
    assert!(voltage < highest + 1.0, "{voltage} V");
}

#[test]
fn under_voltage() {
    let shows = |rig: &Rig| rig.joint.measured().bus_voltage < rig.joint.active().limits.bus_voltage.0;
    for rig in [moving(), positioning(), holding()] {
        runs_its_course(rig, Fault::UnderVoltage, |rig| break_down(rig, Broken::SourceVoltage(10.0)), shows, mend);
    }
}

#[test]
fn encoder_lost() {
    is_caused_in_motion_and_at_rest(Fault::EncoderLost, Broken::Sensor(Channel::Encoder, Failure::Open));
}

#[test]
fn an_encoder_that_was_silent_for_longer_than_its_turns_can_be_told_needs_a_restart() {
    let open = Broken::Sensor(Channel::Encoder, Failure::Open);
    let bridged = moving().joint.active().bridged_steps;
    for (silent, accepted) in [(bridged, true), (bridged + 1, false)] {
        let mut rig = moving();
        break_down(&mut rig, open);
        for _ in 0..silent {
            rig.step();
        }
        mend(&mut rig);
        rig.run(1.0);
        assert_eq!(rig.latched(), [Fault::EncoderLost], "after {silent} steps");
        reset(&mut rig);
        rig.run(0.1);
        assert_eq!(rig.latched().is_empty(), accepted, "after {silent} steps: {:?}", rig.latched());
    }
}

#[test]
fn encoder_jump() {
    is_caused_in_motion_and_at_rest(Fault::EncoderJump, Broken::Sensor(Channel::Encoder, Failure::Offset(0.1)));
}

#[test]
fn encoder_implausible() {
    let stuck = Broken::Sensor(Channel::Encoder, Failure::Stuck);
    for rig in [moving(), positioning(), Rig::following(velocity(-3.0), 0.4)] {
        runs_its_course(rig, Fault::EncoderImplausible, |rig| break_down(rig, stuck), |_| true, mend);
    }
}

#[test]
fn over_speed() {
    let shows = |rig: &Rig| rig.joint.joint().telemetry().motion.velocity > 1.2 * rig.joint.active().limits.velocity;
    let limits = |limits: &mut Limits| {
        limits.velocity = 2.0;
        limits.damping = limits.least_damping();
    };
    load_drives_it_over(limited(limits), Fault::OverSpeed, 110.0, shows);
}

#[test]
fn position_limit() {
    let shows = |rig: &Rig| {
        let limits = rig.joint.active().limits;
        rig.joint.joint().telemetry().motion.position > limits.position.1 + limits.position_margin
    };
    let limits = |limits: &mut Limits| (limits.position, limits.position_margin) = ((-0.3, 0.3), 0.02);
    load_drives_it_over(limited(limits), Fault::PositionLimit, 110.0, shows);
}

/// A load of `push` Nm, more than the joint's whole torque, drives it over a limit, through its braking and on with the
/// bridge off.
fn load_drives_it_over(mut rig: Rig, fault: Fault, push: f64, shows: impl Fn(&Rig) -> bool) {
    let row = documented(fault);
    assert_eq!((row.reaction, row.reset), (Reaction::Brake, Reset::OnceGone));
    rig.worst_torque = 0.0;
    break_down(&mut rig, Broken::ExternalTorque(push));
    let mut shown = 0;
    while rig.latched().is_empty() && shown <= row.steps {
        rig.step();
        shown += u32::from(shows(&rig));
    }
    assert_eq!((rig.latched(), shown), (vec![fault], row.steps));
    assert_eq!((rig.state(), rig.is_switching()), (State::FaultReactionActive, true));
    assert!(rig.joint.joint().history().iter().last().unwrap().faults.contains(fault));

    let most = rig.joint.active().motion.braking_steps + 1;
    assert!((1..=most).any(|_| rig.step() == State::Fault), "{fault:?}: {:?}", rig.latched());
    assert!(!rig.is_switching());
    assert!(rig.worst_torque < TORQUE_TOLERANCE * rig.torque_limit(), "{fault:?}: {} Nm", rig.worst_torque);

    let pushed_over = (0..20_000).any(|_| shows(&rig) || rig.step() != State::Fault);
    assert!(pushed_over && shows(&rig));
    reset(&mut rig);
    assert!(shows(&rig) && rig.state() == State::Fault, "{fault:?} was reset with its cause present");
    mend(&mut rig);
    break_down(&mut rig, Broken::ExternalTorque(-push));
    assert!((0..20_000).any(|_| rig.step() == State::Fault && !shows(&rig)));
    mend(&mut rig);
    reset(&mut rig);
    if row.reset == Reset::Restart {
        assert_eq!(rig.state(), State::Fault, "{fault:?} was reset");
        return;
    }
    assert_eq!(rig.state(), State::SwitchOnDisabled, "{fault:?}: {:?}", rig.latched());
}

#[test]
fn bridge_temperature() {
    let hot = Broken::Sensor(Channel::BridgeTemperature, Failure::Offset(100.0));
    is_caused_in_motion_and_at_rest(Fault::BridgeTemperature, hot);
}

#[test]
fn the_bridge_s_own_losses_derate_it_and_more_heat_is_a_fault() {
    let mut parameters = reference();
    let inverter = &mut parameters.inverter;
    (inverter.heat_capacity, inverter.thermal_resistance, inverter.on_resistance) = (0.1, 100.0, 0.02);
    parameters.sensors.bridge.lag = 0.0;
    let mut rig = Rig::enabled(parameters, &Setup::of(&parameters));
    break_down(&mut rig, Broken::LoadBlocked);
    rig.demand.command = torque(80.0);
    rig.run(3.0);
    // Its own losses heat it to where the current that is left keeps it.
    let temperature = |rig: &Rig| rig.joint.actuator().state().bridge_temperature;
    assert!((95.0..109.0).contains(&temperature(&rig)) && rig.latched().is_empty(), "{} °C", temperature(&rig));
    let current = rig.joint.joint().telemetry().reference.q / rig.joint.active().current_limit;
    assert!((0.05..0.75).contains(&current), "{current} of the current limit");
    // Somebody heats it further.
    break_down(&mut rig, Broken::Sensor(Channel::BridgeTemperature, Failure::Offset(20.0)));
    rig.steps_to_fault(60_000).unwrap();
    assert_eq!((rig.latched(), rig.state()), (vec![Fault::BridgeTemperature], State::FaultReactionActive));
}

#[test]
fn winding_temperature() {
    let hot = Broken::Sensor(Channel::WindingTemperature, Failure::Offset(120.0));
    is_caused_in_motion_and_at_rest(Fault::WindingTemperature, hot);
}

#[test]
fn temperature_sensor() {
    for channel in [Channel::WindingTemperature, Channel::BridgeTemperature] {
        is_caused_in_motion_and_at_rest(Fault::TemperatureSensor, Broken::Sensor(channel, Failure::Open));
    }
}

#[test]
fn stale_command() {
    for rig in [moving(), positioning(), holding()] {
        let late = |rig: &Rig| rig.without_set_point > rig.joint.active().deadline_steps;
        let silence = |rig: &mut Rig| rig.silent = true;
        runs_its_course(rig, Fault::StaleCommand, silence, late, |rig| rig.silent = false);
    }
}

#[test]
fn overrun() {
    for rig in [moving(), positioning(), holding()] {
        // A control step that is always late.
        let late = |rig: &mut Rig| rig.always_late = true;
        runs_its_course(rig, Fault::Overrun, late, |_| true, |rig| rig.always_late = false);
    }
}

#[test]
fn bridge_driver() {
    is_caused_in_motion_and_at_rest(Fault::BridgeDriver, Broken::GateDriver);
}

#[test]
fn a_worse_fault_while_braking_switches_off_at_once() {
    let mut rig = moving();
    break_down(&mut rig, Broken::Sensor(Channel::BridgeTemperature, Failure::Open));
    rig.run(0.01);
    assert_eq!((rig.state(), rig.is_switching()), (State::FaultReactionActive, true));
    break_down(&mut rig, Broken::GateDriver);
    assert_eq!((rig.step(), rig.is_switching()), (State::Fault, false));
    assert_eq!(rig.latched(), [Fault::TemperatureSensor, Fault::BridgeDriver]);
}

#[test]
fn the_documentation_names_every_fault_with_its_reaction_and_code() {
    let names: Vec<String> = Fault::ALL.iter().map(|fault| format!("{fault:?}")).collect();
    assert_eq!(documented_faults(), names);
    for fault in Fault::ALL {
        let row = documented(fault);
        assert_eq!((row.reaction, row.error_code), (fault.reaction(), fault.error_code()), "{fault:?}");
    }
}
