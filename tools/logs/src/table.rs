//! Columns of equal length; host.

use crate::error::LogError;
use std::collections::{BTreeSet, HashMap};
use std::path::Path;

/// Numbers that are looked at together.
const BLOCK: usize = 64;

/// Names of the columns to read.
#[derive(Clone, Debug, Default)]
pub struct Wanted {
    /// Read as numbers.
    pub numbers: BTreeSet<String>,
    /// Read as texts; a number is read as its shortest decimal form.
    pub texts: BTreeSet<String>,
}

impl Wanted {
    /// Columns of numbers.
    pub fn numbers<'a>(names: impl IntoIterator<Item = &'a str>) -> Self {
        Self { numbers: names.into_iter().map(str::to_owned).collect(), texts: BTreeSet::new() }
    }

    /// All names, numbers first.
    pub fn names(&self) -> impl Iterator<Item = &String> {
        self.numbers.iter().chain(&self.texts)
    }
}

/// A column of text: few different words, many rows. A missing text is empty.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Texts {
    /// The different words, in order of first appearance.
    pub words: Vec<String>,
    /// Index of each row's word.
    pub codes: Vec<u32>,
    index: HashMap<String, u32>,
}

impl Texts {
    /// Adds a row.
    pub fn push(&mut self, text: &str) {
        let code = match self.index.get(text) {
            Some(code) => *code,
            None => {
                let code = self.words.len() as u32;
                self.words.push(text.to_owned());
                self.index.insert(text.to_owned(), code);
                code
            }
        };
        self.codes.push(code);
    }

    /// Texts by row.
    pub fn iter(&self) -> impl Iterator<Item = &str> {
        self.codes.iter().map(|code| self.words[*code as usize].as_str())
    }
}

impl<'a> FromIterator<&'a str> for Texts {
    fn from_iter<I: IntoIterator<Item = &'a str>>(texts: I) -> Self {
        let mut column = Self::default();
        texts.into_iter().for_each(|text| column.push(text));
        column
    }
}

/// Columns by name. What is read is in the order of the names.
#[derive(Clone, Debug, Default)]
pub struct Table {
    /// Columns of numbers; a missing value is NaN.
    pub numbers: Vec<(String, Vec<f64>)>,
    /// Columns of text.
    pub texts: Vec<(String, Texts)>,
}

impl Table {
    /// Columns of numbers.
    pub fn of_numbers<S: Into<String>>(columns: impl IntoIterator<Item = (S, Vec<f64>)>) -> Self {
        let numbers = columns.into_iter().map(|(name, values)| (name.into(), values)).collect();
        Self { numbers, texts: Vec::new() }
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        let texts = self.texts.first().map_or(0, |(_, texts)| texts.codes.len());
        self.numbers.first().map_or(texts, |(_, values)| values.len())
    }

    /// A column of numbers.
    pub fn number(&self, name: &str) -> Option<&[f64]> {
        self.numbers.iter().find_map(|(column, values)| (column == name).then_some(values.as_slice()))
    }

    /// A column of text.
    pub fn text(&self, name: &str) -> Option<&Texts> {
        self.texts.iter().find_map(|(column, texts)| (column == name).then_some(texts))
    }

    /// Refuses a missing, NaN or infinite number; `file` is the one that the table is of.
    ///
    /// # Errors
    /// [`LogError::NotFinite`], the first in the order of the rows.
    pub fn all_finite(&self, file: &Path) -> Result<(), LogError> {
        let first = |(name, values): &(String, Vec<f64>)| {
            // Block by block without an end in between, which a processor does several at a time.
            let finite = |block: &[f64]| block.iter().fold(true, |all, value| all & value.is_finite());
            let before = BLOCK * values.chunks(BLOCK).position(|block| !finite(block))?;
            let at = before + values[before..].iter().position(|value| !value.is_finite())?;
            Some((at, name.clone(), values[at]))
        };
        match self.numbers.iter().filter_map(first).min_by_key(|(at, ..)| *at) {
            None => Ok(()),
            Some((at, column, found)) => Err(LogError::NotFinite { file: file.to_owned(), row: at + 1, column, found }),
        }
    }

    /// Refuses to write columns of different length, or two of one name.
    pub(crate) fn check(&self) -> Result<(), LogError> {
        let wrong = |column: &str, reason: String| Err(LogError::Shape { column: column.to_owned(), reason });
        let mut names = BTreeSet::new();
        let numbers = self.numbers.iter().map(|(name, values)| (name, values.len()));
        for (name, rows) in numbers.chain(self.texts.iter().map(|(name, texts)| (name, texts.codes.len()))) {
            if rows != self.rows() {
                return wrong(name, format!("{rows} rows, the first column has {}", self.rows()));
            }
            if !names.insert(name) {
                return wrong(name, "a second column of this name".into());
            }
        }
        Ok(())
    }
}
