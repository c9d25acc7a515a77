//! Other people's programs: what this crate writes is read by PyPI's `mcap`, `pyarrow` and `rerun-sdk`, and what the
//! first two write is read by it.
//!
//! Without Python, or where they cannot be installed, these are reported as ignored by name; with `CI` set they run,
//! and fail.

use libtest_mimic::{Arguments, Failed, Trial};
use logs::{Format, Table, Wanted, encode, read};
use python::{LOGS, Packages, RERUN};
use std::path::Path;
use std::process::Command;

const ROWS: usize = 3_000;
const START: u64 = 1_700_000_000_000_000_000;

/// A test with its name.
type Named = (&'static str, fn(&Path) -> Result<(), Failed>);

fn main() {
    let arguments = Arguments::from_args();
    let must_run = std::env::var_os("CI").is_some();
    let trials = |packages: Packages, tests: &[Named]| -> Vec<Trial> {
        let python = if arguments.list { None } else { packages.python(env!("CARGO_TARGET_TMPDIR")) };
        let ignored = !must_run && python.is_none();
        let trial = |&(name, test): &Named| {
            let python = python.clone();
            Trial::test(name, move || test(packages.required(python.as_deref())?)).with_ignored_flag(ignored)
        };
        tests.iter().map(trial).collect()
    };
    let of_logs: [Named; 5] = [
        ("the_mcap_package_reads_every_value_time_and_schema", mcap_reads),
        ("pyarrow_reads_every_value_and_null", pyarrow_reads),
        ("compressed_and_plain_mcap_of_the_package_is_read", mcap_written),
        ("parquet_as_pyarrow_writes_it_is_read", pyarrow_written),
        ("columns_that_are_no_numbers_are_refused_by_name", pyarrow_other_types),
    ];
    let of_rerun: [Named; 2] = [
        ("rerun_shows_every_value_of_a_parquet_log", rerun_parquet),
        ("rerun_keeps_every_message_of_an_mcap", rerun_mcap),
    ];
    let all = trials(LOGS, &of_logs).into_iter().chain(trials(RERUN, &of_rerun)).collect();
    libtest_mimic::run(&arguments, all).exit();
}

/// Runs a script in a folder; what it prints.
fn run(python: &Path, folder: &Path, script: &str) -> Result<String, Failed> {
    let output = Command::new(python).current_dir(folder).args(["-c", script]).output()?;
    match output.status.success() {
        true => Ok(String::from_utf8_lossy(&output.stdout).into_owned()),
        false => Err(String::from_utf8_lossy(&output.stderr).into_owned().into()),
    }
}

fn same(what: &str, found: &[f64], expected: &[f64]) -> Result<(), Failed> {
    let bits = |values: &[f64]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
    if bits(found) == bits(expected) { Ok(()) } else { Err(format!("{what} differs").into()) }
}

fn check(holds: bool, what: &str) -> Result<(), Failed> {
    if holds { Ok(()) } else { Err(what.into()) }
}

/// The columns of a test, by a rule that a script repeats exactly: fractions of integers.
fn effort(row: usize) -> f64 {
    if row % 10 == 4 { f64::NAN } else { (row as f64 - 1500.0) / 7.0 }
}

fn table() -> Table {
    let time = (0..ROWS).map(|row| row as f64 / 250.0).collect();
    Table::of_numbers([("time_s", time), ("effort_Nm", (0..ROWS).map(effort).collect::<Vec<_>>())])
}

fn mcap_reads(python: &Path) -> Result<(), Failed> {
    let folder = tempfile::tempdir()?;
    std::fs::write(folder.path().join("log.mcap"), encode(&table(), Format::Mcap, "/joint5", START)?)?;
    run(
        python,
        folder.path(),
        r#"
import json
from mcap.reader import make_reader
reader = make_reader(open("log.mcap", "rb"), validate_crcs=True)
assert reader.get_summary().statistics.message_count == 3000
rows = 0
for schema, channel, message in reader.iter_messages():
    assert (channel.topic, channel.message_encoding, schema.encoding) == ("/joint5", "json", "jsonschema")
    assert json.loads(schema.data)["properties"]["effort_Nm"] == {"type": "number"}
    assert message.log_time == 1700000000000000000 + 4000000 * rows, (rows, message.log_time)
    values = json.loads(message.data)
    assert values["time_s"] == rows / 250
    assert values.get("effort_Nm") == (None if rows % 10 == 4 else (rows - 1500) / 7), (rows, values)
    rows += 1
assert rows == 3000
"#,
    )
    .map(drop)
}

fn pyarrow_reads(python: &Path) -> Result<(), Failed> {
    let folder = tempfile::tempdir()?;
    let mut table = table();
    table.texts.push(("state".into(), (0..ROWS).map(|row| if row % 2 == 0 { "run" } else { "" }).collect()));
    std::fs::write(folder.path().join("log.parquet"), encode(&table, Format::Parquet, "", 0)?)?;
    run(
        python,
        folder.path(),
        r#"
import pyarrow as pa, pyarrow.parquet as pq
table = pq.read_table("log.parquet")
assert table.schema.names == ["time_s", "effort_Nm", "state"], table.schema
assert [str(t) for t in table.schema.types] == ["double", "double", "string"], table.schema
columns = table.to_pydict()
assert columns["time_s"] == [row / 250 for row in range(3000)]
assert columns["effort_Nm"] == [None if row % 10 == 4 else (row - 1500) / 7 for row in range(3000)]
assert columns["state"] == ["run" if row % 2 == 0 else None for row in range(3000)]
assert pq.ParquetFile("log.parquet").metadata.row_group(0).column(0).compression == "SNAPPY"
"#,
    )
    .map(drop)
}

fn mcap_written(python: &Path) -> Result<(), Failed> {
    let folder = tempfile::tempdir()?;
    run(
        python,
        folder.path(),
        r#"
import json
from mcap.writer import CompressionType, Writer
for name in ["NONE", "LZ4", "ZSTD"]:
    writer = Writer(open(f"{name}.mcap", "wb"), compression=CompressionType[name])
    writer.start()
    schema = writer.register_schema("Any", "jsonschema", b'{"type": "object"}')
    cdr = writer.register_channel("/tf", "cdr", 0)
    topics = [writer.register_channel(f"/arm/joint{n}", "json", schema) for n in (1, 2)]
    for row in range(3000):
        for n, channel in enumerate(topics):
            data = {"name": f"j{n}", "nested": {"q": [row / 7 + n, row]}, "on": row % 2 == 0}
            if row % 10 != 4:
                data["effort"] = (row - 1500) / 7
            writer.add_message(channel, 10**18 + 4000000 * row, json.dumps(data).encode(), 10**18)
        writer.add_message(cdr, 10**18, b"\x00\x01", 10**18)
    writer.finish()
"#,
    )?;
    for name in ["NONE.mcap", "LZ4.mcap", "ZSTD.mcap"] {
        let path = folder.path().join(name);
        let names = ["/arm/joint2.nested.q.0", "/arm/joint2.effort", "/arm/joint2.on", "log_time_s"];
        let mut wanted = Wanted::numbers(names);
        wanted.texts.insert("/arm/joint2.name".into());
        let back = read(&path, &wanted)?;
        let column = |name: &str| back.number(name).unwrap_or_default();
        same(name, column(names[0]), &(0..ROWS).map(|row| row as f64 / 7.0 + 1.0).collect::<Vec<_>>())?;
        same(name, column(names[1]), &(0..ROWS).map(effort).collect::<Vec<_>>())?;
        same(name, column(names[2]), &(0..ROWS).map(|row| f64::from(row % 2 == 0)).collect::<Vec<_>>())?;
        let last = column("log_time_s").last().copied().unwrap_or_default();
        check((last - 2999.0 * 0.004).abs() < 1e-9, "the last log time")?;
        check(back.text("/arm/joint2.name").is_some_and(|t| t.iter().all(|text| text == "j1")), "the texts")?;
        let several = read(&path, &Wanted::numbers(["effort"])).map(drop).unwrap_err().to_string();
        check(several.contains("more than one topic (/arm/joint1, /arm/joint2): write topic.column"), &several)?;
        let apart = Wanted::numbers(["/arm/joint1.effort", "/arm/joint2.effort"]);
        let apart = read(&path, &apart).map(drop).unwrap_err().to_string();
        check(apart.contains("no topic has all of the columns"), &apart)?;
    }
    Ok(())
}

fn pyarrow_written(python: &Path) -> Result<(), Failed> {
    let folder = tempfile::tempdir()?;
    run(
        python,
        folder.path(),
        r#"
import pyarrow as pa, pyarrow.parquet as pq
rows = range(3000)
table = pa.table({
    "effort": pa.array([None if row % 10 == 4 else (row - 1500) / 7 for row in rows]),
    "single": pa.array([row / 4 for row in rows], pa.float32()),
    "count": pa.array(list(rows), pa.uint32()),
    "large": pa.array([2**31 + row for row in rows], pa.uint32()),
    "at": pa.array([1000 * row for row in rows], pa.timestamp("us")),
    "on": pa.array([row % 2 == 0 for row in rows]),
    "state": pa.array(["run" if row % 3 else None for row in rows]),
    "group": pa.array([{"q": row / 8} for row in rows]),
})
pq.write_table(table, "default.parquet")
pq.write_table(table, "rows.parquet", row_group_size=700, data_page_version="2.0")
pq.write_table(table, "plain.parquet", use_dictionary=False, compression="none", version="1.0", store_schema=False)
pq.write_table(table, "zstd.parquet", compression="zstd", data_page_size=4096)
"#,
    )?;
    for name in ["default.parquet", "rows.parquet", "plain.parquet", "zstd.parquet"] {
        let names = ["effort", "single", "count", "large", "at", "on", "group.q"];
        let mut wanted = Wanted::numbers(names);
        wanted.texts.insert("state".into());
        let back = read(&folder.path().join(name), &wanted)?;
        let rules: [fn(usize) -> f64; 7] = [
            effort,
            |row| row as f64 / 4.0,
            |row| row as f64,
            |row| (2_147_483_648 + row as u64) as f64,
            |row| 1000.0 * row as f64,
            |row| f64::from(row % 2 == 0),
            |row| row as f64 / 8.0,
        ];
        for (column, rule) in names.iter().zip(rules) {
            let expected: Vec<f64> = (0..ROWS).map(rule).collect();
            same(&format!("{name}: {column}"), back.number(column).unwrap_or_default(), &expected)?;
        }
        let texts = back.text("state").ok_or("no texts")?;
        check(texts.iter().enumerate().all(|(row, text)| text == if row % 3 > 0 { "run" } else { "" }), "texts")?;
    }
    Ok(())
}

fn pyarrow_other_types(python: &Path) -> Result<(), Failed> {
    let folder = tempfile::tempdir()?;
    run(
        python,
        folder.path(),
        r#"
import decimal, pyarrow as pa, pyarrow.parquet as pq
pq.write_table(pa.table({
    "list": pa.array([[1.0, 2.0], [3.0]]),
    "decimal": pa.array([decimal.Decimal("1.5"), decimal.Decimal("2.5")]),
    "text": pa.array(["1", "2"]),
}), "types.parquet")
pq.write_table(pa.table({"a": pa.array([1.0, 2.0])}), "gzip.parquet", compression="gzip")
"#,
    )?;
    let path = folder.path().join("types.parquet");
    for (column, found) in [("list.list.element", "in a list"), ("decimal", "DECIMAL"), ("text", "BYTE_ARRAY")] {
        let error = read(&path, &Wanted::numbers([column])).map(drop).unwrap_err().to_string();
        check(error.contains(&format!("column {column:?}: type ")) && error.contains(found), &error)?;
    }
    // A compression that is not compiled in is told, not a defect of the file.
    let error = read(&folder.path().join("gzip.parquet"), &Wanted::numbers(["a"])).map(drop).unwrap_err().to_string();
    check(error.contains("gzip.parquet") && error.to_lowercase().contains("gzip"), &error)
}

/// Rerun's own command reads a log, without a window; the script gets what it made of it, as chunks by entity.
fn rerun(python: &Path, folder: &Path, arguments: &str, script: &str) -> Result<(), Failed> {
    let read = format!(
        r#"
import os, subprocess, sys
import rerun.chunk
subprocess.run([os.path.join(os.path.dirname(sys.executable), "rerun"), {arguments}], check=True,
               env=dict(os.environ, RERUN_ANALYTICS="0", HOME=os.getcwd()), capture_output=True)
chunks = {{}}
for chunk in rerun.chunk.RrdReader("shown.rrd").stream().to_chunks():
    chunks.setdefault(chunk.entity_path, []).append(chunk.to_record_batch())
def values(entity, name):
    found = [batch for batch in chunks[entity] if name in batch.schema.names]
    return [value for batch in found for value in batch.column(name).to_pylist()]
{script}"#
    );
    run(python, folder, &read).map(drop)
}

fn rerun_parquet(python: &Path) -> Result<(), Failed> {
    let folder = tempfile::tempdir()?;
    std::fs::write(folder.path().join("log.parquet"), encode(&table(), Format::Parquet, "", 0)?)?;
    rerun(
        python,
        folder.path(),
        r#""log.parquet", "--save", "shown.rrd""#,
        r#"
assert values("/time", "s") == [[row / 250] for row in range(3000)]
expected = [[None] if row % 10 == 4 else [(row - 1500) / 7] for row in range(3000)]
assert values("/effort", "Nm") == expected, values("/effort", "Nm")[:8]
"#,
    )
}

fn rerun_mcap(python: &Path) -> Result<(), Failed> {
    let folder = tempfile::tempdir()?;
    std::fs::write(folder.path().join("log.mcap"), encode(&table(), Format::Mcap, "/joint5", START)?)?;
    rerun(
        python,
        folder.path(),
        r#""mcap", "convert", "log.mcap", "-o", "shown.rrd""#,
        r#"
import datetime, json
messages = [json.loads(bytes(data[0])) for data in values("/joint5", "McapMessage:data")]
assert [message["time_s"] for message in messages] == [row / 250 for row in range(3000)]
start = datetime.datetime(2023, 11, 14, 22, 13, 20)
expected = [start + datetime.timedelta(milliseconds=4 * row) for row in range(3000)]
assert values("/joint5", "message_log_time") == expected, values("/joint5", "message_log_time")[:3]
"#,
    )
}
