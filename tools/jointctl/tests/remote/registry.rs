//! A fleet's registry beside the joints on a bus.

use crate::served::{NODE, Served, image, program};
use fleet::registry::{Event, Identity, Record, append, sha256};
use serde_json::Value;
use std::path::Path;
use std::process::Output;

fn prints(output: &Output, expected: &[&str]) -> String {
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    for expected in expected {
        assert!(text.contains(expected), "{expected} in {text}");
    }
    text
}

fn made(fleet: &Path, joint: &str, image: &[u8], version: u32) {
    let record = Record {
        time_ms: 1_000,
        event: Event::Made,
        joint: joint.into(),
        identity: None,
        version,
        image: sha256(image),
        days: "2026-01-06 to 2026-01-08".into(),
        data: sha256(b"days"),
        key: "00c0ffee".into(),
    };
    append(fleet, &[record]).unwrap();
}

pub fn joints_with_the_registrys_image_with_another_unknown_and_silent_ones_are_told_apart() {
    let port = bus::free_port().unwrap();
    let _served = Served::on(&format!("slcan:listen://127.0.0.1:{port}"), &[NODE]);
    let client = format!("slcan:tcp://127.0.0.1:{port}");
    let desk = tempfile::tempdir().unwrap();
    let fleet = desk.path().join("fleet");
    for joint in ["elbow", "wrist"] {
        std::fs::create_dir_all(fleet.join(format!("joint={joint}"))).unwrap();
    }
    let run = |arguments: &str| {
        let words = arguments.split(' ').chain(["--bus", &client]);
        program().current_dir(&desk).args(words).output().unwrap()
    };
    let (first, second) = (image(1, 0.25, 0), image(2, 0.5, 0));
    std::fs::write(desk.path().join("first.img"), &first).unwrap();
    std::fs::write(desk.path().join("second.img"), &second).unwrap();
    made(&fleet, "elbow", &first, 1);

    let register = "fleet register fleet --joint elbow --node 5";
    let text = prints(&run("fleet status fleet"), &["runs no image; `jointctl fleet register` enters it"]);
    let line = |text: &str, words: &str| text.lines().find(|line| line.contains(words)).unwrap_or_default().to_owned();
    assert!(line(&text, "unknown joint").starts_with("- "), "{text}");
    prints(&run(register), &["joint=elbow: product ", "serial 12, no image: registered"]);
    prints(&run(register), &["no image: in the registry already"]);
    prints(&run("upload first.img --node 5 --commit"), &["version 1 is stored"]);
    let text =
        prints(&run("fleet status fleet"), &["no image in the registry, the joint runs version 1, made for elbow"]);
    assert!(line(&text, "other image").starts_with("elbow "), "{text}");

    prints(&run(register), &[&format!("version 1, SHA-256 {}: registered", sha256(&first))]);
    let wrist = Record {
        time_ms: 2_000,
        event: Event::Runs,
        joint: "wrist".into(),
        identity: Some(Identity { product: 1, serial: 99 }),
        version: 7,
        image: sha256(b"another"),
        days: String::new(),
        data: String::new(),
        key: String::new(),
    };
    append(&fleet, &[wrist]).unwrap();
    made(&fleet, "elbow", &second, 2);
    let told: Value = serde_json::from_slice(&run("fleet status fleet --stored --json").stdout).unwrap();
    let on_the_bus = told["on_the_bus"].as_array().unwrap();
    let verdicts: Vec<_> = on_the_bus
        .iter()
        .map(|line| (line["joint"].as_str(), line["node"].as_u64(), line["verdict"].as_str().unwrap()))
        .collect();
    assert_eq!(verdicts, [(Some("elbow"), Some(5), "same"), (Some("wrist"), None, "silent-joint")], "{told}");
    assert_eq!(on_the_bus[0]["waiting"], 2);
    prints(&run("upload second.img --node 5 --commit"), &["version 2 is stored"]);
    prints(&run("fleet status fleet"), &["version 1 in the registry, the joint runs version 2, made for elbow"]);

    // Beside a file that is none; what a joint runs has the days and the key of the image that was made.
    std::fs::write(fleet.join("_registry/torn.parquet"), "PAR1").unwrap();
    let images = program().current_dir(&desk).args(["fleet", "images", "fleet", "--json"]).output().unwrap();
    assert!(String::from_utf8_lossy(&images.stderr).contains("torn.parquet: "), "{images:?}");
    let listed: Value = serde_json::from_slice(&images.stdout).unwrap();
    let records = listed["images"].as_array().unwrap();
    let events: Vec<_> =
        records.iter().map(|record| (record["event"].as_str().unwrap(), record["version"].as_u64().unwrap())).collect();
    assert_eq!(events, [("made", 1), ("made", 2), ("runs", 7), ("runs", 0), ("runs", 1)], "{listed}");
    let last = &records[4];
    assert_eq!((&last["key"], &last["days"]), (&"00c0ffee".into(), &"2026-01-06 to 2026-01-08".into()));
    let table = program().current_dir(&desk).args(["fleet", "images", "fleet"]).output().unwrap();
    prints(&table, &["1970-01-01 00:00:01", "00c0ffee", "5 records"]);

    let refused = run("fleet register fleet --joint ankle --node 5");
    let text = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(refused.status.code() == Some(2) && text.contains("no folder joint=ankle; --joint takes"), "{text}");
}
