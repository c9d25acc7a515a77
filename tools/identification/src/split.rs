//! Division of samples into those that train, validate and judge; host.
//!
//! Neighbouring samples of one recording are almost the same sample, so a split never draws single samples: it takes
//! files, runs, values of a column, or blocks of time. The default shares are those of the legged-robot paper:
//! 50 % training, 20 % validation, 30 % test.

use crate::dataset::description::{Fraction, FractionBy, Rule, Split};
use crate::samples::Part;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use std::collections::BTreeSet;
use thiserror::Error;

/// Share of the test set when none is described.
const TEST_SHARE: f64 = 0.3;
/// Share of the validation samples in what is not for test, when not described: 20 of 70 %.
const VALIDATION_SHARE: f64 = 2.0 / 7.0;
/// Blocks that the whole recording is cut into when their length is not described.
const DEFAULT_BLOCKS: f64 = 40.0;

/// A named set of samples for judging.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TestSet {
    /// Name in reports.
    pub name: String,
    /// Indices of its samples, ascending. Sets may overlap.
    pub indices: Vec<usize>,
}

/// The result of a split.
#[derive(Clone, Debug)]
pub struct Assignment {
    /// Use of each sample.
    pub part: Vec<Part>,
    /// The test sets, in the order described.
    pub test_sets: Vec<TestSet>,
    /// Names of described test sets that no sample belongs to.
    pub empty: Vec<String>,
}

/// Columns that a split looks at; all are of equal length, samples of one run are contiguous.
#[derive(Clone, Copy, Debug)]
pub struct Recorded<'a> {
    /// Time since the start of the run, s.
    pub time: &'a [f64],
    /// Index of the run as recorded.
    pub run: &'a [u32],
    /// Samples that may be used at all.
    pub usable: &'a [bool],
}

/// A part that received no sample.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("the split leaves {part} without samples")]
pub struct EmptyPart {
    /// Training, validation, or the test set's name.
    pub part: String,
}

/// Splits the samples. `matches` says for each sample whether the tests of a rule on files, runs and columns hold.
///
/// Test sets come first; validation is cut from what they leave, and training is the rest.
pub fn split(
    description: &Split,
    recorded: Recorded,
    matches: impl Fn(&Rule) -> Vec<bool>,
) -> Result<Assignment, EmptyPart> {
    let count = recorded.time.len();
    let usable = recorded.usable;
    let default_test = [Rule { name: Some("test".to_owned()), fraction: Some(share(TEST_SHARE)), ..Rule::default() }];
    let default_validation = Rule { fraction: Some(share(VALIDATION_SHARE)), ..Rule::default() };
    let test = if description.test.is_empty() { &default_test[..] } else { &description.test };

    let mut part: Vec<Part> = usable.iter().map(|&usable| if usable { Part::Train } else { Part::Unused }).collect();
    let (mut test_sets, mut empty) = (Vec::new(), Vec::new());
    for rule in test {
        let name = rule.name.clone().unwrap_or_default();
        let taken = members(rule, recorded, usable, &matches(rule));
        let indices: Vec<usize> = (0..count).filter(|&i| taken[i]).collect();
        if indices.is_empty() {
            empty.push(name);
            continue;
        }
        indices.iter().for_each(|&i| part[i] = Part::Test);
        test_sets.push(TestSet { name, indices });
    }
    if let (true, Some(name)) = (test_sets.is_empty(), empty.first()) {
        return Err(EmptyPart { part: format!("test set {name:?}") });
    }

    let left: Vec<bool> = part.iter().map(|&part| part == Part::Train).collect();
    let rule = description.validation.as_ref().unwrap_or(&default_validation);
    for (part, taken) in part.iter_mut().zip(members(rule, recorded, &left, &matches(rule))) {
        if taken {
            *part = Part::Validation;
        }
    }
    for (kind, name) in [(Part::Train, "training"), (Part::Validation, "validation")] {
        if !part.contains(&kind) {
            return Err(EmptyPart { part: name.to_owned() });
        }
    }
    Ok(Assignment { part, test_sets, empty })
}

fn share(of: f64) -> Fraction {
    Fraction { of, by: FractionBy::Blocks, length: None, seed: 0 }
}

/// Flag of each sample that is one of the `candidates` and satisfies the rule.
fn members(rule: &Rule, recorded: Recorded, candidates: &[bool], matches: &[bool]) -> Vec<bool> {
    let mut taken: Vec<bool> =
        candidates.iter().zip(matches).map(|(&candidate, &matches)| candidate && matches).collect();
    if let Some(blocks) = &rule.blocks {
        for (taken, block) in taken.iter_mut().zip(block_numbers(recorded, blocks.length)) {
            *taken &= blocks.index.contains(&(block % blocks.modulo.max(1)));
        }
    }
    if let Some(fraction) = &rule.fraction {
        let unit = match fraction.by {
            FractionBy::Runs => recorded.run.iter().map(|&run| run as usize).collect(),
            FractionBy::Blocks => {
                let length = fraction.length.unwrap_or_else(|| duration(recorded) / DEFAULT_BLOCKS);
                block_numbers(recorded, length)
            }
        };
        let drawn = draw(&unit, &taken, fraction);
        for (taken, unit) in taken.iter_mut().zip(unit) {
            *taken &= drawn.contains(&unit);
        }
    }
    taken
}

/// Numbers of the blocks of time, counted through all runs; each run begins a new block.
fn block_numbers(recorded: Recorded, length: f64) -> Vec<usize> {
    let mut numbers = Vec::with_capacity(recorded.time.len());
    let (mut first, mut highest) = (0, 0);
    for (i, &time) in recorded.time.iter().enumerate() {
        if i > 0 && recorded.run[i] != recorded.run[i - 1] {
            first = highest + 1;
        }
        // Times are sums of periods: 6.0 may be stored as 5.999999999.
        let number = first + (time / length + 1e-9).max(0.0) as usize;
        highest = highest.max(number);
        numbers.push(number);
    }
    numbers
}

/// Time covered by all runs, s; a little more, so that the very last sample does not begin a block of its own.
fn duration(recorded: Recorded) -> f64 {
    let Recorded { time, run, .. } = recorded;
    let within = (1..time.len()).filter(|&i| run[i] == run[i - 1]).map(|i| time[i] - time[i - 1]);
    (within.sum::<f64>() * (1.0 + 1e-6)).max(f64::MIN_POSITIVE)
}

/// Draws the share of the units (blocks or runs) that hold candidates.
fn draw(unit: &[usize], candidates: &[bool], fraction: &Fraction) -> BTreeSet<usize> {
    let units: BTreeSet<usize> = unit.iter().zip(candidates).filter(|(_, is)| **is).map(|(&unit, _)| unit).collect();
    let mut units: Vec<usize> = units.into_iter().collect();
    units.shuffle(&mut ChaCha8Rng::seed_from_u64(fraction.seed));
    units.truncate((units.len() as f64 * fraction.of).round() as usize);
    units.into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::description::Blocks;

    fn split_of(text: &str, runs: usize, rows: usize) -> Result<Assignment, EmptyPart> {
        let description: Split = toml::from_str(text).unwrap();
        let time: Vec<f64> = (0..runs * rows).map(|i| (i % rows) as f64 * 0.01).collect();
        let run: Vec<u32> = (0..runs * rows).map(|i| (i / rows) as u32).collect();
        let usable = vec![true; runs * rows];
        split(&description, Recorded { time: &time, run: &run, usable: &usable }, |_| vec![true; runs * rows])
    }

    fn count(assignment: &Assignment, part: Part) -> usize {
        assignment.part.iter().filter(|&&p| p == part).count()
    }

    #[test]
    fn without_a_description_half_trains_a_fifth_validates_and_three_tenths_judge() {
        let found = split_of("", 1, 4000).unwrap();
        assert_eq!(count(&found, Part::Test), 1200);
        assert_eq!(count(&found, Part::Validation), 800);
        assert_eq!(count(&found, Part::Train), 2000);
        assert_eq!(found.test_sets.len(), 1);
    }

    #[test]
    fn a_pattern_of_blocks_takes_every_third_six_seconds() {
        let found =
            split_of("test = [{ name = 'third', blocks = { length = 6.0, modulo = 3, index = [2] } }]", 1, 3600);
        for (i, part) in found.unwrap().part.iter().enumerate() {
            assert_eq!(*part == Part::Test, (i / 600) % 3 == 2, "sample {i}");
        }
    }

    #[test]
    fn blocks_are_numbered_through_all_runs() {
        let time = [0.0, 0.5, 1.0, 0.0, 0.5, 1.0];
        let recorded = Recorded { time: &time, run: &[0, 0, 0, 1, 1, 1], usable: &[true; 6] };
        assert_eq!(block_numbers(recorded, 1.0), [0, 0, 1, 2, 2, 3]);
    }

    #[test]
    fn a_share_of_runs_takes_whole_runs_and_the_seed_decides_which() {
        let text =
            |seed: u32| format!("test = [{{ name = 'runs', fraction = {{ of = 0.25, by = 'runs', seed = {seed} }} }}]");
        let found = split_of(&text(1), 20, 100).unwrap();
        for run in found.part.chunks(100) {
            let judged = run.iter().filter(|&&part| part == Part::Test).count();
            assert!(judged == 0 || judged == 100);
        }
        assert_eq!(count(&found, Part::Test), 500);
        assert_eq!(found.part, split_of(&text(1), 20, 100).unwrap().part);
        assert_ne!(found.part, split_of(&text(2), 20, 100).unwrap().part);
    }

    #[test]
    fn test_sets_may_overlap_and_no_sample_of_them_trains() {
        let rule = |name: &str, index: usize| Rule {
            name: Some(name.to_owned()),
            blocks: Some(Blocks { length: 1.0, modulo: 4, index: vec![index, 3] }),
            ..Rule::default()
        };
        let description = Split { test: vec![rule("a", 0), rule("b", 1)], validation: None };
        let time: Vec<f64> = (0..4000).map(|i| f64::from(i) * 0.01).collect();
        let recorded = Recorded { time: &time, run: &[0; 4000], usable: &[true; 4000] };
        let found = split(&description, recorded, |_| vec![true; 4000]).unwrap();
        assert_eq!(found.test_sets[0].indices.len(), 2000);
        assert_eq!(found.test_sets[1].indices.len(), 2000);
        assert_eq!(count(&found, Part::Test), 3000);
    }

    #[test]
    fn an_empty_part_is_an_error_that_names_it() {
        let all = "test = [{ name = 'all', blocks = { length = 1.0, modulo = 1, index = [0] } }]";
        assert_eq!(split_of(all, 1, 1000).unwrap_err().part, "training");
        let none = "test = [{ name = 'none', blocks = { length = 1.0, modulo = 100, index = [99] } }]";
        assert_eq!(split_of(none, 1, 1000).unwrap_err().part, "test set \"none\"");
        let no_validation = "validation = { blocks = { length = 1.0, modulo = 100, index = [99] } }";
        assert_eq!(split_of(no_validation, 1, 1000).unwrap_err().part, "validation");
    }
}
