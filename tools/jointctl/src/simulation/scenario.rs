//! The named scenarios: which motions a joint runs, at which temperature, with which payload, against what; host.
//!
//! All sizes follow from the joint's own limits of travel and speed, so that every joint has its version of each
//! scenario.

use super::SimulationError;
use super::motion::{Led, Motion, Sweep, Targets};
use excitation::file::Samples;
use excitation::{Bounds, Effort, optimise};
use plant::ActuatorParameters;
use plant::contact::{Contact, Side};
use plant::excitation::{GENTLE_ACCELERATION, Segment, Trajectory, back_and_forth, slow_reversals};

/// What a joint is put through.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Scenario {
    /// Reversals at 2 % of the speed limit: friction changes its sign under a slow motion
    SlowReversal,
    /// A sine from 0.1 to 3 Hz
    SineSweep,
    /// Positions asked for at once, in position mode
    PointToPoint,
    /// Softly against a wall and back, in impedance mode
    ImpedanceContact,
    /// The same motions at ambient temperature, 20 K warmer (as warm as a careful recording gets) and 35 K warmer
    HotAndCold,
    /// The same motions with the whole payload, half and a quarter of it
    PayloadChange,
    /// A motion for identification: a Fourier series optimised for it, or that of a file
    Excitation,
}

/// A part of a scenario: it starts anew, hanging at rest.
#[derive(Clone, Debug)]
pub struct Part {
    /// Name, for the log.
    pub name: &'static str,
    /// The actuator.
    pub plant: ActuatorParameters,
    /// Temperature at the start, °C.
    pub temperature: f64,
    /// Contact in the link's way.
    pub contact: Option<Contact>,
    /// Motion that is asked of the joint.
    pub motion: Motion,
    /// Natural frequency of the impedance as a share of the position loop's.
    pub softness: f64,
    /// The reference can be reached.
    pub tracks: bool,
}

impl Part {
    /// A motion at the ambient temperature with nothing in its way, followed as stiffly as the position loop is.
    #[must_use]
    pub fn new(name: &'static str, plant: &ActuatorParameters, motion: Motion) -> Self {
        Self {
            name,
            plant: *plant,
            temperature: plant.joint.thermal.ambient,
            contact: None,
            motion,
            softness: 1.0,
            tracks: true,
        }
    }
}

impl Scenario {
    /// All scenarios.
    pub const ALL: [Self; 7] = [
        Self::SlowReversal,
        Self::SineSweep,
        Self::PointToPoint,
        Self::ImpedanceContact,
        Self::HotAndCold,
        Self::PayloadChange,
        Self::Excitation,
    ];

    /// Its name on the command line and in file names.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::SlowReversal => "slow-reversal",
            Self::SineSweep => "sine-sweep",
            Self::PointToPoint => "point-to-point",
            Self::ImpedanceContact => "impedance-contact",
            Self::HotAndCold => "hot-and-cold",
            Self::PayloadChange => "payload-change",
            Self::Excitation => "excitation",
        }
    }

    /// Its parts on an actuator. The excitation is `samples`, or else a series that `seed` draws.
    ///
    /// # Errors
    /// A number that is outside its range, which follows from limits that no joint has.
    pub fn parts(
        self,
        plant: &ActuatorParameters,
        seed: u64,
        samples: Option<&Samples>,
    ) -> Result<Vec<Part>, SimulationError> {
        let joint = &plant.joint;
        let (travel, speed) = (joint.limits.travel, joint.limits.speed);
        let acceleration = (0.5 * joint.usable_acceleration()).min(GENTLE_ACCELERATION);
        let trajectory =
            |segments| -> Result<Motion, SimulationError> { Ok(Motion::Trajectory(Trajectory::new(segments)?)) };
        let one = |name, motion| vec![Part::new(name, plant, motion)];
        Ok(match self {
            Self::SlowReversal => {
                let mut segments = vec![Segment::Rest { duration: 0.5 }];
                // To where gravity bends friction's load, not only about hanging down.
                segments.push(Segment::Move { to: 0.4 * travel, speed: 0.5 * speed, acceleration });
                for turn in 0..6 {
                    let side = if turn % 2 == 0 { 0.03 } else { -0.03 } * speed;
                    segments.push(Segment::Move { to: 0.4 * travel + side, speed: 0.02 * speed, acceleration });
                }
                segments.push(Segment::Rest { duration: 0.5 });
                one("slow", trajectory(segments)?)
            }
            Self::SineSweep => {
                let (low, high) = (0.1, 3.0);
                let fastest = std::f64::consts::TAU * high;
                let amplitude = (0.5 * speed / fastest).min(acceleration / (fastest * fastest)).min(0.5 * travel);
                one("sweep", Motion::Sweep(Sweep { amplitude, frequency: (low, high), duration: 12.0 }))
            }
            Self::PointToPoint => {
                let positions = [0.5, -0.5, 0.1, 0.12, 0.1, 0.8, 0.0].map(|share| share * travel).to_vec();
                one("targets", Motion::Targets(Targets { positions, interval: 1.5 }))
            }
            Self::ImpedanceContact => vec![contact(plant, acceleration)?],
            Self::HotAndCold => {
                let motion = trajectory(repeated(speed, travel, acceleration))?;
                let cold = Part::new("cold", plant, motion);
                let warmer = |name, by| Part { name, temperature: cold.temperature + by, ..cold.clone() };
                let (warm, hot) = (warmer("warm", 20.0), warmer("hot", 35.0));
                vec![cold, warm, hot]
            }
            Self::PayloadChange => {
                let motion = trajectory(repeated(speed, travel, acceleration))?;
                let load = joint.load;
                let with = |name, share: f64| {
                    let plant = plant.with_payload(share * load.mass, load.length);
                    Part::new(name, &plant, motion.clone())
                };
                vec![with("whole", 1.0), with("half", 0.5), with("quarter", 0.25)]
            }
            Self::Excitation => {
                if let Some(samples) = samples {
                    return Ok(one("file", Motion::Samples(Led::new(samples.clone(), 0.25 * speed))));
                }
                let bounds = Bounds { position: (-0.9 * travel, 0.9 * travel), velocity: 0.9 * speed, acceleration };
                let found = optimise(&bounds, &Effort { seed, ..Effort::QUICK })?;
                let duration = found.excitation.duration;
                one("series", trajectory(vec![Segment::Fourier { series: found.excitation.series, duration }])?)
            }
        })
    }
}

/// Two speeds back and forth, and slow reversals.
fn repeated(speed: f64, travel: f64, acceleration: f64) -> Vec<Segment> {
    let mut segments = vec![Segment::Rest { duration: 0.5 }];
    for share in [0.1, 0.5] {
        segments.extend(back_and_forth(share * speed, 0.8 * travel, acceleration));
    }
    segments.extend(slow_reversals(0.02 * speed, 1.0, acceleration, 2));
    segments.push(Segment::Rest { duration: 0.5 });
    segments
}

/// Against a wall at a fifth of the travel, a quarter of the peak torque into it, and back.
fn contact(plant: &ActuatorParameters, acceleration: f64) -> Result<Part, SimulationError> {
    const SOFTNESS: f64 = 0.5;
    let joint = &plant.joint;
    let inertia = joint.inertia();
    let wall = 0.2 * joint.limits.travel;
    let bandwidth = SOFTNESS * std::f64::consts::TAU * plant::virtual_joint::setup::POSITION_BANDWIDTH;
    let depth = 0.25 * joint.motor.torque_limit() / (inertia * bandwidth * bandwidth);
    let speed = 0.1 * joint.limits.speed;
    let segments = vec![
        Segment::Rest { duration: 0.5 },
        Segment::Move { to: wall + depth, speed, acceleration },
        Segment::Rest { duration: 1.0 },
        Segment::Move { to: wall + 0.5 * depth, speed, acceleration },
        Segment::Rest { duration: 1.0 },
        Segment::Move { to: 0.0, speed, acceleration },
    ];
    // A hundred times as stiff as the joint, and damped so that the link stays on it.
    let stiffness = 100.0 * inertia * bandwidth * bandwidth;
    let damping = 10.0 * inertia * bandwidth;
    Ok(Part {
        contact: Some(Contact { position: wall, stiffness, damping, side: Side::Above }),
        softness: SOFTNESS,
        tracks: false,
        ..Part::new("wall", plant, Motion::Trajectory(Trajectory::new(segments)?))
    })
}
