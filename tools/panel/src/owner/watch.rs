//! Live values of a joint as they come: samples, changes of its state, EMCYs.

use super::{Setup, Syncs};
use crate::live::{BY_PART, DRAWN, Kept, Reduction, STATE, Stroke, rounded};
use bus::client::{Emergency, Subscription, SyncProducer, cob_id};
use joint_firmware::objects::field::{Actual, Field};
use joint_firmware::objects::settings::Setting;
use jointctl::remote::condition::{self, faults_of, state_of};
use jointctl::remote::words::words;
use jointctl::remote::{RemoteError, RemoteJoint, Signal, Telemetry};
use serde_json::{Value, json};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Samples that are taken at once at most, so that orders and STOP have their turn.
const AT_ONCE: usize = 2_000;
/// Time between two messages with strokes; a page draws more often.
const BATCH: Duration = Duration::from_millis(50);
/// Time without a sample that a page is told of.
const SILENCE: Duration = Duration::from_secs(1);
/// Time after another client's request in which no slow values are read.
const SHARED: Duration = Duration::from_secs(2);
/// Objects of the TPDOs: communication and mapping (CiA 301, 7.5.2.37 and 38).
const TPDOS: [std::ops::RangeInclusive<u16>; 2] = [0x1800..=0x19FF, 0x1A00..=0x1BFF];

/// Signals that are watched.
pub struct Watch {
    telemetry: Telemetry,
    sync: Option<Arc<SyncProducer>>,
    /// SYNCs of others.
    foreign_syncs: Subscription,
    /// SDO requests of other clients.
    foreign_requests: Subscription,
    /// Time at which the last one came.
    requested: Option<Instant>,
    emergencies: Subscription,
    node: u8,
    drawn: usize,
    /// Current that the thousandths of 6078h refer to, A.
    rated_current: f64,
    began: Instant,
    last: Instant,
    silent: bool,
    state: Vec<f64>,
    reduction: Reduction,
    kept: Kept,
    strokes: Vec<Stroke>,
    told: Instant,
}

/// Unit of parts of the motor's rated current in the table.
const OF_CURRENT: &str = "of 6075h";

fn unit(signal: &Signal) -> &'static str {
    if signal.unit == OF_CURRENT { "A" } else { signal.unit }
}

/// Returns `true` if a frame of another client begins to write an object of the TPDOs: an SDO download (CiA 301,
/// 7.2.4.3.3).
fn changes_tpdos(data: &[u8]) -> bool {
    matches!(data, [command, low, high, ..] if command >> 5 == 1
        && TPDOS.iter().any(|range| range.contains(&u16::from_le_bytes([*low, *high]))))
}

impl Watch {
    /// Has the joint send what it has of [`DRAWN`], or of [`BY_PART`], and of [`STATE`] with every SYNC.
    pub fn begin(setup: &Setup, joint: &RemoteJoint, by_part: bool) -> Result<Self, RemoteError> {
        let mut wanted = Vec::new();
        let mut drawn = 0;
        let all = if by_part { BY_PART } else { DRAWN };
        for actual in all.into_iter().chain(STATE) {
            match joint.raw(Field::Actual(actual)) {
                Ok(_) => wanted.push(actual),
                Err(error) if error.is_absent() => continue,
                Err(error) => return Err(error),
            }
            drawn += usize::from(all.contains(&actual));
        }
        let rated_current = joint.number(Field::Setting(Setting::CurrentLimit))?;
        let (network, node) = (joint.network(), joint.id());
        let requests = cob_id::SDO_RECEIVE | u16::from(node);
        let telemetry = Telemetry::begin(joint, &wanted)?;
        let syncs: &Syncs = &setup.syncs;
        let now = Instant::now();
        Ok(Self {
            telemetry,
            sync: Some(syncs.join()),
            foreign_syncs: network.subscribe(|frame| frame.id() == cob_id::SYNC),
            foreign_requests: network.subscribe(move |frame| frame.id() == requests),
            requested: None,
            emergencies: network.emergencies(),
            node,
            drawn,
            rated_current,
            began: now,
            last: now,
            silent: false,
            state: Vec::new(),
            reduction: Reduction::default(),
            kept: Kept::default(),
            strokes: Vec::new(),
            told: now,
        })
    }

    fn drawn(&self) -> impl Iterator<Item = &Signal> {
        self.telemetry.signals().iter().take(self.drawn)
    }

    /// Names and units, and whether a signal's numbers stand for words, for a page.
    pub fn signals(&self) -> Value {
        let told = |signal: &Signal| {
            let worded = words(signal.entry.object.field, 0).is_some();
            json!({ "name": signal.entry.name(), "unit": unit(signal), "worded": worded })
        };
        self.drawn().map(told).collect()
    }

    /// The last minute as a table.
    pub fn csv(&self) -> String {
        let name = |signal: &Signal| match unit(signal) {
            "" => signal.entry.name(),
            unit => format!("{}_{}", signal.entry.name(), unit.replace('/', "_")),
        };
        self.kept.csv(&self.drawn().map(name).collect::<Vec<_>>())
    }

    /// Tells what has come since the last time, as messages.
    pub fn look(&mut self, tell: &mut dyn FnMut(Value)) -> Result<(), RemoteError> {
        if self.is_changed()? {
            let problem = "another client changes the TPDOs; live values ended, Look begins anew".into();
            return Err(RemoteError::Image { node: self.node, problem });
        }
        let mut foreign = false;
        while self.foreign_syncs.try_next()?.is_some() {
            foreign = true;
        }
        if foreign && self.sync.take().is_some() {
            tell(self.event("note", "another client sends SYNC: its rate counts", Instant::now()));
        }
        for _ in 0..AT_ONCE {
            let Some(sample) = self.telemetry.next(Duration::ZERO)? else { break };
            self.last = sample.at;
            let time = sample.at.saturating_duration_since(self.began).as_secs_f64();
            let mut values = sample.values;
            let state = values.split_off(self.drawn.min(values.len()));
            for (value, signal) in values.iter_mut().zip(self.telemetry.signals()) {
                if signal.unit == OF_CURRENT {
                    *value *= self.rated_current;
                }
            }
            self.changed(state, sample.at, tell);
            self.strokes.extend(self.reduction.push(time, &values));
            self.kept.push(time, values);
        }
        while let Some(received) = self.emergencies.try_next()? {
            if let Some(emergency) = Emergency::decode(&received.frame).filter(|emergency| emergency.node == self.node)
            {
                tell(self.event("emcy", &emergency.to_string(), received.at));
            }
        }
        if self.told.elapsed() >= BATCH && !self.strokes.is_empty() {
            self.told = Instant::now();
            tell(self.batch());
        }
        let silent = self.last.elapsed() > SILENCE;
        if silent != self.silent {
            self.silent = silent;
            tell(json!({ "silent": silent }));
        }
        Ok(())
    }

    /// Returns `true` if another client has written to the TPDOs.
    fn is_changed(&mut self) -> Result<bool, RemoteError> {
        while let Some(received) = self.foreign_requests.try_next()? {
            self.requested = Some(received.at);
            if changes_tpdos(received.frame.data()) {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Returns `true` if another client asks the joint something: a question in between would end its transfer.
    pub fn is_shared(&self) -> bool {
        self.requested.is_some_and(|at| at.elapsed() < SHARED)
    }

    fn event(&self, kind: &str, text: &str, at: Instant) -> Value {
        let time = at.saturating_duration_since(self.began).as_secs_f64();
        json!({ "event": { "t": rounded(time), "kind": kind, "text": text } })
    }

    /// Marks where state, faults or acting model are others than before.
    fn changed(&mut self, state: Vec<f64>, at: Instant, tell: &mut dyn FnMut(Value)) {
        for (place, value) in state.iter().enumerate() {
            let signal = self.telemetry.signals().get(self.drawn + place).map(Signal::field);
            let before = self.state.get(place).copied();
            let (kind, text) = match signal {
                Some(Field::Actual(Actual::Statusword)) => {
                    let now = state_of(*value as u16);
                    if before.is_some_and(|before| state_of(before as u16) == now) {
                        continue;
                    }
                    ("state", condition::name(now).to_owned())
                }
                _ if before == Some(*value) => continue,
                Some(Field::Actual(Actual::LatchedFaults)) => match faults_of(*value as u16).as_slice() {
                    [] => ("faults", "none".to_owned()),
                    faults => ("faults", condition::list(faults)),
                },
                Some(Field::Actual(Actual::ActingModel)) => {
                    let models = ["nothing", "the physical model", "the physical model and the network"];
                    ("model", models.get(*value as usize).copied().unwrap_or("unknown").to_owned())
                }
                _ => continue,
            };
            tell(self.event(kind, &text, at));
        }
        self.state = state;
    }

    fn batch(&mut self) -> Value {
        let strokes = std::mem::take(&mut self.strokes);
        let row = |values: &[f64]| values.iter().map(|value| rounded(*value)).collect::<Vec<_>>();
        json!({ "live": {
            "t": strokes.iter().map(|stroke| rounded(stroke.time)).collect::<Vec<_>>(),
            "low": strokes.iter().map(|stroke| row(&stroke.low)).collect::<Vec<_>>(),
            "high": strokes.iter().map(|stroke| row(&stroke.high)).collect::<Vec<_>>(),
            "lost": self.telemetry.lost(),
        }})
    }

    /// Puts the TPDOs back as they were, where nobody else has changed them meanwhile.
    pub fn end(mut self) -> Result<(), RemoteError> {
        if self.is_changed()? {
            self.telemetry.leave();
            return Ok(());
        }
        self.telemetry.end()
    }

    /// Leaves the TPDOs to another client that has changed them.
    pub fn leave(self) {
        self.telemetry.leave();
    }
}

#[cfg(test)]
mod tests {
    use super::changes_tpdos;

    #[test]
    fn writes_to_the_tpdos_are_told_from_reads_and_from_writes_to_other_objects() {
        assert!(changes_tpdos(&[0x2F, 0x00, 0x1A, 0, 0, 0, 0, 0]));
        assert!(changes_tpdos(&[0x23, 0x03, 0x18, 1, 0, 0, 0, 0]));
        assert!(!changes_tpdos(&[0x40, 0x00, 0x1A, 0, 0, 0, 0, 0]));
        assert!(!changes_tpdos(&[0x2F, 0x00, 0x1C, 0, 0, 0, 0, 0]));
        assert!(!changes_tpdos(&[0x2F, 0xFF, 0x17, 0, 0, 0, 0, 0]));
        assert!(!changes_tpdos(&[]));
    }
}
