//! Constants that a function's instructions put into registers: where a call through a register goes that the compiler
//! makes of several calls of one function, and where the linker's veneers go.
//!
//! Followed from one instruction to the next, whatever branches there are between them: a register is known while the
//! last instruction before that writes it loads a constant. Because another path may come with another constant, all
//! that the function has put into the register so far count. Encodings: ARM DDI 0403, A5.

/// Registers of a function on the way through its instructions.
#[derive(Default)]
pub struct Registers {
    /// Their constants; none where the last instruction that wrote them loads something else.
    known: [Option<u32>; 16],
    /// Lower halves that movw has put into each, whatever came in between.
    halves: [u32; 16],
    /// Registers and values that were ever loaded into them, as addresses of code.
    loaded: Vec<(usize, u32)>,
}

impl Registers {
    /// Address of the code that `bx` or `blx` goes to; none where that is not known.
    pub fn called(&self, word: u32) -> Option<u32> {
        let register = self.known.get((word >> 3 & 0xf) as usize).copied().flatten()?;
        // Bit 0 says that it is Thumb code.
        (register & 1 == 1).then_some(register & !1)
    }

    /// All addresses of code that the register of a `bx` or `blx` has been loaded with.
    pub fn loaded(&self, word: u32) -> impl Iterator<Item = u32> {
        let register = (word >> 3 & 0xf) as usize;
        self.loaded.iter().filter(move |(of, _)| *of == register).map(|(_, address)| *address)
    }

    /// Goes on by an instruction; the constant that it builds by itself (movw with movt), if it does. `word` reads a
    /// literal.
    pub fn follow(&mut self, first: u32, second: u32, at: u32, word: impl Fn(u32) -> Option<u32>) -> Option<u32> {
        if first >> 11 < 0b11101 {
            self.narrow(first, at, word);
            return None;
        }
        let register = (second >> 8 & 0xf) as usize;
        let immediate = (first & 0xf) << 12 | (first >> 10 & 1) << 11 | (second >> 12 & 7) << 8 | second & 0xff;
        match first {
            // movw, movt
            _ if first & 0xfbf0 == 0xf240 && second & 0x8000 == 0 => {
                self.halves[register] = immediate;
                self.load(register, None);
            }
            _ if first & 0xfbf0 == 0xf2c0 && second & 0x8000 == 0 => {
                let value = immediate << 16 | self.halves[register];
                self.load(register, Some(value));
                return Some(value);
            }
            // ldr from the literal pool
            _ if first & 0xff7f == 0xf85f => {
                let offset = second & 0xfff;
                let base = at.wrapping_add(4) & !3;
                let address = if first & 0x80 == 0 { base.wrapping_sub(offset) } else { base.wrapping_add(offset) };
                self.load((second >> 12) as usize, word(address));
            }
            // bl: what a function may destroy.
            _ if first >> 11 == 0b11110 && second & 0x8000 != 0 => self.call(),
            // ldm, pop; stm
            _ if first & 0xfe40 == 0xe800 => {
                (0..16).filter(|register| second >> register & 1 == 1).for_each(|register| self.load(register, None));
                self.load((first & 0xf) as usize, None);
            }
            // The floating-point unit writes core registers only where it moves to them, or counts an address on.
            _ if first & 0xec00 == 0xec00 => {
                let [one, other] = match first {
                    _ if first & 0xff10 == 0xee10 && second & 0x10 != 0 => [Some(second >> 12), None],
                    _ if first & 0xfff0 == 0xec50 => [Some(second >> 12), Some(first & 0xf)],
                    _ if first & 0xfe20 == 0xec20 => [Some(first & 0xf), None],
                    _ => [None, None],
                };
                [one, other].into_iter().flatten().for_each(|register| self.load(register as usize, None));
            }
            // Data processing: one destination. Long products and divisions have two.
            _ if first >> 11 == 0b11110 || first & 0xfe00 == 0xea00 || first & 0xff80 == 0xfb00 => {
                self.load(register, None);
            }
            _ if first & 0xff00 == 0xfa00 => self.load(register, None),
            // Loads and stores of one register, which may count their address on.
            _ if first & 0xfe00 == 0xf800 => {
                self.load((second >> 12) as usize, None);
                if first & 0x80 == 0 && second & 0x0900 == 0x0900 {
                    self.load((first & 0xf) as usize, None);
                }
            }
            // Everything else may write what stands in any of the places where a destination can stand.
            _ => {
                for register in [first & 0xf, second >> 12 & 0xf, second >> 8 & 0xf] {
                    self.load(register as usize, None);
                }
            }
        }
        None
    }

    fn narrow(&mut self, instruction: u32, at: u32, word: impl Fn(u32) -> Option<u32>) {
        let (low, high) = ((instruction & 7) as usize, (instruction >> 8 & 7) as usize);
        match instruction >> 11 {
            // ldr from the literal pool
            0b01001 => self.load(high, word((at.wrapping_add(4) & !3) + 4 * (instruction & 0xff))),
            // mov, cmp, add, sub with 8 bits; ldr and str by sp; adr, add from sp
            0b00100..=0b00111 | 0b10010..=0b10101 => self.load(high, None),
            // add, cmp, mov with any register; bx and blx
            0b01000 if instruction >> 8 == 0x47 => self.call(),
            // mov
            0b01000 if instruction >> 8 == 0x46 => {
                let value = self.known[(instruction >> 3 & 0xf) as usize];
                self.load(low | (instruction >> 4 & 8) as usize, value);
            }
            0b01000 if instruction >> 10 & 1 == 1 => self.load(low | (instruction >> 4 & 8) as usize, None),
            // pop, ldm and stm
            0b10111 if instruction & 0xfe00 == 0xbc00 => self.list(instruction),
            0b11000 | 0b11001 => {
                self.list(instruction);
                self.load(high, None);
            }
            // Branches.
            0b11010..=0b11111 => {}
            // cbz and cbnz, push, sub sp and the rest of the group: some of them write the lowest register.
            _ => self.load(low, None),
        }
    }

    fn list(&mut self, instruction: u32) {
        (0..8).filter(|register| instruction >> register & 1 == 1).for_each(|register| self.load(register, None));
    }

    fn call(&mut self) {
        [0, 1, 2, 3, 12, 14].into_iter().for_each(|register| self.load(register, None));
    }

    fn load(&mut self, register: usize, value: Option<u32>) {
        self.known[register] = value;
        self.loaded.extend(value.filter(|value| value & 1 == 1).map(|value| (register, value & !1)));
    }
}
