//! Runs single instructions for a program that compares them: `against_unicorn.py` beside the sources.
//!
//! Reads cases from standard input until its end and writes a result for each, both as little-endian words.
//! A case: address, number of instructions, code (2 words), r0 to r14, program status register, FPSCR, s0 to s31, 64
//! words of memory. A result: 0 if all of them ran, 1 if one was unpredictable, 2 if one was unknown, 3 for anything
//! else; r0 to r14, address of the next instruction, program status register, FPSCR, s0 to s31, the 64 words.

use emulator::cpu::{Cpu, End, Refused};
use emulator::memory::Memory;
use std::io::{BufReader, BufWriter, Read, Write};

/// Addresses of the words of memory, and of the code.
const DATA: u32 = 0x2000_1000;
const CODE: std::ops::Range<u32> = 0x0800_0000..0x0808_0000;
const CASE: usize = 2 + 2 + 15 + 2 + 32 + 64;

/// Code before each case: vmov.f32 s0, s0, so that no case is the first to use the unit, which sets its modes; clrex.
const BEFORE: [u8; 8] = [0xb0, 0xee, 0x40, 0x0a, 0xbf, 0xf3, 0x2f, 0x8f];

/// Resets the core and switches the floating-point unit on, by the program's own instruction: str r1, [r0].
fn reset(cpu: &mut Cpu<Memory>) -> std::io::Result<()> {
    // Stack and start, the instruction behind; the vectors of faults are not used: a fault ends the case.
    assert!(cpu.bus.set(CODE.start, &[0, 0x20, 0, 0x20, 0x41, 0, 0, 8]) && cpu.bus.set(CODE.start + 0x40, &[1, 0x60]));
    assert!(cpu.bus.set(CODE.start + 0x80, &BEFORE));
    cpu.reset(CODE.start).map_err(|refusal| std::io::Error::other(format!("{refusal:?}")))?;
    cpu.set_register(0, 0xe000_ed88);
    cpu.set_register(1, 0xf << 20);
    assert_eq!(cpu.step(), None);
    Ok(())
}

fn main() -> std::io::Result<()> {
    let memory = Memory::new().with(DATA - 0x1000..DATA + 0x1000, false).with(CODE, true);
    let mut cpu = memory.core();
    reset(&mut cpu)?;
    let mut input = BufReader::with_capacity(1 << 20, std::io::stdin().lock());
    let mut output = BufWriter::with_capacity(1 << 20, std::io::stdout().lock());
    let mut case = [0; 4 * CASE];
    while input.read_exact(&mut case).is_ok() {
        let word = |i: usize| case[4 * i..].first_chunk().map_or(0, |bytes| u32::from_le_bytes(*bytes));
        cpu.set_register(15, CODE.start + 0x80);
        assert_eq!((cpu.step(), cpu.step()), (None, None));
        assert!(cpu.bus.set(word(0), &case[8..16]) && cpu.bus.set(DATA, &case[4 * 53..]));
        (0..15).for_each(|n| cpu.set_register(n, word(4 + n)));
        cpu.set_register(15, word(0));
        cpu.set_xpsr(word(19) | 1 << 24);
        cpu.set_fpscr(word(20));
        (0..32).for_each(|n| cpu.set_float_register(n, word(21 + n)));
        let end = (0..word(1)).find_map(|_| cpu.step());
        let faulted = cpu.exception() != 0;
        let status: u32 = match end {
            None if !faulted => 0,
            Some(End::Refused { why: Refused::Unpredictable, .. }) => 1,
            Some(End::Refused { .. }) => 2,
            _ => 3,
        };
        let mut result = vec![status];
        result.extend((0..16).map(|n| cpu.register(n)));
        result.extend([cpu.xpsr(), cpu.fpscr()]);
        result.extend((0..32).map(|n| cpu.float_register(n)));
        let bytes: Vec<u8> = result.iter().flat_map(|word| word.to_le_bytes()).collect();
        output.write_all(&bytes)?;
        output.write_all(cpu.bus.bytes(DATA, 256).unwrap_or_default())?;
        if input.buffer().is_empty() {
            output.flush()?;
        }
        if status == 3 {
            reset(&mut cpu)?;
        }
    }
    Ok(())
}
