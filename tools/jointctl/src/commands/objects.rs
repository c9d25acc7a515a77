//! `jointctl info`, `get`, `set`: a joint's objects, by the names of docs/objects.md or by index.

use super::CommandError;
use super::force::Force;
use super::remote::{Patience, Where};
use super::stream;
use crate::remote::entry::Entry;
use crate::remote::{Value, configuration, info};
use clap::Args;
use std::io::Write;
use std::path::PathBuf;

/// Arguments of `info`.
#[derive(Debug, Args)]
pub struct Info {
    /// Which joint.
    #[command(flatten)]
    on: Where,
    /// Print a JSON object, a text for each line of the page
    #[arg(long)]
    json: bool,
}

impl Info {
    /// Runs the command.
    pub fn run(&self) -> Result<(), CommandError> {
        let page = info::page(&self.on.joint()?)?;
        match self.json {
            true => println!("{:#}", info::json(&page)),
            false => print!("{page}"),
        }
        Ok(())
    }
}

/// Arguments of `get`.
#[derive(Debug, Args)]
pub struct Get {
    /// Names or indices: torque-limit, limits (all of a record), 6064, 2103:1
    #[arg(value_name = "NAME|INDEX[:SUB]", required_unless_present = "list")]
    objects: Vec<String>,
    /// The bus: socketcan:can0, slcan:/dev/ttyACM0, slcan:tcp://host:port, udp:239.74.163.2:43113
    #[arg(long, value_name = "BUS", required_unless_present = "list", env = "JOINTCTL_BUS")]
    bus: Option<String>,
    /// Node id of the joint, 1 to 127
    #[arg(long, value_name = "N", required_unless_present = "list", env = "JOINTCTL_NODE")]
    node: Option<u8>,
    /// Write the bytes of the one object to a file: an image, a fault history; "-" is standard output
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Permission to replace.
    #[command(flatten)]
    force: Force,
    /// Name all objects, with index, type, access, unit and limits; needs no bus
    #[arg(long, conflicts_with_all = ["objects", "out"])]
    list: bool,
    /// Print JSON: an object with each value and unit; with --list an array
    #[arg(long, conflicts_with = "out")]
    json: bool,
    /// How long it may take.
    #[command(flatten)]
    patience: Patience,
}

impl Get {
    /// Runs the command.
    pub fn run(&self) -> Result<(), CommandError> {
        let (Some(bus), Some(node), false) = (&self.bus, self.node, self.list) else {
            let content = Entry::all().filter(Entry::is_content);
            let text = match self.json {
                true => format!("{:#}\n", content.map(|entry| entry.json()).collect::<serde_json::Value>()),
                false => content.map(|entry| format!("{}\n", entry.listed())).collect(),
            };
            // A reader that closes the pipe, as `head` does, has seen enough.
            let _ = std::io::stdout().write_all(text.as_bytes());
            return Ok(());
        };
        let named = self.objects.iter().map(|name| Entry::find(name)).collect::<Result<Vec<_>, _>>()?;
        if let Some(path) = &self.out {
            stream::permits(self.force, path)?;
        }
        let joint = Where { bus: bus.clone(), node, key: None, patience: self.patience }.joint()?;
        if let Some(path) = &self.out {
            let [entry] = named.concat()[..] else {
                return Err(CommandError::Arguments("--out takes the bytes of one object".into()));
            };
            let bytes = joint.node().upload(entry.object.index, entry.object.sub_index);
            let bytes = bytes.map_err(crate::remote::RemoteError::from)?;
            let said = format!("{}: {} bytes written: {}", entry.described(), bytes.len(), path.display());
            return stream::write(path, &bytes, &said);
        }
        if self.json {
            let entries = named.concat();
            let record = entries.len() > 1;
            let mut list = serde_json::Map::new();
            for entry in entries.into_iter().filter(|entry| !record || entry.is_readable()) {
                let value = match joint.read(entry) {
                    Err(error) if record => serde_json::json!({ "error": error.to_string() }),
                    value => serde_json::json!({ "value": value?.json(), "unit": entry.text.unit }),
                };
                list.insert(entry.full_name(), value);
            }
            println!("{:#}", serde_json::Value::Object(list));
            return Ok(());
        }
        let mut text = String::new();
        for entries in named {
            let record = entries.len() > 1;
            // Of a record what can be read; what was named by itself is asked for, and the joint says why not.
            for entry in entries.into_iter().filter(|entry| !record || entry.is_readable()) {
                let shown = match info::show_entry(&joint, entry) {
                    Err(error) if record => error.to_string(),
                    shown => shown?,
                };
                text.push_str(&format!("{:<32} {shown}\n", entry.described()));
            }
        }
        let _ = std::io::stdout().write_all(text.as_bytes());
        Ok(())
    }
}

/// Arguments of `set`.
#[derive(Debug, Args)]
pub struct Set {
    /// Names or indices, each with its value in the unit of docs/objects.md; settings that depend on each other
    /// together
    #[arg(value_name = "NAME|INDEX[:SUB] VALUE", num_args = 2.., required = true, allow_negative_numbers = true)]
    objects: Vec<String>,
    /// Which joint.
    #[command(flatten)]
    on: Where,
    /// Print JSON: an object with each value, as the joint has it now, and unit
    #[arg(long)]
    json: bool,
}

impl Set {
    /// Runs the command.
    pub fn run(&self) -> Result<(), CommandError> {
        let mut wanted: Vec<(Entry, Value)> = Vec::new();
        for pair in self.objects.chunks(2) {
            let [name, value] = pair else {
                let text = format!("'{}' has no value: names and values come in pairs", pair.concat());
                return Err(CommandError::Arguments(text));
            };
            let entry = Entry::one(name)?;
            let value = entry.parse(value)?;
            entry.encode(&value)?;
            wanted.push((entry, value));
        }
        let joint = self.on.joint()?;
        configuration::set(&joint, &wanted)?;
        if self.json {
            let mut list = serde_json::Map::new();
            for (entry, _) in wanted {
                // That of an object that cannot be read is null: it is a command.
                let value = entry.is_readable().then(|| joint.read(entry)).transpose()?;
                let value = value.map(|value| value.json());
                list.insert(entry.full_name(), serde_json::json!({ "value": value, "unit": entry.text.unit }));
            }
            println!("{:#}", serde_json::Value::Object(list));
            return Ok(());
        }
        for (entry, _) in wanted {
            // An object that cannot be read is a command.
            let shown = if entry.is_readable() { info::show_entry(&joint, entry)? } else { "done".into() };
            println!("{:<32} {shown}", entry.described());
        }
        Ok(())
    }
}
