//! The proof: the motor turns in velocity mode with the new configuration, there and back.

use super::bench::{Bench, Motion, Stopped};
use super::failure::Failure;
use joint_firmware::objects::settings::Setting;
use std::f64::consts::TAU;

/// Turns of the rotor per second, and how far it may go to each side, rotor turns; less where the joint's limits are
/// narrower.
const SPEED: f64 = 1.0;
const WAY: f64 = 0.5;
/// Part of the way to the nearest position limit that is used, which the ramps add half of it to, and of the velocity
/// limit.
const PART: f64 = 0.4;
/// Period of set-points, s.
const PERIOD: f64 = 0.01;
/// Longest time, as a multiple of the one that it should take.
const LONGEST: f64 = 3.0;
/// Time at rest before it is switched off, s.
const REST: f64 = 0.1;
/// Mean velocity over the second half of each way, as a part of what is wanted: least and most.
const RIGHT: [f64; 2] = [0.7, 1.3];

/// Motion of the motor.
#[derive(Clone, Debug, PartialEq)]
pub struct Turned {
    /// rad/s at the joint.
    pub wanted: f64,
    /// Mean velocity there and back, rad/s at the joint.
    pub velocity: [f64; 2],
    /// Time, s, velocity, rad/s, and torque, Nm, of the joint.
    pub samples: Vec<[f64; 3]>,
}

/// Largest speed and travel of a joint here.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Reach {
    /// rad/s.
    pub velocity: f64,
    /// rad to one side; a ramp adds half of it at most.
    pub way: f64,
    /// rad/s^2, of the ramps.
    pub acceleration: f64,
}

/// Within the joint's limits of position and velocity.
pub(super) fn reach<B: Bench>(bench: &mut B) -> Result<Reach, Failure> {
    let gear = bench.setting(Setting::GearRatio)?.abs();
    let limits = [bench.setting(Setting::LowestPosition)?, bench.setting(Setting::HighestPosition)?];
    let fastest = bench.setting(Setting::VelocityLimit)?;
    let acceleration = bench.setting(Setting::Acceleration)?;
    let [position, ..] = bench.motion()?;
    let free = (limits[1] - position).min(position - limits[0]).max(0.0);
    let way = (TAU * WAY / gear).min(PART * free);
    // Half of the way at most is for the ramp.
    let velocity = (TAU * SPEED / gear).min(PART * fastest).min((way * acceleration).sqrt());
    if !(velocity > 0.0 && (way / velocity).is_finite()) {
        return Err(Stopped::Joint(format!(
            "the joint is at {position:.3} rad, its limits are {} to {} rad: there is no way to turn it; --zero says where it is, \
             or set lowest-position and highest-position",
            limits[0], limits[1]
        ))
        .into());
    }
    Ok(Reach { velocity, way, acceleration })
}

/// Turns the motor a little, there and back, and leaves the joint disabled.
pub(super) fn turn<B: Bench>(bench: &mut B) -> Result<Turned, Failure> {
    let Reach { velocity, way, acceleration } = reach(bench)?;
    bench.begin_motion(Motion::Velocity)?;
    let turned = there_and_back(bench, velocity, way, acceleration);
    let off = bench.off();
    let turned = turned?;
    off?;
    for (mean, wanted) in turned.velocity.into_iter().zip([velocity, -velocity]) {
        if !(RIGHT[0]..=RIGHT[1]).contains(&(mean / wanted)) {
            return Err(Failure::DoesNotTurn { velocity: mean, wanted });
        }
    }
    Ok(turned)
}

fn there_and_back<B: Bench>(bench: &mut B, wanted: f64, way: f64, acceleration: f64) -> Result<Turned, Failure> {
    let (mut samples, mut velocity, mut now) = (Vec::new(), [0.0; 2], 0.0);
    let [begun, ..] = bench.motion()?;
    for (side, mean) in velocity.iter_mut().enumerate() {
        let sign = if side == 0 { 1.0 } else { -1.0 };
        let (mut taken, mut sum, mut elapsed) = (0, 0.0, 0.0);
        // A bus takes time as well: where the joint is tells how far it has gone, the time only how long it may take.
        let longest = LONGEST * (way / wanted + wanted / acceleration);
        while elapsed < longest {
            bench.move_to(sign * wanted)?;
            bench.pass(PERIOD)?;
            elapsed += PERIOD;
            now += PERIOD;
            let [position, velocity, torque] = bench.motion()?;
            samples.push([now, velocity, torque]);
            let gone = if side == 0 { position - begun } else { begun + way - position };
            if gone > 0.5 * way || elapsed > 0.75 * longest {
                taken += 1;
                sum += velocity;
            }
            if gone >= way {
                break;
            }
        }
        *mean = sum / f64::from(taken.max(1));
    }
    rest(bench, wanted / acceleration)?;
    Ok(Turned { wanted, velocity, samples })
}

/// Down by a ramp of some seconds before the joint is told to stop: what brakes for longer than its command deadline
/// has a fault.
pub(super) fn rest<B: Bench>(bench: &mut B, ramp: f64) -> Result<(), Failure> {
    let mut left = REST + ramp;
    while left > 0.0 {
        bench.move_to(0.0)?;
        bench.pass(PERIOD)?;
        left -= PERIOD;
    }
    Ok(())
}
