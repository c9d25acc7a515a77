//! Measured and predicted effort over time, with the error below: a typical stretch of the test data and its worst;
//! host.

use crate::page::{Report, TestSamples};
use report::figures::axis::Axis;
use report::figures::binning::{extent, quantile, widen};
use report::figures::chart::{Area, Entry, Panel, Swatch, heading, legend, paper};
use report::figures::{Figure, FigureError, Ink};
use std::ops::Range;

/// Longest stretch, s. Runs are cut into equal parts no longer than this.
const LONGEST: f64 = 12.0;
/// A longer step than this many usual ones is a gap.
const LONGEST_GAP: f64 = 10.0;
/// Points of one line.
const LINE_POINTS: usize = 1500;
/// Space for the tick labels, so that the panels line up.
const LEFT: i32 = 84;
/// Space below a stretch, in units of the drawing.
const GAP: i32 = 140;

/// A typical stretch and the worst one, by the RMSE of the last model.
pub fn measured_and_predicted(report: &Report) -> Result<Option<Figure>, FigureError> {
    let test = &report.test;
    let stretches = by_error(test);
    let (Some(typical), Some(worst)) = (stretches.get(stretches.len() / 2), stretches.last()) else {
        return Ok(None);
    };
    let mut shown = vec![("Typical stretch", typical)];
    if stretches.len() > 1 {
        shown.push(("Worst stretch", worst));
    }
    let mut entries: Vec<Entry> = vec![
        (Ink::Measured, Swatch::Line, "measured"),
        (Ink::Nothing, Swatch::Line, "rigid body"),
        (Ink::Physical, Swatch::Line, "physical"),
    ];
    if test.network.is_some() {
        entries.push((Ink::Network, Swatch::Line, "physical + network"));
    }
    let svg = paper(1080, 30 + 440 * shown.len() as u32, |area| {
        let area = legend(area, LEFT, &entries)?;
        for (part, (name, stretch)) in area.split_evenly((shown.len(), 1)).iter().zip(&shown) {
            draw(part, report, name, stretch)?;
        }
        Ok(())
    })?;
    let caption = "Above, the effort as measured and as the models predict it; below, what the friction models leave of \
                   it (measured less predicted; mind the scale): the closer to zero, the better. The typical stretch has the \
                   median error of all stretches of the test data, the worst one the largest.";
    Ok(Some(Figure { name: "effort-time", title: "Effort over time", caption: caption.into(), wide: true, svg }))
}

fn draw<'a>(area: &Area<'a>, report: &Report, name: &str, stretch: &Range<usize>) -> Result<(), FigureError> {
    let (test, unit) = (&report.test, &report.units.effort);
    let area = heading(area, LEFT, &format!("{name}: run {}", test.run[stretch.start]))?;
    let area = area.margin(0, GAP, 0, 0);
    let height = area.dim_in_pixel().1 as i32;
    let (upper, lower) = area.split_vertically(height * 52 / 100);
    let every = stretch.len().div_ceil(LINE_POINTS).max(1);
    let shown: Vec<usize> = stretch.clone().step_by(every).collect();
    let time = || extent(shown.iter().map(|&i| test.time[i]));
    let mut models: Vec<(Ink, &[f64])> = vec![(Ink::Nothing, &test.rigid), (Ink::Physical, &test.physical)];
    if let Some(network) = &test.network {
        models.push((Ink::Network, network));
    }

    let values = shown.iter().flat_map(|&i| models.iter().map(move |(_, model)| model[i]).chain([test.effort[i]]));
    let y = Axis::linear(widen(extent(values), 0.06), 5, format!("effort [{unit}]"));
    let panel = Panel::new(&upper, Axis::linear(time(), 12, ""), y, LEFT)?;
    panel.line(shown.iter().map(|&i| (test.time[i], test.effort[i])), Ink::Measured, 3.0, 0.8)?;
    for (ink, model) in &models {
        panel.line(shown.iter().map(|&i| (test.time[i], model[i])), *ink, 1.4, 1.0)?;
    }

    // The rigid body's error, many times larger, is the distance of its line above; here it would press the rest flat.
    let models = &models[1..];
    let left = |model: &[f64], i: usize| test.effort[i] - model[i];
    let values = shown.iter().flat_map(|&i| models.iter().map(move |(_, model)| left(model, i)));
    let y = Axis::linear(widen(extent(values), 0.06), 4, format!("error [{unit}]"));
    let panel = Panel::new(&lower, Axis::linear(time(), 12, "time [s]"), y, LEFT)?;
    panel.line([(time().start, 0.0), (time().end, 0.0)], Ink::Axis, 1.0, 1.0)?;
    for (ink, model) in models {
        panel.line(shown.iter().map(|&i| (test.time[i], left(model, i))), *ink, 1.3, 1.0)?;
    }
    Ok(())
}

/// Stretches of the test data, from the best to the worst predicted one. Scraps (less than half of the longest stretch)
/// are left out: their error says nothing about the model.
fn by_error(test: &TestSamples) -> Vec<Range<usize>> {
    let predicted = test.compensated();
    let rmse = |stretch: &Range<usize>| {
        let squares: f64 = stretch.clone().map(|i| (test.effort[i] - predicted[i]).powi(2)).sum();
        (squares / stretch.len() as f64).sqrt()
    };
    let all = stretches(test);
    let longest = all.iter().map(Range::len).max().unwrap_or(0);
    let mut found: Vec<(f64, Range<usize>)> =
        all.into_iter().filter(|s| 2 * s.len() >= longest).map(|s| (rmse(&s), s)).collect();
    found.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.start.cmp(&b.1.start)));
    found.into_iter().map(|(_, stretch)| stretch).collect()
}

/// Each run cut into equal parts of at most [`LONGEST`] seconds. A run also ends where time goes backwards
/// or jumps: a test set may be made of blocks of one run.
fn stretches(test: &TestSamples) -> Vec<Range<usize>> {
    let mut found = Vec::new();
    let steps: Vec<f64> = test.time.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > 0.0).collect();
    let gap = LONGEST_GAP * quantile(&steps, 0.5);
    let mut start = 0;
    for end in 1..=test.time.len() {
        let ends = end == test.time.len()
            || test.run[end] != test.run[start]
            || !(0.0..=gap).contains(&(test.time[end] - test.time[end - 1]));
        if ends {
            let length = end - start;
            let parts = ((test.time[end - 1] - test.time[start]) / LONGEST).ceil().clamp(1.0, length as f64) as usize;
            found.extend((0..parts).map(|part| start + length * part / parts..start + length * (part + 1) / parts));
            start = end;
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_cut_into_equal_stretches_ranked_by_their_error() {
        let test = TestSamples {
            time: vec![0.0, 4.0, 8.0, 12.0, 16.0, 20.0, 0.0, 4.0, 100.0, 104.0, 0.0],
            run: vec![1, 1, 1, 1, 1, 1, 2, 2, 2, 2, 3],
            effort: vec![3.0, 3.0, 3.0, 1.0, 1.0, 1.0, 2.0, 2.0, 4.0, 4.0, 9.0],
            physical: vec![0.0; 11],
            ..TestSamples::default()
        };
        assert_eq!(stretches(&test), [0..3, 3..6, 6..8, 8..10, 10..11]);
        assert_eq!(by_error(&test), [3..6, 6..8, 0..3, 8..10]);
        assert!(stretches(&TestSamples::default()).is_empty());
    }
}
