//! Tables in Parquet: flat columns, uncompressed, snappy or zstd; host.
//!
//! Read: DOUBLE, FLOAT, INT32, INT64 and BOOLEAN as numbers (integers and time stamps as they stand, in the unit that
//! they have), BYTE_ARRAY as text. A null is NaN, or the empty text. Lists, decimals and INT96 are refused.
//!
//! Written: optional DOUBLE, NaN as null; optional BYTE_ARRAY with the annotation STRING; snappy, as pyarrow and pandas
//! write by default. The bytes depend on the table only.

use crate::error::LogError;
use crate::format::Format;
use crate::table::{Table, Texts, Wanted};
use bytes::Bytes;
use parquet::basic::{Compression, ConvertedType, LogicalType, Repetition, Type as PhysicalType};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::{ByteArray, ByteArrayType, DataType, DoubleType};
use parquet::errors::ParquetError;
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::{ColumnDescriptor, Type};
use std::fs::File;
use std::path::Path;
use std::sync::Arc;

/// Rows that are decoded at a time.
const BATCH: usize = 8_192;
/// Rows of a row group that is written.
const GROUP: usize = 1 << 20;
/// Bytes of a file up to which it is read at once: of a large one the columns that are wanted, each by its place.
pub const WHOLE: u64 = 16 << 20;
/// Rows of a table up to which it is written without dictionaries and statistics, which are longer than its values.
const SMALL: usize = 64;

/// One wanted column of a file.
struct Target<'a> {
    /// Its place among the file's columns.
    leaf: usize,
    name: &'a str,
    values: Values,
}

enum Values {
    Numbers(Vec<f64>),
    Texts(Texts),
}

/// Reads the wanted columns, row group by row group.
///
/// # Errors
/// [`LogError`].
pub fn read(path: &Path, wanted: &Wanted) -> Result<Table, LogError> {
    read_with(path, wanted, &[])
}

/// Reads the wanted columns, and of `others`, columns of numbers, those that are there.
///
/// # Errors
/// [`LogError`].
pub fn read_with(path: &Path, wanted: &Wanted, others: &[&str]) -> Result<Table, LogError> {
    guarded(path, || read_with_reader(&*open(path)?, path, wanted, others))
}

/// The same of a file whose bytes are here already; `path` is told in an error.
///
/// # Errors
/// [`LogError`].
pub fn read_bytes_with(path: &Path, bytes: Vec<u8>, wanted: &Wanted, others: &[&str]) -> Result<Table, LogError> {
    guarded(path, || {
        let reader = SerializedFileReader::new(Bytes::from(bytes)).map_err(|error| foreign(path, &error))?;
        read_with_reader(&reader, path, wanted, others)
    })
}

fn read_with_reader(reader: &dyn FileReader, path: &Path, wanted: &Wanted, others: &[&str]) -> Result<Table, LogError> {
    let mut all = wanted.clone();
    let names = names(reader);
    all.numbers.extend(names.into_iter().filter(|name| others.contains(&name.as_str())));
    read_columns(reader, path, &all)
}

/// Runs a reader. The crate `parquet` panics at lengths and places in a damaged file that it does not check.
fn guarded<T>(path: &Path, read: impl FnOnce() -> Result<T, LogError>) -> Result<T, LogError> {
    // Only the path outlives a panic.
    let read = std::panic::catch_unwind(std::panic::AssertUnwindSafe(read));
    read.unwrap_or_else(|_| {
        let reason = "its lengths contradict each other".into();
        Err(LogError::Damaged { file: path.to_owned(), row: 0, reason })
    })
}

fn read_columns(reader: &dyn FileReader, path: &Path, wanted: &Wanted) -> Result<Table, LogError> {
    let mut targets = targets(reader, path, wanted)?;
    let mut rows = 0;
    for group in 0..reader.num_row_groups() {
        let damaged = |error: &dyn std::fmt::Display| damaged(path, rows, error);
        let group = reader.get_row_group(group).map_err(|error| damaged(&error))?;
        let expected = usize::try_from(group.metadata().num_rows()).map_err(|error| damaged(&error))?;
        for target in &mut targets {
            let column = group.get_column_reader(target.leaf).map_err(|error| damaged(&error))?;
            let descriptor = reader.metadata().file_metadata().schema_descr().column(target.leaf);
            let before = target.values.len();
            let read = target.values.extend(column, &descriptor);
            let found = target.values.len() - before;
            if let Err(error) = read {
                let reason = format!("column {:?}: {error}", target.name);
                return Err(LogError::Damaged { file: path.to_owned(), row: rows + found, reason });
            }
            if found != expected {
                let reason = format!("column {:?} has {found} of {expected} rows", target.name);
                return Err(LogError::Damaged { file: path.to_owned(), row: rows + found, reason });
            }
        }
        rows += expected;
    }
    if rows == 0 {
        return Err(LogError::Empty { file: path.to_owned() });
    }
    let mut table = Table::default();
    for target in targets {
        match target.values {
            Values::Numbers(values) => table.numbers.push((target.name.to_owned(), values)),
            Values::Texts(texts) => table.texts.push((target.name.to_owned(), texts)),
        }
    }
    Ok(table)
}

/// Names of a file's columns; those inside of groups with a dot.
///
/// # Errors
/// [`LogError`].
pub fn columns(path: &Path) -> Result<Vec<String>, LogError> {
    guarded(path, || Ok(names(&*open(path)?)))
}

fn open(path: &Path) -> Result<Box<dyn FileReader>, LogError> {
    let unreadable = |source| LogError::Unreadable { file: path.to_owned(), source };
    let file = File::open(path).map_err(unreadable)?;
    let reader: Result<Box<dyn FileReader>, ParquetError> = match file.metadata().map_err(unreadable)?.len() <= WHOLE {
        true => {
            let bytes = Bytes::from(std::fs::read(path).map_err(unreadable)?);
            SerializedFileReader::new(bytes).map(|reader| Box::new(reader) as _)
        }
        false => SerializedFileReader::new(file).map(|reader| Box::new(reader) as _),
    };
    reader.map_err(|error| foreign(path, &error))
}

fn foreign(path: &Path, error: &ParquetError) -> LogError {
    LogError::Foreign { file: path.to_owned(), format: Format::Parquet, reason: error.to_string() }
}

fn damaged(path: &Path, row: usize, error: &dyn std::fmt::Display) -> LogError {
    LogError::Damaged { file: path.to_owned(), row, reason: error.to_string() }
}

fn names(reader: &dyn FileReader) -> Vec<String> {
    reader.metadata().file_metadata().schema_descr().columns().iter().map(|column| column.path().string()).collect()
}

fn targets<'a>(reader: &dyn FileReader, path: &Path, wanted: &'a Wanted) -> Result<Vec<Target<'a>>, LogError> {
    let names = names(reader);
    let schema = reader.metadata().file_metadata().schema_descr();
    let find = |name: &'a str, numbers: bool| {
        let missing =
            || LogError::MissingColumn { file: path.to_owned(), column: name.to_owned(), available: names.clone() };
        let leaf = names.iter().position(|column| column == name).ok_or_else(missing)?;
        let (found, readable) = kind(&schema.column(leaf), numbers);
        if !readable {
            let expected = if numbers { "numbers" } else { "texts or numbers" };
            return Err(LogError::Type { file: path.to_owned(), row: None, column: name.to_owned(), found, expected });
        }
        let values = if numbers { Values::Numbers(Vec::new()) } else { Values::Texts(Texts::default()) };
        Ok(Target { leaf, name, values })
    };
    let numbers = wanted.numbers.iter().map(|name| find(name, true));
    numbers.chain(wanted.texts.iter().map(|name| find(name, false))).collect()
}

/// A column's type in words, and whether it can be read as numbers (or, where those are not wanted, as text).
fn kind(column: &ColumnDescriptor, numbers: bool) -> (String, bool) {
    let physical = column.physical_type();
    let decimal = column.converted_type() == ConvertedType::DECIMAL
        || matches!(column.logical_type_ref(), Some(LogicalType::Decimal { .. }));
    let list = column.max_rep_level() > 0;
    let number = matches!(
        physical,
        PhysicalType::DOUBLE | PhysicalType::FLOAT | PhysicalType::INT32 | PhysicalType::INT64 | PhysicalType::BOOLEAN
    );
    let readable = !list && !decimal && (number || !numbers && physical == PhysicalType::BYTE_ARRAY);
    let of = if list {
        " in a list"
    } else if decimal {
        " with the annotation DECIMAL"
    } else {
        ""
    };
    (format!("type {physical}{of}"), readable)
}

/// True for an integer column without sign.
fn unsigned(column: &ColumnDescriptor) -> bool {
    use ConvertedType::{UINT_8, UINT_16, UINT_32, UINT_64};
    matches!(column.converted_type(), UINT_8 | UINT_16 | UINT_32 | UINT_64)
}

impl Values {
    fn len(&self) -> usize {
        match self {
            Self::Numbers(values) => values.len(),
            Self::Texts(texts) => texts.codes.len(),
        }
    }

    fn number(&mut self, value: Option<f64>) {
        match self {
            Self::Numbers(values) => values.push(value.unwrap_or(f64::NAN)),
            Self::Texts(texts) => texts.push(&value.map_or_else(String::new, |value| value.to_string())),
        }
    }

    fn extend(&mut self, column: ColumnReader, descriptor: &ColumnDescriptor) -> Result<(), ParquetError> {
        let most = descriptor.max_def_level();
        let unsigned = unsigned(descriptor);
        match column {
            ColumnReader::DoubleColumnReader(column) => match self {
                Self::Numbers(all) => doubles(column, most, all),
                Self::Texts(_) => pull(column, most, |value| self.number(value.copied())),
            },
            ColumnReader::FloatColumnReader(column) => {
                pull(column, most, |value| self.number(value.map(|value| f64::from(*value))))
            }
            ColumnReader::Int32ColumnReader(column) => pull(column, most, |value| {
                self.number(value.map(|value| if unsigned { f64::from(*value as u32) } else { f64::from(*value) }));
            }),
            ColumnReader::Int64ColumnReader(column) => pull(column, most, |value| {
                self.number(value.map(|value| if unsigned { *value as u64 as f64 } else { *value as f64 }));
            }),
            ColumnReader::BoolColumnReader(column) => {
                pull(column, most, |value| self.number(value.map(|value| f64::from(u8::from(*value)))))
            }
            ColumnReader::ByteArrayColumnReader(column) => pull(column, most, |value| {
                if let Self::Texts(texts) = self {
                    texts.push(&value.map_or_else(String::new, |value| String::from_utf8_lossy(value.data()).into()));
                }
            }),
            ColumnReader::Int96ColumnReader(_) | ColumnReader::FixedLenByteArrayColumnReader(_) => {
                Err(ParquetError::General("a type that is not read".into()))
            }
        }
    }
}

/// All values of a column chunk in the order of the rows; none for a null. `most` is the definition level of a value.
fn pull<T: DataType>(
    column: ColumnReaderImpl<T>,
    most: i16,
    mut each: impl FnMut(Option<&T::T>),
) -> Result<(), ParquetError> {
    batches(column, |levels, values| {
        if most == 0 {
            values.iter().for_each(|value| each(Some(value)));
        } else {
            let mut values = values.iter();
            levels.iter().for_each(|level| each(if *level == most { values.next() } else { None }));
        }
    })
}

/// The same of doubles, decoded to where they stay: a batch with a null is spread out afterwards.
fn doubles(mut column: ColumnReaderImpl<DoubleType>, most: i16, all: &mut Vec<f64>) -> Result<(), ParquetError> {
    let mut levels = Vec::new();
    loop {
        levels.clear();
        let first = all.len();
        let (rows, values, _) = column.read_records(BATCH, Some(&mut levels), None, all)?;
        if rows == 0 {
            return Ok(());
        }
        if values < rows {
            let mut present = all.split_off(first).into_iter();
            let of = |level: &i16| if *level == most { present.next() } else { None };
            all.extend(levels.iter().map(of).map(|value| value.unwrap_or(f64::NAN)));
        }
    }
}

/// Definition levels and values of a column chunk, batch by batch; there are no levels where nothing can be missing.
fn batches<T: DataType>(
    mut column: ColumnReaderImpl<T>,
    mut each: impl FnMut(&[i16], &mut Vec<T::T>),
) -> Result<(), ParquetError> {
    let (mut levels, mut values) = (Vec::new(), Vec::new());
    loop {
        levels.clear();
        values.clear();
        let (rows, ..) = column.read_records(BATCH, Some(&mut levels), None, &mut values)?;
        if rows == 0 {
            return Ok(());
        }
        each(&levels, &mut values);
    }
}

/// The bytes of a Parquet file with this table.
///
/// # Errors
/// [`LogError::Shape`].
pub fn encode(table: &Table) -> Result<Vec<u8>, LogError> {
    table.check()?;
    let wrong = |error: ParquetError| LogError::Shape { column: String::new(), reason: error.to_string() };
    let mut bytes = Vec::new();
    let mut properties =
        WriterProperties::builder().set_compression(Compression::SNAPPY).set_created_by("joint-firmware logs".into());
    if table.rows() <= SMALL {
        properties = properties.set_dictionary_enabled(false).set_statistics_enabled(EnabledStatistics::None);
    }
    let properties = properties.build();
    let schema = Arc::new(schema(table).map_err(wrong)?);
    let mut writer = SerializedFileWriter::new(&mut bytes, schema, Arc::new(properties)).map_err(wrong)?;
    for first in (0..table.rows()).step_by(GROUP) {
        let rows = first..table.rows().min(first + GROUP);
        let mut group = writer.next_row_group().map_err(wrong)?;
        for (_, values) in &table.numbers {
            let present = values[rows.clone()].iter().map(|value| (!value.is_nan()).then_some(*value));
            write_column::<DoubleType, _>(&mut group, present).map_err(wrong)?;
        }
        for (_, texts) in &table.texts {
            let present = texts.codes[rows.clone()].iter().map(|code| texts.words[*code as usize].as_str());
            let present = present.map(|text| (!text.is_empty()).then(|| ByteArray::from(text)));
            write_column::<ByteArrayType, _>(&mut group, present).map_err(wrong)?;
        }
        group.close().map_err(wrong)?;
    }
    writer.close().map_err(wrong)?;
    Ok(bytes)
}

fn write_column<T: DataType, W: std::io::Write + Send>(
    group: &mut SerializedRowGroupWriter<W>,
    values: impl Iterator<Item = Option<T::T>>,
) -> Result<(), ParquetError> {
    let Some(mut column) = group.next_column()? else {
        return Err(ParquetError::General("more columns than the schema has".into()));
    };
    let (mut levels, mut present) = (Vec::new(), Vec::new());
    for value in values {
        levels.push(i16::from(value.is_some()));
        present.extend(value);
    }
    column.typed::<T>().write_batch(&present, Some(&levels), None)?;
    column.close()
}

fn schema(table: &Table) -> Result<Type, ParquetError> {
    let column = |name: &str, physical, logical: Option<LogicalType>| {
        Type::primitive_type_builder(name, physical)
            .with_repetition(Repetition::OPTIONAL)
            .with_logical_type(logical)
            .build()
            .map(Arc::new)
    };
    let numbers = table.numbers.iter().map(|(name, _)| column(name, PhysicalType::DOUBLE, None));
    let texts = table.texts.iter().map(|(name, _)| column(name, PhysicalType::BYTE_ARRAY, Some(LogicalType::String)));
    Type::group_type_builder("log").with_fields(numbers.chain(texts).collect::<Result<_, _>>()?).build()
}
