//! The search for a series: the best of many drawn at random, each improved by a pattern search; host.
//!
//! The condition number has many minima and kinks (Coulomb friction has a sign), so nothing is differentiated:
//! coefficients are changed one at a time by a step that halves when no change helps (Hooke and Jeeves, "Direct
//! search", J. ACM 8(2), 1961, its exploratory moves). After every change the series is scaled to touch its tightest
//! bound. There is no claim that the minimum is global.

use super::basis::Basis;
use super::{Bounds, Excitation, ExciteError, regressor::Regressor, within};
use plant::excitation::Reference;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;

/// Samples of a motion while searching. The fastest harmonic has at least 25.
const SAMPLES: usize = 500;
/// Part of the bounds that the search may use: between its samples a motion goes a little further.
const SHARE: f64 = 0.995;
/// First step of the pattern search, in units of the coefficients' RMS, and the step at which it ends.
const STEPS: (f64, f64) = (0.5, 0.01);

/// Length and effort of the search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Effort {
    /// Duration of the motion, s; 2 to 600.
    pub duration: f64,
    /// Harmonics, 1 to 20.
    pub harmonics: usize,
    /// Series drawn at random, 1 to 10,000.
    pub draws: usize,
    /// The best of them that are improved, 1 to `draws`.
    pub restarts: usize,
    /// Seed of the draws: the same seed gives the same series.
    pub seed: u64,
}

impl Effort {
    /// Effort of `jointctl excite`.
    pub const THOROUGH: Self = Self { duration: 10.0, harmonics: 5, draws: 256, restarts: 16, seed: 1 };
    /// Enough for a simulation.
    pub const QUICK: Self = Self { draws: 32, restarts: 2, ..Self::THOROUGH };

    fn validate(&self) -> Result<(), ExciteError> {
        within("duration", " s", self.duration, (2.0, 600.0))?;
        within("harmonics", "", self.harmonics as f64, (1.0, 20.0))?;
        within("draws", "", self.draws as f64, (1.0, 1e4))?;
        within("restarts", "", self.restarts as f64, (1.0, self.draws as f64))
    }
}

/// Result of the search.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// The best series.
    pub excitation: Excitation,
    /// Its condition number.
    pub condition_number: f64,
    /// Median condition number of the series drawn at random, which a user would have without the search.
    pub random: f64,
}

/// Searches for a series within `bounds`.
///
/// # Errors
/// [`ExciteError::Choice`].
pub fn optimise(bounds: &Bounds, effort: &Effort) -> Result<Found, ExciteError> {
    bounds.validate()?;
    effort.validate()?;
    let search = Search::new(bounds, effort);
    let mut draw = ChaCha8Rng::seed_from_u64(effort.seed);
    let mut drawn: Vec<Point> = (0..effort.draws)
        .map(|_| (0..2 * effort.harmonics).map(|_| StandardNormal.sample(&mut draw)).collect())
        .map(|coefficients| search.point(coefficients))
        .collect();
    drawn.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    let random = drawn[drawn.len() / 2].cost;
    drawn.truncate(effort.restarts);
    let improved: Vec<Point> = drawn.into_par_iter().map(|point| search.improve(point)).collect();
    // The first of equals, whichever thread was the fastest.
    let best = improved.into_iter().reduce(|best, point| if point.cost < best.cost { point } else { best });
    let best = best.unwrap_or_else(|| search.point(vec![0.0; 2 * effort.harmonics]));
    let excitation = search.excitation(&best.coefficients);
    Ok(Found { excitation, condition_number: best.cost, random })
}

/// Coefficients, scaled into the bounds, and their condition number.
struct Point {
    coefficients: Vec<f64>,
    cost: f64,
}

struct Search {
    bounds: Bounds,
    duration: f64,
    basis: Basis,
}

impl Search {
    fn new(bounds: &Bounds, effort: &Effort) -> Self {
        let basis = Basis::new(effort.duration, effort.harmonics, SAMPLES);
        Self { bounds: *bounds, duration: effort.duration, basis }
    }

    fn excitation(&self, coefficients: &[f64]) -> Excitation {
        Excitation { series: self.basis.series(coefficients), centre: self.bounds.centre(), duration: self.duration }
    }

    /// Scales coefficients to the tightest bound and judges them.
    fn point(&self, mut coefficients: Vec<f64>) -> Point {
        let mut motion = self.basis.motion(&coefficients);
        let centre = self.bounds.centre();
        let about = |m: &Reference| Reference { position: m.position + centre, ..*m };
        let used = motion.iter().map(|m| self.bounds.use_of(&about(m))).fold(0.0, f64::max);
        // No motion at all has nothing to scale.
        let scale = if used > 0.0 { SHARE / used } else { 0.0 };
        coefficients.iter_mut().for_each(|coefficient| *coefficient *= scale);
        let mut regressor = Regressor::new(&self.bounds);
        for m in &mut motion {
            m.position = scale * m.position + centre;
            m.velocity *= scale;
            m.acceleration *= scale;
            regressor.add(m);
        }
        Point { coefficients, cost: regressor.condition_number() }
    }

    fn improve(&self, mut best: Point) -> Point {
        let mut step = STEPS.0;
        while step > STEPS.1 {
            let count = best.coefficients.len();
            let size = (best.coefficients.iter().map(|c| c * c).sum::<f64>() / count as f64).sqrt();
            let before = best.cost;
            for index in 0..count {
                for change in [step * size, -step * size] {
                    let mut coefficients = best.coefficients.clone();
                    coefficients[index] += change;
                    let tried = self.point(coefficients);
                    if tried.cost < best.cost {
                        best = tried;
                        break;
                    }
                }
            }
            // A gain of less than a thousandth is not worth another round with this step.
            if best.cost > 0.999 * before {
                step *= 0.5;
            }
        }
        best
    }
}
