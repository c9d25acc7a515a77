//! Results of a whole preparation of a recording.

use super::*;
use crate::samples::Part;
use sha2::{Digest, Sha256};

fn with(tables: &str) -> String {
    format!("{DESCRIPTION}{tables}")
}

fn note(prepared: &Prepared, what: &str) -> usize {
    prepared.notes.iter().find(|note| note.what == what).map_or(0, |note| note.count)
}

#[test]
fn position_becomes_velocity_and_acceleration_and_every_sample_has_a_part() {
    let prepared = prepare(DESCRIPTION, &joint()).unwrap();
    let s = &prepared.samples;
    assert_eq!(s.len(), 2000);
    for i in 2..1998 {
        assert!((s.velocity[i] - s.time[i].cos()).abs() < 1e-4);
        assert!((s.acceleration[i] + s.time[i].sin()).abs() < 1e-4);
        assert!((s.effort[i] - 2.0 * s.time[i].cos()).abs() < 1e-12);
    }
    assert!(s.temperature.iter().all(|&t| t == 25.0));
    let shares = [Part::Train, Part::Validation, Part::Test, Part::Unused].map(|part| s.indices(part).len());
    assert_eq!(shares, [1000, 400, 600, 0]);
    assert_eq!(prepared.test_sets[0].indices, s.indices(Part::Test));
    assert_eq!(s.state.len(), 2000);
}

#[test]
fn the_same_input_gives_the_same_samples_and_digest_and_another_byte_another_digest() {
    let [a, b] = [(); 2].map(|()| prepare(DESCRIPTION, &joint()).unwrap());
    assert_eq!((a.samples.part, a.sha256), (b.samples.part, b.sha256));
    let digest: [u8; 32] = Sha256::new().chain_update(DESCRIPTION).chain_update(joint()).finalize().into();
    assert_eq!(a.sha256, digest);
    assert_ne!(prepare(&with("# a remark\n"), &joint()).unwrap().sha256, digest);
}

#[test]
fn units_signs_and_products_are_applied() {
    let description = DESCRIPTION
        .replace("column = \"q\"", "column = \"q\", scale = -0.5")
        .replace("column = \"u\", unit = \"Nm\"", "product = [\"u\", \"T\"], unit = \"V\", scale = -0.1")
        .replace("column = \"t\"", "column = \"t\", scale = 2.0")
        .replace("effort =", "temperature = { column = \"T\", scale = 1.5 }\neffort =");
    let s = prepare(&description, &joint()).unwrap().samples;
    for i in [0, 700, 1999] {
        let [t, q, u, temperature] = row(i);
        assert!((s.time[i] - 2.0 * t).abs() < 1e-9 && (s.position[i] + 0.5 * q).abs() < 1e-12);
        assert!((s.effort[i] + 0.1 * u * temperature).abs() < 1e-9 && s.temperature[i] == 45.0);
    }
}

#[test]
fn dropouts_and_jumps_are_bridged_as_if_they_were_not_there() {
    let dirty = joint_with(|i, [t, q, u, temperature]| match i {
        100 | 900 | 901 => Some([t, -3.14006, 0.0, 150.0]),
        500 => Some([t, q + 1.0, u, temperature]),
        _ => Some([t, q, u, temperature]),
    });
    let rules = "[clean]\n\
        dropout = [{ column = \"q\", equals = -3.14006 }, { column = \"T\", outside = [1, 100] }]\n\
        jump = [{ column = \"q\", limit = 0.5 }]\n\
        [filter]\nposition = { order = 4, cutoff_hz = 10.0 }\n";
    let found = prepare(&with(rules), &dirty).unwrap();
    let clean = prepare(&with("[filter]\nposition = { order = 4, cutoff_hz = 10.0 }\n"), &joint()).unwrap();
    assert_eq!(note(&found, "rows missing by a dropout rule"), 3);
    assert_eq!(note(&found, "rows missing by a single-sample jump"), 1);
    assert_eq!(note(&found, "missing rows bridged by interpolation"), 4);
    for (a, b) in found.samples.acceleration.iter().zip(&clean.samples.acceleration) {
        assert!((a - b).abs() < 0.06, "{a} {b}");
    }
    let untreated = prepare(&with(""), &dirty).unwrap();
    assert!(untreated.samples.acceleration.iter().any(|a| a.abs() > 1000.0));
}

#[test]
fn a_row_without_a_value_is_missing_where_the_description_says_so() {
    let description = with("[clean]\nmissing_text = [\"\", \"nan\"]\n");
    let prepared = prepare(&description, &joint_with_field(300, 2, "nan")).unwrap();
    assert_eq!(note(&prepared, "missing rows bridged by interpolation"), 1);
    assert!((prepared.samples.effort[298] - 2.0 * 2.98f64.cos()).abs() < 1e-3);
}

#[test]
fn repeated_times_are_left_out_and_a_gap_begins_another_recording() {
    let csv = joint_with(|i, [t, q, u, temperature]| match i {
        1000..1100 => None,
        _ => Some([if i == 50 { 0.49 } else { t }, q, u, temperature]),
    });
    let prepared = prepare(DESCRIPTION, &csv).unwrap();
    assert_eq!(note(&prepared, "rows with a repeated time left out"), 1);
    assert_eq!(prepared.recordings.len(), 2);
    let second = prepared.samples.run.iter().position(|&run| run == 1).unwrap();
    assert!((prepared.samples.time[second] - 11.0).abs() < 1e-9);
    assert!((prepared.samples.velocity[second] - 11.0f64.cos()).abs() < 0.01);
}

#[test]
fn kept_rows_exist_and_used_rows_count() {
    let csv = joint_with(|i, [t, q, u, _]| Some([t, q, u, if i < 300 { 0.0 } else { 1.0 }]));
    let kept = prepare(&with("[select]\nkeep = [{ column = \"T\", equals = 1 }]\n"), &csv).unwrap();
    assert_eq!((kept.samples.len(), note(&kept, "rows left out")), (1700, 300));
    let used = prepare(&with("[select]\nuse = [{ column = \"T\", equals = 1 }]\n"), &csv).unwrap();
    assert_eq!((used.samples.len(), used.samples.indices(Part::Unused)), (2000, (0..300).collect()));
    let saturated = with("[clean]\nsaturation = [{ column = \"u\", limit = 1.9 }]\n");
    let saturated = prepare(&saturated, &joint()).unwrap().samples;
    for (part, effort) in saturated.part.iter().zip(&saturated.effort) {
        assert_eq!(*part == Part::Unused, effort.abs() >= 1.9);
    }
}

#[test]
fn trimming_and_a_time_range_cut_both_ends_and_a_minimum_speed_the_standstill() {
    let trimmed = prepare(&with("[select]\ntrim_start = 2.0\ntrim_end = 3.0\n"), &joint()).unwrap().samples;
    assert!((trimmed.time[0] - 2.0).abs() < 1e-9 && (trimmed.time[trimmed.len() - 1] - 16.99).abs() < 1e-9);
    let range = prepare(&with("[select]\ntime = [1.0, 9.0]\n"), &joint()).unwrap().samples;
    assert!((range.time[0] - 1.0).abs() < 1e-9 && (range.time[range.len() - 1] - 9.0).abs() < 1e-9);
    let moving = prepare(&with("[select]\nminimum_speed = 0.2\n"), &joint()).unwrap().samples;
    for (part, velocity) in moving.part.iter().zip(&moving.velocity) {
        assert_eq!(*part == Part::Unused, velocity.abs() < 0.2);
    }
}

#[test]
fn a_lagging_effort_is_moved_back_to_its_motion() {
    let lagging = joint_with(|_, [t, q, _, temperature]| Some([t, q, 2.0 * (t - 0.025).cos(), temperature]));
    let s = prepare(&with("[filter]\neffort_lag = 0.025\n"), &lagging).unwrap().samples;
    assert!((0..1990).all(|i| (s.effort[i] - 2.0 * s.time[i].cos()).abs() < 1e-3));
}

#[test]
fn decimation_keeps_the_first_or_the_last_sample_and_its_filter_removes_what_would_alias() {
    let noisy =
        joint_with(|i, [t, q, u, temperature]| Some([t, q, u + if i % 2 == 0 { 0.5 } else { -0.5 }, temperature]));
    let decimated = |keep: &str, anti_alias: bool| {
        let table = format!("[filter]\ndecimate = {{ factor = 7, keep = \"{keep}\", anti_alias = {anti_alias} }}\n");
        prepare(&with(&table), &noisy).unwrap()
    };
    let first = decimated("first", true);
    assert_eq!((first.samples.time[0], first.samples.len()), (0.0, 286));
    assert!((first.recordings[0].period - 0.07).abs() < 1e-12);
    let last = decimated("last", true).samples;
    assert!((last.time[last.len() - 1] - 19.99).abs() < 1e-9);
    let error = |p: &Prepared| {
        let s = &p.samples;
        (30..250).map(|i| (s.effort[i] - 2.0 * s.time[i].cos()).abs()).fold(0.0, f64::max)
    };
    assert!(error(&first) < 0.05, "{}", error(&first));
    assert!(error(&decimated("first", false)) > 0.4);
}

#[test]
fn runs_are_told_apart_and_joined_with_their_own_values() {
    let mut csv = String::from("which,t,q,u,phase\n");
    for i in 0..600 {
        // Rows of two runs alternate in the file.
        for (label, speed) in [("a", 1.0), ("b", 2.0)] {
            let t = f64::from(i) * 0.01;
            let phase = if i < 300 { "hold_up" } else { "step_2" };
            writeln!(csv, "{label},{t},{},{},{phase}", (speed * t).sin(), (speed * t).cos()).unwrap();
        }
    }
    let description = r#"
        name = "two runs"
        [source]
        root = "${JOINT_DATA:-recordings}/today"
        files = ["joint.csv"]
        runs = "runs.csv"
        [columns]
        run = "which"
        time = { column = "t" }
        position = { column = "q" }
        effort = { column = "u", unit = "Nm" }
        extra = { mass = "kg", length = "m" }
        [select]
        use = [{ column = "phase", starts_with = ["hold", "step"] }]
        [rigid]
        gravity = "sin"
        mass_and_length = true
        [split]
        test = [
            { name = "steps of b", where = [{ column = "day", equals = "tuesday" }, { column = "phase", in = ["step_2"] }] },
            { name = "b", runs = ["b"] },
            { name = "a early", unless = [{ column = "day", equals = "tuesday" }], blocks = { length = 1.0, modulo = 6, index = [0] } },
        ]
        validation = { blocks = { length = 1.0, modulo = 3, index = [1] } }
    "#;
    let folder = |root: &str| {
        Folder::new()
            .with("set.toml", description)
            .with(&format!("{root}/today/joint.csv"), &csv)
            .with(&format!("{root}/today/runs.csv"), "which,kg,m,day\na,1.5,0.1,monday\nb,2.5,0.2,tuesday\n")
    };
    let prepared = folder("recordings").prepare().unwrap();
    let s = &prepared.samples;
    assert_eq!(prepared.recordings.iter().map(|r| r.label.as_str()).collect::<Vec<_>>(), ["a", "b"]);
    assert_eq!((s.extra["mass"][0], s.extra["length"][700]), (1.5, 0.2));
    let sets: Vec<(&str, usize)> = prepared.test_sets.iter().map(|t| (t.name.as_str(), t.indices.len())).collect();
    assert_eq!(sets, [("steps of b", 300), ("b", 600), ("a early", 100)]);
    assert_eq!([Part::Train, Part::Validation, Part::Test].map(|p| s.indices(p).len()), [300, 200, 700]);
    assert_eq!(prepared.description.rigid.gravity, crate::dataset::Gravity::Sine);

    let elsewhere = folder("other");
    let other = elsewhere.path("other").to_string_lossy().into_owned();
    let environment = |name: &str| (name == "JOINT_DATA").then(|| other.clone());
    assert!(prepare_with(&elsewhere.path("set.toml"), &environment).is_ok());
    assert!(elsewhere.prepare().is_err());
}

#[test]
fn a_causal_filter_knows_nothing_of_the_future() {
    let step = |at: f64| joint_with(move |_, [t, q, _, temp]| Some([t, q, if t < at { 0.0 } else { 1.0 }, temp]));
    let filter = |zero_phase: bool| {
        let table = format!("[filter]\nzero_phase = {zero_phase}\neffort = {{ order = 2, cutoff_hz = 5.0 }}\n");
        prepare(&with(&table), &step(10.0)).unwrap().samples.effort
    };
    assert!(filter(false)[..1000].iter().all(|&u| u == 0.0));
    assert!(filter(true)[995] > 0.05);
}

#[test]
fn causal_motion_knows_nothing_of_the_future_while_the_effort_has_no_delay() {
    let from = |at: f64| {
        joint_with(move |_, [t, q, u, temp]| Some(if t < at { [t, q, u, temp] } else { [t, q + 0.5, u + 0.5, temp] }))
    };
    let filter = "[filter]\ncausal_motion = true\n\
        position = { order = 2, cutoff_hz = 5.0 }\neffort = { order = 2, cutoff_hz = 5.0 }\n";
    let decimated = format!("{filter}decimate = {{ factor = 2, keep = \"first\", anti_alias = true }}\n");
    for (filter, before) in [(filter, 1000), (decimated.as_str(), 500)] {
        let [changed, whole] = [10.0, 99.0].map(|at| prepare(&with(filter), &from(at)).unwrap().samples);
        assert_eq!(changed.velocity[..before], whole.velocity[..before]);
        assert_eq!(changed.position[..before], whole.position[..before]);
        assert!((changed.effort[before - 1] - whole.effort[before - 1]).abs() > 0.02);
    }
}

#[test]
fn the_observer_sees_a_slow_motion_almost_without_delay_where_a_low_pass_would_be_late() {
    let filter = "[filter]\nposition = { order = 4, cutoff_hz = 3.0 }\n";
    let prepared = prepare(&with(filter), &joint()).unwrap();
    let (name, seen) = prepared.on_other_motion().unwrap();
    let worst = |samples: &crate::samples::Samples| {
        (100..1900).fold(0.0, |w: f64, i| w.max((samples.velocity[i] - samples.time[i].cos()).abs()))
    };
    assert!(name == "joint's observer" && worst(&seen) < 0.01, "{name} {}", worst(&seen));
    assert!(worst(&prepared.samples) < 1e-3 && seen.acceleration == prepared.samples.acceleration);
    let late = prepare(&with(&format!("{filter}zero_phase = false\n")), &joint()).unwrap();
    assert!(late.other.is_none() && worst(&late.samples) > 0.1, "{}", worst(&late.samples));
    let causal = prepare(&with(&format!("{filter}causal_motion = true\n")), &joint()).unwrap();
    let (name, smooth) = causal.on_other_motion().unwrap();
    assert_eq!((name, &smooth.velocity), ("zero-phase motion", &prepared.samples.velocity));
    assert_eq!(causal.samples.velocity, seen.velocity);
}

#[test]
fn a_byte_order_mark_spaces_and_windows_line_ends_do_no_harm() {
    let csv = format!("\u{feff}{}", joint().replace(',', " , ").replace('\n', "\r\n"));
    assert_eq!(prepare(DESCRIPTION, &csv).unwrap().samples.len(), 2000);
    let semicolons = DESCRIPTION.replace("files =", "delimiter = \";\"\nfiles =");
    assert_eq!(prepare(&semicolons, &joint().replace(',', ";")).unwrap().samples.len(), 2000);
}

#[test]
fn decimal_commas_are_read_and_what_is_missing_in_the_description_is_named() {
    let points = prepare(DESCRIPTION, &joint()).unwrap();
    let commas = joint().replace(',', ";").replace('.', ",");
    let semicolons = DESCRIPTION.replace("files =", "delimiter = \";\"\nfiles =");
    let decimal = semicolons.replace("files =", "decimal = \",\"\nfiles =");
    assert_eq!(prepare(&decimal, &commas).unwrap().samples.velocity, points.samples.velocity);
    let refusal = |description: &str, csv: &str| prepare(description, csv).unwrap_err().to_string();
    let told = refusal(&semicolons, &commas);
    assert!(told.ends_with("expected a number; `decimal = \",\"` in [source]?"), "{told}");
    let told = refusal(&decimal, &joint().replace(',', ";"));
    assert!(told.ends_with("expected a number; `decimal = \".\"` in [source]?"), "{told}");
    let told = refusal(DESCRIPTION, &joint().replace(',', ";"));
    assert!(told.ends_with("; one column alone: `delimiter = \";\"` in [source]?"), "{told}");
    let same = semicolons.replace("files =", "decimal = \";\"\nfiles =");
    assert!(refusal(&same, &commas).contains("source.decimal"), "{}", refusal(&same, &commas));
    let told = refusal(DESCRIPTION, &joint().replacen('t', "\u{1b}[2Jt", 1));
    assert!(told.contains("\\u{1b}[2Jt") && !told.contains('\u{1b}'), "{told:?}");
}
