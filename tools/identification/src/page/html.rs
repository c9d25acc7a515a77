//! The report as one page that needs nothing but itself; host.

use super::choice;
use super::summary::{headline, verdict};
use super::{NetworkOutcome, Report, tables};
use maud::{Markup, html};
use report::figures::Figure;
use report::html::{document, gallery};
use report::number::{count, percent, significant};

/// One part of the page: anchor, heading, contents.
struct Section {
    anchor: &'static str,
    heading: &'static str,
    contents: Markup,
}

/// The whole page.
pub fn page(report: &Report, figures: &[Figure]) -> String {
    let sections: Vec<Section> = sections(report, figures).into_iter().flatten().collect();
    let verdict = verdict(report);
    let body = html! {
        header {
            h1 { (report.title) }
            p.subtitle {
                "Data set " b { (report.data_set) }
                @if !report.provenance.created.is_empty() { " · " (report.provenance.created) }
            }
        }
        p class=(if verdict.good { "verdict good" } else { "verdict bad" }) { (verdict.sentence) }
        (cards(report))
        nav aria-label="Contents" {
            ol { @for section in &sections { li { a href={ "#" (section.anchor) } { (section.heading) } } } }
        }
        main {
            @for section in &sections {
                section id=(section.anchor) { h2 { (section.heading) } (section.contents) }
            }
        }
        footer { "Made by jointctl " (report.provenance.tool_version) ". All numbers: report.json. All figures: figures/*.svg." }
    };
    document(&report.title, &body)
}

fn sections(report: &Report, figures: &[Figure]) -> Vec<Option<Section>> {
    let section =
        |there: bool, anchor, heading, contents: Markup| there.then_some(Section { anchor, heading, contents });
    let pick =
        |names: &[&str]| -> Vec<&Figure> { figures.iter().filter(|figure| names.contains(&figure.name)).collect() };
    let models = pick(&["friction-velocity", "effort-time", "predicted-measured", "motion-states"]);
    let left = pick(&["error-histogram", "error-velocity", "error-position", "error-temperature"]);
    vec![
        section(!report.warnings.is_empty(), "warnings", "Warnings", tables::warnings(report)),
        section(!report.errors.is_empty(), "errors", "Errors on test data", tables::errors(report)),
        section(!models.is_empty(), "prediction", "Measured and predicted", gallery(&models)),
        section(!left.is_empty(), "left", "What is left unexplained", gallery(&left)),
        section(!report.parameters.is_empty(), "parameters", "Identified parameters", tables::parameters(report)),
        section(
            !report.candidates.is_empty(),
            "selection",
            "Model selection",
            html! { (choice::choice(report)) (tables::candidates(report)) (gallery(&pick(&["candidates"]))) },
        ),
        section(
            !report.training.is_empty(),
            "network",
            "Training of the network",
            html! { (tables::training(report)) (gallery(&pick(&["training"]))) },
        ),
        section(!report.certificate.is_empty(), "certificate", "Certificate", tables::certificate(report)),
        section(!report.stages.is_empty(), "data", "What was done to the data", tables::stages(report)),
        section(true, "provenance", "Provenance", tables::provenance(report)),
    ]
}

/// The numbers that one looks for first.
fn cards(report: &Report) -> Markup {
    let unit = &report.units.effort;
    let mut cards: Vec<(&str, String, String)> = Vec::new();
    if let Some(headline) = headline(report) {
        cards.push((
            "RMSE on test data",
            format!("{} {unit}", significant(headline.after.rmse, 4)),
            format!("was {} {unit}", significant(headline.before.rmse, 4)),
        ));
        let of_rms = |p| format!("{} %", percent(p));
        cards.push((
            "of the effort's RMS",
            of_rms(headline.after.percent_of_rms),
            format!("was {}", of_rms(headline.before.percent_of_rms)),
        ));
        if let Some((worst, set)) = headline.worst_torque_error {
            cards.push(("torque error, worst test set", format!("{} %", percent(Some(worst))), set.to_owned()));
        }
        cards.push(("test samples", count(headline.samples as u64), format!("{} test sets", report.errors.len())));
    }
    let network = match report.network {
        NetworkOutcome::Kept => "kept",
        NetworkOutcome::Rejected { .. } => "rejected",
        NetworkOutcome::NotTrained => "not trained",
    };
    let kept = report.candidates.iter().find(|candidate| candidate.kept);
    cards.push(("network", network.into(), kept.map_or_else(String::new, |kept| format!("model: {}", kept.model))));
    if let Some(fixed) = &report.fixed_point {
        cards.push((
            "fixed point against float",
            format!("{} %", significant(fixed.max_percent_of_full_scale, 2)),
            format!("of full scale at most, {} {unit} RMS", significant(fixed.rms, 3)),
        ));
    }
    if !report.certificate.is_empty() {
        let passed = report.certificate.iter().filter(|item| item.passed).count();
        let all = report.certificate.len();
        let word = if passed == all { "passed" } else { "failed" };
        cards.push(("certificate", word.into(), format!("{passed} of {all} proofs")));
    }
    html! {
        div.cards {
            @for (name, value, note) in &cards {
                div.card { div.name { (name) } div.value { (value) } div.note { (note) } }
            }
        }
    }
}
