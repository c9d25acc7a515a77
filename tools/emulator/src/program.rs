//! A program as it would be flashed: what an ELF file puts at which physical address, and its symbols by name.
//!
//! Host only. probe-rs flashes the same: every loadable segment with bytes in the file, at its physical address.

use object::elf::{FileHeader32, PT_LOAD};
use object::read::elf::{ElfFile, ProgramHeader};
use object::{Endianness, Object, ObjectSymbol, SymbolKind};
use std::collections::{BTreeMap, HashMap};
use std::fmt;

/// Reason for which a file is not a program.
#[derive(Debug)]
pub enum ProgramError {
    /// Not a 32-bit ELF file, or a damaged one.
    Elf(object::Error),
    /// A segment whose bytes the file does not have, by its physical address.
    Segment(u32),
    /// Empty program: nothing in it would be flashed.
    Empty,
}

impl fmt::Display for ProgramError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Elf(error) => write!(f, "not a 32-bit ELF program: {error}"),
            Self::Segment(address) => write!(f, "the ELF file ends before the segment for {address:#010x} does"),
            Self::Empty => write!(f, "the ELF file has nothing to flash"),
        }
    }
}

impl std::error::Error for ProgramError {}

impl From<object::Error> for ProgramError {
    fn from(error: object::Error) -> Self {
        Self::Elf(error)
    }
}

/// A named place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Symbol {
    /// Its address; of a function without the bit that says Thumb.
    pub address: u32,
    /// Bytes, 0 where the file does not say.
    pub size: u32,
}

/// A program.
pub struct Program {
    elf: Vec<u8>,
    segments: Vec<(u32, Vec<u8>)>,
    symbols: HashMap<String, Symbol>,
    functions: BTreeMap<u32, (u32, String)>,
}

impl Program {
    /// The program in the bytes of an ELF file.
    pub fn parse(elf: Vec<u8>) -> Result<Self, ProgramError> {
        let file = ElfFile::<FileHeader32<Endianness>>::parse(&*elf)?;
        let endian = file.endian();
        let mut segments = Vec::new();
        for header in file.elf_program_headers() {
            if header.p_type(endian) != PT_LOAD || header.p_filesz(endian) == 0 {
                continue;
            }
            let data = header.data(endian, &*elf).map_err(|()| ProgramError::Segment(header.p_paddr(endian)))?;
            segments.push((header.p_paddr(endian), data.to_vec()));
        }
        if segments.is_empty() {
            return Err(ProgramError::Empty);
        }
        let (mut symbols, mut functions) = (HashMap::new(), BTreeMap::new());
        for symbol in file.symbols() {
            let Ok(name) = symbol.name() else { continue };
            // Mapping symbols mark code and data; they name nothing.
            if name.is_empty() || name.starts_with('$') {
                continue;
            }
            let is_function = symbol.kind() == SymbolKind::Text;
            let address = symbol.address() as u32;
            let place =
                Symbol { address: if is_function { address & !1 } else { address }, size: symbol.size() as u32 };
            let readable = format!("{:#}", rustc_demangle::demangle(name));
            if is_function {
                functions.insert(place.address, (place.size, readable.clone()));
            }
            symbols.insert(readable, place);
            symbols.insert(name.to_owned(), place);
        }
        Ok(Self { segments, symbols, functions, elf })
    }

    /// Segments that are flashed: physical address and bytes of each.
    pub fn segments(&self) -> impl Iterator<Item = (u32, &[u8])> {
        self.segments.iter().map(|(address, bytes)| (*address, &**bytes))
    }

    /// A symbol by its name, as it is in the file or demangled without hash.
    pub fn symbol(&self, name: &str) -> Option<Symbol> {
        self.symbols.get(name).copied()
    }

    /// Every function whose demangled name ends with `end`, by address.
    pub fn functions_ending(&self, end: &str) -> impl Iterator<Item = (u32, &str)> {
        let named = self.functions.iter().map(|(address, (_, name))| (*address, name.as_str()));
        named.filter(move |(_, name)| name.ends_with(end))
    }

    /// Demangled name of the function that an address lies in.
    pub fn function_at(&self, address: u32) -> Option<&str> {
        let (start, (size, name)) = self.functions.range(..=address).next_back()?;
        (address - start < (*size).max(1)).then_some(name)
    }

    /// The file itself.
    pub fn elf(&self) -> &[u8] {
        &self.elf
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An ELF file of one segment whose bytes lie in flash and run in CCM SRAM, and of two symbols.
    fn elf() -> Vec<u8> {
        let names = b"\0_ZN5joint4step17h0123456789abcdefE\0_SEGGER_RTT\0";
        let words = |words: &[u32]| words.iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<u8>>();
        let (data, symbols, strings, sections) = (84u32, 88u32, 88 + 48, 88 + 48 + names.len() as u32);
        let mut file = b"\x7fELF\x01\x01\x01".to_vec();
        file.resize(16, 0);
        // Executable for Arm; entry, program headers, section headers, flags; sizes and counts of headers.
        file.extend(words(&[2 | 40 << 16, 1, 0, 52, sections, 0x0500_0200]));
        file.extend(words(&[52 | 32 << 16, 1 | 40 << 16, 3 | 2 << 16]));
        // One segment to load: virtual address in CCM SRAM, physical in flash, room for eight bytes of which four are
        // in the file.
        file.extend(words(&[1, data, 0x1000_0000, 0x0800_1000, 4, 8, 5, 4]));
        file.extend([1, 2, 3, 4]);
        file.extend(words(&[0; 4]));
        // A global function in Thumb code and a global object.
        file.extend(words(&[1, 0x1000_0001, 4, 0x12 | 1 << 16]));
        file.extend(words(&[36, 0x2000_0100, 48, 0x11 | 1 << 16]));
        file.extend(names);
        file.extend(words(&[0; 10]));
        file.extend(words(&[0, 2, 0, 0, symbols, 48, 2, 1, 4, 16]));
        file.extend(words(&[0, 3, 0, 0, strings, names.len() as u32, 0, 0, 1, 0]));
        file
    }

    #[test]
    fn bytes_go_to_their_physical_address() {
        let program = Program::parse(elf()).expect("a program");
        assert_eq!(program.segments().collect::<Vec<_>>(), [(0x0800_1000, &[1, 2, 3, 4][..])]);
    }

    #[test]
    fn symbols_are_found_by_either_name_and_by_address() {
        let program = Program::parse(elf()).expect("a program");
        let step = Some(Symbol { address: 0x1000_0000, size: 4 });
        assert_eq!(program.symbol("joint::step"), step);
        assert_eq!(program.symbol("_ZN5joint4step17h0123456789abcdefE"), step);
        assert_eq!(program.symbol("_SEGGER_RTT").map(|symbol| symbol.address), Some(0x2000_0100));
        assert_eq!(program.symbol("step"), None);
        assert_eq!(program.functions_ending("::step").collect::<Vec<_>>(), [(0x1000_0000, "joint::step")]);
        let at = [0x1000_0000, 0x1000_0003, 0x1000_0004].map(|address| program.function_at(address));
        assert_eq!(at, [Some("joint::step"), Some("joint::step"), None]);
    }

    #[test]
    fn what_is_no_program_is_refused() {
        assert!(matches!(Program::parse(b"hello".to_vec()), Err(ProgramError::Elf(_))));
        let mut empty = elf();
        // The type of the segment: none.
        empty[52] = 0;
        assert!(matches!(Program::parse(empty), Err(ProgramError::Empty)));
        let mut short = elf();
        // More bytes in the file than there are.
        short[52 + 18] = 1;
        assert!(matches!(Program::parse(short), Err(ProgramError::Segment(0x0800_1000))));
    }
}
