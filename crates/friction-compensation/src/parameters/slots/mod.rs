//! Two slots in flash for one payload, of which one is whole at any instant of power loss; task or host, never the
//! control interrupt.
//!
//! For friction images and for configurations: each has two slots of one or more pages. A store writes the slot that is
//! not in use and never touches the newest whole one. At start [`Slots::open`] finds the newest whole slot.
//!
//! # A slot
//!
//! | offset | bytes | content |
//! |---|---|---|
//! | 0 | 8 | header: payload length (2 bytes), sequence number (2), CRC-32 of kind, length, sequence number and payload (4) |
//! | 8 | 8 | first confirmation |
//! | 16 | 8 | second confirmation |
//! | 24 | 8 | blank, zero once the slot is settled |
//! | 32 | | payload; the last double word is filled up with 0xFF |
//!
//! # Order of writing, and why it is this one
//!
//! Retire the slot (zero both confirmations, then the header), erase it, write the payload and read it back, then
//! header, first confirmation, second confirmation, zeros into the last of the four. One word written last would do if
//! a torn word always read the same. One that flickers would let a joint start with the new content today and with the
//! old one tomorrow. So whatever a start finds undecided it decides, in flash, before anything is used, and the
//! decision holds although torn words stay torn:
//!
//! | found | then |
//! |---|---|
//! | no header that fits the payload | not whole |
//! | header, and the last word zero | whole |
//! | header, a confirmation | confirmed again where that is possible, last word zeroed: whole |
//! | header, no confirmation | both confirmations zeroed, then the header: the store never happened |
//!
//! A torn header has blank confirmations behind it, so it is never taken; a torn last word has whole confirmations
//! before it, so it always is. A torn first confirmation may go either way, but only once: afterwards zeros stand in
//! the last word, or in the confirmations. Zeros can be written over torn words any number of times, so a loss of power
//! meanwhile is repaired by the next start. The second confirmation covers that loss of power: until it is whole, the
//! last word is blank. Against words that read as anything, differently each time, this holds for any two losses of
//! power in a row (`tests` has every case).
//!
//! # Rolling back
//!
//! [`Slots::roll_back`] takes the previous payload into RAM and stores it again with a new sequence number, into the
//! slot that it came from. The content that was in use stays whole until then and becomes the previous one. The price:
//! where power is lost meanwhile, the joint starts with the content that was in use, and the previous one is lost.
//!
//! # Bit rot
//!
//! A settled slot whose checksum does not fit is reported as [`SlotState::Damaged`] and never used. Where the other
//! slot is whole, the damaged one's header is zeroed, so that it does not come back when it happens to read right. Its
//! confirmations stay: every start finds it damaged until a store takes its place. A loss of power leaves none: before
//! an erase both confirmations are zeroed.

mod flash;
mod header;
#[cfg(test)]
mod tests;

pub use flash::{BLANK, DOUBLE_WORD, PAGE, PAGE_WORDS, ReadError, SlotFlash, WriteError, ZERO};
use header::{CONFIRMATIONS, CONFIRMED, Checksum, HEADER, HEADER_WORDS, Header, Marks, SETTLED, newer};

/// Bytes of a slot that are not payload.
pub const OVERHEAD: usize = HEADER_WORDS * DOUBLE_WORD;
const _: () = assert!(super::image::MAX_LENGTH + OVERHEAD <= PAGE, "an image fits a slot of one page");

/// Location of two slots, and the kind of their content.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    first_page: usize,
    pages: usize,
    kind: u32,
}

impl Layout {
    /// Two slots of `pages` pages each (1 to 16) one behind the other from page `first_page`; `kind` goes into the
    /// checksum, so that one sort of content is not taken for another. None for another number of pages.
    pub const fn new(first_page: usize, pages: usize, kind: u32) -> Option<Self> {
        if pages >= 1 && pages <= 16 { Some(Self { first_page, pages, kind }) } else { None }
    }

    /// Longest payload, bytes.
    pub const fn capacity(&self) -> usize {
        self.pages * PAGE - OVERHEAD
    }

    const fn page(&self, slot: Slot) -> usize {
        match slot {
            Slot::First => self.first_page,
            Slot::Second => self.first_page + self.pages,
        }
    }

    const fn first_word(&self, slot: Slot) -> usize {
        self.page(slot) * PAGE_WORDS
    }
}

/// One of the two.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Slot {
    /// The one in front.
    First,
    /// The one behind.
    Second,
}

impl Slot {
    const fn other(self) -> Self {
        match self {
            Self::First => Self::Second,
            Self::Second => Self::First,
        }
    }
}

/// Content of a slot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SlotState {
    /// Erased.
    Empty,
    /// A whole payload.
    Whole {
        /// Rises by one with every store, and wraps.
        sequence: u16,
        /// Bytes of the payload.
        length: u16,
        /// CRC-32 of kind, length, sequence number and payload.
        checksum: u32,
    },
    /// A store or an erase that did not come to its end. It was never in use.
    Interrupted,
    /// Was whole once and is not any more.
    Damaged,
    /// Taken out of use before its erase.
    Retired,
}

/// Reason for which an operation is not done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SlotError {
    /// The flash refuses to write.
    Write(WriteError),
    /// Written content that does not read back. The content in use is untouched.
    Verify {
        /// Slot that was being written.
        slot: Slot,
    },
    /// A payload of no or too many bytes.
    Length {
        /// Bytes of the payload.
        length: usize,
        /// Most bytes that fit.
        limit: usize,
    },
    /// The buffer is shorter than the payload.
    Buffer {
        /// Bytes of the buffer.
        length: usize,
        /// Bytes of the payload.
        needed: usize,
    },
    /// No previous content to roll back to.
    NoPrevious,
    /// The payload was whole when the slots were opened and is not now.
    Damaged {
        /// Slot that holds it.
        slot: Slot,
    },
}

impl core::fmt::Display for SlotError {
    fn fmt(&self, f: &mut core::fmt::Formatter) -> core::fmt::Result {
        match *self {
            Self::Write(error) => error.fmt(f),
            Self::Verify { slot } => write!(f, "{slot:?} slot does not read back as it was written"),
            Self::Length { length, limit } => write!(f, "payload of {length} bytes, must be 1 to {limit}"),
            Self::Buffer { length, needed } => write!(f, "buffer of {length} bytes for a payload of {needed}"),
            Self::NoPrevious => f.write_str("no previous content is stored"),
            Self::Damaged { slot } => write!(f, "{slot:?} slot is damaged: its checksum does not fit any more"),
        }
    }
}

impl core::error::Error for SlotError {}

impl From<WriteError> for SlotError {
    fn from(error: WriteError) -> Self {
        Self::Write(error)
    }
}

/// Two slots, as they were found at start and changed since. Nothing else may write their pages.
#[derive(Clone, Debug)]
pub struct Slots {
    layout: Layout,
    first: SlotState,
    second: SlotState,
}

impl Slots {
    /// Finds out what the slots hold, and decides for good what a loss of power left undecided.
    ///
    /// Writes at most six double words; none where the last store came to its end and nothing is damaged. After an
    /// error nothing is decided and nothing may be used.
    pub fn open(flash: &mut impl SlotFlash, layout: Layout) -> Result<Self, WriteError> {
        let first = settle(flash, &layout, Slot::First)?;
        let second = settle(flash, &layout, Slot::Second)?;
        let slots = Self { layout, first, second };
        if let Some(active) = slots.active()
            && slots.state(active.other()) == SlotState::Damaged
        {
            give_up(flash, &layout, active.other())?;
        }
        Ok(slots)
    }

    /// Content of a slot.
    pub const fn state(&self, slot: Slot) -> SlotState {
        match slot {
            Slot::First => self.first,
            Slot::Second => self.second,
        }
    }

    /// Returns `true` if a slot was whole once and is not any more, as it was found at start or since. What it held may
    /// have been newer than what the other one holds.
    pub const fn is_damaged(&self) -> bool {
        matches!(self.first, SlotState::Damaged) || matches!(self.second, SlotState::Damaged)
    }

    /// True where a payload was stored and is not there any more: a slot is damaged, or neither is whole and one is not
    /// erased.
    pub const fn is_lost(&self) -> bool {
        let blank = matches!((self.first, self.second), (SlotState::Empty, SlotState::Empty));
        self.is_damaged() || self.active().is_none() && !blank
    }

    /// The newest whole slot.
    pub const fn active(&self) -> Option<Slot> {
        match (self.first, self.second) {
            (SlotState::Whole { sequence: first, .. }, SlotState::Whole { sequence: second, .. }) => {
                Some(if newer(second, first) { Slot::Second } else { Slot::First })
            }
            (SlotState::Whole { .. }, _) => Some(Slot::First),
            (_, SlotState::Whole { .. }) => Some(Slot::Second),
            _ => None,
        }
    }

    /// The slot that [`Slots::roll_back`] would make active.
    pub fn previous(&self) -> Option<Slot> {
        let other = self.active()?.other();
        matches!(self.state(other), SlotState::Whole { .. }).then_some(other)
    }

    /// Copies the newest whole payload to the start of `buffer`; its length, or none where there is none.
    ///
    /// The checksum is checked on the copy. A payload that has been damaged since [`Slots::open`] is
    /// given up and the other one is taken, if it is whole; [`Slots::state`] then says so.
    pub fn load(&mut self, flash: &mut impl SlotFlash, buffer: &mut [u8]) -> Result<Option<usize>, SlotError> {
        let Some(active) = self.active() else { return Ok(None) };
        match self.copy(flash, active, buffer) {
            Err(SlotError::Damaged { slot }) => match self.fall_back(flash, slot)? {
                Some(other) => self.copy(flash, other, buffer).map(Some),
                None => Ok(None),
            },
            result => result.map(Some),
        }
    }

    /// The newest slot whose payload is whole at this moment, for whoever reads it in place; none where there is none.
    /// Damaged content is dealt with as by [`Slots::load`].
    pub fn usable(&mut self, flash: &mut impl SlotFlash) -> Result<Option<Slot>, SlotError> {
        let Some(active) = self.active() else { return Ok(None) };
        if self.is_whole(flash, active) {
            return Ok(Some(active));
        }
        let Some(other) = self.fall_back(flash, active)? else { return Ok(None) };
        if self.is_whole(flash, other) {
            return Ok(Some(other));
        }
        self.set(other, SlotState::Damaged);
        Ok(None)
    }

    /// Gives a damaged slot up for the other one, if that is whole.
    fn fall_back(&mut self, flash: &mut impl SlotFlash, damaged: Slot) -> Result<Option<Slot>, SlotError> {
        self.set(damaged, SlotState::Damaged);
        let Some(other) = self.active() else { return Ok(None) };
        give_up(flash, &self.layout, damaged)?;
        Ok(Some(other))
    }

    /// Returns `true` if the payload of `slot` still has its checksum.
    pub fn is_whole(&self, flash: &mut impl SlotFlash, slot: Slot) -> bool {
        let SlotState::Whole { sequence, length, checksum } = self.state(slot) else { return false };
        fits(flash, &self.layout, slot, Header { length, sequence, checksum })
    }

    /// Range of the payload of `slot`, in bytes from the first page; none where the slot has none.
    pub fn range(&self, slot: Slot) -> Option<core::ops::Range<usize>> {
        let SlotState::Whole { length, .. } = self.state(slot) else { return None };
        let start = (self.layout.first_word(slot) + HEADER_WORDS) * DOUBLE_WORD;
        Some(start..start + usize::from(length))
    }

    /// Copies the payload of `slot` to the start of `buffer`; its length.
    pub fn copy(&self, flash: &mut impl SlotFlash, slot: Slot, buffer: &mut [u8]) -> Result<usize, SlotError> {
        let SlotState::Whole { sequence, length, checksum } = self.state(slot) else {
            return Err(SlotError::Damaged { slot });
        };
        let available = buffer.len();
        let needed = usize::from(length);
        let payload = buffer.get_mut(..needed).ok_or(SlotError::Buffer { length: available, needed })?;
        let mut computed = Checksum::new(self.layout.kind, length, sequence);
        let start = self.layout.first_word(slot) + HEADER_WORDS;
        for (piece, word) in payload.chunks_mut(DOUBLE_WORD).zip(start..) {
            let bytes = flash.read(word).map_err(|_| SlotError::Damaged { slot })?;
            for (place, byte) in piece.iter_mut().zip(bytes) {
                *place = byte;
            }
            computed.add(piece);
        }
        if computed.value() == checksum { Ok(needed) } else { Err(SlotError::Damaged { slot }) }
    }

    /// Makes `payload` the active content. Takes the erase of a slot and a write for each double word.
    ///
    /// After an error the content in use is what it was; the previous one is lost.
    pub fn store(&mut self, flash: &mut impl SlotFlash, payload: &[u8]) -> Result<(), SlotError> {
        let limit = self.layout.capacity();
        let length = match u16::try_from(payload.len()) {
            Ok(length) if length != 0 && payload.len() <= limit => length,
            _ => return Err(SlotError::Length { length: payload.len(), limit }),
        };
        let (slot, sequence) = match self.active() {
            Some(active) => (active.other(), self.sequence(active).wrapping_add(1)),
            None => {
                // A damaged payload in the other slot may read right one day: it must not be the newest then.
                if self.second != SlotState::Empty {
                    retire(flash, &self.layout, Slot::Second)?;
                }
                (Slot::First, 1)
            }
        };
        self.set(slot, SlotState::Interrupted);
        let mut checksum = Checksum::new(self.layout.kind, length, sequence);
        checksum.add(payload);
        let header = Header { length, sequence, checksum: checksum.value() };
        match write(flash, &self.layout, slot, header, payload) {
            Ok(()) => {
                self.set(slot, SlotState::Whole { sequence, length, checksum: header.checksum });
                Ok(())
            }
            Err(error) => {
                // A start after a half-done write would decide; it is decided here. If this fails, too, the start does.
                let _ = retire(flash, &self.layout, slot);
                Err(error)
            }
        }
    }

    /// Makes the previous content active again, the active one the previous. `buffer` must hold it
    /// ([`Layout::capacity`]).
    pub fn roll_back(&mut self, flash: &mut impl SlotFlash, buffer: &mut [u8]) -> Result<(), SlotError> {
        let previous = self.previous().ok_or(SlotError::NoPrevious)?;
        let length = self.copy(flash, previous, buffer)?;
        let available = buffer.len();
        let payload = buffer.get(..length).ok_or(SlotError::Buffer { length: available, needed: length })?;
        self.store(flash, payload)
    }

    fn set(&mut self, slot: Slot, state: SlotState) {
        match slot {
            Slot::First => self.first = state,
            Slot::Second => self.second = state,
        }
    }

    fn sequence(&self, slot: Slot) -> u16 {
        match self.state(slot) {
            SlotState::Whole { sequence, .. } => sequence,
            _ => 0,
        }
    }
}

/// Reads a slot and decides in flash what is undecided.
fn settle(flash: &mut impl SlotFlash, layout: &Layout, slot: Slot) -> Result<SlotState, WriteError> {
    let start = layout.first_word(slot);
    let marks = Marks::read(flash, start);
    let header = marks.header(layout.capacity()).filter(|header| fits(flash, layout, slot, *header));
    if let Some(Header { length, sequence, checksum }) = header {
        let [first, second] = CONFIRMATIONS;
        if !marks.is(SETTLED, ZERO) {
            if !marks.is(first, CONFIRMED) && !marks.is(second, CONFIRMED) {
                retire(flash, layout, slot)?;
                return Ok(SlotState::Interrupted);
            }
            if !marks.is(second, CONFIRMED) {
                // Refused where the double word is torn; the one that follows decides all the same.
                let _ = flash.program(start + second, CONFIRMED);
            }
            flash.program(start + SETTLED, ZERO)?;
        }
        return Ok(SlotState::Whole { sequence, length, checksum });
    }
    let confirmed = CONFIRMATIONS.iter().any(|confirmation| marks.is(*confirmation, CONFIRMED));
    Ok(if marks.all(BLANK) {
        let payload = flash.read(start + HEADER_WORDS);
        if payload == Ok(BLANK) { SlotState::Empty } else { SlotState::Interrupted }
    } else if confirmed && marks.is(SETTLED, ZERO) {
        SlotState::Damaged
    } else if marks.is(HEADER, ZERO) {
        SlotState::Retired
    } else {
        SlotState::Interrupted
    })
}

/// True where the payload in flash is the one that the header speaks of.
fn fits(flash: &mut impl SlotFlash, layout: &Layout, slot: Slot, header: Header) -> bool {
    let mut computed = Checksum::new(layout.kind, header.length, header.sequence);
    let mut rest = usize::from(header.length);
    let mut word = layout.first_word(slot) + HEADER_WORDS;
    while rest > 0 {
        let Ok(bytes) = flash.read(word) else { return false };
        let used = rest.min(DOUBLE_WORD);
        computed.add(bytes.get(..used).unwrap_or(&bytes));
        rest -= used;
        word += 1;
    }
    computed.value() == header.checksum
}

/// Takes a damaged slot out of use, and leaves the marks that tell it from one that was about to be erased.
fn give_up(flash: &mut impl SlotFlash, layout: &Layout, slot: Slot) -> Result<(), WriteError> {
    let header = layout.first_word(slot) + HEADER;
    if flash.read(header) == Ok(ZERO) { Ok(()) } else { flash.program(header, ZERO) }
}

/// Takes a slot out of use, whatever it holds.
fn retire(flash: &mut impl SlotFlash, layout: &Layout, slot: Slot) -> Result<(), WriteError> {
    let start = layout.first_word(slot);
    for word in CONFIRMATIONS {
        flash.program(start + word, ZERO)?;
    }
    flash.program(start + HEADER, ZERO)
}

fn write(
    flash: &mut impl SlotFlash,
    layout: &Layout,
    slot: Slot,
    header: Header,
    payload: &[u8],
) -> Result<(), SlotError> {
    let start = layout.first_word(slot);
    // Erased half, an old slot must not look like a whole one.
    retire(flash, layout, slot)?;
    for page in 0..layout.pages {
        flash.erase_page(layout.page(slot) + page)?;
    }
    for (piece, word) in payload.chunks(DOUBLE_WORD).zip(start + HEADER_WORDS..) {
        let mut bytes = BLANK;
        for (place, byte) in bytes.iter_mut().zip(piece) {
            *place = *byte;
        }
        flash.program(word, bytes)?;
    }
    if !fits(flash, layout, slot, header) {
        return Err(SlotError::Verify { slot });
    }
    flash.program(start + HEADER, header.encode())?;
    for word in CONFIRMATIONS {
        flash.program(start + word, CONFIRMED)?;
    }
    Ok(flash.program(start + SETTLED, ZERO)?)
}
