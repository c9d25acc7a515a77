//! Live values: signals of every sample, kept for a minute, and reduced to minima and maxima for a page; no I/O.

use joint_firmware::objects::field::Actual;
use std::collections::VecDeque;
use std::fmt::Write;

/// Signals that a page draws, the longest first; together with [`STATE`] they fill the four TPDOs of a joint that has
/// all of them.
pub const DRAWN: [Actual; 12] = [
    Actual::Position,
    Actual::Velocity,
    Actual::TorqueDemand,
    Actual::Torque,
    Actual::Current,
    Actual::CompensationTorque,
    Actual::Residual,
    Actual::Permitted,
    Actual::ExternalTorque,
    Actual::ExternalUncertainty,
    Actual::BusVoltage,
    Actual::Reason,
];
/// The same with friction by its parts in place of current, supply and external torque.
pub const BY_PART: [Actual; 12] = [
    Actual::Position,
    Actual::Velocity,
    Actual::TorqueDemand,
    Actual::Torque,
    Actual::CompensationTorque,
    Actual::Residual,
    Actual::Permitted,
    Actual::PhysicalTorque,
    Actual::NetworkTorque,
    Actual::PreSlidingTorque,
    Actual::AdaptationTorque,
    Actual::Reason,
];
/// Signals that become marks where they change.
pub const STATE: [Actual; 3] = [Actual::Statusword, Actual::LatchedFaults, Actual::ActingModel];

/// Width of what a page draws as one stroke, s: several of them to a pixel of a plot over some seconds.
pub const STROKE: f64 = 0.004;
/// Time that is kept, s.
pub const KEPT: f64 = 60.0;

/// Minima and maxima of the samples that share a stroke.
#[derive(Clone, Debug, PartialEq)]
pub struct Stroke {
    /// Time of the first sample, s.
    pub time: f64,
    /// Minimum of each signal; not a number where nothing measured it.
    pub low: Vec<f64>,
    /// Maximum of each signal.
    pub high: Vec<f64>,
}

/// Reduces samples to strokes.
#[derive(Debug, Default)]
pub struct Reduction {
    open: Option<Stroke>,
}

impl Reduction {
    /// Takes a sample; the stroke that it ends.
    pub fn push(&mut self, time: f64, values: &[f64]) -> Option<Stroke> {
        match &mut self.open {
            Some(open) if time < open.time + STROKE => {
                // `min` and `max` of a number and of what is none are the number.
                open.low.iter_mut().zip(values).for_each(|(low, value)| *low = low.min(*value));
                open.high.iter_mut().zip(values).for_each(|(high, value)| *high = high.max(*value));
                None
            }
            open => open.replace(Stroke { time, low: values.to_vec(), high: values.to_vec() }),
        }
    }
}

/// Samples of the last minute at full rate.
#[derive(Debug, Default)]
pub struct Kept {
    samples: VecDeque<(f64, Vec<f64>)>,
}

impl Kept {
    /// Takes a sample; forgets those that are older than [`KEPT`].
    pub fn push(&mut self, time: f64, values: Vec<f64>) {
        self.samples.push_back((time, values));
        while self.samples.front().is_some_and(|(oldest, _)| time - oldest > KEPT) {
            self.samples.pop_front();
        }
    }

    /// A table: the time and a column for each of `names`. What is no number is left empty.
    pub fn csv(&self, names: &[String]) -> String {
        let mut text = String::from("time_s");
        names.iter().for_each(|name| text.extend([",", name]));
        text.push('\n');
        for (time, values) in &self.samples {
            // Writing to a string does not fail.
            let _ = write!(text, "{time:.6}");
            for value in values {
                let _ = if value.is_finite() { write!(text, ",{}", rounded(*value)) } else { write!(text, ",") };
            }
            text.push('\n');
        }
        text
    }
}

/// A value without the noise of its scale: steps of the bus are 1e-6 at least.
pub fn rounded(value: f64) -> f64 {
    (value * 1e7).round() / 1e7
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_peak_of_one_sample_at_1_khz_is_in_the_stroke_that_it_belongs_to() {
        let mut reduction = Reduction::default();
        let mut strokes = Vec::new();
        for n in 0..1_000u32 {
            let time = 1e-3 * f64::from(n);
            let peak = match n {
                502 => 7.0,
                503 => -3.0,
                _ => 1.0,
            };
            strokes.extend(reduction.push(time, &[peak, f64::NAN]));
        }
        // Four samples to a stroke, or five where rounding has it so.
        assert!((199..=250).contains(&strokes.len()), "{}", strokes.len());
        let of = |time: f64| strokes.iter().rfind(|stroke| stroke.time <= time).unwrap();
        assert_eq!((of(0.502).high[0], of(0.503).low[0]), (7.0, -3.0));
        assert!(strokes.iter().filter(|stroke| (stroke.low[0], stroke.high[0]) != (1.0, 1.0)).count() <= 2);
        assert!(strokes.iter().all(|stroke| stroke.low[1].is_nan() && stroke.high[1].is_nan()));
    }

    #[test]
    fn a_value_after_a_gap_counts_in_its_stroke() {
        let mut reduction = Reduction::default();
        assert_eq!(reduction.push(0.0, &[f64::NAN]), None);
        assert_eq!(reduction.push(0.001, &[2.0]), None);
        assert_eq!(reduction.push(1.0, &[5.0]).map(|stroke| (stroke.low[0], stroke.high[0])), Some((2.0, 2.0)));
    }

    #[test]
    fn the_table_holds_the_last_minute_at_full_rate() {
        let mut kept = Kept::default();
        (0..=610).for_each(|n| kept.push(0.1 * f64::from(n), vec![0.1 + 0.2, f64::NAN]));
        let table = kept.csv(&["a_rad".into(), "b_Nm".into()]);
        let lines = table.lines().collect::<Vec<_>>();
        assert_eq!((lines[0], lines[1], lines.len()), ("time_s,a_rad,b_Nm", "1.000000,0.3,", 602));
    }
}
