//! Buses within this process, found by name: for tests, and for several joints in one program; host.
//!
//! Without a bit rate a frame is received the moment it is sent, in the order of sending. With one, a thread runs
//! [`PacedBus`] against the clock: frames wait, are arbitrated, and take their time. A thread wakes up some 0.1 ms late
//! at times; what had to happen meanwhile then happens at once and in its order, and no time is lost over it.

use super::{BusError, Transport};
use crate::Frame;
use crate::pacing::{Order, PacedBus, Station, Statistics};
use std::collections::{HashMap, VecDeque};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError, Weak};
use std::time::{Duration, Instant};

/// Frames that a member may leave unread; the oldest are dropped and counted.
const UNREAD: usize = 1 << 16;
/// Frames of one member that may wait for a paced bus.
const WAITING: usize = 256;
/// Longest time for which a member may wait for its turn on a paced bus.
const SATURATED: Duration = Duration::from_secs(1);

/// Frames that one member has yet to read.
#[derive(Debug, Default)]
struct Inbox {
    frames: Mutex<VecDeque<Frame>>,
    filled: Condvar,
    lost: AtomicU64,
}

impl Inbox {
    fn push(&self, frame: Frame) {
        let mut frames = lock(&self.frames);
        if frames.len() == UNREAD {
            frames.pop_front();
            self.lost.fetch_add(1, Ordering::Relaxed);
        }
        frames.push_back(frame);
        self.filled.notify_one();
    }

    fn pop(&self, timeout: Duration) -> Option<Frame> {
        let frames = lock(&self.frames);
        let wait = self.filled.wait_timeout_while(frames, timeout, |frames| frames.is_empty());
        wait.unwrap_or_else(PoisonError::into_inner).0.pop_front()
    }
}

/// The wire of a paced bus.
#[derive(Debug)]
struct Pace {
    bus: Mutex<PacedBus>,
    began: Instant,
    /// Signal that something was sent, or got its turn.
    changed: Condvar,
}

/// A bus, which lives as long as it has members.
#[derive(Debug)]
struct Bus {
    bitrate: Option<u32>,
    /// The index is the station of the paced bus. Those who left are empty.
    members: Mutex<Vec<Weak<Inbox>>>,
    pace: Option<Pace>,
}

impl Bus {
    fn deliver(&self, frame: &Frame, from: impl Fn(usize) -> bool) {
        for (number, member) in lock(&self.members).iter().enumerate() {
            if let (false, Some(inbox)) = (from(number), member.upgrade()) {
                inbox.push(*frame);
            }
        }
    }

    /// Runs the wire until the last member has left.
    fn run(bus: &Weak<Self>) {
        while let Some(bus) = bus.upgrade() {
            let Some(pace) = &bus.pace else { return };
            let mut wire = lock(&pace.bus);
            let now = pace.began.elapsed();
            while let Some(delivery) = wire.advance(now) {
                bus.deliver(&delivery.frame, |number| delivery.senders.contains(&Station(number)));
                pace.changed.notify_all();
            }
            // Long enough for nothing, short enough to see that all have left.
            let wait =
                wire.next_change().map_or(Duration::from_millis(50), |at| at.saturating_sub(pace.began.elapsed()));
            if !wait.is_zero() {
                drop(pace.changed.wait_timeout(wire, wait));
            }
        }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// All buses that have members.
static BUSES: Mutex<Option<HashMap<String, Weak<Bus>>>> = Mutex::new(None);

/// A member of a bus.
#[derive(Debug)]
struct Member {
    name: String,
    number: usize,
    inbox: Arc<Inbox>,
    bus: Arc<Bus>,
}

/// `NAME` or `NAME?bitrate=bit/s`; all members name the same rate.
pub(super) fn open(given: &str, place: &str) -> Result<Arc<dyn Transport>, BusError> {
    let (name, bitrate) = match place.split_once('?') {
        None => (place, None),
        Some((name, setting)) => {
            let rate = setting.strip_prefix("bitrate=").ok_or_else(|| {
                BusError::malformed(given, format!("'{setting}' is no setting; there is bitrate=1000000"))
            })?;
            let rate = rate.parse().ok().filter(|rate| (1_000..=1_000_000).contains(rate));
            (
                name,
                Some(
                    rate.ok_or_else(|| BusError::malformed(given, "the bitrate is not within 1000 to 1000000 bit/s"))?,
                ),
            )
        }
    };
    if name.is_empty() {
        return Err(BusError::malformed(given, "the name is missing"));
    }
    let mut buses = lock(&BUSES);
    let buses = buses.get_or_insert_default();
    buses.retain(|_, bus| bus.strong_count() > 0);
    let bus = match buses.get(name).and_then(Weak::upgrade) {
        Some(bus) if bus.bitrate == bitrate => bus,
        Some(bus) => {
            let other = bus.bitrate.map_or("no bitrate".into(), |rate| format!("bitrate={rate}"));
            return Err(BusError::malformed(given, format!("the bus '{name}' is open already with {other}")));
        }
        None => {
            let pace = bitrate.map(|bitrate| Pace {
                bus: Mutex::new(PacedBus::new(bitrate)),
                began: Instant::now(),
                changed: Condvar::new(),
            });
            let paced = pace.is_some();
            let bus = Arc::new(Bus { bitrate, members: Mutex::default(), pace });
            buses.insert(name.into(), Arc::downgrade(&bus));
            if paced {
                let bus = Arc::downgrade(&bus);
                std::thread::spawn(move || Bus::run(&bus));
            }
            bus
        }
    };
    let inbox = Arc::<Inbox>::default();
    // The wire is locked before the members, as where it delivers. A member is the station of the same number.
    let number = {
        let wire = bus.pace.as_ref().map(|pace| lock(&pace.bus));
        let mut members = lock(&bus.members);
        members.push(Arc::downgrade(&inbox));
        if let Some(mut wire) = wire {
            wire.add_station(Order::Identifier);
        }
        members.len() - 1
    };
    Ok(Arc::new(Member { name: given.into(), number, inbox, bus }))
}

impl Transport for Member {
    fn name(&self) -> &str {
        &self.name
    }

    fn send(&self, frame: &Frame) -> Result<(), BusError> {
        let Some(pace) = &self.bus.pace else {
            self.bus.deliver(frame, |number| number == self.number);
            return Ok(());
        };
        let station = Station(self.number);
        let full = |wire: &mut PacedBus| wire.waiting(station) >= WAITING;
        let wait = pace.changed.wait_timeout_while(lock(&pace.bus), SATURATED, full);
        let (mut wire, wait) = wait.unwrap_or_else(PoisonError::into_inner);
        if wait.timed_out() {
            return Err(BusError::Saturated { bus: self.name.clone(), within_ms: SATURATED.as_millis() as u64 });
        }
        wire.send(station, *frame, pace.began.elapsed());
        pace.changed.notify_all();
        Ok(())
    }

    fn receive(&self, timeout: Duration) -> Result<Option<Frame>, BusError> {
        Ok(self.inbox.pop(timeout))
    }

    fn lost(&self) -> u64 {
        self.inbox.lost.load(Ordering::Relaxed)
    }

    fn statistics(&self) -> Option<Statistics> {
        self.bus.pace.as_ref().map(|pace| lock(&pace.bus).statistics().clone())
    }
}

#[cfg(test)]
mod tests {
    use crate::Frame;
    use crate::transport::open;
    use std::time::{Duration, Instant};

    fn frame(id: u16) -> Frame {
        Frame::new(id, &[0x55; 8]).unwrap()
    }

    #[test]
    fn everyone_hears_a_frame_but_its_sender_and_other_buses() {
        let [a, b, c, other] =
            ["virtual:trio", "virtual:trio", "virtual:trio", "virtual:other"].map(|bus| open(bus).unwrap());
        a.send(&frame(1)).unwrap();
        b.send(&frame(2)).unwrap();
        let received = |bus: &std::sync::Arc<dyn crate::Transport>| {
            std::iter::from_fn(|| bus.receive(Duration::ZERO).unwrap()).map(|frame| frame.id()).collect::<Vec<_>>()
        };
        assert_eq!(
            [received(&a), received(&b), received(&c), received(&other)],
            [vec![2], vec![1], vec![1, 2], vec![]]
        );
    }

    #[test]
    fn a_member_that_does_not_read_loses_the_oldest_frames_and_counts_them() {
        let [a, b] = ["virtual:deaf"; 2].map(|bus| open(bus).unwrap());
        for number in 0..super::UNREAD + 10 {
            a.send(&frame((number & 0x7FF) as u16)).unwrap();
        }
        assert_eq!((b.lost(), b.receive(Duration::ZERO).unwrap()), (10, Some(frame(10))));
    }

    #[test]
    fn a_paced_bus_takes_the_time_of_the_wire_and_counts_it() {
        let [a, b] = ["virtual:paced?bitrate=125000"; 2].map(|bus| open(bus).unwrap());
        let began = Instant::now();
        for _ in 0..100 {
            a.send(&frame(0x123)).unwrap();
        }
        for _ in 0..100 {
            assert_eq!(b.receive(Duration::from_secs(5)).unwrap(), Some(frame(0x123)));
        }
        let took = began.elapsed();
        let wire = crate::pacing::bit_time(125_000) * 100 * crate::pacing::bits(&frame(0x123));
        assert!(took >= wire - crate::pacing::bit_time(125_000) * 3, "{took:?} {wire:?}");
        let statistics = a.statistics().unwrap();
        assert_eq!((statistics.frames(), statistics.busy()), (100, wire));
        assert!(open("virtual:paced").unwrap_err().to_string().contains("bitrate=125000"));
        assert!(open("virtual:free").unwrap().statistics().is_none());
    }

    #[test]
    fn a_member_that_never_gets_its_turn_is_told() {
        let [a, urgent] = ["virtual:slow?bitrate=1000"; 2].map(|bus| open(bus).unwrap());
        for _ in 0..100 {
            urgent.send(&frame(0)).unwrap();
        }
        let error = (0..=super::WAITING).find_map(|_| a.send(&frame(0x7FF)).err()).unwrap();
        assert!(error.to_string().contains("saturated"), "{error}");
    }
}
