//! A program as it would be flashed: what an ELF file puts at which physical address, and its symbols by name.
//!
//! Host only. probe-rs flashes the same: every loadable segment with bytes in the file, at its physical address.

use object::elf::{FileHeader32, PT_LOAD};
use object::read::elf::{ElfFile, ProgramHeader};
use object::{Endianness, Object, ObjectSymbol, SymbolKind};
use std::collections::{BTreeMap, HashMap};
use std::fmt;

/// Why a file is not a program.
#[derive(Debug)]
pub enum ProgramError {
    /// Not a 32-bit ELF file, or a damaged one.
    Elf(object::Error),
    /// Nothing in it would be flashed.
    Empty,
}

impl fmt::Display for ProgramError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Elf(error) => write!(f, "not a 32-bit ELF program: {error}"),
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
            let damaged = ProgramError::Empty;
            let data = header.data(endian, &*elf).map_err(|()| damaged)?;
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

    /// What is flashed: physical address and bytes of each segment.
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
