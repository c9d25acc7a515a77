//! The figures of the report, each one function from the report to one drawing; host.

mod bars;
mod friction;
mod residuals;
mod time;
mod training;

use super::Report;
use report::figures::{Figure, FigureError};

/// All figures for which the report has data, in the order in which they are read.
///
/// # Errors
/// [`FigureError`].
pub fn figures(report: &Report) -> Result<Vec<Figure>, FigureError> {
    let drawn = [
        friction::against_velocity(report)?,
        time::measured_and_predicted(report)?,
        residuals::histogram(report)?,
        friction::predicted_against_measured(report)?,
        residuals::against_velocity(report)?,
        residuals::against_position(report)?,
        residuals::against_temperature(report)?,
        bars::motion_states(report)?,
        bars::candidates(report)?,
        training::curves(report)?,
    ];
    Ok(drawn.into_iter().flatten().collect())
}
