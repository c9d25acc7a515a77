//! Tables in MCAP: messages in JSON of one topic, one a row; host.
//!
//! Names of columns: the key in the message, with dots into objects and arrays (`imu.gyro.0`), or the topic, a dot and
//! the key (`/arm/joint1.position_rad`) where several topics have the same keys. [`LOG_TIME`] is the log time of each
//! message since the topic's first one. A key that a message lacks, or that is null, is a missing value.
//!
//! Written: one topic with a schema in JSON Schema, which Foxglove shows without a plug-in; chunks in zstd with
//! checksums. The bytes depend on the table, topic and start only.

use crate::error::LogError;
use crate::format::{Format, TIME};
use crate::table::{Table, Texts, Wanted};
use mcap::records::{MessageHeader, Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{McapError, WriteOptions};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::{Cursor, Read};
use std::path::Path;

/// Column that every topic has: log time since the topic's first message, s.
pub const LOG_TIME: &str = "log_time_s";
/// Longest record that is not a chunk, bytes; a longer one is a damaged length.
const LONGEST: usize = 256 << 20;

/// A topic of the file.
#[derive(Default)]
struct Topic {
    name: String,
    /// Message encoding; only `json` is read.
    encoding: String,
    /// Keys of its schema and of its messages.
    known: BTreeSet<String>,
    /// Log time of its first message, ns.
    began: Option<u64>,
    rows: usize,
    numbers: BTreeMap<String, Vec<f64>>,
    texts: BTreeMap<String, Texts>,
}

/// Reads the wanted columns, message by message.
///
/// # Errors
/// [`LogError`].
pub fn read(path: &Path, wanted: &Wanted) -> Result<Table, LogError> {
    let mut topics = scan(path, wanted)?;
    let json = || topics.values().filter(|topic| topic.encoding == "json");
    if json().all(|topic| topic.rows == 0) {
        return Err(nothing(path, &topics));
    }
    if let Some(name) = wanted.names().find(|name| !json().any(|topic| topic.has(name))) {
        return Err(LogError::MissingColumn {
            file: path.to_owned(),
            column: name.clone(),
            available: available(&topics),
        });
    }
    let whole = |topic: &Topic| topic.rows > 0 && wanted.names().all(|name| topic.has(name));
    let names = |some: &dyn Fn(&Topic) -> bool| -> Vec<String> {
        json().filter(|topic| some(topic)).map(|topic| topic.name.clone()).collect()
    };
    let file = path.to_owned();
    let columns = || wanted.names().cloned().collect();
    match names(&whole) {
        none if none.is_empty() => {
            let topics = names(&|topic| wanted.names().any(|name| name != LOG_TIME && topic.has(name)));
            return Err(LogError::Apart { file, columns: columns(), topics });
        }
        topics if topics.len() > 1 => return Err(LogError::Ambiguous { file, columns: columns(), topics }),
        _ => {}
    }
    topics.retain(|_, topic| topic.encoding == "json" && whole(topic));
    let mut topic = topics.into_values().next().unwrap_or_default();
    let rows = topic.rows;
    let numbers = |name: &String| {
        let values = topic.numbers.remove(name).unwrap_or_else(|| vec![f64::NAN; rows]);
        (name.clone(), values)
    };
    let numbers = wanted.numbers.iter().map(numbers).collect();
    let texts = |name: &String| {
        let texts = topic.texts.remove(name).unwrap_or_else(|| std::iter::repeat_n("", rows).collect());
        (name.clone(), texts)
    };
    Ok(Table { numbers, texts: wanted.texts.iter().map(texts).collect() })
}

/// Names of the columns of all topics in JSON; with the topic's name before them where there are several.
///
/// # Errors
/// [`LogError`].
pub fn columns(path: &Path) -> Result<Vec<String>, LogError> {
    let topics = scan(path, &Wanted::default())?;
    if topics.values().all(|topic| topic.encoding != "json" || topic.rows == 0) {
        return Err(nothing(path, &topics));
    }
    Ok(available(&topics))
}

fn available(topics: &BTreeMap<u16, Topic>) -> Vec<String> {
    let json = || topics.values().filter(|topic| topic.encoding == "json");
    let several = json().count() > 1;
    json().flat_map(|topic| topic.available(several)).collect()
}

fn nothing(path: &Path, topics: &BTreeMap<u16, Topic>) -> LogError {
    if topics.is_empty() || topics.values().any(|topic| topic.encoding == "json") {
        return LogError::Empty { file: path.to_owned() };
    }
    let found: Vec<String> = topics.values().map(|topic| format!("{} in {}", topic.name, topic.encoding)).collect();
    let found = found.join(", ");
    LogError::Type { file: path.to_owned(), row: None, column: "*".into(), found, expected: "a topic in json" }
}

/// All topics with the wanted columns that they have.
fn scan(path: &Path, wanted: &Wanted) -> Result<BTreeMap<u16, Topic>, LogError> {
    let mut file = File::open(path).map_err(|source| LogError::Unreadable { file: path.to_owned(), source })?;
    let options = LinearReaderOptions::default()
        .with_validate_chunk_crcs(true)
        .with_validate_data_section_crc(true)
        .with_validate_summary_section_crc(true)
        .with_check_finishes_after_end_magic(true)
        .with_record_length_limit(LONGEST);
    let mut reader = LinearReader::new_with_options(options);
    let mut scan = Scan { path, wanted, topics: BTreeMap::new(), schemas: BTreeMap::new(), rows: 0 };
    while let Some(event) = reader.next_event() {
        match event.map_err(|error| scan.refused(&error))? {
            LinearReadEvent::ReadRequest(bytes) => {
                let unreadable = |source| LogError::Unreadable { file: path.to_owned(), source };
                let read = file.read(reader.insert(bytes)).map_err(unreadable)?;
                reader.notify_read(read);
            }
            LinearReadEvent::Record { data, opcode } if matches!(opcode, op::SCHEMA | op::CHANNEL | op::MESSAGE) => {
                let record = mcap::parse_record(opcode, data).map_err(|error| scan.refused(&error))?;
                scan.take(record)?;
            }
            LinearReadEvent::Record { .. } => {}
        }
    }
    Ok(scan.topics)
}

struct Scan<'a> {
    path: &'a Path,
    wanted: &'a Wanted,
    topics: BTreeMap<u16, Topic>,
    /// Keys of each schema in JSON Schema.
    schemas: BTreeMap<u16, BTreeSet<String>>,
    /// Messages in JSON so far, of all topics.
    rows: usize,
}

impl Scan<'_> {
    fn refused(&self, error: &McapError) -> LogError {
        let (file, reason) = (self.path.to_owned(), error.to_string());
        match error {
            McapError::BadMagic if self.topics.is_empty() => LogError::Foreign { file, format: Format::Mcap, reason },
            _ => self.damaged(reason),
        }
    }

    fn damaged(&self, reason: String) -> LogError {
        LogError::Damaged { file: self.path.to_owned(), row: self.rows, reason }
    }

    fn take(&mut self, record: Record) -> Result<(), LogError> {
        match record {
            Record::Schema { header, data } if header.encoding == "jsonschema" => {
                let schema: Value = serde_json::from_slice(&data).unwrap_or_default();
                let keys = schema.get("properties").and_then(Value::as_object);
                self.schemas.insert(header.id, keys.iter().flat_map(|keys| keys.keys().cloned()).collect());
            }
            Record::Channel(channel) => {
                let known = self.schemas.get(&channel.schema_id).cloned().unwrap_or_default();
                self.topics.entry(channel.id).or_insert_with(|| Topic {
                    name: channel.topic,
                    encoding: channel.message_encoding,
                    known,
                    ..Topic::default()
                });
            }
            Record::Message { header, data } => self.message(&header, &data)?,
            _ => {}
        }
        Ok(())
    }

    fn message(&mut self, header: &MessageHeader, data: &[u8]) -> Result<(), LogError> {
        let Some(topic) = self.topics.get_mut(&header.channel_id) else {
            return Err(self.damaged(format!("a message of channel {}, which is not declared", header.channel_id)));
        };
        if topic.encoding != "json" {
            return Ok(());
        }
        let wrong = |topic: &Topic, column: &str, found: String, expected| LogError::Type {
            file: self.path.to_owned(),
            row: Some(topic.rows + 1),
            column: column.to_owned(),
            found,
            expected,
        };
        let message: Value = match serde_json::from_slice(data) {
            Ok(message) => message,
            Err(error) => return Err(wrong(topic, &topic.name, error.to_string(), "a message in JSON")),
        };
        let Some(keys) = message.as_object() else {
            return Err(wrong(topic, &topic.name, message.to_string(), "a JSON object"));
        };
        if topic.rows == 0 || keys.len() > topic.known.len() {
            topic.known.extend(keys.keys().cloned());
        }
        let since = header.log_time as i128 - *topic.began.get_or_insert(header.log_time) as i128;
        let since = Value::from(since as f64 * 1e-9);
        for name in self.wanted.names() {
            let number = self.wanted.numbers.contains(name);
            let key = key(&topic.name, name);
            let found = lookup(&message, key).or_else(|| (key == LOG_TIME).then_some(&since));
            let Some(found) = found.filter(|found| !found.is_null()) else { continue };
            topic.known.insert(key.to_owned());
            if number {
                let Some(value) = found.as_f64().or_else(|| found.as_bool().map(|bit| f64::from(u8::from(bit)))) else {
                    return Err(wrong(topic, name, found.to_string(), "a number"));
                };
                let column = topic.numbers.entry(name.clone()).or_default();
                column.resize(topic.rows, f64::NAN);
                column.push(value);
            }
            if self.wanted.texts.contains(name) {
                let column = topic.texts.entry(name.clone()).or_default();
                (column.codes.len()..topic.rows).for_each(|_| column.push(""));
                match found {
                    Value::String(text) => column.push(text),
                    Value::Array(_) | Value::Object(_) => {
                        return Err(wrong(topic, name, found.to_string(), "a text or a number"));
                    }
                    // The number that any other format has here: 3, not 3.0.
                    Value::Number(number) => column.push(&number.as_f64().unwrap_or(f64::NAN).to_string()),
                    other => column.push(&other.to_string()),
                }
            }
        }
        topic.rows += 1;
        self.rows += 1;
        // Columns that this message lacks are missing in this row.
        topic.numbers.values_mut().for_each(|values| values.resize(topic.rows, f64::NAN));
        topic.texts.values_mut().for_each(|texts| {
            (texts.codes.len()..topic.rows).for_each(|_| texts.push(""));
        });
        Ok(())
    }
}

impl Topic {
    fn has(&self, name: &str) -> bool {
        let key = key(&self.name, name);
        key == LOG_TIME || self.known.contains(key)
    }

    fn available(&self, with_topic: bool) -> Vec<String> {
        let name = |key: &String| if with_topic { format!("{}.{key}", self.name) } else { key.clone() };
        self.known.iter().map(name).collect()
    }
}

/// The key of a column in messages of a topic.
fn key<'a>(topic: &str, column: &'a str) -> &'a str {
    column.strip_prefix(topic).and_then(|rest| rest.strip_prefix('.')).unwrap_or(column)
}

/// A value by its key; dots lead into objects and arrays.
fn lookup<'a>(value: &'a Value, key: &str) -> Option<&'a Value> {
    let inside = |(dot, _): (usize, &str)| lookup(child(value, &key[..dot])?, &key[dot + 1..]);
    child(value, key).or_else(|| key.match_indices('.').find_map(inside))
}

fn child<'a>(value: &'a Value, key: &str) -> Option<&'a Value> {
    match value {
        Value::Object(keys) => keys.get(key),
        Value::Array(items) => items.get(key.parse::<usize>().ok()?),
        _ => None,
    }
}

/// The bytes of an MCAP file with this table, a message a row. The column [`TIME`] has the times; `start` is that of
/// its 0, ns since 1970.
///
/// # Errors
/// [`LogError::Shape`].
pub fn encode(table: &Table, topic: &str, start: u64) -> Result<Vec<u8>, LogError> {
    table.check()?;
    let shape = |column: &str, reason: String| LogError::Shape { column: column.to_owned(), reason };
    let times = table.number(TIME).ok_or_else(|| shape(TIME, "is missing: messages need times, s".into()))?;
    let failed = |error: McapError| shape(topic, error.to_string());
    let options = WriteOptions::new().compression_threads(0).library("joint-firmware logs");
    let mut writer = options.create(Cursor::new(Vec::new())).map_err(failed)?;
    let schema = writer.add_schema(topic, "jsonschema", schema(table, topic).to_string().as_bytes()).map_err(failed)?;
    let channel = writer.add_channel(schema, topic, "json", &BTreeMap::new()).map_err(failed)?;
    for (row, time) in times.iter().enumerate() {
        let since = (time * 1e9).round();
        if !(0.0..9e18).contains(&since) {
            return Err(shape(TIME, format!("{time} s in row {}: expected 0 to 9e9", row + 1)));
        }
        let log_time = start.saturating_add(since as u64);
        let header = MessageHeader { channel_id: channel, sequence: row as u32, log_time, publish_time: log_time };
        let message = message(table, row).to_string();
        writer.write_to_known_channel(&header, message.as_bytes()).map_err(failed)?;
    }
    writer.finish().map_err(failed)?;
    Ok(writer.into_inner().into_inner())
}

/// A message: what is not finite is left out, JSON has no number for it.
fn message(table: &Table, row: usize) -> Value {
    let numbers = table.numbers.iter().filter(|(_, values)| values[row].is_finite());
    let numbers = numbers.map(|(name, values)| (name.clone(), Value::from(values[row])));
    let text = |texts: &Texts| Value::from(texts.words[texts.codes[row] as usize].as_str());
    Value::Object(numbers.chain(table.texts.iter().map(|(name, texts)| (name.clone(), text(texts)))).collect())
}

fn schema(table: &Table, topic: &str) -> Value {
    let property = |name: &str, kind: &str| (name.to_owned(), serde_json::json!({ "type": kind }));
    let numbers = table.numbers.iter().map(|(name, _)| property(name, "number"));
    let properties = numbers.chain(table.texts.iter().map(|(name, _)| property(name, "string")));
    serde_json::json!({
        "type": "object", "title": topic, "properties": Value::Object(properties.collect()),
    })
}
