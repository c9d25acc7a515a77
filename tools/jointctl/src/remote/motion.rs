//! A motion of a joint, from being enabled to being disabled again: `jointctl move`; host.

use super::condition;
use super::entry::Entry;
use super::error::RemoteError;
use super::joint::RemoteJoint;
use super::stream::Stream;
use joint_firmware::joint::state_machine::State;
use joint_firmware::joint::{Command, Mode};
use joint_firmware::objects::field::{Actual, ConfigurationField, Field, Range};
use joint_firmware::objects::settings::Setting;
use std::time::{Duration, Instant};

/// Part of the time in which the rest position of an impedance goes from where the joint is to where it is wanted.
const APPROACH: f64 = 0.5;
/// Time between two looks at the joint.
const LOOK: Duration = Duration::from_millis(50);
/// Longest motion, s: a day.
const LONGEST: f64 = 86_400.0;

/// Motion that is asked of the joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// Mode, and set-points in SI units. The joint ramps to velocities and positions by itself, within its limits.
    pub command: Command,
    /// Duration, s.
    pub duration: f64,
    /// Set-points a second.
    pub rate: f64,
    /// A fault whose cause is gone is acknowledged first.
    pub acknowledge: bool,
}

/// Observed state of the joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation {
    /// Time since it was enabled, s.
    pub time: f64,
    /// rad.
    pub position: f64,
    /// rad/s.
    pub velocity: f64,
    /// Nm.
    pub torque: f64,
}

impl std::fmt::Display for Observation {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { time, position, velocity, torque } = self;
        write!(f, "{time:6.2} s  {position:+.4} rad  {velocity:+.3} rad/s  {torque:+.3} Nm")
    }
}

/// Outcome of the motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outcome {
    /// The last look before the joint was disabled; none where it ended before the first.
    pub last: Option<Observation>,
    /// The state that the joint is left in.
    pub state: State,
    /// `true` if the time was over; false where somebody ended it before.
    pub complete: bool,
}

impl Motion {
    /// Refuses what is beyond the joint's limits, before anything is sent.
    pub fn check(&self, joint: &RemoteJoint) -> Result<(), RemoteError> {
        if !(self.duration > 0.0 && self.duration <= LONGEST) {
            let (what, value, low, high, unit) = ("--duration", self.duration, 0.0, LONGEST, "s");
            return Err(RemoteError::Range { what, value, low, high, unit });
        }
        // The objects show what is staged; what is in use is the same only while nothing is.
        if joint.raw(Field::Configuration(ConfigurationField::Changed))? != 0 {
            return Err(RemoteError::Staged { node: joint.id() });
        }
        let Command { mode, position, velocity, torque, stiffness, damping, .. } = self.command;
        let both = |what, value: f32, unit, setting| {
            let high = joint.number(Field::Setting(setting))?;
            within(joint, what, value.into(), [-high, high], unit, &[Field::Setting(setting)])
        };
        both("a torque", torque, "Nm", Setting::TorqueLimit)?;
        match mode {
            Mode::Torque => return Ok(()),
            Mode::OpenLoop | Mode::Hold | Mode::Profile => return Err(super::stream::no_set_points()),
            Mode::Velocity => return both("a velocity", velocity, "rad/s", Setting::VelocityLimit),
            Mode::Position | Mode::Impedance => {}
        }
        let ends = [Field::Setting(Setting::LowestPosition), Field::Setting(Setting::HighestPosition)];
        let [low, high] = ends;
        let span = [joint.number(low)?, joint.number(high)?];
        within(joint, "a position", position.into(), span, "rad", &ends)?;
        if mode == Mode::Impedance {
            for (what, value, range, unit, lowest) in [
                ("a position", position, Range::Position, "rad", -1.0),
                ("a torque", torque, Range::Torque, "Nm", -1.0),
                ("a stiffness", stiffness, Range::Stiffness, "Nm/rad", 0.0),
                ("a damping", damping, Range::Damping, "Nm s/rad", 0.0),
            ] {
                let high = joint.number(Field::Range(range))?;
                within(joint, what, value.into(), [lowest * high, high], unit, &[Field::Range(range)])?;
            }
        }
        Ok(())
    }

    /// Enables the joint, moves it for as long as `running` says so and the duration is not over, and disables it,
    /// whatever happens.
    pub fn run(
        &self,
        joint: &RemoteJoint,
        running: &dyn Fn() -> bool,
        tell: &mut dyn FnMut(&Observation),
    ) -> Result<Outcome, RemoteError> {
        self.check(joint)?;
        let stream = Stream::begin(joint, self.command.mode, self.rate, self.acknowledge)?;
        let began = Instant::now();
        let duration = Duration::from_secs_f64(self.duration);
        let mut last = None;
        self.play(&stream, joint)?;
        while running() && began.elapsed() < duration {
            stream.check()?;
            let observation = observe(joint, began)?;
            tell(&observation);
            last = Some(observation);
            std::thread::sleep(LOOK.min(duration.saturating_sub(began.elapsed())));
        }
        let complete = began.elapsed() >= duration;
        if complete {
            stream.check()?;
            last = Some(observe(joint, began)?);
        }
        let state = stream.end()?;
        Ok(Outcome { last, state, complete })
    }

    fn play(&self, stream: &Stream, joint: &RemoteJoint) -> Result<(), RemoteError> {
        let command = self.command;
        if command.mode != Mode::Impedance {
            stream.set(command);
            return Ok(());
        }
        // A spring that is suddenly stretched is a blow; the stiffness acts at once, so its rest position begins where
        // the joint is.
        let from = joint.number(Field::Actual(Actual::Position))? as f32;
        let approach = APPROACH * self.duration;
        stream.play(move |elapsed| {
            let part = smooth((elapsed.as_secs_f64() / approach).min(1.0)) as f32;
            Command { position: from + part * (command.position - from), ..command }
        });
        Ok(())
    }
}

/// Transition from 0 to 1 with velocity and acceleration of zero at both ends: the minimum-jerk motion.
fn smooth(x: f64) -> f64 {
    x * x * x * (10.0 - 15.0 * x + 6.0 * x * x)
}

fn observe(joint: &RemoteJoint, began: Instant) -> Result<Observation, RemoteError> {
    let number = |actual| joint.number(Field::Actual(actual));
    Ok(Observation {
        time: began.elapsed().as_secs_f64(),
        position: number(Actual::Position)?,
        velocity: number(Actual::Velocity)?,
        torque: number(Actual::Torque)? * number(Actual::RatedTorque)?,
    })
}

fn within(
    joint: &RemoteJoint,
    what: &'static str,
    value: f64,
    [low, high]: [f64; 2],
    unit: &'static str,
    fields: &[Field],
) -> Result<(), RemoteError> {
    if (low..=high).contains(&value) {
        return Ok(());
    }
    let object = fields.iter().map(|field| Entry::of(*field).described()).collect::<Vec<_>>().join(", ");
    Err(RemoteError::Limit { node: joint.id(), what, value, low, high, unit, object })
}

/// The state in words, with the faults where there are some: what a command says at its end.
pub fn left(joint: &RemoteJoint, state: State) -> Result<String, RemoteError> {
    let faults = joint.faults()?;
    let words = condition::name(state);
    Ok(if faults.is_empty() { words.to_owned() } else { format!("{words}: {}", condition::list(&faults)) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_smooth_motion_begins_and_ends_at_rest() {
        assert_eq!((smooth(0.0), smooth(0.5), smooth(1.0)), (0.0, 0.5, 1.0));
        let slope = |x: f64| (smooth(x + 1e-6) - smooth(x - 1e-6)) / 2e-6;
        assert!(slope(1e-6) < 1e-9 && slope(1.0 - 1e-6) < 1e-9);
        assert!((slope(0.5) - 1.875).abs() < 1e-6);
    }
}
