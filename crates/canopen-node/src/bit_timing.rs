//! Bit timing of the bus, and how far a node's clock may be off with it.
//!
//! Two conditions (ISO 11898-1, "oscillator tolerance"; Bosch CAN specification 2.0, part B, chapter 10), with NBT the
//! quanta of a bit, PS1 and PS2 the phase segments before and after the sample point, SJW the width by which an edge
//! resynchronises. A clock may be off by df where
//!
//! - df <= SJW / (2 * 10 NBT): ten bits lie between two edges at the most, and one resynchronisation has to make up for
//!   them;
//! - df <= min(PS1, PS2) / (2 * (13 NBT - PS2)): the last bit of an error flag is sampled 13 bits after the last edge.
//!
//! All nodes may be off by as much, to either side.

/// Bit timing in quanta of the controller's clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BitTiming {
    /// Quanta for the way of a bit over the bus and back, through both transceivers.
    pub propagation: u8,
    /// Phase segment before the sample point.
    pub phase1: u8,
    /// Phase segment after the sample point.
    pub phase2: u8,
    /// Width of a resynchronisation.
    pub jump_width: u8,
}

/// 1 Mbit/s at the 170 MHz that both boards give the controller, without a prescaler: 170 quanta a bit, sampled after
/// 126 of them (74 %).
///
/// The boards' clock is the chip's internal oscillator, which is off by up to 1 % from 0 to 85 °C (from memory of the
/// chip's datasheet): this timing bears 1.01 %. What CiA 301 asks for, a sample after 7/8 of the bit, bears 0.48 %. 81
/// quanta, 476 ns, are left for the way there and back: with 135 ns a transceiver, 20 m at 5 ns/m.
pub const BUS: BitTiming = BitTiming { propagation: 81, phase1: 44, phase2: 44, jump_width: 44 };

impl BitTiming {
    /// Quanta of a bit.
    pub const fn bit(&self) -> u16 {
        1 + self.propagation as u16 + self.phase1 as u16 + self.phase2 as u16
    }

    /// Quanta before the sample point without the first, as the controller's register NBTP takes them (NTSEG1; RM0440,
    /// FDCAN_NBTP).
    pub const fn before_sample(&self) -> u8 {
        self.propagation + self.phase1
    }

    /// Tolerated clock deviation of each node, in millionths: the lower of the two conditions.
    pub const fn tolerance(&self) -> u32 {
        let bit = self.bit() as u32;
        let jump = self.jump_width as u32 * 1_000_000 / (20 * bit);
        let phase = if self.phase1 < self.phase2 { self.phase1 } else { self.phase2 } as u32;
        let flag = phase * 1_000_000 / (2 * (13 * bit - self.phase2 as u32));
        if jump < flag { jump } else { flag }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Millionths: 0.9 %.
    const NEEDED: u32 = 9_000;

    #[test]
    fn a_bit_of_1_mbit_a_second_has_170_quanta_at_170_mhz() {
        assert_eq!((BUS.bit(), BUS.before_sample() + 1), (170, 126));
        // Range of the register, and a resynchronisation within the phase segments.
        assert!(BUS.phase2 <= 128 && BUS.jump_width <= BUS.phase1.min(BUS.phase2));
    }

    #[test]
    fn the_bus_bears_clocks_that_are_off_by_0_9_percent() {
        assert_eq!(BUS.tolerance(), 10_156);
        assert!(BUS.tolerance() >= NEEDED);
    }

    #[test]
    fn the_phase_segments_are_just_long_enough_from_40_quanta_on() {
        let timing =
            |phase: u8| BitTiming { propagation: 169 - 2 * phase, phase1: phase, phase2: phase, jump_width: phase };
        assert!(timing(40).tolerance() >= NEEDED && timing(39).tolerance() < NEEDED);
        // A short jump width is the other condition's.
        let jump = |jump_width: u8| BitTiming { jump_width, ..BUS };
        assert!(jump(31).tolerance() >= NEEDED && jump(30).tolerance() < NEEDED);
    }

    #[test]
    fn sampling_after_seven_eighths_of_a_bit_does_not() {
        let recommended = BitTiming { propagation: 127, phase1: 21, phase2: 21, jump_width: 21 };
        assert_eq!((recommended.bit(), recommended.tolerance()), (170, 4_796));
        assert!(recommended.tolerance() < NEEDED);
    }
}
