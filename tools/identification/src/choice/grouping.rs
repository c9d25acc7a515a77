//! Finding the motions of a recording: conditions, runs, clusters of speed, or, where there is one motion alone, blocks
//! of time; host.
//!
//! 1. The columns that the description names (`choice.group_by`), and nothing else.
//! 2. Columns of the table of runs whose values several runs share (trajectory, load, gain, session): the two whose
//!    groups visit most states that no other group visits. A column that numbers repetitions visits none and is no
//!    condition.
//! 3. Runs, where there are three or more; similar ones together where there are more than folds.
//! 4. Strokes between two reversals, by their peak speed in four clusters; beside them the two runs, or the four
//!    quarters of a single one.
//! 5. Blocks of time, where all strokes are alike.

use super::folds::{Folds, MOST_FOLDS};
use crate::dataset::Recording;
use crate::samples::{Part, Samples};
use std::collections::{BTreeMap, HashMap};

/// Folds of each of two groupings, and clusters of speed.
const HALF: usize = MOST_FOLDS / 2;
/// Cells on each axis of the states that are compared: position, velocity, effort.
const CELLS: usize = 10;
/// A second grouping counts when it visits at least this share of the states that the first one visits alone.
const SECOND: f64 = 0.5;
/// Clusters of speed differ when the mean peak of the fastest is at least this many times that of the slowest.
const FASTER: f64 = 1.5;
/// Blocks of time in the whole recording, dealt to [`TIME_FOLDS`] folds in turn.
const BLOCKS: usize = 40;
/// Folds over blocks of time.
const TIME_FOLDS: usize = 5;

/// The texts of one column, sample by sample.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Labels {
    /// Name of the column.
    pub column: String,
    /// The different texts.
    pub words: Vec<String>,
    /// Index of each sample's text.
    pub codes: Vec<u32>,
}

/// A column that the description names and the recordings do not have.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "choice.group_by names the column {0:?}, whose values do not make two folds of the samples for training and validation"
)]
pub struct NoGroups(pub String);

/// Groups of samples in an order in which neighbours are alike, with the group of each sample that is used.
struct Groups {
    what: String,
    names: Vec<String>,
    of: Vec<Option<usize>>,
}

/// The folds of a recording. `labels` are the columns of the table of runs and those that `group_by` names. Only
/// training and validation samples are looked at.
pub fn find(
    samples: &Samples,
    recordings: &[Recording],
    labels: &[Labels],
    group_by: &[String],
) -> Result<Folds, NoGroups> {
    let used = used(samples);
    let runs = runs(samples, recordings, &used);
    let mut folds = Folds { motions: true, left_out: vec![0; samples.len()], ..Folds::default() };
    if !group_by.is_empty() {
        let most = (MOST_FOLDS / group_by.len()).max(2);
        for name in group_by {
            let groups = match (name.as_str(), labels.iter().find(|labels| labels.column == *name)) {
                (_, Some(labels)) => by_label(labels, &used),
                ("run", None) => runs.clone_of(),
                ("file", None) => by_file(samples, recordings, &used),
                _ => return Err(NoGroups(name.clone())),
            };
            if take(&mut folds, groups, most) < 2 {
                return Err(NoGroups(name.clone()));
            }
        }
        folds.several = true;
        return Ok(folds);
    }
    let conditions = conditions(samples, labels, &used, runs.names.len());
    let most = if conditions.len() > 1 { HALF } else { MOST_FOLDS };
    conditions.into_iter().for_each(|groups| {
        take(&mut folds, groups, most);
    });
    if folds.len() >= 2 {
        folds.several = true;
        return Ok(folds);
    }
    let single = runs.names.len() < 2;
    if !single {
        let few = runs.names.len() < 3;
        take(&mut folds, runs, MOST_FOLDS);
        if !few && folds.len() >= 2 {
            folds.several = true;
            return Ok(folds);
        }
    }
    if let Some(strokes) = strokes(samples, &used) {
        take(&mut folds, strokes, HALF);
        if single && !folds.is_empty() {
            take(&mut folds, quarters(&used), HALF);
        }
    }
    if folds.len() < 2 {
        folds = of_time(samples);
    }
    Ok(folds)
}

/// The samples that are used in four contiguous parts of about as many.
fn quarters(used: &[bool]) -> Groups {
    let count = used.iter().filter(|used| **used).count().max(1);
    let mut seen = 0;
    let part = |used: &bool| {
        used.then(|| {
            seen += 1;
            (seen - 1) * HALF / count
        })
    };
    Groups {
        what: "quarter of the recording".into(),
        names: (1..=HALF).map(|n| n.to_string()).collect(),
        of: used.iter().map(part).collect(),
    }
}

/// Folds of blocks of time: what is left where nothing tells motions apart.
pub fn of_time(samples: &Samples) -> Folds {
    let count = used(samples).iter().filter(|used| **used).count().max(1);
    let mut seen = 0;
    let of = samples.part.iter().map(|part| {
        matches!(part, Part::Train | Part::Validation).then(|| {
            seen += 1;
            (seen - 1) * BLOCKS / count % TIME_FOLDS
        })
    });
    let of: Vec<Option<usize>> = of.collect();
    let mut folds = Folds { left_out: vec![0; samples.len()], ..Folds::default() };
    folds.add((1..=TIME_FOLDS).map(|n| format!("blocks of time, {n} of {TIME_FOLDS}")).collect(), &of);
    folds.grouping =
        format!("{} folds of blocks of time: one motion, so nothing is known about other motions", folds.len());
    folds
}

fn used(samples: &Samples) -> Vec<bool> {
    samples.part.iter().map(|part| matches!(part, Part::Train | Part::Validation)).collect()
}

impl Groups {
    fn clone_of(&self) -> Self {
        Self { what: self.what.clone(), names: self.names.clone(), of: self.of.clone() }
    }

    /// The same samples in at most `most` groups: neighbours are joined until the groups are about as large.
    fn merged(self, most: usize) -> Self {
        if self.names.len() <= most {
            return self;
        }
        let mut sizes = vec![0usize; self.names.len()];
        self.of.iter().flatten().for_each(|&group| sizes[group] += 1);
        let all: usize = sizes.iter().sum();
        let mut before = 0;
        let target: Vec<usize> = sizes
            .iter()
            .map(|&size| {
                let middle = 2 * before + size;
                before += size;
                (middle * most / (2 * all).max(1)).min(most - 1)
            })
            .collect();
        let names = (0..most).map(|fold| {
            let mut members = self.names.iter().zip(&target).filter(|(_, t)| **t == fold).map(|(name, _)| name);
            match (members.next(), members.next_back()) {
                (Some(first), Some(last)) => format!("{first} … {last}"),
                (Some(only), None) => only.clone(),
                _ => String::new(),
            }
        });
        let names = names.collect();
        Self { what: self.what, names, of: self.of.iter().map(|group| group.map(|group| target[group])).collect() }
    }
}

/// Adds the groups as folds; how many there are.
fn take(folds: &mut Folds, groups: Groups, most: usize) -> usize {
    let what = groups.what.clone();
    let merged = groups.merged(most);
    let names = merged.names.iter().map(|name| format!("{what} {name}")).collect();
    let added = folds.add(names, &merged.of);
    if added > 0 {
        let text = format!("{added} by {what}");
        folds.grouping = match folds.grouping.is_empty() {
            true => format!("folds of whole motions: {text}"),
            false => format!("{}, {text}", folds.grouping),
        };
    }
    added
}

/// The groups of one column, ascending where the texts are numbers.
fn by_label(labels: &Labels, used: &[bool]) -> Groups {
    let mut order: Vec<usize> = (0..labels.words.len()).collect();
    let numbers: Option<Vec<f64>> = labels.words.iter().map(|word| word.parse().ok()).collect();
    match &numbers {
        Some(numbers) => order.sort_by(|&a, &b| numbers[a].total_cmp(&numbers[b])),
        None => order.sort_by(|&a, &b| labels.words[a].cmp(&labels.words[b])),
    }
    let mut present = vec![false; labels.words.len()];
    labels.codes.iter().zip(used).filter(|(_, used)| **used).for_each(|(&code, _)| present[code as usize] = true);
    order.retain(|&word| present[word]);
    let place: HashMap<usize, usize> = order.iter().enumerate().map(|(place, &word)| (word, place)).collect();
    let of = labels
        .codes
        .iter()
        .zip(used)
        .map(|(&code, &used)| if used { place.get(&(code as usize)).copied() } else { None });
    Groups {
        what: labels.column.clone(),
        of: of.collect(),
        names: order.into_iter().map(|word| labels.words[word].clone()).collect(),
    }
}

/// Runs as recorded, by their root mean square speed.
fn runs(samples: &Samples, recordings: &[Recording], used: &[bool]) -> Groups {
    let key = |i: usize| {
        let recording = &recordings[samples.run[i] as usize];
        (recording.file.as_str(), recording.label.as_str())
    };
    let mut squares: BTreeMap<(&str, &str), (f64, usize)> = BTreeMap::new();
    for i in (0..samples.len()).filter(|&i| used[i]) {
        let (sum, count) = squares.entry(key(i)).or_default();
        *sum += samples.velocity[i].powi(2);
        *count += 1;
    }
    let mut order: Vec<((&str, &str), f64)> =
        squares.into_iter().map(|(key, (sum, count))| (key, sum / count as f64)).collect();
    order.sort_by(|a, b| a.1.total_cmp(&b.1));
    let place: HashMap<(&str, &str), usize> = order.iter().enumerate().map(|(place, (key, _))| (*key, place)).collect();
    let of = (0..samples.len()).map(|i| if used[i] { place.get(&key(i)).copied() } else { None }).collect();
    let names = order.iter().map(|((_, label), _)| (*label).to_owned()).collect();
    Groups { what: "run".into(), names, of }
}

fn by_file(samples: &Samples, recordings: &[Recording], used: &[bool]) -> Groups {
    let mut names: Vec<String> = Vec::new();
    let mut of = Vec::with_capacity(samples.len());
    for (&run, &used) in samples.run.iter().zip(used) {
        let file = &recordings[run as usize].file;
        of.push(used.then(|| {
            names.iter().position(|name| name == file).unwrap_or_else(|| {
                names.push(file.clone());
                names.len() - 1
            })
        }));
    }
    Groups { what: "file".into(), names, of }
}

/// Columns of conditions, up to two, the one that tells motions apart best first.
fn conditions(samples: &Samples, labels: &[Labels], used: &[bool], runs: usize) -> Vec<Groups> {
    let cells = cells(samples, used);
    let mut found: Vec<(f64, Groups)> = Vec::new();
    for labels in labels {
        let groups = by_label(labels, used);
        if (2..=runs / 2).contains(&groups.names.len()) {
            let groups = groups.merged(MOST_FOLDS);
            found.push((novelty(&groups, &cells), groups));
        }
    }
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    let limit = SECOND * found.first().map_or(0.0, |(novelty, _)| *novelty);
    let taken = found.into_iter().take(2).filter(|(novelty, _)| *novelty > 0.0 && *novelty >= limit);
    taken.map(|(_, groups)| groups).collect()
}

/// The cell of position, velocity and effort of every sample.
fn cells(samples: &Samples, used: &[bool]) -> Vec<u16> {
    let mut cells = vec![0u16; samples.len()];
    for values in [&samples.position, &samples.velocity, &samples.effort] {
        let (low, high) = range(values, used, 0.01);
        for (cell, value) in cells.iter_mut().zip(values) {
            let place = ((value - low) / (high - low).max(f64::MIN_POSITIVE) * CELLS as f64).max(0.0) as usize;
            *cell = *cell * CELLS as u16 + place.min(CELLS - 1) as u16;
        }
    }
    cells
}

/// The range that holds all but `tail` of the used values at either end.
fn range(values: &[f64], used: &[bool], tail: f64) -> (f64, f64) {
    let mut sorted: Vec<f64> = values.iter().zip(used).filter(|(_, used)| **used).map(|(value, _)| *value).collect();
    sorted.sort_by(f64::total_cmp);
    let at = |share: f64| sorted.get(((sorted.len().max(1) - 1) as f64 * share) as usize).copied().unwrap_or(0.0);
    (at(tail), at(1.0 - tail))
}

/// Mean over the groups of the share of their samples in cells that no other group visits.
fn novelty(groups: &Groups, cells: &[u16]) -> f64 {
    let mut visits: HashMap<u16, Vec<u32>> = HashMap::new();
    let mut sizes = vec![0u32; groups.names.len()];
    for (cell, group) in cells.iter().zip(&groups.of) {
        if let Some(group) = *group {
            visits.entry(*cell).or_insert_with(|| vec![0; groups.names.len()])[group] += 1;
            sizes[group] += 1;
        }
    }
    let mut alone = vec![0u32; groups.names.len()];
    for counts in visits.values() {
        let mut visitors = counts.iter().enumerate().filter(|(_, count)| **count > 0);
        if let (Some((group, count)), None) = (visitors.next(), visitors.next()) {
            alone[group] += count;
        }
    }
    let shares = alone.iter().zip(&sizes).map(|(&alone, &size)| f64::from(alone) / f64::from(size.max(1)));
    shares.sum::<f64>() / sizes.len().max(1) as f64
}

/// Strokes between two reversals in four clusters of peak speed; nothing where the clusters hardly differ.
fn strokes(samples: &Samples, used: &[bool]) -> Option<Groups> {
    let mut strokes: Vec<(f64, usize)> = Vec::new();
    let mut stroke_of: Vec<Option<usize>> = vec![None; samples.len()];
    let mut last = None;
    for i in 0..samples.len() {
        let key = (samples.run[i], samples.velocity[i] < 0.0);
        if last != Some(key) {
            strokes.push((0.0, 0));
            last = Some(key);
        }
        if used[i] {
            let at = strokes.len() - 1;
            strokes[at].0 = strokes[at].0.max(samples.velocity[i].abs());
            strokes[at].1 += 1;
            stroke_of[i] = Some(at);
        }
    }
    let mut order: Vec<usize> = (0..strokes.len()).filter(|&stroke| strokes[stroke].1 > 0).collect();
    order.sort_by(|&a, &b| strokes[a].0.total_cmp(&strokes[b].0));
    let place: HashMap<usize, usize> = order.iter().enumerate().map(|(place, &stroke)| (stroke, place)).collect();
    let groups = Groups {
        what: "peak speed".into(),
        names: order.iter().map(|&stroke| format!("{:.3}", strokes[stroke].0)).collect(),
        of: stroke_of.into_iter().map(|stroke| stroke.and_then(|stroke| place.get(&stroke).copied())).collect(),
    };
    let peak_of: Vec<f64> = order.iter().map(|&stroke| strokes[stroke].0).collect();
    let original = groups.of.clone();
    let merged = groups.merged(HALF);
    let mut sums = vec![(0.0, 0usize); merged.names.len()];
    for (fold, stroke) in merged.of.iter().zip(&original) {
        if let (Some(fold), Some(stroke)) = (*fold, *stroke) {
            sums[fold].0 += peak_of[stroke];
            sums[fold].1 += 1;
        }
    }
    let means: Vec<f64> = sums.into_iter().filter(|(_, n)| *n > 0).map(|(sum, n)| sum / n as f64).collect();
    let differ = means.len() > 1 && means[means.len() - 1] >= FASTER * means[0];
    differ.then_some(merged)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `runs` runs of ten strokes each at the peak speed that `peak` gives, 100 samples a stroke.
    fn recorded(runs: usize, peak: impl Fn(usize, usize) -> f64) -> (Samples, Vec<Recording>) {
        let mut samples = Samples::default();
        for run in 0..runs {
            for i in 0..1000 {
                let (stroke, phase) = (i / 100, (i % 100) as f64 / 100.0 * std::f64::consts::PI);
                let sign = if stroke % 2 == 0 { 1.0 } else { -1.0 };
                samples.velocity.push(sign * peak(run, stroke) * (phase + 0.01).sin());
                samples.position.push(-sign * phase.cos());
                samples.effort.push(sign);
                samples.time.push(i as f64 * 0.01);
                samples.run.push(run as u32);
                samples.part.push(if i % 10 == 9 { Part::Test } else { Part::Train });
            }
        }
        let recording = |run: usize| Recording { label: run.to_string(), file: "a.csv".into(), period: 0.01 };
        (samples, (0..runs).map(recording).collect())
    }

    fn labels(column: &str, samples: &Samples, word: impl Fn(u32) -> usize) -> Labels {
        let codes: Vec<u32> = samples.run.iter().map(|&run| word(run) as u32).collect();
        let words = (0..=*codes.iter().max().unwrap()).map(|code| code.to_string()).collect();
        Labels { column: column.into(), words, codes }
    }

    #[test]
    fn no_test_sample_is_in_a_fold_and_every_other_one_is() {
        let (samples, recordings) = recorded(4, |run, _| 1.0 + run as f64);
        let folds = find(&samples, &recordings, &[], &[]).unwrap();
        for (part, left_out) in samples.part.iter().zip(&folds.left_out) {
            assert_eq!(*part == Part::Test, *left_out == 0);
        }
    }

    #[test]
    fn runs_are_left_out_whole_and_similar_ones_together() {
        let (samples, recordings) = recorded(12, |run, _| 1.0 + run as f64);
        let folds = find(&samples, &recordings, &[], &[]).unwrap();
        assert_eq!((folds.len(), folds.motions, folds.several), (MOST_FOLDS, true, true));
        let of_run = |run: usize| folds.left_out[run * 1000];
        for (i, part) in samples.part.iter().enumerate().filter(|(_, part)| **part == Part::Train) {
            assert_eq!(folds.left_out[i], of_run(samples.run[i] as usize), "{part:?}");
        }
        assert!(of_run(0) == of_run(1) || of_run(1) == of_run(2));
        assert_ne!(of_run(0), of_run(11));
    }

    #[test]
    fn a_condition_that_changes_the_motion_is_taken_and_repetitions_are_not() {
        let (samples, recordings) = recorded(12, |run, _| [1.0, 2.5, 4.0][run % 3]);
        let columns = [
            labels("repetition", &samples, |run| run as usize / 3 % 2),
            labels("speed", &samples, |run| run as usize % 3),
        ];
        let folds = find(&samples, &recordings, &columns, &[]).unwrap();
        assert_eq!(folds.names, ["speed 0", "speed 1", "speed 2"]);
        let chosen = find(&samples, &recordings, &columns, &["repetition".into()]).unwrap();
        assert_eq!(chosen.names, ["repetition 0", "repetition 1"]);
        assert!(folds.several && chosen.several);
        assert!(find(&samples, &recordings, &columns, &["load".into()]).unwrap_err().to_string().contains("\"load\""));
    }

    #[test]
    fn one_run_is_divided_by_the_peak_speed_of_its_strokes() {
        let (samples, recordings) = recorded(1, |_, stroke| [0.5, 1.0, 2.0, 3.0, 4.0][stroke % 5]);
        let folds = find(&samples, &recordings, &[], &[]).unwrap();
        assert!(folds.motions && folds.grouping.contains("peak speed"), "{}", folds.grouping);
        assert!(!folds.several);
        let speeds = folds.names.iter().take_while(|name| name.starts_with("peak speed")).count();
        assert_eq!((speeds, folds.len()), (4, 8), "beside the quarters of the recording");
        // A stroke is never divided.
        for stroke in samples.part.chunks(100).zip(folds.left_out.chunks(100)) {
            let used: Vec<u8> =
                stroke.1.iter().zip(stroke.0).filter(|(_, p)| **p == Part::Train).map(|(f, _)| *f & 0x0f).collect();
            assert!(used.iter().all(|f| *f == used[0]));
        }
    }

    #[test]
    fn clusters_of_speed_differ_from_one_and_a_half_times_on() {
        let folds = |ratio: f64| {
            let (samples, recordings) = recorded(1, |_, stroke| 1.0 + (ratio - 1.0) * (stroke / 2) as f64 / 4.0);
            find(&samples, &recordings, &[], &[]).unwrap()
        };
        assert!(folds(1.9).motions);
        assert!(!folds(1.3).motions && folds(1.3).grouping.contains("nothing is known about other motions"));
    }
}
