//! The box of signals that a model was identified in: its scales, and how much a model counts beyond it.

use super::state::{SIGNALS, Signal};

/// A closed range of one signal, Q16.16; `low <= high`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Range {
    /// Lowest value.
    pub low: i32,
    /// Highest value.
    pub high: i32,
}

impl Range {
    /// The range of a signal that the model does not depend on: never left.
    pub const ANY: Self = Self { low: i32::MIN, high: i32::MAX };

    /// The value of the range that is nearest to `value`. (`i32::clamp` would panic on an inverted range.)
    #[inline(always)]
    pub fn nearest(self, value: i32) -> i32 {
        value.max(self.low).min(self.high)
    }

    /// Middle of the range, rounded up.
    pub const fn centre(self) -> i32 {
        ((self.low as i64 + self.high as i64 + 1) >> 1) as i32
    }

    /// Largest distance of an end from the centre: half the width, rounded up; at most 2^31.
    pub const fn half_width(self) -> u32 {
        let centre = self.centre() as i64;
        let (below, above) = (centre - self.low as i64, self.high as i64 - centre);
        (if below > above { below } else { above }) as u32
    }

    /// The range with `margin` (Q16.16, in half widths) added on both sides, cut at the limits of Q16.16.
    pub const fn widened(self, margin: u32) -> Self {
        let extra = (self.half_width() as u64 * margin as u64) >> 16;
        let extra = if extra > 1 << 32 { 1i64 << 32 } else { extra as i64 };
        let (low, high) = (self.low as i64 - extra, self.high as i64 + extra);
        Self {
            low: if low < i32::MIN as i64 { i32::MIN } else { low as i32 },
            high: if high > i32::MAX as i64 { i32::MAX } else { high as i32 },
        }
    }
}

/// The box of signals that a parameter set was trained in: one range a signal, in the order of [`Signal::ALL`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Domain {
    /// Trained ranges.
    pub ranges: [Range; SIGNALS],
    /// Distance beyond its half width at which a signal has faded the model out, Q16.16: the network has no weight left
    /// at one margin, the physical model none at two.
    pub margin: u32,
    /// Temperature at which the physical parameters hold, Q16.16.
    pub reference_temperature: i32,
}

impl Domain {
    /// The box with one margin added on every side: where the physical model is evaluated. Beyond it, signals are
    /// clamped.
    pub fn widened(&self) -> [Range; SIGNALS] {
        self.ranges.map(|range| range.widened(self.margin))
    }

    /// Full scale of each signal in the physical model, as the left shift that brings a signal of the widened box to
    /// Q31.
    ///
    /// Full scale is the smallest power of two that the signal's magnitude stays below in the widened box (temperature:
    /// the difference from the reference); in SI it is 2^(15 - shift).
    pub fn shifts(&self) -> [u32; SIGNALS] {
        let mut ranges = self.widened();
        let temperature = &mut ranges[Signal::Temperature as usize];
        temperature.low = temperature.low.saturating_sub(self.reference_temperature);
        temperature.high = temperature.high.saturating_sub(self.reference_temperature);
        ranges.map(|range| {
            let magnitude = range.low.unsigned_abs().max(range.high.unsigned_abs());
            magnitude.leading_zeros().saturating_sub(1).min(MAX_SHIFT)
        })
    }
}

/// A signal that is always zero would allow any shift; this is the largest.
const MAX_SHIFT: u32 = 30;

/// Weight of each part of a model in a state, Q31; `i32::MAX` is all.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Weights {
    /// Weight of the network: falls from the box's edge to nothing at one margin.
    pub network: i32,
    /// Weight of the physical model: falls from one margin to nothing at two.
    pub physical: i32,
    /// The signal that lowers a weight most, if any does.
    pub outside: Option<Signal>,
}

impl Weights {
    /// Full weights: nothing fades. No constant: the compiler would read that from flash.
    #[inline(always)]
    fn full() -> Self {
        Self { network: i32::MAX, physical: i32::MAX, outside: None }
    }
}

/// A signal's distance from its range, measured in margins.
#[derive(Clone, Copy, Debug)]
struct Edge {
    range: Range,
    /// Width of the margin, at least 1 step of Q16.16.
    margin: u32,
    /// The power of two that brings the margin's width to [2^31, 2^32).
    factor: u32,
    /// 2^63 divided by the width times the factor.
    per_step: u32,
}

/// A whole margin, of which two are told: Q31 without a sign.
const MARGIN: u32 = 1 << 31;

impl Edge {
    fn new(range: Range, margin: u32) -> Self {
        let width = ((range.half_width() as u64 * margin as u64) >> 16).clamp(1, i32::MAX as u64) as u32;
        let factor = 1u32.wrapping_shl(width.leading_zeros());
        let divisor = core::num::NonZeroU64::new(width as u64 * factor as u64).unwrap_or(core::num::NonZeroU64::MIN);
        Self { range, margin: width, factor, per_step: ((1u64 << 63) / divisor).min(u32::MAX as u64) as u32 }
    }

    /// Returns `true` if `value` lies within the range: one comparison, because what is below wraps.
    #[inline(always)]
    fn holds(&self, value: i32) -> bool {
        value.wrapping_sub(self.range.low) as u32 <= self.range.high.wrapping_sub(self.range.low) as u32
    }

    /// Distance of `value` beyond the range, Q16.16.
    #[inline(always)]
    fn distance(&self, value: i32) -> u32 {
        match () {
            () if value > self.range.high => value.wrapping_sub(self.range.high) as u32,
            () if value < self.range.low => self.range.low.wrapping_sub(value) as u32,
            () => 0,
        }
    }

    /// Margins that `value` has crossed, in parts of [`MARGIN`]; `u32::MAX` from two on.
    #[inline(always)]
    fn crossed(&self, value: i32) -> u32 {
        let distance = self.distance(value);
        let (whole, rest) = match distance.checked_sub(self.margin) {
            Some(rest) => (MARGIN, rest),
            None => (0, distance),
        };
        if rest >= self.margin {
            return u32::MAX;
        }
        // Below the margin the factor loses nothing and the product is below 2^63.
        whole | ((rest.wrapping_mul(self.factor) as u64 * self.per_step as u64) >> 32) as u32
    }
}

/// [`Weights`] for every state, prepared from a [`Domain`].
#[derive(Clone, Copy, Debug)]
pub struct Fade {
    edges: [Edge; SIGNALS],
}

impl Fade {
    /// Fade that is not prepared yet.
    pub(super) const NONE: Self =
        Self { edges: [Edge { range: Range { low: 0, high: 0 }, margin: 0, factor: 0, per_step: 0 }; SIGNALS] };

    /// Prepares the fade of `domain`. Nothing fades towards the cold: a joint that is colder than it was in training
    /// has more friction, its lubricant being stiffer, so what the coldest trained temperature (the physical model:
    /// one margin below) gives is less than friction takes.
    pub fn new(domain: &Domain) -> Self {
        let mut edges = domain.ranges.map(|range| Edge::new(range, domain.margin));
        edges[Signal::Temperature as usize].range.low = i32::MIN;
        Self { edges }
    }

    /// The weights in a state.
    #[inline]
    pub fn weights(&self, signals: &[i32; SIGNALS]) -> Weights {
        let [a, b, c, d, e, f] = *signals;
        let [ea, eb, ec, ed, ee, ef] = &self.edges;
        // Within the ranges, where signals are as a rule, nothing fades. Written out: an array of pairs would be made
        // in memory.
        match ea.holds(a) && eb.holds(b) && ec.holds(c) && ed.holds(d) && ee.holds(e) && ef.holds(f) {
            true => Weights::full(),
            false => self.faded(signals),
        }
    }

    /// The weights in a state in which at least one signal has left its range: by the one that has crossed most.
    #[inline(never)]
    #[expect(clippy::needless_range_loop, reason = "optimised for size, `zip` copies and calls")]
    fn faded(&self, signals: &[i32; SIGNALS]) -> Weights {
        // At none of the signals.
        let (mut most, mut place) = (0, SIGNALS);
        for i in 0..SIGNALS {
            let crossed = self.edges[i].crossed(signals[i]);
            if crossed > most {
                (most, place) = (crossed, i);
            }
        }
        let left = |crossed: u32| i32::MAX.wrapping_sub_unsigned(crossed);
        Weights {
            network: left(most.min(MARGIN - 1)),
            physical: left(most.saturating_sub(MARGIN)),
            outside: Signal::at(place),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_network_fades_over_the_first_margin_and_the_physical_model_over_the_second() {
        let mut domain = Domain { ranges: [Range::ANY; SIGNALS], margin: 1 << 15, reference_temperature: 0 };
        domain.ranges[Signal::Velocity as usize] = Range { low: -(2 << 16), high: 2 << 16 };
        let fade = Fade::new(&domain);
        let at = |velocity: f64| {
            let mut signals = [0; SIGNALS];
            signals[Signal::Velocity as usize] = (velocity * 65536.0) as i32;
            let weights = fade.weights(&signals);
            let part = |weight: i32| (weight as f64 / i32::MAX as f64 * 100.0).round() as i32;
            (part(weights.network), part(weights.physical), weights.outside)
        };
        let velocity = Some(Signal::Velocity);
        assert_eq!(at(2.0), (100, 100, None));
        assert_eq!(at(-2.5), (50, 100, velocity));
        assert_eq!(at(3.0), (0, 100, velocity));
        assert_eq!(at(3.75), (0, 25, velocity));
        assert_eq!(at(-4.0), (0, 0, velocity));
        assert_eq!(at(32_000.0), (0, 0, velocity));
    }

    #[test]
    fn nothing_fades_towards_the_cold_and_all_of_it_towards_the_heat() {
        let mut domain = Domain { ranges: [Range::ANY; SIGNALS], margin: 1 << 15, reference_temperature: 0 };
        domain.ranges[Signal::Temperature as usize] = Range { low: 20 << 16, high: 40 << 16 };
        let fade = Fade::new(&domain);
        let at = |temperature: i32| {
            let mut signals = [0; SIGNALS];
            signals[Signal::Temperature as usize] = temperature;
            let Weights { network, physical, outside } = fade.weights(&signals);
            (network > 0, physical > 0, outside)
        };
        let temperature = Some(Signal::Temperature);
        for cold in [i32::MIN, 0, (20 << 16) - 1, 20 << 16, 40 << 16] {
            assert_eq!(at(cold), (true, true, None), "{cold}");
        }
        assert_eq!(at((40 << 16) + 1), (true, true, temperature));
        assert_eq!(at(46 << 16), (false, true, temperature));
        assert_eq!(at(50 << 16), (false, false, temperature));
    }

    #[test]
    fn without_a_margin_the_box_has_a_hard_edge() {
        let range = Range { low: -100, high: 100 };
        let fade = Fade::new(&Domain { ranges: [range; SIGNALS], margin: 0, reference_temperature: 0 });
        assert_eq!(fade.weights(&[100; SIGNALS]).network, i32::MAX);
        assert_eq!(fade.weights(&[102; SIGNALS]), Weights { network: 0, physical: 0, outside: Some(Signal::Position) });
    }

    proptest! {
        #[test]
        fn a_range_holds_what_is_nearest_to_itself(a: i32, b: i32, value: i32, near in -2..2i32) {
            let range = Range { low: a.min(b), high: a.max(b) };
            let edge = Edge::new(range, 1 << 16);
            for value in [value, range.low.saturating_add(near), range.high.saturating_add(near), i32::MIN, i32::MAX] {
                prop_assert_eq!(edge.holds(value), range.nearest(value) == value);
                prop_assert_eq!(edge.distance(value), range.nearest(value).abs_diff(value));
            }
        }

        #[test]
        fn a_fade_has_no_step_greater_than_its_slope(half_width in 1..i32::MAX, margin in 1u32..=2 << 16, part in 0.0f64..2.0) {
            let edge = Edge::new(Range { low: -half_width, high: half_width }, margin);
            let steps = (edge.margin as f64 * part) as i64;
            for value in [steps, edge.margin as i64 - 1].map(|steps| half_width as i64 + steps) {
                let at = |value: i64| edge.crossed(value.clamp(0, i32::MAX as i64) as i32);
                let (before, after) = (at(value), at(value + 1));
                let slope = MARGIN / edge.margin + 2;
                prop_assert!(before <= after && after - before <= slope, "{} {}", before, after);
            }
        }

        #[test]
        fn the_weights_are_the_least_that_one_signal_leaves(
            ends in prop::array::uniform6(any::<(i16, i16)>()), margin in 0u32..=2 << 16, signals in prop::array::uniform6(any::<i16>()),
        ) {
            let ranges = ends.map(|(a, b)| Range { low: a.min(b).into(), high: a.max(b).into() });
            let signals = signals.map(i32::from);
            let fade = Fade::new(&Domain { ranges, margin, reference_temperature: 0 });
            let weights = fade.weights(&signals);
            let (mut network, mut physical) = (i32::MAX, i32::MAX);
            for (edge, signal) in fade.edges.iter().zip(signals) {
                // Of each margin, as it is said for both: nothing of it is left where it is crossed.
                let left = |distance: u32| match edge.margin.checked_sub(distance) {
                    None | Some(0) => 0,
                    Some(_) => i32::MAX - ((distance as u64 * edge.factor as u64 * edge.per_step as u64) >> 32) as i32,
                };
                let distance = edge.range.nearest(signal).abs_diff(signal);
                network = network.min(left(distance));
                physical = physical.min(left(distance.saturating_sub(edge.margin)));
            }
            prop_assert_eq!((weights.network, weights.physical), (network, physical));
            prop_assert_eq!(weights.outside.is_none(), (network, physical) == (i32::MAX, i32::MAX));
        }

        #[test]
        fn every_value_of_a_range_is_within_half_a_width_of_its_centre(a: i32, b: i32, t in 0.0f64..=1.0) {
            let range = Range { low: a.min(b), high: a.max(b) };
            let value = (range.low as f64 + t * (range.high as f64 - range.low as f64)) as i32;
            let distance = (value.clamp(range.low, range.high) as i64 - range.centre() as i64).unsigned_abs();
            prop_assert!(distance <= range.half_width() as u64);
        }

        #[test]
        fn shifting_never_overflows_in_the_widened_box(a: i32, b: i32, margin in 0u32..=4 << 16, reference: i32) {
            let range = Range { low: a.min(b), high: a.max(b) };
            let domain = Domain { ranges: [range; SIGNALS], margin, reference_temperature: reference };
            for (signal, (shift, wide)) in domain.shifts().into_iter().zip(domain.widened()).enumerate() {
                for end in [wide.low, wide.high] {
                    let origin = if signal == Signal::Temperature as usize { reference } else { 0 };
                    let value = end.saturating_sub(origin);
                    prop_assert_eq!((value << shift) >> shift, value);
                }
            }
        }
    }
}
