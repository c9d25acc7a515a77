//! Training and validation error over the epochs, for every seed; host.

use crate::page::{Report, TrainingCurve};
use report::figures::axis::Axis;
use report::figures::binning::extent;
use report::figures::chart::{Panel, Swatch, legend, paper};
use report::figures::{Figure, FigureError, Ink};

/// Points of one line; early epochs, where the error falls fast, are all kept.
const LINE_POINTS: usize = 600;

/// Mean square errors on a logarithmic axis, the chosen seed in full colour, its best epoch marked.
pub fn curves(report: &Report) -> Result<Option<Figure>, FigureError> {
    let drawable = |value: &f64| value.is_finite() && *value > 0.0;
    let values = || report.training.iter().flat_map(|curve| curve.train.iter().chain(&curve.validation).copied());
    let range = extent(values().filter(drawable));
    let epochs = report.training.iter().map(|curve| curve.train.len().max(curve.validation.len())).max().unwrap_or(0);
    if !values().any(|value| drawable(&value)) {
        return Ok(None);
    }
    let svg = paper(1080, 400, |area| {
        let entries = [
            (Ink::Train, Swatch::Line, "training"),
            (Ink::Validation, Swatch::Line, "validation"),
            (Ink::Mark, Swatch::Circle, "best epoch"),
        ];
        let area = legend(area, 84, &entries)?;
        let x = Axis::linear(0.0..epochs.saturating_sub(1) as f64, 10, "epoch");
        let label = format!("mean square error [{}²]", report.units.effort);
        let panel = Panel::new(&area, x, Axis::logarithmic(range.start / 1.15..range.end * 1.15, label), 0)?;
        let (chosen, others): (Vec<_>, Vec<_>) = report.training.iter().partition(|curve| curve.chosen);
        for (curves, width, opacity) in [(others, 1.0, 0.35), (chosen, 2.2, 1.0)] {
            for curve in curves {
                panel.line(line(&curve.train), Ink::Train, width, opacity)?;
                panel.line(line(&curve.validation), Ink::Validation, width, opacity)?;
                if let Some(best) = best(curve).filter(|_| curve.chosen) {
                    panel.ring(best, Ink::Mark)?;
                }
            }
        }
        Ok(())
    })?;
    let caption = "One pair of lines for each seed, the chosen seed in full colour; training stops when the validation error \
                   no longer falls, and the weights of the best epoch are kept.";
    Ok(Some(Figure { name: "training", title: "Training", caption: caption.into(), wide: true, svg }))
}

/// The epochs with their errors, thinned; an error that has no logarithm is left out.
fn line(errors: &[f64]) -> impl Iterator<Item = (f64, f64)> {
    let every = errors.len().div_ceil(LINE_POINTS).max(1);
    let kept = move |epoch: &usize| *epoch < LINE_POINTS / 4 || epoch.is_multiple_of(every);
    (0..errors.len())
        .filter(kept)
        .filter(|&epoch| errors[epoch].is_finite() && errors[epoch] > 0.0)
        .map(|epoch| (epoch as f64, errors[epoch]))
}

fn best(curve: &TrainingCurve) -> Option<(f64, f64)> {
    let error = *curve.validation.get(curve.best_epoch)?;
    (error.is_finite() && error > 0.0).then_some((curve.best_epoch as f64, error))
}
