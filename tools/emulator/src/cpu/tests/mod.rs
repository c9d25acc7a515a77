//! Behaviour of the core, by group of instructions, and with exceptions and faults. Values are from the architecture's
//! pseudo-code.

mod data_processing;
mod dsp;
mod exceptions;
mod faults;
mod floating_point;
mod load_store;
mod priorities;
mod stretches;
mod translation;
mod watching;

use super::{Cpu, End};
use crate::memory::Memory;

/// Begin of the code under test, and of the stack; the vector table lies at the flash's beginning.
pub(super) const VECTORS: u32 = 0x0800_0000;
pub(super) const START: u32 = 0x0800_0400;
pub(super) const STACK: u32 = 0x2000_8000;
/// Memory for loads and stores.
pub(super) const DATA: u32 = 0x2000_1000;

/// Address of the handler of an exception; all of them return at once, unless a test says otherwise.
pub(super) fn handler(number: u16) -> u32 {
    0x0800_1000 + 0x40 * u32::from(number)
}

/// A core at the first of these half-words. Behind them lies a breakpoint.
pub(super) fn machine(code: &[u16]) -> Cpu<Memory> {
    // Small: a property test makes thousands of them.
    let mut memory = Memory::new().with(0x2000_0000..0x2000_9000, false).with(VECTORS..VECTORS + 0x3800, true);
    assert!(memory.set(VECTORS, &STACK.to_le_bytes()));
    assert!(memory.set(VECTORS + 4, &(START | 1).to_le_bytes()));
    for number in 2..144 {
        assert!(memory.set(VECTORS + 4 * u32::from(number), &(handler(number) | 1).to_le_bytes()));
    }
    let mut cpu = memory.core();
    for number in 2..144 {
        assert!(cpu.bus.set(handler(number), &0x4770u16.to_le_bytes()));
    }
    place(&mut cpu, START, code);
    place(&mut cpu, START + 2 * code.len() as u32, &[0xbe00]);
    cpu.reset(VECTORS).expect("vectors");
    cpu
}

/// Puts code somewhere.
pub(super) fn place(cpu: &mut Cpu<Memory>, address: u32, code: &[u16]) {
    let bytes: Vec<u8> = code.iter().flat_map(|half| half.to_le_bytes()).collect();
    assert!(cpu.bus.set(address, &bytes));
    cpu.read_signals();
}

/// The two half-words of a wide encoding.
pub(super) fn halves(encoding: u32) -> [u16; 2] {
    [(encoding >> 16) as u16, encoding as u16]
}

/// Runs to the breakpoint behind the code, or to what else ends it.
pub(super) fn finish(cpu: &mut Cpu<Memory>) -> End {
    cpu.run(cpu.now() + 100_000)
}

/// Runs to the breakpoint behind the code.
pub(super) fn complete(cpu: &mut Cpu<Memory>) {
    let end = finish(cpu);
    assert!(matches!(end, End::Breakpoint { number: 0, .. }), "{end}");
}

/// Single steps until a cycle is reached, or something else ends them.
pub(super) fn steps_to(cpu: &mut Cpu<Memory>, until: u64) -> Option<End> {
    let mut end = None;
    while end.is_none() && cpu.now() < until {
        end = cpu.step();
    }
    end
}

/// A word of memory or of the core's own registers, read as the program would.
pub(super) fn read(cpu: &mut Cpu<Memory>, address: u32) -> u32 {
    cpu.load::<4>(address).expect("a register that is modelled")
}

/// Stores a word as the program would.
pub(super) fn write(cpu: &mut Cpu<Memory>, address: u32, value: u32) {
    cpu.store::<4>(address, value).expect("a register that is modelled");
}

/// Registers of the core.
pub(super) const ICSR: u32 = 0xe000_ed04;
pub(super) const AIRCR: u32 = 0xe000_ed0c;
pub(super) const SCR: u32 = 0xe000_ed10;
pub(super) const CCR: u32 = 0xe000_ed14;
pub(super) const SHCSR: u32 = 0xe000_ed24;
pub(super) const CFSR: u32 = 0xe000_ed28;
pub(super) const HFSR: u32 = 0xe000_ed2c;
pub(super) const BFAR: u32 = 0xe000_ed38;
pub(super) const CPACR: u32 = 0xe000_ed88;
pub(super) const FPCCR: u32 = 0xe000_ef34;

/// Switches the floating-point unit on.
pub(super) fn with_floating_point(mut cpu: Cpu<Memory>) -> Cpu<Memory> {
    write(&mut cpu, CPACR, 0xf << 20);
    cpu
}

/// Enables interrupt `n` at a priority.
pub(super) fn enable(cpu: &mut Cpu<Memory>, n: u32, priority: u8) {
    write(cpu, 0xe000_e100 + 4 * (n / 32), 1 << (n % 32));
    cpu.store::<1>(0xe000_e400 + n, u32::from(priority)).expect("a priority");
}

/// Pends interrupt `n`.
pub(super) fn pend(cpu: &mut Cpu<Memory>, n: u32) {
    write(cpu, 0xe000_e200 + 4 * (n / 32), 1 << (n % 32));
}
