//! Motion that is asked of a joint over time; host.
//!
//! A reference in time is followed in impedance mode, as a robot's controller would: position, velocity and the torque
//! that the rigid body needs for it, at a stiffness and damping. Targets are reached in position mode, where the joint
//! makes its own ramp. Either way the controller knows inertia and gravity of the joint, and nothing of its friction.

use excitation::file::Samples;
use joint_firmware::joint::{Command, Mode};
use plant::JointParameters;
use plant::excitation::{Reference, Trajectory};
use plant::fourier::smooth_step;
use std::f64::consts::TAU;

/// Time over which a sweep fades in and out, s.
pub const SWEEP_FADE: f64 = 1.0;

/// Shortest move to where samples begin, s.
const SHORTEST_LEAD: f64 = 0.5;

/// A motion that starts at rest at position zero.
#[derive(Clone, Debug)]
pub enum Motion {
    /// A trajectory of moves, rests and Fourier series.
    Trajectory(Trajectory),
    /// A sine of rising frequency.
    Sweep(Sweep),
    /// A motion from a file, after a move to where it begins.
    Samples(Led),
    /// Positions that are asked for at once.
    Targets(Targets),
}

/// Samples with a move to their first position before them.
#[derive(Clone, Debug, PartialEq)]
pub struct Led {
    samples: Samples,
    /// Duration of the move, s.
    lead: f64,
}

/// A sine whose frequency rises exponentially: each octave takes the same time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sweep {
    /// Amplitude, rad.
    pub amplitude: f64,
    /// First and last frequency, Hz; above zero, the second above the first.
    pub frequency: (f64, f64),
    /// Duration, s; at least twice [`SWEEP_FADE`].
    pub duration: f64,
}

/// Positions, each for the same time.
#[derive(Clone, Debug, PartialEq)]
pub struct Targets {
    /// The positions, rad.
    pub positions: Vec<f64>,
    /// Time for each, s.
    pub interval: f64,
}

/// Control law with which a controller commands the joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Controller {
    /// Impedance mode's stiffness, Nm/rad.
    pub stiffness: f64,
    /// Impedance mode's damping, Nm s/rad.
    pub damping: f64,
}

impl Led {
    /// Motion through at least two samples, in time; the move before them stays below `speed` (rad/s, above zero).
    #[must_use]
    pub fn new(samples: Samples, speed: f64) -> Self {
        let way = samples.motion.first().map_or(0.0, |first| first.position.abs());
        // The steepest slope of the smooth step is 15/8.
        Self { samples, lead: (1.875 * way / speed).max(SHORTEST_LEAD) }
    }

    fn duration(&self) -> f64 {
        let time = &self.samples.time;
        self.lead + time.last().copied().unwrap_or(0.0) - time.first().copied().unwrap_or(0.0)
    }

    fn at(&self, time: f64) -> Reference {
        let (times, motion) = (&self.samples.time, &self.samples.motion);
        let (Some(first), Some(last)) = (motion.first(), motion.last()) else { return Reference::default() };
        if time < self.lead {
            let (level, slope, curvature) = smooth_step(time / self.lead);
            return Reference {
                position: level * first.position,
                velocity: slope / self.lead * first.position,
                acceleration: curvature / (self.lead * self.lead) * first.position,
            };
        }
        let time = time - self.lead + times.first().copied().unwrap_or(0.0);
        let after = times.partition_point(|&sample| sample <= time);
        if after == 0 {
            return *first;
        }
        match (motion.get(after - 1), motion.get(after)) {
            (Some(before), Some(next)) => {
                between(before, next, time - times[after - 1], times[after] - times[after - 1])
            }
            _ => Reference { position: last.position, ..Reference::default() },
        }
    }
}

/// The cubic through two samples `step` (s) apart that has their velocities, `time` after the first.
fn between(before: &Reference, next: &Reference, time: f64, step: f64) -> Reference {
    let x = time / step;
    let way = next.position - before.position;
    let (bend, twist) = (
        3.0 * way - step * (2.0 * before.velocity + next.velocity),
        step * (before.velocity + next.velocity) - 2.0 * way,
    );
    Reference {
        position: before.position + x * (step * before.velocity + x * (bend + x * twist)),
        velocity: before.velocity + x * (2.0 * bend + 3.0 * x * twist) / step,
        // Of a table's decimals, the second derivative of its positions keeps few: the table has it.
        acceleration: before.acceleration + x * (next.acceleration - before.acceleration),
    }
}

impl Sweep {
    fn at(&self, time: f64) -> Reference {
        let time = time.clamp(0.0, self.duration);
        let growth = (self.frequency.1 / self.frequency.0).ln() / self.duration;
        let rate = TAU * self.frequency.0 * (growth * time).exp();
        let phase = (rate - TAU * self.frequency.0) / growth;
        let (sine, cosine) = phase.sin_cos();
        let (level, slope, curvature) = envelope(time, self.duration);
        Reference {
            position: self.amplitude * level * sine,
            velocity: self.amplitude * (slope * sine + level * rate * cosine),
            acceleration: self.amplitude
                * (curvature * sine + 2.0 * slope * rate * cosine + level * rate * (growth * cosine - rate * sine)),
        }
    }
}

/// A level that rises from 0 to 1 and falls back, with its first two derivatives.
fn envelope(time: f64, duration: f64) -> (f64, f64, f64) {
    let (rising, falling) = (time / SWEEP_FADE, (duration - time) / SWEEP_FADE);
    let (x, sign) = if rising < falling { (rising, 1.0) } else { (falling, -1.0) };
    let (level, slope, curvature) = smooth_step(x);
    (level, sign * slope / SWEEP_FADE, curvature / (SWEEP_FADE * SWEEP_FADE))
}

impl Motion {
    /// Duration, s.
    #[must_use]
    pub fn duration(&self) -> f64 {
        match self {
            Self::Trajectory(trajectory) => trajectory.duration(),
            Self::Sweep(sweep) => sweep.duration,
            Self::Samples(led) => led.duration(),
            Self::Targets(targets) => targets.interval * targets.positions.len() as f64,
        }
    }

    /// Reference of the joint at `time` (s). None where the joint makes its own ramp.
    #[must_use]
    pub fn reference(&self, time: f64) -> Option<Reference> {
        match self {
            Self::Trajectory(trajectory) => Some(trajectory.at(time)),
            Self::Sweep(sweep) => Some(sweep.at(time)),
            Self::Samples(led) => Some(led.at(time)),
            Self::Targets(_) => None,
        }
    }

    /// Command that a controller sends at `time` (s) to a joint at `position` (rad), knowing the rigid body of `joint`.
    #[must_use]
    pub fn command(&self, time: f64, position: f64, joint: &JointParameters, controller: &Controller) -> Command {
        if let Self::Targets(targets) = self {
            let index = (time / targets.interval).max(0.0) as usize;
            let last = targets.positions.len().saturating_sub(1);
            let target = targets.positions.get(index.min(last)).copied().unwrap_or(position);
            let torque = joint.load.gravity_torque(position);
            return Command {
                mode: Mode::Position,
                position: target as f32,
                torque: torque as f32,
                ..Command::default()
            };
        }
        let reference = self.reference(time).unwrap_or_default();
        let torque = joint.inertia() * reference.acceleration + joint.load.gravity_torque(reference.position);
        Command {
            mode: Mode::Impedance,
            position: reference.position as f32,
            velocity: reference.velocity as f32,
            torque: torque as f32,
            stiffness: controller.stiffness as f32,
            damping: controller.damping as f32,
            ..Command::NOTHING
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn velocity_and_acceleration_of_a_sweep_are_the_derivatives_of_its_position() {
        let sweep = Motion::Sweep(Sweep { amplitude: 0.2, frequency: (0.2, 3.0), duration: 6.0 });
        let at = |time: f64| sweep.reference(time).unwrap();
        let h = 1e-5;
        for n in 1..600 {
            let time = 0.01 * f64::from(n) - 0.003;
            let (before, now, after) = (at(time - h), at(time), at(time + h));
            let velocity = (after.position - before.position) / (2.0 * h);
            let acceleration = (after.velocity - before.velocity) / (2.0 * h);
            assert!((velocity - now.velocity).abs() < 1e-5, "{time}: {velocity} {now:?}");
            assert!((acceleration - now.acceleration).abs() < 1e-3, "{time}: {acceleration} {now:?}");
        }
        for end in [0.0, 6.0] {
            let rest = at(end);
            assert!(rest.position.abs() + rest.velocity.abs() + rest.acceleration.abs() < 1e-9, "{rest:?}");
        }
    }

    #[test]
    fn samples_are_met_after_the_move_to_the_first_and_joined_smoothly() {
        let period = 0.01;
        let wave = |time: f64| Reference {
            position: 0.7 + 0.2 * (3.0 * time).cos(),
            velocity: -0.6 * (3.0 * time).sin(),
            acceleration: -1.8 * (3.0 * time).cos(),
        };
        let time: Vec<f64> = (0..=100).map(|n| 5.0 + period * f64::from(n)).collect();
        let motion = time.iter().map(|time| wave(time - 5.0)).collect();
        let led = Led::new(Samples { time, motion }, 1.0);
        let lead = led.lead;
        assert!((lead - 1.875 * 0.9).abs() < 1e-12, "{lead}");
        let motion = Motion::Samples(led);
        let at = |time| motion.reference(time).unwrap();
        assert!((motion.duration() - lead - 1.0).abs() < 1e-12);
        assert_eq!((at(0.0).position, at(0.0).velocity), (0.0, 0.0));
        assert!((at(0.5 * lead).position - 0.45).abs() < 1e-12 && (at(0.5 * lead).velocity - 1.0).abs() < 1e-12);
        for n in 0..=999 {
            let time = 1e-3 * f64::from(n) + 2e-4;
            let (found, exact) = (at(lead + time), wave(time));
            assert!((found.position - exact.position).abs() < 1e-7, "{time}: {found:?} {exact:?}");
            assert!((found.velocity - exact.velocity).abs() < 1e-4, "{time}: {found:?} {exact:?}");
            assert!((found.acceleration - exact.acceleration).abs() < 1e-3, "{time}: {found:?} {exact:?}");
        }
        assert_eq!(at(99.0), Reference { position: wave(1.0).position, ..Reference::default() });
    }

    #[test]
    fn targets_hold_for_their_time_and_the_last_one_stays() {
        let joint = JointParameters::reference();
        let motion = Motion::Targets(Targets { positions: vec![0.5, -0.25], interval: 2.0 });
        let controller = Controller { stiffness: 1.0, damping: 1.0 };
        let command = |time| motion.command(time, 0.3, &joint, &controller);
        for (time, position) in [(0.0, 0.5), (1.99, 0.5), (2.01, -0.25), (9.0, -0.25)] {
            assert_eq!((command(time).mode, command(time).position), (Mode::Position, position));
        }
        assert_eq!(motion.duration(), 4.0);
        assert_eq!(command(0.0).torque, joint.load.gravity_torque(0.3) as f32);
    }

    #[test]
    fn a_reference_is_sent_with_the_torque_of_its_rigid_body() {
        let joint = JointParameters::reference();
        let motion = Motion::Sweep(Sweep { amplitude: 0.2, frequency: (0.2, 3.0), duration: 6.0 });
        let reference = motion.reference(3.1).unwrap();
        let command = motion.command(3.1, 9.9, &joint, &Controller { stiffness: 7.0, damping: 3.0 });
        let torque = joint.inertia() * reference.acceleration + joint.load.gravity_torque(reference.position);
        assert_eq!((command.mode, command.torque), (Mode::Impedance, torque as f32));
        assert_eq!((command.position, command.velocity), (reference.position as f32, reference.velocity as f32));
        assert_eq!((command.stiffness, command.damping), (7.0, 3.0));
    }
}
