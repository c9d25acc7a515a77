//! Code, kept decoded: for each half-word where an instruction may begin, the operation that begins there.

use super::operation::{Operands, Operation, Trap};
use super::{Cpu, End, decode};
use crate::bus::{Bus, Refusal};
use std::ops::Range;

pub(super) struct Code<B: Bus> {
    operations: Vec<Operation<B>>,
    regions: Vec<Region>,
    /// The region that the program is in.
    current: Region,
    /// Whether a store to SRAM can change code.
    pub in_sram: bool,
}

#[derive(Clone, Copy)]
struct Region {
    start: u32,
    /// Bytes.
    length: u32,
    /// Where its operations begin.
    offset: usize,
    wait_states: u64,
}

/// From here on memory is SRAM, by the architecture's map (B3.1).
pub(super) const SRAM: Range<u32> = 0x2000_0000..0x4000_0000;

impl<B: Bus> Code<B> {
    pub fn new(bus: &B) -> Self {
        let mut offset = 0;
        let mut regions = Vec::new();
        for range in bus.code() {
            let length = range.end.saturating_sub(range.start) & !1;
            regions.push(Region { start: range.start & !1, length, offset, wait_states: 0 });
            offset += length as usize / 2;
        }
        let nowhere = Region { start: 0, length: 0, offset: 0, wait_states: 0 };
        let in_sram = regions.iter().any(|region| region.start < SRAM.end && region.start + region.length > SRAM.start);
        let mut code = Self { operations: vec![Self::unknown(); offset], current: nowhere, regions, in_sram };
        code.set_wait_states(bus);
        code
    }

    fn unknown() -> Operation<B> {
        let never = |_: &mut Cpu<B>, _: Operands| Err(Trap::End);
        Operation { cycles: 0, ..Operation::new(never) }
    }

    /// The operation at an address of the current region, None elsewhere and where nothing is decoded yet.
    #[inline(always)]
    pub fn at(&self, address: u32) -> Option<Operation<B>> {
        let offset = address.wrapping_sub(self.current.start);
        if offset >= self.current.length {
            return None;
        }
        let operation = *self.operations.get(self.current.offset.wrapping_add((offset / 2) as usize))?;
        (operation.length != 0).then_some(operation)
    }

    /// Whether an address lies in the current region.
    #[inline(always)]
    pub fn holds(&self, address: u32) -> bool {
        address.wrapping_sub(self.current.start) < self.current.length
    }

    /// Cycles that a fetch in the current region takes more.
    #[inline(always)]
    pub fn wait_states(&self) -> u64 {
        self.current.wait_states
    }

    /// Makes the region of an address the current one; where there is none, nothing is.
    #[cold]
    pub fn enter(&mut self, address: u32) {
        let nowhere = Region { start: 0, length: 0, offset: 0, wait_states: 0 };
        let found = self.regions.iter().find(|region| address.wrapping_sub(region.start) < region.length);
        self.current = found.copied().unwrap_or(nowhere);
    }

    /// Asks anew what fetches cost.
    pub fn set_wait_states(&mut self, bus: &B) {
        for region in &mut self.regions {
            region.wait_states = u64::from(bus.wait_states(region.start));
            if region.start == self.current.start {
                self.current.wait_states = region.wait_states;
            }
        }
    }

    /// What lies there has changed.
    pub fn forget(&mut self, range: Range<u32>) {
        // An instruction that begins up to two bytes before may reach into it.
        let range = range.start.saturating_sub(2)..range.end;
        for region in &self.regions {
            let start = range.start.max(region.start);
            let end = range.end.min(region.start.saturating_add(region.length));
            let index = |address: u32| region.offset + ((address - region.start) / 2) as usize;
            if start < end {
                self.operations[index(start)..index(end + 1)].fill(Self::unknown());
            }
        }
    }

    fn keep(&mut self, address: u32, operation: Operation<B>) {
        let offset = address.wrapping_sub(self.current.start);
        if let Some(place) = self.operations.get_mut(self.current.offset + (offset / 2) as usize) {
            *place = operation;
        }
    }
}

impl<B: Bus> Cpu<B> {
    /// Decodes what lies at `pc`; or it is code that must not run.
    #[cold]
    pub(super) fn elsewhere(&mut self, pc: u32) {
        if !self.code.holds(pc) {
            self.code.enter(pc);
        }
        // Devices and the core's own registers are never executable (B3.1).
        let never = matches!(pc >> 28, 4 | 5 | 0xa..=0xf);
        let halves = match never {
            true => return self.trapped(Trap::ExecuteNever, pc),
            false => self.bus.fetch(self.now, pc).and_then(|first| match decode::wide(first) {
                true => Ok((first, self.bus.fetch(self.now, pc.wrapping_add(2))?)),
                false => Ok((first, 0)),
            }),
        };
        match halves {
            Ok((first, second)) if self.code.holds(pc) => match decode::decode(pc, first, second) {
                Ok(operation) => self.code.keep(pc, operation),
                Err(why) => {
                    let length = if decode::wide(first) { 4 } else { 2 };
                    let _ = self.refuse(pc, length, why);
                    self.attention = 0;
                }
            },
            Ok(_) => {
                let what = "code outside of what the bus gives as code".to_owned();
                self.end = Some(End::Unmodelled { address: pc, what });
                self.attention = 0;
            }
            Err(Refusal::NoAnswer) => self.trapped(Trap::Fetch, pc),
            Err(Refusal::Unmodelled(what)) => {
                self.end = Some(End::Unmodelled { address: pc, what });
                self.attention = 0;
            }
        }
    }
}
