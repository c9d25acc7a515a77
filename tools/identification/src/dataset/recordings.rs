//! All files of a data set as one table of raw columns, grouped into runs and joined with the table of runs; host.

use super::condition_keys::{Condition, Value};
use super::description::{Description, Rule};
use super::error::DatasetError;
use super::load::{self, Content, Environment, Table, TextColumn, Wanted};
use super::logs;
use sha2::{Digest, Sha256};
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// One run: rows of one file with one label, in the file's order. They need not be contiguous.
#[derive(Clone, Debug)]
pub struct Run {
    /// Text of the run column, or the file's name as listed.
    pub label: String,
    /// Index of the file in `source.files`.
    pub file: usize,
    /// Rows of the table.
    pub rows: Vec<usize>,
}

/// The raw columns that the description asks for.
#[derive(Debug)]
pub struct Recordings {
    /// The columns; those of the table of runs are repeated for every row of the run.
    pub table: Table,
    /// The runs, in order of first appearance.
    pub runs: Vec<Run>,
    /// Text columns that may tell motions apart: all of the table of runs but the run's label, and those that
    /// `choice.group_by` names.
    pub conditions: Vec<String>,
    /// Paths of the files, in the order listed.
    pub files: Vec<PathBuf>,
    /// SHA-256 over the bytes of the description, of every file in the order listed and of the table of runs, one
    /// after the other: what `cat description.toml files... runs.csv | sha256sum` prints.
    pub sha256: [u8; 32],
}

impl Recordings {
    /// Reads everything that `description` names. `path` is the description's own path and `text` its content.
    pub fn load(
        description: &Description,
        path: &Path,
        text: &str,
        environment: Environment,
    ) -> Result<Recordings, DatasetError> {
        let source = &description.source;
        let root = load::root(source, path, environment)?;
        let mut digest = Sha256::new();
        digest.update(text.as_bytes());
        let files: Vec<PathBuf> = source.files.iter().map(|file| root.join(file)).collect();
        let contents = files.iter().map(|file| load::open(file, &mut digest)).collect::<Result<Vec<_>, _>>()?;

        let mut wanted = wanted(description);
        let mut conditions: Vec<String> = Vec::new();
        let mut per_run = None;
        if let Some(name) = &source.runs {
            let file = root.join(name);
            let content = match load::open(&file, &mut digest)? {
                Content::Csv(bytes) => Content::Csv(load::decompress(bytes, &file)?),
                Content::Log => Content::Log,
            };
            let header = match &content {
                Content::Csv(text) => load::header(text, &file, source)?,
                Content::Log => logs::header(&file)?,
            };
            let label = description.columns.run.clone().unwrap_or_else(|| "run".to_owned());
            let mut found = Wanted {
                numbers: wanted.numbers.iter().filter(|name| header.contains(name)).cloned().collect(),
                texts: wanted.texts.iter().filter(|name| header.contains(name)).cloned().collect(),
            };
            // The label itself belongs to both tables.
            let not_label = |name: &String| *name == label || !header.contains(name);
            wanted.numbers.retain(not_label);
            wanted.texts.retain(not_label);
            found.numbers.remove(&label);
            conditions.extend(header.iter().filter(|name| **name != label).cloned());
            found.texts.extend(header.iter().cloned());
            found.texts.insert(label.clone());
            let mut table = Table::default();
            match content {
                Content::Csv(text) => load::append(&mut table, &text, &file, source, &[], &found, &[])?,
                Content::Log => logs::append(&mut table, &file, &[], &found, &[])?,
            }
            per_run = Some((file, label, header, table));
        }

        let elsewhere = per_run.as_ref().map_or(&[] as &[String], |(_, _, header, _)| header);
        let mut table = Table::default();
        let missing_text = &description.clean.missing_text;
        for (file, content) in files.iter().zip(contents) {
            match content {
                Content::Csv(bytes) => {
                    let text = load::decompress(bytes, file)?;
                    load::append(&mut table, &text, file, source, missing_text, &wanted, elsewhere)?;
                }
                Content::Log => logs::append(&mut table, file, missing_text, &wanted, elsewhere)?,
            }
        }
        let runs = group(&table, description);
        if let Some((file, label, _, per_run)) = per_run {
            join(&mut table, &runs, &per_run, &label, &file)?;
        }
        conditions.extend(description.choice.group_by.iter().filter(|name| table.texts.contains_key(*name)).cloned());
        conditions.dedup();
        Ok(Recordings { table, runs, conditions, files, sha256: digest.finalize().into() })
    }

    /// The file of a row and the line in it.
    pub fn place(&self, row: usize) -> (&Path, u64) {
        (&self.files[self.table.file[row] as usize], u64::from(self.table.line[row]))
    }
}

/// Every column that the description names, as number or as text.
fn wanted(description: &Description) -> Wanted {
    let mut wanted = Wanted::default();
    let d = description;
    let columns = &d.columns;
    let mut number = |name: &str| {
        wanted.numbers.insert(name.to_owned());
    };
    number(&columns.time.column);
    number(&columns.position.column);
    columns.velocity.iter().chain(&columns.temperature).for_each(|c| number(&c.column));
    columns.effort.factors().into_iter().for_each(&mut number);
    columns.extra.values().for_each(|name| number(name));
    d.clean.jump.iter().for_each(|c| number(&c.column));
    d.clean.steady.iter().for_each(|c| number(&c.column));
    d.clean.frozen.iter().for_each(|c| number(&c.column));
    d.clean.saturation.iter().for_each(|c| number(&c.column));
    wanted.texts.extend(columns.run.clone());
    wanted.texts.extend(d.choice.group_by.iter().filter(|name| !matches!(name.as_str(), "run" | "file")).cloned());
    let rules = d
        .split
        .test
        .iter()
        .chain(&d.split.validation)
        .flat_map(|rule: &Rule| rule.conditions.iter().chain(&rule.unless));
    for condition in d.select.keep.iter().chain(&d.select.used).chain(&d.clean.dropout).chain(rules) {
        want_condition(&mut wanted, condition);
    }
    wanted
}

fn want_condition(wanted: &mut Wanted, condition: &Condition) {
    let c = condition;
    let values = || c.equals.iter().chain(c.one_of.iter().flatten()).chain(c.not_in.iter().flatten());
    if c.inside.is_some() || c.outside.is_some() || values().any(|value| matches!(value, Value::Number(_))) {
        wanted.numbers.insert(c.column.clone());
    }
    // An empty list compares with nothing, but its column must exist.
    let empty = c.one_of.iter().chain(&c.not_in).any(Vec::is_empty);
    if empty || c.starts_with.is_some() || values().any(|value| matches!(value, Value::Text(_))) {
        wanted.texts.insert(c.column.clone());
    }
}

fn group(table: &Table, description: &Description) -> Vec<Run> {
    let labels = description.columns.run.as_ref().and_then(|name| table.texts.get(name));
    let mut runs: Vec<Run> = Vec::new();
    let mut index: HashMap<(u32, u32), usize> = HashMap::new();
    let mut last = None;
    for row in 0..table.len() {
        let key = (table.file[row], labels.map_or(0, |column| column.codes[row]));
        let run = match last {
            Some((last_key, run)) if last_key == key => run,
            _ => *index.entry(key).or_insert_with(|| {
                let file = key.0 as usize;
                let label = labels.map_or(description.source.files[file].as_str(), |column| column.text(row));
                runs.push(Run { label: label.to_owned(), file, rows: Vec::new() });
                runs.len() - 1
            }),
        };
        last = Some((key, run));
        runs[run].rows.push(row);
    }
    runs
}

/// Repeats the columns of the table of runs for every row of the recordings.
fn join(table: &mut Table, runs: &[Run], per_run: &Table, label: &str, file: &Path) -> Result<(), DatasetError> {
    let mut row_of: HashMap<&str, usize> = HashMap::new();
    if let Some(labels) = per_run.texts.get(label) {
        for row in 0..per_run.len() {
            if row_of.insert(labels.text(row), row).is_some() {
                return Err(DatasetError::AmbiguousRun { file: file.to_owned(), run: labels.text(row).to_owned() });
            }
        }
    }
    let missing = |run: &Run| DatasetError::MissingRun { file: file.to_owned(), run: run.label.clone() };
    let rows = runs
        .iter()
        .map(|run| row_of.get(run.label.as_str()).copied().ok_or_else(|| missing(run)))
        .collect::<Result<Vec<usize>, _>>()?;
    for (name, values) in &per_run.numbers {
        let mut joined = vec![0.0; table.len()];
        for (run, &row) in runs.iter().zip(&rows) {
            run.rows.iter().for_each(|&at| joined[at] = values[row]);
        }
        table.numbers.insert(name.clone(), joined);
    }
    for (name, column) in per_run.texts.iter().filter(|(name, _)| *name != label) {
        let mut codes = vec![0; table.len()];
        for (run, &row) in runs.iter().zip(&rows) {
            run.rows.iter().for_each(|&at| codes[at] = column.codes[row]);
        }
        table.texts.insert(name.clone(), TextColumn::new(column.words.clone(), codes));
    }
    Ok(())
}
