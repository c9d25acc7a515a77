//! What a linked Thumb program can reach from one function: its direct branches and calls, and the linker's veneers.
//!
//! Encodings: ARM DDI 0403, A5 and A7. Data between instructions is left out by the mapping symbols ($t, $d).

use object::{Object, ObjectSection, ObjectSymbol, SymbolKind};
use std::collections::{BTreeMap, BTreeSet};

/// A program with its functions.
pub struct Program {
    functions: BTreeMap<u32, (u32, String)>,
    /// Whether code (true) or data begins at an address.
    mapping: BTreeMap<u32, bool>,
    /// Address and bytes of each section with code.
    code: Vec<(u32, Vec<u8>)>,
}

/// Where an instruction may go on to, besides the next one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Flow {
    Next,
    To(u32),
    /// To an address that only the running program knows.
    Unknown,
    /// The permanently undefined instruction: where the compiler ends what must not go on.
    Trap,
}

/// What is reached from an entry.
#[derive(Default)]
pub struct Reached {
    /// Address, size and name of every function, the entry included.
    pub functions: Vec<(u32, u32, String)>,
    /// Every word that the code has as a constant, and the function: what it may take for an address.
    pub constants: Vec<(u32, String)>,
    /// What is wrong with the walk itself, in words.
    pub unclear: Vec<String>,
}

impl Program {
    /// The program in an ELF file.
    pub fn parse(bytes: &[u8]) -> Result<Self, object::Error> {
        let file = object::File::parse(bytes)?;
        let (mut functions, mut mapping) = (BTreeMap::new(), BTreeMap::new());
        for symbol in file.symbols() {
            let (name, address) = (symbol.name()?, symbol.address() as u32 & !1);
            match name.get(..2) {
                Some("$t") => drop(mapping.insert(address, true)),
                Some("$d") => drop(mapping.insert(address, false)),
                _ if symbol.kind() == SymbolKind::Text && symbol.size() > 0 => {
                    functions.insert(address, (symbol.size() as u32, name.to_owned()));
                }
                _ => {}
            }
        }
        let code = file.sections().filter(|section| section.kind() == object::SectionKind::Text);
        let code = code.map(|section| Ok((section.address() as u32, section.data()?.to_vec())));
        Ok(Self { functions, mapping, code: code.collect::<Result<_, object::Error>>()? })
    }

    /// Address of a function.
    pub fn address(&self, name: &str) -> Option<u32> {
        self.functions.iter().find(|(_, (_, known))| known == name).map(|(address, _)| *address)
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

    /// Everything that can run once `entry` runs. Functions of which `leaf` is true are in it, but nothing that only they can reach.
    pub fn reachable(&self, entry: u32, leaf: impl Fn(&str) -> bool) -> Reached {
        let mut reached = Reached::default();
        let (mut waiting, mut seen) = (vec![entry], BTreeSet::new());
        while let Some(target) = waiting.pop() {
            let Some((&start, (size, name))) = self.functions.range(..=target).next_back() else {
                reached.unclear.push(format!("{target:#010x} is in no function"));
                continue;
            };
            if target >= start + size {
                reached.unclear.push(format!("{target:#010x} is in no function"));
                continue;
            }
            if !seen.insert(start) {
                continue;
            }
            reached.functions.push((start, *size, name.clone()));
            if leaf(name) {
                continue;
            }
            let mut at = start;
            // Lower halves that movw has put into each register.
            let mut halves = [0; 16];
            // What movw and movt have built in r12, as veneers do.
            let mut veneer = None;
            while at < start + size {
                if !self.is_code(at) {
                    if at % 4 == 0 && at + 4 <= start + size {
                        let word = self.half(at).zip(self.half(at + 2)).map(|(low, high)| high << 16 | low);
                        reached.constants.extend(word.map(|word| (word, name.clone())));
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
                let flow = match (wide, first) {
                    // bx r12 after movw r12 and movt r12.
                    (false, 0x4760) => veneer.map_or(Flow::Unknown, |address: u32| Flow::To(address & !1)),
                    (false, _) => narrow(first, at),
                    (true, _) => wide_flow(first, second, at),
                };
                if wide && second & 0x8000 == 0 {
                    let value = (first & 0xf) << 12 | (first >> 10 & 1) << 11 | (second >> 12 & 7) << 8 | second & 0xff;
                    let register = (second >> 8 & 0xf) as usize;
                    match first & 0xfbf0 {
                        0xf240 => halves[register] = value,
                        0xf2c0 => {
                            let word = value << 16 | halves[register];
                            reached.constants.push((word, name.clone()));
                            veneer = (register == 12).then_some(word);
                        }
                        _ => {}
                    }
                }
                match flow {
                    Flow::Next => {}
                    Flow::To(address) if (start..start + size).contains(&address) => {}
                    Flow::To(address) => waiting.push(address),
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
