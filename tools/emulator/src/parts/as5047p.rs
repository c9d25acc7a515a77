//! AS5047P, a magnetic encoder with 14 bits a turn.
//!
//! Source: ams AS5047P datasheet, "SPI interface": frames of 16 bits, mode 1, at most 10 MHz, even parity; the answer
//! to a command comes with the next frame. Registers: NOP, ERRFL, DIAAGC, MAG, ANGLEUNC, ANGLECOM; those of the
//! one-time memory read as zero and cannot be written here.
//!
//! Assumption: what a command reads is what holds when its frame ends. Dynamic compensation is ideal: ANGLECOM is the
//! angle itself.

use super::rotor_encoder::RotorEncoder;
use crate::chip::wiring::SpiFrame;

/// Fastest clock, Hz.
pub const FASTEST: u64 = 10_000_000;

const READ: u16 = 1 << 14;
const ADDRESS: u16 = 0x3fff;
const ERROR: u16 = 1 << 14;

/// ERRFL: a frame without 16 bits, a register that is not there, wrong parity.
const FRAMING: u16 = 1 << 0;
const INVALID: u16 = 1 << 1;
const PARITY: u16 = 1 << 2;

/// Field that the sensor sees.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Field {
    /// Angle, 2^14 a turn.
    pub angle: u16,
    /// Amplification that the field needs, 255 at the weakest.
    pub gain: u8,
    /// Strength of the field, 14 bits.
    pub magnitude: u16,
    /// The field is too weak.
    pub low: bool,
    /// The field is too strong.
    pub high: bool,
}

impl Field {
    /// A good field at an angle.
    pub const fn at(angle: u16) -> Self {
        Self { angle: angle & ADDRESS, gain: 128, magnitude: 5_000, low: false, high: false }
    }
}

/// The encoder.
#[derive(Clone, Debug, Default)]
pub struct As5047p {
    selected: bool,
    frames: u32,
    /// Content of the next frame, without parity and error flag.
    answer: u16,
    errors: u16,
}

const fn with_parity(word: u16) -> u16 {
    let word = word & 0x7fff;
    word | ((word.count_ones() as u16 & 1) << 15)
}

impl RotorEncoder for As5047p {
    const COUNTS: u32 = 1 << 14;

    /// One frame belongs into a selection; more are a framing error.
    fn select(&mut self, selected: bool, _: impl FnOnce() -> u32) {
        if self.selected && !selected && self.frames > 1 {
            self.errors |= FRAMING;
        }
        if selected != self.selected {
            (self.selected, self.frames) = (selected, 0);
        }
    }

    fn exchange(&mut self, frame: &SpiFrame, count: u32) -> Option<u16> {
        self.sense(frame, &Field::at(count as u16))
    }
}

impl As5047p {
    /// A frame that ended, and what the sensor saw. None where it is not selected: it leaves the line alone.
    pub fn sense(&mut self, frame: &SpiFrame, field: &Field) -> Option<u16> {
        if !self.selected {
            return None;
        }
        self.frames += 1;
        let flag = if self.errors != 0 { ERROR } else { 0 };
        let answer = with_parity(self.answer | flag);
        if frame.bits != 16 || frame.mode != 1 || frame.frequency > FASTEST {
            self.errors |= FRAMING;
            // Bits that are read at the wrong edge are anything.
            return Some(!answer);
        }
        let command = frame.sent;
        if !command.count_ones().is_multiple_of(2) {
            self.errors |= PARITY;
            self.answer = 0;
        } else if command & READ == 0 {
            // NOP is the one command that writes nothing.
            self.errors |= if command & ADDRESS == 0 { 0 } else { INVALID };
            self.answer = 0;
        } else {
            self.answer = self.read(command & ADDRESS, field);
        }
        Some(answer)
    }

    fn read(&mut self, register: u16, field: &Field) -> u16 {
        match register {
            0x0000 => 0,
            // Reading clears it.
            0x0001 => std::mem::take(&mut self.errors),
            0x0003 | 0x0016..=0x0019 => 0,
            // The offset compensation has finished.
            0x3ffc => u16::from(field.gain) | 1 << 8 | u16::from(field.high) << 10 | u16::from(field.low) << 11,
            0x3ffd => field.magnitude & ADDRESS,
            0x3ffe | 0x3fff => field.angle & ADDRESS,
            _ => {
                self.errors |= INVALID;
                0
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chip::time::Instant;

    fn frame(sent: u16) -> SpiFrame {
        SpiFrame { bus: 2, mode: 1, bits: 16, sent, frequency: 5_312_500, began: Instant(0) }
    }

    fn exchange(encoder: &mut As5047p, frame: &SpiFrame, angle: u16) -> u16 {
        encoder.select(true, || 0);
        let answer = encoder.sense(frame, &Field::at(angle)).unwrap();
        encoder.select(false, || 0);
        answer
    }

    #[test]
    fn an_angle_comes_with_the_frame_after_its_command() {
        let mut encoder = As5047p::default();
        exchange(&mut encoder, &frame(0xffff), 0x1234);
        assert_eq!(exchange(&mut encoder, &frame(0xffff), 0x0007) & ADDRESS, 0x1234);
        let answer = exchange(&mut encoder, &frame(0xffff), 0);
        assert_eq!((answer & ADDRESS, answer.count_ones() % 2), (7, 0));
        assert_eq!(answer & ERROR, 0);
    }

    #[test]
    fn wrong_parity_raises_the_flag_until_the_errors_are_read() {
        let mut encoder = As5047p::default();
        exchange(&mut encoder, &frame(0x7fff), 5);
        for _ in 0..3 {
            assert_eq!(exchange(&mut encoder, &frame(0xffff), 5) & ERROR, ERROR);
        }
        exchange(&mut encoder, &frame(with_parity(READ | 1)), 5);
        assert_eq!(exchange(&mut encoder, &frame(0xffff), 5) & ADDRESS, PARITY);
        assert_eq!(exchange(&mut encoder, &frame(0xffff), 5) & ERROR, 0);
    }

    #[test]
    fn registers_that_are_not_there_and_writes_are_invalid() {
        for command in [with_parity(READ | 0x1000), with_parity(0x0018)] {
            let mut encoder = As5047p::default();
            exchange(&mut encoder, &frame(command), 5);
            exchange(&mut encoder, &frame(with_parity(READ | 1)), 5);
            assert_eq!(exchange(&mut encoder, &frame(0), 5) & ADDRESS, INVALID);
        }
    }

    #[test]
    fn a_clock_that_is_too_fast_another_mode_and_two_frames_are_framing_errors() {
        for wrong in [SpiFrame { frequency: 10_625_000, ..frame(0xffff) }, SpiFrame { mode: 0, ..frame(0xffff) }] {
            let mut encoder = As5047p::default();
            exchange(&mut encoder, &wrong, 5);
            assert_eq!(exchange(&mut encoder, &frame(0xffff), 5) & ERROR, ERROR);
        }
        let mut encoder = As5047p::default();
        encoder.select(true, || 0);
        encoder.sense(&frame(0xffff), &Field::at(5));
        encoder.sense(&frame(0xffff), &Field::at(5));
        encoder.select(false, || 0);
        assert_eq!(exchange(&mut encoder, &frame(0xffff), 5) & ERROR, ERROR);
    }

    #[test]
    fn not_selected_it_leaves_the_line_alone() {
        assert_eq!(As5047p::default().sense(&frame(0xffff), &Field::at(5)), None);
    }

    #[test]
    fn the_diagnostics_tell_of_the_field() {
        let mut encoder = As5047p::default();
        let weak = Field { gain: 255, low: true, ..Field::at(0) };
        encoder.select(true, || 0);
        encoder.sense(&frame(with_parity(READ | 0x3ffc)), &weak);
        encoder.select(false, || 0);
        assert_eq!(exchange(&mut encoder, &frame(0), 0) & ADDRESS, 1 << 11 | 1 << 8 | 255);
    }
}
