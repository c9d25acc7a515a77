//! The limits of the check that compares the current loop with the motor's equations: what may be left unexplained.

use super::{Found, Probe, Shows, Subject};
use joint_firmware::default_configuration::BoardConfiguration;
use joint_firmware::joint::fault::Fault;
use joint_firmware::joint::monitor::Monitor;
use joint_firmware::motor::field_oriented::FieldOrientedOutput;
use joint_firmware::motor::phases::Phases;
use joint_firmware::motor::transform::Dq;
use std::f64::consts::TAU;

/// Control steps of a round of the motion loop, at the end of which the check is made.
const ROUND: u32 = 5;
/// Control steps for which a voltage just below its limit is held.
const LONG: u32 = 2_000;
/// Distance of a probe from its limit, as a part of it.
const NEAR: f64 = 1e-3;

/// Values of the current loop in a step.
#[derive(Clone, Copy)]
struct Step {
    reference: Dq,
    current: Dq,
    voltage: Dq,
    /// Rotor's speed, rad/s.
    speed: f64,
}

const REST: Step = Step { reference: Dq::ZERO, current: Dq::ZERO, voltage: Dq::ZERO, speed: 0.0 };

/// A monitor that sees what `at` makes of the value.
fn seen(board: &BoardConfiguration, at: impl Fn(f32) -> Step + Copy + 'static) -> impl Fn() -> Subject + 'static {
    let active = board.joint.prepare(&board.bridge).unwrap();
    let rate = f64::from(board.bridge.rate);
    move || {
        let (mut monitor, mut steps, active) = (Monitor::default(), 0, active.clone());
        Box::new(move |value| {
            let Step { reference, current, voltage, speed } = at(value as f32);
            let output = FieldOrientedOutput { duties: Phases::uniform(0.5), current, voltage, limited: false };
            monitor.current_loop(reference, &output, (speed / TAU / rate * 2f64.powi(32)) as f32);
            steps += 1;
            if steps % ROUND == 0 {
                monitor.check_current_loop(&active);
            }
            Found { faults: monitor.found(), part: 1.0 }
        })
    }
}

/// All probes of a joint on a board.
pub fn probes(board: &BoardConfiguration) -> Vec<Probe> {
    let (motor, rate) = (board.joint.motor, f64::from(board.bridge.rate));
    let highest = f64::from(board.joint.limits.bus_voltage.1);
    let current_limit = f64::from(motor.current_limit);
    // 1.5 % of the highest supply, or, where that is more, 0.3 % and what of the dead time is not compensated: all of
    // it without current, three quarters with much. It takes 4/3 of its part of the period.
    let dead_time = 4.0 / 3.0 * f64::from(board.bridge.dead_time) * rate;
    let part = |uncompensated: f64| highest * (0.003 + uncompensated * dead_time).max(0.015);
    let (small, large) = (part(1.0), part(0.75));
    // Noise of half a per cent of the current limit, filtered with 8 control steps and differentiated.
    let noise = 0.005 * current_limit * (1.0 - 0.875f64.powi(5)) * rate / f64::from(ROUND);
    let (noise_d, noise_q) = (f64::from(motor.inductance_d) * noise, f64::from(motor.inductance_q) * noise);
    // With a current of three quarters of its limit, half of the resistance's voltage.
    let much = 0.75 * current_limit;
    assert!(much > f64::from(board.bridge.dead_time_band));
    let resistive = f64::from(motor.resistance) * much;
    // At a speed, three tenths of what is induced.
    let speed = 40.0;
    let induced = speed * f64::from(motor.torque_constant) / 1.5;
    let current = Dq { d: 0.0, q: much as f32 };

    let implausible = Shows::Fault(Fault::EncoderImplausible);
    let near = |name: &str, subject: Box<dyn Fn() -> Subject>, limit: f64| {
        Probe::of(name, implausible, subject).around(limit, NEAR * limit, LONG)
    };
    let of_d = seen(board, |d| Step { voltage: Dq { d, q: 0.0 }, ..REST });
    let of_q = seen(board, |q| Step { voltage: Dq { d: 0.0, q }, ..REST });
    let backward = seen(board, |q| Step { voltage: Dq { d: 0.0, q: -q }, ..REST });
    let with_current = seen(board, move |q| Step { current, reference: current, voltage: Dq { d: 0.0, q }, ..REST });
    let turning = seen(board, move |q| Step { voltage: Dq { d: 0.0, q }, speed, ..REST });
    let at_speed = f64::from(motor.alignment.electrical_speed(1.0)).signum() * induced;
    let mut probes = vec![
        near("unexplained voltage across", Box::new(of_q), small + noise_q),
        near("unexplained voltage backward", Box::new(backward), small + noise_q),
        near("unexplained voltage along", Box::new(of_d), small + noise_d),
        near("unexplained voltage with a current", Box::new(with_current), 1.5 * resistive + large + noise_q),
        near("unexplained voltage in motion", Box::new(turning), 1.3 * at_speed + small + noise_q),
    ];

    // Thirty control steps of a voltage that is plainly too high.
    let high = Dq { d: 0.0, q: highest as f32 };
    let at_once = seen(board, move |_| Step { voltage: high, ..REST });
    let rounds = move || -> Subject {
        let mut subject = at_once();
        Box::new(move |rounds| (0..rounds as u32 * ROUND).map(|_| subject(0.0)).last().unwrap())
    };
    probes.push(
        Probe::of("rounds of unexplained voltage", implausible, rounds).counted(f64::from(30 / ROUND) - 1.0).apart(),
    );

    // A current that misses its reference by 2 % of its limit and a quarter of the reference, while the voltage is too
    // high.
    let missed = Shows::Fault(Fault::CurrentNotFollowed);
    for reference in [0.1 * current_limit, much] {
        let subject = seen(board, move |error| {
            let (wanted, found) = (reference as f32, reference as f32 - error);
            Step { reference: Dq { d: 0.0, q: wanted }, current: Dq { d: 0.0, q: found }, voltage: high, speed: 0.0 }
        });
        let limit = 0.02 * current_limit + 0.25 * reference;
        let probe =
            Probe::of(format!("current missed at {reference} A"), missed, subject).beside(&[Fault::EncoderImplausible]);
        probes.push(probe.around(limit, NEAR * limit, LONG).apart());
    }
    probes
}
