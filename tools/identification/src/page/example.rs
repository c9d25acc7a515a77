//! A report of a made-up joint with Coulomb, Stribeck and viscous friction, for the tests of the page and the figures.

use super::*;
use crate::metrics::{RELATIVE_FLOOR, metrics_by_state, relative_floor};
use crate::samples::MotionState;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A report whose test set has `samples` samples in five runs, with temperature and network.
pub fn report(samples: usize) -> Report {
    let (test, states) = joint(samples);
    let floor = relative_floor(&test.effort, RELATIVE_FLOOR);
    let row = |model: &str, role, predicted: &[f64]| ErrorRow {
        model: model.into(),
        role,
        errors: metrics_by_state(&test.effort, predicted, &states, floor).unwrap(),
        torque_error: Some(12.5),
    };
    let between = |share: f64| -> Vec<f64> {
        test.physical.iter().zip(&test.rigid).map(|(physical, rigid)| physical + share * (rigid - physical)).collect()
    };
    let network = test.network.clone().unwrap();
    let rows = vec![
        row("nothing (rigid body alone)", Role::Nothing, &test.rigid),
        row("linear", Role::Preset, &between(0.4)),
        row("coulomb-viscous", Role::Preset, &between(0.15)),
        row("stribeck", Role::Physical, &test.physical),
        row("stribeck + network, float", Role::PhysicalAndNetwork, &network),
        row("stribeck + network, image", Role::FixedPoint, &network),
        row("legged-robot reference network", Role::Reference, &between(0.1)),
    ];
    Report {
        title: "Friction of joint 4, elbow".into(),
        data_set: "made-up-joint".into(),
        units: Units { position: "rad".into(), velocity: "rad/s".into(), effort: "Nm".into() },
        provenance: Provenance {
            tool_version: "0.1.0".into(),
            data_sha256: "9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08".into(),
            description: "joint4.toml".into(),
            options: vec![("--preset".into(), "all".into()), ("--network".into(), "3x5".into())],
            seed: 7,
            created: "2025-01-31T12:00:00Z".into(),
        },
        warnings: vec![],
        stages: vec![
            StageNote {
                stage: "clean".into(),
                note: "Removed single-sample dropouts and repeated rows.".into(),
                counts: vec![("read".into(), 95_501), ("dropouts".into(), 112), ("kept".into(), 95_389)],
            },
            StageNote {
                stage: "split".into(),
                note: "By whole runs, so that neighbours in time never end up on both sides.".into(),
                counts: vec![("train".into(), 45_000), ("validation".into(), 20_389), ("test".into(), samples as u64)],
            },
        ],
        parameters: parameters(),
        candidates: candidates(),
        choice: choice(),
        network: NetworkOutcome::Kept,
        errors: vec![ErrorTable { test_set: "other speeds".into(), rows }],
        fixed_point: Some(FixedPointDifference { rms: 0.00021, max: 0.00093, max_percent_of_full_scale: 0.057 }),
        training: (0..5).map(|seed| curve(seed, seed == 1)).collect(),
        uncertainty: Some(Uncertainty {
            value: 0.23,
            worst: "backward at 5 to 10 % of the greatest speed, run 2 left out".into(),
            cells: 30,
        }),
        certificate: certificate(),
        test,
    }
}

fn joint(samples: usize) -> (TestSamples, Vec<MotionState>) {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let mut noise = move |size: f64| size * (0..4).map(|_| random.random_range(-1.0..1.0)).sum::<f64>();
    let mut test = TestSamples { temperature: Some(vec![]), network: Some(vec![]), ..TestSamples::default() };
    let mut states = Vec::new();
    let per_run = samples.div_ceil(5).max(1);
    for i in 0..samples {
        let (run, t) = (i / per_run, (i % per_run) as f64 * 0.005);
        let w = 0.35 + 0.3 * run as f64;
        let position = 1.2 * (w * t).sin() + 0.35 * (2.7 * w * t).sin();
        let velocity = 1.2 * w * (w * t).cos() + 0.35 * 2.7 * w * (2.7 * w * t).cos();
        let acceleration = -1.2 * w * w * (w * t).sin() - 0.35 * (2.7 * w).powi(2) * (2.7 * w * t).sin();
        let temperature = 24.0 + 3.0 * run as f64 + 0.05 * t;
        let rigid = 0.8 * acceleration + 3.5 * position.sin();
        let stribeck = |stick: f64, v: f64| (1.1 + stick * (-(v / 0.12).powi(2)).exp()) * (v / 0.03).tanh() + 0.55 * v;
        let ripple = 0.16 * (3.0 * position + 0.4).sin() * velocity.tanh();
        let cold = 1.0 - 0.008 * (temperature - 24.0);
        test.time.push(t);
        test.run.push(run as u32 + 11);
        test.position.push(position);
        test.velocity.push(velocity);
        test.effort.push(rigid + cold * stribeck(0.5, velocity) + ripple + noise(0.05));
        test.rigid.push(rigid);
        test.physical.push(rigid + 0.95 * stribeck(0.42, velocity));
        test.network.as_mut().unwrap().push(rigid + cold * stribeck(0.47, velocity) + 0.85 * ripple);
        test.temperature.as_mut().unwrap().push(temperature);
        states.push(MotionState { accelerating: acceleration.abs() > 0.5, fast: velocity.abs() > 0.4 });
    }
    (test, states)
}

fn parameters() -> Vec<Parameter> {
    let parameter = |name: &str, symbol: &str, value, unit: &str, standard_error, at_bound| Parameter {
        name: name.into(),
        symbol: symbol.into(),
        value,
        unit: unit.into(),
        standard_error,
        at_bound,
        truth: None,
    };
    vec![
        parameter("Coulomb friction, forward", "F_c+", 1.0973, "Nm", Some(0.0041), false),
        parameter("Coulomb friction, backward", "F_c−", 1.0881, "Nm", Some(0.0044), false),
        parameter("breakaway friction", "F_brk", 1.5202, "Nm", Some(0.031), false),
        parameter("viscous coefficient", "f_v", 0.5512, "Nm s/rad", Some(0.0022), false),
        parameter("Stribeck velocity", "v_st", 0.1184, "rad/s", Some(0.0071), false),
        parameter("Coulomb velocity", "v_c", 0.001, "rad/s", None, true),
    ]
}

fn choice() -> Choice {
    let fold = |left_out: &str, errors: [f64; 2]| FoldRow { left_out: left_out.into(), errors: errors.to_vec() };
    Choice {
        grouping: "folds of whole motions: 2 by run".into(),
        motions: true,
        models: vec!["coulomb-viscous".into(), "full".into()],
        folds: vec![fold("run slow", [0.41, 0.22]), fold("run fast", [0.52, 0.31])],
        terms: vec!["Viscous".into(), "Coulomb".into()],
        notes: vec!["Stribeck tried: error on left-out motions 4.7e-1 -> 2.7e-1".into()],
        overruled: vec!["term -Hysteresis".into()],
    }
}

fn candidates() -> Vec<Candidate> {
    let candidate = |model: &str, parameters, unseen_rmse, kept, reason: &str| Candidate {
        model: model.into(),
        parameters,
        unseen_rmse,
        kept,
        reason: reason.into(),
    };
    vec![
        candidate("stribeck + network", 104, 0.1187, true, "lowest validation error, 31 % below the physical model"),
        candidate("stribeck", 9, 0.1731, false, "best physical model"),
        candidate("hysteresis-harmonics", 24, 0.1735, false, "15 more parameters gain nothing"),
        candidate("hysteresis", 12, 0.1744, false, "gains less than 1 %"),
        candidate("nscf", 7, 0.2519, false, "no Stribeck effect"),
        candidate("coulomb-viscous", 5, 0.2533, false, "no Stribeck effect"),
        candidate("linear", 5, 0.6102, false, "no Coulomb friction"),
    ]
}

fn curve(seed: u64, chosen: bool) -> TrainingCurve {
    let level = 0.0135 + 0.0012 * ((seed * 7 + 3) % 5) as f64 - if chosen { 0.001 } else { 0.0 };
    let epochs = 90 + 13 * seed as usize;
    let falling = |epoch: usize, rate: f64| 0.25 * (-(epoch as f64) / rate).exp() + level;
    let best = epochs - 25;
    TrainingCurve {
        seed,
        train: (0..=epochs).map(|epoch| falling(epoch, 7.0) - 0.000_01 * epoch as f64).collect(),
        validation: (0..=epochs)
            .map(|epoch| falling(epoch, 8.0) + 0.001 + 2e-6 * (epoch as f64 - best as f64).powi(2))
            .collect(),
        best_epoch: best,
        chosen,
        stop: "validation error has not fallen for 25 epochs".into(),
    }
}

fn certificate() -> Vec<CertificateItem> {
    let item = |name: &str, value, limit, unit: &str, worst_found| CertificateItem {
        name: name.into(),
        value,
        limit,
        unit: unit.into(),
        worst_found,
        passed: value <= limit,
    };
    vec![
        item("largest accumulator, layer 1", 1.2e9, 2_147_483_647.0, "counts", Some(8.4e8)),
        item("largest estimate", 3.82, 6.0, "Nm", Some(3.11)),
        item("slope over velocity near standstill", 31.5, 60.0, "Nm s/rad", Some(27.9)),
        item("slope over measured torque", 0.0, 0.5, "", None),
    ]
}
