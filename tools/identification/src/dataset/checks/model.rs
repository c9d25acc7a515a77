//! Checks of the training samples beside the simplest linear model: sign of the effort, excitation, drift, inertia;
//! host.

use crate::dataset::description::Description;
use crate::dataset::error::DatasetError;
use crate::dataset::simple_model::{Normal, SimpleModel, Term, groups, jackknife};
use crate::dataset::warning::Warning;
use crate::rigid::{RigidModel, RigidRegressor};
use crate::samples::{Part, Samples};
use nalgebra::DVector;

/// Standard errors from which a coefficient's sign is certain.
const CERTAIN: f64 = 4.0;
/// Standard error over value from which a coefficient is not determined.
const UNDETERMINED: f64 = 0.3;
/// Variance inflation from which a term cannot be told from the others: they explain 99.5 % of it.
const INFLATION: f64 = 200.0;
/// Largest mean residual of a run, as a share of the effort's RMS.
const DRIFT: f64 = 0.15;
/// Least rows of a run that is compared with the others.
const LEAST_ROWS: usize = 100;
/// Share of a run's effort RMS that another inertia may explain, and least correlation of residual and acceleration.
const INERTIA_SHARE: f64 = 0.1;
const INERTIA_CORRELATION: f64 = 0.5;

/// All checks of the training samples. `run` is the run as recorded for each sample, `label` its text.
///
/// # Errors
/// An effort of the wrong sign: friction drives the joint and its inertia is negative.
pub fn check(
    samples: &Samples,
    rigid: &RigidModel,
    description: &Description,
    run: &[u32],
    label: &dyn Fn(u32) -> String,
) -> Result<Vec<Warning>, DatasetError> {
    let rows = samples.indices(Part::Train);
    let model = SimpleModel::new(rigid, samples, &rows);
    let group = groups(run, &rows);
    let count = group.iter().max().map_or(0, |most| most + 1);
    let mut sums = vec![Normal::zero(model.terms.len()); count];
    for (&i, &group) in rows.iter().zip(&group) {
        sums[group].add(&model.values(samples, i), samples.effort[i]);
    }
    let all = Normal::without(&sums, None);
    let left_out: Vec<DVector<f64>> = (0..count).map(|g| Normal::without(&sums, Some(g)).solve()).collect();
    let seen =
        Seen { samples, description, model, rows, group, all: all.solve(), sum: all, sums, left_out, run, label };
    seen.sign()?;
    let mut warnings = seen.excitation();
    warnings.extend(seen.drift());
    warnings.extend(seen.inertia());
    Ok(warnings)
}

struct Seen<'a> {
    samples: &'a Samples,
    description: &'a Description,
    model: SimpleModel,
    rows: Vec<usize>,
    /// Group of each row.
    group: Vec<usize>,
    /// Coefficients over all rows.
    all: DVector<f64>,
    sum: Normal,
    /// The sums of each group.
    sums: Vec<Normal>,
    /// Coefficients with each group left out.
    left_out: Vec<DVector<f64>>,
    run: &'a [u32],
    label: &'a dyn Fn(u32) -> String,
}

impl Seen<'_> {
    fn column(&self) -> String {
        format!("effort ({:?})", self.description.columns.effort.factors().join(" x "))
    }

    fn training(&self) -> String {
        format!("{} training rows", self.rows.len())
    }

    /// A coefficient and its standard error.
    fn coefficient(&self, place: usize) -> (f64, f64) {
        let values: Vec<f64> = self.left_out.iter().map(|found| found[place]).collect();
        (self.all[place], jackknife(&values).1)
    }

    fn of(&self, term: Term) -> Option<(f64, f64)> {
        self.model.place(term).map(|place| self.coefficient(place))
    }

    fn sign(&self) -> Result<(), DatasetError> {
        // Friction at the middle of the speeds: Coulomb and viscous friction alone can have either sign.
        let speed: f64 =
            self.rows.iter().map(|&i| self.samples.velocity[i].abs()).sum::<f64>() / self.rows.len() as f64;
        let (Some(viscous), Some(coulomb)) = (self.model.place(Term::Viscous), self.model.place(Term::Coulomb)) else {
            return Ok(());
        };
        let level = |found: &DVector<f64>| found[coulomb] + found[viscous] * speed;
        let friction = level(&self.all);
        let error = jackknife(&self.left_out.iter().map(level).collect::<Vec<_>>()).1;
        let negative = |(value, error): (f64, f64)| value < -CERTAIN * error;
        let inertia =
            self.of(Term::Rigid(RigidRegressor::Inertia)).filter(|(value, error)| value.abs() > CERTAIN * error);
        match negative((friction, error)) && inertia.is_none_or(negative) {
            true => Err(DatasetError::EffortSign {
                column: self.description.columns.effort.factors().join(" x "),
                friction,
                error,
                unit: self.description.columns.effort.unit.symbol(),
                speed,
                scale: self.description.columns.effort.scale,
            }),
            false => Ok(()),
        }
    }

    fn excitation(&self) -> Vec<Warning> {
        let mut warnings = Vec::new();
        let n = self.model.terms.len();
        let scale: Vec<f64> = (0..n).map(|i| self.sum.gram[(i, i)].sqrt()).collect();
        let scaled = nalgebra::DMatrix::from_fn(n, n, |i, j| {
            self.sum.gram[(i, j)] / (scale[i] * scale[j]).max(f64::MIN_POSITIVE)
        });
        let inverse = scaled.clone().try_inverse();
        let warning = |finding, remedy: &str| Warning {
            check: "excitation",
            column: self.column(),
            rows: self.training(),
            finding,
            remedy: remedy.to_owned(),
        };
        for (place, term) in self.model.terms.iter().enumerate() {
            let inflation = inverse.as_ref().map_or(f64::INFINITY, |inverse| inverse[(place, place)]);
            if !(0.0..INFLATION).contains(&inflation) {
                let like = |j: &usize| scaled[(place, *j)].abs();
                let partner = (0..n).filter(|&j| j != place).max_by(|a, b| like(a).total_cmp(&like(b)));
                let partner = partner.map_or(String::new(), |j| self.model.terms[j].name());
                let finding = format!(
                    "{} cannot be told from the other terms, most alike {partner}: variance inflation {inflation:.0}, limit {INFLATION}",
                    term.name()
                );
                warnings.push(warning(finding, remedy(*term)));
                continue;
            }
            let asked = matches!(term, Term::Coulomb | Term::Rigid(RigidRegressor::Inertia));
            let (value, error) = self.coefficient(place);
            if asked && error > UNDETERMINED * value.abs() {
                let finding = format!(
                    "{} is {value:.3e} with a standard error of {error:.1e}: {:.0} %, limit {:.0} %",
                    term.name(),
                    100.0 * error / value.abs(),
                    100.0 * UNDETERMINED
                );
                warnings.push(warning(finding, remedy(*term)));
            }
        }
        warnings
    }

    fn residual(&self, by: &DVector<f64>, index: usize) -> f64 {
        let values = self.model.values(self.samples, index);
        self.samples.effort[index] - values.iter().zip(by.iter()).map(|(value, by)| value * by).sum::<f64>()
    }

    /// Training rows of each run as recorded, with its group where runs are the groups.
    fn runs(&self) -> Vec<(&[usize], Option<usize>)> {
        let mut runs = Vec::new();
        let mut begin = 0;
        for rows in self.rows.chunk_by(|a, b| self.run[*a] == self.run[*b]) {
            let groups = &self.group[begin..begin + rows.len()];
            begin += rows.len();
            if rows.len() >= LEAST_ROWS {
                let group = groups[0];
                runs.push((rows, groups.iter().all(|other| *other == group).then_some(group)));
            }
        }
        runs
    }

    /// Inertia of each group by its own rows, less the median of all; empty where none is identified.
    fn inertia_of_groups(&self) -> Vec<f64> {
        let Some(place) = self.model.place(Term::Rigid(RigidRegressor::Inertia)) else { return Vec::new() };
        let own: Vec<f64> = self.sums.iter().map(|sum| sum.solve()[place]).collect();
        let mut sorted = own.clone();
        sorted.sort_by(f64::total_cmp);
        let median = sorted[sorted.len() / 2];
        own.into_iter().map(|inertia| inertia - median).collect()
    }

    fn drift(&self) -> Option<Warning> {
        let runs = self.runs();
        if runs.len() < 2 {
            return None;
        }
        let rms = (self.sum.square / self.sum.count as f64).sqrt();
        let mean = |(rows, _): &(&[usize], Option<usize>)| {
            rows.iter().map(|&i| self.residual(&self.all, i)).sum::<f64>() / rows.len() as f64
        };
        let means: Vec<f64> = runs.iter().map(mean).collect();
        let beyond = means.iter().filter(|mean| mean.abs() > DRIFT * rms).count();
        let worst = (0..means.len()).max_by(|&a, &b| means[a].abs().total_cmp(&means[b].abs()))?;
        (beyond > 0).then(|| Warning {
            check: "drift",
            column: self.column(),
            rows: format!("run {:?}; {beyond} of {} runs", (self.label)(self.run[runs[worst].0[0]]), runs.len()),
            finding: format!(
                "its mean is off by {:.1} % of the effort's RMS from the model of all runs, limit {:.0} %",
                100.0 * means[worst] / rms,
                100.0 * DRIFT
            ),
            remedy: "look for a drifting sensor, another payload (columns.extra) or temperature, or leave the run out"
                .to_owned(),
        })
    }

    /// Correlation of the residual with the acceleration, run by run: the inertia of a run is another one, or no term
    /// at all.
    fn inertia(&self) -> Option<Warning> {
        let mut worst: Option<(f64, f64, u32)> = None;
        let runs = self.runs();
        let apart = self.inertia_of_groups();
        for (rows, group) in &runs {
            let by = group.map_or(&self.all, |group| &self.left_out[group]);
            let (mut both, mut squares, mut residuals, mut efforts) = (0.0, 0.0, 0.0, 0.0);
            for &i in *rows {
                let (residual, acceleration) = (self.residual(by, i), self.samples.acceleration[i]);
                both += residual * acceleration;
                squares += acceleration * acceleration;
                residuals += residual * residual;
                efforts += self.samples.effort[i] * self.samples.effort[i];
            }
            let correlation = both / (squares * residuals).sqrt().max(f64::MIN_POSITIVE);
            // A heavy run among light ones makes the light ones' residuals go with the acceleration, too: the median
            // tells which.
            let share = match group.and_then(|group| apart.get(group)) {
                Some(apart) => apart.abs() * (squares / efforts.max(f64::MIN_POSITIVE)).sqrt(),
                None => both.abs() / (squares * efforts).sqrt().max(f64::MIN_POSITIVE),
            };
            if correlation.abs() > INERTIA_CORRELATION
                && share > INERTIA_SHARE
                && worst.is_none_or(|(_, most, _)| share > most)
            {
                worst = Some((correlation, share, self.run[rows[0]]));
            }
        }
        let (correlation, share, run) = worst?;
        let remedy = match self.description.rigid.inertia {
            true => "record one payload, or give mass and length (columns.extra, rigid.mass_and_length)",
            false => "let the inertia be identified (rigid.inertia = true)",
        };
        Some(Warning {
            check: "inertia",
            column: self.column(),
            rows: format!("run {:?}", (self.label)(run)),
            finding: format!(
                "what the simplest model of the other runs leaves is correlated with the acceleration by {correlation:.2} and {:.0} % of the \
                 effort's RMS, limits {INERTIA_CORRELATION} and {:.0} %",
                100.0 * share,
                100.0 * INERTIA_SHARE
            ),
            remedy: remedy.to_owned(),
        })
    }
}

fn remedy(term: Term) -> &'static str {
    match term {
        Term::Rigid(RigidRegressor::Inertia | RigidRegressor::LoadInertia) => {
            "record faster changes of speed, or set rigid.inertia = false"
        }
        Term::Rigid(_) => "move through more of the travel, or choose another rigid.gravity",
        Term::Viscous => "record more different speeds",
        Term::Coulomb | Term::Offset => "record both directions, with reversals",
    }
}
