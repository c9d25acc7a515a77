//! Fourier series that a joint follows in impedance mode, one after the other, and what is recorded meanwhile; host.
//!
//! The reference is sent with its velocity and with the torque of the rigid body as far as that is known. The joint is
//! led from where it is to the middle of the series first, by the minimum-jerk motion's smooth step.

use super::error::RemoteError;
use super::joint::RemoteJoint;
use super::record::{Pace, Recorder, Recording};
use super::stream::Stream;
use excitation::Excitation;
use identification::rigid::{RigidParameters, RigidState};
use joint_firmware::joint::{Command, Mode};
use joint_firmware::objects::field::{Actual, Field, Range};
use joint_firmware::objects::settings::Setting;
use plant::excitation::Reference;
use plant::fourier::smooth_step;
use std::time::{Duration, Instant};

/// Shortest lead, s.
const SHORTEST_LEAD: f64 = 0.5;
/// The steepest slope of the smooth step.
const STEEPEST: f64 = 1.875;
/// Time between two looks at the joint's state.
const LOOK: Duration = Duration::from_millis(100);

/// Route that a joint follows.
#[derive(Clone, Debug)]
pub struct Route {
    /// About the same position, each beginning and ending at rest there.
    pub series: Vec<Excitation>,
    /// Largest velocity of the lead, rad/s.
    pub speed: f64,
    /// The rigid body whose torque is sent with the reference.
    pub rigid: RigidParameters,
    /// Set-points a second.
    pub rate: f64,
    /// Samples.
    pub pace: Pace,
}

/// A joint on its route.
#[derive(Clone, Debug)]
struct Way {
    from: f64,
    lead: f64,
    route: Route,
    stiffness: f64,
    damping: f64,
}

/// Outcome of a route.
#[derive(Clone, Debug, PartialEq)]
pub struct Travelled {
    /// Recording from the begin of the lead.
    pub recording: Recording,
    /// Reference of the joint at each sample of the series, and the sample's number in the recording.
    pub references: Vec<(usize, Reference)>,
}

impl Way {
    fn duration(&self) -> f64 {
        self.lead + self.route.series.iter().map(|series| series.duration).sum::<f64>()
    }

    fn at(&self, time: f64) -> Reference {
        let centre = self.route.series.first().map_or(self.from, |series| series.centre);
        if time < self.lead {
            let (level, slope, curvature) = smooth_step(time / self.lead);
            let way = centre - self.from;
            return Reference {
                position: self.from + level * way,
                velocity: slope / self.lead * way,
                acceleration: curvature / (self.lead * self.lead) * way,
            };
        }
        let mut left = time - self.lead;
        for series in &self.route.series {
            if left <= series.duration {
                return series.at(left);
            }
            left -= series.duration;
        }
        Reference { position: centre, ..Reference::default() }
    }

    fn command(&self, time: f64) -> Command {
        let reference = self.at(time);
        let (position, acceleration) = (reference.position, reference.acceleration);
        let state = RigidState { position, acceleration, ..RigidState::default() };
        Command {
            mode: Mode::Impedance,
            position: reference.position as f32,
            velocity: reference.velocity as f32,
            torque: self.route.rigid.effort(&state) as f32,
            stiffness: self.stiffness as f32,
            damping: self.damping as f32,
            ..Command::NOTHING
        }
    }
}

impl Route {
    /// Enables the joint, leads it along and disables it, whatever happens. None where `running` ended it.
    pub fn travel(
        &self,
        joint: &RemoteJoint,
        signals: &[Actual],
        acknowledge: bool,
        running: &dyn Fn() -> bool,
    ) -> Result<Option<Travelled>, RemoteError> {
        let least = |setting, range| -> Result<f64, RemoteError> {
            Ok(joint.number(Field::Setting(setting))?.min(joint.number(Field::Range(range))?))
        };
        let (stiffness, damping) =
            (least(Setting::Stiffness, Range::Stiffness)?, least(Setting::Damping, Range::Damping)?);
        let mut recorder = Recorder::begin(joint, signals, self.pace)?;
        let stream = Stream::begin(joint, Mode::Impedance, self.rate, acknowledge)?;
        let from = joint.number(Field::Actual(Actual::Position))?;
        let centre = self.series.first().map_or(from, |series| series.centre);
        let lead = (STEEPEST * (centre - from).abs() / self.speed).max(SHORTEST_LEAD);
        let way = Way { from, lead, route: self.clone(), stiffness, damping };
        let duration = Duration::from_secs_f64(way.duration());
        let began = Instant::now();
        let played = way.clone();
        stream.play(move |elapsed| played.command(elapsed.as_secs_f64()));
        let patience = joint.network().patience();
        let (mut looked, mut heard) = (began, began);
        while began.elapsed() < duration {
            if !running() {
                stream.end()?;
                return Ok(None);
            }
            if recorder.next(patience.min(LOOK))?.is_some() {
                heard = Instant::now();
            } else if heard.elapsed() >= patience {
                return Err(RemoteError::NoSamples { node: joint.id(), within_ms: patience.as_millis() as u64 });
            }
            if looked.elapsed() > LOOK {
                stream.check()?;
                looked = Instant::now();
            }
        }
        stream.check()?;
        stream.end()?;
        let recording = recorder.end()?;
        let timed = |(number, at): (usize, Instant)| {
            // Samples from before the lead were on the way when it began.
            let time = at.checked_duration_since(began)?.as_secs_f64();
            (time >= way.lead && time <= way.duration()).then(|| (number, way.at(time)))
        };
        let references = recording.samples.iter().map(|sample| sample.at).enumerate().filter_map(timed).collect();
        Ok(Some(Travelled { recording, references }))
    }
}

impl Travelled {
    /// Root of the mean square of a signal over the series, in its unit; not a number where there is none.
    pub fn rms(&self, actual: Actual) -> f64 {
        let column = self.recording.column(actual);
        root_mean_square(self.references.iter().filter_map(|(number, _)| column.get(*number).copied()))
    }

    /// Root of the mean square of the position's distance from the reference over the series, rad.
    pub fn tracking_rms(&self) -> f64 {
        let column = self.recording.column(Actual::Position);
        let error = |(number, reference): &(usize, Reference)| Some(column.get(*number)? - reference.position);
        root_mean_square(self.references.iter().filter_map(error))
    }
}

fn root_mean_square(values: impl Iterator<Item = f64>) -> f64 {
    let (count, sum) = values.fold((0u32, 0.0), |(count, sum), value| (count + 1, sum + value * value));
    (sum / f64::from(count)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use plant::fourier::FourierSeries;

    #[test]
    fn a_way_has_no_jump_and_its_velocity_is_that_of_its_position() {
        let series = FourierSeries { fundamental: 2.0, cosine: vec![0.4, -0.1], sine: vec![0.2, 0.3] };
        let series = |duration| Excitation { series: series.clone(), centre: 0.3, duration };
        let rigid = RigidParameters { inertia: 2.0, gravity_sine: 5.0, ..RigidParameters::default() };
        let series = vec![series(3.0), series(2.5)];
        let route = Route { series, speed: 0.5, rigid, rate: 100.0, pace: Pace::Follow };
        let way = Way { from: -0.2, lead: 1.9, route, stiffness: 7.0, damping: 3.0 };
        assert_eq!((way.at(0.0).position, way.duration()), (-0.2, 1.9 + 5.5));
        let step = 1e-4;
        for n in 1..74_000 {
            let time = step * f64::from(n);
            let (before, now, after) = (way.at(time - step), way.at(time), way.at(time + step));
            let velocity = (after.position - before.position) / (2.0 * step);
            assert!((velocity - now.velocity).abs() < 2e-3, "{time}: {velocity} {now:?}");
        }
        let (reference, command) = (way.at(3.0), way.command(3.0));
        let torque = 2.0 * reference.acceleration + 5.0 * reference.position.sin();
        assert!((f64::from(command.torque) - torque).abs() < 1e-5 && command.stiffness == 7.0, "{command:?}");
    }
}
