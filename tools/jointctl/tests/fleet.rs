//! `jointctl fleet` on a virtual fleet: the page and the table name the joints that changed, and new images are kept
//! where they are better.

#[path = "../../fleet/tests/fleet_of_joints/mod.rs"]
mod fleet_of_joints;
mod tables;

use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output};

fn ran(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_jointctl")).current_dir(folder).args(arguments).output().unwrap()
}

fn jointctl(folder: &Path, arguments: &[&str]) -> Output {
    let output = ran(folder, arguments);
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {error}");
    output
}

fn json(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn the_page_names_what_changed_and_only_better_images_are_kept() {
    let folder = tempfile::tempdir().unwrap();
    fleet_of_joints::write(&folder.path().join("fleet"));

    let status = jointctl(folder.path(), &["fleet", "status", "fleet", "--page", "fleet.html"]);
    let text = String::from_utf8_lossy(&status.stdout).into_owned();
    assert!(text.contains("400 partitions: 400 summed up, 0 known, 6 bad; 0 misplaced"), "{text}");
    let errors = String::from_utf8_lossy(&status.stderr).into_owned();
    assert!(errors.contains("joint=j02/day=2026-01-04 is left out: "), "{errors}");
    let page = std::fs::read_to_string(folder.path().join("fleet.html")).unwrap();
    let line = |number: usize| tables::OF_A_FLEET[number].split(' ').collect::<Vec<_>>();
    let sums = jointctl(folder.path(), &line(0));
    tables::assert_is_table(tables::OF_A_FLEET[0], &sums);
    let told = json(&jointctl(folder.path(), &line(1)));
    assert!(told.to_string().contains("j11"), "{told}");
    let named = [("j11", "drifted"), ("j23", "friction fell"), ("j29", "broken"), ("j35", "wrong configuration")];
    for (joint, words) in named {
        let line = text.lines().find(|line| line.starts_with(joint)).unwrap();
        assert!(line.contains(words) && line.contains("2026-01-06"), "{line}");
        assert!(page.contains(&format!("<td>{joint}</td><td>{words}</td><td>2026-01-06</td>")), "{joint}");
    }
    assert!(page.contains("8 of 40 joints have a finding") && page.contains("color-mix"), "the page");

    jointctl(folder.path(), &["key", "new", "fleet.key"]);
    let outcomes = json(&jointctl(folder.path(), &line(2)));
    let outcome = |outcomes: &Value, joint: &str| {
        let joints = outcomes["joints"].as_array().unwrap();
        joints.iter().find(|outcome| outcome["joint"] == joint).unwrap_or_else(|| panic!("{joint}: {outcomes}")).clone()
    };
    for joint in ["j11", "j17", "j23"] {
        let found = outcome(&outcomes, joint);
        let [before, after] = ["before_nm", "after_nm"].map(|key| found[key].as_f64().unwrap());
        println!("{joint}: {before:.4} to {after:.4} Nm");
        assert!(found["kept"] == true && after < 0.98 * before && found["version"] == 2, "{found}");
        let verified = jointctl(folder.path(), &["image", "verify", &format!("new/{joint}/friction.img")]);
        assert!(!verified.stdout.is_empty());
    }
    for joint in outcomes["joints"].as_array().unwrap() {
        let there = folder.path().join("new").join(joint["joint"].as_str().unwrap()).join("friction.img").exists();
        assert_eq!(joint["kept"], there, "{joint}");
    }

    let signed = ["image", "verify", "new/j11/friction.signed", "--key", "fleet.key"];
    assert!(!jointctl(folder.path(), &signed).stdout.is_empty());

    let key = jointctl(folder.path(), &["key", "number", "fleet.key"]).stdout;
    let kept: Vec<&Value> =
        outcomes["joints"].as_array().unwrap().iter().filter(|outcome| outcome["kept"] == true).collect();
    let images = |folder: &Path| {
        let listed = json(&jointctl(folder, &line(3)));
        listed["images"].as_array().unwrap().clone()
    };
    let registered = images(folder.path());
    assert_eq!(registered.len(), kept.len());
    for outcome in kept {
        let joint = outcome["joint"].as_str().unwrap();
        let record = registered.iter().find(|record| record["joint"] == joint).unwrap();
        let image = std::fs::read(folder.path().join(format!("new/{joint}/friction.img"))).unwrap();
        assert_eq!(record["image"], fleet::registry::sha256(&image), "{joint}");
        assert_eq!(record["key"], String::from_utf8_lossy(&key).trim(), "{joint}");
        assert_eq!((&record["event"], &record["version"]), (&"made".into(), &outcome["version"]), "{joint}");
        let days = record["days"].as_str().unwrap();
        assert!(days.starts_with("2026-01-0") && days.ends_with(" to 2026-01-08"), "{joint}: {days}");
    }

    // The joints have the new images: another one is no better, and the joints keep what they have.
    let again =
        ["fleet", "retrain", "fleet", "--out", "again", "--images", "new", "--preset", "coulomb-viscous", "--json"];
    let output = ran(folder.path(), &again);
    let outcomes = json(&output);
    let kept = outcomes["joints"].as_array().unwrap().iter().filter(|outcome| outcome["kept"] == true).count();
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(if kept == 0 { 3 } else { 0 }), "{kept} kept: {error}");
    for joint in ["j11", "j17", "j23"] {
        let found = outcome(&outcomes, joint);
        assert!(found["kept"] == false && found["version"] == 2, "{found}");
        assert!(found["reason"].as_str().unwrap().starts_with("not kept: "), "{found}");
        assert!(!folder.path().join("again").join(joint).exists());
    }

    // Where none is kept that is the exit code: of a joint that has changed, and of one that has not.
    for joint in ["j11", "j00"] {
        let one =
            format!("fleet retrain fleet --out none-{joint} --images new --preset coulomb-viscous --joint {joint}");
        let output = ran(folder.path(), &one.split(' ').collect::<Vec<_>>());
        let error = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(3), "{joint}: {error}");
        assert!(error.contains("error: no new image is kept") && output.stdout.starts_with(b"joint "), "{error}");
        assert!(folder.path().join(format!("none-{joint}/retrain.json")).exists());
    }

    // One joint alone, by its stored sums: the same image.
    let one =
        ["fleet", "retrain", "fleet", "--out", "one", "--preset", "coulomb-viscous", "--joint", "j11", "--stored"];
    let before = images(folder.path());
    jointctl(folder.path(), &one);
    let read = |path: &str| std::fs::read(folder.path().join(path).join("j11/friction.img")).unwrap();
    assert_eq!(read("one"), read("new"));
    assert_eq!(images(folder.path()), before);
}
