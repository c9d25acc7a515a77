//! Samples of a joint as a table that `jointctl fit` reads, with the description of it; host.
//!
//! Every signal of a row is of one control step, the one that SYNC marked, so that none lags another; a network takes
//! such a lag for friction. Times are those at which this machine received the samples: `fit` interpolates onto even
//! ones.

use super::error::RemoteError;
use super::joint::RemoteJoint;
use super::telemetry::{Sample, Telemetry};
use bus::client::{Subscription, SyncProducer, cob_id};
use joint_firmware::objects::field::Actual;
use std::fmt::Write;
use std::time::Duration;

/// SYNCs a second: least and most.
pub const RATES: [f64; 2] = [1.0, 1_000.0];
/// Columns of the table after the time, their decimals, and the signals in them.
const COLUMNS: [(&str, usize, Actual); 4] = [
    ("position_rad", 6, Actual::Position),
    ("velocity_rad_s", 5, Actual::Velocity),
    ("measured_torque_Nm", 4, Actual::Torque),
    ("gear_temperature_C", 1, Actual::GearTemperature),
];
/// The signals that a table needs.
pub const SIGNALS: [Actual; 4] = [Actual::Position, Actual::Velocity, Actual::Torque, Actual::GearTemperature];

/// Node that marks the instants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pace {
    /// This program, so many times a second.
    Send(f64),
    /// This program, which sends already, for other joints too, for as long as this lasts.
    Sent,
    /// Another node on the bus.
    Follow,
}

/// A recording that grows.
#[derive(Debug)]
pub struct Recorder {
    joint: RemoteJoint,
    telemetry: Telemetry,
    producer: Option<SyncProducer>,
    /// SYNCs of others, where there may be none: one's own frames are not heard.
    foreign: Option<Subscription>,
    /// SYNCs on the bus before.
    before: u64,
    samples: Vec<Sample>,
}

/// Recorded samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    /// The signals of a sample, in their order.
    pub signals: Vec<Actual>,
    /// Whole samples, in time.
    pub samples: Vec<Sample>,
    /// SYNCs that were sent, or heard.
    pub syncs: u64,
    /// Periods without a SYNC because this machine came late.
    pub late: u64,
}

impl Recorder {
    /// Has the joint answer every SYNC with these signals.
    pub fn begin(joint: &RemoteJoint, signals: &[Actual], pace: Pace) -> Result<Self, RemoteError> {
        let [low, high] = RATES;
        match pace {
            Pace::Send(rate) if !(low..=high).contains(&rate) => {
                return Err(RemoteError::Range { what: "the rate of samples", value: rate, low, high, unit: "Hz" });
            }
            _ => {}
        }
        let telemetry = Telemetry::begin(joint, signals)?;
        let network = joint.network();
        let foreign = (pace != Pace::Follow).then(|| network.subscribe(|frame| frame.id() == cob_id::SYNC));
        let before = network.syncs();
        let producer = match pace {
            Pace::Send(rate) => Some(SyncProducer::new(network, Duration::from_secs_f64(1.0 / rate))),
            Pace::Sent | Pace::Follow => None,
        };
        Ok(Self { joint: joint.clone(), telemetry, producer, foreign, before, samples: Vec::new() })
    }

    /// Waits for the next sample; none where it does not come within `timeout`.
    pub fn next(&mut self, timeout: Duration) -> Result<Option<&Sample>, RemoteError> {
        let sample = self.telemetry.next(timeout)?;
        if let Some(foreign) = &self.foreign
            && foreign.try_next()?.is_some()
        {
            return Err(RemoteError::OtherSync { node: self.joint.id() });
        }
        match sample {
            Some(sample) => {
                self.samples.push(sample);
                Ok(self.samples.last())
            }
            None => Ok(None),
        }
    }

    /// Puts the joint's PDOs back as they were, and gives what was recorded.
    pub fn end(self) -> Result<Recording, RemoteError> {
        let (syncs, late) = match self.producer {
            Some(producer) => producer.stop().map(|produced| (produced.sent, produced.missed))?,
            None => (self.joint.network().syncs() - self.before, 0),
        };
        let signals = self.telemetry.signals().iter().filter_map(|signal| match signal.field() {
            joint_firmware::objects::field::Field::Actual(actual) => Some(actual),
            _ => None,
        });
        let signals = signals.collect();
        self.telemetry.end()?;
        Ok(Recording { signals, samples: self.samples, syncs, late })
    }
}

impl Recording {
    /// SYNCs without a whole sample: a telegram of it was lost, or came after the end.
    pub fn unanswered(&self) -> u64 {
        self.syncs.saturating_sub(self.samples.len() as u64)
    }

    /// A signal over the samples; empty where it was not recorded.
    pub fn column(&self, actual: Actual) -> Vec<f64> {
        let place = self.signals.iter().position(|signal| *signal == actual);
        let value = |sample: &Sample| place.and_then(|place| sample.values.get(place).copied());
        self.samples.iter().filter_map(value).collect()
    }

    /// Time from the first to the last sample, s.
    pub fn duration(&self) -> f64 {
        match (self.samples.first(), self.samples.last()) {
            (Some(first), Some(last)) => last.at.saturating_duration_since(first.at).as_secs_f64(),
            _ => 0.0,
        }
    }

    /// The columns of the table by name, with the values as they came; NaN where nothing measures.
    pub fn columns(&self) -> Vec<(&'static str, Vec<f64>)> {
        let first = self.samples.first().map(|sample| sample.at);
        let since =
            |sample: &Sample| first.map_or(0.0, |first| sample.at.saturating_duration_since(first).as_secs_f64());
        let time = self.samples.iter().map(since).collect();
        let column = |(name, _, actual)| {
            let values = self.column(actual);
            (name, if values.is_empty() { vec![f64::NAN; self.samples.len()] } else { values })
        };
        [("time_s", time)].into_iter().chain(COLUMNS.map(column)).collect()
    }

    /// The table: a header and a row a sample. What is not a number is left empty.
    pub fn table(&self) -> String {
        let mut text = String::from("time_s");
        COLUMNS.iter().for_each(|(name, ..)| text.extend([",", name]));
        text.push('\n');
        let place = |actual| self.signals.iter().position(|signal| *signal == actual);
        let places = COLUMNS.map(|(_, decimals, actual)| (place(actual), decimals));
        for sample in &self.samples {
            let since = |first: &Sample| sample.at.saturating_duration_since(first.at).as_secs_f64();
            // Writing to a string does not fail.
            let _ = write!(text, "{:.6}", self.samples.first().map_or(0.0, since));
            for (place, decimals) in places {
                let value = place.and_then(|place| sample.values.get(place).copied()).unwrap_or(f64::NAN);
                let _ = if value.is_finite() { write!(text, ",{value:.decimals$}") } else { write!(text, ",") };
            }
            text.push('\n');
        }
        text
    }
}

/// Describes such a table, in the file `table` beside the description, for `jointctl fit`.
pub fn description(node: u8, table: &str) -> String {
    let (name, table) = (toml::Value::from(format!("node {node}")), toml::Value::from(table));
    format!(
        "# A joint recorded over its bus: see docs/your-own-joint.md.\n\
         name = {name}\n\n[source]\nfiles = [{table}]\n{}",
        include_str!("recording.toml")
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Instant;

    #[test]
    fn the_table_has_a_value_under_each_name_and_nothing_where_nothing_measures() {
        let at = Instant::now();
        let sample =
            |after: u64, values: [f64; 4]| Sample { at: at + Duration::from_millis(after), values: values.into() };
        let signals = vec![Actual::GearTemperature, Actual::Position, Actual::Velocity, Actual::Torque];
        let samples = vec![sample(0, [f64::NAN, 1.0, 2.0, 3.0]), sample(4, [25.04, -1.5, 0.25, -0.5])];
        let recording = Recording { signals, samples, syncs: 5, late: 0 };
        assert_eq!(
            recording.table(),
            "time_s,position_rad,velocity_rad_s,measured_torque_Nm,gear_temperature_C\n\
             0.000000,1.000000,2.00000,3.0000,\n\
             0.004000,-1.500000,0.25000,-0.5000,25.0\n"
        );
        let columns = recording.columns();
        assert_eq!(columns.iter().map(|(name, _)| *name).collect::<Vec<_>>(), recording_header(&recording));
        assert_eq!(columns[..2], [("time_s", vec![0.0, 0.004]), ("position_rad", vec![1.0, -1.5])]);
        assert!(columns[4].1[0].is_nan() && columns[4].1[1] == 25.04);
        assert_eq!((recording.unanswered(), recording.duration()), (3, 0.004));
        assert_eq!(recording.column(Actual::Position), [1.0, -1.5]);
    }

    fn recording_header(recording: &Recording) -> Vec<String> {
        let table = recording.table();
        table.lines().next().unwrap_or_default().split(',').map(str::to_owned).collect()
    }
}
