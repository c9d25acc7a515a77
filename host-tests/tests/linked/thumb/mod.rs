//! Code that a linked Thumb program can reach from one function: its direct branches and calls, and the linker's
//! veneers.
//!
//! Encodings: ARM DDI 0403, A5 and A7. Data between instructions is left out by the mapping symbols ($t, $d).

mod registers;
pub mod stack;

use object::{Object, ObjectSection, ObjectSymbol, SymbolKind};
use std::collections::{BTreeMap, BTreeSet};

/// A program with its functions.
pub struct Program {
    functions: BTreeMap<u32, (u32, String)>,
    symbols: BTreeMap<String, u32>,
    /// Kind of content from an address on: code (true) or data.
    mapping: BTreeMap<u32, bool>,
    /// Address and bytes of each section with code.
    code: Vec<(u32, Vec<u8>)>,
}

/// Destination of an instruction, besides the next one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Flow {
    Next,
    To(u32),
    /// Address that only the running program knows.
    Unknown,
    /// The permanently undefined instruction: where the compiler ends what must not go on.
    Trap,
}

/// Code that is reached from an entry.
#[derive(Default)]
pub struct Reached {
    /// Address, size and name of every function, the entry included.
    pub functions: Vec<(u32, u32, String)>,
    /// Every word that the code has as a constant, and the function: what it may take for an address.
    pub constants: Vec<(u32, String)>,
    /// Defects of the walk itself, in words.
    pub unclear: Vec<String>,
}

impl Program {
    /// The program in an ELF file.
    pub fn parse(bytes: &[u8]) -> Result<Self, object::Error> {
        let file = object::File::parse(bytes)?;
        let (mut functions, mut mapping, mut symbols) = (BTreeMap::new(), BTreeMap::new(), BTreeMap::new());
        for symbol in file.symbols() {
            let (name, address) = (symbol.name()?, symbol.address() as u32 & !1);
            match name.get(..2) {
                Some("$t") => drop(mapping.insert(address, true)),
                Some("$d") => drop(mapping.insert(address, false)),
                _ if symbol.kind() == SymbolKind::Text && symbol.size() > 0 => {
                    functions.insert(address, (symbol.size() as u32, name.to_owned()));
                }
                _ => drop(symbols.insert(name.to_owned(), symbol.address() as u32)),
            }
        }
        let code = file.sections().filter(|section| section.kind() == object::SectionKind::Text);
        let code = code.map(|section| Ok((section.address() as u32, section.data()?.to_vec())));
        Ok(Self { functions, symbols, mapping, code: code.collect::<Result<_, object::Error>>()? })
    }

    /// Address of a function.
    pub fn address(&self, name: &str) -> Option<u32> {
        self.functions.iter().find(|(_, (_, known))| known == name).map(|(address, _)| *address)
    }

    /// Names of all functions that `is` picks.
    pub fn named(&self, is: impl Fn(&str) -> bool) -> Vec<String> {
        self.functions.values().filter(|(_, name)| is(name)).map(|(_, name)| name.clone()).collect()
    }

    /// Value of a symbol that is no function: an address.
    pub fn symbol(&self, name: &str) -> Option<u32> {
        self.symbols.get(name).copied()
    }

    /// Address, size and name of the function that an address lies in.
    fn containing(&self, address: u32) -> Option<(u32, u32, &str)> {
        let (&start, (size, name)) = self.functions.range(..=address).next_back()?;
        (address < start + size).then_some((start, *size, name))
    }

    fn half(&self, address: u32) -> Option<u32> {
        self.code.iter().find_map(|(start, bytes)| {
            let at = address.checked_sub(*start)? as usize;
            Some(u32::from(u16::from_le_bytes(bytes.get(at..at + 2)?.try_into().ok()?)))
        })
    }

    fn is_code(&self, address: u32) -> bool {
        self.mapping.range(..=address).next_back().is_none_or(|(_, code)| *code)
    }

    /// Functions that can run once `entry` runs. Functions of which `leaf` is true are in it, but nothing that only
    /// they can reach.
    pub fn reachable(&self, entry: u32, leaf: impl Fn(&str) -> bool) -> Reached {
        let mut reached = Reached::default();
        let (mut waiting, mut seen) = (vec![entry], BTreeSet::new());
        while let Some(target) = waiting.pop() {
            let Some((start, size, name)) = self.containing(target) else {
                reached.unclear.push(format!("{target:#010x} is in no function"));
                continue;
            };
            if !seen.insert(start) {
                continue;
            }
            reached.functions.push((start, size, name.to_owned()));
            if leaf(name) {
                continue;
            }
            let mut at = start;
            let mut registers = registers::Registers::default();
            while at < start + size {
                if !self.is_code(at) {
                    if at % 4 == 0 && at + 4 <= start + size {
                        let word = self.half(at).zip(self.half(at + 2)).map(|(low, high)| high << 16 | low);
                        reached.constants.extend(word.map(|word| (word, name.to_owned())));
                    }
                    at += 2;
                    continue;
                }
                let Some(first) = self.half(at) else {
                    reached.unclear.push(format!("{name}: no code at {at:#010x}"));
                    break;
                };
                let wide = first >> 11 >= 0b11101;
                let second = if wide { self.half(at + 2).unwrap_or(0) } else { 0 };
                let flow = if wide { wide_flow(first, second, at) } else { narrow(first, at) };
                let known = (flow == Flow::Unknown).then(|| registers.called(first)).flatten();
                let word = |address| Some(self.half(address)? | self.half(address + 2)? << 16);
                reached.constants.extend(registers.follow(first, second, at, word).map(|word| (word, name.to_owned())));
                match flow {
                    Flow::Next => {}
                    Flow::To(address) if (start..start + size).contains(&address) => {}
                    Flow::To(address) => waiting.push(address),
                    Flow::Unknown if known.is_some_and(|address| self.containing(address).is_some()) => {
                        waiting.extend(registers.loaded(first).filter(|address| self.containing(*address).is_some()));
                    }
                    Flow::Unknown => reached.unclear.push(format!("{name}: who knows where {at:#010x} goes")),
                    Flow::Trap => reached.unclear.push(format!("{name}: trap at {at:#010x}")),
                }
                at += if wide { 4 } else { 2 };
            }
        }
        reached
    }
}

/// `value` of `bits` bits with its sign.
fn signed(value: u32, bits: u32) -> u32 {
    ((value << (32 - bits)) as i32 >> (32 - bits)) as u32
}

fn narrow(word: u32, at: u32) -> Flow {
    let from = at.wrapping_add(4);
    match word {
        // udf
        _ if word >> 8 == 0xde => Flow::Trap,
        // b<c>, but for svc
        _ if word >> 12 == 0b1101 && word >> 8 != 0xdf => Flow::To(from.wrapping_add(signed(word & 0xff, 8) << 1)),
        // b
        _ if word >> 11 == 0b11100 => Flow::To(from.wrapping_add(signed(word & 0x7ff, 11) << 1)),
        // cbz, cbnz
        _ if word & 0xf500 == 0xb100 => Flow::To(from + ((word >> 9 & 1) << 6 | (word >> 3 & 0x1f) << 1)),
        // bx lr returns; any other bx, and blx, go where a register says.
        0x4770 => Flow::Next,
        _ if word & 0xff00 == 0x4700 => Flow::Unknown,
        // mov pc, add pc
        _ if word & 0xff87 == 0x4687 || word & 0xff87 == 0x4487 => Flow::Unknown,
        _ => Flow::Next,
    }
}

fn wide_flow(first: u32, second: u32, at: u32) -> Flow {
    let from = at.wrapping_add(4);
    let sign = first >> 10 & 1;
    if first >> 11 == 0b11110 && second & 0x8000 != 0 {
        let (j1, j2, low) = (second >> 13 & 1, second >> 11 & 1, second & 0x7ff);
        // bl and the long b; the conditional b; the rest of this group are barriers, hints and system registers.
        if second & 0x1000 != 0 {
            let (i1, i2) = (1 ^ j1 ^ sign, 1 ^ j2 ^ sign);
            let offset = sign << 23 | i1 << 22 | i2 << 21 | (first & 0x3ff) << 11 | low;
            return Flow::To(from.wrapping_add(signed(offset, 24) << 1));
        }
        if second & 0x4000 == 0 && first >> 7 & 7 != 7 {
            let offset = sign << 19 | j2 << 18 | j1 << 17 | (first & 0x3f) << 11 | low;
            return Flow::To(from.wrapping_add(signed(offset, 20) << 1));
        }
        if first & 0xfff0 == 0xf7f0 && second & 0xf000 == 0xa000 {
            return Flow::Trap;
        }
        return Flow::Next;
    }
    // ldr pc, but for pop {pc}, which returns.
    let loads_pc = first & 0xff70 == 0xf850 && second >> 12 == 15;
    match loads_pc && !(first == 0xf85d && second & 0xfff == 0xb04) {
        true => Flow::Unknown,
        false => Flow::Next,
    }
}
