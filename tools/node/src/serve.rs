//! A node on a bus, in real time.

use crate::virtual_node::VirtualNode;
use bus::{BusError, Frame, Transport};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Time that is waited for a frame, and simulated at once.
const TICK: Duration = Duration::from_millis(1);
/// Time that is simulated at most before the bus is looked at again: a machine that is behind still answers, and a client
/// that reads a dozen objects one behind the other does not meet the joint's command deadline of 100 ms meanwhile.
const LONGEST: Duration = Duration::from_millis(2);
/// Frames that are taken at most before the node lives on: as many of the shortest, 47 bits, as a bus of 1 Mbit/s carries in that time.
const MOST: u32 = 42;
/// A machine that is so much behind gives the time up.
const LOST: Duration = Duration::from_millis(100);

/// What can be on a bus: simulated, with a time of its own.
pub trait Served {
    /// Its time.
    fn now(&self) -> Duration;

    /// Lives up to an instant of its time.
    ///
    /// # Errors
    /// What ended its life.
    fn live_until(&mut self, instant: Duration) -> Result<(), String>;

    /// A frame of somebody else's has come.
    fn receive(&mut self, frame: &Frame);

    /// The next frame that it sends.
    fn take_frame(&mut self) -> Option<Frame>;
}

impl Served for VirtualNode {
    fn now(&self) -> Duration {
        Duration::from_secs_f64(self.steps() as f64 / f64::from(self.rate()))
    }

    fn live_until(&mut self, instant: Duration) -> Result<(), String> {
        let steps = (instant.as_secs_f64() * f64::from(self.rate())) as u64;
        self.advance(steps.saturating_sub(self.steps()));
        Ok(())
    }

    fn receive(&mut self, frame: &Frame) {
        Self::receive(self, frame);
        self.work();
    }

    fn take_frame(&mut self) -> Option<Frame> {
        Self::take_frame(self)
    }
}

/// Why a node left the bus.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The bus.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// Its simulation.
    #[error("{0}")]
    Ended(String),
}

/// Runs the node until `stop`; simulated time that the machine was too slow for, s.
///
/// # Errors
/// A bus that is gone, a node that ended.
pub fn serve(node: &mut impl Served, bus: &dyn Transport, stop: &AtomicBool) -> Result<f64, ServeError> {
    let origin = node.now();
    let (mut start, mut lost) = (Instant::now(), Duration::ZERO);
    while !stop.load(Ordering::Relaxed) {
        // Frames do not wait for a machine that is behind to catch up, and it does not wait for them.
        let is_behind = origin + start.elapsed() > node.now() + TICK;
        let mut wait = if is_behind { Duration::ZERO } else { TICK };
        for _ in 0..MOST {
            let Some(frame) = bus.receive(wait)? else { break };
            node.receive(&frame);
            send(node, bus)?;
            wait = Duration::ZERO;
        }
        let target = origin + start.elapsed();
        let behind = target.saturating_sub(node.now());
        if behind > LOST {
            start += behind;
            lost += behind;
        } else {
            node.live_until(target.min(node.now() + LONGEST)).map_err(ServeError::Ended)?;
            send(node, bus)?;
        }
    }
    Ok(lost.as_secs_f64())
}

fn send(node: &mut impl Served, bus: &dyn Transport) -> Result<(), BusError> {
    while let Some(frame) = node.take_frame() {
        bus.send(&frame)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Simulates at half of the speed of time, and is sent much meanwhile.
    struct Slow<'a> {
        other: &'a dyn Transport,
        now: Duration,
        sent: u32,
        received: u32,
        stop: &'a AtomicBool,
    }

    impl Served for Slow<'_> {
        fn now(&self) -> Duration {
            self.now
        }

        fn live_until(&mut self, instant: Duration) -> Result<(), String> {
            if self.received != self.sent {
                return Err(format!("{} of {} frames received", self.received, self.sent));
            }
            std::thread::sleep(2 * (instant - self.now));
            self.now = instant;
            for _ in 0..MOST {
                self.other.send(&Frame::new(0x305, &[0; 8]).unwrap()).unwrap();
                self.sent += 1;
            }
            self.stop.store(self.sent > 4_000, Ordering::Relaxed);
            Ok(())
        }

        fn receive(&mut self, _: &Frame) {
            self.received += 1;
        }

        fn take_frame(&mut self) -> Option<Frame> {
            None
        }
    }

    #[test]
    fn a_node_that_is_behind_hears_what_was_sent_before_it_lives_on() {
        let [own, other] = ["virtual:slow", "virtual:slow"].map(|bus| bus::open(bus).unwrap());
        let stop = AtomicBool::new(false);
        let mut node = Slow { other: &*other, now: Duration::ZERO, sent: 0, received: 0, stop: &stop };
        let given_up = serve(&mut node, &*own, &stop).unwrap();
        assert!(node.sent > 4_000 && given_up > 0.0);
    }
}
