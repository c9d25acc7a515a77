//! Figures as SVG, and what they are drawn with; host.
//!
//! plotters lays out axes and marks, `svg` writes them, [`ink`] gives them meaning and colour. [`over_time`] is the
//! figure that every page has: curves over time.

pub mod axis;
pub mod binning;
pub mod chart;
pub mod ink;
pub mod lines;
mod svg;

pub use ink::{Ink, style_sheet};
pub use lines::{Curve, Plot, over_time};
use plotters::drawing::DrawingAreaErrorKind;
use std::convert::Infallible;

/// Error of drawing a figure: the layout or a font failed. The text is that of plotters.
#[derive(Debug, thiserror::Error)]
#[error("cannot draw a figure: {0}")]
pub struct FigureError(#[from] DrawingAreaErrorKind<Infallible>);

/// One figure, as it is shown on the page and written to its own file.
#[derive(Clone, Debug)]
pub struct Figure {
    /// File name without extension, and anchor on the page.
    pub name: &'static str,
    /// Heading.
    pub title: &'static str,
    /// One sentence that says how to read it.
    pub caption: String,
    /// `true` if it takes the whole width of the page.
    pub wide: bool,
    /// The `<svg>` element; its colours come from [`style_sheet`].
    pub svg: String,
}

impl Figure {
    /// The figure as a file on its own, with title, paper and style sheet.
    pub fn standalone(&self) -> String {
        let title = maud::html! { (self.title) }.into_string();
        let inside = format!(
            ">\n<title>{title}</title>\n<style>{}</style>\n<rect class=\"paper\" width=\"100%\" height=\"100%\"/>\n",
            style_sheet()
        );
        let figure = self.svg.replacen(">\n", &inside, 1);
        format!("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n{figure}")
    }
}
