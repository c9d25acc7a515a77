//! A plotters backend that writes small, themed SVG; host.
//!
//! The backend that comes with plotters writes colours (so a figure cannot follow the page's dark scheme), whole pixels
//! (so a slow curve becomes a staircase) and one element for each point (so a cloud of 4000 points weighs 400 kB).
//! This one writes CSS classes, measures in tenths of a pixel and merges consecutive points of one style into one path.

use super::ink::Ink;
use plotters_backend::text_anchor::{HPos, VPos};
use plotters_backend::{
    BackendColor, BackendCoord, BackendStyle, BackendTextStyle, DrawingBackend, DrawingErrorKind, FontStyle,
    FontTransform,
};
use std::convert::Infallible;
use std::fmt::Write;

/// Units of the drawing in one CSS pixel.
pub const UNITS_PER_PIXEL: u32 = 10;

/// Mean width of a letter, in font sizes: the widths of a sans-serif font differ, layout needs an upper estimate.
const LETTER_WIDTH: f64 = 0.56;

type Result = std::result::Result<(), DrawingErrorKind<Infallible>>;

/// Draws into a string; the caller adds the `<svg>` element around it.
pub struct SvgBackend<'a> {
    out: &'a mut String,
    size: (u32, u32),
    cloud: Option<Cloud>,
}

/// Points of one style that wait to become one path.
struct Cloud {
    class: &'static str,
    opacity: f64,
    diameter: u32,
    path: String,
    last: BackendCoord,
}

impl<'a> SvgBackend<'a> {
    /// A backend of `size` units that appends to `out`.
    pub fn new(out: &'a mut String, size: (u32, u32)) -> Self {
        Self { out, size, cloud: None }
    }

    fn push(&mut self, element: std::fmt::Arguments) {
        self.flush();
        // Writing to a string cannot fail.
        let _ = writeln!(self.out, "{element}");
    }

    fn flush(&mut self) {
        if let Some(Cloud { class, opacity, diameter, path, .. }) = self.cloud.take() {
            let opacity = opacity_attribute(opacity);
            let _ = writeln!(
                self.out,
                r#"<path class="l-{class}"{opacity} stroke-width="{diameter}" stroke-linecap="round" d="{path}"/>"#
            );
        }
    }

    fn add_point(&mut self, (x, y): BackendCoord, class: &'static str, opacity: f64, diameter: u32) {
        let fits = |c: &Cloud| c.class == class && c.opacity == opacity && c.diameter == diameter;
        match self.cloud.as_mut().filter(|cloud| fits(cloud)) {
            Some(cloud) => {
                let (dx, dy) = (x - cloud.last.0, y - cloud.last.1);
                let _ = write!(cloud.path, "m{dx} {dy}h0");
                cloud.last = (x, y);
            }
            None => {
                self.flush();
                self.cloud = Some(Cloud { class, opacity, diameter, path: format!("M{x} {y}h0"), last: (x, y) });
            }
        }
    }
}

impl DrawingBackend for SvgBackend<'_> {
    type ErrorType = Infallible;

    fn get_size(&self) -> (u32, u32) {
        self.size
    }

    fn ensure_prepared(&mut self) -> Result {
        Ok(())
    }

    fn present(&mut self) -> Result {
        self.flush();
        Ok(())
    }

    fn draw_pixel(&mut self, point: BackendCoord, colour: BackendColor) -> Result {
        self.add_point(point, Ink::class(colour.rgb), colour.alpha, UNITS_PER_PIXEL);
        Ok(())
    }

    fn draw_line<S: BackendStyle>(&mut self, from: BackendCoord, to: BackendCoord, style: &S) -> Result {
        self.draw_path([from, to], style)
    }

    fn draw_rect<S: BackendStyle>(&mut self, a: BackendCoord, b: BackendCoord, style: &S, fill: bool) -> Result {
        let (x, y) = (a.0.min(b.0), a.1.min(b.1));
        let (width, height) = (a.0.abs_diff(b.0), a.1.abs_diff(b.1));
        let paint = paint(style, fill);
        self.push(format_args!(r#"<rect {paint} x="{x}" y="{y}" width="{width}" height="{height}"/>"#));
        Ok(())
    }

    fn draw_path<S: BackendStyle, I: IntoIterator<Item = BackendCoord>>(&mut self, path: I, style: &S) -> Result {
        let (paint, points) = (paint(style, false), points(path));
        self.push(format_args!(r#"<polyline {paint} points="{points}"/>"#));
        Ok(())
    }

    fn draw_circle<S: BackendStyle>(&mut self, (x, y): BackendCoord, radius: u32, style: &S, fill: bool) -> Result {
        if fill {
            let colour = style.color();
            self.add_point((x, y), Ink::class(colour.rgb), colour.alpha, 2 * radius);
        } else {
            let paint = paint(style, false);
            self.push(format_args!(r#"<circle {paint} cx="{x}" cy="{y}" r="{radius}"/>"#));
        }
        Ok(())
    }

    fn fill_polygon<S: BackendStyle, I: IntoIterator<Item = BackendCoord>>(&mut self, path: I, style: &S) -> Result {
        let (paint, points) = (paint(style, true), points(path));
        self.push(format_args!(r#"<polygon {paint} points="{points}"/>"#));
        Ok(())
    }

    fn draw_text<S: BackendTextStyle>(&mut self, text: &str, style: &S, (x, y): BackendCoord) -> Result {
        let size = style.size();
        let anchor = match style.anchor().h_pos {
            HPos::Left => "start",
            HPos::Center => "middle",
            HPos::Right => "end",
        };
        let dy = match style.anchor().v_pos {
            VPos::Top => 0.78,
            VPos::Center => 0.36,
            VPos::Bottom => -0.22,
        } * size;
        let turn = match style.transform() {
            FontTransform::None => 0,
            FontTransform::Rotate90 => 90,
            FontTransform::Rotate180 => 180,
            FontTransform::Rotate270 => 270,
        };
        let turn = if turn == 0 { String::new() } else { format!(r#" transform="rotate({turn} {x} {y})""#) };
        let weight = if matches!(style.style(), FontStyle::Bold) { r#" font-weight="600""# } else { "" };
        let class = Ink::class(style.color().rgb);
        let text = maud::html! { (text) }.into_string();
        self.push(format_args!(
            r#"<text class="f-{class}" x="{x}" y="{y}" dy="{dy:.0}" font-size="{size:.0}" text-anchor="{anchor}"{weight}{turn}>{text}</text>"#
        ));
        Ok(())
    }

    fn estimate_text_size<S: BackendTextStyle>(
        &self,
        text: &str,
        style: &S,
    ) -> std::result::Result<(u32, u32), DrawingErrorKind<Infallible>> {
        Ok((text_width(text, style.size()) as u32, style.size() as u32))
    }
}

/// Estimated width of a text in units, on the wide side.
pub fn text_width(text: &str, font_size: f64) -> f64 {
    text.chars().count() as f64 * LETTER_WIDTH * font_size
}

fn paint<S: BackendStyle>(style: &S, fill: bool) -> String {
    let (class, opacity) = (Ink::class(style.color().rgb), opacity_attribute(style.color().alpha));
    if fill {
        format!(r#"class="f-{class}"{opacity}"#)
    } else {
        format!(r#"class="l-{class}"{opacity} stroke-width="{}""#, style.stroke_width())
    }
}

fn opacity_attribute(alpha: f64) -> String {
    if alpha >= 1.0 { String::new() } else { format!(r#" opacity="{alpha}""#) }
}

fn points(path: impl IntoIterator<Item = BackendCoord>) -> String {
    let mut text = String::new();
    for (x, y) in path {
        let separator = if text.is_empty() { "" } else { " " };
        let _ = write!(text, "{separator}{x},{y}");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use plotters::style::{Color, ShapeStyle};

    #[test]
    fn consecutive_points_of_one_style_become_one_path() {
        let mut out = String::new();
        let mut backend = SvgBackend::new(&mut out, (100, 100));
        let grey: ShapeStyle = Ink::Measured.colour().mix(0.5).filled();
        let green: ShapeStyle = Ink::Network.colour().filled();
        for (point, style) in [((1, 2), &grey), ((4, 1), &grey), ((7, 7), &green)] {
            backend.draw_circle(point, 8, style, true).unwrap();
        }
        backend.present().unwrap();
        assert_eq!(
            out,
            "<path class=\"l-measured\" opacity=\"0.5\" stroke-width=\"16\" stroke-linecap=\"round\" d=\"M1 2h0m3 -1h0\"/>\n\
             <path class=\"l-network\" stroke-width=\"16\" stroke-linecap=\"round\" d=\"M7 7h0\"/>\n"
        );
    }
}
