//! Reduction of many samples to few marks: thinning, ranges that outliers do not spoil, and means over bins; host.

use std::ops::Range;

/// Points that one cloud may have.
pub const CLOUD_POINTS: usize = 4000;

/// Indices of at most `limit` of `count` samples, in order.
///
/// A sample is kept by the fractional part of its index times the golden ratio: spread evenly, and yet not in step with
/// a periodic motion as every n-th sample would be.
pub fn thin(count: usize, limit: usize) -> Vec<usize> {
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    if count <= limit {
        return (0..count).collect();
    }
    let share = limit as f64 / count as f64;
    let mut kept: Vec<usize> = (0..count).filter(|&i| (i as f64 * GOLDEN).fract() < share).collect();
    kept.truncate(limit);
    kept
}

/// Smallest and largest value, 0..0 where there is none.
pub fn extent(values: impl IntoIterator<Item = f64>) -> Range<f64> {
    let (low, high) = values.into_iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
    if low <= high { low..high } else { 0.0..0.0 }
}

/// `range` with a margin of `share` of its length on both sides.
pub fn widen(range: Range<f64>, share: f64) -> Range<f64> {
    let margin = share * (range.end - range.start);
    range.start - margin..range.end + margin
}

/// The range of `values` with a margin, but not much more than what holds 99 % of them: a few spikes must not press the
/// rest flat.
pub fn robust_extent(values: &[f64]) -> Range<f64> {
    let all = extent(values.iter().copied());
    let (low, high) = (quantile(values, 0.005), quantile(values, 0.995));
    let allowed = widen(low..high, 0.5);
    widen(all.start.max(allowed.start)..all.end.min(allowed.end), 0.05)
}

/// The value below which `share` of the values lie (nearest rank); 0 where there is none.
pub fn quantile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let rank = (share * sorted.len().saturating_sub(1) as f64).round() as usize;
    sorted.get(rank).copied().unwrap_or(0.0)
}

/// The samples whose abscissa falls into one bin.
#[derive(Clone, Debug, PartialEq)]
pub struct Bin {
    /// Mean abscissa of its samples.
    pub x: f64,
    /// Mean value.
    pub mean: f64,
    /// Standard deviation of the value.
    pub deviation: f64,
    /// Median value.
    pub median: f64,
}

/// `count` bins of equal width over the range of `x`; where that range holds zero, zero is the edge of a bin, because
/// friction jumps there. Bins with less than `least` samples are left out.
pub fn bins(x: &[f64], y: &[f64], count: usize, least: usize) -> Vec<Bin> {
    let range = extent(x.iter().copied());
    let width = (range.end - range.start) / count.max(1) as f64;
    if width <= 0.0 || !width.is_finite() {
        return bin(x.iter().copied().zip(y.iter().copied()).collect(), least).into_iter().collect();
    }
    let origin = if range.contains(&0.0) { (range.start / width).floor() * width } else { range.start };
    let mut members: Vec<Vec<(f64, f64)>> = vec![Vec::new(); count + 2];
    for (&x, &y) in x.iter().zip(y) {
        let place = ((x - origin) / width).floor().max(0.0) as usize;
        members[place.min(count + 1)].push((x, y));
    }
    members.into_iter().filter_map(|members| bin(members, least)).collect()
}

fn bin(members: Vec<(f64, f64)>, least: usize) -> Option<Bin> {
    if members.is_empty() || members.len() < least {
        return None;
    }
    let n = members.len() as f64;
    let x = members.iter().map(|(x, _)| x).sum::<f64>() / n;
    let mean = members.iter().map(|(_, y)| y).sum::<f64>() / n;
    let deviation = (members.iter().map(|(_, y)| (y - mean) * (y - mean)).sum::<f64>() / n).sqrt();
    let values: Vec<f64> = members.into_iter().map(|(_, y)| y).collect();
    Some(Bin { x, mean, deviation, median: quantile(&values, 0.5) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinning_keeps_the_limit_and_spreads_over_all_phases_of_a_period() {
        let kept = thin(100_000, CLOUD_POINTS);
        assert!(kept.len() <= CLOUD_POINTS && kept.len() > CLOUD_POINTS - 10, "{}", kept.len());
        let mut phases = [0; 25];
        kept.iter().for_each(|i| phases[i % 25] += 1);
        assert!(phases.iter().all(|&n| n > 100), "{phases:?}");
        assert_eq!(thin(3, 10), [0, 1, 2]);
    }

    #[test]
    fn a_spike_does_not_widen_the_range_much() {
        let mut values: Vec<f64> = (0..1000).map(|i| f64::from(i) / 1000.0).collect();
        values[500] = 1e6;
        let range = robust_extent(&values);
        assert!(range.start < 0.0 && range.end > 0.998 && range.end < 1.7, "{range:?}");
        assert_eq!(robust_extent(&[]), 0.0..0.0);
    }

    #[test]
    fn bins_have_the_moments_of_their_samples_and_an_edge_at_zero() {
        let found = bins(&[-1.0, -0.5, -0.1, 0.1, 1.0], &[-2.0, -2.0, -5.0, 1.0, 3.0], 2, 1);
        let expected = [
            Bin { x: -1.6 / 3.0, mean: -3.0, deviation: 2f64.sqrt(), median: -2.0 },
            Bin { x: 0.1, mean: 1.0, deviation: 0.0, median: 1.0 },
            Bin { x: 1.0, mean: 3.0, deviation: 0.0, median: 3.0 },
        ];
        assert_eq!(found.len(), 3);
        for (found, expected) in found.iter().zip(&expected) {
            let difference = (found.x - expected.x).abs() + (found.mean - expected.mean).abs();
            assert!(difference + (found.deviation - expected.deviation).abs() < 1e-12, "{found:?}");
            assert_eq!(found.median, expected.median);
        }
        assert_eq!(bins(&[2.0, 2.0], &[1.0, 3.0], 10, 1)[0].mean, 2.0);
        assert!(bins(&[], &[], 10, 1).is_empty());
    }
}
