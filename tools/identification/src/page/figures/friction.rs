//! Measurements against models: friction over velocity, and predicted over measured effort; host.

use crate::page::Report;
use report::figures::axis::Axis;
use report::figures::binning::{CLOUD_POINTS, bins, extent, robust_extent, thin, widen};
use report::figures::chart::{Entry, Panel, Swatch, legend, paper};
use report::figures::{Figure, FigureError, Ink};

const CURVE_BINS: usize = 160;

/// Friction (effort minus rigid body) over velocity, with the models' medians.
pub fn against_velocity(report: &Report) -> Result<Option<Figure>, FigureError> {
    let (test, units) = (&report.test, &report.units);
    if test.time.is_empty() {
        return Ok(None);
    }
    let friction = |total: &[f64]| -> Vec<f64> { total.iter().zip(&test.rigid).map(|(t, rigid)| t - rigid).collect() };
    let measured = friction(&test.effort);
    let curve = |total: &[f64]| -> Vec<(f64, f64)> {
        bins(&test.velocity, &friction(total), CURVE_BINS, 3).into_iter().map(|bin| (bin.x, bin.median)).collect()
    };
    let mut entries: Vec<Entry> =
        vec![(Ink::Measured, Swatch::Points, "measured − rigid body"), (Ink::PhysicalCurve, Swatch::Line, "physical")];
    if test.network.is_some() {
        entries.push((Ink::Network, Swatch::Line, "physical + network"));
    }
    let svg = paper(1080, 470, |area| {
        let area = legend(area, 70, &entries)?;
        let x = Axis::linear(
            widen(extent(test.velocity.iter().copied()), 0.02),
            10,
            format!("velocity [{}]", units.velocity),
        );
        let y = Axis::linear(robust_extent(&measured), 7, format!("friction [{}]", units.effort));
        let panel = Panel::new(&area, x, y, 0)?;
        let points = thin(measured.len(), CLOUD_POINTS).into_iter().map(|i| (test.velocity[i], measured[i]));
        panel.cloud(points, Ink::Measured, 0.5, 1.4)?;
        if let Some(network) = &test.network {
            panel.line(curve(network), Ink::Network, 2.4, 1.0)?;
        }
        panel.line(curve(&test.physical), Ink::PhysicalCurve, 2.4, 1.0)?;
        panel.note_outside(outside(&measured), measured.len())
    })?;
    let caption = "Dots are the measured effort less the rigid body; the lines are the medians of the models' friction at \
                   the same samples: a good model runs through the middle of the dots.";
    Ok(Some(Figure {
        name: "friction-velocity",
        title: "Friction against velocity",
        caption: caption.into(),
        wide: true,
        svg,
    }))
}

/// Predicted over measured effort, with the identity line.
pub fn predicted_against_measured(report: &Report) -> Result<Option<Figure>, FigureError> {
    let (test, unit) = (&report.test, &report.units.effort);
    if test.time.is_empty() {
        return Ok(None);
    }
    let after = test.compensated();
    let (ink, name) = compensated_ink(report);
    let values = test.effort.iter().chain(&test.rigid).chain(after).copied();
    let range = widen(extent(values), 0.04);
    let svg = paper(530, 430, |area| {
        let entries = [
            (Ink::Nothing, Swatch::Points, "rigid body"),
            (ink, Swatch::Points, name),
            (Ink::Axis, Swatch::Line, "identity"),
        ];
        let area = legend(area, 30, &entries)?;
        let x = Axis::linear(range.clone(), 6, format!("measured effort [{unit}]"));
        let y = Axis::linear(range.clone(), 6, format!("predicted effort [{unit}]"));
        let panel = Panel::new(&area, x, y, 0)?;
        let kept = thin(test.effort.len(), CLOUD_POINTS / 2);
        panel.cloud(kept.iter().map(|&i| (test.effort[i], test.rigid[i])), Ink::Nothing, 0.6, 1.3)?;
        panel.cloud(kept.iter().map(|&i| (test.effort[i], after[i])), ink, 0.6, 1.3)?;
        panel.line([(range.start, range.start), (range.end, range.end)], Ink::Axis, 1.2, 1.0)
    })?;
    let caption = "Dots on the identity line are predicted exactly; their distance from it is the error.";
    Ok(Some(Figure {
        name: "predicted-measured",
        title: "Predicted against measured",
        caption: caption.into(),
        wide: false,
        svg,
    }))
}

/// Ink and name of the last model of the chain.
pub fn compensated_ink(report: &Report) -> (Ink, &'static str) {
    match report.test.network {
        Some(_) => (Ink::Network, "physical + network"),
        None => (Ink::Physical, "physical"),
    }
}

/// Number of values beyond their [`robust_extent`].
pub fn outside(values: &[f64]) -> usize {
    let range = robust_extent(values);
    values.iter().filter(|value| !(range.start..=range.end).contains(*value)).count()
}
