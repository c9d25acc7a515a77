//! The boards: what lies between the chip's pins, the plant and the bus.
//!
//! Each board's parts are those of its schematics, not the firmware's constants: where both agree, a run says
//! something.

pub mod amplifier;
pub mod b_g431b_esc1;
pub mod drivetrain;
pub mod electrics;
pub mod encoder;
pub mod moteus_r4;
pub mod witnessed;

pub use b_g431b_esc1::BG431BEsc1;
pub use drivetrain::Drivetrain;
pub use encoder::Encoder;
pub use moteus_r4::MoteusR4;
pub use witnessed::Witnessed;

use crate::chip::fdcan::line::Line;
use crate::chip::variant::Variant;
use crate::chip::wiring::Wiring;
use crate::chip::{Chip, Deviation};
use crate::cpu::Cpu;
use crate::parts::drv8353::Drv8353;
use plant::ParameterError;

/// Actions of a person or of a broken part on a board.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Inputs {
    /// The button is pressed.
    pub button: bool,
    /// `true` if something pulls the gate driver's fault line low.
    pub driver_fault: bool,
    /// The bridge's thermistor is not connected any more.
    pub thermistor_open: bool,
    /// The level that the data line of an encoder with a serial interface stays at, whatever the encoder says. Of one
    /// that is silent it is high: the line is pulled up. The lines of an incremental encoder stay as they are.
    pub encoder_line: Option<bool>,
}

/// A board as the chip's surroundings, and as who tests it sees it.
pub trait Wired: Wiring {
    /// The chip on it.
    const VARIANT: &'static Variant;
    /// Name of the firmware's feature for it.
    const NAME: &'static str;

    /// `true` if it has a button.
    const BUTTON: bool;

    /// Deviations of the program from the manual, made knowingly.
    const DEVIATIONS: &'static [Deviation];

    /// A core for its chip. A board says this itself, so that a core's thousand operations are compiled with the board,
    /// once, and not again in every program that runs it.
    fn core(chip: Chip<Self>) -> Cpu<Chip<Self>>
    where
        Self: Sized;

    /// The board with another encoder on the motor's shaft than the actuator's with the board's usual counts.
    ///
    /// # Errors
    /// An encoder that is outside its ranges, or that the board cannot have.
    fn with_encoder(self, encoder: Encoder) -> Result<Self, ParameterError>
    where
        Self: Sized;

    /// Bridge, motor and joint.
    fn drivetrain(&mut self) -> &mut Drivetrain;
    /// Button and lines.
    fn inputs(&mut self) -> &mut Inputs;
    /// The CAN bus.
    fn line(&mut self) -> &mut Line;
    /// Returns `true` if the LED is lit.
    fn led(&self) -> bool;
    /// The gate driver, where it has registers and a fault line.
    fn gate_driver(&mut self) -> Option<&mut Drv8353>;
}

/// Work on a board of which only the name is known.
pub trait WithBoard {
    /// Result of the work.
    type Outcome;

    /// Runs the work; `new` makes the board from the drivetrain behind it.
    fn run<W: Wired>(self, new: fn(Drivetrain) -> W) -> Self::Outcome;
}

/// Outcome on the board of a name; none where there is no such board.
pub fn with_board<T: WithBoard>(name: &str, work: T) -> Option<T::Outcome> {
    match name {
        BG431BEsc1::NAME => Some(work.run(BG431BEsc1::new)),
        MoteusR4::NAME => Some(work.run(MoteusR4::new)),
        _ => None,
    }
}
