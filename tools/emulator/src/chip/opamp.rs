//! The operational amplifiers 1 to 3: RM0440, chapter 25. Follower and programmable gain, with the bias input or
//! without, into a converter.
//!
//! Ideal within 0 V and VDDA: offset, bandwidth and the 3 to 6 µs of waking up are not modelled. Neither are the
//! standalone mode, gains with a filter pin, outputs at a pin, and the modes that a timer switches.

use super::register::{Block, Register, register};
use super::wiring::Pin;
use crate::bus::Refusal;

const OPAEN: u32 = 1 << 0;
const OPAINTOEN: u32 = 1 << 8;

/// FORCE_VP, USERTRIM, CALON and LOCK are refused.
const REGISTERS: &[Register] = &[
    register(0x00, "OPAMP1_CSR", 0, 0x1fff_f1ed, 0x8000_0812),
    register(0x04, "OPAMP2_CSR", 0, 0x1fff_f1ed, 0x8000_0812),
    register(0x08, "OPAMP3_CSR", 0, 0x1fff_f1ed, 0x8000_0812),
];

/// Positive inputs by VP_SEL (25.3.3), and the negative input VINM0 that PGA_GAIN takes as bias.
const INPUTS: [([Option<Pin>; 4], Pin); 3] = [
    ([Some(Pin::new('A', 1)), Some(Pin::new('A', 3)), Some(Pin::new('A', 7)), None], Pin::new('A', 3)),
    ([Some(Pin::new('A', 7)), Some(Pin::new('B', 14)), Some(Pin::new('B', 0)), None], Pin::new('A', 5)),
    ([Some(Pin::new('B', 0)), Some(Pin::new('B', 13)), Some(Pin::new('A', 1)), None], Pin::new('B', 2)),
];

/// Amplification by an amplifier: its output is `gain` times the positive input less `gain - 1` times the bias.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Amplification {
    /// The positive input.
    pub input: Pin,
    /// Gain of the positive input.
    pub gain: f64,
    /// The other end of the divider; ground where none.
    pub bias: Option<Pin>,
}

/// The amplifiers.
#[derive(Clone, Debug)]
pub struct Amplifiers {
    block: Block,
}

impl Amplifiers {
    /// Off.
    pub fn new() -> Self {
        Self { block: Block::new("OPAMP", "25.5", REGISTERS) }
    }

    /// Back to reset.
    pub fn reset(&mut self) {
        self.block.reset();
    }

    /// Amplification that an amplifier, counted from 1, gives its converter; none where it is off, or where its output
    /// is not connected inside.
    pub fn amplification(&self, number: u8) -> Option<Amplification> {
        let index = usize::from(number.checked_sub(1)?);
        let &(inputs, bias) = INPUTS.get(index)?;
        let control = self.block.get(4 * index as u32);
        if control & (OPAEN | OPAINTOEN) != OPAEN | OPAINTOEN {
            return None;
        }
        let input = inputs[(control >> 2 & 3) as usize]?;
        let code = control >> 14 & 0x1f;
        match (control >> 5 & 3, code & 7) {
            // Connected to the output: gain 1.
            (3, _) => Some(Amplification { input, gain: 1.0, bias: None }),
            (2, power @ 0..=5) => {
                let gain = f64::from(2u32 << power);
                match code >> 3 {
                    0 => Some(Amplification { input, gain, bias: None }),
                    1 => Some(Amplification { input, gain, bias: Some(bias) }),
                    _ => None,
                }
            }
            _ => None,
        }
    }

    /// A load by the core.
    pub fn read(&self, offset: u32) -> Result<u32, Refusal> {
        self.block.read(offset)
    }

    /// A store by the core.
    pub fn write(&mut self, offset: u32, value: u32) -> Result<(), Refusal> {
        let before = self.block.write(offset, value)?;
        if self.block.get(offset) & OPAEN != 0 && self.amplification(offset as u8 / 4 + 1).is_none() {
            self.block.set(offset, before);
            return Err(self.block.refuse(offset, &format!("configuration {value:#x} of a running amplifier")));
        }
        Ok(())
    }
}

impl Default for Amplifiers {
    fn default() -> Self {
        Self::new()
    }
}
