//! The report in one sentence, from all test sets: what compensation removes of the error that the rigid body leaves,
//! whether a simpler model of the same table does better, or why nothing can be said; host.

use super::{NetworkOutcome, Report, Role};
use report::number::{percent, significant};
use serde::Serialize;

/// Largest ratio of the error of what the joint would run to that of the best physical model of the same table, on a
/// test set.
const SIMPLER: f64 = 1.02;

/// The result in one sentence.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Verdict {
    /// The sentence, with a full stop.
    pub sentence: String,
    /// `true` if on every test set the compensation lowers the error and no simpler model does better by 2 %, and the
    /// certificate (where there is one) passed.
    pub good: bool,
}

/// Error over all test sets.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pooled {
    /// Root mean square, unit of effort.
    pub rmse: f64,
    /// The same as a share of the effort's RMS, %.
    pub percent_of_rms: Option<f64>,
}

/// Errors that one looks for first.
pub(super) struct Headline<'a> {
    /// Error with the rigid body alone.
    pub before: Pooled,
    /// Error with what the joint would run.
    pub after: Pooled,
    /// Samples of all test sets; those of several count in each.
    pub samples: usize,
    /// Largest torque error of a test set, %, and its name.
    pub worst_torque_error: Option<(f64, &'a str)>,
}

/// The headline, where every test set was judged.
pub(super) fn headline(report: &Report) -> Option<Headline<'_>> {
    let pooled = |before: bool| {
        let (mut squares, mut efforts, mut samples) = (0.0, Some(0.0), 0);
        for table in &report.errors {
            let row = if before { table.row(Role::Nothing)? } else { table.compensated()? };
            let errors = row.errors.overall.as_ref()?;
            let n = errors.samples as f64;
            squares += n * errors.mse;
            let effort = errors.percent_of_rms.filter(|percent| *percent > 0.0).map(|p| n * errors.mse * 1e4 / (p * p));
            efforts = efforts.zip(effort).map(|(sum, effort)| sum + effort);
            samples += errors.samples;
        }
        let percent_of_rms = efforts.filter(|efforts| *efforts > 0.0).map(|efforts| 100.0 * (squares / efforts).sqrt());
        (samples > 0).then(|| (Pooled { rmse: (squares / samples as f64).sqrt(), percent_of_rms }, samples))
    };
    let ((before, _), (after, samples)) = (pooled(true)?, pooled(false)?);
    let torque =
        report.errors.iter().filter_map(|table| Some((table.compensated()?.torque_error?, table.test_set.as_str())));
    let worst_torque_error = torque.max_by(|a, b| a.0.total_cmp(&b.0));
    Some(Headline { before, after, samples, worst_torque_error })
}

/// Judges the report by all test sets.
pub fn verdict(report: &Report) -> Verdict {
    let unit = &report.units.effort;
    let Some(Headline { before, after, .. }) = headline(report) else {
        return Verdict { sentence: "Nothing was judged: there are no test samples.".into(), good: false };
    };
    let change = format!("{} → {} {unit} RMSE on test data", significant(before.rmse, 4), significant(after.rmse, 4));
    let better = after.rmse < before.rmse;
    let mut sentence = if better {
        let removed = percent(Some(100.0 * (1.0 - after.rmse / before.rmse)));
        format!("Compensation removes {removed} % of the effort error that the rigid body leaves: {change}")
    } else {
        format!("Compensation does not help: {change}")
    };
    match &report.network {
        NetworkOutcome::Kept => sentence.push('.'),
        NetworkOutcome::NotTrained => sentence.push_str(", with the physical model alone."),
        NetworkOutcome::Rejected { reason } => {
            sentence.push_str(&format!(", with the physical model alone (the network was rejected: {reason})."));
        }
    }
    let objections = objections(report);
    for objection in &objections {
        sentence.push(' ');
        sentence.push_str(objection);
    }
    let failed = report.certificate.iter().filter(|item| !item.passed).count();
    if failed > 0 {
        sentence
            .push_str(&format!(" The image must not be used: {failed} of {} proofs failed.", report.certificate.len()));
    }
    Verdict { sentence, good: better && objections.is_empty() && failed == 0 }
}

/// The test set on which a simpler model is better by the most, and those on which compensation does not help.
fn objections(report: &Report) -> Vec<String> {
    let unit = &report.units.effort;
    let mut found = Vec::new();
    let mut worst: Option<(f64, String)> = None;
    for table in &report.errors {
        let rmse = |row: Option<&super::ErrorRow>| row.and_then(|row| Some(row.errors.overall.as_ref()?.rmse));
        let Some(after) = rmse(table.compensated()) else { continue };
        if report.errors.len() > 1 && rmse(table.row(Role::Nothing)).is_some_and(|before| after >= before) {
            found.push(format!("It does not help on test set {:?}.", table.test_set));
        }
        let Some((simple, least)) = table.best_simple() else { continue };
        let ratio = after / least;
        if ratio > SIMPLER && worst.as_ref().is_none_or(|(most, _)| ratio > *most) {
            let text = format!(
                "A simpler model is better: on test set {:?} {} has {} {unit}, the image {} {unit}, {ratio:.2} times as much.",
                table.test_set,
                simple.model,
                significant(least, 4),
                significant(after, 4)
            );
            worst = Some((ratio, text));
        }
    }
    found.extend(worst.map(|(_, text)| text));
    found
}
