//! The report in one sentence, from the first test set: what compensation removes of the error that the rigid body
//! leaves, or why nothing can be said; host.

use super::number::{percent, significant};
use super::{NetworkOutcome, Report, Role};
use serde::Serialize;

/// The result in one sentence.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Verdict {
    /// The sentence, with a full stop.
    pub sentence: String,
    /// The compensation lowers the error on test data, and the certificate (where there is one) passed.
    pub good: bool,
}

/// Judges the report by its first test set.
pub fn verdict(report: &Report) -> Verdict {
    let unit = &report.units.effort;
    let errors = report.errors.first().and_then(|table| {
        let before = table.row(Role::Nothing)?.errors.overall.as_ref()?;
        let after = table.compensated()?.errors.overall.as_ref()?;
        Some((before.rmse, after.rmse))
    });
    let Some((before, after)) = errors else {
        return Verdict { sentence: "Nothing was judged: there are no test samples.".into(), good: false };
    };
    let change = format!("{} → {} {unit} RMSE on test data", significant(before, 4), significant(after, 4));
    let better = after < before;
    let mut sentence = if better {
        let removed = percent(Some(100.0 * (1.0 - after / before)));
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
    let failed = report.certificate.iter().filter(|item| !item.passed).count();
    if failed > 0 {
        sentence
            .push_str(&format!(" The image must not be used: {failed} of {} proofs failed.", report.certificate.len()));
    }
    Verdict { sentence, good: better && failed == 0 }
}
