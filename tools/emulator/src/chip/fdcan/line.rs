//! The CAN bus as the controller meets it: who sends when, how long a frame takes, who acknowledges.
//!
//! Source: ISO 11898-1. [`CanLine`] is what a board offers to the controller; [`Line`] is one with a single controller
//! and whatever the host sends: arbitration, exact numbers of bits with their stuffing, and disturbances on demand.

use super::super::time::Instant;
use std::collections::VecDeque;

/// A classic frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CanFrame {
    /// Identifier, 11 or 29 bits.
    pub id: u32,
    /// The identifier has 29 bits.
    pub extended: bool,
    /// Asks for a frame.
    pub remote: bool,
    /// Bytes of data, 0 to 8; of a remote frame, the length code.
    pub length: u8,
    /// The bytes, zeros behind them.
    pub data: [u8; 8],
}

impl CanFrame {
    /// A data frame with an identifier of 11 bits; none where one of them is too large.
    pub fn standard(id: u32, data: &[u8]) -> Option<Self> {
        let mut bytes = [0; 8];
        bytes.get_mut(..data.len())?.copy_from_slice(data);
        (id < 1 << 11).then_some(Self { id, extended: false, remote: false, length: data.len() as u8, data: bytes })
    }

    /// Order in arbitration: the lower wins. Identifier, then remote and extended frames behind their standard data
    /// twins.
    fn priority(&self) -> u64 {
        let (base, low) = if self.extended { (self.id >> 18, self.id & 0x3_ffff) } else { (self.id, 0) };
        u64::from(base) << 21
            | u64::from(self.extended) << 20
            | u64::from(!self.extended && self.remote) << 19
            | u64::from(low) << 1
            | u64::from(self.extended && self.remote)
    }

    /// Bits from the start of frame to the end of frame, stuffed ones included.
    pub fn bits(&self) -> u64 {
        let mut bits = Bits::default();
        bits.push(0, 1);
        if self.extended {
            bits.push(self.id >> 18, 11);
            bits.push(0b11, 2);
            bits.push(self.id & 0x3_ffff, 18);
            bits.push(u32::from(self.remote), 1);
            bits.push(0, 2);
        } else {
            bits.push(self.id, 11);
            bits.push(u32::from(self.remote), 1);
            bits.push(0, 2);
        }
        bits.push(u32::from(self.length), 4);
        if !self.remote {
            for byte in &self.data[..usize::from(self.length.min(8))] {
                bits.push(u32::from(*byte), 8);
            }
        }
        bits.push(bits.sum, 15);
        // CRC delimiter, acknowledgement with delimiter, end of frame: not stuffed.
        bits.count + 1 + 2 + 7
    }
}

/// Counts bits with their stuffing, and computes the checksum over what was pushed.
#[derive(Default)]
struct Bits {
    count: u64,
    sum: u32,
    last: u32,
    run: u32,
}

impl Bits {
    fn push(&mut self, value: u32, width: u32) {
        for place in (0..width).rev() {
            let bit = value >> place & 1;
            let out = self.sum >> 14 & 1 ^ bit;
            self.sum = self.sum << 1 & 0x7fff ^ if out != 0 { 0x4599 } else { 0 };
            self.count += 1;
            self.run = if self.count > 1 && bit == self.last { self.run + 1 } else { 1 };
            self.last = bit;
            if self.run == 5 {
                // The stuffed bit is the opposite, and the first of the next run.
                self.count += 1;
                (self.last, self.run) = (1 - bit, 1);
            }
        }
    }
}

/// Participation of the controller in the bus.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Part {
    /// No participation: it is initialised, or bus-off.
    #[default]
    None,
    /// Listening: it receives and acknowledges.
    Listening {
        /// Duration of a bit, ps.
        bit: u64,
    },
    /// And it wants to send.
    Sending {
        /// Duration of a bit, ps.
        bit: u64,
        /// Frame that it wants to send.
        frame: CanFrame,
    },
}

impl Part {
    const fn bit(&self) -> Option<u64> {
        match self {
            Self::None => None,
            Self::Listening { bit } | Self::Sending { bit, .. } => Some(*bit),
        }
    }
}

/// Event that ended on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// A frame of somebody else's.
    Received(CanFrame),
    /// The controller's frame, acknowledged.
    Sent(CanFrame),
    /// The controller's frame, which nobody acknowledged.
    NotAcknowledged,
    /// A frame was destroyed: the controller's own, or another's.
    Disturbed {
        /// The controller's own.
        own: bool,
    },
}

/// The bus as one controller meets it.
pub trait CanLine {
    /// Sets how the controller takes part from now on. A frame under way is not affected.
    fn take_part(&mut self, at: Instant, part: Part);
    /// Instant at which something next ends.
    fn next(&self) -> Instant;
    /// Event that ended up to now; none where nothing did.
    fn take(&mut self, at: Instant) -> Option<Event>;
}

#[derive(Clone, Copy, Debug)]
enum Sender {
    Controller(CanFrame),
    Host(CanFrame),
}

/// A bus with one controller and a host.
#[derive(Clone, Debug)]
pub struct Line {
    /// Duration of a bit, ps.
    bit: u64,
    part: Part,
    /// Frames of the host's; of one identifier, in the order that they are to be sent.
    waiting: VecDeque<(Instant, CanFrame)>,
    under_way: Option<(Sender, Instant, Event)>,
    /// Instant before which nobody may begin.
    idle: Instant,
    acknowledged: bool,
    disturbed: Option<Instant>,
    /// Frames that the controller has sent, with the end of each.
    sent: VecDeque<(Instant, CanFrame)>,
}

impl Line {
    /// Line at so many bit/s; others are there to acknowledge.
    pub const fn new(bit_rate: u64) -> Self {
        Self {
            bit: 1_000_000_000_000 / bit_rate,
            part: Part::None,
            waiting: VecDeque::new(),
            under_way: None,
            idle: Instant(0),
            acknowledged: true,
            disturbed: None,
            sent: VecDeque::new(),
        }
    }

    /// Sets whether anybody acknowledges the controller.
    pub fn set_acknowledged(&mut self, acknowledged: bool) {
        self.acknowledged = acknowledged;
    }

    /// Destroys every frame that ends before an instant.
    pub fn disturb(&mut self, until: Instant) {
        self.disturbed = Some(until);
    }

    /// The host sends a frame, from an instant on as soon as it wins arbitration. Say so to the chip
    /// ([`Chip::wiring_changed`](super::super::Chip::wiring_changed)).
    pub fn send(&mut self, at: Instant, frame: CanFrame) {
        self.waiting.push_back((at, frame));
        self.begin(at);
    }

    /// Returns `true` if nobody sends, and nothing waits to be sent by the host: a frame that is sent now begins now.
    pub fn is_idle(&self, at: Instant) -> bool {
        self.under_way.is_none() && self.waiting.is_empty() && self.idle <= at
    }

    /// The oldest frame of the controller's that the host has not taken.
    pub fn receive(&mut self) -> Option<(Instant, CanFrame)> {
        self.sent.pop_front()
    }

    /// The host tries again with a frame, before those that wait behind it.
    fn again(&mut self, from: Instant, frame: CanFrame) {
        self.waiting.push_front((from, frame));
    }

    /// Begins a frame where the line is idle and somebody wants to send.
    fn begin(&mut self, at: Instant) {
        if self.under_way.is_some() {
            return;
        }
        let ready = |from: Instant| from.max(self.idle).max(at);
        let own = match self.part {
            Part::Sending { frame, .. } => Some((ready(at), frame.priority(), Sender::Controller(frame))),
            _ => None,
        };
        let host = self.waiting.iter().map(|&(from, frame)| (ready(from), frame.priority(), Sender::Host(frame)));
        // The first to begin; of those that begin together, the lowest.
        let Some((begin, _, sender)) = host.chain(own).min_by_key(|&(begin, priority, _)| (begin, priority)) else {
            return;
        };
        let frame = match sender {
            Sender::Controller(frame) => frame,
            Sender::Host(frame) => {
                if let Some(place) = self.waiting.iter().position(|(_, waiting)| *waiting == frame) {
                    self.waiting.remove(place);
                }
                frame
            }
        };
        let end = Instant(begin.0 + frame.bits() * self.bit);
        let wrong_rate = self.part.bit().is_some_and(|bit| bit.abs_diff(self.bit) * 200 > self.bit);
        let disturbed = wrong_rate || self.disturbed.is_some_and(|until| end <= until);
        let own = matches!(sender, Sender::Controller(_));
        let event = match (disturbed, own) {
            (true, own) => Event::Disturbed { own },
            (false, false) => Event::Received(frame),
            (false, true) if self.acknowledged => Event::Sent(frame),
            (false, true) => Event::NotAcknowledged,
        };
        self.under_way = Some((sender, end, event));
    }
}

/// Bits between frames; an error takes its flags and delimiter besides.
const INTERMISSION: u64 = 3;
const ERROR_FRAME: u64 = 14;

impl CanLine for Line {
    fn take_part(&mut self, at: Instant, part: Part) {
        self.part = part;
        // A frame that has not begun yet may meet another.
        if let Some((sender, end, _)) = self.under_way {
            let frame = match sender {
                Sender::Controller(frame) | Sender::Host(frame) => frame,
            };
            let began = end.0.saturating_sub(frame.bits() * self.bit);
            if began >= at.0 {
                self.under_way = None;
                if let Sender::Host(frame) = sender {
                    self.again(Instant(began), frame);
                }
            }
        }
        self.begin(at);
    }

    fn next(&self) -> Instant {
        self.under_way.map_or(Instant::NEVER, |(_, end, _)| end)
    }

    fn take(&mut self, at: Instant) -> Option<Event> {
        let (sender, end, event) = self.under_way.filter(|(_, end, _)| *end <= at)?;
        self.under_way = None;
        let after = match event {
            Event::Received(_) | Event::Sent(_) => INTERMISSION,
            _ => ERROR_FRAME + INTERMISSION,
        };
        self.idle = Instant(end.0 + after * self.bit);
        match (sender, event) {
            (Sender::Controller(frame), Event::Sent(_)) => self.sent.push_back((end, frame)),
            (Sender::Host(frame), Event::Disturbed { .. }) => self.again(self.idle, frame),
            _ => {}
        }
        // The controller itself says what it sends next; until then the host may begin.
        self.part = self.part.bit().map_or(Part::None, |bit| Part::Listening { bit });
        self.begin(end);
        Some(event)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_have_the_bits_of_the_standard() {
        // Without data and with no run of five: 44 bits and what is stuffed into identifier and checksum.
        let longest = (0..1u32 << 11).map(|id| CanFrame::standard(id, &[]).unwrap().bits()).max().unwrap();
        let shortest = (0..1u32 << 11).map(|id| CanFrame::standard(id, &[]).unwrap().bits()).min().unwrap();
        assert!(shortest >= 44 && longest <= 44 + (34 - 1) / 4, "{shortest} to {longest}");
        // The worst case of eight bytes: 108 bits and 24 stuffed.
        let zeros = CanFrame::standard(0, &[0; 8]).unwrap().bits();
        assert!((108 + 16..=108 + 24).contains(&zeros), "{zeros}");
        assert_eq!(CanFrame::standard(0x800, &[]), None);
        assert_eq!(CanFrame::standard(1, &[0; 9]), None);
    }

    #[test]
    fn the_lower_identifier_wins() {
        let order = [
            CanFrame::standard(0x100, &[]).unwrap(),
            CanFrame { remote: true, ..CanFrame::standard(0x100, &[]).unwrap() },
            CanFrame { id: 0x100 << 18, extended: true, ..CanFrame::standard(0, &[]).unwrap() },
            CanFrame { id: 0x100 << 18 | 1, extended: true, ..CanFrame::standard(0, &[]).unwrap() },
            CanFrame::standard(0x101, &[]).unwrap(),
        ];
        assert!(order.windows(2).all(|pair| pair[0].priority() < pair[1].priority()));
    }
    /// Events that ended up to when nothing happens any more.
    fn events(line: &mut Line) -> Vec<Event> {
        std::iter::from_fn(|| line.take(line.next())).collect()
    }

    #[test]
    fn frames_of_one_identifier_keep_their_order() {
        let frames = [1, 2, 3, 4].map(|number| CanFrame::standard(0x605, &[number]).unwrap());
        let own = CanFrame::standard(0x185, &[]).unwrap();
        let listening = Part::Listening { bit: 1_000_000 };

        // The controller asks for the bus in the intermission, and wins.
        let mut line = Line::new(1_000_000);
        line.take_part(Instant(0), listening);
        frames.iter().for_each(|frame| line.send(Instant(0), *frame));
        let end = line.next();
        assert_eq!(line.take(end), Some(Event::Received(frames[0])));
        line.take_part(end, Part::Sending { bit: 1_000_000, frame: own });
        let rest =
            [Event::Sent(own), Event::Received(frames[1]), Event::Received(frames[2]), Event::Received(frames[3])];
        assert_eq!(events(&mut line), rest);

        // A frame is destroyed.
        let mut line = Line::new(1_000_000);
        line.take_part(Instant(0), listening);
        line.disturb(Instant(100_000_000));
        frames.iter().for_each(|frame| line.send(Instant(0), *frame));
        let all = frames.map(Event::Received);
        assert_eq!(events(&mut line), [[Event::Disturbed { own: false }].as_slice(), &all].concat());
    }
}
