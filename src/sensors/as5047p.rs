//! Frames of the AS5047P, a magnetic encoder with 14 bit a turn on SPI; control step.
//!
//! Source: ams AS5047P datasheet, "SPI interface": 16-bit frames, mode 1, at most 10 MHz; bit 15 is even parity over
//! the lower 15 bits, bit 14 of an answer flags an error of the previous command.

use super::rotor_encoder::RotorEncoder;

/// The command with its parity bit.
const fn with_parity(command: u16) -> u16 {
    let command = command & 0x7fff;
    command | ((command.count_ones() as u16 & 1) << 15)
}

/// The chip.
pub struct As5047p;

impl RotorEncoder for As5047p {
    /// The angle with dynamic error compensation: register 0x3FFF, read bit, parity.
    const READ: u16 = with_parity(1 << 14 | 0x3fff);
    const MODE: u8 = 1;
    const FASTEST: u32 = 10_000_000;
    /// t_L of the datasheet.
    const SELECT: u32 = 350;
    const ANSWERS_AFTER: u32 = 1;

    /// A data line stuck high fails (the error flag is set); one stuck low reads as a valid angle of zero, which only
    /// the joint's own check for a standing angle can find.
    #[inline(always)]
    fn angle(frame: u16) -> Option<u32> {
        let even = frame.count_ones() & 1 == 0;
        let error = frame & (1 << 14) != 0;
        (even && !error).then_some(u32::from(frame & 0x3fff) << 18)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_angle_is_read_and_any_single_flipped_bit_is_refused() {
        for code in 0..1u16 << 14 {
            let frame = with_parity(code);
            assert_eq!(As5047p::angle(frame), Some(u32::from(code) << 18));
            for bit in 0..16 {
                assert_eq!(As5047p::angle(frame ^ (1 << bit)), None, "code {code}, bit {bit}");
            }
        }
    }

    #[test]
    fn an_answer_with_the_error_flag_or_from_a_line_stuck_high_is_refused() {
        assert_eq!(As5047p::angle(with_parity(1 << 14 | 77)), None);
        assert_eq!(As5047p::angle(0xffff), None);
    }

    #[test]
    fn the_command_is_the_datasheets() {
        assert_eq!(As5047p::READ, 0xffff);
    }
}
