//! Faults of the joint, and its reactions to them; control step.

/// Faults that the control step detects.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Fault {
    /// A phase current is beyond the fault limit, or not a number.
    OverCurrent = 1,
    /// The three phase currents do not add up to zero: a sensor is open, stuck or jumps.
    CurrentSensor = 2,
    /// The current does not follow: an open phase or a lost gate signal.
    CurrentNotFollowed = 3,
    /// The supply is above its limit, or not a number.
    OverVoltage = 4,
    /// The supply is below its limit.
    UnderVoltage = 5,
    /// The encoder did not answer for several steps.
    EncoderLost = 6,
    /// The encoder jumped, or no longer follows its own motion.
    EncoderJump = 7,
    /// Encoder and induced voltage contradict each other: a stuck or slipped encoder.
    EncoderImplausible = 8,
    /// The joint is faster than it may be.
    OverSpeed = 9,
    /// The joint is beyond a position limit and its margin.
    PositionLimit = 10,
    /// The bridge is too hot.
    BridgeTemperature = 11,
    /// The winding is too hot.
    WindingTemperature = 12,
    /// A temperature sensor is open or shorted.
    TemperatureSensor = 13,
    /// No command for longer than the deadline.
    StaleCommand = 14,
    /// A control step took longer than its period.
    Overrun = 15,
    /// The gate driver reports a fault.
    BridgeDriver = 16,
}

/// Reaction to a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reaction {
    /// All transistors off in the same step: without trustworthy current, angle or supply nothing else is safe.
    SwitchOff,
    /// The joint brakes along a ramp, then all transistors are off.
    Brake,
}

impl Fault {
    /// All faults.
    pub const ALL: [Self; 16] = [
        Self::OverCurrent,
        Self::CurrentSensor,
        Self::CurrentNotFollowed,
        Self::OverVoltage,
        Self::UnderVoltage,
        Self::EncoderLost,
        Self::EncoderJump,
        Self::EncoderImplausible,
        Self::OverSpeed,
        Self::PositionLimit,
        Self::BridgeTemperature,
        Self::WindingTemperature,
        Self::TemperatureSensor,
        Self::StaleCommand,
        Self::Overrun,
        Self::BridgeDriver,
    ];

    /// Reaction to this fault.
    pub const fn reaction(self) -> Reaction {
        match self {
            Self::OverSpeed
            | Self::PositionLimit
            | Self::BridgeTemperature
            | Self::WindingTemperature
            | Self::TemperatureSensor
            | Self::StaleCommand => Reaction::Brake,
            _ => Reaction::SwitchOff,
        }
    }

    /// Error code of object 603Fh, of the profile's table (CiA 402-2, error codes): the entry that comes nearest.
    pub const fn error_code(self) -> u16 {
        match self {
            Self::OverCurrent => 0x2310,
            Self::CurrentSensor => 0x5210,
            Self::CurrentNotFollowed => 0x3321,
            Self::OverVoltage => 0x3210,
            Self::UnderVoltage => 0x3220,
            Self::EncoderLost => 0x7305,
            Self::EncoderJump => 0x7320,
            Self::EncoderImplausible => 0x7122,
            Self::OverSpeed => 0x8400,
            Self::PositionLimit => 0x8612,
            Self::BridgeTemperature => 0x4210,
            Self::WindingTemperature => 0x4310,
            Self::TemperatureSensor => 0x4300,
            Self::StaleCommand => 0x8100,
            Self::Overrun => 0x6100,
            Self::BridgeDriver => 0x5410,
        }
    }

    const fn bit(self) -> u32 {
        1 << self as u32
    }
}

impl core::fmt::Display for Fault {
    fn fmt(&self, f: &mut core::fmt::Formatter) -> core::fmt::Result {
        f.write_str(match self {
            Self::OverCurrent => "over-current",
            Self::CurrentSensor => "phase currents do not add up to zero",
            Self::CurrentNotFollowed => "current does not follow its reference",
            Self::OverVoltage => "supply voltage too high",
            Self::UnderVoltage => "supply voltage too low",
            Self::EncoderLost => "encoder does not answer",
            Self::EncoderJump => "encoder jumped",
            Self::EncoderImplausible => "encoder contradicts the induced voltage",
            Self::OverSpeed => "joint too fast",
            Self::PositionLimit => "joint beyond a position limit",
            Self::BridgeTemperature => "bridge too hot",
            Self::WindingTemperature => "winding too hot",
            Self::TemperatureSensor => "temperature sensor open or shorted",
            Self::StaleCommand => "command deadline missed",
            Self::Overrun => "control step overran its period",
            Self::BridgeDriver => "gate driver fault",
        })
    }
}

/// A set of faults.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Faults(u32);

impl Faults {
    /// No fault.
    pub const NONE: Self = Self(0);

    /// Faults of motion that count in the open loop, too: where its position is, a joint under commissioning need not
    /// know.
    pub(super) const OPEN_LOOP: Self =
        Self(Fault::OverSpeed.bit() | Fault::WindingTemperature.bit() | Fault::StaleCommand.bit());

    /// One bit a fault, at its number.
    #[inline(always)]
    pub const fn bits(self) -> u32 {
        self.0
    }

    /// The set with these [bits](Self::bits).
    pub(super) const fn from_bits(bits: u32) -> Self {
        Self(bits)
    }

    /// Returns `true` if this fault is there and no other.
    #[inline(always)]
    pub const fn is_only(self, fault: Fault) -> bool {
        self.0 == fault.bit()
    }

    /// Adds a fault where a condition holds.
    #[inline(always)]
    pub fn set(&mut self, fault: Fault, present: bool) {
        self.0 |= (present as u32) << fault as u32;
    }

    /// Returns `true` if there is none.
    #[inline(always)]
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Returns `true` if a fault is in the set.
    #[inline(always)]
    pub const fn contains(self, fault: Fault) -> bool {
        self.0 & fault.bit() != 0
    }

    /// Faults in both sets.
    #[inline(always)]
    pub const fn intersection(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }

    /// The set without a fault.
    #[inline(always)]
    pub const fn without(self, fault: Fault) -> Self {
        Self(self.0 & !fault.bit())
    }

    /// Both sets.
    #[inline(always)]
    pub const fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// The most severe reaction of any of them; none for the empty set.
    #[inline(always)]
    pub fn reaction(self) -> Option<Reaction> {
        const SWITCH_OFF: u32 = {
            let (mut bits, mut i) = (0, 0);
            while i < Fault::ALL.len() {
                if matches!(Fault::ALL[i].reaction(), Reaction::SwitchOff) {
                    bits |= Fault::ALL[i].bit();
                }
                i += 1;
            }
            bits
        };
        match self.0 {
            0 => None,
            bits if bits & SWITCH_OFF != 0 => Some(Reaction::SwitchOff),
            _ => Some(Reaction::Brake),
        }
    }

    /// The faults of the set, in the order of their numbers.
    pub fn iter(self) -> impl Iterator<Item = Fault> {
        Fault::ALL.into_iter().filter(move |fault| self.contains(*fault))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_set_reacts_as_its_most_severe_fault_does() {
        let mut faults = Faults::NONE;
        assert_eq!(faults.reaction(), None);
        faults.set(Fault::StaleCommand, true);
        assert_eq!(faults.reaction(), Some(Reaction::Brake));
        faults.set(Fault::OverVoltage, true);
        faults.set(Fault::EncoderLost, false);
        assert_eq!(faults.reaction(), Some(Reaction::SwitchOff));
        assert!(faults.iter().eq([Fault::OverVoltage, Fault::StaleCommand]));
    }

    #[test]
    fn every_fault_has_its_own_code_and_bit() {
        for (i, a) in Fault::ALL.iter().enumerate() {
            for b in &Fault::ALL[..i] {
                assert_ne!(a.error_code(), b.error_code());
                assert_ne!(a.bit(), b.bit());
            }
        }
    }
}
