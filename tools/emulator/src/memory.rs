//! A bus with nothing but memory, for tests of the core and programs that need no chip.

use crate::bus::{Bus, Refusal, Signals, Width};
use crate::chip::memory;
use crate::cpu::Cpu;
use std::ops::Range;

/// Range in which accesses are those of SRAM, without wait states.
const SRAM: Range<u32> = 0x2000_0000..0x4000_0000;

/// Blocks of memory, each of which can be loaded, stored and executed, and a line of which the test decides.
#[derive(Clone, Default)]
pub struct Memory {
    blocks: Vec<Block>,
    /// Signals that the core is told; `rewritten` and `reset` are told once.
    pub signals: Signals,
    /// Cycles that every access outside of SRAM takes more.
    pub wait_states: u32,
    /// Bytes of a line that costs them in sequence too; none where that costs nothing.
    pub line: Option<u32>,
}

#[derive(Clone)]
struct Block {
    start: u32,
    bytes: Vec<u8>,
    executable: bool,
}

impl Memory {
    /// A core that is connected to it: not generic, so that its operations are compiled here and not in every program
    /// that runs one.
    pub fn core(self) -> Cpu<Self> {
        Cpu::new(self)
    }

    /// No memory at all.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds zeros, of which `executable` ones are what the core keeps decoded.
    pub fn with(mut self, range: Range<u32>, executable: bool) -> Self {
        let length = range.end.saturating_sub(range.start) as usize;
        self.blocks.push(Block { start: range.start, bytes: vec![0; length], executable });
        self
    }

    /// 2 MiB at 0, 1 MiB where an STM32's flash begins, 256 KiB of SRAM that is not executable.
    pub fn usual() -> Self {
        let flash = 0x0800_0000..0x0810_0000;
        Self::new().with(0x2000_0000..0x2004_0000, false).with(flash, true).with(0..0x20_0000, true)
    }

    /// The bytes at `address`; None where they do not all lie in one block.
    pub fn bytes(&self, address: u32, length: usize) -> Option<&[u8]> {
        let block = self.blocks.iter().find(|block| address.wrapping_sub(block.start) < block.bytes.len() as u32)?;
        let at = (address - block.start) as usize;
        block.bytes.get(at..at.checked_add(length)?)
    }

    /// Sets the bytes at `address`, and lets the core know; false where they do not all lie in one block.
    pub fn set(&mut self, address: u32, bytes: &[u8]) -> bool {
        let Some(block) =
            self.blocks.iter_mut().find(|block| address.wrapping_sub(block.start) < block.bytes.len() as u32)
        else {
            return false;
        };
        let at = (address - block.start) as usize;
        let Some(place) = block.bytes.get_mut(at..at + bytes.len()) else { return false };
        place.copy_from_slice(bytes);
        let end = address + bytes.len() as u32;
        let changed = self.signals.rewritten.take().unwrap_or(address..end);
        self.signals.rewritten = Some(changed.start.min(address)..changed.end.max(end));
        true
    }

    #[inline(always)]
    fn get(&self, address: u32, width: Width) -> Option<u32> {
        let inside = |block: &&Block| (address.wrapping_sub(block.start) as usize) < block.bytes.len();
        let block = self.blocks.iter().find(inside)?;
        memory::load(&block.bytes, address.wrapping_sub(block.start) as usize, width)
    }

    #[inline(always)]
    fn put(&mut self, address: u32, width: Width, value: u32) -> Option<()> {
        let inside = |block: &&mut Block| (address.wrapping_sub(block.start) as usize) < block.bytes.len();
        let block = self.blocks.iter_mut().find(inside)?;
        memory::store(&mut block.bytes, address.wrapping_sub(block.start) as usize, width, value)
    }
}

impl Bus for Memory {
    fn read(&mut self, _: u64, address: u32, width: Width) -> Result<u32, Refusal> {
        self.get(address, width).ok_or(Refusal::NoAnswer)
    }

    fn write(&mut self, _: u64, address: u32, width: Width, value: u32) -> Result<(), Refusal> {
        self.put(address, width, value).ok_or(Refusal::NoAnswer)
    }

    #[inline(always)]
    fn load(&self, address: u32, width: Width) -> Option<u32> {
        if SRAM.contains(&address) { self.get(address, width) } else { None }
    }

    #[inline(always)]
    fn store(&mut self, address: u32, width: Width, value: u32) -> bool {
        SRAM.contains(&address) && self.put(address, width, value).is_some()
    }

    #[inline(always)]
    fn memory(&mut self) -> &mut [u8] {
        match self.blocks.iter_mut().find(|block| block.start == SRAM.start) {
            Some(block) => &mut block.bytes,
            None => &mut [],
        }
    }

    fn place(&self, address: u32) -> Option<usize> {
        let block = self.blocks.iter().find(|block| block.start == SRAM.start)?;
        let place = address.checked_sub(SRAM.start)? as usize;
        (place + 4 <= block.bytes.len()).then_some(place)
    }

    fn constant(&self, address: u32) -> Option<u32> {
        if SRAM.contains(&address) { None } else { self.get(address, Width::Word) }
    }

    fn fetch(&mut self, now: u64, address: u32) -> Result<u16, Refusal> {
        self.read(now, address, Width::Half).map(|half| half as u16)
    }

    fn code(&self) -> Vec<Range<u32>> {
        let executable = self.blocks.iter().filter(|block| block.executable);
        executable.map(|block| block.start..block.start + block.bytes.len() as u32).collect()
    }

    fn wait_states(&self, _: u32) -> u32 {
        self.wait_states
    }

    fn line(&self) -> Option<u32> {
        self.line
    }

    fn next_event(&self) -> u64 {
        u64::MAX
    }

    fn advance(&mut self, _: u64) {}

    fn signals(&mut self) -> Signals {
        let told = self.signals.clone();
        (self.signals.rewritten, self.signals.reset) = (None, false);
        told
    }
}
