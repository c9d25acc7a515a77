//! Results of a commissioning, as a page and as text.

use super::estimate::Estimate;
use super::{Found, Stage};
use crate::remote::Entry;
use joint_firmware::objects::settings::Setting;
use maud::{Markup, html};
use report::figures::{Curve, FigureError, Ink, Plot, over_time};
use report::html::{document, gallery};
use report::output::OutputFile;
use std::fmt::Write as _;

/// The page's and the text's names.
const PAGE: &str = "commission.html";
const TEXT: &str = "commission.toml";
/// Files of a commissioning.
pub const FILES: [&str; 2] = [PAGE, TEXT];

/// Page and text of what was found on a node.
///
/// # Errors
/// [`FigureError`].
pub fn files(found: &Found, node: u8) -> Result<Vec<OutputFile>, FigureError> {
    Ok(vec![OutputFile::new(PAGE, page(found, node)?), OutputFile::new(TEXT, text(found, node))])
}

/// Settings by their objects.
fn sorted(found: &Found) -> Vec<(Setting, f64)> {
    let mut settings = found.settings.clone();
    settings.sort_by_key(|(setting, _)| {
        let entry = Entry::of_setting(*setting);
        (entry.object.index, entry.object.sub_index)
    });
    settings
}

/// The same as [`text`] as a JSON object; where nothing was measured of a setting its standard error is null.
pub fn json(found: &Found, node: u8) -> serde_json::Value {
    let settings = sorted(found).into_iter().map(|(setting, value)| {
        let entry = Entry::of_setting(setting);
        let error = estimate(found, setting).map(|estimate| estimate.error);
        let value = serde_json::json!({ "value": value, "unit": entry.text.unit, "standard_error": error });
        (entry.full_name(), value)
    });
    serde_json::json!({ "node": node, "settings": settings.collect::<serde_json::Map<_, _>>() })
}

/// The settings that the joint took, each with its unit and what was measured of it.
pub fn text(found: &Found, node: u8) -> String {
    let mut text = format!(
        "# Settings of node {node} by `jointctl commission`, by the names of docs/objects.md.\n\
         # `jointctl set NAME VALUE ...` gives them to another joint of the same kind; its electrical zero is its own.\n"
    );
    let mut record = "";
    for (setting, value) in sorted(found) {
        let entry = Entry::of_setting(setting);
        if entry.text.object != record {
            record = entry.text.object;
            let _ = write!(text, "\n[{}]\n", crate::remote::entry::slug(record));
        }
        let measured = estimate(found, setting).map_or_else(String::new, |estimate| {
            format!(", standard error {}", report::number::significant(estimate.error, 2))
        });
        let unit = entry.text.unit;
        let name = crate::remote::entry::slug(entry.text.name);
        let _ = writeln!(text, "{name} = {value} # {}{measured}", if unit.is_empty() { "no unit" } else { unit });
    }
    text
}

/// Measured estimate of a setting.
fn estimate(found: &Found, setting: Setting) -> Option<Estimate> {
    Some(match setting {
        Setting::Resistance => found.resistance.at_25(),
        Setting::InductanceD => found.inductance.d,
        Setting::InductanceQ => found.inductance.q,
        Setting::ElectricalZero => found.alignment.zero,
        _ => return None,
    })
}

fn page(found: &Found, node: u8) -> Result<String, FigureError> {
    let title = format!("Commissioning of node {node}");
    let mut figures = Vec::new();
    if let Some(turned) = &found.turned {
        let points = |of: usize| turned.samples.iter().map(|sample| (sample[0], sample[of])).collect::<Vec<_>>();
        let (velocity, torque) = (points(1), points(2));
        let plots = [
            Plot {
                label: "velocity [rad/s]",
                curves: vec![Curve { name: "measured", ink: Ink::Measured, points: velocity }],
            },
            Plot { label: "torque [Nm]", curves: vec![Curve { name: "measured", ink: Ink::Measured, points: torque }] },
        ];
        let caption =
            format!("The joint in velocity mode at {:.3} rad/s there and back, with what was found.", turned.wanted);
        figures.push(over_time("turning", "The motor turns", &caption, &plots)?);
    }
    let verdict = match &found.turned {
        Some(_) => "The motor turns with what was found; settings are in use and stored.",
        None => "Settings are in use and stored. The motor has not been turned with them.",
    };
    let condition = &found.checked.condition;
    let pictures = figures.iter().collect::<Vec<_>>();
    let body = html! {
        header { h1 { (title) } }
        p class="verdict good" { (verdict) }
        main {
            section { h2 { "What was found" } (measured(found)) }
            @if !pictures.is_empty() { section { h2 { "Proof" } (gallery(&pictures)) } }
            section { h2 { "Resistance: voltage over current" } (points(found)) }
            section { h2 { "Electrical zero, turn by turn" } (scatter(found)) }
            section { h2 { "What the joint took" } pre { (text(found, node)) } }
            section {
                h2 { "Before" }
                p {
                    "Supply " (format!("{:.2}", condition.supply)) " V, winding " (format!("{:.1}", condition.winding)) " °C, bridge "
                    (format!("{:.1}", condition.bridge)) " °C, control rate " (format!("{:.0}", found.checked.rate)) " Hz, state: "
                    (condition.state) "."
                }
            }
        }
        footer { "Made by jointctl " (env!("CARGO_PKG_VERSION")) ". Formulas: docs/commissioning.md. Settings: commission.toml." }
    };
    Ok(document(&title, &body))
}

fn measured(found: &Found) -> Markup {
    let alignment = &found.alignment;
    let number = |estimate: Estimate, scale: f64, digits: usize| {
        format!("{:.digits$} ± {:.digits$}", scale * estimate.value, scale * estimate.error)
    };
    let mut rows: Vec<(&str, String, &str, &str)> = vec![
        ("resistance, now", number(found.resistance.resistance, 1e3, 2), "mΩ", "slope of voltage over current"),
        ("resistance at 25 °C", number(found.resistance.at_25(), 1e3, 2), "mΩ", "the same, by copper's 0.393 %/K"),
        ("lost by a leg", number(found.resistance.lost, 1e3, 1), "mV", "intercept of that line"),
        (
            "inductance d",
            number(found.inductance.d, 1e6, 2),
            "µH",
            "answer to an eighth of the control rate, along the magnet",
        ),
        ("inductance q", number(found.inductance.q, 1e6, 2), "µH", "the same across the magnet"),
        (
            "pole pairs",
            format!("{} ({:.4})", alignment.pole_pairs, alignment.ratio),
            "",
            "turns of the field over turns of the encoder",
        ),
        (
            "encoder",
            if alignment.reversed { "counts down" } else { "counts up" }.into(),
            "",
            "while the field turns forward",
        ),
        ("electrical zero", number(alignment.zero, 360.0, 2), "°", "mean of there and back, turn by turn"),
        (
            "with less current",
            format!("{:+.2}", 360.0 * alignment.difference),
            "°",
            "the same turns again; 8° are too much",
        ),
        (
            "lag of the rotor",
            format!("{:.2}", 360.0 * alignment.lag),
            "°",
            "half the difference of there and back; 60° are too much",
        ),
        ("flux linkage", number(alignment.flux, 1e3, 3), "mVs", "back-EMF across the field"),
        (
            "torque constant by it",
            number(alignment.torque_constant(), 1.0, 5),
            "Nm/A",
            "3/2 pole pairs × flux linkage; uncertain by what dead time may hide",
        ),
    ];
    if let Some(index) = &found.index {
        rows.push((
            "index met after",
            format!("{:.3}", index.turns),
            "turns of the rotor",
            if index.back { "on the way back" } else { "on the way there" },
        ));
    }
    if let Some(load) = &found.load {
        rows.push((
            "known load",
            format!("{:.4} of {:.4}", load.measured.value, load.known),
            "Nm",
            "held still, from both sides",
        ));
        rows.push(("torque constant by it", format!("{:.5}", load.torque_constant), "Nm/A", "with which both agree"));
    }
    if let Some(inertia) = &found.inertia {
        rows.push((
            "known inertia",
            format!("{} of {:.5}", number(inertia.measured, 1.0, 5), inertia.known),
            "kg m²",
            "work over the way, both directions",
        ));
        rows.push((
            "torque constant by it",
            format!("{:.5}", inertia.torque_constant),
            "Nm/A",
            "with which both agree",
        ));
    }
    html! {
        div.scroll { table {
            thead { tr { th { "what" } th.number { "value" } th { "unit" } th { "by" } } }
            tbody { @for (what, value, unit, by) in &rows { tr { td { (what) } td.number { (value) } td { (unit) } td { (by) } } } }
        } }
    }
}

fn points(found: &Found) -> Markup {
    let resistance = &found.resistance;
    let line = |current: f64| {
        let lost = resistance.lost.value * 4.0 / 3.0;
        resistance.resistance.value * current + lost
    };
    html! {
        div.scroll { table {
            thead { tr { th.number { "current, A" } th.number { "voltage, V" } th.number { "off the line, mV" } } }
            tbody { @for (current, voltage) in &resistance.points { tr {
                td.number { (format!("{current:.4}")) }
                td.number { (format!("{voltage:.4}")) }
                td.number { (format!("{:+.2}", 1e3 * (voltage - line(*current)))) }
            } } }
        } }
    }
}

fn scatter(found: &Found) -> Markup {
    let (turns, speed) = found.alignment.swept;
    html! {
        p { (turns) " electrical turns there and back at " (format!("{speed:.2}")) " turns/s; the rotor made " (format!("{:.3}", found.alignment.turned)) " turns each way." }
        div.scroll { table {
            thead { tr { th.number { "electrical turn" } th.number { "off the mean, °" } } }
            tbody { @for (turn, off) in found.alignment.scatter.iter().enumerate() { tr {
                td.number { (turn + 1) } td.number { (format!("{:+.2}", 360.0 * off)) }
            } } }
        } }
    }
}

/// A line for each stage that is under current: what stands in the terminal.
pub fn headline(stage: Stage) -> String {
    let under = if Stage::UNDER_CURRENT.contains(&stage) { "  [under current]" } else { "" };
    format!("{}{under}", stage.name())
}
