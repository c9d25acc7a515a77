//! The delay of the effort is identified in either sign, between samples, and bounded.

use super::*;
use std::f64::consts::PI;

const DESCRIBED: &str = r#"
name = "late"
[source]
files = ["joint.csv"]
[columns]
run = "run"
time = { column = "t" }
position = { column = "q" }
effort = { column = "u", unit = "Nm" }
[filter]
position = { order = 4, cutoff_hz = 10.0 }
effort = { order = 4, cutoff_hz = 10.0 }
"#;

/// Five runs of 30 s at 100 Hz with inertia, viscous and Coulomb friction, the effort `lag` s late.
fn late(lag: f64) -> String {
    let at = |run: usize, t: f64| {
        let (mut q, mut v, mut a) = (0.0, 0.0, 0.0);
        for (k, amplitude) in [0.9, 0.5, 0.3].into_iter().enumerate() {
            let w = 0.6 * (k + 1) as f64 * (1.0 + 0.17 * run as f64) * PI / 2.0;
            let phase = w * t + 0.9 * (k * (run + 1)) as f64;
            q += amplitude * phase.sin();
            v += amplitude * w * phase.cos();
            a -= amplitude * w * w * phase.sin();
        }
        (q, 0.5 * a + 0.4 * v + 1.2 * (v / 0.02).tanh())
    };
    let mut text = String::from("run,t,q,u\n");
    for run in 0..5 {
        for i in 0..3000 {
            let t = i as f64 * 0.01;
            let noise = ((i * 7919 + run * 104_729) % 1013) as f64 / 1013.0 - 0.5;
            writeln!(text, "{run},{t},{},{}", at(run, t).0, at(run, t - lag).1 + 0.1 * noise).unwrap();
        }
    }
    text
}

#[test]
fn a_delay_of_either_sign_is_found_between_the_samples_and_taken_out() {
    for lag in [0.013, -0.013, 0.035, -0.004] {
        let prepared = prepare(DESCRIBED, &late(lag)).unwrap();
        let found = prepared.lag.unwrap();
        assert!((found.lag - lag).abs() < 0.001, "{lag}: {found:?}");
        assert!(found.standard_error < 0.001 && found.applies(), "{lag}: {found:?}");
        assert_eq!(prepared.description.filter.effort_lag, Some(found.lag));
        let exact = format!("{DESCRIBED}effort_lag = {lag}\n");
        let by_hand = prepare(&exact, &late(lag)).unwrap();
        assert_eq!(by_hand.lag, None);
        let apart =
            prepared.samples.effort.iter().zip(&by_hand.samples.effort).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
        assert!((apart / prepared.samples.len() as f64).sqrt() < 0.05, "{lag}: {apart}");
    }
}

#[test]
fn no_delay_is_not_moved() {
    let prepared = prepare(DESCRIBED, &late(0.0)).unwrap();
    assert!(!prepared.lag.unwrap().applies(), "{:?}", prepared.lag);
    assert_eq!(prepared.description.filter.effort_lag, None);
}

#[test]
fn a_delay_beyond_the_limit_is_told_and_left_alone() {
    let prepared = prepare(DESCRIBED, &late(0.08)).unwrap();
    assert!(prepared.lag.unwrap().beyond && prepared.description.filter.effort_lag.is_none());
    let text = prepared.warnings.iter().find(|w| w.check == "lag").unwrap().to_string();
    assert!(text.contains("limit 50.0 ms") && text.contains("filter.lag_limit"), "{text}");
    let wider = format!("{DESCRIBED}lag_limit = 0.1\n");
    assert!((prepare(&wider, &late(0.08)).unwrap().lag.unwrap().lag - 0.08).abs() < 0.001);
}

#[test]
fn a_described_delay_has_a_limit_on_either_side() {
    let with = |lag: f64| prepare(&format!("{DESCRIBED}effort_lag = {lag}\n"), &late(0.0));
    assert!(with(0.05).is_ok() && with(-0.05).is_ok());
    for lag in [0.051, -0.051, 5.0] {
        let message = with(lag).unwrap_err().to_string();
        assert!(message.contains("filter.effort_lag") && message.contains("filter.lag_limit"), "{message}");
    }
    assert!(prepare(&format!("{DESCRIBED}lag_limit = 1.01\n"), &late(0.0)).is_err());
}
