//! Axes: where a value lies, which values have ticks and how they read; host.
//!
//! plotters' own ticks depend on absolute rounding errors and print "-0.0"; these are multiples of 1, 2 or 5 times a
//! power of ten with just the decimals that tell them apart.

use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};
use std::ops::Range;

/// One axis with its ticks and its label.
#[derive(Clone, Debug)]
pub struct Axis {
    range: Range<f64>,
    ticks: Vec<(f64, String)>,
    /// Quantity and its unit.
    pub label: String,
    logarithmic: bool,
}

impl Axis {
    /// A linear axis over `range`, widened where it is empty, with about `ticks` ticks.
    pub fn linear(range: Range<f64>, ticks: usize, label: impl Into<String>) -> Self {
        let range = not_empty(range);
        let step = nice_step((range.end - range.start) / ticks.max(1) as f64);
        let decimals = (-step.log10().floor()).max(0.0) as usize;
        let largest = range.start.abs().max(range.end.abs());
        let (first, last) = ((range.start / step).ceil() as i64, (range.end / step).floor() as i64);
        let ticks = (first..=last)
            .map(|multiple| {
                let value = multiple as f64 * step;
                let text = match value {
                    0.0 => "0".to_owned(),
                    _ if largest >= 1e6 || step < 1e-5 => format!("{value:.1e}"),
                    _ => format!("{value:.decimals$}"),
                };
                (value, text.replace('-', "\u{2212}"))
            })
            .collect();
        Self { range, ticks, label: label.into(), logarithmic: false }
    }

    /// A logarithmic axis over a positive `range`, with ticks at powers of ten (and at 2 and 5 times these where the
    /// range holds less than two of them). Values are drawn by their logarithm.
    pub fn logarithmic(range: Range<f64>, label: impl Into<String>) -> Self {
        let low = range.start.max(f64::MIN_POSITIVE).log10();
        let range = not_empty(low..range.end.max(f64::MIN_POSITIVE).log10());
        let (first, last) = (range.start.floor() as i32, range.end.ceil() as i32);
        let wide = range.end - range.start > 2.0;
        let every = ((range.end - range.start) / 6.0).ceil().max(1.0) as i32;
        let multiples: &[f64] = if wide { &[1.0] } else { &[1.0, 2.0, 5.0] };
        let mut ticks = Vec::new();
        for decade in (first..=last).filter(|decade| !wide || decade % every == 0) {
            for &multiple in multiples {
                let value = multiple * 10f64.powi(decade);
                if range.contains(&value.log10()) {
                    let text = match decade {
                        -3..=3 => format!("{value:.*}", (-decade).max(0) as usize),
                        _ => format!("{value:e}"),
                    };
                    ticks.push((value, text.replace('-', "\u{2212}")));
                }
            }
        }
        Self { range, ticks, label: label.into(), logarithmic: true }
    }

    /// One place for each name, at 0, 1, 2, ...
    pub fn names<'a>(names: impl IntoIterator<Item = &'a str>, label: impl Into<String>) -> Self {
        let ticks: Vec<(f64, String)> =
            names.into_iter().enumerate().map(|(place, name)| (place as f64, name.to_owned())).collect();
        Self { range: -0.5..ticks.len() as f64 - 0.5, ticks, label: label.into(), logarithmic: false }
    }

    /// The same axis in the other direction.
    pub fn reversed(mut self) -> Self {
        self.range = self.range.end..self.range.start;
        self
    }

    /// True where `value` lies on the axis.
    pub fn contains(&self, value: f64) -> bool {
        let value = self.scale(value);
        let (low, high) = (self.range.start.min(self.range.end), self.range.start.max(self.range.end));
        (low..=high).contains(&value)
    }

    /// The nearest value that lies on the axis.
    pub fn clip(&self, value: f64) -> f64 {
        if self.contains(value) {
            return value;
        }
        let (low, high) = (self.range.start.min(self.range.end), self.range.start.max(self.range.end));
        let nearest = self.scale(value).clamp(low, high);
        if self.logarithmic { 10f64.powf(nearest) } else { nearest }
    }

    /// The tick labels.
    pub fn tick_labels(&self) -> impl Iterator<Item = &str> {
        self.ticks.iter().map(|(_, text)| text.as_str())
    }

    fn scale(&self, value: f64) -> f64 {
        if self.logarithmic { value.max(f64::MIN_POSITIVE).log10() } else { value }
    }
}

/// The one of 1, 2, 5 times a power of ten that is nearest to `rough` by ratio.
fn nice_step(rough: f64) -> f64 {
    let decade = 10f64.powf(rough.log10().floor());
    // A power of ten below the smallest number is zero, and no step at all would never end.
    let decade = if decade > 0.0 { decade } else { f64::MIN_POSITIVE };
    match rough / decade {
        ratio if ratio < 2f64.sqrt() => decade,
        ratio if ratio < 10f64.sqrt() => 2.0 * decade,
        ratio if ratio < 50f64.sqrt() => 5.0 * decade,
        _ => 10.0 * decade,
    }
}

/// `range`, or something around its middle where it is too narrow to be divided.
fn not_empty(range: Range<f64>) -> Range<f64> {
    let half = 1e-9 * range.start.abs().max(range.end.abs());
    if range.end - range.start > half {
        return range;
    }
    let half = if half > 0.0 { 1e8 * half } else { 1.0 };
    range.start - half..range.start + half
}

impl Ranged for Axis {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, (start, end): (i32, i32)) -> i32 {
        let share = (self.scale(*value) - self.range.start) / (self.range.end - self.range.start);
        // Far outside values would overflow; a little outside is enough to look clipped.
        start + (f64::from(end - start) * share.clamp(-0.5, 1.5)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        // plotters asks twice, for light and for bold grid lines; there are only bold ones.
        if hint.weight().allow_light_points() {
            Vec::new()
        } else {
            self.ticks.iter().map(|(value, _)| *value).collect()
        }
    }

    fn range(&self) -> Range<f64> {
        self.range.clone()
    }
}

impl ValueFormatter<f64> for Axis {
    fn format_ext(&self, value: &f64) -> String {
        self.ticks.iter().find(|(tick, _)| tick == value).map_or_else(String::new, |(_, text)| text.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: &Axis) -> Vec<&str> {
        axis.tick_labels().collect()
    }

    #[test]
    fn ticks_are_round_numbers_with_the_decimals_they_need() {
        assert_eq!(labels(&Axis::linear(-1.2..1.3, 5, "")), ["−1.0", "−0.5", "0", "0.5", "1.0"]);
        assert_eq!(labels(&Axis::linear(0.0..0.05, 5, "")), ["0", "0.01", "0.02", "0.03", "0.04", "0.05"]);
        assert_eq!(labels(&Axis::linear(100.0..900.0, 4, "")), ["200", "400", "600", "800"]);
        assert_eq!(labels(&Axis::linear(0.0..2.1e7, 2, "")), ["0", "1.0e7", "2.0e7"]);
    }

    #[test]
    fn an_empty_range_is_widened_around_its_value() {
        for value in [0.0, 3.0, -1e-12, 1e12] {
            let axis = Axis::linear(value..value, 5, "");
            assert!(axis.contains(value) && labels(&axis).len() >= 2, "{axis:?}");
            assert_eq!(axis.map(&value, (0, 1000)), 500);
        }
    }

    #[test]
    fn a_logarithmic_axis_has_powers_of_ten_or_finer_ticks() {
        assert_eq!(labels(&Axis::logarithmic(5e-5..2.0, "")), ["1e−4", "0.001", "0.01", "0.1", "1"]);
        assert_eq!(labels(&Axis::logarithmic(0.04..0.3, "")), ["0.05", "0.1", "0.2"]);
        let axis = Axis::logarithmic(0.01..100.0, "");
        assert_eq!((axis.map(&1.0, (0, 1000)), axis.map(&0.0, (0, 1000))), (500, -500));
    }

    #[test]
    fn names_lie_at_whole_numbers() {
        let axis = Axis::names(["a", "b"], "").reversed();
        assert_eq!((axis.map(&0.0, (0, 100)), axis.map(&1.0, (0, 100))), (75, 25));
        assert_eq!(axis.format_ext(&1.0), "b");
    }
}
