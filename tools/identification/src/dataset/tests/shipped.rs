//! The descriptions that come with the program, and the example of the reference.

use super::*;
use crate::dataset::parse;
use std::f64::consts::FRAC_PI_2;

fn shipped() -> Vec<PathBuf> {
    let mut found: Vec<PathBuf> =
        std::fs::read_dir(shipped_folder()).unwrap().map(|entry| entry.unwrap().path()).collect();
    found.sort();
    found
}

#[test]
fn every_shipped_description_is_valid() {
    assert!(shipped().len() >= 11);
    for path in shipped() {
        parse(&std::fs::read_to_string(&path).unwrap(), &path).unwrap();
    }
}

/// The fenced blocks of a language in the reference.
fn blocks(language: &str) -> Vec<String> {
    let reference = include_str!("../../../../../docs/dataset.md");
    let fence = format!("```{language}\n");
    reference.split(&fence).skip(1).filter_map(|after| after.split("```").next()).map(str::to_owned).collect()
}

#[test]
fn the_example_of_the_reference_prepares_a_recording_of_its_form() {
    let [description] = &blocks("toml")[..] else { panic!("the reference has one example") };
    let header = blocks("csv").concat().lines().next().unwrap().to_owned();
    assert_eq!(header, "t_ms,angle_deg,torque_mNm,temperature_C,state");
    let mut csv = header + "\n";
    for i in 0..6000 {
        let t = f64::from(i) * 0.005;
        writeln!(csv, "{},{},{},31,run", 5 * i, 90.0 * t.sin(), 800.0 * t.cos()).unwrap();
    }
    let folder = Folder::new()
        .with("set.toml", description)
        .with("slow.csv", &csv)
        .with("fast.csv", &csv)
        .with("runs.csv", "run,payload_kg,lever_m\nslow.csv,0.5,0.2\nfast.csv,1.5,0.2\n");
    let prepared = folder.prepare().unwrap();
    assert!((prepared.samples.position.iter().fold(0.0, |m: f64, q| m.max(*q)) - FRAC_PI_2).abs() < 1e-3);
    assert_eq!(prepared.test_sets[0].name, "heavy payload");
}

/// The keys that a table of the description knows: those that the error about an unknown one lists.
fn keys_of(table: &str) -> Vec<String> {
    let message = parse(&format!("{table}unknown_key = 1\n"), Path::new("set.toml")).unwrap_err().to_string();
    let (_, listed) = message.split_once("unknown field `unknown_key`, expected").unwrap();
    listed.split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

#[test]
fn the_reference_names_every_key() {
    let reference = include_str!("../../../../../docs/dataset.md");
    for (table, prefix) in [
        ("", ""),
        ("[source]\n", "source."),
        ("[columns]\n", "columns."),
        ("[columns.time]\n", "columns.time."),
        ("[columns.position]\n", "columns.position."),
        ("[columns.velocity]\n", "columns.velocity."),
        ("[columns.effort]\n", "columns.effort."),
        ("[select]\n", "select."),
        ("[[select.keep]]\n", ""),
        ("[clean]\n", "clean."),
        ("[[clean.jump]]\n", ""),
        ("[[clean.steady]]\n", ""),
        ("[[clean.frozen]]\n", ""),
        ("[[clean.saturation]]\n", ""),
        ("[filter]\n", "filter."),
        ("[filter.position]\n", ""),
        ("[filter.decimate]\n", "filter.decimate."),
        ("[differentiate]\n", "differentiate."),
        ("[classify]\n", "classify."),
        ("[rigid]\n", "rigid."),
        ("[split]\n", "split."),
        ("[choice]\n", "choice."),
        ("[split.validation]\n", ""),
        ("[split.validation.blocks]\n", "blocks."),
        ("[split.validation.fraction]\n", "fraction."),
    ] {
        let keys = keys_of(table);
        assert!(!keys.is_empty());
        for key in keys {
            assert!(reference.contains(&format!("`{prefix}{key}`")), "`{prefix}{key}` is not in docs/dataset.md");
        }
    }
}
