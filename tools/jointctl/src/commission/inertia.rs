//! The torque constant against an inertia that is known: the joint swings to and fro, and its torque tells what it
//! speeds up.
//!
//! Work is change of kinetic energy plus what friction takes, over a way and without a clock, which a bus would blur:
//!
//! ```text
//! mean T = J (v2^2 - v1^2) / (2 dq) + friction
//! ```
//!
//! In each direction the slope of the straight line through torque over acceleration is the inertia; friction stays in
//! the intercept.

use super::bench::{Bench, Motion};
use super::estimate::{Estimate, line};
use super::failure::Failure;
use super::turning::{self, Reach};
use joint_firmware::objects::settings::Setting;

/// Ways to and fro.
const WAYS: usize = 10;
/// Period of set-points, s, and samples of a stretch over which the work is counted.
const PERIOD: f64 = 0.01;
const STRETCH: usize = 5;
/// Least speed of a stretch as a part of the largest: near standstill friction is not itself.
const LEAST_SPEED: f64 = 0.2;
/// Longest time of a way, as a multiple of the one that it should take.
const LONGEST: f64 = 3.0;
/// Largest standard error, as a part of the inertia.
const CLEAR: f64 = 0.1;

/// Measurement of an inertia by the joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inertia {
    /// kg m^2 at the joint, as the user says.
    pub known: f64,
    /// kg m^2 at the joint, as it measures by its torque constant.
    pub measured: Estimate,
    /// Torque constant with which both agree, Nm/A.
    pub torque_constant: f64,
}

/// Swings the joint about where it is, and leaves it disabled.
pub(super) fn swing<B: Bench>(bench: &mut B, known: f64) -> Result<Inertia, Failure> {
    let constant = bench.setting(Setting::TorqueConstant)?;
    let reach = turning::reach(bench)?;
    bench.begin_motion(Motion::Velocity)?;
    let samples = to_and_fro(bench, &reach);
    let off = bench.off();
    let measured = inertia(&samples?, reach.velocity);
    off?;
    if measured.relative() <= CLEAR && measured.value > 0.0 {
        return Ok(Inertia { known, measured, torque_constant: constant * known / measured.value });
    }
    Err(Failure::InertiaUnclear { inertia: measured.value, error: measured.error, limit: CLEAR })
}

/// Position, rad, velocity, rad/s, and torque, Nm, all the way.
fn to_and_fro<B: Bench>(bench: &mut B, reach: &Reach) -> Result<Vec<[f64; 3]>, Failure> {
    let Reach { velocity, way, acceleration } = *reach;
    let mut samples = Vec::new();
    let [begun, ..] = bench.motion()?;
    for number in 0..WAYS {
        let wanted = if number % 2 == 0 { velocity } else { -velocity };
        let mut left = LONGEST * (way / velocity + 2.0 * velocity / acceleration);
        while left > 0.0 {
            bench.move_to(wanted)?;
            bench.pass(PERIOD)?;
            left -= PERIOD;
            let sample = bench.motion()?;
            samples.push(sample);
            // The ramp needs as much again.
            if (sample[0] - begun) * wanted.signum() >= 0.5 * way {
                break;
            }
        }
    }
    turning::rest(bench, velocity / acceleration)?;
    Ok(samples)
}

/// kg m^2, from stretches in which the joint keeps its direction; NaN from too few.
fn inertia(samples: &[[f64; 3]], fastest: f64) -> Estimate {
    let slope = |direction: f64| {
        let points: Vec<(f64, f64)> = samples
            .chunks_exact(STRETCH)
            .filter(|stretch| stretch.iter().all(|[_, velocity, _]| velocity * direction > LEAST_SPEED * fastest))
            .filter_map(work)
            .collect();
        line(&points).0
    };
    let (there, back) = (slope(1.0), slope(-1.0));
    Estimate { value: 0.5 * (there.value + back.value), error: 0.5 * there.error.hypot(back.error) }
}

/// Mean acceleration, rad/s^2, and mean torque, Nm, over the way of a stretch.
fn work(stretch: &[[f64; 3]]) -> Option<(f64, f64)> {
    let ([from, slow, _], [to, fast, _]) = (stretch.first()?, stretch.last()?);
    let way = to - from;
    let work: f64 = stretch.windows(2).map(|pair| 0.5 * (pair[0][2] + pair[1][2]) * (pair[1][0] - pair[0][0])).sum();
    (way != 0.0).then(|| (0.5 * (fast * fast - slow * slow) / way, work / way))
}
