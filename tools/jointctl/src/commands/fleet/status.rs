//! `jointctl fleet sums` and `jointctl fleet status`.

use super::{Folder, Status, Sums, page, registry};
use crate::commands::CommandError;
use crate::commands::remote::{catch_interrupts, running};
use crate::commands::terminal::Terminal;
use ::fleet::finding::{Finding, findings};
use ::fleet::night::{Night, Scope, night};
use identification::progress::Progress;
use report::output::write_file;
use serde_json::json;
use std::fmt::Write;

impl Sums {
    /// Runs the command.
    pub fn run(&self) -> Result<(), CommandError> {
        let night = self.fleet.night()?;
        match self.json {
            true => println!("{}", counts(&night)),
            false => println!("{}", summary(&night)),
        }
        Ok(())
    }
}

impl Folder {
    /// Sums of everything.
    pub(super) fn night(&self) -> Result<Night, CommandError> {
        catch_interrupts()?;
        let progress = Terminal::new();
        progress.stage("sum up");
        let scope = Scope { joints: self.joint.clone(), stored: self.stored };
        let night = night(&self.folder, &scope, self.threads, &running)?;
        progress.finish();
        if !running() {
            let text = "interrupted: what was summed up stays, the same command goes on from there".to_owned();
            return Err(CommandError::Interrupted(text));
        }
        for bad in &night.misplaced {
            eprintln!("warning: {}: {}", bad.path.display(), bad.reason);
        }
        for bad in night.entries.iter().filter(|entry| !entry.defect.is_empty()) {
            eprintln!("warning: joint={}/day={} is left out: {}", bad.joint, bad.day, bad.defect);
        }
        Ok(night)
    }
}

impl Status {
    /// Runs `fleet status`.
    pub fn run(&self) -> Result<(), CommandError> {
        self.force.permits(&self.page)?;
        let night = self.fleet.night()?;
        let findings = findings(&night.entries);
        let roll_call = |bus: &String| registry::roll_call(&self.fleet.folder, bus, self.patience);
        let called = self.bus.as_ref().map(roll_call).transpose()?;
        if let Some(path) = &self.page {
            write_file(path, page::page(&findings, &night).as_bytes())?;
        }
        if self.json {
            let mut told = counts(&night);
            told["joints"] = json!(findings);
            if let Some(called) = &called {
                told["on_the_bus"] = json!(called);
            }
            println!("{told}");
            return Ok(());
        }
        print!("{}", table(&findings));
        println!("{}", summary(&night));
        if let Some(called) = &called {
            print!("{}", registry::table(called));
        }
        if let Some(path) = &self.page {
            println!("Written: {}", path.display());
        }
        Ok(())
    }
}

/// Counts of partitions, and misplaced files, as JSON.
fn counts(night: &Night) -> serde_json::Value {
    let misplaced: Vec<_> =
        night.misplaced.iter().map(|bad| json!({ "path": bad.path, "reason": bad.reason })).collect();
    json!({
        "partitions": night.entries.len(),
        "bad_partitions": bad(night),
        "summed_up": night.read,
        "known": night.kept,
        "misplaced": misplaced
    })
}

fn bad(night: &Night) -> usize {
    night.entries.iter().filter(|entry| !entry.defect.is_empty()).count()
}

/// One line about the partitions.
fn summary(night: &Night) -> String {
    format!(
        "{} partitions: {} summed up, {} known, {} bad; {} misplaced",
        night.entries.len(),
        night.read,
        night.kept,
        bad(night),
        night.misplaced.len()
    )
}

/// The joints, a line each.
fn table(findings: &[Finding]) -> String {
    let mut text = format!("{:<16}{:<20}{:<12}{:>9}  reason\n", "joint", "finding", "since", "bad days");
    for joint in findings {
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{:<16}{:<20}{:<12}{:>9}  {}",
            joint.joint,
            joint.kind.words(),
            joint.since.as_deref().unwrap_or("-"),
            joint.bad_days,
            joint.reason
        );
    }
    text
}
