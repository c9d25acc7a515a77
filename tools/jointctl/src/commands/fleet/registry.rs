//! `jointctl fleet register`, `jointctl fleet images`, and the roll call of `fleet status --bus`: which joint runs
//! which image.

use super::{Images, Register};
use crate::commands::CommandError;
use crate::commands::remote::Patience;
use crate::remote::present::{PATIENCE, present};
use crate::remote::{RemoteError, RemoteJoint};
use ::fleet::night::NightError;
use ::fleet::partition::is_joint;
use ::fleet::registry::{self, Event, Identity, Record, sha256};
use ::fleet::roll_call::{Answer, Line, compare};
use bus::client::Network;
use friction_compensation::parameters::authentication::split;
use std::fmt::Write;
use std::path::Path;
use std::time::{SystemTime, UNIX_EPOCH};
use time::UtcDateTime;

/// Time since 1970-01-01 UTC, ms.
pub(super) fn now() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |time| time.as_millis() as u64)
}

/// Adds records.
pub(super) fn append(fleet: &Path, records: &[Record]) -> Result<(), CommandError> {
    let failed = |source| CommandError::Registry { path: fleet.join(registry::FOLDER), source };
    registry::append(fleet, records).map(|_| ()).map_err(failed)
}

/// All records; files that are none are told.
pub(super) fn records(fleet: &Path) -> Result<Vec<Record>, CommandError> {
    let failed = |source| CommandError::Registry { path: fleet.join(registry::FOLDER), source };
    let (records, misplaced) = registry::read(fleet).map_err(failed)?;
    for bad in misplaced {
        eprintln!("warning: {}: {}", bad.path.display(), bad.reason);
    }
    Ok(records)
}

/// A joint's identity and image, as it says itself.
fn answer(joint: &RemoteJoint) -> Result<Answer, RemoteError> {
    let word = |sub_index| joint.node().number(0x1018, sub_index).map(u32::from_le_bytes);
    let identity = Identity { product: word(2)?, serial: word(4)? };
    let version = joint.node().number(0x2213, 1).map(u32::from_le_bytes)?;
    let upload = joint.active_image()?;
    let image = (!upload.is_empty()).then(|| (version, sha256(split(&upload).0)));
    Ok(Answer { node: joint.id(), identity, image })
}

/// A time since 1970-01-01 UTC, s, as date and time; "-" beyond the year 9999.
fn utc(time: u64) -> String {
    let time = i64::try_from(time).ok().and_then(|time| UtcDateTime::from_unix_timestamp(time).ok());
    // Other crates of a build may ask `time` for larger years.
    time.filter(|time| time.year() <= 9999).map_or_else(
        || "-".into(),
        |t| {
            let (hour, minute, second) = t.as_hms();
            format!("{} {hour:02}:{minute:02}:{second:02}", t.date())
        },
    )
}

impl Register {
    /// Runs the command.
    pub fn run(&self) -> Result<(), CommandError> {
        if !is_joint(&self.folder, &self.joint) {
            let (fleet, joint) = (self.folder.clone(), self.joint.clone());
            return Err(NightError::NoJoint { fleet, joint }.into());
        }
        let joint = self.on.joint()?;
        let answer = answer(&joint)?;
        let known = records(&self.folder)?;
        let (version, image) = answer.image.clone().unwrap_or_default();
        let made = registry::made(&known, &image);
        let record = Record {
            time_ms: now(),
            event: Event::Runs,
            joint: self.joint.clone(),
            identity: Some(answer.identity),
            version,
            image,
            days: made.map_or_else(String::new, |made| made.days.clone()),
            data: made.map_or_else(String::new, |made| made.data.clone()),
            key: made.map_or_else(String::new, |made| made.key.clone()),
        };
        let Identity { product, serial } = answer.identity;
        let what = match &answer.image {
            Some((version, digest)) => format!("version {version}, SHA-256 {digest}"),
            None => "no image".into(),
        };
        let said = format!("joint={}: product {product:08x}, serial {serial}, {what}", self.joint);
        let last = registry::running(&known).get(&answer.identity).copied();
        if last.is_some_and(|last| last.joint == record.joint && last.image == record.image) {
            println!("{said}: in the registry already");
            return Ok(());
        }
        append(&self.folder, &[record])?;
        println!("{said}: registered");
        Ok(())
    }
}

impl Images {
    /// Runs the command.
    pub fn run(&self) -> Result<(), CommandError> {
        let records = records(&self.folder)?;
        if self.json {
            println!("{}", serde_json::json!({ "images": records }));
            return Ok(());
        }
        let mut text = format!(
            "{:<21}{:<6}{:<16}{:>8}{:>9}  {:<14}{:<10}learned from\n",
            "time, UTC", "event", "joint", "serial", "version", "SHA-256", "key"
        );
        for record in &records {
            let serial = record.identity.map_or("-".into(), |identity| identity.serial.to_string());
            let event = if record.event == Event::Made { "made" } else { "runs" };
            let or = |text: &str, length: usize| match text {
                "" => "-".to_owned(),
                text => text.chars().take(length).collect(),
            };
            // Writing to a string cannot fail.
            let _ = writeln!(
                text,
                "{:<21}{event:<6}{:<16}{serial:>8}{:>9}  {:<14}{:<10}{}",
                utc(record.time_ms / 1_000),
                record.joint,
                record.version,
                or(&record.image, 12),
                or(&record.key, 8),
                or(&record.days, 64)
            );
        }
        print!("{text}");
        println!("{} records", records.len());
        Ok(())
    }
}

/// The registry beside what the joints on a bus say.
pub(super) fn roll_call(fleet: &Path, bus: &str, patience: Patience) -> Result<Vec<Line>, CommandError> {
    let network: Network = patience.network(bus)?;
    let nodes = present(&network, PATIENCE).map_err(RemoteError::from)?;
    let mut answers = Vec::new();
    for node in nodes {
        match RemoteJoint::on(&network, node).and_then(|joint| answer(&joint)) {
            Ok(answer) => answers.push(answer),
            Err(error) => eprintln!("warning: node {node}: {error}"),
        }
    }
    Ok(compare(&records(fleet)?, &answers))
}

/// The roll call, a line each.
pub(super) fn table(lines: &[Line]) -> String {
    let mut text = format!("\n{:<16}{:>5}{:>12}  {:<16}reason\n", "joint", "node", "serial", "on the bus");
    for line in lines {
        let node = line.node.map_or("-".into(), |node| node.to_string());
        let waiting = line.waiting.map_or(String::new(), |version| format!("; version {version} was made for it"));
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{:<16}{node:>5}{:>12}  {:<16}{}{waiting}",
            line.joint.as_deref().unwrap_or("-"),
            line.identity.serial,
            line.verdict.words(),
            line.reason
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::utc;

    #[test]
    fn a_time_is_a_date_up_to_the_year_9999() {
        for (time, date) in [
            (0, "1970-01-01 00:00:00"),
            (951_782_400, "2000-02-29 00:00:00"),
            (253_402_300_799, "9999-12-31 23:59:59"),
            (253_402_300_800, "-"),
            (u64::MAX, "-"),
        ] {
            assert_eq!(utc(time), date);
        }
    }
}
