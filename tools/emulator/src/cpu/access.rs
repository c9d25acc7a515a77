//! Loads and stores: memory at once, devices with what they have to say, the core's own registers.

use super::code::SRAM;
use super::operation::Trap;
use super::{Cpu, End};
use crate::bus::{Bus, Refusal, Width};

/// Registers of the core itself (B3.1: the private peripheral bus).
const PRIVATE: u32 = 0xe000_0000;
/// Length up to the instrumentation and debug devices, which are the chip's.
const PRIVATE_LENGTH: u32 = 0x4_2000;

#[inline(always)]
const fn width(bytes: u32) -> Width {
    match bytes {
        1 => Width::Byte,
        2 => Width::Half,
        _ => Width::Word,
    }
}

impl<B: Bus> Cpu<B> {
    /// A load of 1, 2 or 4 bytes from any address (MemU).
    #[inline(always)]
    pub(super) fn load<const BYTES: u32>(&mut self, address: u32) -> Result<u32, Trap> {
        match self.load_at_once::<BYTES>(address) {
            Some(value) => Ok(value),
            None if address & (BYTES - 1) != 0 => self.load_unaligned::<BYTES>(address),
            None => self.load_elsewhere(address, width(BYTES)),
        }
    }

    /// The same where memory answers at once.
    #[inline(always)]
    pub(super) fn load_at_once<const BYTES: u32>(&self, address: u32) -> Option<u32> {
        if address & (BYTES - 1) != 0 { None } else { self.bus.load(address, width(BYTES)) }
    }

    /// A load whose address has to be a multiple of the width (MemA).
    #[inline(always)]
    pub(super) fn load_aligned<const BYTES: u32>(&mut self, address: u32) -> Result<u32, Trap> {
        if address & (BYTES - 1) != 0 {
            return Err(Trap::Unaligned);
        }
        self.load::<BYTES>(address)
    }

    /// A store of 1, 2 or 4 bytes to any address (MemU).
    #[inline(always)]
    pub(super) fn store<const BYTES: u32>(&mut self, address: u32, value: u32) -> Result<(), Trap> {
        if self.store_at_once::<BYTES>(address, value) {
            return Ok(());
        }
        match address & (BYTES - 1) {
            0 => self.store_elsewhere(address, width(BYTES), value),
            _ => self.store_unaligned::<BYTES>(address, value),
        }
    }

    /// The same where memory takes it at once; false where it does not.
    #[inline(always)]
    pub(super) fn store_at_once<const BYTES: u32>(&mut self, address: u32, value: u32) -> bool {
        address & (BYTES - 1) == 0 && !self.code.changes(address) && self.bus.store(address, width(BYTES), value)
    }

    /// Loads of several words, one behind the other (MemA): at once where memory answers all of them so.
    #[inline(always)]
    pub(super) fn load_words(&mut self, address: u32, words: &mut [u32]) -> Result<(), Trap> {
        let bytes = 4 * words.len() as u32;
        if address & 3 == 0
            && let Some(memory) = self.bus.block(address, bytes)
        {
            for (word, bytes) in words.iter_mut().zip(memory.as_chunks().0) {
                *word = u32::from_le_bytes(*bytes);
            }
            return Ok(());
        }
        for (at, word) in (address..).step_by(4).zip(words) {
            *word = self.load_aligned::<4>(at)?;
        }
        Ok(())
    }

    /// Stores of several words, one behind the other (MemA).
    #[inline(always)]
    pub(super) fn store_words(&mut self, address: u32, words: &[u32]) -> Result<(), Trap> {
        let bytes = 4 * words.len() as u32;
        if address & 3 == 0
            && !self.code.changes_block(address, bytes)
            && let Some(memory) = self.bus.block_mut(address, bytes)
        {
            for (bytes, word) in memory.as_chunks_mut().0.iter_mut().zip(words) {
                *bytes = word.to_le_bytes();
            }
            return Ok(());
        }
        for (at, word) in (address..).step_by(4).zip(words) {
            self.store_aligned::<4>(at, *word)?;
        }
        Ok(())
    }

    /// A store whose address has to be a multiple of the width (MemA).
    #[inline(always)]
    pub(super) fn store_aligned<const BYTES: u32>(&mut self, address: u32, value: u32) -> Result<(), Trap> {
        if address & (BYTES - 1) != 0 {
            return Err(Trap::Unaligned);
        }
        self.store::<BYTES>(address, value)
    }

    #[inline(never)]
    fn load_elsewhere(&mut self, address: u32, width: Width) -> Result<u32, Trap> {
        self.settle();
        if address.wrapping_sub(PRIVATE) < PRIVATE_LENGTH {
            return self.read_private(address, width);
        }
        if SRAM.contains(&address) {
            return self.bus.read(self.now, address, width).map_err(|refusal| self.refused(address, refusal));
        }
        self.wait_for(address);
        let value = self.bus.read(self.now, address, width);
        self.now += u64::from(self.bus.wait_states(address));
        // A device; or a word of the flash that its ECC cannot read, which is an interrupt at once.
        if address >= SRAM.end || self.bus.next_event() <= self.now {
            self.read_news();
        }
        value.map_err(|refusal| self.refused(address, refusal))
    }

    #[inline(never)]
    fn store_elsewhere(&mut self, address: u32, width: Width, value: u32) -> Result<(), Trap> {
        self.settle();
        if address.wrapping_sub(PRIVATE) < PRIVATE_LENGTH {
            return self.write_private(address, width, value);
        }
        let done = self.bus.write(self.now, address, width, value);
        self.now += u64::from(self.bus.wait_states(address));
        if address < SRAM.end {
            self.code.forget(address..address.saturating_add(4));
        }
        if !SRAM.contains(&address) {
            self.read_news();
        }
        done.map_err(|refusal| self.refused(address, refusal))
    }

    /// Byte by byte, in one cycle more; faults where the program asked for that, and for devices (A3.2.1).
    #[cold]
    fn load_unaligned<const BYTES: u32>(&mut self, address: u32) -> Result<u32, Trap> {
        self.check_unaligned(address)?;
        let mut value = 0;
        for i in 0..BYTES {
            value |= self.load::<1>(address.wrapping_add(i))? << (8 * i);
        }
        Ok(value)
    }

    #[cold]
    fn store_unaligned<const BYTES: u32>(&mut self, address: u32, value: u32) -> Result<(), Trap> {
        self.check_unaligned(address)?;
        for i in 0..BYTES {
            self.store::<1>(address.wrapping_add(i), value >> (8 * i) & 0xff)?;
        }
        Ok(())
    }

    fn check_unaligned(&mut self, address: u32) -> Result<(), Trap> {
        self.settle();
        // Devices, and what lies where the map has devices (B3.1).
        let device = matches!(address >> 28, 4 | 5 | 0xa..=0xf);
        self.now += 1;
        match device || self.system.traps_unaligned() {
            true => Err(Trap::Unaligned),
            false => Ok(()),
        }
    }

    #[cold]
    fn refused(&mut self, address: u32, refusal: Refusal) -> Trap {
        match refusal {
            Refusal::NoAnswer => {
                self.trapped_address = address;
                Trap::Data
            }
            Refusal::Unmodelled(what) => {
                // The instruction's address is filled in by `trapped`.
                self.end = Some(End::Unmodelled { address: 0, what });
                Trap::End
            }
        }
    }

    /// Ends the run because a register of the core is not modelled.
    pub(super) fn unmodelled(&mut self, what: String) -> Trap {
        self.end = Some(End::Unmodelled { address: 0, what });
        Trap::End
    }
}
