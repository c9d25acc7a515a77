//! The motions that are recorded: rests, Fourier series and trapezoidal moves, strung together.

use crate::error::{ParameterError, count_within, within};
pub use crate::fourier::Reference;

use crate::fourier::FourierSeries;
use crate::noise::Noise;
use crate::parameters::JointParameters;

/// Runs of the default excitation.
pub const DEFAULT_RUNS: usize = 6;

/// Largest acceleration of the default excitation, rad/s².
pub const GENTLE_ACCELERATION: f64 = 20.0;

/// One piece of a trajectory; it starts and ends at rest.
#[derive(Clone, Debug, PartialEq)]
pub enum Segment {
    /// Stays where it is.
    Rest {
        /// Duration, s, up to 3600.
        duration: f64,
    },
    /// A Fourier series about the present position, faded in and out.
    Fourier {
        /// The series.
        series: FourierSeries,
        /// Duration, s, up to 3600.
        duration: f64,
    },
    /// A move at constant speed with constant acceleration at both ends.
    Move {
        /// Destination, -100 to 100 rad.
        to: f64,
        /// Speed, 1e-4 to 100 rad/s; not reached where the way is too short.
        speed: f64,
        /// Acceleration, 1e-3 to 1e5 rad/s².
        acceleration: f64,
    },
}

/// Segments in sequence, starting at rest at position zero.
#[derive(Clone, Debug)]
pub struct Trajectory {
    pieces: Vec<Piece>,
    end: f64,
}

#[derive(Clone, Debug)]
struct Piece {
    start: f64,
    from: f64,
    segment: Segment,
}

impl Trajectory {
    /// Strings 1 to 10,000 segments together.
    ///
    /// # Errors
    /// The first number of a segment that is outside its range.
    pub fn new(segments: Vec<Segment>) -> Result<Self, ParameterError> {
        count_within("trajectory.segments", segments.len(), 1, 10_000)?;
        let mut pieces = Vec::with_capacity(segments.len());
        let (mut start, mut from) = (0.0, 0.0);
        for segment in segments {
            let (duration, to) = match &segment {
                Segment::Rest { duration } => {
                    within("rest.duration", *duration, 0.0, 3600.0)?;
                    (*duration, from)
                }
                Segment::Fourier { series, duration } => {
                    within("fourier.duration", *duration, 0.01, 3600.0)?;
                    within("fourier.fundamental", series.fundamental, 1e-3, 1e3)?;
                    count_within("fourier.sine", series.sine.len(), series.cosine.len(), series.cosine.len())?;
                    for coefficient in series.cosine.iter().chain(&series.sine) {
                        within("fourier.coefficient", *coefficient, -100.0, 100.0)?;
                    }
                    (*duration, from)
                }
                Segment::Move { to, speed, acceleration } => {
                    within("move.to", *to, -100.0, 100.0)?;
                    within("move.speed", *speed, 1e-4, 100.0)?;
                    within("move.acceleration", *acceleration, 1e-3, 1e5)?;
                    (Trapezoid::new(to - from, *speed, *acceleration).duration(), *to)
                }
            };
            pieces.push(Piece { start, from, segment });
            start += duration;
            from = to;
        }
        Ok(Self { pieces, end: start })
    }

    /// Duration, s.
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.end
    }

    /// Reference of the joint at `time` (s); at rest before the start and after the end.
    #[must_use]
    pub fn at(&self, time: f64) -> Reference {
        let time = time.clamp(0.0, self.end);
        let index = self.pieces.partition_point(|piece| piece.start <= time).max(1) - 1;
        let piece = &self.pieces[index];
        let local = time - piece.start;
        let mut reference = match &piece.segment {
            Segment::Rest { .. } => Reference::default(),
            Segment::Fourier { series, duration } => series.faded(local, *duration),
            Segment::Move { to, speed, acceleration } => {
                Trapezoid::new(to - piece.from, *speed, *acceleration).at(local)
            }
        };
        reference.position += piece.from;
        reference
    }
}

/// A move of `distance` with a trapezoidal velocity.
struct Trapezoid {
    distance: f64,
    speed: f64,
    acceleration: f64,
}

impl Trapezoid {
    fn new(distance: f64, speed: f64, acceleration: f64) -> Self {
        let reachable = (distance.abs() * acceleration).sqrt();
        Self { distance, speed: speed.min(reachable), acceleration }
    }

    fn ramp(&self) -> f64 {
        self.speed / self.acceleration
    }

    fn duration(&self) -> f64 {
        if self.distance == 0.0 { 0.0 } else { self.distance.abs() / self.speed + self.ramp() }
    }

    fn at(&self, time: f64) -> Reference {
        let (ramp, end) = (self.ramp(), self.duration());
        let sign = 1.0_f64.copysign(self.distance);
        let (position, velocity, acceleration) = if time < ramp {
            (0.5 * self.acceleration * time * time, self.acceleration * time, self.acceleration)
        } else if time < end - ramp {
            (self.speed * (time - 0.5 * ramp), self.speed, 0.0)
        } else {
            let left = (end - time).max(0.0);
            let braking = if left > 0.0 { -self.acceleration } else { 0.0 };
            (self.distance.abs() - 0.5 * self.acceleration * left * left, self.acceleration * left, braking)
        };
        Reference { position: sign * position, velocity: sign * velocity, acceleration: sign * acceleration }
    }
}

/// One recording session: the joint starts hanging at rest, at some temperature.
#[derive(Clone, Debug)]
pub struct Run {
    /// Temperature of the joint above the ambient when the run starts, 0 to 60 K.
    pub warmth: f64,
    /// Trajectory that follows.
    pub trajectory: Trajectory,
}

/// All runs of one recording.
#[derive(Clone, Debug)]
pub struct Excitation {
    /// The runs, each recorded on its own.
    pub runs: Vec<Run>,
}

impl Excitation {
    /// Excitation that a careful user would record on this joint: [`DEFAULT_RUNS`] runs of 20 to 30 s with a Fourier
    /// series, three constant speeds back and forth, slow reversals and rests; the first run cold, the last one 25 K
    /// warm. Speeds cover 2 to 90 % of the speed limit over all runs. `seed` draws the series and the order of the
    /// warmth.
    ///
    /// # Errors
    /// The first of the joint's parameters that is outside its range.
    pub fn for_joint(parameters: &JointParameters, seed: u64) -> Result<Self, ParameterError> {
        parameters.validate()?;
        let mut draw = Noise::new(seed, 200);
        let acceleration = parameters.usable_acceleration().min(GENTLE_ACCELERATION);
        let limits = Reference { position: parameters.limits.travel, velocity: parameters.limits.speed, acceleration };
        let mut runs = Vec::with_capacity(DEFAULT_RUNS);
        for run in 0..DEFAULT_RUNS {
            let duration = 10.0;
            let series = FourierSeries::drawn(&mut draw, duration, &limits);
            let mut segments = vec![
                Segment::Rest { duration: 1.0 },
                Segment::Fourier { series, duration },
                Segment::Rest { duration: 0.5 },
            ];
            for third in 0..3 {
                let share = (run + third * DEFAULT_RUNS) as f64 / (3 * DEFAULT_RUNS - 1) as f64;
                let speed = 0.02 * libm::pow(45.0, share) * limits.velocity;
                segments.extend(back_and_forth(speed, 0.9 * limits.position, acceleration));
            }
            segments.push(Segment::Rest { duration: 0.5 });
            let slow = limits.velocity * draw.scale(0.004, 0.02);
            segments.extend(slow_reversals(slow, 0.5, acceleration, 4));
            segments.push(Segment::Rest { duration: 1.0 });
            let warmth = 5.0 * (run as f64 + if run == 0 { 0.0 } else { draw.uniform(-0.4, 0.4) });
            runs.push(Run { warmth, trajectory: Trajectory::new(segments)? });
        }
        Ok(Self { runs })
    }

    /// Duration of all runs together, s.
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.runs.iter().map(|run| run.trajectory.duration()).sum()
    }
}

/// Motion from zero to one side, to the other and back at `speed` (rad/s): one second of it to each side, or less where
/// `travel` (rad) ends first. `acceleration` in rad/s².
#[must_use]
pub fn back_and_forth(speed: f64, travel: f64, acceleration: f64) -> Vec<Segment> {
    let side = travel.min(speed);
    [side, -side, 0.0].map(|to| Segment::Move { to, speed, acceleration }).to_vec()
}

/// `reversals` changes of direction at `speed` (rad/s), `interval` (s) apart, back at zero in the end; `acceleration`
/// in rad/s².
#[must_use]
pub fn slow_reversals(speed: f64, interval: f64, acceleration: f64, reversals: usize) -> Vec<Segment> {
    let side = 0.5 * speed * interval;
    let turns = (0..reversals).map(|turn| if turn % 2 == 0 { side } else { -side });
    turns.chain([0.0]).map(|to| Segment::Move { to, speed, acceleration }).collect()
}
