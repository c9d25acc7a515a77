//! Arbitration and time: a discrete-event model of a bus; no I/O, time passed in, host.

use super::bits::{INTERFRAME_SPACE, bit_time, bits};
use super::statistics::Statistics;
use crate::Frame;
use std::collections::VecDeque;
use std::time::Duration;

/// A station of a [`PacedBus`], numbered from 0 in the order of adding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Station(pub usize);

/// Order in which a controller offers its own waiting frames to the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// Lowest identifier first; of the same identifier the oldest (FDCAN: queue mode).
    Identifier,
    /// The oldest (FDCAN: FIFO mode). An urgent frame waits behind a lazy one.
    Fifo,
}

/// A frame that went over the bus.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Delivery {
    /// The frame.
    pub frame: Frame,
    /// Senders of it; several where they sent the same at the same time. All others receive it.
    pub senders: Vec<Station>,
    /// Time at which the (first) sender had handed it to its controller.
    pub queued: Duration,
    /// Time at which its first bit went out.
    pub started: Duration,
    /// Time at which it was received: the end of "end of frame". The interframe space follows.
    pub ended: Duration,
}

#[derive(Clone, Copy, Debug)]
struct Waiting {
    frame: Frame,
    queued: Duration,
}

#[derive(Debug)]
struct Controller {
    order: Order,
    waiting: VecDeque<Waiting>,
}

impl Controller {
    /// Frame that takes part in the arbitration at `start`.
    fn offer(&self, start: Duration) -> Option<usize> {
        let present = self.waiting.iter().enumerate().filter(|(_, waiting)| waiting.queued <= start);
        match self.order {
            Order::Fifo => present.map(|(at, _)| at).next(),
            // The first of several least ones, which is the oldest.
            Order::Identifier => present.min_by_key(|(_, waiting)| waiting.frame.id()).map(|(at, _)| at),
        }
    }
}

/// A classic CAN bus. All times count from the bus's beginning and never go back.
#[derive(Debug)]
pub struct PacedBus {
    bit_time: Duration,
    controllers: Vec<Controller>,
    /// Time at which the interframe space of the last frame is over.
    free: Duration,
    on_wire: Option<Delivery>,
    statistics: Statistics,
    collisions: u64,
}

impl PacedBus {
    /// `bitrate` in bit/s.
    pub fn new(bitrate: u32) -> Self {
        Self {
            bit_time: bit_time(bitrate),
            controllers: Vec::new(),
            free: Duration::ZERO,
            on_wire: None,
            statistics: Statistics::default(),
            collisions: 0,
        }
    }

    /// One more station.
    pub fn add_station(&mut self, order: Order) -> Station {
        self.controllers.push(Controller { order, waiting: VecDeque::new() });
        Station(self.controllers.len() - 1)
    }

    /// A station hands a frame to its controller at `now`, which is no earlier than any time the bus was advanced to. A
    /// station that was never added sends nothing.
    pub fn send(&mut self, station: Station, frame: Frame, now: Duration) {
        if let Some(controller) = self.controllers.get_mut(station.0) {
            controller.waiting.push_back(Waiting { frame, queued: now });
        }
    }

    /// Frames of a station that have not begun yet.
    pub fn waiting(&self, station: Station) -> usize {
        self.controllers.get(station.0).map_or(0, |controller| controller.waiting.len())
    }

    /// The next frame that is received up to `until`. Call it until there is none; only then has the bus advanced to
    /// `until`.
    pub fn advance(&mut self, until: Duration) -> Option<Delivery> {
        if self.on_wire.is_none() {
            self.arbitrate(until);
        }
        let delivery = self.on_wire.take_if(|delivery| delivery.ended <= until)?;
        // The next one begins within this call's time, before anything is sent later.
        self.arbitrate(until);
        Some(delivery)
    }

    /// Time at which to call [`PacedBus::advance`] next, if nothing more is sent: at the end of the frame on the wire,
    /// or when the one that has yet to begin has ended at the earliest. None where nothing waits.
    pub fn next_change(&self) -> Option<Duration> {
        match &self.on_wire {
            Some(delivery) => Some(delivery.ended),
            None => self.start().map(|start| start + self.bit_time * 44),
        }
    }

    /// Statistics so far.
    pub fn statistics(&self) -> &Statistics {
        &self.statistics
    }

    /// Counts from `now` on.
    pub fn reset_statistics(&mut self, now: Duration) {
        self.statistics = Statistics::since(now);
    }

    /// Number of times that several stations sent different frames with the same identifier at the same time. On a wire
    /// that is an error frame and a repetition that collides again; here the station that was added first goes first.
    pub fn collisions(&self) -> u64 {
        self.collisions
    }

    /// Time at which the next frame begins.
    fn start(&self) -> Option<Duration> {
        let waiting = self.controllers.iter().flat_map(|controller| &controller.waiting);
        let earliest = waiting.map(|waiting| waiting.queued).min()?;
        Some(earliest.max(self.free))
    }

    /// Begins the next frame, where it begins before `until`: from then on nothing that is sent later can win against
    /// it.
    fn arbitrate(&mut self, until: Duration) {
        let Some(start) = self.start().filter(|start| *start < until) else { return };
        let offers: Vec<(usize, usize, Waiting)> = self
            .controllers
            .iter()
            .enumerate()
            .filter_map(|(station, controller)| {
                let at = controller.offer(start)?;
                Some((station, at, *controller.waiting.get(at)?))
            })
            .collect();
        let Some(Waiting { frame, .. }) = offers.iter().map(|offer| offer.2).min_by_key(|waiting| waiting.frame.id())
        else {
            return;
        };
        let (mut senders, mut queued) = (Vec::new(), start);
        for (station, at, waiting) in offers {
            if waiting.frame == frame {
                senders.push(Station(station));
                queued = queued.min(waiting.queued);
                if let Some(controller) = self.controllers.get_mut(station) {
                    controller.waiting.remove(at);
                }
            } else if waiting.frame.id() == frame.id() {
                self.collisions += 1;
            }
        }
        let occupied = self.bit_time * bits(&frame);
        let ended = start + occupied - self.bit_time * INTERFRAME_SPACE;
        self.free = start + occupied;
        self.statistics.add(frame.id(), occupied, ended.saturating_sub(queued));
        self.on_wire = Some(Delivery { frame, senders, queued, started: start, ended });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const US: Duration = Duration::from_micros(1);

    fn frame(id: u16, data: &[u8]) -> Frame {
        Frame::new(id, data).unwrap()
    }

    fn ids(bus: &mut PacedBus, until: Duration) -> Vec<u16> {
        std::iter::from_fn(|| bus.advance(until)).map(|delivery| delivery.frame.id()).collect()
    }

    #[test]
    fn the_lowest_identifier_of_those_that_wait_goes_first_and_a_frame_that_began_is_not_interrupted() {
        let mut bus = PacedBus::new(1_000_000);
        let [a, b, c] = [Order::Identifier; 3].map(|order| bus.add_station(order));
        bus.send(a, frame(0x300, &[0; 8]), Duration::ZERO);
        bus.send(b, frame(0x200, &[0; 8]), 10 * US);
        bus.send(c, frame(0x000, &[2, 0]), 20 * US);
        bus.send(a, frame(0x100, &[0; 8]), 30 * US);
        assert_eq!(ids(&mut bus, 1000 * US), [0x300, 0x000, 0x100, 0x200]);
    }

    #[test]
    fn frames_that_are_sent_while_the_bus_is_advanced_in_small_steps_arrive_as_in_one() {
        let mut bus = PacedBus::new(1_000_000);
        let [a, b] = [Order::Identifier; 2].map(|order| bus.add_station(order));
        let mut received = Vec::new();
        for step in 0..500u32 {
            let now = step * US;
            received.extend(std::iter::from_fn(|| bus.advance(now)));
            match step {
                0 => bus.send(a, frame(0x7FF, &[0x55; 8]), now),
                5 => bus.send(b, frame(0x001, &[]), now),
                6 => bus.send(a, frame(0x000, &[]), now),
                _ => {}
            }
        }
        let first = Duration::from_micros(bits(&frame(0x7FF, &[0x55; 8])).into());
        assert_eq!(received.iter().map(|delivery| delivery.frame.id()).collect::<Vec<_>>(), [0x7FF, 0, 1]);
        assert_eq!(received[0].ended, first - 3 * US);
        assert_eq!((received[1].queued, received[1].started), (6 * US, first));
    }

    #[test]
    fn a_fifo_keeps_an_urgent_frame_waiting_and_a_queue_does_not() {
        for (order, expected) in [(Order::Fifo, [0x700, 0x600, 0x080]), (Order::Identifier, [0x080, 0x600, 0x700])] {
            let mut bus = PacedBus::new(1_000_000);
            let a = bus.add_station(order);
            for id in [0x700, 0x600, 0x080] {
                bus.send(a, frame(id, &[]), Duration::ZERO);
            }
            assert_eq!(ids(&mut bus, 1000 * US), expected);
        }
    }

    #[test]
    fn identical_frames_merge_and_different_ones_with_the_same_identifier_are_counted() {
        let mut bus = PacedBus::new(1_000_000);
        let stations = [Order::Identifier; 3].map(|order| bus.add_station(order));
        for station in stations {
            bus.send(station, frame(0x7E4, &[0x4F, 0, 0, 0, 0, 0, 0, 0]), Duration::ZERO);
        }
        let delivery = bus.advance(1000 * US).unwrap();
        assert_eq!((delivery.senders.len(), bus.advance(1000 * US), bus.collisions()), (3, None, 0));
        bus.send(stations[0], frame(0x601, &[1]), 1000 * US);
        bus.send(stations[1], frame(0x601, &[2]), 1000 * US);
        assert_eq!((ids(&mut bus, 2000 * US), bus.collisions()), (vec![0x601, 0x601], 1));
    }

    #[test]
    fn load_is_the_share_of_time_that_the_bus_is_taken() {
        let mut bus = PacedBus::new(1_000_000);
        let a = bus.add_station(Order::Identifier);
        let one = frame(0x2AA, &[0xAA; 8]);
        for step in 0..100u32 {
            let now = step * 1000 * US;
            ids(&mut bus, now);
            bus.send(a, one, now);
        }
        ids(&mut bus, 100_000 * US);
        let load = bus.statistics().load(100_000 * US);
        assert!((load - f64::from(bits(&one)) / 1000.0).abs() < 1e-9, "{load}");
        let latency = bus.statistics().latencies()[&0x2AA];
        assert_eq!((latency.frames(), latency.least(), latency.most()), (100, latency.mean(), latency.mean()));
        assert_eq!(latency.mean(), (bits(&one) - 3) * US);
        bus.reset_statistics(100_000 * US);
        assert_eq!(bus.statistics().load(200_000 * US), 0.0);
    }

    proptest! {
        /// The bound of Davis, Burns, Bril, Lukkien 2007, eq. 4: the most urgent frame waits for one frame that began,
        /// then goes.
        #[test]
        fn the_most_urgent_frame_waits_for_one_frame_at_most(sends in proptest::collection::vec((0usize..4, 1u16..0x800, 0u32..3000), 0..60), at in 0u32..3000) {
            let mut bus = PacedBus::new(1_000_000);
            for _ in 0..5 {
                bus.add_station(Order::Identifier);
            }
            for (station, id, when) in sends {
                bus.send(Station(station), frame(id, &[0; 8]), when * US);
            }
            let stop = frame(0, &[2, 0]);
            bus.send(Station(4), stop, at * US);
            let all: Vec<_> = std::iter::from_fn(|| bus.advance(1_000_000 * US)).collect();
            let stopped = all.iter().find(|delivery| delivery.frame.id() == 0).unwrap();
            prop_assert!(stopped.ended - at * US <= (135 + bits(&stop)) * US);
            // Nothing overlaps, nothing is lost, and the bus is never idle while something waits.
            for pair in all.windows(2) {
                let free = pair[0].ended + 3 * US;
                prop_assert!(pair[1].started == free || pair[1].started > free && pair[1].started == pair[1].queued);
            }
        }
    }
}
