//! A bus that loses and delays frames on their way out.

use bus::{BusError, Frame, Transport};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

/// Loses one frame in `loss` of those that `concerned` selects, and keeps one in `delay` back for a while.
#[derive(Debug)]
pub struct Disturbed {
    pub bus: Arc<dyn Transport>,
    pub loss: u32,
    pub delay: u32,
    pub concerned: fn(&Frame) -> bool,
    pub random: AtomicU32,
    pub lost: AtomicU32,
}

impl Disturbed {
    pub fn new(bus: Arc<dyn Transport>, loss: u32, delay: u32, concerned: fn(&Frame) -> bool) -> Self {
        Self { bus, loss, delay, concerned, random: AtomicU32::new(1), lost: AtomicU32::new(0) }
    }
}

impl Transport for Disturbed {
    fn name(&self) -> &str {
        self.bus.name()
    }

    fn send(&self, frame: &Frame) -> Result<(), BusError> {
        let step = |random: u32| Some(random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223));
        let random = self.random.fetch_update(Ordering::Relaxed, Ordering::Relaxed, step).unwrap() >> 8;
        if (self.concerned)(frame) {
            if random.is_multiple_of(self.loss) {
                self.lost.fetch_add(1, Ordering::Relaxed);
                return Ok(());
            }
            if random.is_multiple_of(self.delay) {
                std::thread::sleep(Duration::from_millis(3));
            }
        }
        self.bus.send(frame)
    }

    fn receive(&self, timeout: Duration) -> Result<Option<Frame>, BusError> {
        self.bus.receive(timeout)
    }
}
