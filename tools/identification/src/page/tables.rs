//! The tables of the page; host.

use super::{ErrorRow, ErrorTable, NetworkOutcome, Report, Role};
use crate::metrics::Metrics;
use maud::{Markup, html};
use report::number::{NONE, count, optional, percent, significant, with_error};

/// A table that scrolls by itself on narrow screens; the first `text_columns` columns are text, the others numbers.
fn table(heading: &[&str], text_columns: usize, rows: &[(Option<&'static str>, Vec<Markup>)], caption: &str) -> Markup {
    let align = |column: usize| (column >= text_columns).then_some("number");
    html! {
        p.caption { (caption) }
        div.scroll {
            table {
                thead { tr { @for (column, name) in heading.iter().enumerate() { th scope="col" class=[align(column)] { (name) } } } }
                tbody {
                    @for (class, cells) in rows {
                        tr class=[class] { @for (column, cell) in cells.iter().enumerate() { td class=[align(column)] { (cell) } } }
                    }
                }
            }
        }
    }
}

fn text(value: impl AsRef<str>) -> Markup {
    html! { (value.as_ref()) }
}

/// Tables for each test set: all metrics overall, then RMSE and relative torque error per motion state, then fixed
/// point.
pub fn errors(report: &Report) -> Markup {
    let unit = &report.units.effort;
    html! {
        @for set in &report.errors {
            @if report.errors.len() > 1 { h3 { "Test set " (set.test_set) } }
            (overall(set, unit))
            (per_state(set, &format!("RMSE in {unit} (and in % of the RMS of the state's effort) in each motion state."), |e| {
                format!("{} ({})", significant(e.rmse, 4), percent(e.percent_of_rms))
            }))
            (per_state(set, "Relative torque error (001, eq. 11) in % in each motion state.", |e| percent(e.relative_torque_error)))
        }
        @if let Some(fixed) = &report.fixed_point {
            p {
                "Fixed-point arithmetic differs from the same model in floating point by " (significant(fixed.rms, 3)) " " (unit)
                " RMS and by " (significant(fixed.max, 3)) " " (unit) " at most, which is "
                (significant(fixed.max_percent_of_full_scale, 2)) " % of the largest friction estimate."
            }
        }
    }
}

fn row_class(row: &ErrorRow, set: &ErrorTable) -> Option<&'static str> {
    let decides = set.compensated().is_some_and(|chosen| std::ptr::eq(chosen, row));
    match row.role {
        _ if decides => Some("kept"),
        Role::Preset | Role::Reference | Role::OtherMotion => Some("aside"),
        _ => None,
    }
}

fn overall(set: &ErrorTable, unit: &str) -> Markup {
    let heading = [
        "model",
        &format!("RMSE [{unit}]"),
        "% of RMS",
        "R²",
        &format!("MAE [{unit}]"),
        &format!("MSE [{unit}²]"),
        &format!("largest [{unit}]"),
        "torque error [%]",
        "001 eq. 11 [%]",
        "left out",
        "samples",
    ];
    let rows: Vec<_> = set
        .rows
        .iter()
        .map(|row| {
            let errors = row.errors.overall.as_ref();
            let four = |value: fn(&Metrics) -> f64| text(optional(errors.map(value)));
            let cells = vec![
                text(&row.model),
                four(|e| e.rmse),
                text(percent(errors.and_then(|e| e.percent_of_rms))),
                text(errors.and_then(|e| e.r2).map_or_else(|| NONE.to_owned(), |r2| format!("{r2:.4}"))),
                four(|e| e.mae),
                four(|e| e.mse),
                four(|e| e.max_error),
                text(percent(row.torque_error)),
                text(percent(errors.and_then(|e| e.relative_torque_error))),
                text(count(errors.map_or(0, |e| e.relative_excluded as u64))),
                text(count(errors.map_or(0, |e| e.samples as u64))),
            ];
            (row_class(row, set), cells)
        })
        .collect();
    let floor = set.rows.iter().find_map(|row| row.errors.overall.as_ref()).map(|errors| errors.relative_floor);
    let caption = format!(
        "Errors of the effort that each model predicts, all test samples. The highlighted row is what the joint would run. \
         Torque error: what does not arrive below 20 Hz, in % of what the rigid body leaves there. \
         \"image, joint's observer\" sees the recorded motion through the joint's own observer, which knows nothing of the future. \
         The relative torque error of 001, eq. 11, leaves out samples with less than {} {unit} of measured effort (how many: left out).",
        optional(floor)
    );
    table(&heading, 1, &rows, &caption)
}

fn per_state(set: &ErrorTable, caption: &str, cell: impl Fn(&Metrics) -> String) -> Markup {
    let Some(first) = set.rows.first() else { return html! {} };
    let heading: Vec<&str> = ["model"].into_iter().chain(first.errors.named().map(|(name, _)| name)).collect();
    let rows: Vec<_> = set
        .rows
        .iter()
        .map(|row| {
            let values = row.errors.named().map(|(_, errors)| text(errors.as_ref().map_or(NONE.to_owned(), &cell)));
            (row_class(row, set), [text(&row.model)].into_iter().chain(values).collect())
        })
        .collect();
    html! { div.states { (table(&heading, 1, &rows, caption)) } }
}

/// Physical parameters with their standard errors.
pub fn parameters(report: &Report) -> Markup {
    let truth = report.parameters.iter().any(|p| p.truth.is_some());
    let rows: Vec<_> = report
        .parameters
        .iter()
        .map(|p| {
            let relative = p.standard_error.filter(|_| p.value != 0.0).map(|error| 100.0 * (error / p.value).abs());
            let note = if p.at_bound { "at bound" } else { "" };
            let (value, error) = with_error(p.value, p.standard_error);
            let (letter, index) = p.symbol.split_once('_').unwrap_or((&p.symbol, ""));
            let mut cells = vec![
                text(&p.name),
                html! { i { (letter) sub { (index) } } },
                text(&p.unit),
                text(note),
                text(value),
                text(error),
                text(percent(relative)),
            ];
            if truth {
                cells.push(text(optional(p.truth)));
            }
            (p.at_bound.then_some("warn"), cells)
        })
        .collect();
    let mut heading = vec!["parameter", "symbol", "unit", "note", "value", "standard error", "of value [%]"];
    if truth {
        heading.push("truth");
    }
    let caption = "A standard error above some 30 % of the value means that the data hardly determine the parameter; \
                   a value at its bound would like to go further.";
    table(&heading, 4, &rows, caption)
}

/// The models that were compared, with the reason for each decision.
pub fn candidates(report: &Report) -> Markup {
    let rows: Vec<_> = report
        .candidates
        .iter()
        .map(|c| {
            let kept = if c.kept { "kept" } else { "" };
            let cells = vec![
                text(&c.model),
                text(kept),
                text(&c.reason),
                text(c.parameters.to_string()),
                text(significant(c.unseen_rmse, 4)),
            ];
            (c.kept.then_some("kept"), cells)
        })
        .collect();
    let heading = ["model", "", "why", "parameters", &format!("RMSE on left-out motions [{}]", report.units.effort)];
    let caption = "Models by their error on motions that each of them was not fitted to.";
    table(&heading, 3, &rows, caption)
}

/// One row for each seed, and what became of the network.
pub fn training(report: &Report) -> Markup {
    let rows: Vec<_> = report
        .training
        .iter()
        .map(|c| {
            let at_best = |errors: &[f64]| text(optional(errors.get(c.best_epoch).copied()));
            let cells = vec![
                text(if c.chosen { "chosen" } else { "" }),
                text(&c.stop),
                text(c.seed.to_string()),
                text(c.train.len().saturating_sub(1).to_string()),
                text(c.best_epoch.to_string()),
                at_best(&c.train),
                at_best(&c.validation),
            ];
            (c.chosen.then_some("kept"), cells)
        })
        .collect();
    let unit = &report.units.effort;
    let heading = [
        "",
        "stopped because",
        "seed",
        "epochs",
        "best epoch",
        &format!("training MSE [{unit}²]"),
        &format!("validation MSE [{unit}²]"),
    ];
    html! {
        @if let NetworkOutcome::Rejected { reason } = &report.network { p { "The network was rejected: " (reason) "." } }
        (table(&heading, 2, &rows, "Each seed starts from other weights; the one with the lowest validation error is chosen."))
    }
}

/// Every proof with its limit.
pub fn certificate(report: &Report) -> Markup {
    let rows: Vec<_> = report
        .certificate
        .iter()
        .map(|item| {
            let cells = vec![
                text(&item.name),
                text(&item.unit),
                text(if item.passed { "passed" } else { "failed" }),
                text(optional(item.worst_found)),
                text(significant(item.value, 4)),
                text(significant(item.limit, 4)),
            ];
            ((!item.passed).then_some("bad"), cells)
        })
        .collect();
    let heading = ["property", "unit", "result", "worst found", "proven bound", "limit"];
    let caption = "The proven bound must not exceed the limit; the worst value that a search found must not exceed the proven bound.";
    table(&heading, 3, &rows, caption)
}

/// Suspected defects of the data, one line each.
pub fn warnings(report: &Report) -> Markup {
    let rows: Vec<_> = report
        .warnings
        .iter()
        .map(|w| (Some("warn"), vec![text(w.check), text(&w.column), text(&w.rows), text(&w.finding), text(&w.remedy)]))
        .collect();
    let heading = ["check", "column", "rows", "finding", "remedy"];
    table(
        &heading,
        heading.len(),
        &rows,
        "Suspected defects of the data: look at them before you trust a number of this page.",
    )
}

/// Table of what each stage did to the samples.
pub fn stages(report: &Report) -> Markup {
    let rows: Vec<_> = report
        .stages
        .iter()
        .map(|stage| {
            let counts = html! {
                @for (place, (name, value)) in stage.counts.iter().enumerate() {
                    @if place > 0 { " · " }
                    span.pair { (name) " " b { (count(*value)) } }
                }
            };
            (None, vec![text(&stage.stage), text(&stage.note), counts])
        })
        .collect();
    table(
        &["stage", "what it did", "samples"],
        3,
        &rows,
        "The stages in order, with the number of samples that each one touched.",
    )
}

/// Version, data, options, seed.
pub fn provenance(report: &Report) -> Markup {
    let made = &report.provenance;
    let fixed = [
        ("jointctl", made.tool_version.clone()),
        ("description", made.description.clone()),
        ("data SHA-256", made.data_sha256.clone()),
        ("seed", made.seed.to_string()),
        ("created", made.created.clone()),
    ];
    html! {
        dl {
            @for (name, value) in &fixed { dt { (name) } dd { code { (value) } } }
            @for (name, value) in &made.options { dt { (name) } dd { code { (value) } } }
        }
    }
}
