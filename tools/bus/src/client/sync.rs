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
    /// Periods without one, because the host came late by more than a period: they are left out, not sent in a burst.
    pub missed: u64,
    /// The latest that a SYNC was sent after its time.
    pub latest: Duration,
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
                let periods = late.as_nanos() / period.as_nanos();
                produced.missed += periods as u64;
                due += period * (periods as u32).saturating_add(1);
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
