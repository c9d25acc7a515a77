//! Every defect of the input is refused with a message that says where it is, what was found and what was expected.

use super::*;
use flate2::{Compression, write::GzEncoder};
use std::io::Write;

/// The error's message; each of `parts` must be in it.
fn refused(result: Result<Prepared, DatasetError>, parts: &[&str]) {
    let message = result.expect_err("the input has a defect").to_string();
    for part in parts {
        assert!(message.contains(part), "{part:?} is not in: {message}");
    }
}

fn described(from: &str, to: &str) -> String {
    assert!(DESCRIPTION.contains(from));
    DESCRIPTION.replace(from, to)
}

fn with(tables: &str) -> String {
    format!("{DESCRIPTION}{tables}")
}

#[test]
fn a_missing_description_or_file_is_named() {
    refused(prepare_with(Path::new("/nowhere/set.toml"), &|_| None), &["/nowhere/set.toml", "cannot be read"]);
    refused(Folder::new().with("set.toml", DESCRIPTION).prepare(), &["joint.csv", "cannot be read"]);
}

#[test]
fn toml_that_cannot_be_read_is_shown_with_line_and_column() {
    refused(prepare("name = \"x\"\nfiles = [1,,2]\n", ""), &["set.toml", "line 2, column"]);
}

#[test]
fn an_unknown_key_is_named_with_those_that_exist() {
    let misspelt = with("[filter]\npositon = { order = 4, cutoff_hz = 10.0 }\n");
    refused(prepare(&misspelt, &joint()), &["set.toml", "unknown field `positon`", "`position`", "line 10"]);
}

#[test]
fn a_missing_key_and_a_wrong_type_are_named() {
    refused(prepare("name = \"x\"", ""), &["missing field `source`"]);
    refused(prepare(&with("[select]\ntrim_start = \"2 s\"\n"), ""), &["line 10", "expected f64"]);
}

#[test]
fn a_missing_column_is_named_with_those_that_exist() {
    let description = described("column = \"q\"", "column = \"angle\"");
    refused(prepare(&description, &joint()), &["joint.csv", "no column \"angle\"", "available: t, q, u, T"]);
}

#[test]
fn a_column_that_exists_twice_is_refused() {
    let csv = joint().replacen("t,q,u,T", "t,q,u,q", 1);
    refused(prepare(DESCRIPTION, &csv), &["joint.csv", "\"q\" appears more than once"]);
}

#[test]
fn text_in_a_number_is_shown_with_file_line_and_column() {
    let csv = joint_with_field(17, 1, "broken");
    refused(prepare(DESCRIPTION, &csv), &["joint.csv line 17", "column \"q\"", "\"broken\"", "a number"]);
    let empty = joint_with_field(18, 2, "");
    refused(prepare(DESCRIPTION, &empty), &["joint.csv line 18", "column \"u\"", "\"\"", "a number"]);
}

#[test]
fn nan_and_infinity_are_refused() {
    for text in ["NaN", "nan", "inf", "-Infinity", "1e999"] {
        let csv = joint_with_field(300, 2, text);
        refused(prepare(DESCRIPTION, &csv), &["joint.csv line 300", "column \"u\"", text, "finite number"]);
    }
}

#[test]
fn time_that_runs_backwards_is_shown_with_its_line_and_both_times() {
    let csv = joint_with_field(500, 0, "3.5");
    refused(prepare(DESCRIPTION, &csv), &["joint.csv line 500", "time 3.5 s after 4.97 s", "run \"joint.csv\""]);
}

#[test]
fn a_constant_signal_is_named_with_its_column_and_value() {
    let still = joint_with(|_, [t, _, u, temperature]| Some([t, 0.25, u, temperature]));
    refused(prepare(DESCRIPTION, &still), &["position", "column \"q\"", "0.25", "2000 samples"]);
    let slack = joint_with(|_, [t, q, _, temperature]| Some([t, q, 0.0, temperature]));
    refused(prepare(DESCRIPTION, &slack), &["effort", "column \"u\"", "2000 samples"]);
    let velocity = described("effort =", "velocity = { column = \"T\" }\neffort =");
    refused(prepare(&velocity, &joint()), &["velocity", "column \"T\"", "30"]);
}

#[test]
fn too_few_samples_are_counted() {
    let short = joint_with(|i, row| (i < 60).then_some(row));
    refused(prepare(DESCRIPTION, &short), &["60 usable samples", "at least 100"]);
    let unused = with("[select]\nminimum_speed = 0.9999\n");
    refused(prepare(&unused, &joint()), &["usable samples", "after cleaning and selection", "at least 100"]);
    let everything_missing = with("[clean]\ndropout = [{ column = \"T\", equals = 30 }]\n");
    refused(prepare(&everything_missing, &joint()), &["0 usable samples", "after cleaning"]);
}

#[test]
fn a_split_that_leaves_a_part_empty_names_it() {
    let all = with("[split]\ntest = [{ name = \"all\", files = [\"joint.csv\"] }]\n");
    refused(prepare(&all, &joint()), &["training", "2000 usable samples"]);
    let none = with("[split]\ntest = [{ name = \"hot\", where = [{ column = \"T\", inside = [50, 90] }] }]\n");
    refused(prepare(&none, &joint()), &["test set \"hot\"", "[split]"]);
    let no_validation = with("[split]\nvalidation = { runs = [\"another\"] }\n");
    refused(prepare(&no_validation, &joint()), &["validation"]);
}

#[test]
fn a_signal_beyond_the_number_format_is_named_with_value_and_limit() {
    let counts = joint_with(|_, [t, q, u, temperature]| Some([t, 40_000.0 * q, u, temperature]));
    refused(prepare(DESCRIPTION, &counts), &["position", "column \"q\"", "3999", "32000", "columns.position.scale"]);
    let scaled = described("column = \"q\"", "column = \"q\", scale = 0.000025");
    assert!(prepare(&scaled, &counts).is_ok());
}

#[test]
fn a_cut_off_beyond_nyquist_is_shown_with_the_nyquist_frequency() {
    let filter = with("[filter]\neffort = { order = 4, cutoff_hz = 60.0 }\n");
    refused(prepare(&filter, &joint()), &["filter.effort", "60", "Nyquist frequency of 50", "\"joint.csv\""]);
}

#[test]
fn values_that_make_no_sense_are_refused_before_a_file_is_read() {
    let cases: [(&str, &[&str]); 12] = [
        ("[filter]\nposition = { order = 0, cutoff_hz = 5.0 }", &["filter.position.order = 0", "1 to 12"]),
        ("[filter]\nposition = { order = 2 }", &["filter.position", "cutoff_hz or cutoff_nyquist"]),
        ("[filter]\nposition = { order = 2, cutoff_nyquist = 1.5 }", &["cutoff_nyquist = 1.5", "less than 1"]),
        ("[filter]\ndecimate = { factor = 0 }", &["filter.decimate.factor = 0"]),
        ("[clean]\nmax_gap = -1.0", &["clean.max_gap = -1", "greater than 0"]),
        ("[clean]\ndropout = [{ column = \"q\" }]", &["clean.dropout = q", "outside"]),
        (
            "[select]\nuse = [{ column = \"q\", in = [1, \"a\"] }]",
            &["select.use", "list of numbers or a list of texts"],
        ),
        ("[select]\ntime = [5.0, 1.0]", &["select.time = [5, 1]"]),
        ("[rigid]\nback_emf = true", &["rigid.back_emf", "\"V\""]),
        ("[rigid]\nmass_and_length = true", &["rigid.mass_and_length", "columns.extra"]),
        ("[split]\ntest = [{ files = [\"joint.csv\"] }]", &["split.test.name", "a name"]),
        (
            "[split]\ntest = [{ name = \"a\", files = [\"b.csv\"] }]",
            &["split.test \"a\".files = b.csv", "source.files"],
        ),
    ];
    for (tables, parts) in cases {
        refused(Folder::new().with("set.toml", with(tables)).prepare(), parts);
    }
}

#[test]
fn a_ragged_row_is_shown_with_its_line() {
    let csv = joint().replacen("\n0.05,", "\n0.05,7,", 1);
    refused(prepare(DESCRIPTION, &csv), &["joint.csv line 7", "5 fields, expected 4"]);
}

#[test]
fn a_file_without_rows_is_refused() {
    refused(prepare(DESCRIPTION, "t,q,u,T\n"), &["joint.csv", "no rows"]);
    refused(prepare(DESCRIPTION, ""), &["joint.csv"]);
}

#[test]
fn a_damaged_gzip_file_is_refused() {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(joint().as_bytes()).unwrap();
    let whole = encoder.finish().unwrap();
    let description = described("joint.csv", "joint.csv.gz");
    let folder = |bytes: &[u8]| Folder::new().with("set.toml", &description).with("joint.csv.gz", bytes);
    assert!(folder(&whole).prepare().is_ok());
    refused(folder(&whole[..whole.len() / 2]).prepare(), &["joint.csv.gz", "not a whole gzip file"]);
    let mut changed = whole.clone();
    let middle = changed.len() / 2;
    changed[middle] ^= 0x55;
    refused(folder(&changed).prepare(), &["joint.csv.gz", "not a whole gzip file"]);
    refused(folder(joint().as_bytes()).prepare(), &["joint.csv.gz", "not a whole gzip file"]);
}

#[test]
fn an_environment_variable_that_is_not_set_is_named() {
    let description = described("[source]", "[source]\nroot = \"$MY_DATA/here\"");
    refused(prepare(&description, &joint()), &["$MY_DATA/here", "environment variable MY_DATA is not set"]);
}

#[test]
fn a_run_must_have_exactly_one_row_in_the_table_of_runs() {
    let description = described("files =", "runs = \"runs.csv\"\nfiles =")
        .replace("[columns]", "[columns]\nextra = { mass = \"kg\" }");
    let folder =
        |runs: &str| Folder::new().with("set.toml", &description).with("joint.csv", joint()).with("runs.csv", runs);
    assert!(folder("run,kg\njoint.csv,1.5\n").prepare().is_ok());
    refused(folder("run,kg\nother.csv,1.5\n").prepare(), &["runs.csv", "no row for run \"joint.csv\""]);
    let twice = "run,kg\njoint.csv,1.5\njoint.csv,1.6\n";
    refused(folder(twice).prepare(), &["runs.csv", "more than one row for run \"joint.csv\""]);
    refused(folder("label,kg\njoint.csv,1.5\n").prepare(), &["runs.csv", "no column \"run\""]);
}
