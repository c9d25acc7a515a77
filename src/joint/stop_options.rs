//! Options of the joint's stops, in the numbers of CiA 402-2, and what of them the control step uses; task and control
//! step. What they do: [stopping](super::stopping).

#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

/// Stop options of the joint, in the numbers of the profile's option codes.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(deny_unknown_fields))]
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
