//! The torque constant against a load that is known: the joint holds it still, reached from both sides.
//!
//! Friction holds with or against the motor, whichever way the joint came; in the mean of both ways it drops out.

use super::bench::{Bench, Motion};
use super::estimate::Estimate;
use super::failure::Failure;
use joint_firmware::objects::settings::Setting;

/// Distance that the joint goes aside before it comes back, rad.
const ASIDE: f64 = 0.05;
/// Period of set-points, s; how long a position is approached, and how long it is held.
const PERIOD: f64 = 0.01;
const APPROACH: f64 = 1.0;
const HELD: f64 = 0.5;

/// Measurement of a load by the joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Load {
    /// Nm, as the user says.
    pub known: f64,
    /// Nm, as the joint measures by its torque constant; its error is half the difference of both ways: friction.
    pub measured: Estimate,
    /// Torque constant with which both agree, Nm/A.
    pub torque_constant: f64,
}

/// Holds the joint where it is, reached from above and from below.
pub(super) fn hold<B: Bench>(bench: &mut B, known: f64) -> Result<Load, Failure> {
    let constant = bench.setting(Setting::TorqueConstant)?;
    let [position, ..] = bench.motion()?;
    bench.begin_motion(Motion::Position)?;
    let held = both(bench, position);
    let off = bench.off();
    let [above, below] = held?;
    off?;
    let measured = Estimate { value: 0.5 * (above + below), error: 0.5 * (above - below).abs() };
    Ok(Load { known, measured, torque_constant: constant * known / measured.value })
}

fn both<B: Bench>(bench: &mut B, position: f64) -> Result<[f64; 2], Failure> {
    let mut torques = [0.0; 2];
    for (torque, aside) in torques.iter_mut().zip([ASIDE, -ASIDE]) {
        follow(bench, position + aside, APPROACH)?;
        follow(bench, position, APPROACH)?;
        *torque = follow(bench, position, HELD)?;
    }
    Ok(torques)
}

/// Keeps a set-point for a time, s; mean torque meanwhile, Nm.
fn follow<B: Bench>(bench: &mut B, position: f64, seconds: f64) -> Result<f64, Failure> {
    let steps = (seconds / PERIOD).ceil() as u32;
    let mut sum = 0.0;
    for _ in 0..steps {
        bench.move_to(position)?;
        bench.pass(PERIOD)?;
        sum += bench.motion()?[2];
    }
    Ok(sum / f64::from(steps))
}
