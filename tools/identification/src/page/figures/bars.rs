//! Comparisons as bars: RMSE in each motion state, and the candidates' validation error; host.

use crate::page::{ErrorRow, Report, Role};
use report::figures::axis::Axis;
use report::figures::chart::{Panel, Swatch, legend, paper};
use report::figures::{Figure, FigureError, Ink};
use report::number::significant;

/// Share of the distance between two groups that bars take.
const GROUP_WIDTH: f64 = 0.78;

/// RMSE of the first test set: a group for each motion state, a bar for each step of compensation.
pub fn motion_states(report: &Report) -> Result<Option<Figure>, FigureError> {
    let Some(table) = report.errors.first() else { return Ok(None) };
    let steps = [
        (Role::Nothing, Ink::Nothing, "nothing"),
        (Role::Physical, Ink::Physical, "physical"),
        (Role::PhysicalAndNetwork, Ink::Network, "physical + network"),
    ];
    let rows: Vec<(Ink, &str, &ErrorRow)> =
        steps.into_iter().filter_map(|(role, ink, name)| table.row(role).map(|row| (ink, name, row))).collect();
    let rmse = |row: &ErrorRow| row.errors.named().map(|(_, errors)| errors.as_ref().map(|e| e.rmse));
    let highest = rows.iter().flat_map(|(_, _, row)| rmse(row)).flatten().filter(|v| v.is_finite()).fold(0.0, f64::max);
    let Some((_, _, first)) = rows.first() else { return Ok(None) };
    let states = first.errors.named().map(|(name, _)| name);
    let svg = paper(530, 430, |area| {
        let entries: Vec<_> = rows.iter().map(|(ink, name, _)| (*ink, Swatch::Area(1.0), *name)).collect();
        let area = legend(area, 30, &entries)?;
        let y = Axis::linear(0.0..highest * 1.08, 6, format!("RMSE [{}]", report.units.effort));
        let panel = Panel::new(&area, Axis::names(states, "motion state"), y, 0)?;
        let width = GROUP_WIDTH / rows.len() as f64;
        for (place, (ink, _, row)) in rows.iter().enumerate() {
            for (state, value) in rmse(row).into_iter().enumerate() {
                let Some(value) = value.filter(|value| value.is_finite()) else { continue };
                let from = state as f64 - GROUP_WIDTH / 2.0 + place as f64 * width;
                panel.bar([(from, 0.0), (from + 0.92 * width, value)], *ink, 1.0)?;
            }
        }
        Ok(())
    })?;
    let caption = "RMSE on test data in each motion state: every step should be lower than the one before it; a state \
                   without bars has no samples.";
    Ok(Some(Figure {
        name: "motion-states",
        title: "Error in each motion state",
        caption: caption.into(),
        wide: false,
        svg,
    }))
}

/// RMSE on left-out motions of every candidate, in the order of the report.
pub fn candidates(report: &Report) -> Result<Option<Figure>, FigureError> {
    let shown: Vec<_> = report.candidates.iter().filter(|c| c.unseen_rmse.is_finite()).collect();
    if shown.is_empty() {
        return Ok(None);
    }
    let highest = shown.iter().map(|c| c.unseen_rmse).fold(0.0, f64::max);
    let names: Vec<String> = shown.iter().map(|c| shorten(&c.model, 40)).collect();
    let svg = paper(1080, 110 + 34 * shown.len().max(2) as u32, |area| {
        let area = legend(
            area,
            30,
            &[(Ink::Network, Swatch::Area(1.0), "kept"), (Ink::Measured, Swatch::Area(1.0), "not kept")],
        )?;
        let x = Axis::linear(0.0..highest * 1.1, 8, format!("RMSE on left-out motions [{}]", report.units.effort));
        let panel = Panel::new(&area, x, Axis::names(names.iter().map(String::as_str), "").reversed(), 0)?;
        for (place, candidate) in shown.iter().enumerate() {
            let (place, value) = (place as f64, candidate.unseen_rmse);
            let ink = if candidate.kept { Ink::Network } else { Ink::Measured };
            panel.bar([(0.0, place - 0.34), (value, place + 0.34)], ink, 1.0)?;
            panel.text_beside(&significant(value, 4), (value, place), 6)?;
        }
        Ok(())
    })?;
    let caption = "RMSE on left-out motions of every model that was tried, best first; a more complex model has to earn its place by a \
                   shorter bar.";
    Ok(Some(Figure { name: "candidates", title: "Candidate models", caption: caption.into(), wide: true, svg }))
}

fn shorten(text: &str, letters: usize) -> String {
    if text.chars().count() <= letters {
        return text.to_owned();
    }
    text.chars().take(letters.saturating_sub(1)).chain(['…']).collect()
}
