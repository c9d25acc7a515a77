//! Ripple over the position: a series that any gear, wave generator or motor repeats, with its own phase; control step.
//!
//! ```text
//! level  = sum over the series of  A sin(h q) + B cos(h q)      added to the Coulomb friction of both directions
//! torque = sum over the series of  C sin(h q) + D cos(h q)      whatever the direction: cogging, error of the gear
//! ```
//!
//! The harmonics of 003 eq. 5 have one frequency, and all of them the phase of position zero; a joint repeats at that
//! of its output and at that of its motor, each where it happens to stand. The phase wraps with the integers: nothing
//! is lost on any number of turns.

use crate::dsp::{saturate, smlal};
use crate::sine::cos_sin;

/// Number of series.
pub const RIPPLES: usize = 2;

/// One series as it is stored and transferred.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Ripple {
    /// h / (2 pi): periods in a rad, Q16.16; 0: absent.
    pub periods: i32,
    /// A, Nm in Q16.16.
    pub level_sine: i32,
    /// B, Nm in Q16.16.
    pub level_cosine: i32,
    /// C, Nm in Q16.16.
    pub torque_sine: i32,
    /// D, Nm in Q16.16.
    pub torque_cosine: i32,
}

/// Values of the series at a position, Nm in Q16.16.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Rippled {
    /// Added to the Coulomb friction of both directions.
    pub level: i32,
    /// Added to friction.
    pub torque: i32,
}

/// Both series at a position, rad in Q16.16.
#[inline(always)]
pub fn ripple([a, b]: &[Ripple; RIPPLES], position: i32) -> Rippled {
    let (mut level, mut torque) = (0, 0);
    for series in [a, b] {
        // Q32 of a turn: what the product has above that is whole turns.
        let (cosine, sine) = cos_sin(position.wrapping_mul(series.periods) as u32);
        level = smlal(smlal(level, series.level_sine, sine), series.level_cosine, cosine);
        torque = smlal(smlal(torque, series.torque_sine, sine), series.torque_cosine, cosine);
    }
    Rippled { level: saturate(level >> 31), torque: saturate(torque >> 31) }
}

impl Ripple {
    /// Largest magnitudes of level and torque, Q16.16. Sums fit where both stay below 2^31.
    pub(crate) fn bound(series: &[Self; RIPPLES]) -> (i64, i64) {
        // Rounded down, a sum may be one below.
        let sum = |a: i32, b: i32| (a as i64).abs() + (b as i64).abs() + i64::from(a != 0 || b != 0);
        let (mut level, mut torque) = (0, 0);
        for ripple in series {
            level += sum(ripple.level_sine, ripple.level_cosine);
            torque += sum(ripple.torque_sine, ripple.torque_cosine);
        }
        (level, torque)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn each_series_is_a_sine_of_its_own_phase_within_its_bound(
            periods in prop::array::uniform2(-(40i32 << 16)..40 << 16), position in -(200i32 << 16)..200 << 16,
            amplitudes in prop::array::uniform8(-(4i32 << 16)..4 << 16),
        ) {
            let [a, b, c, d, e, f, g, h] = amplitudes;
            let series = [
                Ripple { periods: periods[0], level_sine: a, level_cosine: b, torque_sine: c, torque_cosine: d },
                Ripple { periods: periods[1], level_sine: e, level_cosine: f, torque_sine: g, torque_cosine: h },
            ];
            let found = ripple(&series, position);
            let (mut level, mut torque) = (0.0, 0.0);
            for series in &series {
                let turns = f64::from(series.periods) / 65_536.0 * f64::from(position) / 65_536.0;
                let (sine, cosine) = (turns.fract() * std::f64::consts::TAU).sin_cos();
                level += f64::from(series.level_sine) * sine + f64::from(series.level_cosine) * cosine;
                torque += f64::from(series.torque_sine) * sine + f64::from(series.torque_cosine) * cosine;
            }
            let size: f64 = amplitudes.iter().map(|a| f64::from(*a).abs()).sum();
            let allowed = 2e-5 * size + 2.0;
            prop_assert!((f64::from(found.level) - level).abs() < allowed, "{} {}", found.level, level);
            prop_assert!((f64::from(found.torque) - torque).abs() < allowed, "{} {}", found.torque, torque);
            let (most_level, most_torque) = Ripple::bound(&series);
            prop_assert!(i64::from(found.level).abs() <= most_level && i64::from(found.torque).abs() <= most_torque);
        }
    }

    #[test]
    fn nothing_overflows_at_the_ends_of_the_numbers() {
        for periods in [i32::MIN, -1, 0, 1, i32::MAX] {
            for amplitude in [i32::MIN, i32::MAX] {
                let series = Ripple {
                    periods,
                    level_sine: amplitude,
                    level_cosine: amplitude,
                    torque_sine: amplitude,
                    torque_cosine: amplitude,
                };
                for position in [i32::MIN, -77_777, 0, 123_456, i32::MAX] {
                    let found = ripple(&[series; RIPPLES], position);
                    assert!(i64::from(found.level).abs() <= Ripple::bound(&[series; RIPPLES]).0);
                }
            }
        }
    }
}
