//! Registers that keep what is written: offset, name, value after reset, which bits exist, and which of them select
//! something that is not modelled.

use crate::bus::Refusal;

/// A register of a peripheral.
#[derive(Clone, Copy, Debug)]
pub struct Register {
    /// Bytes from the peripheral's address.
    pub offset: u32,
    /// Name as in the reference manual, without the peripheral.
    pub name: &'static str,
    /// Value after reset.
    pub reset: u32,
    /// Bits that keep what is written.
    pub kept: u32,
    /// Bits that select something that is not modelled where they become set.
    pub refused: u32,
}

/// In the order of the fields.
pub const fn register(offset: u32, name: &'static str, reset: u32, kept: u32, refused: u32) -> Register {
    Register { offset, name, reset, kept, refused }
}

/// The registers of a peripheral.
#[derive(Clone, Debug)]
pub struct Block {
    name: &'static str,
    chapter: &'static str,
    table: &'static [Register],
    /// Place in `table` of the register at each word; `NONE` where there is none.
    places: Vec<u8>,
    /// Value by word; 0 where there is none.
    values: Vec<u32>,
}

const NONE: u8 = u8::MAX;

impl Block {
    /// State after reset. `chapter` of RM0440 describes them.
    pub fn new(name: &'static str, chapter: &'static str, table: &'static [Register]) -> Self {
        let words = table.iter().map(|register| register.offset / 4 + 1).max().unwrap_or(0);
        let mut places = vec![NONE; words as usize];
        for (place, register) in table.iter().enumerate() {
            places[(register.offset / 4) as usize] = place as u8;
        }
        let mut block = Self { name, chapter, table, places, values: vec![0; words as usize] };
        block.reset();
        block
    }

    /// Back to the values after reset.
    pub fn reset(&mut self) {
        for register in self.table {
            self.values[(register.offset / 4) as usize] = register.reset;
        }
    }

    fn place(&self, offset: u32) -> Option<usize> {
        self.places.get((offset / 4) as usize).copied().filter(|place| *place != NONE).map(usize::from)
    }

    fn checked(&self, offset: u32) -> Result<usize, Refusal> {
        self.place(offset).ok_or_else(|| {
            let (name, chapter) = (self.name, self.chapter);
            Refusal::Unmodelled(format!("{name}: register at {offset:#05x} (RM0440, {chapter}) is not modelled"))
        })
    }

    /// Content of a register of the table.
    ///
    /// # Panics
    /// Behind the last register.
    #[inline]
    pub fn get(&self, offset: u32) -> u32 {
        self.values[(offset / 4) as usize]
    }

    /// Content of a register; 0 where the peripheral does not have it.
    #[inline]
    pub fn get_or_zero(&self, offset: u32) -> u32 {
        self.values.get((offset / 4) as usize).copied().unwrap_or(0)
    }

    /// Lets a register hold a value, whatever bits exist.
    ///
    /// # Panics
    /// Those of [`get`](Self::get).
    #[inline]
    pub fn set(&mut self, offset: u32, value: u32) {
        self.values[(offset / 4) as usize] = value;
    }

    /// A load by the core.
    pub fn read(&self, offset: u32) -> Result<u32, Refusal> {
        self.checked(offset)?;
        Ok(self.get(offset))
    }

    /// A store by the core: keeps the bits that exist. Returns what the register held before.
    pub fn write(&mut self, offset: u32, value: u32) -> Result<u32, Refusal> {
        let place = self.checked(offset)?;
        let Register { kept, refused, .. } = self.table[place];
        let before = self.get(offset);
        let chosen = value & refused;
        if chosen != 0 {
            return Err(self.refuse(offset, &format!("bits {chosen:#x}")));
        }
        self.set(offset, before & !kept | value & kept);
        Ok(before)
    }

    /// Refusal of what is not modelled of a register.
    pub fn refuse(&self, offset: u32, what: &str) -> Refusal {
        let name = self.place(offset).map_or("?", |place| self.table[place].name);
        let (peripheral, chapter) = (self.name, self.chapter);
        Refusal::Unmodelled(format!("{peripheral}_{name}: {what} (RM0440, {chapter}) is not modelled"))
    }

    /// Refusal of what a program must not do with a register, because the reference manual leaves open what happens.
    pub fn forbid(&self, offset: u32, what: &str) -> Refusal {
        let name = self.place(offset).map_or("?", |place| self.table[place].name);
        let (peripheral, chapter) = (self.name, self.chapter);
        Refusal::Unmodelled(format!("{peripheral}_{name}: {what}, against RM0440, {chapter}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TABLE: &[Register] = &[register(0, "A", 0x5, 0xff, 0x80), register(8, "B", 0, 0, 0)];

    #[test]
    fn bits_that_do_not_exist_ignore_what_is_written() {
        let mut block = Block::new("X", "1", TABLE);
        assert_eq!(block.write(0, 0xffff_ff0f), Ok(0x5));
        assert_eq!(block.read(0), Ok(0x0f));
        block.write(8, u32::MAX).unwrap();
        assert_eq!(block.read(8), Ok(0));
        block.reset();
        assert_eq!(block.read(0), Ok(0x5));
    }

    #[test]
    fn what_is_not_modelled_is_named() {
        let mut block = Block::new("X", "1", TABLE);
        let refused = |result: Result<u32, Refusal>| match result {
            Err(Refusal::Unmodelled(text)) => text,
            other => panic!("{other:?}"),
        };
        assert_eq!(refused(block.read(4)), "X: register at 0x004 (RM0440, 1) is not modelled");
        assert_eq!(refused(block.write(0, 0x81)), "X_A: bits 0x80 (RM0440, 1) is not modelled");
        assert_eq!(block.read(0), Ok(0x5), "and nothing is written");
    }
}
