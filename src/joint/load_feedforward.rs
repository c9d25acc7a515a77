//! Feedforward of the configured load: inertia times the reference's acceleration, and gravity; task, host.
//!
//! A thousand times a second a task looks at a control step and computes
//!
//! ```text
//! torque = (J + m l²) dv/dt + (G + m g l) sin(q - q0)
//! ```
//!
//! from the reference velocity `v` and the measured position `q` of that step and a
//! [`LoadConfiguration`](super::configuration::LoadConfiguration): inertia `J`, gravity torque `G`, hanging position
//! `q0`, payload `m` at an arm `l`. It joins the command's torque, as a torque
//! offset (60B2h) would, in modes that have a reference velocity ([`Command::bear`](super::Command::bear)): the control
//! step does nothing for it. Torque mode has none, so the energy guard never takes it for a push or for what holds the
//! joint.
//!
//! The acceleration is what a lag of [`DERIVATIVE`] leaves of the reference velocity, held to the larger one of the
//! ramps' accelerations; what the bound cuts off comes later, so that no change of velocity is lost. Gravity follows by
//! at most [`GRAVITY_RATE`] times the torque limit a second: another payload under way is no blow. Motion asks for less
//! than that: a gravity of 35 % of the torque limit at 12 rad/s, the most in the ranges of the plant's random joints,
//! for 4.2.
//!
//! Source: inverse dynamics as a feedforward, B. Siciliano, L. Sciavicco, L. Villani, G. Oriolo, Robotics, section 8.5.

use super::Telemetry;
use super::configuration::LoadFeedforwardRequest;
use super::load::LoadGains;
use super::state_machine::State;
use crate::motor::number::{limited, or_zero};

/// Looks a second, Hz.
pub const LOOK_RATE: f32 = super::adaptation::LOOK_RATE;
/// Time over which the reference's acceleration is taken, s: several commands of a bus at 1 kHz.
pub const DERIVATIVE: f32 = 0.004;
/// Fastest change of gravity's torque, in torque limits a second.
pub const GRAVITY_RATE: f32 = 10.0;

/// The feedforward, from one look to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LoadFeedforward {
    /// Reference velocity, rad/s, as a first-order lag follows it; none where there is no reference.
    reference: Option<f32>,
    /// Gravity's part, Nm.
    gravity: f32,
}

impl LoadFeedforward {
    /// State before the first look.
    pub const NOTHING: Self = Self { reference: None, gravity: 0.0 };

    /// A look at a control step, [`LOOK_RATE`] times a second: the torque to add from here on, Nm, within the torque
    /// limit. Exactly zero where nothing is requested.
    pub fn look(&mut self, gains: &LoadGains, telemetry: &Telemetry) -> f32 {
        use LoadFeedforwardRequest::{Acceleration, Both, Gravity};
        let acceleration = self.follow(gains, telemetry);
        let accelerating =
            if matches!(gains.request, Acceleration | Both) { gains.load.inertia * acceleration } else { 0.0 };
        let gravity = match gains.request {
            Gravity | Both => gains.load.gravity_torque(telemetry.motion.position),
            _ => 0.0,
        };
        self.gravity += limited(gravity - self.gravity, gains.torque_limit * (GRAVITY_RATE / LOOK_RATE));
        limited(accelerating + self.gravity, gains.torque_limit)
    }

    /// The reference's acceleration, rad/s².
    fn follow(&mut self, gains: &LoadGains, telemetry: &Telemetry) -> f32 {
        let reference = telemetry.wanted.velocity.filter(|_| telemetry.state == State::OperationEnabled);
        let Some(velocity) = reference else {
            self.reference = None;
            return 0.0;
        };
        let lagging = self.reference.unwrap_or(velocity);
        let acceleration = limited((velocity - lagging) * (1.0 / DERIVATIVE), gains.acceleration);
        self.reference = Some(or_zero(lagging + acceleration * (1.0 / LOOK_RATE)));
        acceleration
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::joint::configuration::LoadConfiguration;
    use crate::joint::load::Load;
    use crate::joint::{Command, JointMotion, Mode};

    const LOAD: LoadConfiguration = LoadConfiguration {
        request: LoadFeedforwardRequest::Both,
        inertia: 0.5,
        gravity: 4.0,
        hanging: 0.3,
        payload_mass: 2.0,
        payload_arm: 0.4,
        ..LoadConfiguration::NONE
    };
    const GAINS: LoadGains = LoadGains {
        request: LoadFeedforwardRequest::Both,
        load: Load { inertia: 0.5, gravity: 4.0, hanging: 0.3 },
        acceleration: 20.0,
        torque_limit: 30.0,
        ..LoadGains::NONE
    };

    fn seen(position: f32, reference: Option<f32>) -> Telemetry {
        let mut telemetry = Telemetry { state: State::OperationEnabled, ..Telemetry::NOTHING };
        telemetry.motion = JointMotion { position, ..JointMotion::default() };
        telemetry.wanted.velocity = reference;
        telemetry
    }

    /// The torque after `looks` at a position with a reference velocity by the look.
    fn after(gains: &LoadGains, looks: u16, position: f32, reference: impl Fn(u16) -> f32) -> f32 {
        let mut feedforward = LoadFeedforward::NOTHING;
        (0..looks).map(|n| feedforward.look(gains, &seen(position, Some(reference(n))))).last().unwrap()
    }

    #[test]
    fn a_payload_adds_to_inertia_and_gravity() {
        let load = Load::of(&LOAD);
        assert!((load.inertia - (0.5 + 2.0 * 0.16)).abs() < 1e-6, "{load:?}");
        assert!((load.gravity - (4.0 + 2.0 * 9.80665 * 0.4)).abs() < 1e-5, "{load:?}");
        assert_eq!(Load::of(&LoadConfiguration::NONE), Load::default());
    }

    #[test]
    fn gravity_is_that_of_a_pendulum_that_hangs_where_it_is_said_to() {
        for position in [-7.0f32, -1.0, 0.3, 0.31, 1.0, 1.87, 3.44, 100.0] {
            let found = after(&GAINS, 400, position, |_| 0.0);
            let expected = 4.0 * f64::from(position - 0.3).sin() as f32;
            assert!((found - expected).abs() < 2e-4, "{position} rad: {found} Nm for {expected}");
        }
    }

    #[test]
    fn a_ramp_takes_inertia_times_its_acceleration_after_a_lag_of_4_ms() {
        for acceleration in [-19.9f32, -3.0, 0.5, 19.9] {
            let ramp = |n: u16| 1e-3 * f32::from(n) * acceleration;
            let lagged = after(&GAINS, 5, 0.3, ramp) / (0.5 * acceleration);
            assert!((0.5..0.75).contains(&lagged), "{lagged} of it after 4 ms");
            let settled = after(&GAINS, 60, 0.3, ramp);
            assert!((settled - 0.5 * acceleration).abs() < 1e-3, "{acceleration} rad/s²: {settled} Nm");
        }
    }

    #[test]
    fn an_acceleration_beyond_the_ramps_is_held_to_theirs_and_its_velocity_is_not_lost() {
        let mut feedforward = LoadFeedforward::NOTHING;
        let (mut impulse, mut largest) = (0.0, 0.0f32);
        for n in 0..200u16 {
            let torque = feedforward.look(&GAINS, &seen(0.3, Some(if n < 10 { 0.0 } else { 1.0 })));
            impulse += torque * 1e-3;
            largest = largest.max(torque);
        }
        assert!((largest - 0.5 * 20.0).abs() < 1e-4, "{largest} Nm");
        assert!((impulse - 0.5).abs() < 1e-3, "{impulse} Nm s for 1 rad/s");
    }

    #[test]
    fn each_part_can_be_off_and_off_is_exactly_nothing() {
        use LoadFeedforwardRequest::{Acceleration, Gravity, Off};
        let of = |request| after(&LoadGains { request, ..GAINS }, 300, 1.3, |n| 0.01 * f32::from(n));
        let (gravity, both) = (of(Gravity), of(LoadFeedforwardRequest::Both));
        assert_eq!(of(Off).to_bits(), 0.0f32.to_bits());
        assert!((of(Acceleration) - 5.0).abs() < 1e-3 && (gravity - 4.0 * 1.0f32.sin()).abs() < 1e-3);
        assert!((both - gravity - 5.0).abs() < 1e-3, "{both} {gravity}");
    }

    #[test]
    fn another_payload_comes_in_steps_of_a_hundredth_of_the_torque_limit() {
        let mut feedforward = LoadFeedforward::NOTHING;
        let mut last = 0.0;
        for n in 0..300u16 {
            let mut gains = GAINS;
            gains.load.gravity = if n < 100 { 0.0 } else { 20.0 };
            let torque = feedforward.look(&gains, &seen(0.3 + core::f32::consts::FRAC_PI_2, Some(0.0)));
            assert!(torque - last <= 0.01 * 30.0 + 1e-5, "{last} to {torque} Nm");
            last = torque;
        }
        assert!((last - 20.0).abs() < 1e-3, "{last} Nm");
    }

    #[test]
    fn it_stays_within_the_torque_limit_whatever_comes() {
        let wild = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e30, -1e30, 0.0];
        let mut feedforward = LoadFeedforward::NOTHING;
        for position in wild {
            for velocity in wild {
                let torque = feedforward.look(&GAINS, &seen(position, Some(velocity)));
                assert!(torque.abs() <= 30.0, "{position} rad, {velocity} rad/s: {torque} Nm");
            }
        }
        let settled = (0..200).map(|_| feedforward.look(&GAINS, &seen(0.3, Some(0.0)))).last().unwrap();
        assert!(settled.abs() < 1e-2, "{settled} Nm");
    }

    #[test]
    fn no_acceleration_is_left_of_a_reference_that_ended_or_of_a_joint_that_is_off() {
        for ends in [seen(0.3, None), Telemetry { state: State::QuickStopActive, ..seen(0.3, Some(5.0)) }] {
            let mut feedforward = LoadFeedforward::NOTHING;
            (0..20u16).for_each(|n| {
                feedforward.look(&GAINS, &seen(0.3, Some(0.01 * f32::from(n))));
            });
            assert!(feedforward.look(&GAINS, &ends).abs() < 1e-4);
            assert!(feedforward.look(&GAINS, &seen(0.3, Some(5.0))).abs() < 1e-4, "it begins where the reference is");
        }
    }

    #[test]
    fn it_joins_the_torque_of_modes_with_a_reference_velocity_alone_and_pushes_nowhere() {
        for (mode, joins) in [
            (Mode::Torque, false),
            (Mode::OpenLoop, false),
            (Mode::Velocity, true),
            (Mode::Position, true),
            (Mode::Profile, true),
            (Mode::Impedance, true),
            (Mode::Hold, true),
        ] {
            let before = Command { mode, torque: -0.0, push: 1.0, ..Command::NOTHING };
            let mut command = before;
            command.bear(0.0);
            assert_eq!(command.torque.to_bits(), before.torque.to_bits(), "{mode:?}");
            command.bear(2.5);
            assert_eq!((command.torque, command.push), (if joins { 2.5 } else { 0.0 }, 1.0), "{mode:?}");
        }
    }
}
