//! `jointctl monitor`: what a joint does, as it does it, in a terminal; or one page of it.

mod screen;

use super::CommandError;
use super::remote::{Where, catch_interrupts, running};
use crate::remote::condition::{self, faults_of, state_of};
use crate::remote::info;
use crate::remote::record::{Pace, Recorder};
use clap::Args;
use joint_firmware::objects::field::Actual;
use std::collections::VecDeque;
use std::fmt::Write;
use std::time::Duration;

/// Signals that one looks at, as many as fit into the four TPDOs.
const SIGNALS: [Actual; 13] = [
    Actual::Position,
    Actual::Velocity,
    Actual::Torque,
    Actual::TorqueDemand,
    Actual::CompensationTorque,
    Actual::Residual,
    Actual::BusVoltage,
    Actual::WindingTemperature,
    Actual::BridgeTemperature,
    Actual::GearTemperature,
    Actual::Statusword,
    Actual::LatchedFaults,
    Actual::ActingModel,
];
/// Time without a sample after which the joint is taken to be gone.
const SILENCE: Duration = Duration::from_secs(3);

/// Arguments of `monitor`.
#[derive(Debug, Args)]
pub struct Monitor {
    /// Which joint.
    #[command(flatten)]
    on: Where,
    /// Samples a second
    #[arg(long, value_name = "HZ", default_value_t = 50.0)]
    rate: f64,
    /// Send no SYNC, follow that of another client
    #[arg(long, conflicts_with = "rate")]
    follow: bool,
    /// Print one page and end: needs no terminal
    #[arg(long)]
    once: bool,
    /// Print that page as a JSON object, a text for each line
    #[arg(long, requires = "once")]
    json: bool,
}

/// Samples of a joint, newest last.
#[derive(Debug, Default)]
struct History {
    node: u8,
    /// Time since the first sample, s, and the values of [`SIGNALS`].
    samples: VecDeque<(f64, Vec<f64>)>,
}

/// Samples that are kept: 20 s at 50 Hz.
const KEPT: usize = 1_000;

impl History {
    fn add(&mut self, time: f64, values: Vec<f64>) {
        self.samples.push_back((time, values));
        while self.samples.len() > KEPT {
            self.samples.pop_front();
        }
    }

    /// A signal over time.
    fn line(&self, actual: Actual) -> Vec<(f64, f64)> {
        let Some(place) = SIGNALS.iter().position(|signal| *signal == actual) else { return Vec::new() };
        let point = |(time, values): &(f64, Vec<f64>)| Some((*time, *values.get(place)?));
        self.samples.iter().filter_map(point).filter(|(_, value)| value.is_finite()).collect()
    }

    /// The newest value; not a number where nothing measures it.
    fn now(&self, actual: Actual) -> f64 {
        let place = SIGNALS.iter().position(|signal| *signal == actual);
        let newest = self.samples.back().zip(place).and_then(|((_, values), place)| values.get(place).copied());
        newest.unwrap_or(f64::NAN)
    }

    /// The newest sample in words and numbers.
    fn page(&self) -> String {
        let mut page = String::new();
        let number = |actual, decimals: usize, unit: &str| match self.now(actual) {
            value if value.is_finite() => format!("{value:+.decimals$} {unit}"),
            _ => "not measured".into(),
        };
        let mut line = |title: &str, text: String| {
            // Writing to a string does not fail.
            let _ = writeln!(page, "{title:<width$}{text}", width = info::TITLE);
        };
        let faults = faults_of(self.now(Actual::LatchedFaults) as u16);
        line("node", self.node.to_string());
        line("state", condition::name(state_of(self.now(Actual::Statusword) as u16)).into());
        line("faults", if faults.is_empty() { "none".into() } else { condition::list(&faults) });
        line("position", number(Actual::Position, 4, "rad"));
        line("velocity", number(Actual::Velocity, 3, "rad/s"));
        line(
            "torque",
            format!("{}, demand {}", number(Actual::Torque, 3, "Nm"), number(Actual::TorqueDemand, 3, "Nm")),
        );
        let model = match self.now(Actual::ActingModel) as u8 {
            0 => "nothing acts",
            1 => "the physical model acts",
            _ => "the physical model and the network act",
        };
        line("compensation", format!("{}, {model}", number(Actual::CompensationTorque, 3, "Nm")));
        line("unexplained", number(Actual::Residual, 3, "Nm"));
        let heat = |actual| number(actual, 1, "°C");
        line(
            "temperatures",
            format!(
                "winding {}, bridge {}, gear {}",
                heat(Actual::WindingTemperature),
                heat(Actual::BridgeTemperature),
                heat(Actual::GearTemperature)
            ),
        );
        line("bus voltage", number(Actual::BusVoltage, 2, "V"));
        page
    }
}

impl Monitor {
    /// Runs the command.
    pub fn run(&self) -> Result<(), CommandError> {
        let joint = self.on.joint()?;
        catch_interrupts()?;
        let pace = if self.follow { Pace::Follow } else { Pace::Send(self.rate) };
        let mut recorder = Recorder::begin(&joint, &SIGNALS, pace)?;
        let mut history = History { node: joint.id(), ..History::default() };
        let shown = if self.once {
            look(&mut recorder, &mut history, SILENCE, None).map(drop)
        } else {
            screen::run(&mut history, |history, began| look(&mut recorder, history, SILENCE, began))
        };
        // The joint's PDOs go back whatever happened on the screen.
        let ended = recorder.end();
        shown?;
        ended?;
        if self.once {
            match self.json {
                true => println!("{:#}", info::json(&history.page())),
                false => print!("{}", history.page()),
            }
        }
        Ok(())
    }
}

/// Takes the next sample into the history; when the first one came.
fn look(
    recorder: &mut Recorder,
    history: &mut History,
    timeout: Duration,
    began: Option<std::time::Instant>,
) -> Result<std::time::Instant, CommandError> {
    let node = history.node;
    let Some(sample) = recorder.next(timeout)? else {
        let text = format!("node {node}: no samples for {} s", timeout.as_secs());
        return Err(CommandError::Bus(text));
    };
    let began = began.unwrap_or(sample.at);
    history.add(sample.at.saturating_duration_since(began).as_secs_f64(), sample.values.clone());
    Ok(began)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_tells_state_and_faults_in_words_and_what_nothing_measures() {
        let mut history = History { node: 5, ..History::default() };
        let values = SIGNALS.map(|signal| match signal {
            Actual::Statusword => 0x0008 as f64,
            Actual::LatchedFaults => 0x2000 as f64,
            Actual::BridgeTemperature => f64::NAN,
            Actual::Position => 1.25,
            _ => 0.0,
        });
        history.add(0.0, values.to_vec());
        let page = history.page();
        for expected in [
            "state           in a fault\n",
            "faults          command deadline missed (8100h)\n",
            "position        +1.2500 rad\n",
            "bridge not measured",
        ] {
            assert!(page.contains(expected), "{expected}: {page}");
        }
        (0..2 * KEPT).for_each(|n| history.add(n as f64, values.to_vec()));
        assert_eq!((history.line(Actual::Position).len(), history.line(Actual::BridgeTemperature).len()), (KEPT, 0));
    }
}
