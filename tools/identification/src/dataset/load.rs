//! Files to raw columns: where the files are, gzip, CSV, numbers and texts, the table of runs, the digest; host. Logs
//! in MCAP and Parquet: `logs`.
//!
//! Only the columns that the description names are kept. Nothing is corrected here: the first field that does not
//! hold what it should is an error with file, line and column.

use super::description::Source;
use super::error::DatasetError;
use sha2::{Digest, Sha256};
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// The value of an environment variable, or nothing. Passed in, so that loading does not depend on the process.
pub type Environment<'a> = &'a dyn Fn(&str) -> Option<String>;

/// Names of the columns to read.
#[derive(Clone, Debug, Default)]
pub struct Wanted {
    /// Read as numbers.
    pub numbers: BTreeSet<String>,
    /// Read as text.
    pub texts: BTreeSet<String>,
}

/// A column of text: few different words, many rows.
#[derive(Clone, Debug, Default)]
pub struct TextColumn {
    /// The different words, in order of first appearance.
    pub words: Vec<String>,
    /// Index of each row's word.
    pub codes: Vec<u32>,
    index: HashMap<Vec<u8>, u32>,
}

impl TextColumn {
    /// A column from its words and codes.
    pub fn new(words: Vec<String>, codes: Vec<u32>) -> TextColumn {
        let index = words.iter().enumerate().map(|(i, word)| (word.as_bytes().to_owned(), i as u32)).collect();
        TextColumn { words, codes, index }
    }

    /// Adds a row.
    pub fn push(&mut self, field: &[u8]) {
        let code = match self.index.get(field) {
            Some(&code) => code,
            None => {
                let code = self.words.len() as u32;
                self.words.push(String::from_utf8_lossy(field).into_owned());
                self.index.insert(field.to_owned(), code);
                code
            }
        };
        self.codes.push(code);
    }

    /// The text of a row.
    pub fn text(&self, row: usize) -> &str {
        &self.words[self.codes[row] as usize]
    }
}

/// The rows of one or more files of the same form, one after the other.
#[derive(Clone, Debug, Default)]
pub struct Table {
    /// Numeric columns by name; a field that means "missing" is NaN.
    pub numbers: BTreeMap<String, Vec<f64>>,
    /// Text columns by name.
    pub texts: BTreeMap<String, TextColumn>,
    /// Line of each row in its file; the header is line 1.
    pub line: Vec<u32>,
    /// Index of each row's file.
    pub file: Vec<u32>,
    /// Flag of each row in which a numeric field means "missing".
    pub missing: Vec<bool>,
}

impl Table {
    /// Number of rows.
    pub fn len(&self) -> usize {
        self.line.len()
    }

    /// True where there is no row.
    pub fn is_empty(&self) -> bool {
        self.line.is_empty()
    }
}

/// The folder that the file names are relative to.
///
/// `description` is the path of the TOML file. A root that begins with `$NAME` or `${NAME}` has that replaced by the
/// environment variable; `${NAME:-default}` takes the default where the variable is not set. What is then relative is
/// relative to the description's folder.
pub fn root(source: &Source, description: &Path, environment: Environment) -> Result<PathBuf, DatasetError> {
    let folder = description.parent().unwrap_or(Path::new(""));
    let Some(root) = &source.root else { return Ok(folder.to_owned()) };
    let Some(after) = root.strip_prefix('$') else { return Ok(folder.join(root)) };
    let (name, default, rest) = match after.strip_prefix('{').and_then(|braced| braced.split_once('}')) {
        Some((inside, rest)) => match inside.split_once(":-") {
            Some((name, default)) => (name, Some(default), rest),
            None => (inside, None, rest),
        },
        None => {
            let end = after.find('/').unwrap_or(after.len());
            (&after[..end], None, &after[end..])
        }
    };
    let value = environment(name).filter(|value| !value.is_empty()).or(default.map(str::to_owned));
    match value {
        Some(value) => Ok(folder.join(value + rest)),
        None => Err(DatasetError::Environment {
            file: description.to_owned(),
            root: root.clone(),
            variable: name.to_owned(),
        }),
    }
}

/// True for a file whose name ends as that of a log.
pub fn is_log(path: &Path) -> bool {
    let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
    ["mcap", "parquet"].iter().any(|name| ending.eq_ignore_ascii_case(name))
}

/// A file whose bytes, as they are on disk, are in the digest.
pub enum Content {
    /// A CSV text.
    Csv(Vec<u8>),
    /// MCAP or Parquet, of which only columns are read.
    Log,
}

/// Reads a file of a data set and adds its bytes to the digest; of a log the columns are read later.
pub fn open(path: &Path, digest: &mut Sha256) -> Result<Content, DatasetError> {
    let unreadable = |source| DatasetError::Unreadable { file: path.to_owned(), source };
    if !is_log(path) {
        let bytes = std::fs::read(path).map_err(unreadable)?;
        digest.update(&bytes);
        return Ok(Content::Csv(bytes));
    }
    let mut file = File::open(path).map_err(unreadable)?;
    let mut piece = vec![0; 1 << 16];
    loop {
        let length = file.read(&mut piece).map_err(unreadable)?;
        if length == 0 {
            return Ok(Content::Log);
        }
        digest.update(&piece[..length]);
    }
}

/// The bytes of a gzip file decompressed; any other bytes as they are.
pub fn decompress(bytes: Vec<u8>, path: &Path) -> Result<Vec<u8>, DatasetError> {
    if !bytes.starts_with(&[0x1f, 0x8b]) && path.extension().is_none_or(|extension| extension != "gz") {
        return Ok(bytes);
    }
    let mut text = Vec::with_capacity(bytes.len() * 6);
    flate2::read::MultiGzDecoder::new(bytes.as_slice())
        .read_to_end(&mut text)
        .map_err(|source| DatasetError::Gzip { file: path.to_owned(), source })?;
    Ok(text)
}

/// Destination of one wanted column of a file, and how it is read.
enum Target<'a> {
    Number { field: usize, name: &'a str, values: Vec<f64> },
    Text { field: usize, name: &'a str, column: TextColumn },
}

/// Appends the rows of one CSV text to `table`. Every wanted column must be there; `elsewhere` names columns of other
/// tables, to be listed in the error when one is not.
pub fn append(
    table: &mut Table,
    text: &[u8],
    path: &Path,
    source: &Source,
    missing_text: &[String],
    wanted: &Wanted,
    elsewhere: &[String],
) -> Result<(), DatasetError> {
    let mut reader = csv::ReaderBuilder::new().delimiter(source.delimiter as u8).from_reader(text);
    let header = names(&mut reader, path)?;
    let mut targets = targets(&header, path, wanted, elsewhere)?;
    for target in &mut targets {
        if let Target::Text { name, column, .. } = target {
            *column = table.texts.remove(*name).unwrap_or_default();
        }
    }
    let file = table.file.last().map_or(0, |last| last + 1);
    let rows_before = table.len();
    let mut record = csv::ByteRecord::new();
    while reader.read_byte_record(&mut record).map_err(|error| table_error(error, path))? {
        let line = record.position().map_or(0, csv::Position::line);
        let mut missing = false;
        for target in &mut targets {
            match target {
                Target::Number { field, name, values } => {
                    let bytes = record.get(*field).unwrap_or_default().trim_ascii();
                    let value = number(bytes, source.decimal).filter(|value| value.is_finite());
                    missing |= value.is_none();
                    values.push(match value {
                        Some(value) => value,
                        None if missing_text.iter().any(|text| text.as_bytes() == bytes) => f64::NAN,
                        None => return Err(bad_number(bytes, source.decimal, path, line, name)),
                    });
                }
                Target::Text { field, column, .. } => {
                    column.push(record.get(*field).unwrap_or_default().trim_ascii());
                }
            }
        }
        table.line.push(line as u32);
        table.file.push(file);
        table.missing.push(missing);
    }
    if table.len() == rows_before {
        return Err(DatasetError::Empty { file: path.to_owned() });
    }
    for target in targets {
        match target {
            Target::Number { name, values, .. } => {
                table.numbers.entry(name.to_owned()).or_default().extend(values);
            }
            Target::Text { name, column, .. } => {
                table.texts.insert(name.to_owned(), column);
            }
        }
    }
    Ok(())
}

/// The names in the header line of a CSV text.
pub fn header(text: &[u8], path: &Path, source: &Source) -> Result<Vec<String>, DatasetError> {
    names(&mut csv::ReaderBuilder::new().delimiter(source.delimiter as u8).from_reader(text), path)
}

fn names(reader: &mut csv::Reader<&[u8]>, path: &Path) -> Result<Vec<String>, DatasetError> {
    let header = reader.byte_headers().map_err(|error| table_error(error, path))?;
    Ok(header.iter().map(|field| String::from_utf8_lossy(field.trim_ascii()).into_owned()).collect())
}

fn targets<'a>(
    header: &[String],
    path: &Path,
    wanted: &'a Wanted,
    elsewhere: &[String],
) -> Result<Vec<Target<'a>>, DatasetError> {
    let find = |name: &String| -> Result<usize, DatasetError> {
        let mut found = (0..header.len()).filter(|&i| header[i] == *name);
        match (found.next(), found.next()) {
            (Some(_), Some(_)) => Err(DatasetError::AmbiguousColumn { file: path.to_owned(), column: name.clone() }),
            (Some(field), None) => Ok(field),
            _ => Err(DatasetError::MissingColumn {
                file: path.to_owned(),
                column: name.clone(),
                // Bytes of a file that is no table are no orders to a terminal.
                available: header.iter().chain(elsewhere).map(|name| name.escape_debug().to_string()).collect(),
                hint: delimiter_hint(header).unwrap_or_default(),
            }),
        }
    };
    let mut targets = Vec::new();
    for name in &wanted.numbers {
        targets.push(Target::Number { field: find(name)?, name, values: Vec::new() });
    }
    for name in &wanted.texts {
        targets.push(Target::Text { field: find(name)?, name, column: TextColumn::default() });
    }
    Ok(targets)
}

/// Delimiter that a header of one field may have meant.
fn delimiter_hint(header: &[String]) -> Option<String> {
    let [only] = header else { return None };
    let delimiter = [";", "\t", ",", "|"].into_iter().find(|delimiter| only.contains(delimiter))?;
    Some(format!("; one column alone: `delimiter = {delimiter:?}` in [source]?"))
}

fn number(bytes: &[u8], decimal: char) -> Option<f64> {
    let text = std::str::from_utf8(bytes).ok()?;
    match decimal {
        '.' => text.parse().ok(),
        // A point would be between thousands.
        _ if text.contains('.') => None,
        _ => text.replacen(decimal, ".", 1).parse().ok(),
    }
}

fn bad_number(bytes: &[u8], decimal: char, path: &Path, line: u64, column: &str) -> DatasetError {
    let (file, column, text) = (path.to_owned(), column.to_owned(), String::from_utf8_lossy(bytes).into_owned());
    let hint = match decimal {
        '.' if number(bytes, ',').is_some() => "; `decimal = \",\"` in [source]?",
        ',' if number(bytes, '.').is_some() => "; `decimal = \".\"` in [source]?",
        _ => "",
    };
    match number(bytes, decimal) {
        Some(_) => DatasetError::NotFinite { file, line, column, text },
        None => DatasetError::NotANumber { file, line, column, text, hint },
    }
}

fn table_error(error: csv::Error, path: &Path) -> DatasetError {
    match error.kind() {
        csv::ErrorKind::UnequalLengths { pos, expected_len, len } => DatasetError::Ragged {
            file: path.to_owned(),
            line: pos.as_ref().map_or(0, csv::Position::line),
            expected: *expected_len,
            found: *len,
        },
        _ => DatasetError::Csv { file: path.to_owned(), message: error.to_string() },
    }
}
