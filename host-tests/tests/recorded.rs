//! Recorded joints: the fixed-point image predicts unseen samples as docs/results-recordings.md says.
//!
//! Without the recordings ([`host_tests::recordings`]) every test here is reported as ignored, by name.

use host_tests::recordings;
use identification::dataset::{Prepared, prepare_with};
use identification::filter::LowPassFilter;
use identification::fit::{Options, fit};
use identification::page::Role;
use identification::progress::Silent;
use identification::samples::Part;
use libtest_mimic::{Arguments, Failed, Trial};
use nalgebra::{DMatrix, DVector};
use std::path::{Path, PathBuf};

/// Data set, and for each test set the best test RMSE of three SciPy baselines (Coulomb and viscous friction; with
/// Stribeck, asymmetric, quadratic and load-dependent terms; with a network on top) and that of the image, both of
/// docs/results-recordings.md, in the effort's unit.
const PUBLISHED: [(&str, &[(f64, f64)]); 10] = [
    ("emps", &[(3.161, 1.668)]),
    ("ur10e_joint1", &[(0.0927, 0.0659)]),
    ("ur10e_joint2", &[(0.0744, 0.0870)]),
    ("ur10e_joint3", &[(0.0481, 0.0493)]),
    ("iiwa_joint4", &[(0.658, 0.340)]),
    ("sts3250", &[(0.319, 0.301), (0.262, 0.235)]),
    ("dm_motor1", &[(0.0446, 0.0407)]),
    ("dm_motor2", &[(0.0433, 0.0362)]),
    ("dm_motor5", &[(0.0228, 0.0207)]),
    ("dm_motor6", &[(0.0224, 0.0208)]),
];
/// Largest departure from a published figure, either way, as a fraction of it.
const TOLERANCE: f64 = 0.01;
/// Largest RMS difference between the image and the same model in f64, as a fraction of the effort's RMS.
const FIXED_POINT: f64 = 2e-3;

fn main() {
    let arguments = Arguments::from_args();
    let data = recordings::folder();
    let ignored = data.is_none();
    let root = data.unwrap_or_default();
    let mut trials: Vec<Trial> = PUBLISHED
        .into_iter()
        .map(|(name, published)| {
            let root = root.clone();
            let title = format!("{name}_is_predicted_as_well_as_published");
            Trial::test(title, move || as_published(name, published, &root)).with_ignored_flag(ignored)
        })
        .collect();
    type Check = fn(&Path) -> Result<(), Failed>;
    let checks: [(&str, Check); 3] = [
        ("emps_published_protocol_is_reproduced", published_protocol),
        ("every_shipped_description_prepares_its_recorded_joint", shipped_descriptions),
        ("the_dirt_of_the_recorded_servo_is_found", dirt_of_the_servo),
    ];
    for (title, check) in checks {
        let root = root.clone();
        trials.push(Trial::test(title, move || check(&root)).with_ignored_flag(ignored));
    }
    libtest_mimic::run(&arguments, trials).exit();
}

/// The folder of the descriptions that come with the program.
fn descriptions() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tools/jointctl/datasets")
}

/// The samples of the data set `name` in `root`.
fn prepared(name: &str, root: &Path) -> Result<Prepared, Failed> {
    let environment = recordings::environment(root)?;
    Ok(prepare_with(&descriptions().join(format!("{name}.toml")), &environment)?)
}

fn shipped_descriptions(root: &Path) -> Result<(), Failed> {
    let mut count = 0;
    for entry in std::fs::read_dir(descriptions())? {
        let path = entry?.path();
        let name = path.file_stem().and_then(|stem| stem.to_str()).ok_or("a description without a name")?;
        let samples = prepared(name, root)?.samples;
        let sizes = [Part::Train, Part::Validation, Part::Test].map(|part| samples.indices(part).len());
        if sizes.iter().any(|&size| size < 300) {
            return Err(format!("{name}: {sizes:?} samples to train, validate and test with").into());
        }
        count += 1;
    }
    if count >= PUBLISHED.len() { Ok(()) } else { Err(format!("only {count} descriptions").into()) }
}

/// The figures are those of the data's own documentation.
fn dirt_of_the_servo(root: &Path) -> Result<(), Failed> {
    let prepared = prepared("sts3250", root)?;
    let count = |what: &str| prepared.notes.iter().find(|note| note.what == what).map_or(0, |note| note.count);
    for (what, expected) in [
        ("rows read", 376_200),
        ("runs", 627),
        ("rows missing by a dropout rule", 83),
        ("rows unused around a frozen read-out", 452),
    ] {
        if count(what) != expected {
            return Err(format!("{what}: {}, expected {expected}", count(what)).into());
        }
    }
    // Root mean square of the voltage in both test sets: what errors are to be compared with.
    for (set, expected) in prepared.test_sets.iter().zip([3.588, 3.640]) {
        let sum: f64 = set.indices.iter().map(|&i| prepared.samples.effort[i].powi(2)).sum();
        let rms = (sum / set.indices.len() as f64).sqrt();
        if (rms - expected).abs() >= 1e-3 {
            return Err(format!("RMS of {} is {rms}, expected {expected}", set.name).into());
        }
    }
    Ok(())
}

fn as_published(name: &str, published: &[(f64, f64)], root: &Path) -> Result<(), Failed> {
    let mut prepared = prepared(name, root)?;
    let options = Options { reference: false, ..Options::default() };
    let fitted = fit(&mut prepared, &options, &Silent)?;
    let mut effort_rms = f64::INFINITY;
    for (table, (baseline, image)) in fitted.report.errors.iter().zip(published) {
        let fixed =
            table.row(Role::FixedPoint).and_then(|row| row.errors.overall.as_ref()).ok_or("no fixed-point row")?;
        println!("{name}, {}: {:.4} of baseline {baseline}", table.test_set, fixed.rmse);
        if (fixed.rmse / image - 1.0).abs() > TOLERANCE {
            return Err(format!("{}: RMSE {:.5}, published {image}", table.test_set, fixed.rmse).into());
        }
        let percent = fixed.percent_of_rms.ok_or("no effort")?;
        effort_rms = effort_rms.min(100.0 * fixed.rmse / percent);
    }
    let difference = fitted.report.fixed_point.ok_or("no fixed-point difference")?.rms;
    match difference <= FIXED_POINT * effort_rms {
        true => Ok(()),
        false => Err(format!("fixed point departs by {difference} RMS, effort {effort_rms} RMS").into()),
    }
}

/// The EMPS benchmark's protocol: 4th-order Butterworth at 100 Hz forwards and backwards, central differences, the
/// first 49 samples dropped, regressors and force decimated by 10 (Chebyshev type I of order 8), least squares.
///
/// Published: 4.0834 % on the training run and 5.9824 % on the run with pulses (symmetric friction), 3.1117 % on the
/// training run (asymmetric friction).
fn published_protocol(root: &Path) -> Result<(), Failed> {
    let folder = root.join("emps");
    for (asymmetric, published_train, most_on_pulses) in [(false, 4.0834, 6.1), (true, 3.1117, 5.5)] {
        let (regressors, force) = protocol_rows(&folder.join("emps_train.csv.gz"), asymmetric)?;
        let parameters = regressors.clone().svd(true, true).solve(&force, 1e-12)?;
        let relative = |w: &DMatrix<f64>, y: &DVector<f64>| 100.0 * (y - w * &parameters).norm() / y.norm();
        let train = relative(&regressors, &force);
        let (regressors, force) = protocol_rows(&folder.join("emps_test_pulses.csv.gz"), asymmetric)?;
        let pulses = relative(&regressors, &force);
        println!("asymmetric {asymmetric}: {train:.4} % training, {pulses:.4} % pulses");
        if (train - published_train).abs() > 0.1 || pulses > most_on_pulses {
            return Err(format!("{train:.4} % (published {published_train}), pulses {pulses:.4} %").into());
        }
    }
    Ok(())
}

fn protocol_rows(file: &Path, asymmetric: bool) -> Result<(DMatrix<f64>, DVector<f64>), Failed> {
    let mut reader = csv::Reader::from_reader(flate2::read::GzDecoder::new(std::fs::File::open(file)?));
    let headers = reader.headers()?.clone();
    let column = |name: &str| headers.iter().position(|header| header == name).ok_or(format!("no column {name}"));
    let (position, force) = (column("position_m")?, column("force_N")?);
    let (mut q, mut f) = (Vec::new(), Vec::new());
    for record in reader.records() {
        let record = record?;
        q.push(record[position].parse::<f64>()?);
        f.push(record[force].parse::<f64>()?);
    }
    let differences = |x: &[f64]| identification::differentiate::central_difference(x, 1e-3);
    let q = LowPassFilter::butterworth(4, 0.2)?.zero_phase(&q)?;
    let v = differences(&q);
    let a = differences(&v);
    let mut columns: Vec<Vec<f64>> = vec![a];
    let signs: Vec<f64> = v.iter().map(|v| if *v == 0.0 { 0.0 } else { v.signum() }).collect();
    if asymmetric {
        for direction in [1.0, -1.0] {
            let on = |i: usize| (1.0 + direction * signs[i]) / 2.0;
            columns.push((0..v.len()).map(|i| v[i] * on(i)).collect());
            columns.push((0..v.len()).map(|i| signs[i] * on(i)).collect());
        }
    } else {
        columns.extend([v.clone(), signs, vec![1.0; v.len()]]);
    }
    columns.push(f);
    let anti_alias = LowPassFilter::chebyshev(8, 0.05, 0.08)?;
    let mut decimated = Vec::new();
    for column in &columns {
        let filtered = anti_alias.zero_phase(&column[49..])?;
        decimated.push(filtered.into_iter().step_by(10).collect::<Vec<_>>());
    }
    let force = DVector::from_vec(decimated.pop().unwrap_or_default());
    let regressors = DMatrix::from_fn(force.len(), decimated.len(), |row, column| decimated[column][row]);
    Ok((regressors, force))
}
