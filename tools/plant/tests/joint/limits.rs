//! Velocity and position limits of the virtual joint: torque up to them, holding torque at them, and no way through
//! them, whatever the modes' gains are.

use crate::rig::{Rig, break_down, position, reference, torque};
use joint_firmware::joint::configuration::Gains;
use joint_firmware::joint::fault::Fault;
use joint_firmware::joint::state_machine::{Controlword, State};
use joint_firmware::joint::{Command, Mode};
use plant::actuator::{ActuatorParameters, Fault as Broken};
use plant::virtual_joint::Setup;

/// Actuators drawn at random that each law is tried on.
const JOINTS: u64 = 100;

/// The same inertia without gravity: nothing but friction is against the motor.
fn weightless(mut parameters: ActuatorParameters) -> ActuatorParameters {
    let load = &mut parameters.joint.load;
    (load.inertia, load.mass, load.length) = (load.total_inertia(), 0.0, 0.0);
    parameters
}

/// Inertia, kg m².
fn inertia(parameters: &ActuatorParameters) -> f64 {
    parameters.joint.inertia()
}

/// All gains of the modes are zero.
fn without_gains(setup: &mut Setup) {
    let gains = &mut setup.configuration.gains;
    (gains.stiffness, gains.damping, gains.integral) = (0.0, 0.0, 0.0);
}

/// Part of the margin by which the joint has passed its upper limit.
fn passed(rig: &Rig) -> f64 {
    let limits = rig.joint.active().limits;
    (rig.position() - f64::from(limits.position.1)) / f64::from(limits.position_margin)
}

/// Commands for `time` s; the largest of what `of` sees meanwhile.
fn largest(rig: &mut Rig, command: Command, time: f64, of: impl Fn(&Rig) -> f64) -> f64 {
    rig.demand.command = command;
    (0..rig.steps_in(time)).fold(f64::MIN, |most, _| {
        rig.step();
        most.max(of(rig))
    })
}

/// The reference joint without gravity between narrow position limits.
fn narrow(change: impl Fn(&mut Setup)) -> Rig {
    let parameters = weightless(reference());
    let mut setup = Setup::of(&parameters);
    setup.configuration.limits.position = (-0.5, 0.5);
    change(&mut setup);
    Rig::enabled(parameters, &setup)
}

/// A load pulls away from the limit or pushes against it: 90 % of the torque limit, which is announced, or 80 %, which
/// position mode's integral finds in some 5 s, because friction takes most of the rest.
#[test]
fn a_load_is_held_at_each_position_limit_by_position_and_by_impedance() {
    for (side, away) in [(-1.0f32, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)] {
        for (mode, load, known, time) in
            [(Mode::Position, 0.9, 1.0, 1.5), (Mode::Position, 0.8, 0.0, 25.0), (Mode::Impedance, 0.9, 1.0, 1.5)]
        {
            let mut rig = narrow(|_| {});
            rig.follow(position(0.5 * side), 1.0);
            let push = away * side * load * rig.joint.active().limits.torque;
            let gains = rig.joint.active().motion;
            break_down(&mut rig, Broken::ExternalTorque(f64::from(push)));
            let (stiffness, damping) = (gains.stiffness, gains.damping);
            let torque = -push * known;
            rig.follow(Command { mode, position: 0.5 * side, torque, stiffness, damping, ..Command::NOTHING }, time);
            let sag = (rig.position() - f64::from(0.5 * side)).abs();
            println!("{mode:?}, {push} Nm at {side}: {:.2} mrad", 1e3 * sag);
            assert!(sag < 4e-3, "{mode:?}, load of {push} Nm at {side}: {sag} rad");
            assert!(rig.velocity().abs() < 0.01);
        }
    }
}

/// Stiffnesses and dampings of the modes, parts of the reference joint's.
const GAINS: [f32; 3] = [0.0, 1.0, 4.0];

/// Every mode with the parts of stiffness and damping that it has a use for.
fn modes() -> impl Iterator<Item = (Mode, f32, f32)> {
    let all = |mode| GAINS.into_iter().flat_map(move |k| GAINS.into_iter().map(move |d| (mode, k, d)));
    let modes = [Mode::Position, Mode::Velocity, Mode::Impedance, Mode::Torque].into_iter().flat_map(all);
    modes.filter(|(mode, k, d)| match mode {
        Mode::Velocity => *k == 0.0,
        Mode::Torque => (*k, *d) == (0.0, 0.0),
        _ => true,
    })
}

/// The reference joint at its upper or lower limit, without integral, with so many parts of stiffness and damping.
fn at_limit(side: f32, stiffness: f32, damping: f32, usual: &Gains) -> Rig {
    let mut rig = narrow(|setup| {
        let gains = &mut setup.configuration.gains;
        (gains.stiffness, gains.damping) = (stiffness * usual.stiffness, damping * usual.damping);
        gains.integral = 0.0;
    });
    let Gains { stiffness, damping, .. } = *usual;
    let lead = Command { mode: Mode::Impedance, stiffness, damping, ..Command::NOTHING };
    for part in 1..=100 {
        rig.follow(Command { position: 0.005 * part as f32 * side, ..lead }, 0.01);
    }
    rig.follow(Command { position: 0.5 * side, ..lead }, 0.5);
    rig
}

/// 90 % of the torque limit at each position limit, in every mode, with any stiffness and damping, none included, and
/// without integral.
///
/// Announced (60B2h) it is held where the joint is, whichever way it pulls: the limits act on the sum of torques alone.
/// Unannounced a stiffness holds it as its spring gives (a tenth more where friction stops its swing), and without one
/// the law does where the load pushes outwards: 95 % of the margin behind the limit, less what friction bears.
///
/// A load that pulls inwards, announced by nobody and held by no stiffness, the joint follows, as it is to: with a
/// damping slowly, and the law holds it at the other limit; without one a fault ends it, because beyond the velocity
/// limit its current is at the end of the supply's voltage (OverCurrent), or because a tenth of the torque is what is
/// left to stop it at the other limit, less than the quick stop's deceleration takes (PositionLimit).
#[test]
fn a_load_of_nine_tenths_is_held_at_each_position_limit_with_any_gains_in_every_mode() {
    let usual = Setup::of(&weightless(reference())).configuration.gains;
    let (mut sag, mut farthest, mut faulty) = (0.0f64, [0.0f64; 2], 0);
    for (mode, stiffness, damping) in modes() {
        for side in [-1.0f32, 1.0] {
            let there = at_limit(side, stiffness, damping, &usual);
            for (outwards, known) in [(-1.0, 1.0), (1.0, 1.0), (-1.0, 0.0), (1.0, 0.0)] {
                let (mut rig, begun) = (there.clone(), there.position());
                let limits = rig.joint.active().limits;
                let push = outwards * side * 0.9 * limits.torque;
                break_down(&mut rig, Broken::ExternalTorque(f64::from(push)));
                let (stiffness, damping) = (stiffness * usual.stiffness, damping * usual.damping);
                let torque = -push * known;
                let command = Command { mode, position: 0.5 * side, stiffness, damping, torque, ..Command::NOTHING };
                let case = format!(
                    "{mode:?}, {push} Nm at {side}, {known} of it known, {stiffness} Nm/rad, {damping} Nm s/rad"
                );
                rig.demand.command = command;
                let follows = known == 0.0 && stiffness == 0.0 && outwards < 0.0;
                rig.run(if follows { 5.0 } else { 2.0 });
                if follows && damping == 0.0 {
                    let faults = rig.latched();
                    let ends = faults == [Fault::PositionLimit] || faults == [Fault::OverCurrent];
                    assert!(ends, "{case}: {faults:?}");
                    faulty += 1;
                    continue;
                }
                assert!(rig.latched().is_empty(), "{case}: {:?}", rig.latched());
                assert!(rig.velocity().abs() < 0.01, "{case}: {} rad/s", rig.velocity());
                let held = if follows { -0.5 * side } else { 0.5 * side };
                let off = (rig.position() - f64::from(held)).abs();
                if known > 0.0 {
                    let moved = (rig.position() - begun).abs();
                    sag = sag.max(moved);
                    assert!(moved < 4e-3, "{case}: {moved} rad from where it was");
                } else if stiffness > 0.0 {
                    let part = off * f64::from(stiffness / push.abs());
                    farthest[0] = farthest[0].max(part);
                    assert!(part < 1.1, "{case}: {off} rad, {part} of what its spring gives");
                } else {
                    let part = off / f64::from(limits.position_margin);
                    farthest[1] = farthest[1].max(part);
                    assert!((0.8..0.95).contains(&part), "{case}: {part} of the margin");
                }
            }
        }
    }
    let [spring, margin] = farthest;
    println!("{:.2} mrad announced; {spring:.3} of what a spring gives, {margin:.3} of the margin", 1e3 * sag);
    assert_eq!(faulty, 2 * 4, "modes without stiffness and damping, at two limits");
}

#[test]
fn a_torque_outwards_ends_within_half_the_margin() {
    for part in [0.9, 1.0] {
        let mut rig = narrow(without_gains);
        let command = torque(part * rig.joint.active().limits.torque);
        let farthest = largest(&mut rig, command, 2.0, passed);
        println!("{part}: {farthest:.3} of the margin");
        assert!(rig.latched().is_empty(), "{:?}", rig.latched());
        assert!((0.4..0.51).contains(&farthest) && rig.velocity().abs() < 1e-3, "{farthest}");
    }
}

#[test]
fn random_joints_driven_outwards_with_all_they_have_stop_within_the_margin() {
    let mut worst = 0.0f64;
    for seed in 0..JOINTS {
        let parameters = ActuatorParameters::randomised(seed).aligned();
        let mut setup = Setup::of(&parameters);
        without_gains(&mut setup);
        let mut rig = Rig::enabled(parameters, &setup);
        let limit = rig.joint.active().limits.torque;
        let farthest = largest(&mut rig, torque(limit), 2.0, passed);
        worst = worst.max(farthest);
        assert!(rig.latched().is_empty(), "{seed}: {:?} at {farthest} of the margin", rig.latched());
        assert!(farthest < 0.75, "{seed}: {farthest} of the margin");
    }
    println!("{worst:.3} of the margin at the most");
}

/// The quick stop's deceleration has to be possible: then the torque limit decides how far a joint gets, not the law.
#[test]
fn a_deceleration_beyond_the_torque_is_where_a_position_limit_is_passed() {
    let parameters = weightless(reference());
    let possible = Setup::of(&parameters).configuration.limits.torque / inertia(&parameters) as f32;
    for (part, holds) in [(0.5, true), (0.9, true), (10.0, false)] {
        let mut rig = narrow(|setup| {
            let limits = &mut setup.configuration.limits;
            (limits.position, limits.position_margin) = ((-1.5, 1.5), 0.06);
            setup.configuration.gains.quick_stop_deceleration = part * possible;
        });
        let limit = rig.joint.active().limits.torque;
        let farthest = largest(&mut rig, torque(limit), 2.0, passed);
        println!("{part}: {farthest:.3} of the margin, {:?}", rig.latched());
        assert_eq!(rig.latched().is_empty(), holds, "{part}: {:?}", rig.latched());
        assert!(holds || rig.latched() == [Fault::PositionLimit]);
    }
}

/// The setup of a joint that may turn for as long as a test takes.
fn endless(parameters: &ActuatorParameters) -> Setup {
    let mut setup = Setup::of(parameters);
    without_gains(&mut setup);
    setup.configuration.limits.position = (-900.0, 900.0);
    setup
}

/// The speed that a joint without load is driven to by its whole torque, as a part of the velocity limit.
fn fastest(parameters: ActuatorParameters, setup: &Setup, direction: f32) -> (f64, Rig) {
    let mut rig = Rig::enabled(parameters, setup);
    let limits = rig.joint.active().limits;
    let speed = |rig: &Rig| rig.velocity().abs() / f64::from(limits.velocity);
    (largest(&mut rig, torque(direction * limits.torque), 0.7, speed), rig)
}

#[test]
fn random_joints_without_load_are_held_at_the_velocity_limit() {
    let (mut slow, mut most) = (0, 0.0f64);
    for seed in 0..JOINTS {
        let parameters = weightless(ActuatorParameters::randomised(seed).aligned());
        let (speed, rig) = fastest(parameters, &endless(&parameters), if seed % 2 == 0 { 1.0 } else { -1.0 });
        most = most.max(speed);
        assert!(speed < 1.05, "{seed}: {speed} of the velocity limit");
        assert!(rig.latched().is_empty(), "{seed}: {:?}", rig.latched());
        slow += u32::from(speed < 0.95);
    }
    println!("{most:.3} of the velocity limit at the most, {slow} do not come near it");
    assert!(slow <= 10, "{slow}");
}

/// The speed between two of its samples, a round of the motion loop apart, errs by two counts and more with the
/// encoder's noise, and the limit damping makes torque of it. That is no contradiction between encoder and voltage.
#[test]
fn joints_with_a_coarse_encoder_behind_a_low_gear_reverse_at_any_damping_without_a_fault() {
    let random = (0..400).map(|seed| ActuatorParameters::randomised(seed).aligned());
    let coarse: Vec<_> = random.filter(|joint| joint.joint.motor.gear_ratio.abs() < 12.0).map(weightless).collect();
    assert_eq!(coarse.len(), 91);
    for damping in [1.0, 3.0, 10.0] {
        for (number, mut parameters) in coarse.iter().copied().enumerate() {
            parameters.sensors.encoder.counts_per_turn = 1 << 12;
            let mut setup = endless(&parameters);
            setup.configuration.limits.damping *= damping;
            let mut rig = Rig::enabled(parameters, &setup);
            let half = 0.5 * rig.joint.active().limits.torque;
            for way in [1.0, -1.0, 1.0, -1.0, 1.0, -1.0] {
                largest(&mut rig, torque(way * half), 0.35, |_| 0.0);
            }
            assert!(rig.latched().is_empty(), "{number}, {damping} times the damping: {:?}", rig.latched());
        }
    }
}

/// Ripple of the torque (RMS) at the velocity limit, as a part of the torque limit: what stands in `limit_law` on
/// stability.
#[test]
fn an_inertia_over_damping_of_a_millisecond_is_enough_for_the_loops_delays() {
    let parameters = weightless(reference());
    for (milliseconds, low, high) in [(10.0, 0.0, 0.07), (1.0, 0.0, 0.07), (0.3, 0.1, 1.0)] {
        let mut setup = endless(&parameters);
        setup.configuration.limits.damping = (inertia(&parameters) / (milliseconds * 1e-3)) as f32;
        let (speed, mut rig) = fastest(parameters, &setup, 1.0);
        let torques: Vec<f64> = (0..4000)
            .map(|_| {
                rig.step();
                rig.motor_torque() / rig.torque_limit()
            })
            .collect();
        let mean = |values: &mut dyn Iterator<Item = f64>| values.sum::<f64>() / torques.len() as f64;
        let middle = mean(&mut torques.iter().copied());
        let ripple = mean(&mut torques.iter().map(|torque| (torque - middle).powi(2))).sqrt();
        println!("{milliseconds} ms: {speed:.3} of the velocity limit, ripple {ripple:.3}");
        assert!(speed < 1.05 && rig.latched().is_empty(), "{milliseconds} ms: {speed} {:?}", rig.latched());
        assert!((low..high).contains(&ripple), "{milliseconds} ms: {ripple}");
    }
}

/// Brakes until the bridge is off, which it is when the joint stands, or, where a coarse encoder does not let it see
/// that, after the braking time: the joint's speed then as a part of the velocity limit.
fn speed_after_braking(rig: &mut Rig) -> f64 {
    let limits = rig.joint.active().limits;
    let most = rig.joint.active().motion.braking_steps + 2;
    let needed = (1..=most).find(|_| {
        rig.step();
        !rig.is_switching()
    });
    assert!(needed.is_some());
    rig.velocity().abs() / f64::from(limits.velocity)
}

#[test]
fn joints_whose_gains_are_zero_brake_to_a_stop() {
    for seed in 0..JOINTS / 4 {
        let parameters = match seed {
            0 => reference(),
            seed => ActuatorParameters::randomised(seed).aligned(),
        };
        let mut setup = Setup::of(&parameters);
        without_gains(&mut setup);
        let mut moving = Rig::enabled(parameters, &setup);
        let limits = moving.joint.active().limits;
        moving.demand.command = torque(0.6 * limits.torque);
        let most = moving.steps_in(1.0);
        let fast = |rig: &Rig| rig.velocity() > f64::from(0.3 * limits.velocity);
        let moves = (0..most).any(|_| {
            moving.step();
            fast(&moving)
        });
        assert!(moves, "{seed}: {}", moving.velocity());
        let mut stopping = moving.clone();
        stopping.demand.controlword = Controlword::QUICK_STOP;
        let speed = speed_after_braking(&mut stopping);
        assert!(speed < 0.02, "{seed}: {speed} after a quick stop");
        assert_eq!((stopping.state(), stopping.latched()), (State::SwitchOnDisabled, vec![]), "{seed}");
        // From here on the joint is driven by nothing but the torque of its last set-point.
        moving.silent = true;
        while moving.state() == State::OperationEnabled {
            moving.step();
        }
        let speed = speed_after_braking(&mut moving);
        assert!(speed < 0.02, "{seed}: {speed} after a fault");
        assert_eq!((moving.state(), moving.latched()), (State::Fault, vec![Fault::StaleCommand]), "{seed}");
    }
}
