//! A data set is the same in CSV, MCAP and Parquet: it fits to the same image, and its defects are told alike.

use friction_compensation::parameters::image::MAX_LENGTH;
use identification::dataset::{Prepared, prepare_with};
use identification::fit::{Options, fit};
use identification::presets::Preset;
use identification::progress::Silent;
use logs::{Format, Table, Texts, encode};
use std::fmt::Write;
use std::path::{Path, PathBuf};

const FILES: [&str; 3] = ["log.csv", "log.mcap", "log.parquet"];
/// Missing in the column of the temperature.
const MISSING: usize = 700;

const DESCRIPTION: &str = r#"
name = "one joint"

[source]
files = ["FILE"]
runs = "RUNS"

[columns]
run = "run"
time = { column = "time_s" }
position = { column = "position_rad" }
velocity = { column = "velocity_rad_s" }
effort = { column = "torque_Nm", unit = "Nm" }
temperature = { column = "temperature_C" }

[clean]
missing_text = ["nan"]

[split]
test = [{ name = "last", where = [{ column = "place", equals = "lab" }] }]

[choice]
group_by = ["part"]
"#;

/// Two runs of 40 s at 250 Hz of a joint with 0.2 kg m^2, Coulomb friction of 1.5 Nm and 0.4 Nms/rad.
fn table() -> Table {
    let mut columns: [Vec<f64>; 5] = Default::default();
    let (mut run, mut part) = (Texts::default(), Texts::default());
    for row in 0..20_000 {
        let label = row / 10_000;
        let time = (row % 10_000) as f64 * 0.004;
        let (mut q, mut v, mut a) = (0.0, 0.0, 0.0);
        for (amplitude, rate) in [(0.5, 1.1), (0.2, 2.9), (0.05, 7.3)] {
            let phase: f64 = rate * time + label as f64;
            q += amplitude * phase.sin();
            v += amplitude * rate * phase.cos();
            a -= amplitude * rate * rate * phase.sin();
        }
        let noise = ((row * 7_919 % 10_007) as f64 / 10_007.0 - 0.5) * 0.02;
        let torque = 0.2 * a + 1.5 * (v / 0.05).tanh() + 0.4 * v + noise;
        let temperature = if row == MISSING { f64::NAN } else { 25.0 + time / 30.0 };
        for (column, value) in columns.iter_mut().zip([time, q, v, torque, temperature]) {
            column.push(value);
        }
        run.push(["0", "1"][label]);
        part.push(["a", "b", "c", "d", "e"][row % 10_000 / 2_000]);
    }
    let names = ["time_s", "position_rad", "velocity_rad_s", "torque_Nm", "temperature_C"];
    let mut table = Table::of_numbers(names.into_iter().zip(columns));
    table.texts = vec![("run".into(), run), ("part".into(), part)];
    table
}

/// The runs: one row each.
fn runs() -> Table {
    let column = |words: [&str; 2]| words.into_iter().collect::<Texts>();
    let texts = vec![("run".to_owned(), column(["0", "1"])), ("place".to_owned(), column(["hall", "lab"]))];
    Table { texts, ..Table::default() }
}

fn csv(table: &Table) -> Vec<u8> {
    let names: Vec<&str> =
        table.numbers.iter().map(|(n, _)| n.as_str()).chain(table.texts.iter().map(|(n, _)| n.as_str())).collect();
    let mut text = names.join(",") + "\n";
    for row in 0..table.rows() {
        for (_, values) in &table.numbers {
            let _ = if values[row].is_nan() { write!(text, "nan,") } else { write!(text, "{},", values[row]) };
        }
        let words = table.texts.iter().map(|(_, texts)| texts.words[texts.codes[row] as usize].as_str());
        text += &words.collect::<Vec<_>>().join(",");
        text.push('\n');
    }
    text.into_bytes()
}

/// Writes table and runs in the format that the name says, and the description of them. Runs have no times: those of an
/// MCAP are Parquet.
fn write(folder: &Path, file: &str, table: &Table, description: &str) -> PathBuf {
    let bytes = |table: &Table, file: &str| match Format::of(Path::new(file)) {
        Some(format) => encode(table, format, "/joint", 1_700_000_000_000_000_000).unwrap(),
        None => csv(table),
    };
    let per_run = if file == "log.csv" { "runs.csv" } else { "runs.parquet" };
    std::fs::write(folder.join(file), bytes(table, file)).unwrap();
    std::fs::write(folder.join(per_run), bytes(&runs(), per_run)).unwrap();
    let described = folder.join(format!("{file}.toml"));
    std::fs::write(&described, description.replace("FILE", file).replace("RUNS", per_run)).unwrap();
    described
}

fn prepared(path: &Path) -> Prepared {
    prepare_with(path, &|_| None).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn csv_mcap_and_parquet_fit_to_the_same_image_byte_for_byte() {
    let folder = tempfile::tempdir().unwrap();
    let options = Options { presets: vec![Preset::CoulombViscous], trainer: None, ..Options::default() };
    let [csv, mcap, parquet] = FILES.map(|file| {
        let mut prepared = prepared(&write(folder.path(), file, &table(), DESCRIPTION));
        let mut image = fit(&mut prepared, &options, &Silent).unwrap().image;
        assert_eq!(image.data_hash, prepared.sha256[..16], "{file}");
        // The digest is that of the files' bytes, and tells which file it was.
        image.data_hash = [0; 16];
        let mut bytes = [0; MAX_LENGTH];
        let length = image.encode(&mut bytes).unwrap();
        (bytes[..length].to_vec(), prepared.samples.effort.len(), prepared.sha256)
    });
    assert!(csv.0 == mcap.0 && csv.0 == parquet.0, "the images differ");
    assert_eq!((csv.1, csv.1), (mcap.1, parquet.1));
    assert!(csv.2 != mcap.2 && csv.2 != parquet.2 && mcap.2 != parquet.2, "the digests are of the files");
}

#[test]
fn a_missing_value_that_nobody_named_and_an_unknown_column_are_told_with_file_row_and_column() {
    let folder = tempfile::tempdir().unwrap();
    for file in FILES {
        let unnamed = DESCRIPTION.replace("missing_text = [\"nan\"]", "");
        let error = prepare_with(&write(folder.path(), file, &table(), &unnamed), &|_| None).unwrap_err().to_string();
        // A row is a line behind the header, which a log does not have.
        let place = if file == "log.csv" { MISSING + 2 } else { MISSING + 1 };
        let expected = format!("{file} line {place}, column \"temperature_C\": ");
        assert!(error.contains(&expected) && error.contains("clean.missing_text"), "{error}");
        let unknown = DESCRIPTION.replace("\"torque_Nm\"", "\"torque\"");
        let error = prepare_with(&write(folder.path(), file, &table(), &unknown), &|_| None).unwrap_err().to_string();
        assert!(error.contains(&format!("{file}: no column \"torque\"; available: ")), "{error}");
        // Columns of the table of runs are among those that are available.
        assert!(error.contains("torque_Nm") && error.contains("place"), "{error}");
    }
}
