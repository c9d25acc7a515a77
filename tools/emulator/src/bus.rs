//! Surroundings of an emulated core: addresses that answer, time that makes things happen, and lines that interrupt.

use std::ops::Range;

/// Part of a word that an access takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Width {
    /// 8 bits.
    Byte,
    /// 16 bits.
    Half,
    /// 32 bits.
    Word,
}

impl Width {
    /// Width in bytes.
    #[inline(always)]
    pub const fn bytes(self) -> u32 {
        match self {
            Self::Byte => 1,
            Self::Half => 2,
            Self::Word => 4,
        }
    }
}

/// Reason for which an access was not answered.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// No answer: nothing on the chip is there, and the core takes a precise bus fault.
    NoAnswer,
    /// The chip would answer, but that part of it is not modelled: the run ends, so that no result rests on it. In
    /// words, with the section of the reference manual.
    Unmodelled(String),
}

/// Signals of the bus to the core besides data. Read after every write to a device, every read of one, and every
/// [`Bus::advance`].
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Signals {
    /// Level of interrupt line n in bit n % 32 of word n / 32.
    pub lines: [u32; 4],
    /// Level of the non-maskable interrupt.
    pub nmi: bool,
    /// The chip resets the core (watchdog, power).
    pub reset: bool,
    /// Code that changed by itself (flash that was erased or written), which the core must decode anew.
    pub rewritten: Option<Range<u32>>,
    /// Memory that does not answer before a cycle: code and data that the core wants from there wait until then. Read
    /// it also after a store to memory that is not RAM: flash that is erased or written begins to stall with that
    /// store.
    pub stall: Option<(Range<u32>, u64)>,
}

/// Memories and devices as a core sees them. `now` counts the core's cycles since the run began and never goes back.
pub trait Bus {
    /// A load. `address` is a multiple of the width, or lies in memory that allows any.
    fn read(&mut self, now: u64, address: u32, width: Width) -> Result<u32, Refusal>;
    /// A store.
    fn write(&mut self, now: u64, address: u32, width: Width, value: u32) -> Result<(), Refusal>;
    /// A load from memory that answers at once and that nothing else hears of: most of the traffic, for which the core
    /// does nothing else. None for everything else, which the core then [`read`](Self::read)s.
    #[inline(always)]
    fn load(&self, _address: u32, _width: Width) -> Option<u32> {
        None
    }
    /// A store of that kind; false where it is none, and has to be a [`write`](Self::write).
    #[inline(always)]
    fn store(&mut self, _address: u32, _width: Width, _value: u32) -> bool {
        false
    }
    /// Memory that answers such loads, all bytes of a block.
    #[inline(always)]
    fn block(&self, _address: u32, _bytes: u32) -> Option<&[u8]> {
        None
    }
    /// Memory that takes such stores, all bytes of a block.
    #[inline(always)]
    fn block_mut(&mut self, _address: u32, _bytes: u32) -> Option<&mut [u8]> {
        None
    }
    /// All memory that answers so from 2000_0000h on, for translated code. It never changes its length, but that it is
    /// empty without power.
    #[inline(always)]
    fn memory(&mut self) -> &mut [u8] {
        &mut []
    }
    /// Place of a word in [`memory`](Self::memory); none where it does not lie there.
    fn place(&self, _address: u32) -> Option<usize> {
        None
    }
    /// A word of memory that changes only with [`Signals::rewritten`], and that nothing hears of when it is loaded;
    /// none where it is none.
    fn constant(&self, _address: u32) -> Option<u32> {
        None
    }
    /// Half a word of code.
    fn fetch(&mut self, now: u64, address: u32) -> Result<u16, Refusal>;
    /// Ranges in which code may lie; what the core keeps decoded.
    fn code(&self) -> Vec<Range<u32>>;
    /// Cycles that an access there takes more than the core's own.
    fn wait_states(&self, address: u32) -> u32;
    /// Bytes of a line of code, a power of two, where each line costs the wait states of its address although the one
    /// before it was fetched; none where fetching in sequence costs nothing.
    fn line(&self) -> Option<u32> {
        None
    }
    /// Cycle at which something next happens by itself; `u64::MAX` for never.
    fn next_event(&self) -> u64;
    /// Does what is due up to `now`.
    fn advance(&mut self, now: u64);
    /// Returns `true` if there may be signals that it was not told yet. Where there are none, asking for them would
    /// change nothing.
    #[inline(always)]
    fn has_news(&self) -> bool {
        true
    }
    /// Signals that the core has to know; forgets `rewritten` and `reset`, which are told once.
    fn signals(&mut self) -> Signals;
}
