//! The boards' programs copy and clear memory by routines of their own, which the compiler calls by name (RTABI,
//! 4.3.4): every length, every overlap, and not a byte beside, executed from where the program has them.

use crate::Missing;
use emulator::cpu::{Cpu, End};
use emulator::memory::Memory;
use emulator::program::Program;
use host_tests::bare_metal::{BOARDS, build};
use libtest_mimic::{Failed, Trial};

/// Memory in which the routines work, with as much around it as they might touch.
const SRAM: u32 = 0x2000_0000;
const ROOM: usize = 256;
/// Return address: a breakpoint behind the program.
const BACK: u32 = 0x0807_fff0;
/// Lengths in bytes: of both loops of words and of what is left over.
const LENGTHS: std::ops::RangeInclusive<usize> = 0..=83;
/// Registers that a routine must leave as they were.
const KEPT: [usize; 9] = [4, 5, 6, 7, 8, 9, 10, 11, 13];

pub fn trials(missing: &Missing) -> Vec<Trial> {
    vec![Trial::test("copies_and_clears_move_each_byte_and_none_beside", each_byte).with_ignored_flag(missing.target)]
}

/// Routine that works on memory.
#[derive(Clone, Copy, PartialEq)]
enum Routine {
    Clear,
    Copy,
    Move,
}

fn each_byte() -> Result<(), Failed> {
    for board in &BOARDS {
        let program = Program::parse(std::fs::read(build(board.name, env!("CARGO_TARGET_TMPDIR"))?)?)?;
        let mut cpu = core(&program)?;
        let mut found = 0;
        for (name, routine, aligned) in [
            ("__aeabi_memclr4", Routine::Clear, 4),
            ("__aeabi_memclr8", Routine::Clear, 8),
            ("__aeabi_memclr", Routine::Clear, 1),
            ("__aeabi_memcpy4", Routine::Copy, 4),
            ("__aeabi_memcpy8", Routine::Copy, 8),
            ("__aeabi_memcpy", Routine::Copy, 1),
            ("__aeabi_memmove4", Routine::Move, 4),
            ("__aeabi_memmove8", Routine::Move, 8),
        ] {
            // The linker leaves out those that nothing calls.
            let Some(symbol) = program.symbol(name) else { continue };
            found += 1;
            for length in LENGTHS {
                // Apart, and for those that may overlap also by a part of the length, either way.
                let overlaps = if routine == Routine::Move { &[0, 8, 16, 24, 48, 64][..] } else { &[] };
                let apart = [(16, 128), (128, 16), (16 + aligned % 8, 136 + aligned % 8)];
                let near = overlaps.iter().flat_map(|by| [(64, 64 + by), (64 + by, 64)]);
                for (to, from) in apart.into_iter().chain(near) {
                    check(&mut cpu, (symbol.address, routine), to, from, length).map_err(|what| {
                        format!("{}, {name}, {length} bytes from {from} to {to}: {what}", board.name)
                    })?;
                }
            }
        }
        if found < 4 || program.symbol("__aeabi_memclr4").is_none() || program.symbol("__aeabi_memcpy4").is_none() {
            return Err(format!("{}: only {found} of the routines are linked", board.name).into());
        }
    }
    Ok(())
}

/// The program in a memory without a chip, with what it copies to CCM SRAM at its start.
fn core(program: &Program) -> Result<Cpu<Memory>, Failed> {
    let address = |name: &str| program.symbol(name).map(|symbol| symbol.address).ok_or(format!("no {name}"));
    let (start, end, load) = (address("__ccm_start")?, address("__ccm_end")?, address("__ccm_load")?);
    let flash = 0x0800_0000..0x0808_0000;
    let mut memory = Memory::new().with(SRAM..SRAM + 0x8000, false).with(flash.clone(), true).with(start..end, true);
    let fits = program.segments().all(|(address, bytes)| memory.set(address, bytes));
    let routines = memory.bytes(load, (end - start) as usize).ok_or("CCM SRAM is not loaded from flash")?.to_vec();
    match fits && memory.set(start, &routines) && memory.set(BACK, &[0x00, 0xbe]) {
        true => {
            let mut cpu = memory.core();
            cpu.reset(flash.start).map_err(|refusal| format!("{refusal:?}"))?;
            Ok(cpu)
        }
        false => Err("the program does not fit into the memory".into()),
    }
}

fn check(
    cpu: &mut Cpu<Memory>,
    (address, routine): (u32, Routine),
    to: usize,
    from: usize,
    length: usize,
) -> Result<(), String> {
    let before: Vec<u8> = (1..=ROOM as u32).map(|i| (i.wrapping_mul(0x9e37_79b9) >> 24) as u8 | 1).collect();
    let mut expected = before.clone();
    match routine {
        Routine::Clear => expected[to..to + length].fill(0),
        _ => expected.copy_within(from..from + length, to),
    }
    let place = |offset: usize| SRAM + offset as u32;
    let second = if routine == Routine::Clear { length as u32 } else { place(from) };
    for number in 0..13 {
        cpu.set_register(number, 0x1111_1111 * number as u32);
    }
    for (number, value) in [(0, place(to)), (1, second), (2, length as u32), (13, SRAM + 0x8000), (14, BACK | 1)] {
        cpu.set_register(number, value);
    }
    cpu.set_register(15, address);
    let kept = KEPT.map(|number| cpu.register(number));
    if !cpu.bus.set(SRAM, &before) {
        return Err("no memory".to_owned());
    }
    match cpu.run(cpu.now() + 10_000) {
        End::Breakpoint { address: BACK, .. } => {}
        end => return Err(end.to_string()),
    }
    if cpu.bus.bytes(SRAM, ROOM) != Some(&expected) {
        return Err(format!("{:?} instead of {expected:?}", cpu.bus.bytes(SRAM, ROOM)));
    }
    match KEPT.map(|number| cpu.register(number)) == kept {
        true => Ok(()),
        false => Err("a register that is the caller's has changed".to_owned()),
    }
}
