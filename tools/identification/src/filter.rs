//! Low-pass filters: Butterworth for signals, Chebyshev type I before decimation; zero-phase or causal; host.
//!
//! The Butterworth sections come from `sci-rs`, which follows SciPy. It has no Chebyshev prototype; ours is
//! Oppenheim and Schafer, Discrete-Time Signal Processing, appendix B, through the bilinear transform with prewarping.

use sci_rs::signal::filter::design::{DigitalFilter, FilterBandType, FilterOutputType, Sos, butter_dyn};
use sci_rs::signal::filter::{sosfilt_dyn, sosfilt_zi_dyn, sosfiltfilt_dyn};
use std::f64::consts::PI;
use thiserror::Error;

/// Reason for which a signal cannot be filtered.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum FilterError {
    /// The order is zero or beyond what second-order sections in double precision were checked for.
    #[error("filter order {0}: expected 1 to 12")]
    Order(usize),
    /// The cut-off is not below half of the sampling rate.
    #[error("cut-off {0} of the Nyquist frequency: expected more than 0 and less than 1")]
    Cutoff(f64),
    /// The signal is not longer than what is mirrored at its ends.
    #[error("{found} samples: a zero-phase filter of this order needs at least {required}")]
    TooShort {
        /// Number of samples.
        found: usize,
        /// Number of samples needed.
        required: usize,
    },
}

/// A low-pass as second-order sections.
#[derive(Clone, Debug)]
pub struct LowPassFilter {
    sections: Vec<Sos<f64>>,
}

impl LowPassFilter {
    /// Butterworth low-pass of `order` (1 to 12) with its -3 dB point at `cutoff`, a fraction of the Nyquist frequency.
    pub fn butterworth(order: usize, cutoff: f64) -> Result<LowPassFilter, FilterError> {
        check(order, cutoff)?;
        let design = butter_dyn(
            order,
            vec![cutoff],
            Some(FilterBandType::Lowpass),
            Some(false),
            Some(FilterOutputType::Sos),
            None,
        );
        match design {
            DigitalFilter::Sos(sos) => Ok(LowPassFilter { sections: sos.sos }),
            _ => Err(FilterError::Order(order)),
        }
    }

    /// Chebyshev type I low-pass of even `order` (2 to 12) with `ripple` dB up to `cutoff`, a fraction of the Nyquist
    /// frequency.
    pub fn chebyshev(order: usize, ripple: f64, cutoff: f64) -> Result<LowPassFilter, FilterError> {
        check(order, cutoff)?;
        if order % 2 == 1 {
            return Err(FilterError::Order(order));
        }
        let epsilon = (10f64.powf(0.1 * ripple) - 1.0).sqrt();
        let mu = (1.0 / epsilon).asinh() / order as f64;
        let warped = (0.5 * PI * cutoff).tan();
        let mut sections: Vec<Sos<f64>> = (0..order / 2)
            .map(|k| {
                let theta = PI * (2 * k + 1) as f64 / (2 * order) as f64;
                let (re, im) = (-mu.sinh() * theta.sin() * warped, mu.cosh() * theta.cos() * warped);
                // (s - p)(s - p*) = s^2 - 2 re s + |p|^2 with s = (1 - 1/z) / (1 + 1/z).
                let square = re * re + im * im;
                let a0 = 1.0 - 2.0 * re + square;
                let b = square / a0;
                Sos::new([b, 2.0 * b, b], [1.0, 2.0 * (square - 1.0) / a0, (1.0 + 2.0 * re + square) / a0])
            })
            .collect();
        // Of even order, the ripple has its lower edge at zero frequency.
        let gain = (1.0 + epsilon * epsilon).sqrt().recip();
        if let Some(section) = sections.first_mut() {
            section.b = section.b.map(|b| b * gain);
        }
        Ok(LowPassFilter { sections })
    }

    /// Fewest samples that `zero_phase` accepts: one more than it mirrors at each end (three times the coefficients, as
    /// SciPy).
    pub fn minimum_samples(&self) -> usize {
        let first_order = |last: fn(&Sos<f64>) -> f64| self.sections.iter().filter(|s| last(s) == 0.0).count();
        let degree = 2 * self.sections.len() - first_order(|s| s.b[2]).min(first_order(|s| s.a[2]));
        3 * (degree + 1) + 1
    }

    /// Filters forward and backward, with a point reflection at both ends, so that nothing is delayed.
    pub fn zero_phase(&self, values: &[f64]) -> Result<Vec<f64>, FilterError> {
        let required = self.minimum_samples();
        if values.len() < required {
            return Err(FilterError::TooShort { found: values.len(), required });
        }
        Ok(sosfiltfilt_dyn(values.iter(), &self.sections))
    }

    /// Filters forward only, beginning in the steady state of the first value: what a filter on the joint would give.
    pub fn causal(&self, values: &[f64]) -> Vec<f64> {
        let Some(first) = values.first() else { return Vec::new() };
        let mut sections = self.sections.clone();
        sosfilt_zi_dyn::<_, _, Sos<f64>>(sections.iter_mut());
        for section in &mut sections {
            section.zi0 *= first;
            section.zi1 *= first;
        }
        sosfilt_dyn(values.iter(), &mut sections)
    }
}

/// Moves a signal earlier by `samples` (not necessarily whole) with linear interpolation; the ends are held.
pub fn advance(values: &[f64], samples: f64) -> Vec<f64> {
    let last = values.len().saturating_sub(1);
    (0..values.len())
        .map(|i| {
            let at = (i as f64 + samples).clamp(0.0, last as f64);
            let before = (at.floor() as usize).min(last);
            let after = (before + 1).min(last);
            values[before] + (at - before as f64) * (values[after] - values[before])
        })
        .collect()
}

fn check(order: usize, cutoff: f64) -> Result<(), FilterError> {
    if !(1..=12).contains(&order) {
        return Err(FilterError::Order(order));
    }
    if !(cutoff > 0.0 && cutoff < 1.0) {
        return Err(FilterError::Cutoff(cutoff));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn signal() -> Vec<f64> {
        (0..60).map(|i| (0.05 * f64::from(i)).sin() + 0.3 * (1.3 * f64::from(i)).sin() + 0.01 * f64::from(i)).collect()
    }

    /// Compares with `scipy.signal.sosfiltfilt` and `sosfilt` (SciPy 1.x) at a few samples, both ends among them.
    fn assert_like_scipy(values: &[f64], expected: [f64; 5]) {
        for (i, e) in [0, 1, 10, 30, 59].into_iter().zip(expected) {
            assert!((values[i] - e).abs() < 1e-9, "sample {i}: {} {e}", values[i]);
        }
    }

    #[test]
    fn zero_phase_butterworth_is_that_of_scipy() {
        let even = LowPassFilter::butterworth(4, 0.2).unwrap().zero_phase(&signal()).unwrap();
        assert_like_scipy(
            &even,
            [0.0010630170386058879, 0.06101721429780587, 0.5796635838238037, 1.297821526457123, 1.0696621223422111],
        );
        let odd = LowPassFilter::butterworth(3, 0.2).unwrap().zero_phase(&signal()).unwrap();
        assert_like_scipy(
            &odd,
            [-0.0012902996947949628, 0.060534377854417405, 0.5801698981919344, 1.299223530862071, 1.070416419905145],
        );
    }

    #[test]
    fn causal_butterworth_is_that_of_scipy_from_its_steady_state() {
        let causal = LowPassFilter::butterworth(4, 0.2).unwrap().causal(&signal());
        assert_like_scipy(
            &causal,
            [0.0, 0.0016839207663494956, 0.35183059022522706, 1.2292935520958894, 0.9389951844457393],
        );
        assert_eq!(LowPassFilter::butterworth(4, 0.2).unwrap().causal(&[]), Vec::<f64>::new());
    }

    #[test]
    fn the_decimation_filter_is_that_of_scipy() {
        let filtered = LowPassFilter::chebyshev(8, 0.05, 0.08).unwrap().zero_phase(&signal()).unwrap();
        assert_like_scipy(
            &filtered,
            [0.0009761648930098465, 0.05932785353757102, 0.5763875538357043, 1.298794006380219, 1.0129003017777578],
        );
    }

    #[test]
    fn every_order_passes_a_constant_and_halves_the_power_at_its_cut_off() {
        for order in 1..=12 {
            let filter = LowPassFilter::butterworth(order, 0.25).unwrap();
            assert!(filter.causal(&[7.5; 200]).iter().all(|x| (x - 7.5).abs() < 1e-6), "order {order}");
            let tone: Vec<f64> = (0..4000).map(|i| (0.25 * PI * f64::from(i)).sin()).collect();
            let settled = &filter.causal(&tone)[2000..];
            let power = settled.iter().map(|x| x * x).sum::<f64>() / 1000.0;
            assert!((power - 0.5).abs() < 1e-3, "order {order}: {power}");
        }
    }

    #[test]
    fn order_zero_and_a_cut_off_beyond_nyquist_are_refused() {
        assert_eq!(LowPassFilter::butterworth(0, 0.2).unwrap_err(), FilterError::Order(0));
        assert_eq!(LowPassFilter::butterworth(13, 0.2).unwrap_err(), FilterError::Order(13));
        assert_eq!(LowPassFilter::chebyshev(7, 0.05, 0.2).unwrap_err(), FilterError::Order(7));
        assert_eq!(LowPassFilter::butterworth(4, 1.0).unwrap_err(), FilterError::Cutoff(1.0));
        assert!(LowPassFilter::butterworth(4, f64::NAN).is_err());
    }

    #[test]
    fn a_signal_shorter_than_its_mirrored_ends_is_refused_and_one_longer_is_not() {
        for order in 1..=12 {
            let filter = LowPassFilter::butterworth(order, 0.2).unwrap();
            let required = filter.minimum_samples();
            assert!(filter.zero_phase(&vec![1.0; required]).is_ok());
            let found = required - 1;
            assert_eq!(filter.zero_phase(&vec![1.0; found]), Err(FilterError::TooShort { found, required }));
        }
    }

    #[test]
    fn advancing_moves_a_signal_earlier_between_its_samples() {
        let moved = advance(&[0.0, 1.0, 4.0, 9.0], 0.5);
        assert_eq!(moved, [0.5, 2.5, 6.5, 9.0]);
        assert_eq!(advance(&[0.0, 1.0, 4.0], -1.0), [0.0, 0.0, 1.0]);
        assert_eq!(advance(&[], 1.0), Vec::<f64>::new());
    }
}
