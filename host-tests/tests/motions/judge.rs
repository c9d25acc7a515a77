//! One motion left out: image and baselines on the same samples.

use crate::list::Motion;
use crate::page::{Image, Row};
use identification::dataset::description::Rule;
use identification::dataset::{Description, Prepared, prepare_as};
use identification::evaluate::Prediction;
use identification::fit::{FitError, Fitted, Options, fit};
use identification::page::{ErrorTable, Role};
use identification::presets::Preset;
use identification::progress::Silent;
use identification::sample_table::write_sample_table;
use libtest_mimic::Failed;
use serde_json::Value;
use std::path::Path;

/// Networks that a fit trains; `jointctl fit` trains 8. Fewer, for the time that it takes.
pub const RESTARTS: usize = 3;

/// The row of the motion.
pub fn judge(motion: &Motion, data: &Path, python: &Path) -> Result<Row, Failed> {
    let context = |error: String| Failed::from(format!("{}, {}: {error}", motion.data_set, motion.name));
    row(motion, data, python).map_err(|failed| context(failed.message().unwrap_or_default().to_owned()))
}

fn row(motion: &Motion, data: &Path, python: &Path) -> Result<Row, Failed> {
    let descriptions = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tools/jointctl/datasets");
    let rule = Rule { name: Some(motion.name.clone()), ..toml::from_str(&motion.rule)? };
    let mut prepared =
        prepare_as(&descriptions.join(format!("{}.toml", motion.data_set)), |description: &mut Description| {
            let folder = description.source.root.as_deref().and_then(|root| root.rsplit_once('/'));
            description.source.root = folder.map(|(_, folder)| data.join(folder).to_string_lossy().into_owned());
            description.split.test = vec![rule];
        })?;
    let options = Options { reference: false, restarts: RESTARTS, ..Options::default() };
    let fitted = match fit(&mut prepared, &options, &Silent) {
        Err(FitError::Refused(_)) => None,
        result => Some(result?),
    };
    let predictions = fitted.as_ref().map_or(&[][..], |fitted| &fitted.predictions);
    let judged = judged(&prepared, predictions, python)?;
    let test = &judged["tests"][0];
    let percent = |group: &str, model: &str| {
        test[group][model]["percent_of_rms"].as_f64().ok_or_else(|| format!("no error of {model} in {judged}"))
    };
    let image = match fitted {
        None => None,
        Some(Fitted { report, .. }) => {
            let errors = report.errors.first().ok_or("no test set")?;
            let image = &errors.row(Role::FixedPoint).ok_or("no image")?.model;
            let simplest = Preset::CoulombViscous.name();
            for model in [image, simplest] {
                same_rows(percent("exported", model)?, errors, model)?;
            }
            let kept = report.candidates.iter().filter(|candidate| candidate.kept);
            let model = kept.map(|candidate| &candidate.model).max_by_key(|name| name.len()).ok_or("no model")?;
            let (error, simplest) = (percent("exported", image)?, percent("exported", simplest)?);
            Some(Image { model: model.clone(), error, simplest })
        }
    };
    Ok(Row {
        data_set: motion.data_set.to_owned(),
        left_out: motion.name.clone(),
        samples: test["samples"].as_u64().ok_or("no number of samples")?,
        image,
        baselines: [percent("baselines", "a")?, percent("baselines", "b")?, percent("baselines", "c")?],
    })
}

/// Errors of the baselines and of `predictions`, as Python computes them.
fn judged(prepared: &Prepared, predictions: &[Prediction], python: &Path) -> Result<Value, Failed> {
    let folder = tempfile::tempdir()?;
    let table = folder.path().join("samples.csv");
    write_sample_table(prepared, predictions, &table)?;
    let output = python::baselines::command(python).args(["-m", "baselines"]).arg(&table).output()?;
    match output.status.success() {
        true => Ok(serde_json::from_slice(&output.stdout)?),
        false => Err(String::from_utf8_lossy(&output.stderr).into_owned().into()),
    }
}

/// Checks that Python finds for a model in the exported table what the report says: both look at the same rows.
fn same_rows(found: f64, errors: &ErrorTable, model: &str) -> Result<(), Failed> {
    let row = errors.rows.iter().find(|row| row.model == model).ok_or_else(|| format!("no row {model}"))?;
    let reported = row.errors.overall.as_ref().and_then(|overall| overall.percent_of_rms).ok_or("no effort")?;
    match (found - reported).abs() <= 1e-9 * reported {
        true => Ok(()),
        false => Err(format!("{model}: {found} % in the table, {reported} % in the report").into()),
    }
}
