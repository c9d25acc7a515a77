//! The pages of the flash that hold parameters; thread mode.
//!
//! embassy's driver erases and writes, with interrupts enabled. Where code and parameters share a bank, whatever
//! fetches from flash stands still meanwhile, some 20 ms for a page (from memory, not measured): such a board writes
//! with the motor off, and holds it off until it has written ([`control::hold_off`]).

use super::{FLASH_START, control, faults};
use core::ptr::addr_of;
use embassy_stm32::Peri;
use embassy_stm32::flash::{Blocking, Flash};
use embassy_stm32::peripherals::FLASH;
use friction_compensation::parameters::slots::{DOUBLE_WORD, PAGE, PAGE_WORDS, ReadError, SlotFlash, WriteError};

unsafe extern "C" {
    static __parameters_start: u8;
    static __parameters_end: u8;
}

/// The region PARAMETERS of the board's memory.
pub struct Parameters {
    flash: Flash<'static, Blocking>,
}

impl Parameters {
    /// The pages, as they are.
    pub fn new(flash: Peri<'static, FLASH>) -> Self {
        Self { flash: Flash::new_blocking(flash) }
    }

    /// All bytes of the region. What reads them knows by a checksum, read word by word, that they are whole: reading a
    /// torn word raises the non-maskable interrupt and gives anything.
    pub fn bytes(&self) -> &[u8] {
        let (start, end) = (addr_of!(__parameters_start), addr_of!(__parameters_end));
        // SAFETY: the region is flash; it changes through `erase_page` and `program` alone, which need this value for
        // themselves.
        unsafe { core::slice::from_raw_parts(start, end as usize - start as usize) }
    }

    /// Bytes from the start of the flash to byte `byte` of the parameters, of which `length` follow in the region.
    fn offset(byte: usize, length: usize) -> Option<u32> {
        let (start, end) = (addr_of!(__parameters_start) as usize, addr_of!(__parameters_end) as usize);
        let address = start.checked_add(byte)?;
        (address.checked_add(length)? <= end).then_some(address as u32 - FLASH_START)
    }
}

impl SlotFlash for Parameters {
    fn erase_page(&mut self, page: usize) -> Result<(), WriteError> {
        let refused = WriteError { word: page.saturating_mul(PAGE_WORDS) };
        let from = Self::offset(page.saturating_mul(PAGE), PAGE).ok_or(refused)?;
        if !control::hold_off() {
            return Err(refused);
        }
        self.flash.blocking_erase(from, from + PAGE as u32).map_err(|_| refused)
    }

    fn program(&mut self, word: usize, bytes: [u8; DOUBLE_WORD]) -> Result<(), WriteError> {
        let refused = WriteError { word };
        let offset = Self::offset(word.saturating_mul(DOUBLE_WORD), DOUBLE_WORD).ok_or(refused)?;
        if !control::hold_off() {
            return Err(refused);
        }
        self.flash.blocking_write(offset, &bytes).map_err(|_| refused)
    }

    fn read(&mut self, word: usize) -> Result<[u8; DOUBLE_WORD], ReadError> {
        let offset = Self::offset(word.saturating_mul(DOUBLE_WORD), DOUBLE_WORD).ok_or(ReadError)?;
        let address = (FLASH_START + offset) as *const u32;
        let torn = faults::torn_words();
        // SAFETY: two words of the region, which is flash and aligned to pages. Reading a torn one raises the
        // non-maskable interrupt, which counts it and returns.
        let [low, high] = unsafe { [address.read_volatile(), address.add(1).read_volatile()] };
        // The interrupt has been taken before anything behind this.
        cortex_m::asm::dsb();
        cortex_m::asm::isb();
        if faults::torn_words() != torn {
            return Err(ReadError);
        }
        let [a, b, c, d] = low.to_le_bytes();
        let [e, f, g, h] = high.to_le_bytes();
        Ok([a, b, c, d, e, f, g, h])
    }
}
