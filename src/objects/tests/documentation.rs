//! `docs/objects.md` is what the table says.

use crate::objects::table::{DataType, Object, Text, communication, described};
use canopen_node::Access;
use std::fmt::Write;

const HEAD: &str = "# Objects

The object dictionary of the joint, made from the tables in `src/objects/table/`: a test fails where this file says anything else, and
`UPDATE_DOCS=1 cargo test -p joint-firmware --lib objects` writes it anew. Values are raw; one step is the scale, in the unit. PDO: R may
be mapped into RPDOs, T into TPDOs.
";

/// Access of an SDO client.
pub fn access(object: &Object) -> &'static str {
    match object.access {
        Access::ReadOnly => "ro",
        Access::WriteOnly => "wo",
        Access::ReadWrite => "rw",
    }
}

/// The PDOs that it may be part of.
pub fn pdo(object: &Object) -> &'static str {
    match (object.mappable.receive, object.mappable.transmit) {
        (true, true) => "RT",
        (true, false) => "R",
        (false, true) => "T",
        (false, false) => "",
    }
}

fn row(text: &mut String, (object, words): (&Object, &Text)) {
    let (access, pdo) = (access(object), pdo(object));
    let step = match (words.unit, words.scale) {
        ("", 1.0) => String::new(),
        (unit, 1.0) if object.data_type == DataType::F32 => unit.to_string(),
        (unit, scale) => format!("{scale:?} {unit}").trim_end().to_string(),
    };
    let limits = words.limits.map_or(String::new(), |(low, high)| format!("{low:?} to {high:?}"));
    let (index, sub, name, kind) = (object.index, object.sub_index, words.name, object.data_type.name());
    writeln!(
        text,
        "| {index:04X}h:{sub} | {name} | {kind} | {access} | {pdo} | {step} | {limits} | {} |",
        words.description
    )
    .unwrap();
}

fn document() -> String {
    let mut text = HEAD.to_string();
    let (mut application, mut server) = (described().peekable(), communication().peekable());
    for (title, rows) in [
        ("Application", &mut application as &mut dyn Iterator<Item = _>),
        ("Communication", &mut server as &mut dyn Iterator<Item = _>),
    ] {
        writeln!(text, "\n## {title}\n\n| object | name | type | access | PDO | scale | limits | |").unwrap();
        writeln!(text, "|---|---|---|---|---|---|---|---|").unwrap();
        rows.filter(|(_, words): &(&Object, &Text)| !words.description.is_empty())
            .for_each(|pair| row(&mut text, pair));
    }
    text
}

/// Fails where the file says anything else; writes it with `UPDATE_DOCS`.
pub fn held_to(file: &str, expected: &str) {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(file);
    if std::env::var_os("UPDATE_DOCS").is_some() {
        std::fs::write(&path, expected).unwrap();
    }
    let found = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(found == expected, "{file} is not what the table says; UPDATE_DOCS=1 writes it anew");
}

#[test]
fn the_file_says_what_the_table_says() {
    held_to("docs/objects.md", &document());
}
