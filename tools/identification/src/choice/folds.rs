//! Folds of a cross-validation over motions: which samples each of them leaves out; host.

/// Most folds: one bit each of a byte.
pub const MOST_FOLDS: usize = 8;
/// Fewest samples that a fold judges, and a fiftieth of all at least.
pub const LEAST_JUDGED: usize = 50;
/// Fewest samples that a fold leaves to fit.
pub const LEAST_FITTED: usize = 200;

/// Folds, up to [`MOST_FOLDS`]. A sample may be left out by several: of two groupings, each leaves it out once.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Folds {
    /// The groupings that the folds are of, in words.
    pub grouping: String,
    /// True where the folds leave out motions; false where they are blocks of time of one motion, which say nothing
    /// about other motions.
    pub motions: bool,
    /// True where they leave out whole runs or conditions of several, not parts of one or two runs.
    pub several: bool,
    /// Number of the grouping that each fold is of, from 0.
    pub groupings: Vec<usize>,
    /// Name of each fold: the motions that it leaves out.
    pub names: Vec<String>,
    /// Folds that leave each sample out, one bit each from bit 0; 0 for a sample that is not used.
    pub left_out: Vec<u8>,
}

impl Folds {
    /// Number of folds.
    pub fn len(&self) -> usize {
        self.names.len()
    }

    /// True where there is no fold.
    pub fn is_empty(&self) -> bool {
        self.names.is_empty()
    }

    /// True where the fold leaves the sample out.
    pub fn leaves_out(&self, fold: usize, sample: usize) -> bool {
        self.left_out[sample] >> fold & 1 == 1
    }

    /// Adds the folds of one grouping: `group` is the fold of each sample that is used, below `names.len()`. Folds that
    /// would judge or leave too few samples are not added, and none beyond [`MOST_FOLDS`]. Returns how many were
    /// added.
    pub(super) fn add(&mut self, names: Vec<String>, group: &[Option<usize>]) -> usize {
        self.left_out.resize(group.len(), 0);
        let mut sizes = vec![0; names.len()];
        group.iter().flatten().for_each(|&fold| sizes[fold] += 1);
        let all: usize = sizes.iter().sum();
        let before = self.len();
        let grouping = self.groupings.last().map_or(0, |last| last + 1);
        for (place, name) in names.into_iter().enumerate() {
            let fits = sizes[place] >= LEAST_JUDGED.max(all / 50) && all - sizes[place] >= LEAST_FITTED;
            if !fits || self.len() == MOST_FOLDS {
                continue;
            }
            let bit = 1 << self.len();
            self.names.push(name);
            self.groupings.push(grouping);
            for (left_out, _) in self.left_out.iter_mut().zip(group).filter(|(_, fold)| **fold == Some(place)) {
                *left_out |= bit;
            }
        }
        self.len() - before
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn added(sizes: &[usize]) -> Folds {
        let group: Vec<Option<usize>> =
            sizes.iter().enumerate().flat_map(|(fold, &size)| std::iter::repeat_n(Some(fold), size)).collect();
        let mut folds = Folds::default();
        folds.add((0..sizes.len()).map(|i| i.to_string()).collect(), &group);
        folds
    }

    #[test]
    fn a_fold_judges_at_least_fifty_samples() {
        assert_eq!(added(&[300, 50, 300]).names, ["0", "1", "2"]);
        assert_eq!(added(&[300, 49, 300]).names, ["0", "2"]);
    }

    #[test]
    fn a_fold_judges_at_least_a_fiftieth_of_the_samples() {
        assert_eq!(added(&[4900, 100, 5000 - 4900 + 4900]).names.len(), 2);
        assert_eq!(added(&[4900, 200, 4900]).names, ["0", "1", "2"]);
        assert_eq!(added(&[4900, 199, 4901]).names, ["0", "2"]);
    }

    #[test]
    fn a_fold_leaves_at_least_two_hundred_samples() {
        assert_eq!(added(&[1000, 200]).names, ["0", "1"]);
        assert_eq!(added(&[1000, 199]).names, ["1"]);
    }

    #[test]
    fn there_are_at_most_eight_folds() {
        assert_eq!(added(&[100; 8]).len(), 8);
        assert_eq!(added(&[100; 9]).len(), 8);
    }

    #[test]
    fn a_second_grouping_leaves_samples_out_once_more() {
        let mut folds = added(&[200, 200]);
        let second: Vec<Option<usize>> = (0..400).map(|i| Some(i % 2)).collect();
        assert_eq!(folds.add(vec!["even".into(), "odd".into()], &second), 2);
        assert!(folds.leaves_out(0, 0) && folds.leaves_out(2, 0) && !folds.leaves_out(1, 0) && !folds.leaves_out(3, 0));
        assert!(folds.leaves_out(1, 399) && folds.leaves_out(3, 399));
    }
}
