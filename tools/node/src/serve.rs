//! A node on a bus, in real time.

use crate::virtual_node::VirtualNode;
use bus::{BusError, Frame, Transport};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Time that is waited for a frame, and simulated at once.
const TICK: Duration = Duration::from_millis(1);
/// Time that is simulated at most before the bus is looked at again: a machine that is behind still answers, and a
/// client that reads a dozen objects one behind the other does not meet the joint's command deadline of 100 ms
/// meanwhile.
const LONGEST: Duration = Duration::from_millis(2);
/// Frames that are taken at most before the node lives on: as many of the shortest, 47 bits, as a bus of 1 Mbit/s
/// carries in that time.
const MOST: u32 = 42;
/// Time of a bit on the wire, at 1 Mbit/s.
const BIT: Duration = Duration::from_micros(1);
/// A machine that is so much behind gives the time up.
const LOST: Duration = Duration::from_millis(100);

/// Participant of a bus: simulated, with a time of its own.
pub trait Served {
    /// Its time.
    fn now(&self) -> Duration;

    /// Lives up to an instant of its time.
    ///
    /// # Errors
    /// Reason for the end of its life.
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

/// Reason for which a node left the bus.
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
    let start = Instant::now();
    serve_by(&|| start.elapsed(), node, bus, stop)
}

/// The same by another clock.
fn serve_by(
    clock: &impl Fn() -> Duration,
    node: &mut impl Served,
    bus: &dyn Transport,
    stop: &AtomicBool,
) -> Result<f64, ServeError> {
    let origin = node.now();
    let (start, mut lost) = (clock(), Duration::ZERO);
    // Time of the node if it were as fast as the clock.
    let target = |lost| origin + clock().saturating_sub(start + lost);
    while !stop.load(Ordering::Relaxed) {
        // Frames do not wait for a machine that is behind to catch up, and it does not wait for them.
        let is_behind = target(lost) > node.now() + TICK;
        let mut wait = if is_behind { Duration::ZERO } else { TICK };
        let begun = node.now();
        let mut carried = Duration::ZERO;
        for _ in 0..MOST {
            let Some(frame) = bus.receive(wait)? else { break };
            // Frames that waited for this machine came one after the other, as a bus carries them.
            let until = target(lost).min(begun + carried);
            if until > node.now() {
                node.live_until(until).map_err(ServeError::Ended)?;
            }
            node.receive(&frame);
            carried += on_the_wire(&frame) + send(node, bus)?;
            wait = Duration::ZERO;
        }
        let now = target(lost);
        let behind = now.saturating_sub(node.now());
        if behind > LOST {
            lost += behind;
        } else {
            let until = now.min(begun + LONGEST).max(node.now());
            node.live_until(until).map_err(ServeError::Ended)?;
            send(node, bus)?;
        }
    }
    Ok(lost.as_secs_f64())
}

/// Sends what the node has to say; the time that it takes on the wire.
fn send(node: &mut impl Served, bus: &dyn Transport) -> Result<Duration, BusError> {
    let mut carried = Duration::ZERO;
    while let Some(frame) = node.take_frame() {
        bus.send(&frame)?;
        carried += on_the_wire(&frame);
    }
    Ok(carried)
}

/// Time that a frame takes on the wire, without stuff bits (ISO 11898-1, base format).
fn on_the_wire(frame: &Frame) -> Duration {
    BIT * (47 + 8 * frame.data().len() as u32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use joint_firmware::default_configuration::BOARDS;
    use std::cell::Cell;

    /// Takes twice as long as what it simulates, by a clock that only it moves on, while others on the bus do
    /// something.
    struct Slow<'a, F> {
        now: Duration,
        clock: &'a Cell<Duration>,
        received: u32,
        others: F,
    }

    impl<'a, F: FnMut(u32, Duration) -> Result<(), String>> Slow<'a, F> {
        /// `others` is given the frames received and the node's time, after each piece of its life.
        fn new(clock: &'a Cell<Duration>, others: F) -> Self {
            Self { now: Duration::ZERO, clock, received: 0, others }
        }
    }

    impl<F: FnMut(u32, Duration) -> Result<(), String>> Served for Slow<'_, F> {
        fn now(&self) -> Duration {
            self.now
        }

        fn live_until(&mut self, instant: Duration) -> Result<(), String> {
            // Looking at the clock takes time as well, whatever is simulated.
            self.clock.set(self.clock.get() + 2 * (instant - self.now) + Duration::from_micros(100));
            self.now = instant;
            (self.others)(self.received, self.now)
        }

        fn receive(&mut self, _: &Frame) {
            self.received += 1;
        }

        fn take_frame(&mut self) -> Option<Frame> {
            None
        }
    }

    fn frame() -> Frame {
        Frame::new(0x305, &[0; 8]).unwrap()
    }

    #[test]
    fn a_node_that_is_behind_hears_what_was_sent_in_the_time_that_a_bus_takes_for_it() {
        let [own, other] = ["virtual:slow", "virtual:slow"].map(|bus| bus::open(bus).unwrap());
        let (stop, clock) = (AtomicBool::new(false), Cell::new(Duration::ZERO));
        let (mut sent, mut last) = (0, Duration::ZERO);
        let mut node = Slow::new(&clock, |received, now| {
            if received != sent {
                let took = now - last;
                let late = took > MOST * on_the_wire(&frame());
                return if late { Err(format!("{received} of {sent} frames received after {took:?}")) } else { Ok(()) };
            }
            last = now;
            for _ in 0..MOST {
                other.send(&frame()).unwrap();
                sent += 1;
            }
            stop.store(sent > 4_000, Ordering::Relaxed);
            Ok(())
        });
        let given_up = serve_by(&|| clock.get(), &mut node, &*own, &stop).unwrap();
        assert!(given_up > 0.0 && node.received + MOST > 4_000);
    }

    /// Twenty SYNCs of a master that has a period of 1 ms, and a machine that was late by as much: nodes leave out
    /// a SYNC that comes too soon after another.
    #[test]
    fn frames_that_waited_come_one_after_the_other_as_a_bus_carries_them() {
        /// Notes the time of each frame; answers with one of 8 bytes.
        struct Noting<'a> {
            now: Duration,
            clock: &'a Cell<Duration>,
            stop: &'a AtomicBool,
            at: Vec<Duration>,
            answers: usize,
        }
        impl Served for Noting<'_> {
            fn now(&self) -> Duration {
                self.now
            }
            fn live_until(&mut self, instant: Duration) -> Result<(), String> {
                self.now = instant;
                Ok(())
            }
            fn receive(&mut self, _: &Frame) {
                self.at.push(self.now);
                self.answers += 1;
                self.stop.store(self.at.len() == 20, Ordering::Relaxed);
                self.clock.set(self.clock.get() + Duration::from_micros(1));
            }
            fn take_frame(&mut self) -> Option<Frame> {
                self.answers.checked_sub(1).map(|answers| {
                    self.answers = answers;
                    frame()
                })
            }
        }
        let [own, other] = ["virtual:waited", "virtual:waited"].map(|bus| bus::open(bus).unwrap());
        let (stop, clock) = (AtomicBool::new(false), Cell::new(Duration::ZERO));
        let mut node = Noting { now: Duration::ZERO, clock: &clock, stop: &stop, at: Vec::new(), answers: 0 };
        let sync = Frame::new(0x80, &[]).unwrap();
        (0..20).for_each(|_| other.send(&sync).unwrap());
        // The clock is 20 ms ahead by the time that the node looks at the bus.
        let looked = Cell::new(0);
        let late = || {
            looked.set(looked.get() + 1);
            clock.get() + Duration::from_millis(if looked.get() > 1 { 20 } else { 0 })
        };
        serve_by(&late, &mut node, &*own, &stop).unwrap();
        let apart = |pair: &[Duration]| pair[1] - pair[0];
        assert!(node.at.windows(2).all(|pair| apart(pair) == BIT * (47 + 111)), "{:?}", node.at);
        // In time, nothing of the node's future is lived for a frame.
        stop.store(false, Ordering::Relaxed);
        node.at.clear();
        (0..20).for_each(|_| other.send(&sync).unwrap());
        let origin = clock.get();
        serve_by(&|| clock.get() - origin, &mut node, &*own, &stop).unwrap();
        assert!(node.at.windows(2).all(|pair| apart(pair) <= Duration::from_micros(1)), "{:?}", node.at);
    }

    /// A client that asks one thing after the other between two of its set-points, each as soon as the one before
    /// has been answered.
    #[test]
    fn a_dozen_reads_of_a_node_that_is_behind_take_less_than_half_of_the_command_deadline() {
        let [own, other] = ["virtual:reads", "virtual:reads"].map(|bus| bus::open(bus).unwrap());
        let (stop, clock) = (AtomicBool::new(false), Cell::new(Duration::ZERO));
        // The first piece of its life in which it was as far behind as it may be, and the one with the last answer.
        let (mut first, mut asked, mut took) = (None, 0, Duration::ZERO);
        let mut node = Slow::new(&clock, |received, now| {
            // By then it has been behind for a second.
            if now > Duration::from_secs(1) && received == asked {
                let first = *first.get_or_insert(now);
                took = now - first;
                stop.store(asked == 12, Ordering::Relaxed);
                asked += 1;
                other.send(&frame()).unwrap();
            }
            Ok(())
        });
        let given_up = serve_by(&|| clock.get(), &mut node, &*own, &stop).unwrap();
        assert!(given_up > 0.0);
        for (_, board) in BOARDS {
            let half = Duration::from_secs_f32(0.5 * board.joint.limits.command_deadline);
            assert!(took < half, "{took:?} of {half:?}");
        }
    }
}
