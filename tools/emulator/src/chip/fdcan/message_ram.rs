//! The message RAM of a controller: filters, receive FIFOs, transmit buffers. RM0440, 44.3.4 "Message RAM" and 44.3.5
//! to 44.3.10.

use super::line::CanFrame;

/// Words of a controller.
pub const WORDS: usize = 212;
/// Elements of a FIFO, and transmit buffers.
pub const ELEMENTS: u32 = 3;

const STANDARD_FILTERS: usize = 0;
const EXTENDED_FILTERS: usize = 28;
const RECEIVE: [usize; 2] = [44, 98];
const TRANSMIT: usize = 158;
const ELEMENT: usize = 18;

const EXTENDED: u32 = 1 << 30;
const REMOTE: u32 = 1 << 29;

/// Destination of an accepted frame, and the filter that took it; none where no filter matched.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Accepted {
    /// FIFO 0 or 1.
    pub fifo: usize,
    /// Number of the filter.
    pub filter: Option<u32>,
}

/// The message RAM.
#[derive(Clone, Debug)]
pub struct MessageRam {
    words: Vec<u32>,
}

impl MessageRam {
    /// Message RAM after power-up; its contents are undefined and stay over resets.
    pub fn new() -> Self {
        Self { words: (0..WORDS as u32).map(|word| word.wrapping_mul(0x9e37_79b9) ^ 0xa5a5_5a5a).collect() }
    }

    /// A word; 0 behind the last.
    pub fn get(&self, word: usize) -> u32 {
        self.words.get(word).copied().unwrap_or(0)
    }

    /// Writes a word.
    pub fn set(&mut self, word: usize, value: u32) {
        if let Some(place) = self.words.get_mut(word) {
            *place = value;
        }
    }

    /// Decision of the filters and of the global configuration RXGFC on a frame; none where it is rejected (44.3.5
    /// "Acceptance filter"). `extended_mask` is XIDAM.
    pub fn accept(&self, frame: &CanFrame, global: u32, extended_mask: u32) -> Option<Accepted> {
        let (reject_remote, unmatched, filters) = match frame.extended {
            false => (global >> 1 & 1, global >> 4 & 3, global >> 16 & 0x1f),
            true => (global & 1, global >> 2 & 3, global >> 24 & 0xf),
        };
        if frame.remote && reject_remote != 0 {
            return None;
        }
        for filter in 0..filters {
            let action = match frame.extended {
                false => self.standard(filter, frame.id),
                true => self.extended(filter, frame.id, extended_mask),
            };
            match action {
                // Disabled, or no match: the next filter.
                None | Some(0) => {}
                Some(1) => return Some(Accepted { fifo: 0, filter: Some(filter) }),
                Some(2) => return Some(Accepted { fifo: 1, filter: Some(filter) }),
                // Rejected. Priorities were refused when the controller started.
                Some(_) => return None,
            }
        }
        (unmatched < 2).then_some(Accepted { fifo: unmatched as usize, filter: None })
    }

    /// Decision of a standard filter on an identifier; none where it does not match (44.3.9).
    fn standard(&self, filter: u32, id: u32) -> Option<u32> {
        let element = self.get(STANDARD_FILTERS + filter as usize);
        let (first, second) = (element >> 16 & 0x7ff, element & 0x7ff);
        let matches = match element >> 30 {
            0 => (first..=second).contains(&id),
            1 => id == first || id == second,
            2 => id & second == first & second,
            _ => false,
        };
        matches.then_some(element >> 27 & 7)
    }

    /// The same for an extended filter (44.3.10).
    fn extended(&self, filter: u32, id: u32, mask: u32) -> Option<u32> {
        let [low, high] = [0, 1].map(|word| self.get(EXTENDED_FILTERS + 2 * filter as usize + word));
        let (first, second) = (low & 0x1fff_ffff, high & 0x1fff_ffff);
        let matches = match high >> 30 {
            0 => (first..=second).contains(&(id & mask)),
            1 => id & mask == first || id & mask == second,
            2 => id & mask & second == first & second,
            _ => (first..=second).contains(&id),
        };
        matches.then_some(low >> 29)
    }

    /// Returns `true` if a filter in use marks priorities (SFEC, EFEC 4 to 7), which are not modelled.
    pub fn has_priorities(&self, global: u32) -> bool {
        let standard = (0..global >> 16 & 0x1f).map(|filter| {
            let element = self.get(STANDARD_FILTERS + filter as usize);
            (element >> 30 != 3, element >> 27 & 7)
        });
        let extended =
            (0..global >> 24 & 0xf).map(|filter| (true, self.get(EXTENDED_FILTERS + 2 * filter as usize) >> 29));
        standard.chain(extended).any(|(enabled, action)| enabled && action >= 4)
    }

    /// Puts a frame into an element of a FIFO (44.3.6).
    pub fn put(&mut self, accepted: Accepted, element: u32, frame: &CanFrame, timestamp: u32) {
        let place = RECEIVE[accepted.fifo & 1] + ELEMENT * (element % ELEMENTS) as usize;
        let id = if frame.extended { frame.id | EXTENDED } else { frame.id << 18 };
        self.set(place, id | if frame.remote { REMOTE } else { 0 });
        let filter = accepted.filter.map_or(1 << 31, |filter| filter << 24);
        self.set(place + 1, filter | u32::from(frame.length) << 16 | timestamp & 0xffff);
        for (word, bytes) in frame.data.chunks(4).enumerate().take(usize::from(frame.length).div_ceil(4)) {
            self.set(place + 2 + word, bytes.iter().rev().fold(0, |value, byte| value << 8 | u32::from(*byte)));
        }
    }

    /// The frame in a transmit buffer (44.3.7), and whether it wants an event.
    pub fn transmit(&self, buffer: u32) -> (CanFrame, bool) {
        let place = TRANSMIT + ELEMENT * (buffer % ELEMENTS) as usize;
        let [id, control, low, high] = [0, 1, 2, 3].map(|word| self.get(place + word));
        let extended = id & EXTENDED != 0;
        // A length code above 8 means 8 in a classic frame.
        let length = (control >> 16 & 0xf).min(8) as u8;
        let mut data = (u64::from(low) | u64::from(high) << 32).to_le_bytes();
        let remote = id & REMOTE != 0;
        data[if remote { 0 } else { usize::from(length) }..].fill(0);
        let frame =
            CanFrame { id: if extended { id & 0x1fff_ffff } else { id >> 18 & 0x7ff }, extended, remote, length, data };
        (frame, control >> 23 & 1 != 0)
    }
}

impl Default for MessageRam {
    fn default() -> Self {
        Self::new()
    }
}
