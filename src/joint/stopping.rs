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

/// Stop options of the joint, in the numbers of the profile's option codes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StopConfiguration {
    /// Quick stop, 605Ah: 0, 1, 2, 5 or 6.
    pub quick_stop: u8,
    /// Shutdown, 605Bh: 0 or 1.
    pub shutdown: u8,
    /// Disable operation, 605Ch: 0 or 1.
    pub disable_operation: u8,
    /// Halt, 605Dh: 1 or 2.
    pub halt: u8,
    /// A fault that permits braking, 605Eh: 0, 1 or 2.
    pub fault_reaction: u8,
    /// A command that is late, 6007h: 1, a fault, or 3, a quick stop.
    pub late_command: u8,
    /// Time in which the holding brake opens, s; 0 to 5.
    pub brake_release: f32,
    /// Time in which it closes, s; 0 to 5.
    pub brake_apply: f32,
}

/// A late command is a quick stop.
pub const QUICK_STOP: u8 = 3;

impl StopConfiguration {
    /// Defaults of the profile, but for "disable operation", which has the bridge off at once.
    pub const DEFAULT: Self = Self {
        quick_stop: 2,
        shutdown: 0,
        disable_operation: 0,
        halt: 1,
        fault_reaction: 2,
        late_command: 1,
        brake_release: 0.0,
        brake_apply: 0.0,
    };

    /// Returns `true` if there is such an option everywhere.
    pub const fn is_possible(&self) -> bool {
        matches!(self.quick_stop, 0..=2 | 5 | 6)
            && self.shutdown <= 1
            && self.disable_operation <= 1
            && matches!(self.halt, 1 | 2)
            && self.fault_reaction <= 2
            && matches!(self.late_command, 1 | QUICK_STOP)
    }

    /// Returns `true` if a quick stop ends in holding.
    #[inline(always)]
    pub const fn holds(&self) -> bool {
        self.quick_stop > 2
    }
}

impl Default for StopConfiguration {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// The same, prepared.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StopGains {
    /// The options.
    pub options: StopConfiguration,
    /// Rounds of the motion loop in which the brake opens.
    pub release_rounds: u32,
    /// Control steps in which it closes.
    pub apply_steps: u32,
}

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_option_codes_of_the_profile_are_possible() {
        type Member = fn(&mut StopConfiguration) -> &mut u8;
        let members: [(Member, &[u8]); 6] = [
            (|s| &mut s.quick_stop, &[0, 1, 2, 5, 6]),
            (|s| &mut s.shutdown, &[0, 1]),
            (|s| &mut s.disable_operation, &[0, 1]),
            (|s| &mut s.halt, &[1, 2]),
            (|s| &mut s.fault_reaction, &[0, 1, 2]),
            (|s| &mut s.late_command, &[1, 3]),
        ];
        for (number, (member, codes)) in members.into_iter().enumerate() {
            for code in 0..=u8::MAX {
                let mut stops = StopConfiguration::DEFAULT;
                *member(&mut stops) = code;
                assert_eq!(stops.is_possible(), codes.contains(&code), "{number}: {code}");
            }
        }
    }
}
