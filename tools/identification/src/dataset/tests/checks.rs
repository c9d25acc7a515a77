//! Every data check finds its defect, planted into a clean recording, and says nothing of the clean one.

use super::*;
use crate::dataset::Warning;
use std::f64::consts::PI;

/// Rows of one run: 30 s at 100 Hz.
const ROWS: usize = 3000;
const RUNS: usize = 5;

const DESCRIBED: &str = r#"
name = "checked"
[source]
files = ["joint.csv"]
[columns]
run = "run"
time = { column = "t" }
position = { column = "q" }
velocity = { column = "v" }
effort = { column = "u", unit = "Nm" }
[rigid]
gravity = "sin"
[filter]
position = { order = 4, cutoff_hz = 10.0 }
velocity = { order = 4, cutoff_hz = 10.0 }
effort = { order = 4, cutoff_hz = 10.0 }
"#;

/// A row as recorded: time, position, velocity, effort.
type Sample = [f64; 4];

/// A joint with inertia, gravity, viscous and Coulomb friction that moves at four frequencies, other ones in each run.
fn sample(run: usize, i: usize) -> Sample {
    let t = i as f64 * 0.01;
    let (mut q, mut v, mut a) = (0.0, 0.0, 0.0);
    for (k, amplitude) in [0.9, 0.5, 0.3, 0.15].into_iter().enumerate() {
        let w = 0.35 * (k + 1) as f64 * (1.0 + 0.17 * run as f64) * PI / 2.0;
        let phase = w * t + 0.9 * (k * (run + 1)) as f64;
        q += amplitude * phase.sin();
        v += amplitude * w * phase.cos();
        a -= amplitude * w * w * phase.sin();
    }
    // A hash of the row as noise.
    let noise = ((i * 7919 + run * 104_729) % 1013) as f64 / 1013.0 - 0.5;
    [t, q, v, 0.5 * a + 1.5 * q.sin() + 0.4 * v + 1.2 * (v / 0.02).tanh() + 0.1 * noise]
}

fn csv(change: impl Fn(usize, usize, Sample) -> Sample) -> String {
    let mut text = String::from("run,t,q,v,u\n");
    for run in 0..RUNS {
        for i in 0..ROWS {
            let [t, q, v, u] = change(run, i, sample(run, i));
            writeln!(text, "{run},{t},{q},{v},{u}").unwrap();
        }
    }
    text
}

fn warnings_of(description: &str, csv: &str) -> Vec<Warning> {
    prepare(description, csv).unwrap().warnings
}

/// The recording with the defect has this warning, which names all of `parts`; the clean one has none at all.
fn found(check: &str, description: &str, change: impl Fn(usize, usize, Sample) -> Sample, parts: &[&str]) {
    let warnings = warnings_of(description, &csv(change));
    let told: Vec<String> = warnings.iter().filter(|w| w.check == check).map(ToString::to_string).collect();
    let text = told.join("\n");
    assert!(!told.is_empty(), "{check} not in {warnings:?}");
    for part in parts {
        assert!(text.to_string().contains(part), "{part:?} is not in: {text}");
    }
}

#[test]
fn a_clean_recording_has_no_warning() {
    let prepared = prepare(DESCRIBED, &csv(|_, _, s| s)).unwrap();
    assert_eq!(prepared.warnings, []);
    assert!(!prepared.lag.unwrap().applies(), "{:?}", prepared.lag);
}

#[test]
fn an_effort_of_the_wrong_sign_is_an_error_with_the_scale_that_turns_it() {
    let turned = csv(|_, _, [t, q, v, u]| [t, q, v, -u]);
    let message = prepare(DESCRIBED, &turned).unwrap_err().to_string();
    for part in ["effort (column \"u\")", "wrong sign", "columns.effort.scale the value -1"] {
        assert!(message.contains(part), "{message}");
    }
    let described = DESCRIBED.replace("unit = \"Nm\"", "unit = \"Nm\", scale = -1.0");
    assert_eq!(warnings_of(&described, &turned), []);
}

#[test]
fn units_that_do_not_fit_are_named_with_their_factor() {
    let degrees = |_, _, [t, q, v, u]: Sample| [t, q.to_degrees(), v, u];
    found("units", DESCRIBED, degrees, &["\"q\"", "0.017", "rad/s beside degrees", "columns.position.scale = 0.017"]);
    let per_minute = |_, _, [t, q, v, u]: Sample| [t, q, v * 30.0 / PI, u];
    found("units", DESCRIBED, per_minute, &["9.5", "revolutions per minute", "columns.velocity.scale = 0.104"]);
    let another = |_, i: usize, [t, q, _, u]: Sample| [t, q, (i as f64 * 0.013).sin(), u];
    found("units", DESCRIBED, another, &["correlated by", "one joint"]);
    let against = prepare(DESCRIBED, &csv(|_, _, [t, q, v, u]| [t, q, -v, u])).unwrap_err().to_string();
    assert!(against.contains("\"v\"") && against.contains("runs against position"), "{against}");
}

#[test]
fn the_ratio_of_units_has_a_limit_on_either_side() {
    let by = |factor: f64| warnings_of(DESCRIBED, &csv(move |_, _, [t, q, v, u]| [t, q, v * factor, u]));
    assert_eq!(by(1.24), []);
    assert_eq!(by(0.81), []);
    assert!(by(1.26).iter().any(|w| w.check == "units"));
    assert!(by(0.79).iter().any(|w| w.check == "units"));
}

#[test]
fn a_position_that_wraps_is_told_from_an_outlier() {
    let wrap = |q: f64| (q + 0.4).rem_euclid(2.0) - 1.0;
    let wraps = |_, _, [t, q, v, u]: Sample| [t, wrap(q), v, u];
    found("wrapping", DESCRIBED, wraps, &["\"q\"", "run \"0\" from", "columns.position.wrap = 1.9"]);
    let described = DESCRIBED.replace("column = \"q\"", "column = \"q\", wrap = 2.0");
    assert!(!warnings_of(&described, &csv(wraps)).iter().any(|w| w.check == "wrapping"));
    let outlier = |run, i, [t, q, v, u]: Sample| [t, if (run, i) == (2, 700) { 40.0 } else { q }, v, u];
    found("wrapping", DESCRIBED, outlier, &["run \"2\" from 7.0", "clean.jump"]);
}

#[test]
fn a_signal_that_is_stuck_while_the_joint_moves_is_named_with_its_time() {
    let effort = |run, i, [t, q, v, u]: Sample| [t, q, v, if run == 1 && (600..700).contains(&i) { 0.7 } else { u }];
    found("stuck", DESCRIBED, effort, &["effort", "\"u\"", "run \"1\" from 6.000 to 6.990 s", "100 rows"]);
    let held = sample(1, 600)[1];
    let position =
        move |run, i, [t, q, v, u]: Sample| [t, if run == 1 && (600..700).contains(&i) { held } else { q }, v, u];
    found("stuck", DESCRIBED, position, &["position", "run \"1\" from 6.000"]);
    let velocity = |run, i, [t, q, v, u]: Sample| [t, q, if run == 1 && (600..700).contains(&i) { 3.0 } else { v }, u];
    found("stuck", DESCRIBED, velocity, &["velocity", "run \"1\" from 6.000"]);
}

#[test]
fn a_joint_that_trembles_is_named_with_the_rows_that_run_against_it() {
    // Of the rows in steady motion, as many as are given run backwards.
    let against = |every: usize| {
        move |run: usize, i: usize, [t, q, v, u]: Sample| {
            let turns = (i + 13 * run).is_multiple_of(every);
            [t, q, if turns { -v } else { v }, u]
        }
    };
    found("trembling", DESCRIBED, against(150), &["\"v\"", "against the motion in 0.7 %", "lower its gains"]);
    let trembles = |text: &str| warnings_of(DESCRIBED, text).iter().any(|w| w.check == "trembling");
    assert!(!trembles(&csv(against(250))));
    // A velocity that is late by three rows turns late, and is no trembling.
    let late = |run: usize, i: usize, [t, q, _, u]: Sample| [t, q, sample(run, i.saturating_sub(3))[2], u];
    assert!(!trembles(&csv(late)));
}

#[test]
fn a_clipped_effort_is_named_with_its_limit() {
    let clipped = |_, _, [t, q, v, u]: Sample| [t, q, v, u.clamp(-2.0, 2.0)];
    found("clipping", DESCRIBED, clipped, &["\"u\"", "2", "clean.saturation = [{ column = \"u\", limit = 2 }]"]);
    let described = DESCRIBED.to_owned() + "[clean]\nsaturation = [{ column = \"u\", limit = 2.0 }]\n";
    assert!(!warnings_of(&described, &csv(clipped)).iter().any(|w| w.check == "clipping"));
}

#[test]
fn a_time_in_milliseconds_is_told_by_its_period() {
    let described =
        DESCRIBED.replace("[filter]", "[filter]\nlag_limit = 0.0").replace("cutoff_hz = 10.0", "cutoff_nyquist = 0.2");
    let milliseconds = |_, _, [t, q, v, u]: Sample| [1000.0 * t, q, v, u];
    let error = |result: Result<Prepared, DatasetError>| result.map(|p| p.warnings);
    let found = error(prepare(&described, &csv(milliseconds))).unwrap();
    assert!(found.iter().any(|w| w.check == "sampling" && w.remedy.contains("columns.time.scale")), "{found:?}");
}

#[test]
fn motion_that_does_not_excite_a_term_is_named_with_the_term() {
    let one_way = |run, i: usize, _: Sample| {
        let t = i as f64 * 0.01;
        let v = 0.4 + 0.1 * (1.0 + run as f64) + 0.05 * (0.7 * t).sin();
        let q = (0.4 + 0.1 * (1.0 + run as f64)) * t - 0.05 / 0.7 * (0.7 * t).cos();
        let noise = ((i * 7919) % 1013) as f64 / 1013.0 - 0.5;
        [t, q, v, 1.5 * q.sin() + 0.4 * v + 1.2 + 0.1 * noise]
    };
    found("excitation", DESCRIBED, one_way, &["Coulomb friction", "both directions", "inertia"]);
}

#[test]
fn a_run_whose_effort_has_drifted_is_named() {
    let by = |share: f64| move |run, _, [t, q, v, u]: Sample| [t, q, v, if run == 3 { u + share } else { u }];
    found("drift", DESCRIBED, by(1.2), &["run \"3\"", "drifting sensor"]);
    assert!(!warnings_of(DESCRIBED, &csv(by(0.1))).iter().any(|w| w.check == "drift"));
}

#[test]
fn a_run_with_another_inertia_is_named() {
    let loaded = |run, i, [t, q, v, u]: Sample| {
        let ahead = (sample(run, i + 1)[2] - v) / 0.01;
        [t, q, v, if run == 3 { u + 1.5 * ahead } else { u }]
    };
    found("inertia", DESCRIBED, loaded, &["run \"3\"", "payload"]);
}

#[test]
fn an_empty_test_set_is_skipped_and_told() {
    let split = "[split]\ntest = [{ name = \"none\", runs = [\"7\"] }, { name = \"last\", runs = [\"4\"] }]\n";
    let prepared = prepare(&(DESCRIBED.to_owned() + split), &csv(|_, _, s| s)).unwrap();
    assert_eq!(prepared.test_sets.iter().map(|set| set.name.as_str()).collect::<Vec<_>>(), ["last"]);
    assert!(prepared.warnings[0].to_string().contains("split.test \"none\""), "{:?}", prepared.warnings);
}

#[test]
fn empty_lists_mean_what_they_say() {
    let with = |tables: &str| prepare(&(DESCRIBED.to_owned() + tables), &csv(|_, _, s| s));
    let used = |tables: &str| {
        with(tables).unwrap().samples.part.iter().filter(|&&p| p != crate::samples::Part::Unused).count()
    };
    assert_eq!(used("[select]\nuse = [{ column = \"q\", not_in = [] }]\n"), RUNS * ROWS);
    assert_eq!(used("[clean]\ndropout = [{ column = \"q\", in = [] }]\n"), RUNS * ROWS);
    let none = with("[select]\nuse = [{ column = \"q\", in = [] }]\n").unwrap_err().to_string();
    assert!(none.contains("usable samples"), "{none}");
    let unknown = with("[select]\nuse = [{ column = \"w\", not_in = [] }]\n").unwrap_err().to_string();
    assert!(unknown.contains("no column \"w\""), "{unknown}");
}

#[test]
fn an_acceleration_has_a_filter_of_its_own() {
    let noisy = csv(|run, i, [t, q, v, u]| [t, q, v + 0.02 * f64::from((i * 31 + run) as u32 % 7) - 0.06, u]);
    let bare = DESCRIBED.replace("velocity = { order = 4, cutoff_hz = 10.0 }", "");
    let filtered = bare.clone() + "acceleration = { order = 4, cutoff_hz = 5.0 }\n";
    let rms = |description: &str| {
        let samples = prepare(description, &noisy).unwrap().samples;
        (samples.acceleration.iter().map(|a| a * a).sum::<f64>() / samples.len() as f64).sqrt()
    };
    let (without, with) = (rms(&bare), rms(&filtered));
    assert!(with < 0.7 * without, "{with} {without}");
}
