//! Low-pass filters: Butterworth for signals, Chebyshev type I before decimation; zero-phase or causal; host.
//!
//! The Butterworth sections come from `sci-rs`, which follows SciPy. It has no Chebyshev prototype; ours is
//! Oppenheim and Schafer, Discrete-Time Signal Processing, appendix B, through the bilinear transform with prewarping.

use sci_rs::signal::filter::design::{DigitalFilter, FilterBandType, FilterOutputType, Sos, butter_dyn};
use sci_rs::signal::filter::{sosfilt_dyn, sosfilt_zi_dyn, sosfiltfilt_dyn};
use std::f64::consts::PI;
use thiserror::Error;

/// Why a signal cannot be filtered.
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

    /// Chebyshev type I low-pass of even `order` (2 to 12) with `ripple` dB up to `cutoff`, a fraction of the Nyquist frequency.
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

    /// Fewest samples that `zero_phase` accepts: one more than it mirrors at each end (three times the coefficients, as SciPy).
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
