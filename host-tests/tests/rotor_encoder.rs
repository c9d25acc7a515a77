//! Encoder chips as the board's program takes them, against the emulated ones: command, mode, clock, age of an answer,
//! and words to angles.

use emulator::chip::time::Instant;
use emulator::chip::wiring::SpiFrame;
use emulator::parts;
use joint_firmware::sensors::as5047p::As5047p;
use joint_firmware::sensors::rotor_encoder::{RotorEncoder, clock};

/// Clock of the SPI's kernel on the moteus r4, Hz.
const KERNEL: u32 = 170_000_000;

/// A command to the emulated chip at a count; the program's angle of its answer.
fn frame<E: RotorEncoder, P: parts::rotor_encoder::RotorEncoder>(chip: &mut P, count: u32) -> Option<u32> {
    chip.select(true, || count);
    let frequency = clock::<E>(KERNEL).into();
    let frame = SpiFrame { bus: 2, mode: E::MODE, bits: 16, sent: E::READ, frequency, began: Instant(0) };
    let answer = chip.exchange(&frame, count);
    chip.select(false, || count);
    answer.and_then(E::angle)
}

/// An angle for each count, so many frames later as the program believes.
fn agrees<E: RotorEncoder, P: parts::rotor_encoder::RotorEncoder>() {
    let counts: Vec<u32> = (0..P::COUNTS).step_by(37).collect();
    let mut chip = P::default();
    let angles: Vec<_> = counts.iter().map(|&count| frame::<E, P>(&mut chip, count)).collect();
    let per_count = (1u64 << 32) / u64::from(P::COUNTS);
    let expected: Vec<_> = counts.iter().map(|&count| Some((u64::from(count) * per_count) as u32)).collect();
    let after = E::ANSWERS_AFTER as usize;
    assert_eq!(angles[after..], expected[..counts.len() - after]);
}

#[test]
fn the_emulated_encoders_answer_as_the_program_expects() {
    agrees::<As5047p, parts::as5047p::As5047p>();
}
