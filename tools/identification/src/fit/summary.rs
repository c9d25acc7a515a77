//! Summary of a fit: its stages, candidates, predictions and certificate as the report's rows.

use super::{Learned, Options};
use crate::certificate_search::Found;
use crate::choice::{Decision, Folds, compare};
use crate::dataset::Prepared;
use crate::evaluate::Prediction;
use crate::friction_parameter::Units;
use crate::identify::{self, Identified};
use crate::joint_model::{network_inputs, rigid_efforts};
use crate::page::{self, Candidate, CertificateItem, NetworkOutcome, Role};
use crate::samples::{Part, Samples};
use friction_compensation::parameters::certificate::Certificate;
use friction_compensation::parameters::image::Image;

pub(super) fn predictions(
    samples: &Samples,
    identified: &[Identified],
    chosen: usize,
    learned: &Learned,
    sets: &[usize],
    fixed: &[(f64, f64)],
) -> Vec<Prediction> {
    let physical = &identified[chosen];
    let rigid = rigid_efforts(&physical.rigid, samples);
    let mut all = vec![Prediction::new("nothing", Role::Nothing, &rigid, |_| 0.0)];
    for (i, one) in identified.iter().enumerate() {
        let own_rigid = rigid_efforts(&one.rigid, samples);
        let role = if i == chosen { Role::Physical } else { Role::Preset };
        all.push(Prediction::new(one.preset.name(), role, &own_rigid, |i| one.friction(samples, i)));
    }
    if learned.has_network() {
        let name = format!("{} + network, f64", physical.preset);
        all.push(Prediction::new(name, Role::PhysicalAndNetwork, &rigid, |i| {
            let (physical, network) = learned.float.parts(sets[i], samples, i);
            physical + network
        }));
    }
    all.push(Prediction::new("image, fixed point", Role::FixedPoint, &rigid, |i| fixed[i].0 + fixed[i].1));
    if let Some(reference) = &learned.reference {
        all.push(Prediction::new("legged-robot network (16), f64", Role::Reference, &rigid, |i| {
            physical.friction(samples, i) + reference.evaluate(&network_inputs(samples, i))
        }));
    }
    all
}

pub(super) fn parameter(estimated: &identify::Estimated) -> page::Parameter {
    page::Parameter {
        name: estimated.name.clone(),
        symbol: estimated.symbol.clone(),
        value: estimated.value,
        unit: estimated.unit.clone(),
        standard_error: estimated.standard_error,
        at_bound: estimated.at_bound,
        truth: None,
    }
}

pub(super) fn candidates(
    identified: &[Identified],
    chosen: usize,
    refused: &[(usize, String)],
    learned: &Learned,
) -> Vec<Candidate> {
    let mut all: Vec<Candidate> = identified
        .iter()
        .enumerate()
        .map(|(i, one)| Candidate {
            model: one.preset.name().to_owned(),
            parameters: one.parameters.len(),
            unseen_rmse: one.unseen_rmse(),
            kept: i == chosen,
            reason: match refused.iter().find(|(refused, _)| *refused == i) {
                Some((_, reason)) => reason.clone(),
                None if i == chosen => "the simplest that no other beats beyond the spread of the folds".to_owned(),
                None => against(one, &identified[chosen]),
            },
        })
        .collect();
    if let Some(unseen_rmse) = learned.unseen_rmse {
        let (kept, reason) = match &learned.outcome {
            NetworkOutcome::Kept => (true, "lowers the error on left-out motions, or is kept by request".to_owned()),
            NetworkOutcome::Rejected { reason } => (false, reason.clone()),
            NetworkOutcome::NotTrained => (false, "not trained".to_owned()),
        };
        let model = format!("{} + network", identified[chosen].preset);
        let parameters = identified[chosen].parameters.len() + learned.parameters;
        all.push(Candidate { model, parameters, unseen_rmse, kept, reason });
    }
    all.sort_by(|a, b| a.unseen_rmse.total_cmp(&b.unseen_rmse));
    all
}

/// Change of the error on left-out motions from the chosen model to another.
fn against(other: &Identified, chosen: &Identified) -> String {
    let change = compare(&chosen.fold_errors(), &other.fold_errors());
    format!("{:+.1} ± {:.1} % on left-out motions", change.percent(), 100.0 * change.standard_error)
}

/// Choice of the model, for the report.
pub(super) fn choice(
    folds: &Folds,
    identified: &[Identified],
    chosen: usize,
    refused: &[(usize, String)],
    learned: &Learned,
    options: &Options,
) -> page::Choice {
    let mut overruled: Vec<String> = options.terms.iter().map(|rule| format!("term {rule}")).collect();
    for (part, decision) in [("network", options.network), ("lagged accelerations", options.lags)] {
        match decision {
            Decision::Choose => {}
            Decision::Keep => overruled.push(format!("{part}: keep")),
            Decision::Never => overruled.push(format!("{part}: never")),
        }
    }
    let Identified { friction, rigid_model, .. } = &identified[chosen];
    let mut terms: Vec<String> = friction.terms.iter().map(|term| format!("{term:?}")).collect();
    if rigid_model.lags > 0 {
        terms.push(format!("{} lagged accelerations in the rigid part", rigid_model.lags));
    }
    let mut notes: Vec<String> = identified[chosen].notes.clone();
    notes.extend(learned.notes.iter().cloned());
    notes.extend(refused.iter().map(|(i, reason)| format!("{} is refused: {reason}", identified[*i].preset)));
    page::Choice {
        grouping: folds.grouping.clone(),
        motions: folds.motions,
        folds: (0..folds.len())
            .map(|fold| page::FoldRow {
                left_out: folds.names[fold].clone(),
                errors: identified.iter().map(|one| one.folds.get(fold).map_or(f64::NAN, |fit| fit.rmse)).collect(),
            })
            .collect(),
        models: identified.iter().map(|one| one.preset.name().to_owned()).collect(),
        terms,
        notes,
        overruled,
    }
}

pub(super) fn certificate_items(
    certificate: &Certificate,
    image: &Image,
    found: &Found,
    units: &Units,
) -> Vec<CertificateItem> {
    let item = |name: &str, value: f64, limit: f64, unit: String, worst: f64| CertificateItem {
        name: name.to_owned(),
        value,
        limit,
        unit,
        worst_found: Some(worst),
        passed: value <= limit,
    };
    let Units { position, effort } = units;
    let slope = certificate.velocity_slope_high.max(-certificate.velocity_slope_low);
    vec![
        item(
            "|friction|",
            f64::from(certificate.output) / 65536.0,
            f64::from(image.limits.output) / 65536.0,
            effort.clone(),
            found.output,
        ),
        item(
            "|d(network) / d(measured torque)|",
            f64::from(certificate.torque_gain) / 65536.0,
            f64::from(image.limits.torque_gain) / 65536.0,
            "1".to_owned(),
            found.torque_gain,
        ),
        item(
            "|d(friction) / d(velocity)|",
            slope as f64 / 256.0,
            f64::from(image.limits.velocity_slope) / 256.0,
            format!("{effort} s/{position}"),
            found.velocity_slope,
        ),
    ]
}

pub(super) fn stages(prepared: &Prepared) -> Vec<page::StageNote> {
    let mut stages: Vec<page::StageNote> = Vec::new();
    for note in &prepared.notes {
        let count = (note.what.to_owned(), note.count as u64);
        match stages.iter_mut().find(|stage| stage.stage == note.stage) {
            Some(stage) => stage.counts.push(count),
            None => {
                stages.push(page::StageNote { stage: note.stage.to_owned(), note: String::new(), counts: vec![count] })
            }
        }
    }
    if let Some(lag) = &prepared.lag {
        let done = if lag.applies() { "moved by it" } else { "not significant, or beyond the limit: not moved" };
        stages.push(page::StageNote {
            stage: "lag".to_owned(),
            note: format!(
                "effort behind position by {:.2} +- {:.2} ms; left-out groups' residual falls by {:.2} %: {done}",
                1e3 * lag.lag,
                1e3 * lag.standard_error,
                100.0 * lag.gain
            ),
            counts: vec![],
        });
    }
    stages
}

pub(super) fn option_list(options: &Options) -> Vec<(String, String)> {
    let value = serde_json::to_value(options).unwrap_or_default();
    let entries = value.as_object().into_iter().flatten();
    entries.map(|(key, value)| (key.clone(), value.to_string().replace('"', ""))).collect()
}

pub(super) fn test_samples(
    prepared: &Prepared,
    rigid: &[f64],
    physical: &Identified,
    learned: &Learned,
    fixed: &[(f64, f64)],
) -> page::TestSamples {
    let samples = &prepared.samples;
    let test = samples.indices(Part::Test);
    let pick = |value: &dyn Fn(usize) -> f64| test.iter().map(|&i| value(i)).collect::<Vec<_>>();
    page::TestSamples {
        time: pick(&|i| samples.time[i]),
        run: test.iter().map(|&i| samples.run[i]).collect(),
        position: pick(&|i| samples.position[i]),
        velocity: pick(&|i| samples.velocity[i]),
        temperature: prepared.description.columns.temperature.as_ref().map(|_| pick(&|i| samples.temperature[i])),
        effort: pick(&|i| samples.effort[i]),
        rigid: pick(&|i| rigid[i]),
        physical: pick(&|i| rigid[i] + physical.friction(samples, i)),
        network: learned.has_network().then(|| pick(&|i| rigid[i] + fixed[i].0 + fixed[i].1)),
    }
}
