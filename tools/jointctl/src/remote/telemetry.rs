//! Telemetry of a joint, sample by sample in SI units: TPDOs that follow SYNC; host.
//!
//! [`Telemetry::begin`] packs the wanted signals into as few TPDOs as carry them and has them answer every SYNC,
//! so that all values of a sample are of one control step. Somebody has to send SYNC:
//! [`bus::client::SyncProducer`], once for all joints of a bus. [`Telemetry::end`] puts the PDOs back; dropping it
//! does too, and says nothing where that fails.

use super::configured;
use super::entry::Entry;
use super::error::RemoteError;
use super::joint::RemoteJoint;
use super::pdo::{Change, Direction, Pdo, unpack};
use bus::client::{Command, NmtState, Received, Subscription};
use canopen_node::{MAPPED, MappedObject, PDOS, PdoParameters};
use joint_firmware::objects::field::{Actual, Field};
use std::time::{Duration, Instant};

/// Bits of a TPDO.
const CONTENT: u32 = 64;
/// Samples after which it counts how many are lost: one that is only late has come by then.
const BLOCK: u64 = 64;
/// Transmission type: with every SYNC.
const EVERY_SYNC: u8 = 1;

/// Signals of a joint that a control engineer wants first: state, motion, torques, friction.
pub const USUAL: [Actual; 8] = [
    Actual::Position,
    Actual::Velocity,
    Actual::Statusword,
    Actual::Torque,
    Actual::TorqueDemand,
    Actual::CompensationTorque,
    Actual::Residual,
    Actual::GearTemperature,
];

/// One signal of a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Signal {
    /// Its object.
    pub entry: Entry,
    /// Unit of the decoded values: the table's, with torques in Nm where the table has parts of the rated torque.
    pub unit: &'static str,
    /// Factor of the table's value.
    factor: f64,
}

impl Signal {
    /// The field.
    pub fn field(&self) -> Field {
        self.entry.object.field
    }

    /// A raw value of the bus in [`Signal::unit`]; not a number where nothing measures it.
    fn decode(&self, raw: u64) -> f64 {
        let value = self.entry.decode_raw(raw);
        match value.number() {
            Some(number) if !self.entry.is_unknown(&value) => number * self.factor,
            _ => f64::NAN,
        }
    }
}

/// All signals at one instant.
#[derive(Clone, Debug, PartialEq)]
pub struct Sample {
    /// Time at which its first TPDO was received.
    pub at: Instant,
    /// One for each of [`Telemetry::signals`].
    pub values: Vec<f64>,
}

/// Signals of a joint, as they come.
#[derive(Debug)]
pub struct Telemetry {
    joint: RemoteJoint,
    signals: Vec<Signal>,
    changes: Vec<Change>,
    /// Presence of a date of the configuration at the beginning.
    dated: bool,
    /// Places of each TPDO's signals.
    places: Vec<Vec<usize>>,
    frames: Subscription,
    /// TPDOs of the sample that is coming.
    arrived: Vec<Option<Received>>,
    unanswered: Unanswered,
    incomplete: u64,
    ended: bool,
}

impl Telemetry {
    /// Has the joint send these signals with every SYNC, and puts it into OPERATIONAL, where PDOs exist. A joint
    /// there without set-points brakes and stays off: nothing moves because of this.
    pub fn begin(joint: &RemoteJoint, wanted: &[Actual]) -> Result<Self, RemoteError> {
        let rated = joint.number(Field::Actual(Actual::RatedTorque))?;
        let signals = wanted.iter().map(|actual| signal(*actual, rated)).collect::<Vec<_>>();
        let places = distribute(&signals)?;
        let mut telemetry = Self {
            joint: joint.clone(),
            signals,
            changes: Vec::new(),
            dated: false,
            places,
            frames: joint.network().subscribe(|_| false),
            arrived: Vec::new(),
            unanswered: Unanswered::default(),
            incomplete: 0,
            ended: false,
        };
        // The PDOs that have been changed are put back if one of them fails.
        telemetry.dated = configured::keep(joint, || {
            for (pdo, places) in Pdo::all(Direction::Transmit).into_iter().zip(&telemetry.places) {
                let base = 0x180 + 0x100 * u16::from(pdo.number) + u16::from(joint.id());
                let mapping: Vec<_> = places.iter().filter_map(|at| telemetry.signals.get(*at)).map(mapped).collect();
                let wanted = PdoParameters { transmission: EVERY_SYNC, ..PdoParameters::new(base, &mapping) };
                telemetry.changes.push(pdo.ensure(joint, &wanted)?);
            }
            Ok(())
        })?;
        let identifiers = telemetry.changes.iter().map(Change::identifier).collect::<Vec<_>>();
        telemetry.arrived = vec![None; identifiers.len()];
        telemetry.frames = joint.network().subscribe(move |frame| identifiers.contains(&frame.id()));
        joint.nmt(Command::Start, NmtState::Operational)?;
        Ok(telemetry)
    }

    /// The signals, in the order that they were asked for in, which is that of a sample's values.
    pub fn signals(&self) -> &[Signal] {
        &self.signals
    }

    /// Place of a signal in a sample.
    pub fn place(&self, actual: Actual) -> Option<usize> {
        self.signals.iter().position(|signal| signal.field() == Field::Actual(actual))
    }

    /// The next sample; none where it did not come within `timeout`.
    pub fn next(&mut self, timeout: Duration) -> Result<Option<Sample>, RemoteError> {
        let deadline = Instant::now() + timeout;
        loop {
            let Some(received) = self.frames.next(deadline.saturating_duration_since(Instant::now()))? else {
                return Ok(None);
            };
            if let Some(sample) = self.take(received) {
                return Ok(Some(sample));
            }
        }
    }

    fn take(&mut self, received: Received) -> Option<Sample> {
        let at = self.changes.iter().position(|change| change.identifier() == received.frame.id())?;
        if self.arrived.get(at)?.is_some() {
            // The rest of the sample before was lost.
            self.incomplete += 1;
            self.arrived.fill(None);
        }
        *self.arrived.get_mut(at)? = Some(received);
        let frames = self.arrived.iter().copied().collect::<Option<Vec<_>>>()?;
        self.arrived.fill(None);
        let mut values = vec![f64::NAN; self.signals.len()];
        for ((change, places), received) in self.changes.iter().zip(&self.places).zip(&frames) {
            let raw = unpack(change.parameters(), received.frame.data());
            for (at, (_, raw)) in places.iter().zip(raw) {
                if let (Some(value), Some(signal)) = (values.get_mut(*at), self.signals.get(*at)) {
                    *value = signal.decode(raw);
                }
            }
        }
        let at = frames.iter().map(|received| received.at).min()?;
        self.unanswered.sample(frames.iter().map(|received| received.syncs).min()?);
        Some(Sample { at, values })
    }

    /// Samples that are missing, whole or in part: SYNCs that none followed, told 64 samples later.
    pub fn lost(&self) -> u64 {
        self.unanswered.lost.max(self.incomplete)
    }

    /// Puts the PDOs back as they were.
    pub fn end(mut self) -> Result<(), RemoteError> {
        self.put_back()
    }

    /// Ends without a change of the PDOs: for another client that has changed them meanwhile.
    pub fn leave(mut self) {
        self.ended = true;
    }

    fn put_back(&mut self) -> Result<(), RemoteError> {
        if std::mem::replace(&mut self.ended, true) {
            return Ok(());
        }
        let undo = || self.changes.iter().try_for_each(|change| change.undo(&self.joint));
        if self.dated { configured::keep(&self.joint, undo).map(drop) } else { undo() }
    }
}

impl Drop for Telemetry {
    fn drop(&mut self) {
        // Nobody is left to be told; a bus that is gone has told everyone.
        let _ = self.put_back();
    }
}

/// SYNCs that no sample followed.
///
/// A sample may come after the next SYNC, one that is lost does not come at all: what counts is the least number
/// of SYNCs beyond the samples within [`BLOCK`] of them, against the least that there ever was.
#[derive(Debug, Default)]
struct Unanswered {
    samples: u64,
    /// Least number of SYNCs beyond the samples in this block.
    beyond: Option<i64>,
    least: Option<i64>,
    lost: u64,
}

impl Unanswered {
    /// A sample has come, and by then `syncs` had.
    fn sample(&mut self, syncs: u64) {
        self.samples += 1;
        let beyond = syncs as i64 - self.samples as i64;
        let beyond = *self.beyond.insert(self.beyond.map_or(beyond, |least| least.min(beyond)));
        if self.samples.is_multiple_of(BLOCK) {
            let least = *self.least.insert(self.least.map_or(beyond, |least| least.min(beyond)));
            self.lost = self.lost.max((beyond - least) as u64);
            self.beyond = None;
        }
    }
}

fn signal(actual: Actual, rated: f64) -> Signal {
    let entry = Entry::of(Field::Actual(actual));
    match entry.text.unit {
        "of 6076h" => Signal { entry, unit: "Nm", factor: rated },
        unit => Signal { entry, unit, factor: 1.0 },
    }
}

fn mapped(signal: &Signal) -> MappedObject {
    let object = signal.entry.object;
    MappedObject::new(object.index, object.sub_index, 8 * object.data_type.bytes().unwrap_or(0))
}

/// Places of the signals of each TPDO: the longest first, each into the first TPDO with room.
fn distribute(signals: &[Signal]) -> Result<Vec<Vec<usize>>, RemoteError> {
    let bits = signals.iter().map(|signal| mapped(signal).bits()).sum();
    if let Some(signal) = signals.iter().find(|signal| !signal.entry.object.mappable.transmit) {
        let problem = "cannot be part of a TPDO".into();
        return Err(RemoteError::Value { object: signal.entry.described(), problem });
    }
    let mut sorted = signals.iter().enumerate().collect::<Vec<_>>();
    sorted.sort_by_key(|(_, signal)| std::cmp::Reverse(mapped(signal).bits()));
    let mut groups: Vec<(u32, Vec<usize>)> = Vec::new();
    for (at, signal) in sorted {
        let length = mapped(signal).bits();
        let room = |(used, group): &(u32, Vec<usize>)| used + length <= CONTENT && group.len() < MAPPED;
        let with_room = groups.iter().position(room).unwrap_or(groups.len());
        if with_room == PDOS {
            return Err(RemoteError::TooManySignals { signals: signals.len(), bits });
        }
        groups.resize_with(groups.len().max(with_room + 1), Default::default);
        if let Some((used, group)) = groups.get_mut(with_room) {
            *used += length;
            group.push(at);
        }
    }
    Ok(groups.into_iter().map(|(_, group)| group).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn signals(actuals: &[Actual]) -> Vec<Signal> {
        actuals.iter().map(|actual| signal(*actual, 10.0)).collect()
    }

    #[test]
    fn signals_are_packed_whole_and_each_once() {
        let signals = signals(&USUAL);
        let groups = distribute(&signals).unwrap();
        let length = |group: &Vec<usize>| group.iter().map(|at| mapped(&signals[*at]).bits()).sum::<u32>();
        assert_eq!(groups.iter().map(length).collect::<Vec<_>>(), [64, 64, 32]);
        let mut all = groups.concat();
        all.sort_unstable();
        assert_eq!(all, (0..USUAL.len()).collect::<Vec<_>>());
    }

    #[test]
    fn what_does_not_fit_or_cannot_be_mapped_is_refused() {
        let error = distribute(&signals(&[Actual::Position; 9])).unwrap_err().to_string();
        assert_eq!(error, "9 signals of 288 bits do not fit into 4 TPDOs of 64 bits");
        let error = distribute(&signals(&[Actual::RatedTorque])).unwrap_err().to_string();
        assert!(error.contains("motor-rated-torque (6076h:0): cannot be part of a TPDO"), "{error}");
    }

    #[test]
    fn a_sync_without_a_sample_counts_and_one_whose_sample_is_late_does_not() {
        // Sixty SYNCs before the first that is answered; every third sample comes after the next SYNC.
        let mut unanswered = Unanswered::default();
        let mut count = |syncs: std::ops::Range<u64>| {
            syncs.for_each(|sync| unanswered.sample(sync + u64::from(sync % 3 == 0)));
            unanswered.lost
        };
        assert_eq!(count(60..60 + 10 * BLOCK), 0);
        let end = 60 + 10 * BLOCK;
        assert_eq!(count(end + 1..end + BLOCK), 0);
        assert_eq!(count(end + BLOCK..end + 2 * BLOCK + 1), 1);
        assert_eq!(count(end + 2 * BLOCK + 12..end + 4 * BLOCK + 12), 12);
    }

    #[test]
    fn values_are_in_si_units_and_what_nothing_measures_is_no_number() {
        let [torque, velocity, bridge] =
            [Actual::Torque, Actual::Velocity, Actual::BridgeTemperature].map(|a| signal(a, 20.0));
        assert_eq!((torque.unit, velocity.unit, bridge.unit), ("Nm", "rad/s", "°C"));
        assert!((torque.decode(0xFFFF_u64) + 0.02).abs() < 1e-12);
        assert!((velocity.decode(1_500) - 1.5).abs() < 1e-12);
        assert!(bridge.decode(0x8000).is_nan() && (bridge.decode(0xFFFF) + 0.1).abs() < 1e-12);
    }
}
