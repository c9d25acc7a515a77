//! What friction is: pure functions of the joint's state, in fixed point, the same bits on every machine.
//!
//! `state` says what the model looks at, `domain` where it was identified, `physical` and `network` are its two parts, `smooth` holds the functions that both
//! share, `regime` chooses between parameter sets. Here they are put together: [`FrictionModel`] is prepared once from an
//! image's parameters, outside the control interrupt, and evaluated once a control step.

pub mod domain;
pub mod network;
pub mod physical;
pub mod regime;
pub mod smooth;
pub mod state;

use crate::quantity::Torque;
use domain::{Domain, Fade};
use network::{Inputs, Layers, NetworkParameters};
use physical::{PhysicalParameters, PreparedTerms, Scaling};
use regime::{MAX_SETS, Memory, Selector};
use state::JointState;

/// One regime's parameters: the physical model and, where one helps, a network for what it leaves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ParameterSet {
    /// Physical part.
    pub physical: PhysicalParameters,
    /// Learned part.
    pub network: Option<NetworkParameters>,
}

/// Everything that the friction of one joint depends on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrictionParameters {
    /// The box that the parameters were identified in.
    pub domain: Domain,
    /// Which set applies when.
    pub selector: Selector,
    /// Parameter sets; those beyond [`Selector::sets`] are unused and all zero.
    pub sets: [ParameterSet; MAX_SETS],
}

/// Friction torque that the joint is about to lose, by part.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Estimate {
    /// Torque of the physical model.
    pub physical: Torque,
    /// Torque of the network; zero without one.
    pub network: Torque,
}

impl Estimate {
    /// Both parts.
    pub const fn total(self) -> Torque {
        self.physical.saturating_add(self.network)
    }
}

/// A friction model ready to be evaluated.
#[derive(Clone, Debug)]
pub struct FrictionModel {
    fade: Fade,
    selector: Selector,
    scaling: Scaling,
    inputs: Inputs,
    sets: [(PreparedTerms, Option<Layers>); MAX_SETS],
    /// Cross-fade per control step, Q31.
    fade_decrement: i32,
}

impl FrictionModel {
    /// Prepares `parameters` for a control loop of `rate` Hz (at least 1).
    pub fn new(parameters: &FrictionParameters, rate: u32) -> Self {
        let domain = parameters.domain;
        // 2^31 / (time * rate), with the time in Q16.16.
        let steps = (parameters.selector.fade_time as u64 * rate as u64) >> 16;
        let fade_decrement = match core::num::NonZeroU64::new(steps) {
            Some(steps) => (i32::MAX as u64 / steps).max(1) as i32,
            None => i32::MAX,
        };
        Self {
            fade: Fade::new(&domain),
            selector: parameters.selector,
            scaling: Scaling::new(&domain),
            inputs: Inputs::new(&domain),
            sets: parameters
                .sets
                .map(|set| (PreparedTerms::new(&set.physical), set.network.map(|network| Layers::new(&network)))),
            fade_decrement,
        }
    }

    /// How much the model counts beyond the box that it was identified in.
    pub const fn fade(&self) -> &Fade {
        &self.fade
    }

    /// True where the set in use has a network.
    pub fn has_network(&self, memory: &Memory) -> bool {
        self.set(memory.set.unwrap_or(0)).1.is_some()
    }

    /// Friction in this state, with regime selection and cross-fade.
    #[inline]
    pub fn step(&self, state: &JointState, memory: &mut Memory) -> Estimate {
        let set = self.selector.select(state, memory.set.unwrap_or(0));
        memory.enter(set);
        memory.fade(self.evaluate(set, state), self.fade_decrement)
    }

    /// Friction in this state by parameter set `set` (taken modulo [`MAX_SETS`]).
    #[inline]
    pub fn evaluate(&self, set: usize, state: &JointState) -> Estimate {
        let signals = state.signals();
        let (physical, network) = self.set(set);
        Estimate {
            physical: physical.evaluate(&self.scaling.apply(&signals)),
            network: match network {
                Some(network) => network.evaluate(&self.inputs.apply(&signals)),
                None => Torque::ZERO,
            },
        }
    }

    #[inline(always)]
    fn set(&self, index: usize) -> &(PreparedTerms, Option<Layers>) {
        &self.sets[index % MAX_SETS]
    }
}
