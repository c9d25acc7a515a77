use super::check::check;
use super::file::{SAMPLE_PERIOD, coefficients, parse, table};
use super::regressor::condition_number;
use super::*;
use std::path::Path;

const BOUNDS: Bounds = Bounds { position: (-0.8, 1.6), velocity: 3.0, acceleration: 12.0 };

fn quick(seed: u64) -> Found {
    optimise(&BOUNDS, &Effort { seed, ..Effort::QUICK }).unwrap()
}

fn samples(excitation: &Excitation) -> (Vec<f64>, Vec<Reference>) {
    excitation.samples(SAMPLE_PERIOD).unzip()
}

#[test]
fn a_series_keeps_its_bounds_begins_and_ends_at_rest_and_is_better_conditioned_than_a_random_one() {
    for seed in 1..4 {
        let found = quick(seed);
        let (time, motion) = samples(&found.excitation);
        let findings = check(&time, &motion, &BOUNDS);
        assert_eq!(findings.defects, Vec::<String>::new());
        // The tightest bound is used.
        let used = motion.iter().map(|m| BOUNDS.use_of(m)).fold(0.0, f64::max);
        assert!((0.99..=1.0).contains(&used), "{used}");
        assert!(found.condition_number < 0.8 * found.random, "{found:?}");
        let finer = condition_number(&BOUNDS, &motion);
        assert!((finer / found.condition_number - 1.0).abs() < 0.02, "{finer} {}", found.condition_number);
        println!("seed {seed}: condition number {:.2}, at random {:.2}", found.condition_number, found.random);
    }
}

#[test]
fn the_same_seed_gives_the_same_series_and_more_effort_none_that_is_worse() {
    assert_eq!(quick(7), quick(7));
    assert_ne!(quick(7), quick(8));
    let more = optimise(&BOUNDS, &Effort { seed: 7, restarts: 8, ..Effort::QUICK }).unwrap();
    assert!(more.condition_number <= quick(7).condition_number);
}

#[test]
fn coefficients_and_table_are_the_same_motion() {
    let found = quick(1);
    let from_toml = parse(&coefficients(&found).unwrap(), Path::new("a.toml")).unwrap();
    let from_csv = parse(&table(&found.excitation), Path::new("a.csv")).unwrap();
    assert_eq!(from_toml.motion, samples(&found.excitation).1);
    assert_eq!(from_csv.motion.len(), from_toml.motion.len());
    for (table, exact) in from_csv.motion.iter().zip(&from_toml.motion) {
        assert!((table.position - exact.position).abs() < 1e-6, "{table:?} {exact:?}");
        assert!((table.velocity - exact.velocity).abs() < 1e-5, "{table:?} {exact:?}");
    }
    assert_eq!(check(&from_csv.time, &from_csv.motion, &BOUNDS).defects, Vec::<String>::new());
}

#[test]
fn each_limit_that_is_exceeded_is_named_with_what_is_permitted() {
    let (time, motion) = samples(&quick(1).excitation);
    for (bounds, expected) in [
        (Bounds { position: (0.0, 1.6), ..BOUNDS }, "lowest permitted is 0.0000 rad"),
        (Bounds { position: (-0.8, 0.5), ..BOUNDS }, "highest permitted is 0.5000 rad"),
        (Bounds { velocity: 0.5, ..BOUNDS }, "permitted are 0.5000 rad/s"),
        (Bounds { acceleration: 2.0, ..BOUNDS }, "permitted are 2.0000 rad/s²"),
    ] {
        let defects = check(&time, &motion, &bounds).defects.join("\n");
        assert!(defects.contains(expected), "{expected}: {defects}");
    }
}

#[test]
fn a_table_that_is_no_motion_is_found_out() {
    let (time, motion) = samples(&quick(1).excitation);
    let defects = |time: &[f64], motion: &[Reference]| check(time, motion, &BOUNDS).defects.join("\n");
    let mut jump = motion.clone();
    jump[5000..].iter_mut().for_each(|m| m.position += 0.01);
    assert!(defects(&time, &jump).contains("from 4.9990 s to 5.0000 s the position changes by"));
    let mut back = time.clone();
    back[5000] = back[4999];
    assert!(defects(&back, &motion).contains("time does not increase after 4.9990 s"));
    let fastest = (0..motion.len()).max_by(|&a, &b| motion[a].velocity.total_cmp(&motion[b].velocity)).unwrap();
    assert!(defects(&time[..=fastest], &motion[..=fastest]).contains("does not end at rest"));
    let refused = |text: &str, file: &str| parse(text, Path::new(file)).unwrap_err().to_string();
    assert!(refused("time_s,position_rad\n", "a.csv").contains("no column velocity_rad_s"));
    let broken = table(&quick(1).excitation).replacen("\n0.0010,", "\n0.001o,", 1);
    assert!(refused(&broken, "a.csv").contains("line 3, column time_s: \"0.001o\""));
    assert!(refused("centre = 1.0", "a.toml").contains("missing field"));
}

#[test]
fn bounds_and_efforts_that_make_no_sense_are_refused_with_their_range() {
    let refused = |bounds: &Bounds, effort: &Effort| optimise(bounds, effort).unwrap_err().to_string();
    let shown = refused(&Bounds { velocity: -1.0, ..BOUNDS }, &Effort::QUICK);
    assert_eq!(shown, "velocity is -1, must lie in 0.001 to 200 rad/s");
    let shown = refused(&Bounds { position: (1.0, 0.0), ..BOUNDS }, &Effort::QUICK);
    assert!(shown.contains("highest position is 0"), "{shown}");
    let shown = refused(&BOUNDS, &Effort { harmonics: 0, ..Effort::QUICK });
    assert!(shown.contains("harmonics is 0, must lie in 1 to 20"), "{shown}");
}
