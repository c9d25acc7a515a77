//! Reasons for the end of a run.

use super::Refused;
use std::fmt;

/// Reason for the end of a run. Where it says an address, that is the instruction's, which has not taken effect.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum End {
    /// The cycle that was asked for is reached.
    Time,
    /// The core sleeps and nothing will wake it.
    Asleep,
    /// The program reached an address that the [`Watch`](super::Watch) stops at; the instruction there has not run.
    Reached {
        /// The address.
        address: u32,
    },
    /// BKPT; `Cpu::skip` goes on behind it.
    Breakpoint {
        /// Its address.
        address: u32,
        /// Its immediate; 0xab is a semihosting call.
        number: u8,
    },
    /// An encoding that is not implemented, or unpredictable.
    Refused {
        /// Its address.
        address: u32,
        /// The encoding, the first half-word in the upper half where there are two.
        encoding: u32,
        /// Defect of it.
        why: Refused,
    },
    /// Use of something that is not modelled.
    Unmodelled {
        /// Address of the instruction.
        address: u32,
        /// Name of it, in words.
        what: String,
    },
    /// A fault that no handler could take: the core would stand still until reset.
    Lockup(Lockup),
    /// The core is to be reset; `Cpu::reset` does.
    Reset(Origin),
}

/// A fault while the priority forbids any fault handler (ARM DDI 0403, B1.5.15).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Lockup {
    /// Address of the instruction.
    pub address: u32,
    /// Number of the exception whose handler ran.
    pub exception: u16,
    /// Configurable fault status (CFSR).
    pub faults: u32,
    /// Hard fault status (HFSR).
    pub hard_fault: u32,
    /// Address of the bus fault (BFAR), where it is known.
    pub bus_fault_address: u32,
}

/// Origin of a request for a reset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin {
    /// The program, by AIRCR.SYSRESETREQ.
    Program,
    /// The chip: watchdog, power.
    Chip,
}

impl fmt::Display for End {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Time => write!(f, "the time is over"),
            Self::Asleep => write!(f, "asleep, and nothing will wake it"),
            Self::Reached { address } => write!(f, "reached {address:#010x}"),
            Self::Breakpoint { address, number } => write!(f, "breakpoint {number:#04x} at {address:#010x}"),
            Self::Refused { address, encoding, why } => write!(f, "{encoding:#010x} at {address:#010x} is {why}"),
            Self::Unmodelled { address, what } => write!(f, "not modelled, at {address:#010x}: {what}"),
            Self::Lockup(lockup) => write!(
                f,
                "locked up at {:#010x} in exception {}: CFSR {:#010x}, HFSR {:#010x}, BFAR {:#010x}",
                lockup.address, lockup.exception, lockup.faults, lockup.hard_fault, lockup.bus_fault_address
            ),
            Self::Reset(Origin::Program) => write!(f, "the program resets"),
            Self::Reset(Origin::Chip) => write!(f, "the chip resets the core"),
        }
    }
}
