//! Stops of the joint, and who bears its load then: the option codes of CiA 402-2 and a holding brake; task and control
//! step.
//!
//! | object | what ends the operation | 0 | 1 | 2 | 5, 6 |
//! |---|---|---|---|---|---|
//! | 605Ah | quick stop, by controlword or NMT | off at once | ramp of the modes, off | ramp of the quick stop, off | as 1, 2; then holds |
//! | 605Bh | shutdown | off at once | ramp of the modes, off | | |
//! | 605Ch | disable operation | off at once | ramp of the modes, off | | |
//! | 605Dh | halt, and a mode without a target | | ramp of the modes, holds | ramp of the quick stop, holds | |
//! | 605Eh | a fault that permits braking | off at once | ramp of the modes, off | ramp of the quick stop, off | |
//!
//! "Disable voltage" and a fault of the bridge or the current loop have it off at once, whatever stands here. A ramp
//! ends where the joint stands, or after the longest braking time. A joint that holds after a quick stop does so until
//! the voltage is disabled or operation is enabled anew, with no more current than winding and bridge bear for long.
//!
//! **The holding brake** has its output on as long as the bridge makes a torque. When operation is enabled the joint
//! holds where it is for the brake's release time; a set-point counts after it. When a ramp has ended the output goes
//! off, and the bridge only after the brake's apply time. Where the bridge is off at once nobody bears the load for
//! that time.

use super::active::Active;
use super::state_machine::{Controlword, State};
use super::{JointMotion, STANDING};

/// Control steps for which a joint must stand before its bridge switches off.
const STANDING_STEPS: u32 = 400;

/// Progress of a stop.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Stopping {
    /// Control steps that it took so far; those of a joint that stands and holds do not count.
    steps: u32,
    standing: u32,
    /// `true` once it has stood.
    stood: bool,
    /// Control steps since the ramp ended.
    applying: u32,
}

impl Stopping {
    /// Returns `true` while a stop is under way that may end in the state in which it began.
    #[inline(always)]
    pub const fn is_under_way(&self) -> bool {
        self.steps > 0
    }

    /// The joint has stood for long enough: from here on it bears a load, and is not braked any more.
    #[inline(always)]
    pub const fn bears(&self) -> bool {
        self.stood
    }

    /// The brake is to close.
    #[inline(always)]
    pub const fn closes_brake(&self) -> bool {
        self.applying > 0
    }

    /// One control step; whether the bridge may go off: the joint stands, or has braked for too long, and the brake has
    /// closed.
    #[inline(always)]
    pub fn step(
        &mut self,
        active: &Active,
        state: State,
        word: Controlword,
        motion: &JointMotion,
        ramp_is_over: bool,
    ) -> bool {
        let brakes = match state {
            State::QuickStopActive | State::FaultReactionActive => true,
            State::OperationEnabled => word.ends_operation(),
            _ => false,
        };
        if !brakes {
            *self = Self::default();
            return false;
        }
        let stops = &active.stops;
        let holds = stops.options.holds() && state as u8 == State::QuickStopActive as u8;
        let standing = STANDING * active.limits.velocity;
        let stands = motion.velocity <= standing && motion.velocity >= -standing && ramp_is_over;
        self.standing = if stands { self.standing.saturating_add(1) } else { 0 };
        let stands = self.standing >= STANDING_STEPS;
        self.stood |= stands;
        // Not to zero: it is under way.
        self.steps = if holds && stands { 1 } else { self.steps.saturating_add(1) };
        let ended = !holds && stands || self.steps > active.motion.braking_steps;
        if ended || self.closes_brake() {
            self.applying = self.applying.saturating_add(1);
        }
        self.applying > stops.apply_steps
    }
}
