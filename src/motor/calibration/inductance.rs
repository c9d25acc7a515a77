//! Inductance: the winding's answer to an alternating voltage of an eighth of the control rate; control step.
//!
//! The voltage alternates on top of the one that holds the rotor, so that no phase current crosses zero and dead time changes nothing. Its
//! amplitude rises until the current's is a fifth of the holding current, then both are compared over whole cycles.
//!
//! A voltage that is held for a period T makes the winding a filter of first order, i(z) / v(z) = (1 - a) / R / (z - a) with
//! a = exp(-R T / L). With m its measured gain at the angle theta = 2 pi / 8 a step, g = (m R)^2 and u = 1 - a:
//!
//! ```text
//! u^2 = k (1 - u),   k = 2 g (1 - cos theta) / (1 - g),   L = R T (2 - u) / (2 u)
//! ```
//!
//! which is exact but for the last step, the first Padé approximation of the logarithm (0.3 % at R T / L = 0.2). The phase is not
//! used, so it does not matter when the current is sampled.

use super::Next;
use super::failure::Failure;
use super::resistance::Hold;
use super::settings::{MEASURE, Plan, RISE, SETTLE};
use crate::motor::number::square_root;

/// Amplitude of the current at which the voltage's stops rising, and the least to measure by, in parts of the holding current.
const AMPLITUDE: (f32, f32) = (0.2, 0.02);
/// Least impedance in parts of the resistance: below, the inductance's share is too small to tell.
const LEAST_RATIO: f32 = 1.1;
/// One minus the cosine of an eighth of a turn.
const ONE_LESS_COSINE: f32 = 0.292_893_2;

#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Inductance {
    /// Amplitude of the voltage, V.
    voltage: f32,
    /// Step within the cycle.
    step: u32,
    /// Cycles since the amplitude stopped rising; none while it rises.
    cycles: Option<u32>,
    rises: u32,
    sine: f32,
    cosine: f32,
}

/// Sine of a number of eighths of a turn.
fn eighth(step: u32) -> f32 {
    const DIAGONAL: f32 = core::f32::consts::FRAC_1_SQRT_2;
    match step % 8 {
        0 | 4 => 0.0,
        1 | 3 => DIAGONAL,
        2 => 1.0,
        5 | 7 => -DIAGONAL,
        _ => -1.0,
    }
}

impl Inductance {
    /// Takes the current along the axis that the voltage alternates on; the voltage to add there.
    pub fn step(&mut self, plan: &Plan, hold: &Hold, current: f32) -> Result<Next<f32, f32>, Failure> {
        self.sine += current * eighth(self.step);
        self.cosine += current * eighth(self.step + 2);
        self.step += 1;
        if self.step == 8 {
            self.step = 0;
            if let Some(inductance) = self.cycle(plan, hold)? {
                return Ok(Next::Finished(inductance));
            }
        }
        Ok(Next::Continue(self.voltage * eighth(self.step)))
    }

    /// After each whole cycle.
    fn cycle(&mut self, plan: &Plan, hold: &Hold) -> Result<Option<f32>, Failure> {
        let sums = square_root(self.sine * self.sine + self.cosine * self.cosine);
        let Some(cycles) = self.cycles else {
            let amplitude = 0.25 * sums;
            (self.sine, self.cosine) = (0.0, 0.0);
            if amplitude >= AMPLITUDE.0 * plan.current || self.rises >= RISE {
                if amplitude < AMPLITUDE.1 * plan.current {
                    return Err(Failure::RippleTooSmall { amplitude, least: AMPLITUDE.1 * plan.current });
                }
                self.cycles = Some(0);
            } else {
                self.rises += 1;
                self.voltage = (plan.highest_voltage - hold.voltage) * (self.rises as f32 / RISE as f32);
            }
            return Ok(None);
        };
        self.cycles = Some(cycles + 1);
        if cycles < SETTLE {
            (self.sine, self.cosine) = (0.0, 0.0);
            return Ok(None);
        }
        if cycles + 1 < SETTLE + MEASURE {
            return Ok(None);
        }
        let amplitude = sums * (0.25 / MEASURE as f32);
        let part = hold.resistance * amplitude;
        if part * LEAST_RATIO > self.voltage {
            return Err(Failure::NotInductive { ratio: self.voltage / part, least: LEAST_RATIO });
        }
        let gain = part / self.voltage;
        let g = gain * gain;
        let k = 2.0 * g * ONE_LESS_COSINE / (1.0 - g);
        let u = 0.5 * (square_root(k * k + 4.0 * k) - k);
        Ok(Some(hold.resistance / plan.rate * (2.0 - u) / (2.0 * u)))
    }
}
