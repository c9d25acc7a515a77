//! Friction model: pure functions of the joint's state, in fixed point, the same bits on every machine.
//!
//! `state` says what the model looks at, `domain` where it was identified, `physical` (whose terms are listed in
//! `coefficients`) and `network` are its two parts, `smooth` holds the functions that both share, `regime` chooses
//! between parameter sets, `common` holds what these have in common: pre-sliding (`maxwell_slip`) and `ripple`. Here
//! they are put together: [`FrictionModel`] is prepared once from an image's parameters, outside the control interrupt,
//! and evaluated there at a fixed rate.

mod coefficients;
pub mod common;
pub mod domain;
pub mod maxwell_slip;
pub mod network;
pub mod physical;
pub mod regime;
pub mod ripple;
pub mod smooth;
pub mod state;

use crate::quantity::Torque;
use common::{Common, CommonTerms, CommonTorques};
use domain::{Domain, Fade};
use maxwell_slip::Bent;
use network::{Inputs, Layers, NetworkParameters};
use physical::{PhysicalParameters, PreparedTerms, Scaling};
use regime::{MAX_CRITERIA, MAX_SETS, Memory, Selector};
use ripple::Rippled;
use state::{JointState, SIGNALS, Signal};

/// One regime's parameters: the physical model and, where one helps, a network for what it leaves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ParameterSet {
    /// Physical part.
    pub physical: PhysicalParameters,
    /// Learned part.
    pub network: Option<NetworkParameters>,
}

/// Parameters of the friction of one joint, complete.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrictionParameters {
    /// The box that the parameters were identified in.
    pub domain: Domain,
    /// Selector of the set that applies.
    pub selector: Selector,
    /// Terms that all sets have in common.
    pub common: CommonTerms,
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
    common: Common,
    scaling: Scaling,
    inputs: Inputs,
    sets: [(PreparedTerms, Option<Layers>); MAX_SETS],
    /// Cross-fade per evaluation, Q31.
    fade_decrement: i32,
}

impl FrictionModel {
    /// No friction.
    const NONE: Self = Self {
        fade: Fade::NONE,
        selector: Selector { criteria: [None; MAX_CRITERIA], fade_time: 0 },
        common: Common::NONE,
        scaling: Scaling::NONE,
        inputs: Inputs::NONE,
        sets: [(PreparedTerms::NONE, None); MAX_SETS],
        fade_decrement: 0,
    };

    /// Prepares `parameters` for `rate` evaluations a second (at least 1).
    pub fn new(parameters: &FrictionParameters, rate: u32) -> Self {
        let mut model = Self::NONE;
        model.set_up(&parameters.domain, &parameters.selector, &parameters.common, rate);
        for (number, set) in parameters.sets.iter().enumerate() {
            model.prepare_set(number, set);
        }
        model
    }

    /// A model in its place, whose sets are still to be [prepared](Self::prepare_set).
    #[inline(never)]
    pub(crate) fn place<'a>(
        place: &'a mut Option<Self>,
        domain: &Domain,
        selector: &Selector,
        common: &CommonTerms,
        rate: u32,
    ) -> &'a mut Self {
        let model = place.insert(Self::NONE);
        model.set_up(domain, selector, common, rate);
        model
    }

    /// A copy in its place: field by field, so that its 2 KiB do not pass over the stack.
    #[inline(never)]
    pub fn copy_to(&self, place: &mut Option<Self>) {
        let model = place.insert(Self::NONE);
        let Self { fade, selector, common, scaling, inputs, sets, fade_decrement } = self;
        (model.fade, model.selector, model.common) = (*fade, *selector, *common);
        (model.scaling, model.inputs) = (*scaling, *inputs);
        model.sets = *sets;
        model.fade_decrement = *fade_decrement;
    }

    fn set_up(&mut self, domain: &Domain, selector: &Selector, common: &CommonTerms, rate: u32) {
        // 2^31 / (time * rate), with the time in Q16.16.
        let steps = (selector.fade_time as u64 * rate as u64) >> 16;
        self.fade_decrement = match core::num::NonZeroU64::new(steps) {
            Some(steps) => (i32::MAX as u64 / steps).max(1) as i32,
            None => i32::MAX,
        };
        self.fade = Fade::new(domain);
        self.selector = *selector;
        self.common = Common::new(common, rate);
        self.scaling = Scaling::new(domain);
        self.inputs = Inputs::new(domain);
    }

    /// Prepares set `number`; nothing beyond [`MAX_SETS`].
    pub(crate) fn prepare_set(&mut self, number: usize, set: &ParameterSet) {
        if let Some(place) = self.sets.get_mut(number) {
            *place = prepared(set);
        }
    }

    /// Fade of the model beyond the box that it was identified in.
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
        let signals = state.signals();
        self.enter(state, memory);
        let common = CommonTorques { pre_sliding: self.pre_sliding(&signals, memory), ripple: self.ripple(&signals) };
        let network = self.by_network(&signals, memory);
        let physical = self.by_physical_model(&signals, &common, memory);
        self.fade_in(Estimate { physical, network }, memory)
    }

    /// Chooses the regime's parameter set.
    #[inline]
    pub fn enter(&self, state: &JointState, memory: &mut Memory) {
        memory.enter(self.selector.select(state, memory.set.unwrap_or(0)));
    }

    /// Bends the pre-sliding elements of all sets; their torque, Nm in Q16.16.
    #[inline]
    pub fn pre_sliding(&self, signals: &[i32; SIGNALS], memory: &mut Memory) -> i32 {
        self.common.pre_sliding(&mut memory.bent, signals[Signal::Velocity as usize])
    }

    /// The ripple of all sets.
    #[inline]
    pub fn ripple(&self, signals: &[i32; SIGNALS]) -> Rippled {
        self.common.ripple(signals[Signal::Position as usize])
    }

    /// Torque of the regime's network; zero without one.
    #[inline]
    pub fn by_network(&self, signals: &[i32; SIGNALS], memory: &Memory) -> Torque {
        by_network(&self.inputs, &self.set(memory.set.unwrap_or(0)).1, signals)
    }

    /// Torque of the regime's physical model.
    #[inline]
    pub fn by_physical_model(&self, signals: &[i32; SIGNALS], common: &CommonTorques, memory: &Memory) -> Torque {
        by_physical_model(&self.scaling, &self.set(memory.set.unwrap_or(0)).0, common, signals)
    }

    /// The cross-fade from the regime before to this regime's estimate.
    #[inline]
    pub fn fade_in(&self, estimate: Estimate, memory: &mut Memory) -> Estimate {
        memory.fade(estimate, self.fade_decrement)
    }

    /// Dry friction of the first parameter set at the reference temperature, without load: the larger direction's
    /// breakaway, hysteresis and pre-sliding.
    pub fn dry_friction(&self) -> Torque {
        let (terms, _) = self.set(0);
        Torque::from_bits(terms.breakaway(self.common.pre_sliding_level()))
    }

    /// True where the model has pre-sliding elements: friction at a velocity of zero.
    #[inline(always)]
    pub fn pre_slides(&self) -> bool {
        self.common.pre_slides()
    }

    /// Torques of the common terms in this state, which bends the pre-sliding elements.
    #[inline]
    pub fn common(&self, bent: &mut Bent, state: &JointState) -> CommonTorques {
        self.common.step(bent, state)
    }

    /// Friction in this state by parameter set `set` (taken modulo [`MAX_SETS`]) alone, without the common terms.
    #[inline]
    pub fn evaluate(&self, set: usize, state: &JointState) -> Estimate {
        self.evaluate_with(set, state, &CommonTorques::default())
    }

    /// [`evaluate`](Self::evaluate), with what the [common terms](Self::common) give.
    #[inline]
    pub fn evaluate_with(&self, set: usize, state: &JointState, common: &CommonTorques) -> Estimate {
        evaluate(&self.scaling, &self.inputs, self.set(set), common, state)
    }

    #[inline(always)]
    #[allow(clippy::modulo_one, reason = "a program may have room for one set")]
    fn set(&self, index: usize) -> &(PreparedTerms, Option<Layers>) {
        &self.sets[index % MAX_SETS]
    }
}

/// A parameter set ready to be evaluated.
#[inline(never)]
pub(crate) fn prepared(set: &ParameterSet) -> (PreparedTerms, Option<Layers>) {
    (PreparedTerms::new(&set.physical), set.network.as_ref().map(Layers::new))
}

/// Friction in a state by one prepared set.
#[inline]
pub(crate) fn evaluate(
    scaling: &Scaling,
    inputs: &Inputs,
    (physical, network): &(PreparedTerms, Option<Layers>),
    common: &CommonTorques,
    state: &JointState,
) -> Estimate {
    let signals = state.signals();
    Estimate {
        physical: by_physical_model(scaling, physical, common, &signals),
        network: by_network(inputs, network, &signals),
    }
}

/// A function of its own: the control step, the shadow and the golden vectors share one.
#[inline(never)]
fn by_physical_model(
    scaling: &Scaling,
    terms: &PreparedTerms,
    common: &CommonTorques,
    signals: &[i32; SIGNALS],
) -> Torque {
    terms.evaluate(&scaling.apply(signals), common)
}

/// A function of its own, as above; zero without a network.
#[inline(never)]
fn by_network(inputs: &Inputs, network: &Option<Layers>, signals: &[i32; SIGNALS]) -> Torque {
    match network {
        Some(network) => network.evaluate(inputs, signals),
        None => Torque::ZERO,
    }
}
