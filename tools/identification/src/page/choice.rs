//! Choice of the model, as a section of the page: the folds with the errors there, the steps, and what was overruled;
//! host.

use super::{Choice, Report};
use maud::{Markup, html};
use report::number::significant;

/// The grouping, the errors of the physical models on each fold, and every step.
pub fn choice(report: &Report) -> Markup {
    let Choice { grouping, motions, models, folds, terms, notes, overruled } = &report.choice;
    html! {
        @if !grouping.is_empty() { p { "Chosen by " (grouping) "." } }
        @if !motions && !folds.is_empty() {
            p { strong { "The recording has one motion: the errors below say nothing about other motions." } }
        }
        @for rule in overruled { p { strong { "Overruled: " (rule) "." } } }
        @if !folds.is_empty() {
            div.scroll {
                table {
                    thead { tr { th { "left out" } @for model in models { th { (model) } } } }
                    tbody {
                        @for fold in folds {
                            tr {
                                td { (fold.left_out) }
                                @for error in &fold.errors { td { (significant(*error, 4)) } }
                            }
                        }
                    }
                }
            }
        }
        @if !terms.is_empty() { p { "Terms of the chosen model: " (terms.join(", ")) "." } }
        @if let Some(uncertainty) = &report.uncertainty { p { (uncertainty.sentence()) "." } }
        @if !notes.is_empty() { ul { @for note in notes { li { (note) } } } }
    }
}
