//! Modes of operation, object 6060h: what a master asks for, beside what the joint's [`Mode`] makes of it; any context.

use crate::joint::{Mode, PROFILES};

/// Modes of operation (CiA 402-2, "Modes of operation"; negative numbers are the manufacturer's).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(i8)]
pub enum Operation {
    /// A voltage along a turning field.
    OpenLoop = -2,
    /// Stiffness and damping around a position and a velocity.
    Impedance = -1,
    /// The joint holds where it is.
    None = 0,
    /// Profile position: single positions, each of which is reached along a profile.
    ProfilePosition = 1,
    /// Profile velocity: a velocity that is reached along a profile.
    ProfileVelocity = 3,
    /// Homing: the joint is told or finds where its zero is.
    Homing = 6,
    /// Cyclic synchronous position.
    Position = 8,
    /// Cyclic synchronous velocity.
    Velocity = 9,
    /// Cyclic synchronous torque.
    Torque = 10,
}

impl Operation {
    /// The one of this number; none where this program has none.
    pub const fn of(number: i8) -> Option<Self> {
        Some(match number {
            1 if PROFILES => Self::ProfilePosition,
            3 if PROFILES => Self::ProfileVelocity,
            6 if PROFILES => Self::Homing,
            8 => Self::Position,
            9 => Self::Velocity,
            10 => Self::Torque,
            -1 => Self::Impedance,
            -2 => Self::OpenLoop,
            0 => Self::None,
            _ => return None,
        })
    }

    /// Its number.
    pub const fn number(self) -> i8 {
        self as i8
    }

    /// Mode of the joint in it while it follows a target.
    pub const fn of_the_joint(self) -> Mode {
        match self {
            Self::OpenLoop => Mode::OpenLoop,
            Self::Impedance => Mode::Impedance,
            Self::None | Self::Homing => Mode::Hold,
            Self::ProfilePosition => Mode::Profile,
            Self::ProfileVelocity | Self::Velocity => Mode::Velocity,
            Self::Position => Mode::Position,
            Self::Torque => Mode::Torque,
        }
    }

    /// Returns `true` if 6502h names a profile mode.
    pub const fn has_profiles(supported: u32) -> bool {
        supported & (1 << (Self::ProfilePosition as i8 - 1)) != 0
    }

    /// Mask of the modes that there are, object 6502h: a mode n from 1 on is bit n - 1; the manufacturer's are bits 16
    /// (impedance) and 17 (open loop).
    pub const SUPPORTED: u32 = Self::supported();

    const fn supported() -> u32 {
        let (mut bits, mut number) = (3 << 16, 1);
        while number <= 10 {
            if Self::of(number).is_some() {
                bits |= 1 << (number - 1);
            }
            number += 1;
        }
        bits
    }
}
