//! Tables come back as they were written, bit by bit, in both formats.

use logs::{Format, LogError, Table, Texts, Wanted, encode, read};
use proptest::prelude::*;
use std::path::{Path, PathBuf};

const FORMATS: [Format; 2] = [Format::Mcap, Format::Parquet];

fn file(folder: &Path, format: Format) -> PathBuf {
    folder.join(match format {
        Format::Mcap => "log.mcap",
        Format::Parquet => "log.parquet",
    })
}

fn write(folder: &Path, format: Format, table: &Table) -> PathBuf {
    let path = file(folder, format);
    std::fs::write(&path, encode(table, format, "/joint", 1_700_000_000_123_456_789).unwrap()).unwrap();
    path
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|value| value.to_bits()).collect()
}

fn times(rows: usize) -> Vec<f64> {
    (0..rows).map(|row| row as f64 * 0.004).collect()
}

#[test]
fn more_rows_than_a_batch_come_back_with_texts_and_missing_values() {
    let rows = 20_000;
    let effort: Vec<f64> =
        (0..rows).map(|row| if row % 7 == 3 { f64::NAN } else { (row as f64).sin() / 3.0 }).collect();
    let state: Texts = (0..rows).map(|row| if row % 100 < 50 { "run" } else { "reverse" }).collect();
    let mut table = Table::of_numbers([("time_s", times(rows)), ("effort_Nm", effort.clone())]);
    table.texts.push(("state".into(), state.clone()));
    let folder = tempfile::tempdir().unwrap();
    for format in FORMATS {
        let path = write(folder.path(), format, &table);
        let mut wanted = Wanted::numbers(["effort_Nm"]);
        wanted.texts.insert("state".into());
        let back = read(&path, &wanted).unwrap();
        assert_eq!((back.numbers.len(), back.texts.len(), back.rows()), (1, 1, rows), "{format:?}");
        assert_eq!(bits(back.number("effort_Nm").unwrap()), bits(&effort), "{format:?}");
        assert_eq!(back.text("state").unwrap(), &state, "{format:?}");
        let mut columns = logs::columns(&path).unwrap();
        columns.sort();
        assert_eq!(columns, ["effort_Nm", "state", "time_s"], "{format:?}");
    }
}

#[test]
fn numbers_are_texts_where_texts_are_wanted() {
    let folder = tempfile::tempdir().unwrap();
    let table = Table::of_numbers([("time_s", times(3)), ("run", vec![0.0, 1.0, 2.5])]);
    for format in FORMATS {
        let path = write(folder.path(), format, &table);
        let wanted = Wanted { numbers: [].into(), texts: ["run".to_owned()].into() };
        let back = read(&path, &wanted).unwrap();
        assert_eq!(back.text("run").unwrap().iter().collect::<Vec<_>>(), ["0", "1", "2.5"], "{format:?}");
    }
}

#[test]
fn the_same_table_gives_the_same_bytes() {
    let table = Table::of_numbers([("time_s", times(3_000)), ("a", times(3_000))]);
    for format in FORMATS {
        assert_eq!(encode(&table, format, "/a", 5).unwrap(), encode(&table, format, "/a", 5).unwrap());
    }
}

#[test]
fn tables_that_are_no_table_are_not_written() {
    let uneven = Table::of_numbers([("time_s", times(3)), ("a", times(2))]);
    let twice = Table::of_numbers([("time_s", times(3)), ("time_s", times(3))]);
    for format in FORMATS {
        let error = encode(&uneven, format, "/a", 0).unwrap_err().to_string();
        assert_eq!(error, "table: column \"a\": 2 rows, the first column has 3");
        assert!(encode(&twice, format, "/a", 0).unwrap_err().to_string().contains("a second column of this name"));
    }
    let untimed = Table::of_numbers([("a", times(3))]);
    assert!(matches!(encode(&untimed, Format::Mcap, "/a", 0), Err(LogError::Shape { .. })));
    let early = Table::of_numbers([("time_s", vec![0.0, -1e-9])]);
    let error = encode(&early, Format::Mcap, "/a", 0).unwrap_err().to_string();
    assert!(error.contains("-0.000000001 s in row 2: expected 0 to 9e9"), "{error}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    /// Every finite number, subnormal ones and both zeros among them.
    #[test]
    fn every_number_comes_back_bit_by_bit(values in prop::collection::vec(any::<f64>(), 1..40)) {
        let values: Vec<f64> = values.into_iter().map(|v| if v.is_finite() { v } else { f64::NAN }).collect();
        let folder = tempfile::tempdir().unwrap();
        let table = Table::of_numbers([("time_s", times(values.len())), ("v", values.clone())]);
        for format in FORMATS {
            let path = write(folder.path(), format, &table);
            let back = read(&path, &Wanted::numbers(["v", "time_s"])).unwrap();
            prop_assert_eq!(bits(back.number("v").unwrap()), bits(&values));
            prop_assert_eq!(bits(back.number("time_s").unwrap()), bits(&times(values.len())));
        }
    }
}
