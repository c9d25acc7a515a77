//! Making rare motions count: a joint spends most of a recording at a few speeds, and a network learns only those;
//! host.
//!
//! Samples are sorted into strata of velocity, sign of the acceleration and load. The frequency of each stratum is
//! moved from what it is in the recording towards the same for all, either by drawing samples or by weighting them.

use crate::samples::{Part, Samples};
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use std::collections::BTreeMap;

/// Settings of the equalisation of samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Equalise {
    /// Most samples that a draw returns.
    pub limit: usize,
    /// 0 keeps the frequencies of the recording, 1 makes all strata equally frequent.
    pub blend: f64,
    /// Classes of velocity between its extremes.
    pub velocity_classes: usize,
    /// Classes of load between its extremes; 1 where the load does not matter or is not identified yet.
    pub load_classes: usize,
    /// Seed of the draw.
    pub seed: u64,
}

impl Default for Equalise {
    fn default() -> Self {
        Equalise { limit: 20_000, blend: 0.5, velocity_classes: 16, load_classes: 1, seed: 0 }
    }
}

/// Draws at most `limit` samples of `part`, ascending and none twice.
///
/// A stratum with fewer samples than its share gives all it has, and the others share the rest.
pub fn draw(samples: &Samples, part: Part, options: &Equalise) -> Vec<usize> {
    let indices = samples.indices(part);
    if indices.len() <= options.limit {
        return indices;
    }
    let mut strata: Vec<Vec<usize>> = strata(samples, &indices, options).into_values().collect();
    let sizes: Vec<usize> = strata.iter().map(Vec::len).collect();
    let quotas = quotas(&sizes, &frequencies(&sizes, options.blend), options.limit);
    let mut random = ChaCha8Rng::seed_from_u64(options.seed);
    let mut drawn = Vec::with_capacity(options.limit);
    for (stratum, quota) in strata.iter_mut().zip(quotas) {
        stratum.shuffle(&mut random);
        drawn.extend(&stratum[..quota]);
    }
    drawn.sort_unstable();
    drawn
}

/// A weight for each of `indices`, with a mean of 1, that gives its stratum the blended frequency.
pub fn weights(samples: &Samples, indices: &[usize], options: &Equalise) -> Vec<f64> {
    let strata = strata(samples, indices, options);
    let sizes: Vec<usize> = strata.values().map(Vec::len).collect();
    let mut weight = BTreeMap::new();
    for ((stratum, frequency), size) in strata.values().zip(frequencies(&sizes, options.blend)).zip(&sizes) {
        for &index in stratum {
            weight.insert(index, frequency * indices.len() as f64 / *size as f64);
        }
    }
    indices.iter().map(|index| weight[index]).collect()
}

/// Velocity class, sign of the acceleration (0 in uniform motion), load class.
type Stratum = (usize, i8, usize);

fn strata(samples: &Samples, indices: &[usize], options: &Equalise) -> BTreeMap<Stratum, Vec<usize>> {
    let velocity = Classes::of(&samples.velocity, indices, options.velocity_classes);
    let load = Classes::of(&samples.load, indices, options.load_classes);
    let mut strata: BTreeMap<Stratum, Vec<usize>> = BTreeMap::new();
    for &i in indices {
        let sign = match (samples.state.get(i).is_some_and(|s| s.accelerating), samples.acceleration[i] > 0.0) {
            (false, _) => 0,
            (true, true) => 1,
            (true, false) => -1,
        };
        let key = (velocity.class(&samples.velocity, i), sign, load.class(&samples.load, i));
        strata.entry(key).or_default().push(i);
    }
    strata
}

/// Classes of equal width between the extremes of a signal.
struct Classes {
    low: f64,
    width: f64,
    count: usize,
}

impl Classes {
    fn of(values: &[f64], indices: &[usize], count: usize) -> Classes {
        let known = indices.iter().filter_map(|&i| values.get(i));
        let (low, high) = known.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), &x| (l.min(x), h.max(x)));
        Classes { low, width: (high - low) / count.max(1) as f64, count: count.max(1) }
    }

    /// Class of sample `i`; 0 for a signal that is not there or does not vary.
    fn class(&self, values: &[f64], i: usize) -> usize {
        match values.get(i) {
            Some(&x) if self.width > 0.0 => (((x - self.low) / self.width) as usize).min(self.count - 1),
            _ => 0,
        }
    }
}

/// Blended frequency of each stratum; they add up to 1.
fn frequencies(sizes: &[usize], blend: f64) -> Vec<f64> {
    let total: usize = sizes.iter().sum();
    let blend = blend.clamp(0.0, 1.0);
    sizes.iter().map(|&size| (1.0 - blend) * size as f64 / total as f64 + blend / sizes.len() as f64).collect()
}

/// Number of samples from each stratum: `limit` in all, none more than it has. `limit` is at most the sum of sizes.
fn quotas(sizes: &[usize], frequencies: &[f64], limit: usize) -> Vec<usize> {
    let mut quotas = vec![0; sizes.len()];
    let mut open: Vec<usize> = (0..sizes.len()).collect();
    let mut left = limit;
    loop {
        let total: f64 = open.iter().map(|&k| frequencies[k]).sum();
        let share = |k: usize| left as f64 * frequencies[k] / total;
        let (full, rest): (Vec<usize>, Vec<usize>) = open.iter().partition(|&&k| share(k) >= sizes[k] as f64);
        if full.is_empty() {
            // Largest remainders first, so that exactly the limit is drawn.
            let mut remainders: Vec<(f64, usize)> = Vec::new();
            for &k in &rest {
                quotas[k] = share(k).floor() as usize;
                remainders.push((share(k).fract(), k));
            }
            remainders.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
            let given: usize = rest.iter().map(|&k| quotas[k]).sum();
            remainders.iter().take(left.saturating_sub(given)).for_each(|&(_, k)| quotas[k] += 1);
            return quotas;
        }
        for k in full {
            quotas[k] = sizes[k];
            left = left.saturating_sub(sizes[k]);
        }
        open = rest;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples::MotionState;

    /// 9,000 slow samples, 900 fast ones, 100 fast and accelerating ones.
    fn samples() -> Samples {
        let kind = |i: usize| if i < 9000 { 0 } else { 1 + usize::from(i >= 9900) };
        let of = |values: [f64; 3]| (0..10_000).map(|i| values[kind(i)]).collect::<Vec<f64>>();
        Samples {
            time: of([0.0; 3]),
            velocity: of([0.1, 1.0, 1.0]),
            acceleration: of([0.0, 0.0, 2.0]),
            part: vec![Part::Train; 10_000],
            state: (0..10_000).map(|i| MotionState { accelerating: kind(i) == 2, fast: kind(i) > 0 }).collect(),
            ..Samples::default()
        }
    }

    fn counts(drawn: &[usize]) -> [usize; 3] {
        let below = |limit: usize| drawn.iter().filter(|&&i| i < limit).count();
        [below(9000), below(9900) - below(9000), drawn.len() - below(9900)]
    }

    #[test]
    fn without_blending_a_draw_keeps_the_frequencies_of_the_recording() {
        let options = Equalise { limit: 1000, blend: 0.0, ..Equalise::default() };
        assert_eq!(counts(&draw(&samples(), Part::Train, &options)), [900, 90, 10]);
    }

    #[test]
    fn full_blending_takes_all_of_a_rare_stratum_and_shares_the_rest() {
        let options = Equalise { limit: 1000, blend: 1.0, ..Equalise::default() };
        assert_eq!(counts(&draw(&samples(), Part::Train, &options)), [450, 450, 100]);
    }

    #[test]
    fn a_draw_has_no_sample_twice_and_depends_only_on_the_seed() {
        let options = Equalise { limit: 777, blend: 0.3, ..Equalise::default() };
        let drawn = draw(&samples(), Part::Train, &options);
        assert_eq!(drawn.len(), 777);
        assert!(drawn.windows(2).all(|pair| pair[0] < pair[1]));
        assert_eq!(drawn, draw(&samples(), Part::Train, &options));
        assert_ne!(drawn, draw(&samples(), Part::Train, &Equalise { seed: 1, ..options }));
    }

    #[test]
    fn fewer_samples_than_the_limit_are_all_returned() {
        let drawn = draw(&samples(), Part::Train, &Equalise { limit: 10_000, ..Equalise::default() });
        assert_eq!(drawn.len(), 10_000);
        assert!(draw(&samples(), Part::Test, &Equalise::default()).is_empty());
    }

    #[test]
    fn weights_have_a_mean_of_one_and_give_every_stratum_its_frequency() {
        let samples = samples();
        let indices = samples.indices(Part::Train);
        let weights = weights(&samples, &indices, &Equalise { blend: 1.0, ..Equalise::default() });
        assert!((weights.iter().sum::<f64>() - 10_000.0).abs() < 1e-6);
        let rare: f64 = weights[9900..].iter().sum();
        assert!((rare - 10_000.0 / 3.0).abs() < 1e-6, "{rare}");
    }

    #[test]
    fn the_load_makes_strata_of_its_own() {
        let mut samples = samples();
        samples.load = (0..10_000).map(|i| f64::from(u8::from(i < 10))).collect();
        let options = Equalise { limit: 400, blend: 1.0, load_classes: 2, ..Equalise::default() };
        let drawn = draw(&samples, Part::Train, &options);
        assert_eq!(drawn.iter().filter(|&&i| i < 10).count(), 10);
    }
}
