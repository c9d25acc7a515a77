//! The search for the series of all joints: the best of many motions drawn at random, each improved by a pattern search
//! (Hooke and Jeeves, "Direct search", J. ACM 8(2), 1961, exploratory moves), as for a single joint; host.
//!
//! A joint's series is always scaled to touch its tightest bound about its centre, and all of them are reduced together
//! where a frame would come below the floor: every motion that is judged may be run. Centres are searched too. There is
//! no claim that the minimum is global.

use super::check::{Findings, check};
use super::regressor::{Motion, Regressor, Score};
use super::{Effort, RobotExciteError, Task};
use excitation::basis::Basis;
use excitation::file::SAMPLE_PERIOD;
use excitation::{Bounds, Excitation};
use plant::excitation::Reference;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;

/// Samples of a motion beside its limits while searching, and one in how many is a sample of the regressor.
const SAMPLES: (usize, usize) = (481, 4);
/// Part of the bounds that the search may use: between its samples a motion goes a little further.
const SHARE: f64 = 0.99;
/// Height above the floor that the search keeps, m.
const CLEARANCE: f64 = 0.002;
/// Centres of random motions, parts of the travel about its middle.
const CENTRES: f64 = 0.5;
/// Halvings in search of the largest motion above the floor.
const HALVINGS: usize = 7;
/// Least part of its size to which a motion is reduced for the floor: below, another one is drawn.
const LEAST_PART: f64 = 0.1;
/// Motions that are tried for each that is wanted above a floor.
const TRIES: usize = 20;
/// Random motions that columns are measured by.
const REFERENCES: usize = 8;
/// First step of the pattern search, in units of a joint's coefficients' RMS and of a quarter of its travel, and the
/// step at which it ends.
const STEPS: (f64, f64) = (0.5, 0.05);
/// Fall of the cost in a round, below which steps are halved.
const GAIN: f64 = 0.01;

/// Result of the search.
#[derive(Clone, Debug)]
pub struct Found {
    /// The series of every joint.
    pub excitations: Vec<Excitation>,
    /// Its singular values.
    pub score: Score,
    /// The random motion of median cost, which a user would have without the search.
    pub random: Vec<Excitation>,
    /// Its singular values.
    pub random_score: Score,
    /// The motion beside its limits.
    pub findings: Findings,
}

/// Searches for a motion.
///
/// # Errors
/// [`RobotExciteError`].
pub fn search(task: &Task, effort: &Effort) -> Result<Found, RobotExciteError> {
    effort.validate()?;
    let basis = Basis::new(effort.duration, effort.harmonics, SAMPLES.0);
    let drawn = draw(task, &basis, effort)?;
    let reference: Vec<Motion> = drawn.iter().take(REFERENCES).map(|series| series.sampled(&basis)).collect();
    let regressor = Regressor::new(task.robot, &reference);
    let search = Search { task, basis: &basis, regressor: &regressor, rounds: effort.rounds };
    let mut points: Vec<Point> = drawn.into_par_iter().map(|series| search.judged(series)).collect();
    points.sort_by(|a, b| a.score.cost().total_cmp(&b.score.cost()));
    let random = settled(task, &basis, points[points.len() / 2].series.clone())?;
    points.truncate(effort.restarts);
    let improved: Vec<Point> = points.into_par_iter().map(|point| search.improve(point)).collect();
    // The first of equals, whichever thread was the fastest.
    let best = improved.into_iter().reduce(|a, b| if b.score.cost() < a.score.cost() { b } else { a });
    let best = best.ok_or(RobotExciteError::Undetermined)?;
    let found = settled(task, &basis, best.series)?;
    let (score, random_score) = (search.judged(found.clone()).score, search.judged(random.clone()).score);
    if !score.condition.is_finite() {
        return Err(RobotExciteError::Undetermined);
    }
    let (excitations, random) =
        (found.excitations(&basis, effort.duration), random.excitations(&basis, effort.duration));
    let findings = check(task, &excitations, SAMPLE_PERIOD);
    match findings.defects.is_empty() {
        true => Ok(Found { excitations, score, random, random_score, findings }),
        false => Err(RobotExciteError::Exceeds(findings.defects.join("; "))),
    }
}

/// Centre and coefficients of every joint.
#[derive(Clone, Debug)]
struct Series {
    centres: Vec<f64>,
    coefficients: Vec<Vec<f64>>,
}

impl Series {
    /// The motion at the regressor's samples.
    fn sampled(&self, basis: &Basis) -> Motion {
        let joint = |(centre, coefficients): (&f64, &Vec<f64>)| {
            let motion = basis.motion(coefficients).into_iter().step_by(SAMPLES.1);
            motion.map(|m| Reference { position: m.position + centre, ..m }).collect()
        };
        self.centres.iter().zip(&self.coefficients).map(joint).collect()
    }

    fn scale(&mut self, part: f64) {
        self.coefficients.iter_mut().flatten().for_each(|coefficient| *coefficient *= part);
    }

    fn excitations(&self, basis: &Basis, duration: f64) -> Vec<Excitation> {
        let joint = |(centre, coefficients): (&f64, &Vec<f64>)| Excitation {
            series: basis.series(coefficients),
            centre: *centre,
            duration,
        };
        self.centres.iter().zip(&self.coefficients).map(joint).collect()
    }
}

/// Random motions within the bounds and above the floor.
fn draw(task: &Task, basis: &Basis, effort: &Effort) -> Result<Vec<Series>, RobotExciteError> {
    let mut random = ChaCha8Rng::seed_from_u64(effort.seed);
    let mut drawn = Vec::new();
    let tries = TRIES * effort.draws;
    let mut highest = (f64::NEG_INFINITY, 0);
    for _ in 0..tries {
        let centre = |bounds: &Bounds| {
            let half = 0.5 * CENTRES * (bounds.position.1 - bounds.position.0);
            bounds.centre() + half * random.random_range(-1.0..1.0)
        };
        let centres: Vec<f64> = task.bounds.iter().map(centre).collect();
        let joint = |_| (0..2 * effort.harmonics).map(|_| StandardNormal.sample(&mut random)).collect();
        let coefficients = (0..centres.len()).map(joint).collect();
        if let Some(floor) = task.floor {
            let lowest = task.lowest(&centres);
            highest = if lowest.0 > highest.0 { lowest } else { highest };
            if lowest.0 < floor + CLEARANCE {
                continue;
            }
        }
        drawn.extend(within_bounds(task, basis, Series { centres, coefficients }));
        if drawn.len() == effort.draws {
            break;
        }
    }
    match (drawn.is_empty(), task.floor) {
        (true, Some(floor)) => {
            let frame = task.robot.frames.get(highest.1).map_or(String::new(), |frame| frame.link.clone());
            Err(RobotExciteError::NoRoom { tried: tries, floor, highest: highest.0, frame })
        }
        (true, None) => Err(RobotExciteError::Undetermined),
        _ => Ok(drawn),
    }
}

impl Task<'_> {
    /// Height and index of the lowest frame at positions `q`.
    pub fn lowest(&self, q: &[f64]) -> (f64, usize) {
        let heights = self.robot.heights(q).into_iter().enumerate();
        heights.fold((f64::INFINITY, 0), |low, (i, height)| if height < low.0 { (height, i) } else { low })
    }

    /// Part of its tightest bound that a joint uses at a sample about `centre`; above 1 beyond it.
    fn used(&self, joint: usize, centre: f64, about: &Reference) -> f64 {
        let bounds = &self.bounds[joint];
        let end = if about.position > 0.0 { bounds.position.1 } else { bounds.position.0 };
        let position = if about.position == 0.0 { 0.0 } else { about.position / (end - centre) };
        // Beyond its end a centre has a room below zero.
        let position = if position < 0.0 { f64::INFINITY } else { position };
        position.max(about.velocity.abs() / bounds.velocity).max(about.acceleration.abs() / bounds.acceleration)
    }
}

/// Series scaled to touch their tightest bound, and above the floor; None where there is no room.
fn within_bounds(task: &Task, basis: &Basis, mut series: Series) -> Option<Series> {
    let mut motion: Motion = Vec::new();
    for (j, coefficients) in series.coefficients.iter_mut().enumerate() {
        let mut about = basis.motion(coefficients);
        let used = about.iter().map(|m| task.used(j, series.centres[j], m)).fold(0.0, f64::max);
        if !used.is_finite() || used <= 0.0 {
            return None;
        }
        let scale = SHARE / used;
        coefficients.iter_mut().for_each(|coefficient| *coefficient *= scale);
        about.iter_mut().for_each(|m| m.position *= scale);
        motion.push(about);
    }
    if let Some(floor) = task.floor {
        let above = |part: f64| {
            (0..motion[0].len()).all(|i| {
                let q: Vec<f64> = motion
                    .iter()
                    .zip(&series.centres)
                    .map(|(joint, centre)| centre + part * joint[i].position)
                    .collect();
                task.lowest(&q).0 >= floor + CLEARANCE
            })
        };
        let part = largest_part(above)?;
        series.scale(part);
    }
    Some(series)
}

/// Largest part of a motion that is above the floor, by halving; None below [`LEAST_PART`].
fn largest_part(above: impl Fn(f64) -> bool) -> Option<f64> {
    if above(1.0) {
        return Some(1.0);
    }
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if above(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    (low >= LEAST_PART).then_some(low)
}

/// Series reduced to what the limits permit on the fine grid of the tables.
fn settled(task: &Task, basis: &Basis, mut series: Series) -> Result<Series, RobotExciteError> {
    let mut defects = Vec::new();
    for _ in 0..10 {
        let excitations = series.excitations(basis, basis.duration());
        for (j, excitation) in excitations.iter().enumerate() {
            let about = |m: Reference| Reference { position: m.position - excitation.centre, ..m };
            let motion = excitation.samples(SAMPLE_PERIOD).map(|(_, m)| task.used(j, excitation.centre, &about(m)));
            let used = motion.fold(0.0, f64::max);
            if used > SHARE {
                series.coefficients[j].iter_mut().for_each(|coefficient| *coefficient *= SHARE / used);
            }
        }
        defects = check(task, &series.excitations(basis, basis.duration()), SAMPLE_PERIOD).defects;
        if defects.is_empty() {
            return Ok(series);
        }
        series.scale(0.97);
    }
    Err(RobotExciteError::Exceeds(defects.join("; ")))
}

/// A motion that was judged.
#[derive(Clone, Debug)]
struct Point {
    series: Series,
    score: Score,
}

struct Search<'a> {
    task: &'a Task<'a>,
    basis: &'a Basis,
    regressor: &'a Regressor<'a>,
    rounds: usize,
}

impl Search<'_> {
    fn judged(&self, series: Series) -> Point {
        let score = self.regressor.score(&series.sampled(self.basis));
        Point { series, score }
    }

    /// The point of a change, where it is a lower cost within the limits.
    fn lower(&self, series: Series, cost: f64) -> Option<Point> {
        let point = self.judged(within_bounds(self.task, self.basis, series)?);
        (point.score.cost() < cost).then_some(point)
    }

    fn improve(&self, mut best: Point) -> Point {
        let mut step = STEPS.0;
        for _ in 0..self.rounds {
            let before = best.score.cost();
            for joint in 0..self.task.bounds.len() {
                best = self.improve_joint(best, joint, step);
            }
            if best.score.cost() > (1.0 - GAIN) * before {
                step *= 0.5;
            }
            if step < STEPS.1 {
                break;
            }
        }
        best
    }

    fn improve_joint(&self, mut best: Point, joint: usize, step: f64) -> Point {
        let count = best.series.coefficients[joint].len();
        let squares: f64 = best.series.coefficients[joint].iter().map(|c| c * c).sum();
        let size = (squares / count as f64).sqrt();
        let bounds = &self.task.bounds[joint];
        let travel = 0.25 * (bounds.position.1 - bounds.position.0);
        for index in 0..=count {
            for direction in [1.0, -1.0] {
                let mut series = best.series.clone();
                match series.coefficients[joint].get_mut(index) {
                    Some(coefficient) => *coefficient += direction * step * size,
                    None => series.centres[joint] += direction * step * travel,
                }
                if let Some(lower) = self.lower(series, best.score.cost()) {
                    best = lower;
                    break;
                }
            }
        }
        best
    }
}
