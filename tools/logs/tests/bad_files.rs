//! Bad files are errors that name file, column and row; whatever stands in a file, reading it ends.

use logs::{Format, LogError, Table, Wanted, encode, read};
use std::path::{Path, PathBuf};

const FORMATS: [(Format, &str); 2] = [(Format::Mcap, "log.mcap"), (Format::Parquet, "log.parquet")];

fn table(rows: usize) -> Table {
    let column = |scale: f64| (0..rows).map(|row| row as f64 * scale).collect::<Vec<_>>();
    Table::of_numbers([("time_s", column(0.004)), ("position_rad", column(0.1))])
}

fn bytes(format: Format) -> Vec<u8> {
    encode(&table(500), format, "/joint", 0).unwrap()
}

fn write(folder: &Path, name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, bytes).unwrap();
    path
}

fn position() -> Wanted {
    Wanted::numbers(["position_rad"])
}

#[test]
fn a_file_that_ends_early_is_refused_wherever_it_ends() {
    let folder = tempfile::tempdir().unwrap();
    for (format, name) in FORMATS {
        let whole = bytes(format);
        for length in (0..whole.len()).step_by(61).chain([whole.len() - 1]) {
            let path = write(folder.path(), name, &whole[..length]);
            let error = read(&path, &position()).expect_err("a part of a file was read");
            assert!(error.to_string().contains(name), "{error}");
        }
        assert_eq!(read(&write(folder.path(), name, &whole), &position()).unwrap().rows(), 500);
    }
}

#[test]
fn a_changed_byte_ends_reading_and_an_mcap_notices_it_among_the_values() {
    let folder = tempfile::tempdir().unwrap();
    for (format, name) in FORMATS {
        let whole = bytes(format);
        let mut refused = 0;
        for place in (0..whole.len()).step_by(7) {
            let mut changed = whole.clone();
            changed[place] ^= 0x55;
            refused += usize::from(read(&write(folder.path(), name, &changed), &position()).is_err());
        }
        // Parquet has checksums of pages only where the writer gives them.
        assert!(refused > 0, "{format:?}");
        if format == Format::Mcap {
            let tried = whole.len().div_ceil(7);
            assert!(20 * refused >= 19 * tried, "{refused} of {tried}");
        }
    }
}

#[test]
fn another_format_is_told_by_name() {
    let folder = tempfile::tempdir().unwrap();
    for (_, name) in FORMATS {
        let path = write(folder.path(), name, b"time_s,position_rad\n0,1\n0.1,2\n0.2,2\n0.3,2\n0.4,2\n0.5,2\n");
        let error = read(&path, &position()).unwrap_err();
        assert!(matches!(error, LogError::Foreign { .. }), "{error}");
        assert!(error.to_string().contains(&format!("{name}: is no ")), "{error}");
    }
    let error = read(Path::new("log.csv"), &position()).unwrap_err().to_string();
    assert_eq!(error, "log.csv: a log's name ends in .mcap or .parquet");
    let error = read(Path::new("nowhere/log.mcap"), &position()).unwrap_err().to_string();
    assert!(error.starts_with("nowhere/log.mcap: cannot be read: "), "{error}");
}

#[test]
fn a_missing_column_is_told_with_those_that_exist() {
    let folder = tempfile::tempdir().unwrap();
    for (format, name) in FORMATS {
        let path = write(folder.path(), name, &bytes(format));
        let error = read(&path, &Wanted::numbers(["time_s", "velocity"])).unwrap_err().to_string();
        assert!(
            error.ends_with("log.mcap: no column \"velocity\"; available: position_rad, time_s")
                || error.ends_with("log.parquet: no column \"velocity\"; available: time_s, position_rad"),
            "{error}"
        );
    }
}

#[test]
fn text_where_numbers_are_wanted_is_told_with_column_and_row() {
    let folder = tempfile::tempdir().unwrap();
    let mut with_text = table(3);
    with_text.texts.push(("state".into(), ["run", "stop", "run"].into_iter().collect()));
    let errors = FORMATS.map(|(format, name)| {
        let path = write(folder.path(), name, &encode(&with_text, format, "/joint", 0).unwrap());
        read(&path, &Wanted::numbers(["state"])).unwrap_err().to_string()
    });
    assert!(errors[0].ends_with("log.mcap row 1, column \"state\": \"run\": expected a number"), "{}", errors[0]);
    assert!(errors[1].ends_with("log.parquet, column \"state\": type BYTE_ARRAY: expected numbers"), "{}", errors[1]);
}

#[test]
fn what_is_not_finite_is_found_by_row_and_column() {
    let mut table = table(5);
    table.numbers[1].1[3] = f64::NAN;
    table.numbers[0].1[4] = f64::INFINITY;
    let error = table.all_finite(Path::new("a.parquet")).unwrap_err().to_string();
    assert_eq!(error, "a.parquet row 4, column \"position_rad\": NaN: expected a finite number");
    table.numbers[1].1[3] = 0.0;
    let error = table.all_finite(Path::new("a.parquet")).unwrap_err().to_string();
    assert_eq!(error, "a.parquet row 5, column \"time_s\": inf: expected a finite number");
    table.numbers[0].1[4] = 0.0;
    table.all_finite(Path::new("a.parquet")).unwrap();
}

#[test]
fn a_table_without_rows_is_told() {
    let folder = tempfile::tempdir().unwrap();
    for (format, name) in FORMATS {
        let path = write(folder.path(), name, &encode(&table(0), format, "/joint", 0).unwrap());
        let error = read(&path, &position()).unwrap_err();
        assert!(matches!(error, LogError::Empty { .. }), "{error}");
    }
}

#[test]
fn the_row_of_a_number_that_is_none_is_told_wherever_it_is() {
    for at in [0, 63, 64, 65, 127, 128, 199] {
        let mut values = vec![1.0; 200];
        values[at] = f64::INFINITY;
        let error = Table::of_numbers([("a", vec![0.0; 200]), ("b", values)]).all_finite(Path::new("a.parquet"));
        let error = error.unwrap_err().to_string();
        assert!(error.contains(&format!("row {},", at + 1)), "{at}: {error}");
    }
}
