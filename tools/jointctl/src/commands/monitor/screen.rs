//! The terminal of `jointctl monitor`: curves over the last seconds, and the numbers of this instant; host.
//!
//! The terminal is put back as it was at the end, at an error and at a panic (`ratatui::init` sets the hook).

use super::{CommandError, History, running};
use joint_firmware::objects::field::Actual;
use ratatui::Frame;
use ratatui::crossterm::event::{self, Event, KeyCode, KeyEventKind, KeyModifiers};
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Style};
use ratatui::symbols::Marker;
use ratatui::widgets::{Axis, Block, Chart, Dataset, GraphType, Paragraph};
use std::time::{Duration, Instant};

/// Time between two pictures.
const PICTURE: Duration = Duration::from_millis(100);
/// Lines of the page below the curves, with its frame.
const PAGE: u16 = 12;

/// A chart: its title, and its curves with names and colours.
type Curves = (&'static str, &'static [(&'static str, Actual, Color)]);

const CHARTS: [Curves; 4] = [
    ("position, rad", &[("position", Actual::Position, Color::Cyan)]),
    ("velocity, rad/s", &[("velocity", Actual::Velocity, Color::Green)]),
    (
        "torque, Nm",
        &[
            ("measured", Actual::Torque, Color::Yellow),
            ("compensation", Actual::CompensationTorque, Color::Magenta),
            ("unexplained", Actual::Residual, Color::Red),
        ],
    ),
    (
        "temperature, °C",
        &[
            ("winding", Actual::WindingTemperature, Color::Red),
            ("bridge", Actual::BridgeTemperature, Color::Yellow),
            ("gear", Actual::GearTemperature, Color::Cyan),
        ],
    ),
];

/// Shows the history as `look` extends it, until q, Ctrl-C or an error.
pub fn run(
    history: &mut History,
    mut look: impl FnMut(&mut History, Option<Instant>) -> Result<Instant, CommandError>,
) -> Result<(), CommandError> {
    let failed = |error: std::io::Error| CommandError::Arguments(format!("the terminal cannot be used: {error}"));
    let mut terminal = ratatui::try_init().map_err(failed)?;
    let mut show = || -> Result<(), CommandError> {
        let mut began = None;
        let mut pictured = Instant::now();
        while running() {
            began = Some(look(history, began)?);
            if pictured.elapsed() < PICTURE {
                continue;
            }
            pictured = Instant::now();
            terminal.draw(|frame| draw(frame, history)).map_err(failed)?;
            while event::poll(Duration::ZERO).map_err(failed)? {
                if event::read().is_ok_and(|event| ends(&event)) {
                    return Ok(());
                }
            }
        }
        Ok(())
    };
    let shown = show();
    ratatui::restore();
    shown
}

/// Returns `true` if the user ends it: in raw mode Ctrl-C is a key.
fn ends(event: &Event) -> bool {
    let Event::Key(key) = event else { return false };
    let interrupt = key.code == KeyCode::Char('c') && key.modifiers.contains(KeyModifiers::CONTROL);
    key.kind == KeyEventKind::Press && (key.code == KeyCode::Char('q') || interrupt)
}

fn draw(frame: &mut Frame, history: &History) {
    let [curves, page] = Layout::vertical([Constraint::Min(8), Constraint::Length(PAGE)]).areas(frame.area());
    let rows: [Rect; 2] = Layout::vertical([Constraint::Fill(1); 2]).areas(curves);
    let places = rows.map(|row| Layout::horizontal([Constraint::Fill(1); 2]).areas::<2>(row));
    for ((title, curves), place) in CHARTS.iter().zip(places.into_iter().flatten()) {
        chart(frame, history, title, curves, place);
    }
    let block = Block::bordered().title(" q or Ctrl-C ends ");
    frame.render_widget(Paragraph::new(history.page()).block(block), page);
}

fn chart(frame: &mut Frame, history: &History, title: &str, curves: &[(&str, Actual, Color)], place: Rect) {
    let lines = curves.iter().map(|(name, actual, color)| (*name, history.line(*actual), *color)).collect::<Vec<_>>();
    let points = || lines.iter().flat_map(|(_, line, _)| line);
    let span = |value: fn(&(f64, f64)) -> f64, least: f64| {
        let low = points().map(value).fold(f64::INFINITY, f64::min);
        let high = points().map(value).fold(f64::NEG_INFINITY, f64::max);
        let (middle, half) = (0.5 * (low + high), (0.5 * (high - low)).max(0.5 * least));
        if middle.is_finite() { [middle - half, middle + half] } else { [0.0, 1.0] }
    };
    let (time, value) = (span(|point| point.0, 1.0), span(|point| point.1, 0.02));
    let datasets = lines.iter().map(|(name, line, color)| {
        let dataset = Dataset::default().data(line).marker(Marker::Braille).graph_type(GraphType::Line);
        let dataset = dataset.style(Style::default().fg(*color));
        if curves.len() > 1 { dataset.name(*name) } else { dataset }
    });
    let axis =
        |[low, high]: [f64; 2]| Axis::default().bounds([low, high]).labels([format!("{low:.2}"), format!("{high:.2}")]);
    let block = Block::bordered().title(format!(" {title} "));
    let chart = Chart::new(datasets.collect()).block(block).x_axis(axis(time)).y_axis(axis(value));
    frame.render_widget(chart, place);
}

#[cfg(test)]
mod tests {
    use super::super::SIGNALS;
    use super::*;
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;
    use ratatui::crossterm::event::KeyEvent;

    #[test]
    fn a_picture_has_every_chart_and_the_page_and_fits_any_terminal() {
        let mut history = History { node: 5, ..History::default() };
        (0..100).for_each(|n| history.add(0.02 * f64::from(n), vec![f64::from(n).sin(); SIGNALS.len()]));
        let mut terminal = Terminal::new(TestBackend::new(110, 40)).unwrap();
        terminal.draw(|frame| draw(frame, &history)).unwrap();
        let text = terminal.backend().to_string();
        for expected in
            ["position, rad", "velocity, rad/s", "torque, Nm", "temperature, °C", "temperatures", "q or Ctrl-C"]
        {
            assert!(text.contains(expected), "{expected}: {text}");
        }
        for (width, height) in [(1, 1), (20, 5), (300, 100)] {
            let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
            terminal.draw(|frame| draw(frame, &History::default())).unwrap();
        }
    }

    #[test]
    fn q_and_ctrl_c_end_it_and_nothing_else_does() {
        let key = |code, modifiers| Event::Key(KeyEvent::new(KeyCode::Char(code), modifiers));
        assert!(ends(&key('q', KeyModifiers::NONE)) && ends(&key('c', KeyModifiers::CONTROL)));
        assert!(!ends(&key('c', KeyModifiers::NONE)) && !ends(&Event::FocusLost));
    }
}
