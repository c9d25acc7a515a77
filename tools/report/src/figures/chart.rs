//! Elements that all figures share: paper, panels with axes, a legend above the plot, and the marks; host.

use super::FigureError;
use super::axis::Axis;
use super::ink::Ink;
use super::svg::{SvgBackend, UNITS_PER_PIXEL, text_width};
use plotters::chart::{ChartBuilder, ChartContext};
use plotters::coord::Shift;
use plotters::coord::cartesian::Cartesian2d;
use plotters::drawing::{DrawingArea, IntoDrawingArea};
use plotters::element::{Circle, PathElement, Polygon, Rectangle, Text};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, FontFamily, FontStyle, IntoTextStyle, ShapeStyle, TextStyle};

/// A part of the paper.
pub type Area<'a> = DrawingArea<SvgBackend<'a>, Shift>;
type Result<T> = std::result::Result<T, FigureError>;

const UNIT: i32 = UNITS_PER_PIXEL as i32;
/// Size of all letters, in units.
const FONT: i32 = 13 * UNIT;
/// Height of one row of a legend.
const LEGEND_ROW: i32 = 22 * UNIT;
/// Empty edge of the paper.
const MARGIN: i32 = 6 * UNIT;
const SWATCH: i32 = 24 * UNIT;

/// Draws on paper of `width` by `height` CSS pixels and returns the `<svg>` element.
pub fn paper(width: u32, height: u32, draw: impl FnOnce(&Area) -> Result<()>) -> Result<String> {
    let (units_x, units_y) = (width * UNITS_PER_PIXEL, height * UNITS_PER_PIXEL);
    let mut body = String::new();
    {
        let area = SvgBackend::new(&mut body, (units_x, units_y)).into_drawing_area();
        draw(&area.margin(MARGIN, MARGIN, MARGIN, 0))?;
        area.present()?;
    }
    Ok(format!(
        "<svg class=\"figure\" xmlns=\"http://www.w3.org/2000/svg\" role=\"img\" width=\"{width}\" height=\"{height}\" \
         viewBox=\"0 0 {units_x} {units_y}\">\n{body}</svg>\n"
    ))
}

/// Swatch of an ink in a legend.
#[derive(Clone, Copy, Debug)]
pub enum Swatch {
    /// A line.
    Line,
    /// Some points.
    Points,
    /// A filled area of this opacity.
    Area(f64),
    /// A circle.
    Circle,
}

/// One entry of a legend.
pub type Entry<'a> = (Ink, Swatch, &'a str);

/// Draws the legend in rows at the top of `area` and returns what is left below it.
pub fn legend<'a>(area: &Area<'a>, indent: i32, entries: &[Entry]) -> Result<Area<'a>> {
    let width = area.dim_in_pixel().0 as i32;
    let (mut x, mut row) = (indent * UNIT, 0);
    for (ink, swatch, text) in entries {
        let length = SWATCH + 7 * UNIT + text_width(text, f64::from(FONT)) as i32 + 20 * UNIT;
        if x + length > width && x > indent * UNIT {
            (x, row) = (indent * UNIT, row + 1);
        }
        let y = row * LEGEND_ROW + LEGEND_ROW / 2;
        match swatch {
            Swatch::Line => area.draw(&PathElement::new([(x, y), (x + SWATCH, y)], line_style(*ink, 2.2)))?,
            Swatch::Points => {
                for (place, lift) in [(4, -2), (12, 3), (20, -1)] {
                    area.draw(&Circle::new((x + place * UNIT, y + lift * UNIT), 2 * UNIT, ink.colour().filled()))?;
                }
            }
            Swatch::Area(opacity) => {
                let half = 6 * UNIT;
                area.draw(&Rectangle::new(
                    [(x, y - half), (x + SWATCH, y + half)],
                    ink.colour().mix(*opacity).filled(),
                ))?;
            }
            Swatch::Circle => {
                let centre = (x + SWATCH / 2, y);
                area.draw(&Circle::new(centre, 5 * UNIT, line_style(*ink, 2.0)))?;
            }
        }
        area.draw(&Text::new(*text, (x + SWATCH + 7 * UNIT, y), text_style(HPos::Left, VPos::Center)))?;
        x += length;
    }
    let used = if entries.is_empty() { 0 } else { (row + 1) * LEGEND_ROW };
    Ok(area.split_vertically(used).1)
}

/// A plot with axes; marks are given in the units of the axes.
pub struct Panel<'a> {
    chart: ChartContext<'a, SvgBackend<'a>, Cartesian2d<Axis, Axis>>,
    x: Axis,
    y: Axis,
}

impl<'a> Panel<'a> {
    /// Draws axes, grid and labels in `area`. Space for the tick labels at the left is taken from their lengths, but
    /// at least `left` pixels, so that panels below each other line up.
    pub fn new(area: &Area<'a>, x: Axis, y: Axis, left: i32) -> Result<Self> {
        let longest = y.tick_labels().map(|text| text_width(text, f64::from(FONT))).fold(0.0, f64::max) as i32;
        let label = if y.label.is_empty() { 4 * UNIT } else { 26 * UNIT };
        let mut chart = ChartBuilder::on(area)
            .margin_top(8 * UNIT)
            .margin_right(16 * UNIT)
            .margin_bottom(2 * UNIT)
            .x_label_area_size(if x.label.is_empty() { 26 * UNIT } else { 46 * UNIT })
            .y_label_area_size((longest + label + 8 * UNIT).max(left * UNIT))
            .build_cartesian_2d(x.clone(), y.clone())?;
        chart
            .configure_mesh()
            .bold_line_style(line_style(Ink::Grid, 1.0))
            .axis_style(line_style(Ink::Axis, 1.0))
            .set_all_tick_mark_size(4 * UNIT)
            .label_style(text_style(HPos::Left, VPos::Top))
            .x_desc(x.label.clone())
            .y_desc(y.label.clone())
            .draw()?;
        Ok(Self { chart, x, y })
    }

    /// A cloud of points of `radius` pixels. Points beyond the axes are left out; returns how many.
    pub fn cloud(
        &self,
        points: impl IntoIterator<Item = (f64, f64)>,
        ink: Ink,
        opacity: f64,
        radius: f64,
    ) -> Result<usize> {
        let style = ink.colour().mix(opacity).filled();
        let radius = (radius * f64::from(UNIT)) as i32;
        let mut outside = 0;
        for (x, y) in points {
            if self.x.contains(x) && self.y.contains(y) {
                self.chart.plotting_area().draw(&Circle::new((x, y), radius, style))?;
            } else {
                outside += 1;
            }
        }
        Ok(outside)
    }

    /// A line of `width` pixels through the points, or a dot where there is but one; it stays inside the axes.
    pub fn line(&self, points: impl IntoIterator<Item = (f64, f64)>, ink: Ink, width: f64, opacity: f64) -> Result<()> {
        let points: Vec<(f64, f64)> = points.into_iter().map(|(x, y)| (x, self.y.clip(y))).collect();
        if let [point] = points[..] {
            self.cloud([point], ink, opacity, width)?;
        } else if points.len() > 1 {
            let style = ShapeStyle { color: ink.colour().mix(opacity), ..line_style(ink, width) };
            self.chart.plotting_area().draw(&PathElement::new(points, style))?;
        }
        Ok(())
    }

    /// The area between two lines given as (x, low, high).
    pub fn band(&self, edges: &[(f64, f64, f64)], ink: Ink, opacity: f64) -> Result<()> {
        if edges.len() > 1 {
            let low = edges.iter().map(|&(x, low, _)| (x, self.y.clip(low)));
            let high = edges.iter().rev().map(|&(x, _, high)| (x, self.y.clip(high)));
            let outline: Vec<(f64, f64)> = low.chain(high).collect();
            self.chart.plotting_area().draw(&Polygon::new(outline, ink.colour().mix(opacity)))?;
        }
        Ok(())
    }

    /// A filled rectangle between two corners.
    pub fn bar(&self, corners: [(f64, f64); 2], ink: Ink, opacity: f64) -> Result<()> {
        let style = ink.colour().mix(opacity).filled();
        Ok(self.chart.plotting_area().draw(&Rectangle::new(corners, style))?)
    }

    /// A circle around a point.
    pub fn ring(&self, at: (f64, f64), ink: Ink) -> Result<()> {
        Ok(self.chart.plotting_area().draw(&Circle::new(at, 5 * UNIT, line_style(ink, 2.0)))?)
    }

    /// A text to the right of a point, some pixels away.
    pub fn text_beside(&self, text: &str, at: (f64, f64), pixels: i32) -> Result<()> {
        let (x, y) = self.chart.backend_coord(&at);
        let plot = self.chart.plotting_area().strip_coord_spec();
        let (base_x, base_y) = plot.get_base_pixel();
        let place = (x - base_x + pixels * UNIT, y - base_y);
        Ok(plot.draw(&Text::new(text, place, text_style(HPos::Left, VPos::Center)))?)
    }

    /// Says in the corner how many samples lie beyond the axes, if any do.
    pub fn note_outside(&self, outside: usize, of: usize) -> Result<()> {
        if outside == 0 {
            return Ok(());
        }
        let plot = self.chart.plotting_area().strip_coord_spec();
        let text = format!("{outside} of {of} samples lie beyond the axes");
        let place = (plot.dim_in_pixel().0 as i32 - 6 * UNIT, 6 * UNIT);
        Ok(plot.draw(&Text::new(text, place, text_style(HPos::Right, VPos::Top)))?)
    }
}

/// A text heading at the top of `area`, returning what is left below it.
pub fn heading<'a>(area: &Area<'a>, indent: i32, text: &str) -> Result<Area<'a>> {
    let (top, rest) = area.split_vertically(LEGEND_ROW);
    let bold = TextStyle {
        font: text_style(HPos::Left, VPos::Center).font.style(FontStyle::Bold),
        ..text_style(HPos::Left, VPos::Center)
    };
    top.draw(&Text::new(text, (indent * UNIT, LEGEND_ROW / 2), bold))?;
    Ok(rest)
}

fn line_style(ink: Ink, width: f64) -> ShapeStyle {
    ShapeStyle { color: ink.colour().to_rgba(), filled: false, stroke_width: (width * f64::from(UNIT)) as u32 }
}

fn text_style(h: HPos, v: VPos) -> TextStyle<'static> {
    (FontFamily::SansSerif, FONT).into_text_style(&(0, 0)).color(&const { Ink::Text.colour() }).pos(Pos::new(h, v))
}
