//! Residuals of the models: their distribution, and whether they still depend on something; host.

use super::friction::{compensated_ink, outside};
use crate::page::Report;
use report::figures::axis::Axis;
use report::figures::binning::{CLOUD_POINTS, bins, extent, quantile, robust_extent, thin, widen};
use report::figures::chart::{Entry, Panel, Swatch, legend, paper};
use report::figures::{Figure, FigureError, Ink};

const HISTOGRAM_BINS: usize = 81;
const MEAN_BINS: usize = 40;
/// Bins with less samples than this, or with less than one in [`LEAST_SHARE`] of all, say too little about a mean.
const LEAST_SAMPLES: usize = 5;
const LEAST_SHARE: usize = 1000;

/// Histogram of the error without compensation and with each model.
pub fn histogram(report: &Report) -> Result<Option<Figure>, FigureError> {
    let (test, unit) = (&report.test, &report.units.effort);
    if test.time.is_empty() {
        return Ok(None);
    }
    let mut models: Vec<(Ink, &str, Vec<f64>)> = vec![(Ink::Nothing, "nothing", left(report, &test.rigid))];
    if let Some(network) = &test.network {
        models.push((Ink::Network, "physical + network", left(report, network)));
    }
    let physical = if test.network.is_some() { Ink::PhysicalCurve } else { Ink::Physical };
    models.push((physical, "physical", left(report, &test.physical)));
    let reach = models
        .iter()
        .map(|(_, _, values)| quantile(values, 0.002).abs().max(quantile(values, 0.998).abs()))
        .fold(0.0, f64::max);
    let reach = if reach > 0.0 { reach * 1.05 } else { 1.0 };
    let width = 2.0 * reach / HISTOGRAM_BINS as f64;
    let shares: Vec<Vec<f64>> = models.iter().map(|(_, _, values)| bin_shares(values, reach)).collect();
    let highest = shares.iter().flatten().copied().fold(0.0, f64::max);
    let svg = paper(530, 430, |area| {
        let mut entries: Vec<Entry> = models.iter().map(|(ink, name, _)| (*ink, Swatch::Line, *name)).collect();
        entries.sort_by_key(|(ink, ..)| *ink as u8);
        let area = legend(area, 30, &entries)?;
        let x = Axis::linear(-reach..reach, 7, format!("error [{unit}]"));
        let panel = Panel::new(&area, x, Axis::linear(0.0..highest * 1.06, 6, "share of samples [%]"), 0)?;
        for ((ink, ..), shares) in models.iter().zip(&shares) {
            let steps = shares.iter().enumerate().flat_map(|(place, &share)| {
                let from = -reach + place as f64 * width;
                [(from, share), (from + width, share)]
            });
            let steps: Vec<(f64, f64)> = steps.collect();
            if *ink != Ink::PhysicalCurve {
                let edges: Vec<(f64, f64, f64)> = steps.iter().map(|&(x, share)| (x, 0.0, share)).collect();
                panel.band(&edges, *ink, 0.25)?;
            }
            panel.line(steps, *ink, 1.6, 1.0)?;
        }
        Ok(())
    })?;
    let caption = "How often which error occurs: compensation should leave one narrow peak at zero where the rigid body \
                   alone leaves two humps, one for each direction of motion.";
    Ok(Some(Figure {
        name: "error-histogram",
        title: "Distribution of the error",
        caption: caption.into(),
        wide: false,
        svg,
    }))
}

/// The error over velocity.
pub fn against_velocity(report: &Report) -> Result<Option<Figure>, FigureError> {
    let label = format!("velocity [{}]", report.units.velocity);
    against(report, &report.test.velocity, "error-velocity", "Error against velocity", &label)
}

/// The error over position.
pub fn against_position(report: &Report) -> Result<Option<Figure>, FigureError> {
    let label = format!("position [{}]", report.units.position);
    against(report, &report.test.position, "error-position", "Error against position", &label)
}

/// The error over temperature, where it was recorded.
pub fn against_temperature(report: &Report) -> Result<Option<Figure>, FigureError> {
    match &report.test.temperature {
        Some(temperature) => {
            against(report, temperature, "error-temperature", "Error against temperature", "temperature [°C]")
        }
        None => Ok(None),
    }
}

fn against(
    report: &Report,
    abscissa: &[f64],
    name: &'static str,
    title: &'static str,
    label: &str,
) -> Result<Option<Figure>, FigureError> {
    let (test, unit) = (&report.test, &report.units.effort);
    if test.time.is_empty() {
        return Ok(None);
    }
    let after = left(report, test.compensated());
    let (ink, model) = compensated_ink(report);
    let mean_name = format!("{model}: mean ± std");
    let mut entries: Vec<Entry> = vec![(Ink::Measured, Swatch::Points, "error"), (ink, Swatch::Line, &mean_name)];
    if test.network.is_some() {
        entries.push((Ink::PhysicalCurve, Swatch::Line, "physical: mean"));
    }
    let svg = paper(530, 430, |area| {
        let area = legend(area, 10, &entries)?;
        let x = Axis::linear(widen(extent(abscissa.iter().copied()), 0.02), 6, label);
        let panel = Panel::new(&area, x, Axis::linear(robust_extent(&after), 6, format!("error [{unit}]")), 0)?;
        let kept = thin(after.len(), CLOUD_POINTS);
        panel.cloud(kept.into_iter().map(|i| (abscissa[i], after[i])), Ink::Measured, 0.5, 1.2)?;
        let range = extent(abscissa.iter().copied());
        panel.line([(range.start, 0.0), (range.end, 0.0)], Ink::Axis, 1.0, 1.0)?;
        let least = LEAST_SAMPLES.max(after.len() / LEAST_SHARE);
        let means = bins(abscissa, &after, MEAN_BINS, least);
        let edges: Vec<(f64, f64, f64)> =
            means.iter().map(|bin| (bin.x, bin.mean - bin.deviation, bin.mean + bin.deviation)).collect();
        panel.band(&edges, ink, 0.3)?;
        panel.line(means.iter().map(|bin| (bin.x, bin.mean)), ink, 2.2, 1.0)?;
        panel.cloud(means.iter().map(|bin| (bin.x, bin.mean)), ink, 1.0, 2.6)?;
        if test.network.is_some() {
            let physical = bins(abscissa, &left(report, &test.physical), MEAN_BINS, least);
            panel.line(physical.iter().map(|bin| (bin.x, bin.mean)), Ink::PhysicalCurve, 1.8, 1.0)?;
        }
        panel.note_outside(outside(&after), after.len())
    })?;
    let caption = "The mean (one dot for each bin) should lie on zero everywhere; where it does not, the model misses \
                   something that depends on this quantity.";
    Ok(Some(Figure { name, title, caption: caption.into(), wide: false, svg }))
}

/// Measured less predicted effort.
fn left(report: &Report, predicted: &[f64]) -> Vec<f64> {
    report.test.effort.iter().zip(predicted).map(|(measured, predicted)| measured - predicted).collect()
}

/// Percentage of all values in each of [`HISTOGRAM_BINS`] bins over +-reach.
fn bin_shares(values: &[f64], reach: f64) -> Vec<f64> {
    let mut shares = vec![0.0; HISTOGRAM_BINS];
    for value in values {
        let place = ((value + reach) / (2.0 * reach) * HISTOGRAM_BINS as f64).floor();
        if (0.0..HISTOGRAM_BINS as f64).contains(&place) {
            shares[place as usize] += 100.0 / values.len() as f64;
        }
    }
    shares
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_are_percentages_of_all_values_even_of_those_beyond_the_axis() {
        let shares = bin_shares(&[0.0, 0.0, 0.99, 5.0], 1.0);
        assert_eq!((shares[40], shares[80], shares.iter().sum::<f64>()), (50.0, 25.0, 75.0));
    }
}
