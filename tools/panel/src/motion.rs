//! Motion with which a page moves a joint, as a function of time since it began: jog, sine, steps, impedance; no I/O.

use joint_firmware::joint::{Command, Mode};
use jointctl::remote::motion::Motion as Limited;
use jointctl::remote::{RemoteError, RemoteJoint};
use serde::Deserialize;
use std::f64::consts::TAU;
use std::time::Duration;

/// Time in which an impedance's rest position goes to where it is wanted, s.
const APPROACH: f64 = 1.0;
/// Steepest slope of the smooth step of [`smooth`].
const STEEPEST: f64 = 1.875;

/// Set-points in SI units. Positions are relative to where the joint is when it begins.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Motion {
    /// Velocity mode.
    Jog {
        /// rad/s, with its sign.
        velocity: f64,
    },
    /// Position mode: a sine that grows to its amplitude in its first period.
    Sine {
        /// rad.
        amplitude: f64,
        /// Hz.
        frequency: f64,
    },
    /// Position mode: there and back, the first step after one `dwell`.
    Steps {
        /// rad, with its sign.
        step: f64,
        /// Time at each end, s.
        dwell: f64,
    },
    /// Impedance mode: a spring whose rest position goes by `offset` within a second.
    Impedance {
        /// rad, with its sign.
        offset: f64,
        /// Nm/rad.
        stiffness: f64,
        /// Nm s/rad.
        damping: f64,
    },
}

/// Transition from 0 to 1 with velocity and acceleration of zero at both ends: the minimum-jerk motion (Flash, Hogan,
/// "The coordination of arm movements", 1985, eq. 4).
fn smooth(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * x * (10.0 - 15.0 * x + 6.0 * x * x)
}

impl Motion {
    /// Mode of operation.
    pub const fn mode(&self) -> Mode {
        match self {
            Self::Jog { .. } => Mode::Velocity,
            Self::Sine { .. } | Self::Steps { .. } => Mode::Position,
            Self::Impedance { .. } => Mode::Impedance,
        }
    }

    /// Set-point `time` seconds after the begin, from the position `from`, rad.
    pub fn at(&self, from: f64, time: f64) -> Command {
        let command = Command { mode: self.mode(), ..Command::default() };
        match *self {
            Self::Jog { velocity } => Command { velocity: velocity as f32, ..command },
            Self::Sine { amplitude, frequency } => {
                let turns = frequency * time;
                let position = from + amplitude * smooth(turns) * (TAU * turns).sin();
                Command { position: position as f32, ..command }
            }
            Self::Steps { step, dwell } => {
                let away = (time / dwell) as u64 % 2 == 1;
                Command { position: (from + if away { step } else { 0.0 }) as f32, ..command }
            }
            Self::Impedance { offset, stiffness, damping } => Command {
                position: (from + offset * smooth(time / APPROACH)) as f32,
                stiffness: stiffness as f32,
                damping: damping as f32,
                ..command
            },
        }
    }

    /// Refuses what is beyond this program's ranges.
    fn ranges(&self) -> Result<(), RemoteError> {
        let within = |what, value: f64, low, high, unit| match (low..=high).contains(&value) {
            true => Ok(()),
            false => Err(RemoteError::Range { what, value, low, high, unit }),
        };
        match *self {
            Self::Jog { .. } | Self::Impedance { .. } => Ok(()),
            Self::Sine { amplitude, frequency } => {
                within("the amplitude", amplitude, 1e-6, 1e3, "rad")?;
                within("the frequency", frequency, 0.01, 20.0, "Hz")
            }
            Self::Steps { dwell, .. } => within("the dwell", dwell, 0.05, 60.0, "s"),
        }
    }

    /// Refuses what is beyond this program's ranges, and at its ends what is beyond the joint's limits, before anything
    /// is sent.
    pub fn check(&self, joint: &RemoteJoint, from: f64) -> Result<(), RemoteError> {
        self.ranges()?;
        let plain = Command { mode: self.mode(), ..Command::default() };
        let at = |position: f64| Command { position: position as f32, ..plain };
        let moving = |velocity: f64| Command { mode: Mode::Velocity, velocity: velocity as f32, ..plain };
        let ends = match *self {
            Self::Jog { velocity } => vec![moving(velocity)],
            Self::Sine { amplitude, frequency } => {
                // While it grows the amplitude adds its own slope.
                let fastest = amplitude * frequency * (TAU + STEEPEST);
                vec![at(from - amplitude), at(from + amplitude), moving(fastest)]
            }
            Self::Steps { step, .. } => vec![at(from), at(from + step)],
            Self::Impedance { offset, stiffness, damping } => [from, from + offset]
                .map(|position| Command { stiffness: stiffness as f32, damping: damping as f32, ..at(position) })
                .to_vec(),
        };
        ends.into_iter()
            .try_for_each(|command| Limited { command, duration: 1.0, rate: RATE, acknowledge: false }.check(joint))
    }
}

/// Set-points a second.
pub const RATE: f64 = 100.0;

/// A motion that stands still from the first set-point on at which it is not held, whatever comes after.
#[derive(Clone, Copy, Debug)]
pub struct Steered {
    motion: Motion,
    from: f64,
    last: Command,
    frozen: bool,
}

impl Steered {
    /// Motion from the position `from`, rad.
    pub fn new(motion: Motion, from: f64) -> Self {
        Self { motion, from, last: motion.at(from, 0.0), frozen: false }
    }

    /// The next set-point, a time after the begin. Frozen it is the last position, or no velocity.
    pub fn next(&mut self, elapsed: Duration, held: bool) -> Command {
        if !held && !self.frozen {
            self.frozen = true;
            self.last.velocity = 0.0;
        }
        if !self.frozen {
            self.last = self.motion.at(self.from, elapsed.as_secs_f64());
        }
        self.last
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Motion; 4] = [
        Motion::Jog { velocity: -0.5 },
        Motion::Sine { amplitude: 0.2, frequency: 0.5 },
        Motion::Steps { step: 0.3, dwell: 0.4 },
        Motion::Impedance { offset: -0.4, stiffness: 30.0, damping: 2.0 },
    ];

    #[test]
    fn each_motion_begins_where_the_joint_is_and_reaches_what_was_asked_for() {
        for motion in ALL {
            let mut reach = (f32::MAX, f32::MIN);
            (0..40_000).map(|n| motion.at(1.0, 1e-4 * f64::from(n)).position).for_each(|position| {
                reach = (reach.0.min(position), reach.1.max(position));
            });
            let expected = match motion {
                Motion::Jog { .. } => (0.0, 0.0),
                Motion::Sine { .. } => (0.8, 1.2),
                Motion::Steps { .. } => (1.0, 1.3),
                Motion::Impedance { .. } => (0.6, 1.0),
            };
            assert!((reach.0 - expected.0).abs() < 1e-3 && (reach.1 - expected.1).abs() < 1e-3, "{motion:?} {reach:?}");
            if motion.mode() != Mode::Velocity {
                assert_eq!(motion.at(1.0, 0.0).position, 1.0, "{motion:?}");
            }
        }
        assert_eq!(ALL[0].at(1.0, 3.0).velocity, -0.5);
        let spring = ALL[3].at(0.0, 0.0);
        assert_eq!((spring.stiffness, spring.damping), (30.0, 2.0));
    }

    #[test]
    fn the_speed_of_a_sine_stays_below_the_bound_that_is_checked() {
        let (amplitude, frequency, step) = (0.2, 0.5, 1e-4);
        let sine = Motion::Sine { amplitude, frequency };
        let position = |n: u32| {
            let turns = frequency * step * f64::from(n);
            amplitude * smooth(turns) * (TAU * turns).sin()
        };
        assert!((f64::from(sine.at(0.0, 1.3).position) - position(13_000)).abs() < 1e-6);
        let fastest = (1..40_000).map(|n| ((position(n) - position(n - 1)) / step).abs()).fold(0.0, f64::max);
        let bound = amplitude * frequency * (TAU + STEEPEST);
        assert!(fastest < bound && fastest > 0.7 * bound, "{fastest} {bound}");
    }

    #[test]
    fn ranges_end_where_they_say() {
        let sine = |amplitude, frequency| Motion::Sine { amplitude, frequency };
        let steps = |dwell| Motion::Steps { step: 1.0, dwell };
        for (within, beyond) in [
            (sine(1e-6, 1.0), sine(0.99e-6, 1.0)),
            (sine(1e3, 1.0), sine(1000.1, 1.0)),
            (sine(1.0, 0.01), sine(1.0, 0.0099)),
            (sine(1.0, 20.0), sine(1.0, 20.01)),
            (steps(0.05), steps(0.0499)),
            (steps(60.0), steps(60.01)),
        ] {
            assert!(within.ranges().is_ok(), "{within:?}");
            let error = beyond.ranges().unwrap_err().to_string();
            assert!(error.contains("must lie in"), "{error}");
        }
    }

    #[test]
    fn what_is_not_held_stands_from_then_on() {
        for motion in ALL {
            let mut steered = Steered::new(motion, 1.0);
            let at = |seconds: f64| Duration::from_secs_f64(seconds);
            let moving = steered.next(at(0.7), true);
            let rest = steered.next(at(0.71), false);
            assert_eq!((rest.position, rest.velocity), (moving.position, 0.0), "{motion:?}");
            // A held-message that comes again does not move it on.
            assert_eq!(steered.next(at(1.3), true), rest, "{motion:?}");
        }
    }
}
