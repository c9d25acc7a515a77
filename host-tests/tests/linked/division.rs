//! The 64-bit divisions that the program of the B-G431B-ESC1 brings along, run on the emulated core against the host's.

use emulator::cpu::End;
use emulator::memory::Memory;
use emulator::program::Program;
use host_tests::bare_metal;
use libtest_mimic::{Failed, Trial};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// Memory that a call uses: its stack, and a breakpoint to return to.
const STACK: u32 = 0x2000_4000;
const RETURN: u32 = 0x2000_0000;
const BREAKPOINT: [u8; 2] = 0xbe00_u16.to_le_bytes();
/// Random pairs.
const PAIRS: usize = 20_000;
/// Longest division, cycles.
const LONGEST: u64 = 2_000;

pub fn trials() -> Vec<Trial> {
    vec![Trial::test("the_divisions_of_b_g431b_esc1_are_the_hosts", divisions)]
}

/// A number of every length, with the ends of the range among them.
fn operand(random: &mut ChaCha8Rng) -> u64 {
    let number = random.next_u64();
    match number % 8 {
        0 => [0, 1, u64::MAX, 1 << 63, i64::MAX as u64, 1 << 32, u32::MAX.into(), 1 << 31]
            [random.next_u32() as usize % 8],
        1 => (number as i64 >> (random.next_u32() % 64)) as u64,
        _ => number >> (random.next_u32() % 64),
    }
}

fn divisions() -> Result<(), Failed> {
    let path = bare_metal::build("b-g431b-esc1", env!("CARGO_TARGET_TMPDIR"))?;
    let program = Program::parse(std::fs::read(path)?)?;
    let mut memory = Memory::new().with(0x0800_0000..0x0802_0000, true).with(0x1000_0000..0x1000_2800, true);
    memory = memory.with(0x2000_0000..0x2000_8000, true);
    for (address, bytes) in program.segments() {
        if !memory.set(address, bytes) {
            return Err(format!("nothing lies at {address:#010x}").into());
        }
    }
    memory.set(RETURN, &BREAKPOINT);
    let mut cpu = memory.core();
    let mut call = |name: &str, dividend: u64, divisor: u64| -> Result<(u64, u64), Failed> {
        let function = program.symbol(name).ok_or_else(|| format!("no symbol {name}"))?;
        let words = [dividend as u32, (dividend >> 32) as u32, divisor as u32, (divisor >> 32) as u32];
        for (number, word) in words.into_iter().enumerate() {
            cpu.set_register(number, word);
        }
        cpu.set_register(13, STACK);
        cpu.set_register(14, RETURN | 1);
        cpu.set_register(15, function.address & !1);
        match cpu.run(cpu.now() + LONGEST) {
            End::Breakpoint { .. } => {}
            end => return Err(format!("{name}({dividend:#x}, {divisor:#x}) ends with {end}").into()),
        }
        let pair = |low: usize| u64::from(cpu.register(low)) | u64::from(cpu.register(low + 1)) << 32;
        match cpu.register(13) {
            STACK => Ok((pair(0), pair(2))),
            stack => Err(format!("{name} leaves the stack at {stack:#010x}").into()),
        }
    };
    let mut random = ChaCha8Rng::seed_from_u64(1);
    for _ in 0..PAIRS {
        let (dividend, divisor) = (operand(&mut random), operand(&mut random).max(1));
        let found = call("__aeabi_uldivmod", dividend, divisor)?;
        if found != (dividend / divisor, dividend % divisor) {
            return Err(format!("{dividend} over {divisor}: {found:?}").into());
        }
        let (signed, by) = (dividend as i64, divisor as i64);
        let found = call("__aeabi_ldivmod", dividend, divisor)?;
        if found != (signed.wrapping_div(by) as u64, signed.wrapping_rem(by) as u64) {
            return Err(format!("{signed} over {by}: {found:x?}").into());
        }
    }
    Ok(())
}
