//! Curves over time, in panels below each other; host.

use super::axis::Axis;
use super::binning::{extent, widen};
use super::chart::{Entry, Panel, Swatch, legend, paper};
use super::ink::Ink;
use super::{Figure, FigureError};

/// Space for the tick labels, so that the panels line up.
const LEFT: i32 = 84;
/// Height of a panel.
const HEIGHT: u32 = 200;

/// One curve.
#[derive(Clone, Debug)]
pub struct Curve<'a> {
    /// Meaning of the curve. The same in all panels.
    pub ink: Ink,
    /// Name in the legend.
    pub name: &'a str,
    /// Time and value, in time.
    pub points: Vec<(f64, f64)>,
}

/// One panel.
#[derive(Clone, Debug)]
pub struct Plot<'a> {
    /// Quantity that is shown, and its unit.
    pub label: &'a str,
    /// Curves, the first below the others.
    pub curves: Vec<Curve<'a>>,
}

/// A figure over the whole width of the page.
///
/// # Errors
/// [`FigureError`].
pub fn over_time(
    name: &'static str,
    title: &'static str,
    caption: &str,
    plots: &[Plot],
) -> Result<Figure, FigureError> {
    let mut entries: Vec<Entry> = Vec::new();
    for curve in plots.iter().flat_map(|plot| &plot.curves) {
        if entries.iter().all(|(ink, ..)| *ink != curve.ink) {
            entries.push((curve.ink, Swatch::Line, curve.name));
        }
    }
    let time = extent(plots.iter().flat_map(|plot| &plot.curves).flat_map(|c| c.points.iter().map(|point| point.0)));
    let svg = paper(1080, 40 + HEIGHT * plots.len() as u32, |area| {
        let area = legend(area, LEFT, &entries)?;
        for (number, (part, plot)) in area.split_evenly((plots.len(), 1)).iter().zip(plots).enumerate() {
            let values = plot.curves.iter().flat_map(|curve| curve.points.iter().map(|point| point.1));
            let y = Axis::linear(widen(extent(values), 0.06), 4, plot.label);
            let x = Axis::linear(time.clone(), 12, if number + 1 == plots.len() { "time [s]" } else { "" });
            let panel = Panel::new(part, x, y, LEFT)?;
            for curve in &plot.curves {
                panel.line(curve.points.iter().copied(), curve.ink, 1.4, 1.0)?;
            }
        }
        Ok(())
    })?;
    Ok(Figure { name, title, caption: caption.to_owned(), wide: true, svg })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_ink_has_one_entry_and_each_curve_a_line_and_no_data_is_no_panic() {
        let curve = |ink, name| Curve { ink, name, points: vec![(0.0, 1.0), (1.0, 2.0)] };
        let plot = |label| Plot { label, curves: vec![curve(Ink::Nothing, "off"), curve(Ink::Network, "on")] };
        let figure = over_time("a", "A", "", &[plot("first"), plot("second")]).unwrap();
        assert_eq!((figure.svg.matches(">off<").count(), figure.svg.matches(">on<").count()), (1, 1), "{}", figure.svg);
        // Two panels and the legend.
        assert_eq!(figure.svg.matches("l-nothing").count(), 3, "{}", figure.svg);
        let empty = Plot { label: "", curves: vec![Curve { ink: Ink::Nothing, name: "off", points: Vec::new() }] };
        assert!(over_time("a", "A", "", &[empty]).is_ok());
    }
}
