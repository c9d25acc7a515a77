//! Selection of the parameter set that applies now: up to two criteria, each with hysteresis, choose one of up to four
//! sets; control step.
//!
//! Criteria: |acceleration| (accelerating against uniform motion) and |velocity| (high against low speed) are the
//! mobile-robot paper's two ways to divide motion (001, section 3.1); own speed against that of a coupled joint is the
//! WAM's (003, section II.C). After a change-over the last output of the old set fades into the new set's, so the
//! torque has no step, stays between the two, and no second evaluation is needed.

use super::Estimate;
use super::maxwell_slip::Bent;
use super::state::JointState;
use crate::dsp::smmul;
use crate::quantity::Torque;

/// Most criteria that an image can hold.
pub const MAX_CRITERIA: usize = 2;
/// Most parameter sets that an image can hold: every combination of the criteria.
pub const MOST_SETS: usize = 1 << MAX_CRITERIA;
/// Most parameter sets that this program has room for. With the feature `little-room` a chip's program has no regimes;
/// on the host nothing changes.
pub const MAX_SETS: usize = if cfg!(all(feature = "little-room", target_os = "none")) { 1 } else { MOST_SETS };

/// Quantity that a criterion looks at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Measure {
    /// |acceleration|: upper half "accelerating", lower half "uniform".
    Acceleration = 1,
    /// |velocity|: upper half "high speed", lower half "low speed".
    Speed = 2,
    /// |velocity| - |velocity of the coupled joint|: upper half "leading", lower half "following".
    Coupled = 3,
}

impl Measure {
    /// The measure in a state, in Q16.16 of its unit.
    #[inline(always)]
    fn of(self, state: &JointState) -> i32 {
        let speed = state.velocity.to_bits().saturating_abs();
        match self {
            Self::Acceleration => state.acceleration.to_bits().saturating_abs(),
            Self::Speed => speed,
            Self::Coupled => speed.saturating_sub(state.coupled_velocity.to_bits().saturating_abs()),
        }
    }
}

/// A threshold with hysteresis: upper from `enter` on, lower from `leave` down, unchanged between.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Criterion {
    /// Quantity that is compared.
    pub measure: Measure,
    /// Upper threshold, Q16.16.
    pub enter: i32,
    /// Lower threshold, Q16.16; at most `enter`.
    pub leave: i32,
}

/// The selector of an image: no criterion means always the first set.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Selector {
    /// Criteria; the first decides bit 0 of the set's index, the second bit 1.
    pub criteria: [Option<Criterion>; MAX_CRITERIA],
    /// Duration of the cross-fade, s in Q16.16.
    pub fade_time: u32,
}

impl Selector {
    /// Number of parameter sets that the criteria tell apart: 1, 2 or 4.
    pub const fn sets(&self) -> usize {
        match self.criteria {
            [None, _] => 1,
            [Some(_), None] => 2,
            [Some(_), Some(_)] => 4,
        }
    }

    /// Index of the set for this state; between the thresholds of a criterion, as in `previous`.
    #[inline]
    pub fn select(&self, state: &JointState, previous: usize) -> usize {
        if MAX_SETS == 1 {
            return 0;
        }
        let upper = |criterion: &Criterion, before: bool| {
            let measure = criterion.measure.of(state);
            measure >= criterion.enter || measure > criterion.leave && before
        };
        let [Some(first), second] = &self.criteria else { return 0 };
        let first = upper(first, previous & 1 != 0) as usize;
        let Some(second) = second else { return first };
        first | (upper(second, previous & 2 != 0) as usize) << 1
    }
}

/// Memory of the selection from one evaluation to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Memory {
    /// Index of the set in use; nothing before the first step.
    pub(super) set: Option<usize>,
    /// Output at the moment of the last change-over.
    held: Estimate,
    /// Output of the last step.
    last: Estimate,
    /// Weight of `held`, Q31; falls to zero.
    weight: i32,
    /// Pre-sliding elements: those of all sets.
    pub(super) bent: Bent,
}

impl Memory {
    /// Forgets the past. Field by field: optimised for size the compiler would make a record of it and copy that, byte
    /// by byte.
    #[inline(always)]
    pub(crate) fn reset(&mut self) {
        (self.set, self.weight) = (None, 0);
        (self.held.physical, self.held.network) = (Torque::ZERO, Torque::ZERO);
        (self.last.physical, self.last.network) = (Torque::ZERO, Torque::ZERO);
        let [a, b, c, d] = &mut self.bent;
        (*a, *b, *c, *d) = (0, 0, 0, 0);
    }

    /// Takes note of the set for this step; a change starts a cross-fade from the last output.
    #[inline]
    pub(super) fn enter(&mut self, set: usize) {
        if MAX_SETS > 1 && self.set.is_some_and(|before| before != set) {
            self.held = self.last;
            self.weight = i32::MAX;
        }
        self.set = Some(set);
    }

    /// Blends the set's estimate with the fading one; `decrement` is the fade per step, Q31.
    #[inline]
    pub(super) fn fade(&mut self, new: Estimate, decrement: i32) -> Estimate {
        if MAX_SETS == 1 {
            return new;
        }
        self.last = Estimate {
            physical: blend(self.held.physical, new.physical, self.weight),
            network: blend(self.held.network, new.network, self.weight),
        };
        self.weight = self.weight.saturating_sub(decrement).max(0);
        self.last
    }
}

/// `weight` (Q31) of the old, the rest of the new; never outside the two.
#[inline(never)]
fn blend(old: Torque, new: Torque, weight: i32) -> Torque {
    let (old, new) = (old.to_bits(), new.to_bits());
    // Halves, because the difference of two torques takes 33 bits. A weight of zero must give the new value exactly.
    let part = smmul((old >> 1).wrapping_sub(new >> 1), weight);
    // A quarter of the way from the new towards the old, which has that direction's sign or is zero: at most 2^30.
    let quarter = part.unsigned_abs();
    let whole = old.abs_diff(new);
    let way = if quarter >> 30 != 0 { whole } else { (quarter << 2).min(whole) };
    Torque::from_bits(if old < new { new.wrapping_sub_unsigned(way) } else { new.wrapping_add_unsigned(way) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quantity::Velocity;
    use proptest::prelude::*;

    fn speed(bits: i32) -> JointState {
        JointState { velocity: Velocity::from_bits(bits), ..Default::default() }
    }

    fn by(measure: Measure, enter: i32, leave: i32) -> Selector {
        Selector { criteria: [Some(Criterion { measure, enter, leave }), None], fade_time: 0 }
    }

    #[test]
    fn between_the_thresholds_the_set_stays() {
        let selector = by(Measure::Speed, 1000, 800);
        assert_eq!(selector.select(&speed(900), 0), 0);
        assert_eq!(selector.select(&speed(-1000), 0), 1);
        assert_eq!(selector.select(&speed(900), 1), 1);
        assert_eq!(selector.select(&speed(800), 1), 0);
    }

    #[test]
    fn a_coupled_joint_follows_until_it_leads_by_the_band() {
        let selector = by(Measure::Coupled, 100, -100);
        let state = |own: i32, other: i32| JointState { coupled_velocity: Velocity::from_bits(other), ..speed(own) };
        assert_eq!(selector.select(&state(500, -450), 0), 0);
        assert_eq!(selector.select(&state(-500, 400), 0), 1);
        assert_eq!(selector.select(&state(500, 550), 1), 1);
        assert_eq!(selector.select(&state(500, 600), 1), 0);
    }

    #[test]
    fn two_criteria_tell_four_sets_apart() {
        let mut selector = by(Measure::Speed, 1000, 1000);
        selector.criteria[1] = Some(Criterion { measure: Measure::Acceleration, enter: 50, leave: 50 });
        let state =
            |v: i32, a: i32| JointState { acceleration: crate::quantity::Acceleration::from_bits(a), ..speed(v) };
        let sets = [(0, 0), (2000, 0), (0, 60), (2000, -60)].map(|(v, a)| selector.select(&state(v, a), 0));
        assert_eq!((sets, selector.sets()), ([0, 1, 2, 3], 4));
    }

    fn estimate(bits: i32) -> Estimate {
        Estimate { physical: Torque::from_bits(bits), network: Torque::from_bits(-bits) }
    }

    #[test]
    fn a_change_over_has_no_step_and_ends_exactly_at_the_new_set() {
        let mut memory = Memory::default();
        memory.enter(0);
        assert_eq!(memory.fade(estimate(60_000), i32::MAX / 10), estimate(60_000));
        let mut last = 60_000;
        for step in 0..=11 {
            memory.enter(1);
            let now = memory.fade(estimate(-40_000), i32::MAX / 10).physical.to_bits();
            assert!(now <= last && last - now <= 10_001, "step {step}: {last} -> {now}");
            last = now;
        }
        assert_eq!(last, -40_000);
    }

    #[test]
    fn turning_back_in_mid_fade_has_no_step_either() {
        let mut memory = Memory::default();
        let mut last = 10_000;
        for step in 0..30 {
            let set = usize::from((5..9).contains(&step));
            memory.enter(set);
            let now = memory.fade(estimate(if set == 1 { -10_000 } else { 10_000 }), i32::MAX / 8).physical.to_bits();
            assert!((now - last).abs() <= 2_600, "step {step}: {last} -> {now}");
            last = now;
        }
        assert_eq!(last, 10_000);
    }

    /// Reference for [`blend`], in 64 bits.
    fn wide_blend(old: i64, new: i64, weight: i64) -> i64 {
        let half = (old >> 1) - (new >> 1);
        (new + ((half * weight) >> 32) * 4).max(old.min(new)).min(old.max(new))
    }

    proptest! {
        #[test]
        fn a_blend_is_that_of_wider_numbers(
            old in prop_oneof![any::<i32>(), Just(i32::MIN), Just(i32::MAX)],
            new in prop_oneof![any::<i32>(), Just(i32::MIN), Just(i32::MAX)],
            near in -5..5i32,
            weight in prop_oneof![0..=i32::MAX, Just(i32::MAX)],
        ) {
            for new in [new, old.wrapping_add(near)] {
                let blended = blend(Torque::from_bits(old), Torque::from_bits(new), weight).to_bits();
                prop_assert_eq!(blended as i64, wide_blend(old as i64, new as i64, weight as i64));
            }
        }

        #[test]
        fn a_blend_lies_between_its_ends(old: i32, new: i32, weight in 0..=i32::MAX) {
            let blended = blend(Torque::from_bits(old), Torque::from_bits(new), weight).to_bits();
            prop_assert!((old.min(new)..=old.max(new)).contains(&blended));
            prop_assert_eq!(blend(Torque::from_bits(old), Torque::from_bits(new), 0).to_bits(), new);
        }
    }
}
