//! A motion of all joints of a robot at once by computed torque (003, eq. 9), and what is recorded meanwhile; host.
//!
//! Each joint closes the loop by itself, in impedance mode: it is sent the reference of its position and velocity, the
//! model's torque of the whole robot's reference, and stiffness and damping by its inertia there. The ranges of its
//! impedance frame (2012h) are widened for it, and put back. Joints are enabled one after the other, each holding its
//! share of the links where they are; then all are led to the begin of the motion. From there on a joint that shares
//! its drive is told the other one's reference velocity, too.

use super::entry::Entry;
use super::error::RemoteError;
use super::joint::RemoteJoint;
use super::motion::Motion;
use super::partners::Partner;
use super::record::{Pace, Recorder, Recording, SIGNALS};
use super::stream::Stream;
use super::value::Value;
use excitation::file::SAMPLE_PERIOD;
use joint_firmware::joint::{Command, Mode};
use joint_firmware::objects::field::{Actual, Field, Range};
use plant::excitation::Reference;
use plant::fourier::smooth_step;
use robot::Controller;
use std::fmt::Write;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Shortest lead to the begin of the motion, s.
const SHORTEST_LEAD: f64 = 1.0;
/// The steepest slope of the smooth step.
const STEEPEST: f64 = 1.875;
/// Part of the motion's largest velocity with which a joint is led to its begin.
const LEAD: f64 = 0.3;
/// Wider than the largest value, so that rounding stays within.
const SPARE: f64 = 1.01;
/// Time between two looks at the joints' states.
const LOOK: Duration = Duration::from_millis(100);

/// Motion of all joints, in the order of the controller's.
#[derive(Debug)]
pub struct RobotMotion<'m> {
    /// The controller.
    pub controller: &'m Controller,
    /// References of each joint, [`SAMPLE_PERIOD`] apart, as many for each.
    pub references: Vec<Vec<Reference>>,
    /// Set-points and samples a second.
    pub rate: f64,
    /// Faults whose cause is gone are acknowledged first.
    pub acknowledge: bool,
}

/// A sample of all joints.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Time since the first row, s.
    pub time: f64,
    /// Values of [`SIGNALS`], of each joint.
    pub values: Vec<Vec<f64>>,
    /// Positions of the reference, where the motion has begun and is not over.
    pub wanted: Option<Vec<f64>>,
}

/// Outcome of a motion.
#[derive(Clone, Debug, PartialEq)]
pub struct RobotMoved {
    /// Samples that all joints have.
    pub rows: Vec<Row>,
    /// SYNCs without one.
    pub unanswered: u64,
}

/// Commands of all joints, from where they are to the end of the motion.
struct Plan {
    commands: Vec<Vec<Command>>,
    positions: Vec<Vec<f64>>,
    /// Sample at which the motion begins.
    begins: usize,
}

impl Plan {
    fn place(&self, time: f64) -> usize {
        ((time / SAMPLE_PERIOD) as usize).min(self.commands.len().saturating_sub(1))
    }

    fn wanted(&self, time: f64) -> Option<Vec<f64>> {
        let place = (time / SAMPLE_PERIOD).round() as usize;
        (place >= self.begins).then(|| self.positions.get(place).cloned()).flatten()
    }

    /// Largest size of a value that a joint is sent.
    fn most(&self, joint: usize, value: Part) -> f32 {
        let of = self.commands.iter().filter_map(|all| all.get(joint).map(value));
        of.fold(0.0, |most, one| most.max(one.abs()))
    }

    fn duration(&self) -> Duration {
        Duration::from_secs_f64(self.commands.len() as f64 * SAMPLE_PERIOD)
    }
}

impl RobotMotion<'_> {
    /// Reference of each joint at a sample of the motion.
    fn at(&self, sample: usize) -> Vec<Reference> {
        self.references.iter().filter_map(|joint| joint.get(sample).copied()).collect()
    }

    fn samples(&self) -> usize {
        self.references.iter().map(Vec::len).min().unwrap_or(0)
    }

    fn commands(&self, references: &[Reference]) -> Vec<Command> {
        let of = |value: fn(&Reference) -> f64| references.iter().map(value).collect::<Vec<f64>>();
        let (q, v, a) = (of(|at| at.position), of(|at| at.velocity), of(|at| at.acceleration));
        let shares = self.controller.at(&q, &v, &a);
        let command = |(share, at): (&robot::controller::Share, &Reference)| Command {
            mode: Mode::Impedance,
            position: at.position as f32,
            velocity: at.velocity as f32,
            torque: share.torque as f32,
            stiffness: share.stiffness as f32,
            damping: share.damping as f32,
            ..Command::NOTHING
        };
        shares.iter().zip(references).map(command).collect()
    }

    /// Lead from these positions, then the motion.
    fn plan(&self, from: &[f64]) -> Plan {
        let first = self.at(0);
        let lead = first.iter().zip(from).zip(&self.references).map(|((to, from), joint)| {
            let fastest = joint.iter().fold(0.0, |most: f64, at| most.max(at.velocity.abs()));
            STEEPEST * (to.position - from).abs() / (LEAD * fastest).max(0.05)
        });
        let lead = lead.fold(SHORTEST_LEAD, f64::max);
        let begins = (lead / SAMPLE_PERIOD).ceil() as usize;
        let led = |sample: usize| -> Vec<Reference> {
            let (level, slope, curvature) = smooth_step(sample as f64 * SAMPLE_PERIOD / lead);
            let led = |(to, from): (&Reference, &f64)| {
                let way = to.position - from;
                Reference {
                    position: from + level * way,
                    velocity: slope / lead * way,
                    acceleration: curvature / (lead * lead) * way,
                }
            };
            first.iter().zip(from).map(led).collect()
        };
        let all = (0..begins).map(led).chain((0..self.samples()).map(|sample| self.at(sample)));
        let (commands, positions) = all
            .map(|references| {
                let positions = references.iter().map(|at| at.position).collect();
                (self.commands(&references), positions)
            })
            .unzip();
        Plan { commands, positions, begins }
    }

    /// Refuses what is beyond a joint's limits, before anything is enabled.
    ///
    /// # Errors
    /// [`RemoteError`], with node, value and limit.
    fn check(&self, joints: &[RemoteJoint], plan: &Plan) -> Result<(), RemoteError> {
        for (i, joint) in joints.iter().enumerate() {
            let most = |value: Part| plan.most(i, value);
            let positions = || plan.commands.iter().filter_map(|all| all.get(i).map(|command| command.position));
            let lowest = positions().fold(f32::INFINITY, f32::min);
            let highest = positions().fold(f32::NEG_INFINITY, f32::max);
            let refuse = |command| Motion { command, duration: 1.0, rate: self.rate, acknowledge: false }.check(joint);
            for position in [lowest, highest] {
                refuse(Command {
                    mode: Mode::Impedance,
                    position,
                    torque: most(|command| command.torque),
                    stiffness: most(|command| command.stiffness),
                    damping: most(|command| command.damping),
                    ..Command::NOTHING
                })?;
            }
            refuse(Command { mode: Mode::Velocity, velocity: most(|command| command.velocity), ..Command::NOTHING })?;
        }
        Ok(())
    }

    /// Enables the joints, moves them for as long as `running` says so, and disables them, whatever happens. None where
    /// `running` ended it.
    ///
    /// # Errors
    /// [`RemoteError`] of the first joint that has one; all are left disabled.
    pub fn run(&self, joints: &[RemoteJoint], running: &dyn Fn() -> bool) -> Result<Option<RobotMoved>, RemoteError> {
        let position = |joint: &RemoteJoint| joint.number(Field::Actual(Actual::Position));
        let from = joints.iter().map(position).collect::<Result<Vec<f64>, RemoteError>>()?;
        let plan = Arc::new(self.plan(&from));
        // Put back at the end, whatever happens.
        let mut ranges = Ranges::default();
        for (i, joint) in joints.iter().enumerate() {
            ranges.bear(joint, &plan, i)?;
        }
        self.check(joints, &plan)?;
        // Put back likewise, once no stream uses it.
        let mut partners = Vec::new();
        for (i, joint) in joints.iter().enumerate() {
            let other = self.controller.robot().pairs.iter().find_map(|pair| pair.partner(i));
            let told = match other {
                Some(other) => Partner::begin(joint)?.map(|partner| Arc::new((partner, other))),
                None => None,
            };
            partners.push(told);
        }
        let mut recorders = Vec::new();
        for (i, joint) in joints.iter().enumerate() {
            let pace = if i == 0 { Pace::Send(self.rate) } else { Pace::Sent };
            recorders.push(Recorder::begin(joint, &SIGNALS, pace)?);
        }
        let mut streams = Vec::new();
        let holding = plan.commands.first().cloned().unwrap_or_default();
        for (joint, hold) in joints.iter().zip(holding) {
            streams.push(Stream::begin_with(joint, hold, self.rate, self.acknowledge)?);
        }
        let began = Instant::now();
        for (i, stream) in streams.iter().enumerate() {
            let (plan, told) = (Arc::clone(&plan), partners.get(i).cloned().flatten());
            stream.play(move |_| {
                let now = plan.place(began.elapsed().as_secs_f64());
                if let Some((partner, other)) = told.as_deref() {
                    partner.tell(plan.commands.get(now).and_then(|all| all.get(*other)).map_or(0.0, |of| of.velocity));
                }
                plan.commands.get(now).and_then(|all| all.get(i).copied()).unwrap_or(Command::NOTHING)
            });
        }
        let followed = follow(&streams, &mut recorders, plan.duration(), running);
        // However it went, all of them brake at once.
        let ended = std::thread::scope(|scope| {
            let ending: Vec<_> = streams.into_iter().map(|stream| scope.spawn(|| stream.end())).collect();
            let join = |one: std::thread::ScopedJoinHandle<'_, _>| {
                one.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
            };
            ending.into_iter().map(join).collect::<Vec<Result<_, RemoteError>>>()
        });
        if !followed? {
            return Ok(None);
        }
        ended.into_iter().collect::<Result<Vec<_>, _>>()?;
        let recordings = recorders.into_iter().map(Recorder::end).collect::<Result<Vec<_>, _>>()?;
        let moved =
            together(&recordings, 0.5 / self.rate, |at| plan.wanted(at.checked_duration_since(began)?.as_secs_f64()));
        match joints.first() {
            Some(first) if moved.rows.iter().all(|row| row.wanted.is_none()) => {
                Err(RemoteError::NoSamples { node: first.id(), within_ms: plan.duration().as_millis() as u64 })
            }
            _ => Ok(Some(moved)),
        }
    }
}

/// A value of a command.
type Part = fn(&Command) -> f32;

/// Ranges of joints' impedance frames (2012h) that a motion does not fit into, wider while this lasts.
#[derive(Default)]
struct Ranges {
    before: Vec<(RemoteJoint, Range, f64)>,
}

impl Ranges {
    /// Widens those of a joint.
    fn bear(&mut self, joint: &RemoteJoint, plan: &Plan, place: usize) -> Result<(), RemoteError> {
        let values: [(Range, Part); 5] = [
            (Range::Position, |command| command.position),
            (Range::Velocity, |command| command.velocity),
            (Range::Stiffness, |command| command.stiffness),
            (Range::Damping, |command| command.damping),
            (Range::Torque, |command| command.torque),
        ];
        for (range, value) in values {
            let (before, most) = (joint.number(Field::Range(range))?, f64::from(plan.most(place, value)));
            if most > before {
                self.before.push((joint.clone(), range, before));
                joint.write(Entry::of(Field::Range(range)), &Value::Real(SPARE * most))?;
            }
        }
        Ok(())
    }
}

impl Drop for Ranges {
    fn drop(&mut self) {
        for (joint, range, before) in &self.before {
            // The error that brought us here is what is reported.
            let _ = joint.write(Entry::of(Field::Range(*range)), &Value::Real(*before));
        }
    }
}

/// Takes samples until the time is over; false where `running` ended it.
fn follow(
    streams: &[Stream],
    recorders: &mut [Recorder],
    duration: Duration,
    running: &dyn Fn() -> bool,
) -> Result<bool, RemoteError> {
    let (began, mut looked) = (Instant::now(), Instant::now());
    while began.elapsed() < duration {
        if !running() {
            return Ok(false);
        }
        for (i, recorder) in recorders.iter_mut().enumerate() {
            let mut wait = if i == 0 { LOOK } else { Duration::ZERO };
            while recorder.next(wait)?.is_some() {
                wait = Duration::ZERO;
            }
        }
        if looked.elapsed() > LOOK {
            streams.iter().try_for_each(Stream::check)?;
            looked = Instant::now();
        }
    }
    streams.iter().try_for_each(Stream::check)?;
    Ok(true)
}

/// Samples of all joints that belong to one SYNC: those that came within half a period of the first joint's.
fn together(recordings: &[Recording], within: f64, wanted: impl Fn(Instant) -> Option<Vec<f64>>) -> RobotMoved {
    let Some((first, others)) = recordings.split_first() else {
        return RobotMoved { rows: Vec::new(), unanswered: 0 };
    };
    let apart = |a: Instant, b: Instant| a.max(b).duration_since(a.min(b)).as_secs_f64();
    let mut places = vec![0; others.len()];
    let mut rows = Vec::new();
    let start = first.samples.first().map(|sample| sample.at);
    for sample in &first.samples {
        let mut values = vec![sample.values.clone()];
        for (place, other) in places.iter_mut().zip(others) {
            let nearer = |place: usize| {
                let [here, next] = [place, place + 1].map(|at| other.samples.get(at));
                next.is_some_and(|next| here.is_none_or(|here| apart(next.at, sample.at) <= apart(here.at, sample.at)))
            };
            while nearer(*place) {
                *place += 1;
            }
            let nearest = other.samples.get(*place).filter(|found| apart(found.at, sample.at) <= within);
            values.extend(nearest.map(|found| found.values.clone()));
        }
        if values.len() == recordings.len() {
            let time = start.map_or(0.0, |start| sample.at.saturating_duration_since(start).as_secs_f64());
            rows.push(Row { time, values, wanted: wanted(sample.at) });
        }
    }
    let unanswered = first.syncs.saturating_sub(rows.len() as u64);
    RobotMoved { rows, unanswered }
}

/// Tracking of one joint along a motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tracked {
    /// Root of the mean square of the position's distance from the reference, rad.
    pub rms: f64,
    /// Its largest value, rad.
    pub largest: f64,
    /// Root of the mean square of the measured torque, Nm.
    pub torque: f64,
}

impl RobotMoved {
    /// Tracking of each joint.
    pub fn tracked(&self) -> Vec<Tracked> {
        let joints = self.rows.first().map_or(0, |row| row.values.len());
        let tracked = |joint: usize| {
            let (mut count, mut squares, mut largest, mut torques) = (0u32, 0.0, 0.0f64, 0.0);
            for row in &self.rows {
                let Some(wanted) = &row.wanted else { continue };
                let value = |actual| row.values[joint][SIGNALS.iter().position(|one| *one == actual).unwrap_or(0)];
                let error = value(Actual::Position) - wanted[joint];
                count += 1;
                (squares, largest) = (squares + error * error, largest.max(error.abs()));
                torques += value(Actual::Torque).powi(2);
            }
            let root = |sum: f64| (sum / f64::from(count)).sqrt();
            Tracked { rms: root(squares), largest, torque: root(torques) }
        };
        (0..joints).map(tracked).collect()
    }

    /// The rows as a table that `robot fit` reads: a column for each joint and signal.
    pub fn table(&self, names: &[String]) -> String {
        let mut text = String::from("time_s");
        for name in names {
            COLUMNS.iter().for_each(|(column, _)| text.extend([",", name, ".", column]));
        }
        text.push('\n');
        for row in &self.rows {
            // Writing to a string does not fail.
            let _ = write!(text, "{:.6}", row.time);
            for (value, (_, decimals)) in row.values.iter().flat_map(|values| values.iter().zip(&COLUMNS)) {
                let _ = if value.is_finite() { write!(text, ",{value:.decimals$}") } else { write!(text, ",") };
            }
            text.push('\n');
        }
        text
    }
}

/// Columns of [`SIGNALS`] and their decimals.
const COLUMNS: [(&str, usize); SIGNALS.len()] =
    [("position_rad", 6), ("velocity_rad_s", 5), ("torque_Nm", 4), ("temperature_C", 1)];

/// Describes such a table, in the file `table` beside the description, of the robot in the file `robot`, for
/// `jointctl robot fit`.
pub fn description(robot: &str, table: &str, names: &[String]) -> String {
    let quoted = |text: &str| toml::Value::from(text).to_string();
    let mut text = format!(
        "# A robot recorded over its bus: see docs/robot.md.\nname = {}\nrobot = {}\n\n[source]\nfiles = [{}]\n{}",
        quoted("moved by jointctl"),
        quoted(robot),
        quoted(table),
        include_str!("robot_recording.toml")
    );
    for name in names {
        let column = |place: usize| quoted(&format!("{name}.{}", COLUMNS[place].0));
        let _ = write!(
            text,
            "\n[joints.{}]\nposition = {{ column = {} }}\nvelocity = {{ column = {} }}\n\
             effort = {{ column = {}, unit = \"Nm\" }}\ntemperature = {{ column = {} }}\n",
            quoted(name),
            column(0),
            column(1),
            column(2),
            column(3)
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::super::telemetry::Sample;
    use super::*;

    fn recording(at: Instant, milliseconds: &[u64], syncs: u64) -> Recording {
        let sample = |after: &u64| Sample {
            at: at + Duration::from_millis(*after),
            values: vec![1e-3 * *after as f64, 0.0, 2.0, f64::NAN],
        };
        Recording { signals: SIGNALS.to_vec(), samples: milliseconds.iter().map(sample).collect(), syncs, late: 0 }
    }

    #[test]
    fn rows_have_the_samples_of_one_sync_and_those_that_a_joint_lacks_are_counted() {
        let at = Instant::now();
        let recordings = [recording(at, &[0, 4, 8, 12], 5), recording(at, &[1, 5, 13], 0)];
        let wanted = |instant: Instant| (instant > at).then(|| vec![0.0, 0.004]);
        let moved = together(&recordings, 2e-3, wanted);
        let times: Vec<f64> = moved.rows.iter().map(|row| row.time).collect();
        assert_eq!((times, moved.unanswered), (vec![0.0, 0.004, 0.012], 2));
        let [first, second] = moved.tracked()[..] else { panic!("two joints") };
        // Of the first 4 and 12 mrad, of the second 1 and 9.
        assert!((first.rms - 1e-3 * 80f64.sqrt()).abs() < 1e-12 && first.largest == 0.012, "{first:?}");
        assert!((second.rms - 1e-3 * 41f64.sqrt()).abs() < 1e-12 && second.torque == 2.0, "{second:?}");
        let table = moved.table(&["a".into(), "b".into()]);
        let lines: Vec<&str> = table.lines().collect();
        assert_eq!(lines[0].split(',').count(), 9);
        assert_eq!(lines[2], "0.004000,0.004000,0.00000,2.0000,,0.005000,0.00000,2.0000,");
    }
}
