//! Hardware of a board that tells of itself: its gate driver, its revision, the option bytes of its chip. Pure code:
//! who reads pins and registers is the board.

pub mod chip_options;
pub mod drv8353;
pub mod moteus_revision;

use chip_options::ChipOptions;

/// Set-up of what the bridge needs before the joint may start, and what is missing of it; the number of object 2302h:4.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Setup {
    /// Complete set-up: nothing is missing, or the board has no gate driver that is set up.
    #[default]
    Complete = 0,
    /// The gate driver has just been enabled.
    Waking = 1,
    /// The gate driver does not answer: it has no supply, or its bus is broken.
    NoAnswer = 2,
    /// A register of the gate driver does not hold what was written.
    NotConfigured = 3,
    /// The gate driver reports a fault that has not been cleared.
    Fault = 4,
    /// The pins that tell family and revision of the board tell of another one than the program is for: nothing is
    /// driven.
    WrongBoard = 5,
    /// A converter of the chip does not get ready.
    Converter = 6,
}

impl Setup {
    /// The set-up with a number; [`Setup::Complete`] where there is none.
    pub const fn at(number: u8) -> Self {
        match number {
            1 => Self::Waking,
            2 => Self::NoAnswer,
            3 => Self::NotConfigured,
            4 => Self::Fault,
            5 => Self::WrongBoard,
            6 => Self::Converter,
            _ => Self::Complete,
        }
    }
}

/// A gate driver with registers, as last seen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct GateDriver {
    /// Both fault status words ([`drv8353`]) of the fault that has not been cleared; zero where there is none.
    pub status: [u16; 2],
    /// Faults since the start.
    pub faults: u16,
    /// Missing part of the set-up.
    pub setup: Setup,
    /// The fault line is low, and the status words have not been read yet.
    pub unread: bool,
}

/// Report of a board on its hardware. All zero where it has nothing to tell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Hardware {
    /// The gate driver.
    pub driver: GateDriver,
    /// Family and revision of the board, by its pins ([`moteus_revision`]).
    pub revision: u8,
    /// The chip's option bytes.
    pub options: ChipOptions,
}
