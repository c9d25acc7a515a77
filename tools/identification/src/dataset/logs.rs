//! MCAP and Parquet among the files of a data set: the columns of the crate `logs` as rows of the same table as those
//! of CSV; host. Without the feature `logs` such a file is refused.

use super::error::DatasetError;
use super::load::{Table, Wanted};
use std::path::Path;

/// Names of the columns of a log.
#[cfg(feature = "logs")]
pub fn header(path: &Path) -> Result<Vec<String>, DatasetError> {
    Ok(::logs::columns(path)?)
}

/// Appends the rows of a log to `table`, as `load::append` does with those of a CSV text; the place of a row is its
/// number, from 1. A value that is missing, NaN or infinite has to be named in `missing_text`, as `""`, `"nan"` or
/// `"inf"`; upper case counts as lower case.
#[cfg(feature = "logs")]
pub fn append(
    table: &mut Table,
    path: &Path,
    missing_text: &[String],
    wanted: &Wanted,
    elsewhere: &[String],
) -> Result<(), DatasetError> {
    use ::logs::LogError;

    let wanted = ::logs::Wanted { numbers: wanted.numbers.clone(), texts: wanted.texts.clone() };
    let read = ::logs::read(path, &wanted).map_err(|error| match error {
        LogError::MissingColumn { file, column, mut available } => {
            available.extend_from_slice(elsewhere);
            LogError::MissingColumn { file, column, available }
        }
        error => error,
    })?;
    let marks = |text: &str| missing_text.iter().any(|mark| mark.trim_start_matches('-').eq_ignore_ascii_case(text));
    let (not_a_number, infinite) = (marks("") || marks("nan"), marks("inf"));
    let rows = read.rows();
    let mut missing = vec![false; rows];
    let mut unnamed: Option<(usize, &String, f64)> = None;
    for (name, values) in &read.numbers {
        for (row, value) in values.iter().enumerate().filter(|(_, value)| !value.is_finite()) {
            missing[row] = true;
            let named = if value.is_nan() { not_a_number } else { infinite };
            if !named && unnamed.is_none_or(|(first, ..)| row < first) {
                unnamed = Some((row, name, *value));
            }
        }
    }
    if let Some((row, column, value)) = unnamed {
        let text = if value.is_nan() { "NaN or missing".to_owned() } else { value.to_string() };
        let (file, line, column) = (path.to_owned(), row as u64 + 1, column.clone());
        return Err(DatasetError::NotFinite { file, line, column, text });
    }
    let file = table.file.last().map_or(0, |last| last + 1);
    for (name, mut values) in read.numbers {
        values.iter_mut().filter(|value| !value.is_finite()).for_each(|value| *value = f64::NAN);
        table.numbers.entry(name).or_default().extend(values);
    }
    for (name, texts) in read.texts {
        let column = table.texts.entry(name).or_default();
        texts.iter().for_each(|text| column.push(text.trim().as_bytes()));
    }
    table.line.extend((1..=rows).map(|row| row as u32));
    table.file.extend(std::iter::repeat_n(file, rows));
    table.missing.extend(missing);
    Ok(())
}

/// Refuses the file.
#[cfg(not(feature = "logs"))]
pub fn header(path: &Path) -> Result<Vec<String>, DatasetError> {
    Err(DatasetError::WithoutLogs { file: path.to_owned() })
}

/// Refuses the file.
#[cfg(not(feature = "logs"))]
pub fn append(_: &mut Table, path: &Path, _: &[String], _: &Wanted, _: &[String]) -> Result<(), DatasetError> {
    Err(DatasetError::WithoutLogs { file: path.to_owned() })
}
