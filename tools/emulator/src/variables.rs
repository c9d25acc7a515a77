//! A program's static variables, by name and field, as a debugger finds them: from the debug information in its file.
//! Host.
//!
//! Layouts are the compiler's own choice; nothing here knows one. A static that an optimiser has taken to pieces is
//! found piece by piece; what it has taken out of the program is not found.

use crate::bus::{Bus, Refusal, Width};
use crate::program::Program;
use gimli::{AttributeValue, DwTag, EndianSlice, LittleEndian, UnitOffset, UnitSectionOffset};
use object::{Object, ObjectSection};
use std::collections::HashMap;
use std::fmt;

type Source<'a> = EndianSlice<'a, LittleEndian>;
type Unit<'a> = gimli::Unit<Source<'a>>;
type Entry<'e, 'a> = gimli::DebuggingInformationEntry<'e, 'e, Source<'a>>;

/// Reason for which a variable is not known.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum VariableError {
    /// The debug information is damaged, or there is none.
    Debug(String),
    /// No such static, or several.
    Static {
        /// Name that was looked for.
        name: String,
        /// Number of them.
        count: usize,
    },
    /// A variable has no such part.
    Part {
        /// Path to it.
        path: String,
        /// Part that was looked for in it.
        part: String,
    },
    /// Its memory does not answer.
    Memory(Refusal),
}

impl fmt::Display for VariableError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Debug(what) => write!(f, "debug information: {what}"),
            Self::Static { name, count } => write!(f, "{count} statics are called {name}"),
            Self::Part { path, part } => write!(f, "{path} has no {part}"),
            Self::Memory(refusal) => write!(f, "a variable's memory does not answer: {refusal:?}"),
        }
    }
}

impl std::error::Error for VariableError {}

impl From<gimli::Error> for VariableError {
    fn from(error: gimli::Error) -> Self {
        Self::Debug(error.to_string())
    }
}

impl From<Refusal> for VariableError {
    fn from(refusal: Refusal) -> Self {
        Self::Memory(refusal)
    }
}

#[derive(Clone, Debug)]
struct Field {
    name: String,
    offset: u32,
    of: UnitSectionOffset,
}

#[derive(Debug)]
enum Shape {
    /// A number, or something that is as good as one.
    Bits,
    /// A structure, or a union.
    Fields(Vec<Field>),
    /// An array.
    Elements { of: UnitSectionOffset, count: u32 },
    /// An enumeration without fields.
    Names(Vec<(u64, String)>),
    /// One with fields, in which `tag` says which of the variants it is; a variant without a value is the one that no
    /// other is.
    Variants { tag: Option<Field>, variants: Vec<(Option<u64>, Field)> },
}

#[derive(Debug)]
struct Type {
    size: u32,
    shape: Shape,
}

/// Consecutive bytes of a static.
#[derive(Clone, Copy, Debug)]
struct Piece {
    /// Offset in the static.
    offset: u32,
    size: u32,
    /// Address in the program's memory; none where the optimiser has taken it out.
    address: Option<u32>,
}

#[derive(Debug)]
struct Static {
    /// Path with its namespaces.
    path: String,
    pieces: Vec<Piece>,
    of: UnitSectionOffset,
}

/// The static variables of a program.
#[derive(Debug)]
pub struct Variables {
    types: HashMap<UnitSectionOffset, Type>,
    statics: Vec<Static>,
}

/// A static, or a part of one.
#[derive(Clone, Debug)]
pub struct Variable<'v> {
    variables: &'v Variables,
    path: String,
    pieces: &'v [Piece],
    /// Offset in the static.
    offset: u32,
    of: UnitSectionOffset,
}

impl Variables {
    /// Variables of a program.
    ///
    /// # Errors
    /// Debug information that cannot be read.
    pub fn of(program: &Program) -> Result<Self, VariableError> {
        let file = object::File::parse(program.elf()).map_err(|error| VariableError::Debug(error.to_string()))?;
        let section = |id: gimli::SectionId| {
            let data = file.section_by_name(id.name()).and_then(|section| section.data().ok()).unwrap_or_default();
            Ok::<_, gimli::Error>(EndianSlice::new(data, LittleEndian))
        };
        let dwarf = gimli::Dwarf::load(section)?;
        let mut found = Self { types: HashMap::new(), statics: Vec::new() };
        let mut units = dwarf.units();
        while let Some(header) = units.next()? {
            found.read_unit(&dwarf, &dwarf.unit(header)?)?;
        }
        Ok(found)
    }

    fn read_unit<'a>(&mut self, dwarf: &gimli::Dwarf<Source<'a>>, unit: &Unit<'a>) -> Result<(), VariableError> {
        let mut path: Vec<(isize, String)> = Vec::new();
        let (mut entries, mut depth) = (unit.entries(), 0);
        while let Some((delta, entry)) = entries.next_dfs()? {
            depth += delta;
            while path.pop_if(|(level, _)| *level >= depth).is_some() {}
            match entry.tag() {
                gimli::DW_TAG_namespace => path.push((depth, name(dwarf, unit, entry)?)),
                gimli::DW_TAG_variable => {
                    let (Some(pieces), Some(of)) = (pieces(unit, entry)?, kind(unit, entry)?) else { continue };
                    let own = name(dwarf, unit, entry)?;
                    let spaces = path.iter().map(|(_, space)| space.as_str());
                    let path = spaces.chain([own.as_str()]).collect::<Vec<_>>().join("::");
                    self.statics.push(Static { path, pieces, of });
                }
                tag => {
                    if let Some(shape) = shape(dwarf, unit, tag, entry.offset())? {
                        let size = number(entry, gimli::DW_AT_byte_size)?.unwrap_or(0) as u32;
                        self.types.insert(entry.offset().to_unit_section_offset(unit), Type { size, shape });
                    }
                }
            }
        }
        Ok(())
    }

    /// A variable by the end of its static's path and by the parts of it that follow,
    /// `control::CONTROL.joint.telemetry`: fields by their names, elements by their numbers. Structures around a
    /// single value need not be named.
    ///
    /// # Errors
    /// No such static or part, or several statics.
    pub fn get(&self, path: &str) -> Result<Variable<'_>, VariableError> {
        let mut parts = path.split('.');
        let name = parts.next().unwrap_or_default();
        let named = |whole: &str| whole.strip_suffix(name).is_some_and(|rest| rest.is_empty() || rest.ends_with("::"));
        let found = self.statics.iter().filter(|entry| named(&entry.path)).collect::<Vec<_>>();
        let [Static { path, pieces, of }] = &*found else {
            return Err(VariableError::Static { name: name.into(), count: found.len() });
        };
        let start = Variable { variables: self, path: path.clone(), pieces, offset: 0, of: *of };
        parts.try_fold(start, |variable, part| variable.part(part))
    }

    fn size(&self, of: UnitSectionOffset) -> u32 {
        match self.types.get(&of) {
            Some(Type { shape: Shape::Elements { of, count }, .. }) => self.size(*of) * count,
            other => other.map_or(0, |kind| kind.size),
        }
    }
}

impl<'v> Variable<'v> {
    /// Address of one of its bytes.
    fn address(&self, byte: u32) -> Result<u32, VariableError> {
        let at = self.offset + byte;
        let holds = |piece: &&Piece| piece.offset <= at && at - piece.offset < piece.size;
        let piece = self.pieces.iter().find(holds);
        let address = piece.and_then(|piece| Some(piece.address? + at - piece.offset));
        address.ok_or_else(|| self.without("place in memory"))
    }

    /// Its bytes.
    pub fn size(&self) -> u32 {
        self.variables.size(self.of)
    }

    fn shape(&self) -> Option<&'v Shape> {
        self.variables.types.get(&self.of).map(|kind| &kind.shape)
    }

    fn at(&self, field: &Field) -> Self {
        let path = format!("{}.{}", self.path, field.name);
        Self { variables: self.variables, path, pieces: self.pieces, offset: self.offset + field.offset, of: field.of }
    }

    /// The only field that takes memory.
    fn content(&self) -> Option<Self> {
        let Some(Shape::Fields(fields)) = self.shape() else { return None };
        let mut fields = fields.iter().filter(|field| self.variables.size(field.of) > 0);
        fields.next().filter(|_| fields.next().is_none()).map(|field| self.at(field))
    }

    /// A field, or an element by its number.
    ///
    /// # Errors
    /// There is none.
    pub fn part(&self, part: &str) -> Result<Self, VariableError> {
        match self.shape() {
            Some(Shape::Fields(fields)) if fields.iter().any(|field| field.name == part) => {
                let field = fields.iter().find(|field| field.name == part);
                field.map(|field| self.at(field)).ok_or_else(|| self.without(part))
            }
            Some(Shape::Elements { of, count }) => {
                let number =
                    part.parse::<u32>().ok().filter(|number| number < count).ok_or_else(|| self.without(part))?;
                let (name, offset) = (part.to_owned(), self.variables.size(*of) * number);
                Ok(self.at(&Field { name, offset, of: *of }))
            }
            _ => self.content().ok_or_else(|| self.without(part))?.part(part),
        }
    }

    fn without(&self, part: &str) -> VariableError {
        VariableError::Part { path: self.path.clone(), part: part.into() }
    }

    /// Its bits, as an unsigned number of up to 64; read without effects on the program.
    ///
    /// # Errors
    /// Memory that does not answer, or more than 64 bits.
    pub fn bits<B: Bus>(&self, bus: &mut B, now: u64) -> Result<u64, VariableError> {
        // A variant is as large as all of its enumeration.
        if let Some(content) = self.content() {
            return content.bits(bus, now);
        }
        let size = self.size();
        if !(1..=8).contains(&size) {
            return Err(self.without("number"));
        }
        let mut bits = 0;
        for byte in (0..size).rev() {
            bits = bits << 8 | u64::from(bus.read(now, self.address(byte)?, Width::Byte)?);
        }
        Ok(bits)
    }

    /// Its value as a number of single precision.
    ///
    /// # Errors
    /// Those of [`Self::bits`].
    pub fn real<B: Bus>(&self, bus: &mut B, now: u64) -> Result<f32, VariableError> {
        Ok(f32::from_bits(self.bits(bus, now)? as u32))
    }

    /// Variant of an enumeration, and the variant's content where it can have one.
    ///
    /// # Errors
    /// It is no enumeration, or has a value that is none of its variants.
    pub fn variant<B: Bus>(&self, bus: &mut B, now: u64) -> Result<(&'v str, Option<Self>), VariableError> {
        match self.shape() {
            Some(Shape::Names(names)) => {
                let bits = self.bits(bus, now)?;
                let name = names.iter().find(|(value, _)| *value == bits).map(|(_, name)| name.as_str());
                Ok((name.ok_or_else(|| self.without("variant"))?, None))
            }
            Some(Shape::Variants { tag, variants }) => {
                let tag = tag.as_ref().map(|tag| self.at(tag).bits(bus, now)).transpose()?;
                let of = |value: Option<u64>| variants.iter().find(|(of, _)| *of == value);
                let (_, field) = of(tag).or_else(|| of(None)).ok_or_else(|| self.without("variant"))?;
                Ok((field.name.as_str(), Some(self.at(field))))
            }
            _ => self.content().ok_or_else(|| self.without("variant"))?.variant(bus, now),
        }
    }
}

fn number(entry: &Entry<'_, '_>, attribute: gimli::DwAt) -> Result<Option<u64>, VariableError> {
    Ok(entry.attr_value(attribute)?.and_then(|value| value.udata_value()))
}

fn name<'a>(dwarf: &gimli::Dwarf<Source<'a>>, unit: &Unit<'a>, entry: &Entry<'_, 'a>) -> Result<String, VariableError> {
    let Some(value) = entry.attr_value(gimli::DW_AT_name)? else { return Ok(String::new()) };
    Ok(dwarf.attr_string(unit, value)?.to_string_lossy().into_owned())
}

/// The type that an entry refers to.
fn kind(unit: &Unit<'_>, entry: &Entry<'_, '_>) -> Result<Option<UnitSectionOffset>, VariableError> {
    Ok(match entry.attr_value(gimli::DW_AT_type)? {
        Some(AttributeValue::UnitRef(offset)) => Some(offset.to_unit_section_offset(unit)),
        Some(AttributeValue::DebugInfoRef(offset)) => Some(UnitSectionOffset::DebugInfoOffset(offset)),
        _ => None,
    })
}

/// Location of a variable; none where it is no static.
fn pieces(unit: &Unit<'_>, entry: &Entry<'_, '_>) -> Result<Option<Vec<Piece>>, VariableError> {
    let Some(AttributeValue::Exprloc(expression)) = entry.attr_value(gimli::DW_AT_location)? else { return Ok(None) };
    let (mut pieces, mut offset, mut last) = (Vec::new(), 0, None);
    let mut operations = expression.operations(unit.encoding());
    while let Some(operation) = operations.next()? {
        match operation {
            gimli::Operation::Address { address } => last = Some(address as u32),
            // Statics that the compiler has merged into one.
            gimli::Operation::PlusConstant { value } => last = last.map(|address| address.wrapping_add(value as u32)),
            gimli::Operation::Piece { size_in_bits, bit_offset: None } => {
                let size = (size_in_bits / 8) as u32;
                pieces.push(Piece { offset, size, address: last.take() });
                offset += size;
            }
            // A constant: it is not in memory.
            _ => last = None,
        }
    }
    pieces.extend(last.map(|address| Piece { offset, size: u32::MAX, address: Some(address) }));
    Ok(Some(pieces).filter(|pieces| pieces.iter().any(|piece| piece.address.is_some())))
}

/// Composition of a type; none for what is no type.
fn shape<'a>(
    dwarf: &gimli::Dwarf<Source<'a>>,
    unit: &Unit<'a>,
    tag: DwTag,
    offset: UnitOffset,
) -> Result<Option<Shape>, VariableError> {
    let mut tree = unit.entries_tree(Some(offset))?;
    let root = tree.root()?;
    let field = |entry: &Entry<'_, 'a>| -> Result<Option<Field>, VariableError> {
        let at = number(entry, gimli::DW_AT_data_member_location)?.unwrap_or(0) as u32;
        let name = name(dwarf, unit, entry)?;
        Ok(kind(unit, entry)?.map(|of| Field { name, offset: at, of }))
    };
    let shape = match tag {
        gimli::DW_TAG_base_type | gimli::DW_TAG_pointer_type => Shape::Bits,
        gimli::DW_TAG_structure_type | gimli::DW_TAG_union_type => {
            let (mut fields, mut variants) = (Vec::new(), None);
            let mut children = root.children();
            while let Some(child) = children.next()? {
                match child.entry().tag() {
                    gimli::DW_TAG_member => fields.extend(field(child.entry())?),
                    gimli::DW_TAG_variant_part => variants = Some(self::variants(child, &field)?),
                    _ => {}
                }
            }
            variants.unwrap_or(Shape::Fields(fields))
        }
        gimli::DW_TAG_array_type => {
            let Some(of) = kind(unit, root.entry())? else { return Ok(None) };
            let (mut count, mut children) = (0, root.children());
            while let Some(child) = children.next()? {
                count = number(child.entry(), gimli::DW_AT_count)?.unwrap_or(count);
            }
            Shape::Elements { of, count: count as u32 }
        }
        gimli::DW_TAG_enumeration_type => {
            let (mut names, mut children) = (Vec::new(), root.children());
            while let Some(child) = children.next()? {
                let value = number(child.entry(), gimli::DW_AT_const_value)?.unwrap_or(0);
                names.push((value, name(dwarf, unit, child.entry())?));
            }
            Shape::Names(names)
        }
        _ => return Ok(None),
    };
    Ok(Some(shape))
}

/// The variants of an enumeration, each a structure.
fn variants<'a>(
    part: gimli::EntriesTreeNode<'_, '_, '_, Source<'a>>,
    field: &impl Fn(&Entry<'_, 'a>) -> Result<Option<Field>, VariableError>,
) -> Result<Shape, VariableError> {
    let (mut tag, mut variants) = (None, Vec::new());
    let mut children = part.children();
    while let Some(child) = children.next()? {
        match child.entry().tag() {
            gimli::DW_TAG_member => tag = field(child.entry())?,
            gimli::DW_TAG_variant => {
                let value = number(child.entry(), gimli::DW_AT_discr_value)?;
                let mut members = child.children();
                while let Some(member) = members.next()? {
                    variants.extend(field(member.entry())?.map(|field| (value, field)));
                }
            }
            _ => {}
        }
    }
    Ok(Shape::Variants { tag, variants })
}
