//! RNG, the random number generator: RM0440, chapter 26. Its numbers are a sequence that begins anew with each power-up
//! of the emulated chip, so that runs repeat; how long a word takes, and the checks of the noise source, are not
//! modelled.

use super::register::{Block, Register, register};
use crate::bus::Refusal;

const CR: u32 = 0x00;
const SR: u32 = 0x04;
const DR: u32 = 0x08;
const RNGEN: u32 = 1 << 2;
const DRDY: u32 = 1;

const REGISTERS: &[Register] = &[
    // IE: no interrupt. CED: the clock's check is not modelled.
    register(CR, "CR", 0, RNGEN, 0x0000_0028),
    register(SR, "SR", 0, 0, 0),
    register(DR, "DR", 0, 0, 0),
];

/// The generator.
#[derive(Clone, Debug)]
pub struct Rng {
    block: Block,
    state: u64,
}

#[allow(clippy::new_without_default, reason = "as the chip's other parts")]
impl Rng {
    /// State after power-up.
    pub fn new() -> Self {
        Self { block: Block::new("RNG", "26.7", REGISTERS), state: 0x9e37_79b9_7f4a_7c15 }
    }

    /// Back to reset; the numbers go on.
    pub fn reset(&mut self) {
        self.block.reset();
    }

    /// A load by the core; `clocked` where its 48 MHz clock runs.
    pub fn read(&mut self, offset: u32, clocked: bool) -> Result<u32, Refusal> {
        let value = self.block.read(offset)?;
        let runs = clocked && self.block.get(CR) & RNGEN != 0;
        Ok(match offset {
            SR if runs => DRDY,
            DR if runs => {
                // xorshift64* (S. Vigna, An experimental exploration of Marsaglia's xorshift generators, 2016).
                self.state ^= self.state >> 12;
                self.state ^= self.state << 25;
                self.state ^= self.state >> 27;
                (self.state.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 32) as u32
            }
            _ => value,
        })
    }

    /// A store by the core.
    pub fn write(&mut self, offset: u32, value: u32) -> Result<(), Refusal> {
        self.block.write(offset, value).map(drop)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_are_numbers_while_it_runs_and_has_its_clock() {
        let mut rng = Rng::new();
        assert_eq!((rng.read(SR, true).unwrap(), rng.read(DR, true).unwrap()), (0, 0));
        rng.write(CR, RNGEN).unwrap();
        assert_eq!((rng.read(SR, false).unwrap(), rng.read(DR, false).unwrap()), (0, 0));
        assert_eq!(rng.read(SR, true).unwrap(), DRDY);
        let numbers: std::collections::BTreeSet<u32> = (0..100).map(|_| rng.read(DR, true).unwrap()).collect();
        assert_eq!(numbers.len(), 100);
        assert!(rng.write(CR, 1 << 3).is_err());
    }
}
