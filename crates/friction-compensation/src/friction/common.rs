//! Terms that all parameter sets of an image have in common: pre-sliding and ripple. They belong to the joint's
//! bearings and gears, whatever the regime; control step.

use super::maxwell_slip::{Bent, ELEMENTS, MaxwellElement, MaxwellSlip};
use super::ripple::{RIPPLES, Ripple, Rippled, ripple};
use super::state::JointState;

/// The terms as they are stored and transferred; all zero in images of format 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CommonTerms {
    /// Pre-sliding friction.
    pub elements: [MaxwellElement; ELEMENTS],
    /// Ripple over the position.
    pub ripples: [Ripple; RIPPLES],
}

impl CommonTerms {
    /// No term at all.
    pub const NONE: Self = Self {
        elements: [MaxwellElement { stiffness: 0, level: 0 }; ELEMENTS],
        ripples: [Ripple { periods: 0, level_sine: 0, level_cosine: 0, torque_sine: 0, torque_cosine: 0 }; RIPPLES],
    };
}

/// The terms ready to be evaluated at a fixed rate.
#[derive(Clone, Copy, Debug)]
pub struct Common {
    /// `true` if there are any: without them the control step does nothing here.
    present: bool,
    slip: MaxwellSlip,
    ripples: [Ripple; RIPPLES],
}

/// Contribution of the common terms to a parameter set's physical model, Nm in Q16.16.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CommonTorques {
    /// Pre-sliding friction, before the factor of the Coulomb friction (temperature, load).
    pub pre_sliding: i32,
    /// Ripple.
    pub ripple: Rippled,
}

impl Common {
    /// No term.
    pub(super) const NONE: Self = Self { present: false, slip: MaxwellSlip::NONE, ripples: CommonTerms::NONE.ripples };

    /// Prepares `terms` for `rate` evaluations a second (at least 1).
    pub fn new(terms: &CommonTerms, rate: u32) -> Self {
        Self {
            present: *terms != CommonTerms::NONE,
            slip: MaxwellSlip::new(&terms.elements, rate),
            ripples: terms.ripples,
        }
    }

    /// True where there are pre-sliding elements.
    #[inline(always)]
    pub(super) fn pre_slides(&self) -> bool {
        self.present && !self.slip.is_none()
    }

    /// Torque of all elements where they slip, Nm in Q16.16.
    pub(super) fn pre_sliding_level(&self) -> i32 {
        if self.present { self.slip.level() } else { 0 }
    }

    /// One evaluation, which bends the elements.
    #[inline(always)]
    pub fn step(&self, bent: &mut Bent, state: &JointState) -> CommonTorques {
        let pre_sliding = self.pre_sliding(bent, state.velocity.to_bits());
        CommonTorques { pre_sliding, ripple: self.ripple(state.position.to_bits()) }
    }

    /// Pre-sliding friction at a velocity (Q16.16), which bends the elements.
    #[inline(always)]
    pub(super) fn pre_sliding(&self, bent: &mut Bent, velocity: i32) -> i32 {
        if self.present { self.bend(bent, velocity) } else { 0 }
    }

    /// Ripple at a position (Q16.16).
    #[inline(always)]
    pub(super) fn ripple(&self, position: i32) -> Rippled {
        if self.present { self.rippled(position) } else { Rippled::default() }
    }

    #[inline(never)]
    fn bend(&self, bent: &mut Bent, velocity: i32) -> i32 {
        self.slip.step(bent, velocity)
    }

    #[inline(never)]
    fn rippled(&self, position: i32) -> Rippled {
        ripple(&self.ripples, position)
    }
}
