//! Conversion of a friction estimate into a torque that is safe to add to the command; control step.
//!
//! In this order: the estimate's parts fade outside the box that they were identified in, gain, clamp, slew limit. What
//! is asked for falls back by itself (network, then physical, then nothing) and every step says what it did and why.
//! Switched off, or without a model, the torque is exactly zero: the loop computes the same bits as one without
//! compensation.

use crate::friction::common::CommonTorques;
use crate::friction::regime::{MAX_SETS, Memory};
use crate::friction::state::{JointState, SIGNALS, Signal};
use crate::friction::{Estimate, FrictionModel};
use crate::quantity::Torque;

/// Request of the operator.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Request {
    /// No compensation.
    #[default]
    Off = 0,
    /// The physical model alone.
    Physical = 1,
    /// The physical model and the network.
    PhysicalAndNetwork = 2,
    /// The physical model acts; the network is computed and reported, but has no effect.
    NetworkInShadow = 3,
}

/// Model that acted in a step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Acting {
    /// No model.
    #[default]
    Nothing = 0,
    /// The physical model.
    Physical = 1,
    /// The physical model and the network.
    PhysicalAndNetwork = 2,
}

/// Reason for less than a full compensation by network and physical model.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Reason {
    /// Switched off.
    #[default]
    Off,
    /// No verified image.
    NoModel,
    /// Full compensation, as requested.
    AsRequested,
    /// The image's parameter set has no network: it did not help on validation data.
    NoNetwork,
    /// A signal is outside the trained box: the network fades, the physical model acts in full.
    OutsideTrainedBox(Signal),
    /// A signal is more than a margin outside the trained box: the physical model fades too.
    FarOutsideTrainedBox(Signal),
}

impl core::fmt::Display for Reason {
    fn fmt(&self, f: &mut core::fmt::Formatter) -> core::fmt::Result {
        match self {
            Self::Off => f.write_str("compensation is switched off"),
            Self::NoModel => f.write_str("there is no verified parameter image"),
            Self::AsRequested => f.write_str("as requested"),
            Self::NoNetwork => f.write_str("the image has no network for this regime: physical model only"),
            Self::OutsideTrainedBox(signal) => {
                write!(f, "{} is outside the trained box: the network fades out", signal.name())
            }
            Self::FarOutsideTrainedBox(signal) => {
                write!(f, "{} is far outside the trained box: the physical model fades out", signal.name())
            }
        }
    }
}

/// A setting beyond its range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SettingsError {
    /// The gain must lie in [0, 65536], that is 0 to 1.
    Gain(u32),
    /// The clamp must not be negative.
    Clamp(Torque),
    /// The slew limit is too small for the rate of evaluations to keep: the torque moves in whole steps of Q16.16.
    Slew {
        /// Slew limit in a second.
        slew: Torque,
        /// Least slew limit, one step of Q16.16 an evaluation.
        least: Torque,
    },
    /// The rate of evaluations must be positive.
    Rate(u32),
}

impl core::fmt::Display for SettingsError {
    fn fmt(&self, f: &mut core::fmt::Formatter) -> core::fmt::Result {
        match self {
            Self::Gain(gain) => write!(f, "compensation gain is {gain}/65536, must be 0 to 65536"),
            Self::Clamp(clamp) => write!(f, "compensation clamp is {clamp}, must not be negative"),
            Self::Slew { slew, least } => {
                write!(
                    f,
                    "compensation slew limit is {slew} a second, must be at least {least} at this rate of evaluations"
                )
            }
            Self::Rate(rate) => write!(f, "rate of evaluations is {rate} Hz, must be positive"),
        }
    }
}

impl core::error::Error for SettingsError {}

/// Permitted compensation. New settings take effect with the next evaluation; a torque beyond a new, lower clamp comes
/// down to it at the slew rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    request: Request,
    /// Q31.
    gain: i32,
    /// Q16.16, not negative.
    clamp: i32,
    /// Q16.16 per evaluation, at least 1.
    slew: i32,
}

impl Settings {
    /// Checks and prepares settings for `rate` evaluations a second: `gain` in Q16.16 (0 to 1), `clamp` the largest
    /// magnitude of the torque, `slew` its largest change in a second, at least one step of Q16.16 an evaluation
    /// (0.06 Nm/s at 4 kHz).
    pub fn new(request: Request, gain: u32, clamp: Torque, slew: Torque, rate: u32) -> Result<Self, SettingsError> {
        let Some(rate) = core::num::NonZeroU32::new(rate) else { return Err(SettingsError::Rate(rate)) };
        if gain > 1 << 16 {
            return Err(SettingsError::Gain(gain));
        }
        if clamp < Torque::ZERO {
            return Err(SettingsError::Clamp(clamp));
        }
        let least = Torque::from_bits(rate.get().min(i32::MAX as u32) as i32);
        if slew < least {
            return Err(SettingsError::Slew { slew, least });
        }
        Ok(Self {
            request,
            gain: ((gain as u64) << 15).min(i32::MAX as u64) as i32,
            clamp: clamp.to_bits(),
            slew: (slew.to_bits() as u32 / rate).max(1) as i32,
        })
    }
}

/// Number of [`Parts`] of an output: one, and none where a program has no room for regimes.
pub const PARTS: usize = (MAX_SETS > 1) as usize;

/// The model's torque by its parts, as they fade beyond their box, before gain, clamp and slew limit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Parts {
    /// Torque of the physical model, pre-sliding included.
    pub physical: Torque,
    /// Torque of the network, in shadow too.
    pub network: Torque,
    /// Torque of pre-sliding, before the factor of dry friction (temperature, load) and the fade.
    pub pre_sliding: Torque,
}

impl Parts {
    /// No torque.
    const NOTHING: Self = Self { physical: Torque::ZERO, network: Torque::ZERO, pre_sliding: Torque::ZERO };
}

/// The outcome of one evaluation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Output {
    /// Torque to add to the command.
    pub torque: Torque,
    /// Torque that the full model would have added in this step, whatever was requested: gain and clamp applied, no
    /// slew limit.
    pub shadow: Torque,
    /// Model that acted.
    pub acting: Acting,
    /// Reason for it.
    pub reason: Reason,
    /// True where the clamp or the slew limit changed the torque.
    pub limited: bool,
    /// Parts of the model's torque.
    pub parts: [Parts; PARTS],
}

impl Output {
    /// Output of a compensation that is off.
    pub const NOTHING: Self = Self {
        torque: Torque::ZERO,
        shadow: Torque::ZERO,
        acting: Acting::Nothing,
        reason: Reason::Off,
        limited: false,
        parts: [Parts::NOTHING; PARTS],
    };
}

impl Default for Output {
    fn default() -> Self {
        Self::NOTHING
    }
}

/// Compensation of one joint, from one evaluation to the next.
///
/// An evaluation has four stages, none of them longer than the physical model, so that a control loop can do one in a
/// step: [`begin`](Self::begin) with a state (its regime, the ripple), [`network`](Self::network) (and pre-sliding),
/// [`physical_model`](Self::physical_model),
/// [`finish`](Self::finish) (the torque).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Compensation {
    memory: Memory,
    last: Torque,
    begun: Option<Begun>,
}

/// An evaluation that is under way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Begun {
    signals: [i32; SIGNALS],
    common: CommonTorques,
    estimate: Estimate,
}

/// Weights come in Q31 and a torque in Q16.16: `i32::MAX` counts as one, so that a full weight changes no bit. Never
/// larger in magnitude than the torque.
#[inline(always)]
fn weigh(torque: i32, weight: i32) -> i32 {
    if weight == i32::MAX { torque } else { ((torque as i64 * weight as i64) >> 31) as i32 }
}

impl Compensation {
    /// Forgets the past. Field by field: the compiler would copy even what an absent value has no use for.
    #[inline(always)]
    pub fn reset(&mut self) {
        self.memory.reset();
        self.last = Torque::ZERO;
        self.begun = None;
    }

    /// All stages at once.
    pub fn step(&mut self, model: Option<&FrictionModel>, settings: &Settings, state: &JointState) -> Output {
        self.begin(model, settings, state);
        self.network(model);
        self.physical_model(model);
        self.finish(model, settings)
    }

    /// First stage: the regime of a state, and the ripple.
    #[inline]
    pub fn begin(&mut self, model: Option<&FrictionModel>, settings: &Settings, state: &JointState) {
        self.begun = match (settings.request, model) {
            (Request::Off, _) | (_, None) => None,
            (_, Some(model)) => {
                model.enter(state, &mut self.memory);
                let signals = state.signals();
                let common = CommonTorques { ripple: model.ripple(&signals), ..CommonTorques::default() };
                Some(Begun { signals, common, estimate: Estimate::default() })
            }
        };
    }

    /// Second stage: the torque of the regime's network, and pre-sliding. A model that came after the first stage goes
    /// on with what another one has begun, within clamp and slew limit.
    #[inline]
    pub fn network(&mut self, model: Option<&FrictionModel>) {
        if let (Some(Begun { signals, common, estimate }), Some(model)) = (&mut self.begun, model) {
            common.pre_sliding = model.pre_sliding(signals, &mut self.memory);
            estimate.network = model.by_network(signals, &self.memory);
        }
    }

    /// Third stage: what the regime's physical model gives.
    #[inline]
    pub fn physical_model(&mut self, model: Option<&FrictionModel>) {
        if let (Some(Begun { signals, common, estimate }), Some(model)) = (&mut self.begun, model) {
            estimate.physical = model.by_physical_model(signals, common, &self.memory);
        }
    }

    /// Last stage: how much of the model counts, and the torque. Without a model, or switched off, it goes to zero at
    /// the slew rate, stays there exactly, and the past is forgotten.
    #[inline]
    pub fn finish(&mut self, model: Option<&FrictionModel>, settings: &Settings) -> Output {
        let (Some(Begun { signals, estimate, common }), Some(model)) = (&self.begun, model) else {
            return self.fade_out(settings);
        };
        let weights = model.fade().weights(signals);
        let estimate = model.fade_in(*estimate, &mut self.memory);
        let physical = weigh(estimate.physical.to_bits(), weights.physical);
        let network = weigh(estimate.network.to_bits(), weights.network);
        let [physical_part, network_part, pre_sliding] = [physical, network, common.pre_sliding].map(Torque::from_bits);
        let parts = [Parts { physical: physical_part, network: network_part, pre_sliding }; PARTS];
        let full = self.permitted(physical.saturating_add(network), settings);
        let wants_network = settings.request == Request::PhysicalAndNetwork;
        // After a change-over to a set without a network, the old set's still fades out.
        let network_acts = wants_network && (model.has_network(&self.memory) || estimate.network != Torque::ZERO);
        let wanted = if wants_network { full } else { self.permitted(physical, settings) };

        let last = self.last.to_bits();
        let torque = wanted.torque.max(last.saturating_sub(settings.slew)).min(last.saturating_add(settings.slew));
        self.last = Torque::from_bits(torque);

        let acting = match () {
            () if network_acts && weights.network > 0 => Acting::PhysicalAndNetwork,
            () if weights.physical > 0 => Acting::Physical,
            () => Acting::Nothing,
        };
        let reason = match weights.outside {
            Some(signal) if weights.physical < i32::MAX => Reason::FarOutsideTrainedBox(signal),
            Some(signal) if network_acts => Reason::OutsideTrainedBox(signal),
            _ if wants_network && !network_acts => Reason::NoNetwork,
            _ => Reason::AsRequested,
        };
        let limited = wanted.limited || torque != wanted.torque;
        Output { torque: self.last, shadow: Torque::from_bits(full.torque), acting, reason, limited, parts }
    }

    /// Gain, then clamp.
    #[inline(always)]
    fn permitted(&self, torque: i32, settings: &Settings) -> Permitted {
        let scaled = weigh(torque, settings.gain);
        let torque = scaled.max(settings.clamp.saturating_neg()).min(settings.clamp);
        Permitted { torque, limited: torque != scaled }
    }

    /// Brings what is left of the torque to zero at the slew rate; from then on the past is forgotten.
    #[inline(never)]
    fn fade_out(&mut self, settings: &Settings) -> Output {
        let reason = if settings.request == Request::Off { Reason::Off } else { Reason::NoModel };
        let last = self.last.to_bits();
        let torque = last.saturating_sub(last.max(settings.slew.saturating_neg()).min(settings.slew));
        self.reset();
        self.last = Torque::from_bits(torque);
        Output { torque: self.last, reason, limited: torque != 0, ..Output::default() }
    }
}

/// A torque after gain and clamp, Q16.16.
#[derive(Clone, Copy)]
struct Permitted {
    torque: i32,
    limited: bool,
}
