//! The torque error: torque that did not arrive, as a share of the friction, below 20 Hz; host.
//!
//! The one measure of compensation, on recordings and in the loop. What does not arrive is the measured effort less the
//! predicted one on a recording, and the torque that was asked for less the torque at the link in the loop. The
//! friction is what the rigid body leaves of the effort on a recording, and the true friction in the loop. Without
//! compensation the torque error is 100 %.
//!
//! Below 20 Hz, because no link follows what is above, and there it is noise of currents and encoders that does not
//! belong to friction. As a share of the friction's RMS, because quotients of single samples are ruled by the smallest
//! denominators: with perfect knowledge of the friction, equation 11 of the mobile-robot paper over the torque asked
//! for reads 51 % on slow reversals.

use crate::filter::LowPassFilter;

/// Band in which torque counts, Hz: the -3 dB point of one pass.
pub const BAND_HZ: f64 = 20.0;
/// Order of one pass of the Butterworth filter, which runs forward and backward.
const ORDER: usize = 4;

/// A continuous recording; all columns are of equal length.
#[derive(Clone, Debug)]
pub struct Lost {
    /// Sampling period, s.
    pub period: f64,
    /// Torque that did not arrive.
    pub lost: Vec<f64>,
    /// Friction.
    pub friction: Vec<f64>,
    /// Samples that count. The others feed the filter.
    pub counts: Vec<bool>,
}

/// 100 RMS(lost) / RMS(friction) below 20 Hz, %. None where nothing counts or no friction is there.
///
/// A recording with less than 40 Hz, or too short for the filter, is taken as it is.
pub fn torque_error<'a>(recordings: impl IntoIterator<Item = &'a Lost>) -> Option<f64> {
    let (mut lost, mut friction) = (0.0, 0.0);
    for recording in recordings {
        let sum = |values: &[f64]| -> f64 {
            let counted = below(values, recording.period).into_iter().zip(&recording.counts);
            counted.filter(|(_, counts)| **counts).map(|(value, _)| value * value).sum()
        };
        lost += sum(&recording.lost);
        friction += sum(&recording.friction);
    }
    (friction > 0.0).then(|| 100.0 * (lost / friction).sqrt())
}

/// The signal below 20 Hz, without delay.
fn below(values: &[f64], period: f64) -> Vec<f64> {
    let filtered =
        LowPassFilter::butterworth(ORDER, 2.0 * BAND_HZ * period).and_then(|filter| filter.zero_phase(values));
    filtered.unwrap_or_else(|_| values.to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    fn tone(hertz: f64, amplitude: f64) -> Vec<f64> {
        (0..4000).map(|i| amplitude * (TAU * hertz * f64::from(i) * 1e-3).sin()).collect()
    }

    fn of(lost: Vec<f64>, friction: Vec<f64>) -> f64 {
        let counts = (0..lost.len()).map(|i| i > 500 && i < 3500).collect();
        torque_error(&[Lost { period: 1e-3, lost, friction, counts }]).unwrap()
    }

    #[test]
    fn a_tenth_of_the_friction_lost_is_ten_percent() {
        assert!((of(tone(2.0, 0.1), tone(2.0, 1.0)) - 10.0).abs() < 1e-6);
        assert!((of(tone(2.0, 1.0), tone(2.0, 1.0)) - 100.0).abs() < 1e-9);
    }

    #[test]
    fn noise_above_the_band_does_not_count_and_a_loss_within_does() {
        let friction = tone(2.0, 1.0);
        let with = |hertz| of(tone(hertz, 1.0), friction.clone());
        assert!(with(60.0) < 0.1, "{}", with(60.0));
        // Both passes halve the amplitude at the band's end.
        assert!((with(20.0) - 50.0).abs() < 1.0, "{}", with(20.0));
        assert!((with(8.0) - 100.0).abs() < 1.0, "{}", with(8.0));
    }

    #[test]
    fn recordings_too_slow_or_short_are_taken_as_they_are_and_no_friction_gives_no_number() {
        let short = |lost: Vec<f64>, friction: Vec<f64>, period| {
            let counts = vec![true; lost.len()];
            torque_error(&[Lost { period, lost, friction, counts }])
        };
        assert_eq!(short(vec![0.5; 3], vec![1.0; 3], 1e-3), Some(50.0));
        assert_eq!(short([0.5, -0.5, 0.5, -0.5].repeat(20), vec![1.0; 80], 0.04), Some(50.0));
        assert_eq!(short(vec![0.5; 3], vec![0.0; 3], 1e-3), None);
        assert_eq!(torque_error(&[]), None);
    }
}
