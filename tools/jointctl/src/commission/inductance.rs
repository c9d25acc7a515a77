//! Inductances: the winding's answer to a voltage that alternates with an eighth of the control rate, along the magnet
//! and across it.
//!
//! It alternates on top of the voltage that holds the rotor, so that no phase current crosses zero and dead time
//! changes nothing. A voltage that is held for a period T makes the winding a filter of first order, i(z) / v(z) = (1 -
//! a) / R / (z - a) with a = exp(-R T / L) (G. F. Franklin, J. D. Powell, M. Workman, "Digital Control of Dynamic
//! Systems", 1998, sec. 4.3: zero-order hold). With m its measured gain at the angle theta = 2 pi / 8 a step, g = (m
//! R)^2 and u = 1 - a:
//!
//! ```text
//! u^2 = k (1 - u),   k = 2 g (1 - cos theta) / (1 - g),   L = -R T / ln(1 - u)
//! ```
//!
//! The phase is not used, so it does not matter when within a period the current is sampled.

use super::bench::{Bench, Frame, Window};
use super::drive::Drive;
use super::estimate::Estimate;
use super::failure::Failure;
use super::resistance::{Resistance, rest};

/// Amplitude of the current at which the voltage's stops rising, and the least to measure by, as parts of the holding
/// current.
const AMPLITUDE: f64 = 0.2;
const LEAST_AMPLITUDE: f64 = 0.02;
/// Least impedance in parts of the resistance: below, the inductance's share is too small to tell.
const LEAST_RATIO: f64 = 1.1;
/// First amplitude of the voltage, V, and the factor by which it rises.
const FIRST: f64 = 0.05;
const RISE: f64 = 1.6;
/// Windows that are measured.
const WINDOWS: usize = 6;

/// Inductances of the winding.
#[derive(Clone, Debug, PartialEq)]
pub struct Inductance {
    /// Along the magnet at the commissioning current, H.
    pub d: Estimate,
    /// Across it, H; too low where the rotor is light enough to give way: by the part
    /// 3/2 (pole pairs x flux linkage / w)^2 / (inertia x inductance) with w = 2 pi rate / 8.
    pub q: Estimate,
}

/// Measures them while `current`, A, holds the rotor, with at most `highest`, V, in all.
pub(super) fn measure<B: Bench>(
    drive: &mut Drive<'_, B>,
    resistance: &Resistance,
    current: f64,
    highest: f64,
    rate: f64,
) -> Result<Inductance, Failure> {
    let hold = Frame { voltage: resistance.voltage(current), ..Frame::default() };
    drive.set(hold)?;
    rest(drive)?;
    let ohms = resistance.resistance.value;
    let mut axis = |frame: fn(Frame, f64) -> Frame, read: fn(&Window) -> (f64, f64)| {
        let mut volts: f64 = FIRST;
        loop {
            drive.set(frame(hold, volts))?;
            let answer = drive.fresh(1, true)?;
            let ripple = answer.first().map_or(0.0, |window| read(window).0);
            let room = highest - hold.voltage;
            if ripple >= 0.8 * AMPLITUDE * current || volts >= room {
                if ripple < LEAST_AMPLITUDE * current {
                    return Err(Failure::RippleTooSmall { amplitude: ripple, least: LEAST_AMPLITUDE * current });
                }
                break;
            }
            // The answer is proportional, once there is one.
            let wanted = if ripple > 0.01 * current { AMPLITUDE * current / ripple } else { RISE };
            volts = (volts * wanted.min(RISE)).min(room);
        }
        let mut found = Vec::with_capacity(WINDOWS);
        for window in drive.fresh(WINDOWS, true)? {
            let (ripple, volts) = read(&window);
            found.push(inductance(ohms, ripple / volts, rate)?);
        }
        // Away before the other axis.
        drive.set(hold)?;
        Ok(Estimate::mean(&found))
    };
    let d = axis(|hold, along| Frame { along, ..hold }, |window| (window.ripple_along, window.alternating[0]))?;
    let q = axis(|hold, across| Frame { across, ..hold }, |window| (window.ripple_across, window.alternating[1]))?;
    Ok(Inductance { d, q })
}

/// Inductance, H, of a resistance, Ω, that answers with so many amperes per volt at an eighth of the control rate, Hz.
fn inductance(resistance: f64, gain: f64, rate: f64) -> Result<f64, Failure> {
    let part = resistance * gain;
    if LEAST_RATIO * part > 1.0 || part.is_nan() {
        return Err(Failure::NotInductive { ratio: 1.0 / part, least: LEAST_RATIO });
    }
    let g = part * part;
    let k = 2.0 * g * (1.0 - std::f64::consts::FRAC_1_SQRT_2) / (1.0 - g);
    let u = 0.5 * ((k * k + 4.0 * k).sqrt() - k);
    Ok(-resistance / rate / (1.0 - u).ln())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Gain of the winding with a voltage that is held for each period, by running it.
    fn gain(resistance: f64, henry: f64, rate: f64) -> f64 {
        let a = (-resistance / rate / henry).exp();
        let (mut current, mut sine, mut cosine) = (0.0, 0.0, 0.0);
        for n in 0..80_000 {
            let angle = std::f64::consts::TAU / 8.0 * f64::from(n % 8);
            if n >= 80_000 - 8 {
                sine += 0.25 * current * angle.sin();
                cosine += 0.25 * current * angle.cos();
            }
            current = a * current + (1.0 - a) / resistance * angle.sin();
        }
        f64::hypot(sine, cosine)
    }

    #[test]
    fn the_formula_gives_back_the_winding_that_was_run() {
        for (resistance, henry, rate) in
            [(0.1, 20e-6, 40e3), (0.05, 200e-6, 20e3), (2.0, 800e-6, 20e3), (0.5, 40e-6, 20e3)]
        {
            let found = inductance(resistance, gain(resistance, henry, rate), rate).unwrap();
            assert!((found / henry - 1.0).abs() < 1e-6, "{found} of {henry} H");
        }
    }

    #[test]
    fn a_winding_that_answers_like_a_resistor_is_refused_just_beyond_the_limit() {
        assert!(inductance(1.0, 0.999 / LEAST_RATIO, 20e3).is_ok());
        let refused = inductance(1.0, 1.001 / LEAST_RATIO, 20e3);
        assert!(matches!(refused, Err(Failure::NotInductive { ratio, .. }) if ratio < LEAST_RATIO), "{refused:?}");
    }
}
