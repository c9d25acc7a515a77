//! A small synthetic joint as CSV and TOML, for the tests of the whole preparation.

mod checks;
mod defects;
mod lag;
mod pipeline;
mod shipped;

use super::{DatasetError, Prepared, prepare_with};
use std::fmt::Write;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Description of `joint()`; tests append tables or replace parts of it.
const DESCRIPTION: &str = r#"
name = "synthetic"
[source]
files = ["joint.csv"]
[columns]
time = { column = "t" }
position = { column = "q" }
effort = { column = "u", unit = "Nm" }
"#;

/// A folder that is removed at the end of the test.
struct Folder(TempDir);

impl Folder {
    fn new() -> Folder {
        Folder(tempfile::tempdir().unwrap())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn with(self, name: &str, content: impl AsRef<[u8]>) -> Folder {
        let path = self.path(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, content).unwrap();
        self
    }

    fn prepare(&self) -> Result<Prepared, DatasetError> {
        prepare_with(&self.path("set.toml"), &|_| None)
    }
}

/// Prepares `joint.csv` with the description.
fn prepare(description: &str, csv: &str) -> Result<Prepared, DatasetError> {
    Folder::new().with("set.toml", description).with("joint.csv", csv).prepare()
}

/// Row `i` of the joint: 20 s at 100 Hz, q = sin(t), u = 2 cos(t), T = 30.
fn row(i: usize) -> [f64; 4] {
    let t = i as f64 * 0.01;
    [t, t.sin(), 2.0 * t.cos(), 30.0]
}

/// The joint with each row changed by `change`; a row may be dropped.
fn joint_with(change: impl Fn(usize, [f64; 4]) -> Option<[f64; 4]>) -> String {
    let mut csv = String::from("t,q,u,T\n");
    for [t, q, u, temperature] in (0..2000).filter_map(|i| change(i, row(i))) {
        writeln!(csv, "{t},{q},{u},{temperature}").unwrap();
    }
    csv
}

fn joint() -> String {
    joint_with(|_, row| Some(row))
}

/// The joint with one field of one line (the header is line 1) replaced by a text.
fn joint_with_field(line: usize, column: usize, text: &str) -> String {
    let csv = joint();
    let lines = csv.lines().enumerate().map(|(i, content)| {
        let mut fields: Vec<&str> = content.split(',').collect();
        if i + 1 == line {
            fields[column] = text;
        }
        fields.join(",")
    });
    lines.collect::<Vec<_>>().join("\n")
}

fn shipped_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../jointctl/datasets")
}
