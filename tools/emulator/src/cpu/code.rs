//! Code, kept decoded: for each half-word where an instruction may begin, the operation that begins there.

use super::operation::{Operands, Operation, Rest, Trap};
use super::stretch::{SPAN, Stretches};
use super::translation::Translations;
use super::{Cpu, End, decode};
use crate::bus::{Bus, Refusal};
use std::ops::Range;

#[derive(Clone)]
pub(super) struct Code<B: Bus> {
    operations: Vec<Operation<B>>,
    pub(super) stretches: Stretches<B>,
    pub(super) translations: Translations,
    regions: Vec<Region>,
    /// Length of a line of code, as of [`Bus::line`].
    line: Option<u32>,
    /// The region that the program is in.
    current: Region,
    /// Range from the first to behind the last address in SRAM at which something was ever decoded: a store there may
    /// change it. A word that begins up to three bytes before reaches into it: the start is that of such a word.
    changeable: Range<u32>,
    /// Its length.
    changeable_length: u32,
}

#[derive(Clone, Copy)]
struct Region {
    start: u32,
    /// Bytes.
    length: u32,
    /// Offset at which its operations begin.
    offset: usize,
    wait_states: u64,
}

/// Places behind each region that stay empty: the last instruction of a region may be wide.
const BEHIND: usize = 2;

/// Range of SRAM, from here on, by the architecture's map (B3.1).
pub(super) const SRAM: Range<u32> = 0x2000_0000..0x4000_0000;

impl<B: Bus> Code<B> {
    pub fn new(bus: &B) -> Self {
        let mut offset = 0;
        let mut regions = Vec::new();
        for range in bus.code() {
            let length = range.end.saturating_sub(range.start) & !1;
            regions.push(Region { start: range.start & !1, length, offset, wait_states: 0 });
            offset += length as usize / 2 + BEHIND;
        }
        let nowhere = Region { start: 0, length: 0, offset: 0, wait_states: 0 };
        let operations = vec![Self::unknown(); offset];
        let stretches = Stretches::new(offset);
        let mut code = Self {
            operations,
            stretches,
            translations: Translations::default(),
            current: nowhere,
            regions,
            line: None,
            changeable: 0..0,
            changeable_length: 0,
        };
        code.set_wait_states(bus);
        code
    }

    fn unknown() -> Operation<B> {
        let never = |_: &mut Cpu<B>, _: Operands, _: Rest<B>| Err(Trap::End.into());
        Operation::new(never).cycles(0)
    }

    /// The operation at an address of the current region, None elsewhere and where nothing is decoded yet.
    #[inline(always)]
    pub fn at(&self, address: u32) -> Option<Operation<B>> {
        Self::kept(&self.operations, self.place(address)?)
    }

    /// Place in which the operation for an address of the current region is kept. That of the next instruction is kept
    /// behind it, by its half-words.
    #[inline(always)]
    pub fn place(&self, address: u32) -> Option<usize> {
        let offset = address.wrapping_sub(self.current.start);
        (offset < self.current.length).then(|| self.current.offset.wrapping_add((offset / 2) as usize))
    }

    /// Operation that is kept at a place; None where nothing is decoded yet, and behind the region's end.
    #[inline(always)]
    pub fn kept(operations: &[Operation<B>], place: usize) -> Option<Operation<B>> {
        let operation = *operations.get(place)?;
        (operation.timing.length != 0).then_some(operation)
    }

    /// The operation at an address of any region, None where nothing is decoded yet.
    pub fn anywhere(&self, address: u32) -> Option<Operation<B>> {
        Self::kept(&self.operations, self.place_anywhere(address)?)
    }

    /// Returns `true` if what begins at an address of any region is translated.
    pub fn is_translated(&self, address: u32) -> bool {
        self.place_anywhere(address).is_some_and(|place| self.stretches.is_translated(place))
    }

    fn place_anywhere(&self, address: u32) -> Option<usize> {
        let region = self.region(address)?;
        Some(region.offset + ((address - region.start) / 2) as usize)
    }

    /// Cycles that a fetch at an address of any region takes more.
    pub fn wait_states_at(&self, address: u32) -> Option<u32> {
        self.region(address).map(|region| region.wait_states as u32)
    }

    fn region(&self, address: u32) -> Option<&Region> {
        self.regions.iter().find(|region| address.wrapping_sub(region.start) < region.length)
    }

    /// Addresses at which a store may change what is decoded.
    pub fn changeable(&self) -> Range<u32> {
        self.changeable.clone()
    }

    /// Forms the stretch that begins at an address of the current region; false where nothing is decoded yet.
    #[cold]
    pub fn form(&mut self, address: u32) -> bool {
        let operations = &self.operations;
        self.place(address).is_some_and(|place| self.stretches.form(place, |place| Self::kept(operations, place)))
    }

    /// Returns `true` if a store to an address may change what is decoded; always outside of SRAM, where programs
    /// seldom store.
    #[inline(always)]
    pub fn changes(&self, address: u32) -> bool {
        address < SRAM.start || address.wrapping_sub(self.changeable.start) < self.changeable_length
    }

    /// The same of a store of several bytes.
    #[inline(always)]
    pub fn changes_block(&self, address: u32, bytes: u32) -> bool {
        self.changes(address) || self.changeable.start.wrapping_sub(address) < bytes && self.changeable_length != 0
    }

    /// Returns `true` if an address lies in the current region.
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
        self.current = self.region(address).copied().unwrap_or(nowhere);
    }

    /// Returns `true` if lines of code cost something in sequence too.
    #[inline(always)]
    pub const fn waits_for_lines(&self) -> bool {
        self.line.is_some()
    }

    /// Cycles that an instruction in the current region waits for the lines that it lies in, without the one that it
    /// begins in where a branch leads there, which the branch has waited for. `before` is where the instruction
    /// before it ends.
    pub fn waits_for_lines_of(&self, address: u32, length: u8, before: u32) -> u64 {
        let Some(line) = self.line else { return 0 };
        let fetched = if before == address { address.wrapping_sub(1) } else { address };
        let last = address.wrapping_add(u32::from(length)).wrapping_sub(1);
        u64::from((last / line).saturating_sub(fetched / line)) * self.current.wait_states
    }

    /// Asks anew what fetches cost.
    pub fn set_wait_states(&mut self, bus: &B) {
        self.line = bus.line();
        for region in &mut self.regions {
            let wait_states = u64::from(bus.wait_states(region.start));
            if region.wait_states != wait_states {
                region.wait_states = wait_states;
                self.translations.forget_all();
            }
            if region.start == self.current.start {
                self.current.wait_states = region.wait_states;
            }
        }
    }

    /// Forgets a range whose content has changed.
    pub fn forget(&mut self, range: Range<u32>) {
        // An instruction that begins up to two bytes before may reach into it.
        let range = range.start.saturating_sub(2)..range.end;
        self.translations.forget(range.clone());
        for region in &self.regions {
            let start = range.start.max(region.start);
            let end = range.end.min(region.start.saturating_add(region.length));
            let index = |address: u32| region.offset + ((address - region.start) / 2) as usize;
            if start < end {
                self.operations[index(start)..index(end + 1)].fill(Self::unknown());
                self.stretches.forget(index(start).saturating_sub(SPAN)..index(end + 1));
            }
        }
    }

    fn keep(&mut self, address: u32, operation: Operation<B>) {
        let Some(place) = self.place(address) else { return };
        if SRAM.contains(&address) {
            let (start, end) = (address - 3, address + u32::from(operation.timing.length));
            self.changeable = match self.changeable.is_empty() {
                true => start..end,
                false => self.changeable.start.min(start)..self.changeable.end.max(end),
            };
            self.changeable_length = self.changeable.end - self.changeable.start;
            self.translations.forget_all();
        }
        if let Some(kept) = self.operations.get_mut(place) {
            *kept = operation;
        }
        self.stretches.decoded(place);
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
            Ok((first, second)) if self.code.holds(pc) => match (self.decode)(pc, first, second) {
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
