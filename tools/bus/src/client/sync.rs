//! A SYNC producer: one frame each period, in a thread; host.

use super::error::ClientError;
use super::network::Network;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Sends SYNC until it is dropped or the bus fails.
#[derive(Debug)]
pub struct SyncProducer {
    stop: Option<Sender<()>>,
    thread: Option<JoinHandle<Result<Produced, ClientError>>>,
}

/// Accuracy with which the period was kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Produced {
    /// SYNCs that were sent.
    pub sent: u64,
    /// Periods without one, because the host came late by more than half of one: they are left out, so that two
    /// SYNCs are half a period apart at least.
    pub missed: u64,
    /// The latest that a SYNC was sent after its time.
    pub latest: Duration,
}

/// Periods that are left out after a SYNC that was late: the time after it to the nearest, so that none follows
/// sooner than half a period. Nodes leave out what comes too soon.
fn missed(late: Duration, period: Duration) -> u32 {
    let rounded = (late.as_nanos() + period.as_nanos() / 2) / period.as_nanos();
    u32::try_from(rounded).unwrap_or(u32::MAX)
}

impl SyncProducer {
    /// Sends the first SYNC at once. A host keeps periods of 1 ms to some 0.1 ms at best; a joint's control does not
    /// depend on it. A period of zero counts as 1 us.
    pub fn new(network: &Network, period: Duration) -> Self {
        let (stop, stopped) = channel::<()>();
        let network = network.clone();
        let period = period.max(Duration::from_micros(1));
        let thread = std::thread::spawn(move || {
            let mut produced = Produced::default();
            let mut due = Instant::now();
            loop {
                match stopped.recv_timeout(due.saturating_duration_since(Instant::now())) {
                    Err(RecvTimeoutError::Timeout) => {}
                    _ => return Ok(produced),
                }
                let late = due.elapsed();
                network.sync()?;
                produced.sent += 1;
                produced.latest = produced.latest.max(late);
                let periods = missed(late, period);
                produced.missed += u64::from(periods);
                due += period * periods.saturating_add(1);
            }
        });
        Self { stop: Some(stop), thread: Some(thread) }
    }

    /// Stops, and says how it went.
    pub fn stop(mut self) -> Result<Produced, ClientError> {
        self.stop.take();
        match self.thread.take().map(JoinHandle::join) {
            Some(Ok(produced)) => produced,
            Some(Err(panic)) => std::panic::resume_unwind(panic),
            None => Ok(Produced::default()),
        }
    }
}

impl Drop for SyncProducer {
    fn drop(&mut self) {
        self.stop.take();
        if let Some(thread) = self.thread.take() {
            // A failure of the bus is told to everyone else who uses it.
            let _ = thread.join();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sync_follows_half_a_period_after_a_late_one_at_the_soonest() {
        let period = Duration::from_millis(1);
        for late in (0..10_000).map(Duration::from_micros) {
            let next = period * (missed(late, period) + 1);
            assert!(next >= late + period / 2 && next <= late + 3 * period / 2, "{late:?}");
        }
        assert_eq!([499, 500, 1_499, 1_500].map(|late| missed(Duration::from_micros(late), period)), [0, 1, 1, 2]);
    }
}
