//! Profile modes and homing, as far as they take time: targets reached, and the joint's zero; the task (CiA 402-2,
//! "Profile position mode", "Profile velocity mode", "Homing mode").
//!
//! The receive interrupt takes set-points and the control step moves the joint; this part compares, once a millisecond,
//! what was asked for with what is there. It sets the bits 10, 11 and 13 of the statusword, and bit 12 in the modes in
//! which it tells of the motion.

use super::field::{ProfileParameter, SetPoint};
use super::observed::Observed;
use super::operation::Operation;
use super::set_points::impedance;
use super::shared::{STARTED, Shared};
use crate::joint::configuration::Configuration;
use crate::joint::state_machine::{Controlword, State};
use crate::joint::{PROFILES, STANDING};
use crate::motor::number::{self, magnitude};
use canopen_node::Abort;
use core::f32::consts::TAU;

/// Number of [`ProfileModes`]: none where a program does not have these modes.
pub(super) const PROFILE_MODES: usize = PROFILES as usize;

/// Bits of the statusword.
const REACHED: u16 = 1 << 10;
const LIMITED: u16 = 1 << 11;
const MODE: u16 = 1 << 12;
const ERROR: u16 = 1 << 13;

/// Numbers of homing methods.
const TO_INDEX_BACKWARDS: u32 = 33;
const TO_INDEX: u32 = 34;

/// Time since which a signal has been within or beyond a limit.
#[derive(Clone, Copy, Debug, Default)]
struct Since(Option<u64>);

impl Since {
    /// Returns `true` if `holds` has been true for `time`, ms.
    fn lasts(&mut self, holds: bool, now: u64, time: u32) -> bool {
        self.0 = holds.then(|| self.0.unwrap_or(now));
        self.0.is_some_and(|since| now.saturating_sub(since) >= u64::from(time))
    }
}

/// State of homing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
enum Homing {
    /// No homing: not begun, or interrupted.
    #[default]
    Idle,
    /// Approach to an index, rad.
    Approaches(f32),
    /// Waits until the joint stands, to take its zero: the position, rad, that is to be called the home offset. None:
    /// the joint's own.
    Settles(Option<f32>),
    /// The zero is another one, but the control step has not told so yet: positions on the way from the old one to the
    /// new one, rad, and which way that is.
    Taken(f32, f32),
    /// Done.
    Attained,
    /// Impossible homing.
    Failed,
}

/// Action that is to be done.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Wish {
    /// No action.
    Nothing,
    /// Position that is to be the joint's zero, rad (2102h:2). How that went [`ProfileModes::answer`] is told.
    Zero(f32),
}

/// The task's part of the profile modes.
#[derive(Debug)]
pub(super) struct ProfileModes {
    arrived: Since,
    astray: Since,
    homing: Homing,
    /// Values that are to be known of the wish once it has come true.
    shift: (f32, f32),
    /// The start of homing was asked for when it was looked at last.
    started: bool,
    /// It was not, in homing mode: it begins with the rising edge alone.
    waits: bool,
}

impl ProfileModes {
    /// State at the start.
    pub(super) const NOTHING: Self = Self {
        arrived: Since(None),
        astray: Since(None),
        homing: Homing::Idle,
        shift: (0.0, 0.0),
        started: false,
        waits: false,
    };

    /// Every millisecond or so, at `now`, ms. `permitted`: whoever asks for homing now may have it, because it
    /// moves the joint's zero, and its limits with it.
    pub(super) fn poll(
        &mut self,
        now: u64,
        observed: &Observed,
        configuration: &Configuration,
        shared: &Shared,
        permitted: bool,
    ) -> Wish {
        let telemetry = &observed.telemetry;
        let motion = &telemetry.motion;
        let parameter = |parameter| shared.parameter(parameter);
        let micro = |position: f32| super::number::to_i32(1e6 * position);
        let word = Controlword(shared.set_point(SetPoint::Controlword) as u16);
        let mode = shared.mode().filter(|_| telemetry.state == State::OperationEnabled);
        let limits = &configuration.limits;
        shared.set_position(micro(motion.position));

        let near = |a: i32, b: i32, window: u32| a.abs_diff(b) <= window;
        let target = shared.profile_target().filter(|_| mode == Some(Operation::ProfilePosition));
        let window = parameter(ProfileParameter::PositionWindow);
        let there = target.filter(|(target, _)| {
            let target = (*target).max(micro(limits.position.0)).min(micro(limits.position.1));
            near(target, micro(motion.position), window) && near(target, micro(observed.position_demand()), window)
        });
        let arrives = self.arrived.lasts(there.is_some(), now, parameter(ProfileParameter::PositionTime));
        shared.set_reached(there.map(|(_, number)| number).filter(|_| arrives));

        let counts = matches!(mode, Some(Operation::ProfilePosition | Operation::Position));
        let error = micro(observed.position_demand()).abs_diff(micro(motion.position));
        let window = parameter(ProfileParameter::FollowingErrorWindow);
        let beyond = counts && window != u32::MAX && error > window;
        let astray = self.astray.lasts(beyond, now, parameter(ProfileParameter::FollowingErrorTime));

        let speed = magnitude(motion.velocity);
        let slow = 1e3 * speed < parameter(ProfileParameter::VelocityThreshold) as f32;
        let milli = |set_point| 1e-3 * shared.set_point(set_point) as i32 as f32;
        let velocity = milli(SetPoint::TargetVelocity);
        let position = |set_point| 1e-6 * shared.set_point(set_point) as i32 as f32;
        let outside = |position: f32| position < limits.position.0 || position > limits.position.1;
        let torque = shared.set_point(SetPoint::TargetTorque) as i16;
        let offset = shared.set_point(SetPoint::TorqueOffset) as i16;
        let most = shared.set_point(SetPoint::MaxTorque).min(1_000) as u16;
        let limited = match mode {
            Some(Operation::ProfilePosition) => target.is_some_and(|(target, _)| outside(1e-6 * target as f32)),
            Some(Operation::Position) => {
                outside(position(SetPoint::TargetPosition) + position(SetPoint::PositionOffset))
            }
            Some(Operation::ProfileVelocity) => magnitude(velocity) > limits.velocity,
            Some(Operation::Velocity) => magnitude(velocity + milli(SetPoint::VelocityOffset)) > limits.velocity,
            Some(Operation::Torque) => torque.saturating_add(offset).unsigned_abs() > most,
            Some(Operation::Impedance) => {
                let asked = impedance(shared.set_point(SetPoint::ImpedanceFrame), |range| shared.range(range));
                let torque = 1e3 * asked.torque + f32::from(offset) * limits.torque;
                // A number without a gain asks for nothing.
                asked.stiffness > 0.0 && outside(asked.position)
                    || asked.damping > 0.0 && magnitude(asked.velocity) > limits.velocity
                    || magnitude(torque) > f32::from(most) * limits.torque
            }
            _ => false,
        };
        let mut bits = if limited && (shared.follows() || target.is_some()) { LIMITED } else { 0 };
        bits |= if astray { ERROR } else { 0 };
        bits |= match mode {
            Some(Operation::ProfilePosition) if word.halts() && slow => REACHED,
            Some(Operation::ProfileVelocity) => {
                let asked =
                    if word.halts() || !shared.follows() { 0.0 } else { number::limited(velocity, limits.velocity) };
                let missing = 1e3 * magnitude(asked - motion.velocity);
                let reached = missing <= parameter(ProfileParameter::VelocityWindow) as f32;
                (if reached { REACHED } else { 0 }) | if slow { MODE } else { 0 }
            }
            _ => 0,
        };
        let is_homing = mode == Some(Operation::Homing);
        let (begins, asked) = (self.waits && is_homing, is_homing && word.is_new_set_point());
        (self.started, self.waits) = (asked, is_homing && !asked);
        if begins && asked {
            self.homing = begun(observed, configuration, shared, permitted);
        }
        let (wish, homes) = self.home(is_homing, word, observed, configuration, shared);
        shared.set_status(bits | homes | if self.started { STARTED } else { 0 });
        wish
    }

    /// Homing: what is to be done, and its bits of the statusword.
    fn home(
        &mut self,
        is_mode: bool,
        word: Controlword,
        observed: &Observed,
        configuration: &Configuration,
        shared: &Shared,
    ) -> (Wish, u16) {
        let motion = &observed.telemetry.motion;
        let under_way = matches!(self.homing, Homing::Approaches(_) | Homing::Settles(_));
        if let Homing::Taken(middle, way) = self.homing
            && (motion.position - middle) * way >= 0.0
        {
            self.homing = Homing::Attained;
        }
        if !is_mode || under_way && !self.started {
            self.homing = Homing::Idle;
        }
        let limits = &configuration.limits;
        let stands = magnitude(motion.velocity) < STANDING * limits.velocity;
        let offset = 1e-6 * shared.parameter(ProfileParameter::HomeOffset) as i32 as f32;
        let window = shared.parameter(ProfileParameter::PositionWindow).max(1);
        if let Homing::Approaches(index) = self.homing
            && stands
            && observed.telemetry.wanted.velocity == Some(0.0)
            && 1e6 * magnitude(motion.position - index) <= window as f32
        {
            self.homing = Homing::Settles(Some(index));
        }
        let wish = match self.homing {
            Homing::Settles(place) if stands && !word.halts() => {
                let shift = offset - place.unwrap_or(motion.position);
                let (low, high) = limits.position;
                let after = motion.position + shift;
                if after < low || after > high {
                    // It would be beyond its limits at once.
                    self.homing = Homing::Failed;
                    Wish::Nothing
                } else {
                    self.shift = (motion.position + 0.5 * shift, shift);
                    Wish::Zero(configuration.gear.zero + shift)
                }
            }
            _ => Wish::Nothing,
        };
        shared.set_homing(match self.homing {
            Homing::Approaches(index) => Some(index),
            _ => None,
        });
        let still = if stands { REACHED } else { 0 };
        let bits = match self.homing {
            _ if !is_mode => 0,
            Homing::Idle => still,
            Homing::Approaches(_) | Homing::Settles(_) | Homing::Taken(..) => 0,
            Homing::Attained => still | MODE,
            Homing::Failed => still | ERROR,
        };
        (wish, bits)
    }

    /// Takes the outcome of the wish. One that the control step had no place for comes again.
    pub(super) fn answer(&mut self, taken: Result<(), Abort>) {
        self.homing = match taken {
            Ok(()) => Homing::Taken(self.shift.0, self.shift.1),
            Err(Abort::DEVICE_STATE) => self.homing,
            Err(_) => Homing::Failed,
        };
    }
}

/// State of a homing that begins. Method 0 changes nothing, and is everybody's.
fn begun(observed: &Observed, configuration: &Configuration, shared: &Shared, permitted: bool) -> Homing {
    let method = shared.parameter(ProfileParameter::HomingMethod);
    match method {
        0 => Homing::Attained,
        _ if !permitted => Homing::Failed,
        TO_INDEX | TO_INDEX_BACKWARDS => {
            next_index(observed.telemetry.motion.position, configuration, method == TO_INDEX)
                .map_or(Homing::Failed, Homing::Approaches)
        }
        _ => Homing::Settles(None),
    }
}

/// The next position above, or below, this one, rad, in which the rotor's encoder reads zero: where its index is, or an
/// absolute one begins anew. None where that is beyond the position limits.
fn next_index(position: f32, configuration: &Configuration, above: bool) -> Option<f32> {
    let turn = TAU / magnitude(configuration.gear.ratio);
    let turns = (position - configuration.gear.zero) / turn;
    let below = turns as i32 as f32 - if turns < 0.0 { 1.0 } else { 0.0 };
    let mut next = if above { below + 1.0 } else { below };
    // The one that the joint stands at is not the next one.
    if magnitude(next - turns) < NEXT {
        next += if above { 1.0 } else { -1.0 };
    }
    let index = configuration.gear.zero + next * turn;
    let (low, high) = configuration.limits.position;
    (index >= low && index <= high).then_some(index)
}

/// Part of a rotor's turn within which the joint stands at an index.
const NEXT: f32 = 0.01;
