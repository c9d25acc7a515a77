//! The box that a model was identified in, from robust coverage of the samples; host.
//!
//! The most extreme samples of a recording are few, often at reversals or where a filter rings, and the box between
//! them is mostly empty. The box ends where samples are left: at the [`TAIL`] quantiles of each signal, but it is never
//! narrower than nine tenths of the whole range on that account, so that it does not lose what a recording visits
//! rarely on purpose.

use crate::joint_model::network_inputs;
use crate::network::INPUTS;
use crate::samples::{Part, Samples};

/// Share of the samples beyond each end of the box.
const TAIL: f64 = 0.0005;
/// Part of the range by which each end may move inwards.
const MOST: f64 = 0.05;

/// The ends of the box of one signal. No value: (0, 0).
pub(super) fn ends(mut values: Vec<f64>) -> (f64, f64) {
    values.sort_by(f64::total_cmp);
    let (Some(&lowest), Some(&highest)) = (values.first(), values.last()) else { return (0.0, 0.0) };
    let place = (TAIL * values.len() as f64) as usize;
    let room = MOST * (highest - lowest);
    (values[place].min(lowest + room), values[values.len() - 1 - place].max(highest - room))
}

/// Ends of the box of every input of a network, over the samples for training and validation.
pub(super) fn trained(samples: &Samples) -> ([f64; INPUTS], [f64; INPUTS]) {
    let used: Vec<[f64; INPUTS]> = used(samples).map(|i| network_inputs(samples, i)).collect();
    let ends: [(f64, f64); INPUTS] = std::array::from_fn(|input| ends(used.iter().map(|row| row[input]).collect()));
    (ends.map(|(low, _)| low), ends.map(|(_, high)| high))
}

/// The samples for training and validation.
pub(super) fn used(samples: &Samples) -> impl Iterator<Item = usize> {
    (0..samples.len()).filter(|&i| matches!(samples.part[i], Part::Train | Part::Validation))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn single_extreme_samples_do_not_widen_the_box_much() {
        let mut values: Vec<f64> = (0..10_000).map(|i| f64::from(i) / 10_000.0).collect();
        assert_eq!(ends(values.clone()), (0.0005, 0.9994));
        values.push(1.03);
        assert!(ends(values.clone()).1 < 1.0);
        // An end moves by a twentieth of the range at the most.
        values.push(3.0);
        assert!((ends(values).1 - 2.85).abs() < 1e-9);
    }

    #[test]
    fn short_recordings_keep_their_whole_range() {
        assert_eq!(ends((0..1_999).map(f64::from).collect()), (0.0, 1998.0));
        assert_eq!(ends(vec![]), (0.0, 0.0));
    }
}
