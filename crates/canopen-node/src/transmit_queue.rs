//! Frames that wait for the controller, and with it what happens when the bus has no room; interrupt and task, each
//! while the other cannot come between.
//!
//! - The lowest identifier goes first, as on the bus; of the same identifier the oldest.
//! - A TPDO or heartbeat that still waits when its successor comes is overwritten, in its place: nobody wants to know
//!   how it was. It is counted.
//! - Anything else waits. What finds no room is dropped and counted.
//! - A frame that has waited for [`PATIENCE`] goes before all others of this node, the oldest of them first.
//! - A node whose heartbeat had to wait so long, here and in the controller, adds nothing until it is out, and no PDO
//!   for as long again. Heartbeats have the highest identifiers of all and are the first to be lost; as every joint
//!   makes room like this, the PDOs of joints cannot starve the heartbeats of joints. Without the pause, the joints
//!   with the lowest identifiers take the whole bus, and those with the highest are never heard of.
//! - What is urgent ([`URGENT`]: EMCYs) comes before even that, and the controller's last free buffer is kept for it:
//!   what the controller has is out of reach, and on a full bus stays there.

use super::time::{MILLISECOND, elapsed};
use super::{Frame, HEARTBEAT};

/// Time after which a frame is not overtaken any more, us. Long against a frame (0.13 ms) and the usual distance of two
/// SYNCs, short against heartbeats and the time-outs of SDO.
pub const PATIENCE: u32 = 10 * MILLISECOND;

/// Identifiers from here on are not urgent: PDOs and all that follows. CiA 301 section 7.3.3.
pub const URGENT: u16 = 0x101;

/// A frame that waits.
#[derive(Clone, Copy, Debug)]
struct Waiting {
    frame: Frame,
    since: u32,
    renewable: bool,
    /// Frames that had come before.
    number: u32,
}

impl Waiting {
    fn is_pdo(&self) -> bool {
        self.renewable && !is_heartbeat(&self.frame)
    }
}

fn is_heartbeat(frame: &Frame) -> bool {
    frame.id() & !0x7F == HEARTBEAT
}

/// Transmit buffers of a controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Buffers {
    /// Number of buffers.
    pub all: usize,
    /// Number of buffers that hold a frame that is not out yet.
    pub occupied: usize,
}

impl Buffers {
    const fn free(self) -> usize {
        self.all.saturating_sub(self.occupied)
    }
}

/// Room for `N` frames.
#[derive(Clone, Debug)]
pub struct TransmitQueue<const N: usize> {
    waiting: [Option<Waiting>; N],
    number: u32,
    /// Time at which the heartbeat that the controller has was queued.
    heartbeat: Option<u32>,
    /// Time at which a heartbeat that was late had gone out.
    pausing: Option<u32>,
    overwritten: u32,
    dropped: u32,
}

impl<const N: usize> TransmitQueue<N> {
    /// Empty queue.
    #[allow(clippy::new_without_default, reason = "it belongs into a static")]
    pub const fn new() -> Self {
        Self { waiting: [None; N], number: 0, heartbeat: None, pausing: None, overwritten: 0, dropped: 0 }
    }

    /// Takes a frame at `now` (us, wrapping); false where it is dropped. `renewable`: it makes the one before it
    /// worthless ([`Shared::is_renewable`](super::Shared::is_renewable)).
    pub fn push(&mut self, frame: Frame, renewable: bool, now: u32) -> bool {
        let same = |waiting: &&mut Waiting| waiting.renewable && waiting.frame.id() == frame.id();
        if renewable && let Some(waiting) = self.waiting.iter_mut().flatten().find(same) {
            waiting.frame = frame;
            self.overwritten = self.overwritten.saturating_add(1);
            return true;
        }
        let Some(place) = self.waiting.iter_mut().find(|place| place.is_none()) else {
            self.dropped = self.dropped.saturating_add(1);
            return false;
        };
        *place = Some(Waiting { frame, since: now, renewable, number: self.number });
        self.number = self.number.wrapping_add(1);
        true
    }

    /// The frame that the controller is to have next. `buffers`: what it has for transmission. To be called again
    /// whenever a buffer becomes free.
    pub fn pop(&mut self, now: u32, buffers: Buffers) -> Option<Frame> {
        let late = |since| elapsed(now, since) >= PATIENCE;
        if buffers.occupied == 0 {
            self.pausing = self.heartbeat.take().filter(|since| late(*since)).map(|_| now).or(self.pausing);
        }
        self.pausing = self.pausing.filter(|since| !late(*since));
        let pause = self.pausing.is_some();
        // Numbers wrap: how long ago, not which.
        let age = |waiting: &Waiting| self.number.wrapping_sub(waiting.number);
        let all = || self.waiting.iter().flatten().filter(|waiting| !(pause && waiting.is_pdo()));
        let first = all().min_by_key(|waiting| (waiting.frame.id(), u32::MAX.wrapping_sub(age(waiting))))?;
        let oldest = all().max_by_key(|waiting| age(waiting))?;
        let urgent = first.frame.id() < URGENT;
        let silent = self.heartbeat.is_some_and(late) || buffers.free() == 1;
        if buffers.free() == 0 || silent && !urgent {
            return None;
        }
        let Waiting { number, since, .. } = *if late(oldest.since) && !urgent { oldest } else { first };
        let place = self.waiting.iter_mut().find(|place| place.is_some_and(|waiting| waiting.number == number))?;
        let frame = place.take()?.frame;
        if is_heartbeat(&frame) {
            self.heartbeat = Some(since);
        }
        Some(frame)
    }

    /// Frames that wait.
    pub fn len(&self) -> usize {
        self.waiting.iter().flatten().count()
    }

    /// Returns `true` if nothing waits.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Frames for which there is room.
    pub fn room(&self) -> usize {
        N.saturating_sub(self.len())
    }

    /// TPDOs and heartbeats that were replaced by newer ones before they were sent; stays at its end.
    pub fn overwritten(&self) -> u32 {
        self.overwritten
    }

    /// Frames that found no room; stays at its end.
    pub fn dropped(&self) -> u32 {
        self.dropped
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const EMPTY: Buffers = Buffers { all: 3, occupied: 0 };

    fn full_but(free: usize) -> Buffers {
        Buffers { all: 3, occupied: 3 - free }
    }

    fn frame(id: u16, byte: u8) -> Frame {
        Frame::new(id, &[byte]).unwrap()
    }

    #[test]
    fn the_lowest_identifier_goes_first_and_of_the_same_the_oldest() {
        let mut queue = TransmitQueue::<8>::new();
        for (id, byte) in [(0x705, 0), (0x585, 1), (0x585, 2), (0x185, 3)] {
            assert!(queue.push(frame(id, byte), false, 0));
        }
        let order: Vec<u8> = std::iter::from_fn(|| queue.pop(0, EMPTY)).map(|frame| frame.data()[0]).collect();
        assert_eq!(order, [3, 1, 2, 0]);
    }

    #[test]
    fn a_heartbeat_does_not_overwrite_the_boot_up_message() {
        let mut queue = TransmitQueue::<4>::new();
        queue.push(frame(0x705, 0), false, 0);
        queue.push(frame(0x705, 0x7F), true, 0);
        queue.push(frame(0x705, 0x05), true, 0);
        let order: Vec<u8> = std::iter::from_fn(|| queue.pop(0, EMPTY)).map(|frame| frame.data()[0]).collect();
        assert_eq!(order, [0, 5]);
    }

    #[test]
    fn a_newer_tpdo_overwrites_the_one_that_waits_and_other_frames_do_not() {
        let mut queue = TransmitQueue::<4>::new();
        for byte in 0..3 {
            assert!(queue.push(frame(0x185, byte), true, 0));
        }
        assert!(queue.push(frame(0x585, 7), false, 0) && queue.push(frame(0x585, 8), false, 0));
        assert_eq!((queue.len(), queue.overwritten(), queue.dropped()), (3, 2, 0));
        let order: Vec<u8> = std::iter::from_fn(|| queue.pop(0, EMPTY)).map(|frame| frame.data()[0]).collect();
        assert_eq!(order, [2, 7, 8]);
    }

    #[test]
    fn what_finds_no_room_is_dropped_and_counted() {
        let mut queue = TransmitQueue::<2>::new();
        assert!(queue.push(frame(0x705, 0), false, 0) && queue.push(frame(0x185, 0), true, 0));
        assert!(!queue.push(frame(0x085, 0), false, 0));
        assert!(queue.push(frame(0x185, 1), true, 0), "its place is there");
        assert_eq!((queue.room(), queue.dropped(), queue.overwritten()), (0, 1, 1));
    }

    #[test]
    fn a_frame_that_has_waited_long_enough_is_not_overtaken_and_an_overwritten_one_keeps_its_turn() {
        let now = u32::MAX - 1_000;
        let mut queue = TransmitQueue::<8>::new();
        queue.push(frame(0x705, 0), false, now);
        queue.push(frame(0x285, 1), true, now.wrapping_add(1));
        for tick in 1..=9 {
            let now = now.wrapping_add(tick * MILLISECOND);
            queue.push(frame(0x185, 2), true, now);
            assert_eq!(queue.pop(now, EMPTY).unwrap().id(), 0x185, "{tick} ms");
            queue.push(frame(0x285, 3), true, now);
        }
        let now = now.wrapping_add(PATIENCE + 1);
        queue.push(frame(0x185, 4), true, now);
        assert_eq!(queue.pop(now, EMPTY), Some(frame(0x705, 0)));
        assert_eq!(queue.pop(now, full_but(2)), None, "until it is out");
        assert_eq!(queue.pop(now, EMPTY), None, "PDOs pause");
        queue.push(frame(0x585, 5), false, now);
        assert_eq!(queue.pop(now, EMPTY), Some(frame(0x585, 5)));
        let now = now.wrapping_add(PATIENCE);
        let order: Vec<Frame> = std::iter::from_fn(|| queue.pop(now, EMPTY)).collect();
        assert_eq!(order, [frame(0x285, 3), frame(0x185, 4)]);
    }

    #[test]
    fn a_heartbeat_that_stays_in_the_controller_silences_its_node_and_one_that_goes_out_does_not() {
        let mut queue = TransmitQueue::<8>::new();
        queue.push(frame(0x705, 0), false, 0);
        assert_eq!(queue.pop(1, EMPTY), Some(frame(0x705, 0)));
        queue.push(frame(0x185, 1), true, PATIENCE - 1);
        assert_eq!(queue.pop(PATIENCE - 1, full_but(2)), Some(frame(0x185, 1)));
        queue.push(frame(0x185, 2), true, PATIENCE);
        queue.push(frame(0x085, 3), false, PATIENCE);
        assert_eq!(queue.pop(PATIENCE, full_but(2)), Some(frame(0x085, 3)));
        assert_eq!(queue.pop(PATIENCE, full_but(2)), None);
        assert_eq!(queue.pop(2 * PATIENCE, EMPTY), None);
        assert_eq!(queue.pop(3 * PATIENCE, EMPTY), Some(frame(0x185, 2)));
        // In time.
        queue.push(frame(0x705, 0), false, 4 * PATIENCE);
        assert_eq!(queue.pop(4 * PATIENCE, EMPTY), Some(frame(0x705, 0)));
        queue.push(frame(0x185, 4), true, 6 * PATIENCE);
        assert_eq!(queue.pop(4 * PATIENCE + 1, EMPTY), Some(frame(0x185, 4)));
    }

    #[test]
    fn the_last_buffer_is_for_what_is_urgent_which_is_never_held_back() {
        let mut queue = TransmitQueue::<8>::new();
        queue.push(frame(0x705, 0), false, 0);
        assert_eq!(queue.pop(2 * PATIENCE, full_but(1)), None);
        queue.push(frame(0x085, 1), false, 2 * PATIENCE);
        assert_eq!(queue.pop(2 * PATIENCE, full_but(0)), None);
        assert_eq!(queue.pop(2 * PATIENCE, full_but(1)), Some(frame(0x085, 1)));
        assert_eq!(queue.pop(2 * PATIENCE, full_but(2)), Some(frame(0x705, 0)));
    }

    proptest! {
        /// Whatever the bus lets through, nothing waits for longer than the patience and the frames that were there
        /// before.
        #[test]
        fn every_frame_gets_its_turn(pushes in prop::collection::vec((URGENT..0x700, any::<bool>()), 1..200)) {
            let mut queue = TransmitQueue::<8>::new();
            let mut now = 0u32;
            let mut oldest: Option<u32> = None;
            for (id, pdo) in pushes {
                now += MILLISECOND;
                queue.push(frame(id, 0), pdo, now);
                oldest = oldest.or(Some(now));
                if queue.room() == 0 {
                    queue.pop(now, EMPTY);
                }
                let waited = queue.waiting.iter().flatten().map(|waiting| now - waiting.since).max().unwrap_or(0);
                prop_assert!(waited <= PATIENCE + 8 * 8 * MILLISECOND, "{waited}");
            }
            while queue.pop(now, EMPTY).is_some() {}
            prop_assert!(queue.is_empty());
        }
    }
}
