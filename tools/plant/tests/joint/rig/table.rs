//! The tables of docs/faults.md as the tests read them: what the documentation promises is what they measure against;
//! host.

use joint_firmware::joint::fault::{Fault, Reaction};

const DOCUMENT: &str = include_str!("../../../../../docs/faults.md");

/// Condition on which a fault can be acknowledged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reset {
    /// Once its cause is gone.
    OnceGone,
    /// Once its cause is gone, where that is soon; later only by a restart of the joint.
    Restart,
    /// Once its cause is gone; a reset waits for that a while.
    Waits,
    /// Reset at any time: with the bridge off the cause does not show.
    AnyTime,
}

/// A row of the table of faults.
#[derive(Clone, Debug, PartialEq)]
pub struct FaultRow {
    /// Control steps from the first one whose signals show the cause to the reaction, that one included.
    pub steps: u32,
    pub reaction: Reaction,
    pub reset: Reset,
    pub error_code: u16,
}

/// Cells of every row of the table under a heading.
fn rows(heading: &str) -> Vec<Vec<&'static str>> {
    let section = DOCUMENT.split("\n## ").find(|section| section.starts_with(heading));
    let lines = section.unwrap_or_else(|| panic!("no section {heading:?}")).lines();
    let rows = lines.filter(|line| line.starts_with('|')).skip(2);
    rows.map(|row| row.trim_matches('|').split('|').map(str::trim).collect()).collect()
}

fn number(cell: &str) -> u32 {
    cell.parse().unwrap_or_else(|_| panic!("not a number of steps: {cell:?}"))
}

/// Names of the faults in the table, in its order.
pub fn documented_faults() -> Vec<String> {
    rows("Faults").iter().map(|row| row[0].to_owned()).collect()
}

/// Documented row of a fault.
pub fn documented(fault: Fault) -> FaultRow {
    let name = format!("{fault:?}");
    let rows = rows("Faults");
    let row = rows.iter().find(|row| row[0] == name).unwrap_or_else(|| panic!("{name} is not documented"));
    let [_, _, steps, reaction, reset, error_code] = row[..] else { panic!("six columns: {row:?}") };
    FaultRow {
        steps: number(steps),
        reaction: match reaction {
            "off" => Reaction::SwitchOff,
            "brake" => Reaction::Brake,
            other => panic!("{name}: {other:?}"),
        },
        reset: match reset {
            "once gone" => Reset::OnceGone,
            "once gone, or restart" => Reset::Restart,
            "once gone, waits" => Reset::Waits,
            "any time" => Reset::AnyTime,
            other => panic!("{name}: {other:?}"),
        },
        error_code: u16::from_str_radix(error_code.trim_end_matches('h'), 16).unwrap(),
    }
}

/// A row of the table of broken sensors.
#[derive(Clone, Debug, PartialEq)]
pub struct SensorRow {
    pub sensor: &'static str,
    pub failure: &'static str,
    pub motion: &'static str,
    /// Name of the fault, and the control steps after which it comes at most; none where nothing shows.
    pub fault: Option<(&'static str, u32)>,
}

/// All rows of the table of broken sensors.
pub fn documented_sensors() -> Vec<SensorRow> {
    let row = |row: &Vec<&'static str>| {
        let [sensor, failure, motion, fault, steps, _] = row[..] else { panic!("six columns: {row:?}") };
        let fault = (fault != "none").then(|| (fault, number(steps)));
        SensorRow { sensor, failure, motion, fault }
    };
    rows("Broken sensors").iter().map(row).collect()
}
