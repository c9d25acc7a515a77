//! The fleet on one page: a map of what the reference leaves unexplained, by joint and day, and the reasons.

use ::fleet::finding::{Day, Finding, Kind};
use ::fleet::night::Night;
use maud::{Markup, html};
use report::html::document;
use std::collections::BTreeSet;

/// Part of the torque that is unexplained at which the map's colour is full.
const FULL: f64 = 0.3;

/// The page; a pure function of its arguments.
pub fn page(findings: &[Finding], night: &Night) -> String {
    let days: BTreeSet<&str> = findings.iter().flat_map(|joint| &joint.days).map(|day| day.day.as_str()).collect();
    let worst: Vec<&Finding> = findings.iter().filter(|joint| joint.kind != Kind::Healthy).collect();
    let bad: Vec<_> = night.entries.iter().filter(|entry| !entry.defect.is_empty()).collect();
    let class = if worst.is_empty() { "verdict good" } else { "verdict bad" };
    let body = html! {
        header { h1 { "Fleet of " (findings.len()) " joints" } }
        p class=(class) { (worst.len()) " of " (findings.len()) " joints have a finding" }
        main {
            section { h2 { "Findings" } (reasons(&worst)) }
            section {
                h2 { "Torque that the reference leaves unexplained" }
                p { "% of the day's torque (RMS), with the parameters of the first days. –: not enough motion; ×: bad partition." }
                div.scroll { (map(findings, &days)) }
            }
            @if !bad.is_empty() || !night.misplaced.is_empty() {
                section {
                    h2 { "Left out" }
                    ul {
                        @for entry in &bad { li { "joint=" (entry.joint) "/day=" (entry.day) ": " (entry.defect) } }
                        @for place in &night.misplaced { li { (place.path.display()) ": " (place.reason) } }
                    }
                }
            }
        }
    };
    document("Fleet", &body)
}

fn reasons(worst: &[&Finding]) -> Markup {
    html! {
        table {
            thead { tr { th { "joint" } th { "finding" } th { "since" } th { "reason" } } }
            tbody {
                @for joint in worst {
                    tr { td { (joint.joint) } td { (joint.kind.words()) } td { (joint.since.as_deref().unwrap_or("–")) } td { (joint.reason) } }
                }
            }
        }
    }
}

fn map(findings: &[Finding], days: &BTreeSet<&str>) -> Markup {
    html! {
        table {
            thead { tr { th { "joint" } @for day in days { th.number { (day) } } } }
            tbody {
                @for joint in findings {
                    tr {
                        td { (joint.joint) }
                        @for day in days { (cell(joint.days.iter().find(|own| own.day == **day))) }
                    }
                }
            }
        }
    }
}

fn cell(day: Option<&Day>) -> Markup {
    match day {
        None => html! { td {} },
        Some(day) if !day.defect.is_empty() => html! { td.number title=(day.defect) { "×" } },
        Some(Day { unexplained: Some(part), .. }) => {
            let share = (100.0 * part / FULL).clamp(0.0, 100.0).round();
            let style = format!("background:color-mix(in srgb,var(--bad) {share}%,transparent)");
            html! { td.number style=(style) { (format!("{:.1}", 100.0 * part)) } }
        }
        Some(_) => html! { td.number { "–" } },
    }
}
