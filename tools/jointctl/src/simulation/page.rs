//! Simulated scenarios as one page that needs nothing but itself; host.

use super::Log;
use super::table::{HEADING, Line};
use maud::{Markup, html};
use report::figures::{Curve, Figure, FigureError, Ink, Plot, over_time};
use report::html::{document, gallery};

/// Points of one line.
const LINE_POINTS: usize = 2000;

/// One scenario: its name, what it is, and its logs without and, where there was an image, with compensation.
pub struct Shown<'a> {
    /// Name.
    pub name: &'static str,
    /// Logs of the parts without compensation.
    pub off: Vec<&'a Log>,
    /// Logs of the parts with compensation.
    pub on: Vec<&'a Log>,
}

/// The page.
///
/// # Errors
/// [`FigureError`].
pub fn page(title: &str, lines: &[Line], speed: &str, scenarios: &[Shown]) -> Result<String, FigureError> {
    let figures: Vec<Figure> = scenarios.iter().map(figure).collect::<Result<_, _>>()?;
    let figures: Vec<&Figure> = figures.iter().collect();
    let body: Markup = html! {
        header { h1 { (title) } p.subtitle { (speed) } }
        main {
            section {
                h2 { "Without and with compensation" }
                div.scroll { table {
                    thead { tr { @for (column, name) in HEADING.iter().enumerate() { th.number[column > 1] { (name) } } } }
                    tbody { @for line in lines { tr.kept[line.compensated] {
                        @for (column, cell) in line.cells().iter().enumerate() { td.number[column > 1] { (cell) } }
                    } } }
                } }
                @for stop in lines.iter().filter_map(Line::stop) { p.verdict.bad { (stop) } }
                @for faded in lines.iter().filter_map(Line::faded) { p { (faded) "." } }
                p { "Position error: reference less true position. Torque error: RMS of the torque that did not arrive, in % of the "
                    "friction's RMS, both below 20 Hz. 001 eq. 11: mean of |what did not arrive| / |motor torque|; motor torques below a "
                    "tenth of their RMS count in no quotient." }
            }
            section { h2 { "Over time" } (gallery(&figures)) }
        }
        footer { "Made by jointctl " (env!("CARGO_PKG_VERSION")) ". All samples: *.csv." }
    };
    Ok(document(title, &body))
}

fn figure(shown: &Shown) -> Result<Figure, FigureError> {
    let both = [(Ink::Nothing, "without compensation", &shown.off), (Ink::Network, "with compensation", &shown.on)];
    let both = || both.iter().filter(|(.., logs)| !logs.is_empty());
    let curves = |value: fn(&super::Row) -> f64| -> Vec<Curve> {
        both().map(|(ink, name, logs)| Curve { ink: *ink, name, points: points(logs, value) }).collect()
    };
    let mut position = curves(|row| row.true_position);
    position.insert(
        0,
        Curve { ink: Ink::Measured, name: "reference", points: points(&shown.off, |row| row.reference_position) },
    );
    let plots = [
        Plot { label: "position [rad]", curves: position },
        Plot { label: "position error [mrad]", curves: curves(|row| 1e3 * row.position_error()) },
        Plot { label: "torque lost [Nm]", curves: curves(|row| row.commanded_torque - row.arriving_torque()) },
        Plot { label: "torque asked [Nm]", curves: curves(|row| row.commanded_torque) },
    ];
    let caption = "Torque lost is the torque that was asked for less the torque that arrived. Parts follow each other.";
    over_time(shown.name, shown.name, caption, &plots)
}

/// The parts one after the other, thinned.
fn points(logs: &[&Log], value: fn(&super::Row) -> f64) -> Vec<(f64, f64)> {
    let every = logs.iter().map(|log| log.rows.len()).sum::<usize>().div_ceil(LINE_POINTS).max(1);
    let mut start = 0.0;
    let mut points = Vec::new();
    for log in logs {
        points.extend(log.rows.iter().step_by(every).map(|row| (start + row.time, value(row))));
        start += log.rows.last().map_or(0.0, |row| row.time);
    }
    points
}
