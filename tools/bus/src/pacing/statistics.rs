//! Statistics of a paced bus: load, and how long frames take; no I/O, host.

use std::collections::BTreeMap;
use std::time::Duration;

/// Times from handing a frame to its controller until its last bit is received.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Latency {
    frames: u64,
    least: Duration,
    most: Duration,
    sum: Duration,
}

impl Latency {
    fn add(&mut self, latency: Duration) {
        self.least = if self.frames == 0 { latency } else { self.least.min(latency) };
        self.most = self.most.max(latency);
        self.sum += latency;
        self.frames += 1;
    }

    /// Frames that were measured.
    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// The shortest.
    pub fn least(&self) -> Duration {
        self.least
    }

    /// The longest.
    pub fn most(&self) -> Duration {
        self.most
    }

    /// The mean; zero without frames.
    pub fn mean(&self) -> Duration {
        self.sum.checked_div(self.frames.min(u32::MAX.into()) as u32).unwrap_or_default()
    }
}

/// Counts since the bus began or since they were reset.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Statistics {
    since: Duration,
    frames: u64,
    busy: Duration,
    latencies: BTreeMap<u16, Latency>,
}

impl Statistics {
    pub(super) fn since(since: Duration) -> Self {
        Self { since, ..Self::default() }
    }

    pub(super) fn add(&mut self, id: u16, occupied: Duration, latency: Duration) {
        self.frames += 1;
        self.busy += occupied;
        self.latencies.entry(id).or_default().add(latency);
    }

    /// Frames on the wire.
    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// Time for which the bus was taken, interframe spaces included.
    pub fn busy(&self) -> Duration {
        self.busy
    }

    /// Share of the time until `now` for which the bus was taken, 0 to 1. `now` counts from the bus's beginning.
    pub fn load(&self, now: Duration) -> f64 {
        let elapsed = now.saturating_sub(self.since).as_secs_f64();
        if elapsed > 0.0 { self.busy.as_secs_f64() / elapsed } else { 0.0 }
    }

    /// Latencies by identifier.
    pub fn latencies(&self) -> &BTreeMap<u16, Latency> {
        &self.latencies
    }
}
