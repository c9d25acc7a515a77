//! Multiplications of words and half-words, with and without accumulation, and divisions.

use crate::bus::Bus;
use crate::cpu::Cpu;
use crate::cpu::operation::{Done, Operands, Rest, Trap};

/// Addend: register x, or 0 where that is 15.
fn addend<B: Bus>(cpu: &Cpu<B>, o: Operands) -> u32 {
    if o.x == 15 { 0 } else { cpu.get(o.x) }
}

/// The upper half-word with its sign if `top`, otherwise the lower.
#[inline(always)]
fn half(value: u32, top: bool) -> i64 {
    i64::from(if top { (value >> 16) as i16 } else { value as i16 })
}

/// Keeps the lower word; Q where that is not all (the accumulation wraps, it does not saturate).
#[inline(always)]
fn set_wrapping<B: Bus>(cpu: &mut Cpu<B>, register: u8, value: i64) {
    cpu.saturated |= value != i64::from(value as i32);
    cpu.set(register, value as u32);
}

/// d and m of long results: d is the lower word, x the upper.
fn long<B: Bus>(cpu: &Cpu<B>, o: Operands) -> u64 {
    u64::from(cpu.get(o.x)) << 32 | u64::from(cpu.get(o.d))
}

fn set_long<B: Bus>(cpu: &mut Cpu<B>, o: Operands, value: u64) {
    cpu.set(o.d, value as u32);
    cpu.set(o.x, (value >> 32) as u32);
}

/// MLA; MUL where x is 15.
pub(in crate::cpu) fn mla<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    let value = addend(cpu, o).wrapping_add(cpu.get(o.n).wrapping_mul(cpu.get(o.m)));
    cpu.set(o.d, value);
    cpu.next(rest)
}

pub(in crate::cpu) fn mls<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    let value = cpu.get(o.x).wrapping_sub(cpu.get(o.n).wrapping_mul(cpu.get(o.m)));
    cpu.set(o.d, value);
    cpu.next(rest)
}

/// SMLAxy, SMULxy: `immediate` has the upper half of n in bit 1, that of m in bit 0.
pub(in crate::cpu) fn smla_halves<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    let product = half(cpu.get(o.n), o.immediate & 2 != 0) * half(cpu.get(o.m), o.immediate & 1 != 0);
    let sum = i64::from(addend(cpu, o) as i32) + product;
    set_wrapping(cpu, o.d, sum);
    cpu.next(rest)
}

/// SMLAWy, SMULWy: the upper 32 of 48 bits; `immediate` chooses the upper half of m.
pub(in crate::cpu) fn smlaw<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    let product = i64::from(cpu.get(o.n) as i32) * half(cpu.get(o.m), o.immediate & 1 != 0);
    let sum = i64::from(addend(cpu, o) as i32) + (product >> 16);
    set_wrapping(cpu, o.d, sum);
    cpu.next(rest)
}

/// Products of lower and upper half-words, those of m exchanged if bit 0 of `immediate` says so.
#[inline(always)]
fn products<B: Bus>(cpu: &Cpu<B>, o: Operands) -> (i64, i64) {
    let (n, m) = (cpu.get(o.n), cpu.get(o.m).rotate_right(16 * (o.immediate & 1)));
    (half(n, false) * half(m, false), half(n, true) * half(m, true))
}

/// SMLAD, SMUAD.
pub(in crate::cpu) fn smlad<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    let (low, high) = products(cpu, o);
    let sum = i64::from(addend(cpu, o) as i32) + low + high;
    set_wrapping(cpu, o.d, sum);
    cpu.next(rest)
}

/// SMLSD, SMUSD.
pub(in crate::cpu) fn smlsd<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    let (low, high) = products(cpu, o);
    let sum = i64::from(addend(cpu, o) as i32) + low - high;
    set_wrapping(cpu, o.d, sum);
    cpu.next(rest)
}

/// Rounding of the SMM instructions: bit 0 of `immediate`.
fn rounding(o: Operands) -> i64 {
    i64::from(o.immediate & 1) << 31
}

/// SMMLA, SMMUL, rounded or not.
pub(in crate::cpu) fn smmla<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    let product = i64::from(cpu.get(o.n) as i32) * i64::from(cpu.get(o.m) as i32);
    let sum = (i64::from(addend(cpu, o) as i32) << 32).wrapping_add(product).wrapping_add(rounding(o));
    cpu.set(o.d, (sum >> 32) as u32);
    cpu.next(rest)
}

/// SMMLS, rounded or not.
pub(in crate::cpu) fn smmls<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    let product = i64::from(cpu.get(o.n) as i32) * i64::from(cpu.get(o.m) as i32);
    let sum = (i64::from(cpu.get(o.x) as i32) << 32).wrapping_sub(product).wrapping_add(rounding(o));
    cpu.set(o.d, (sum >> 32) as u32);
    cpu.next(rest)
}

/// USADA8, USAD8.
pub(in crate::cpu) fn usada8<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    let bytes = cpu.get(o.n).to_le_bytes().into_iter().zip(cpu.get(o.m).to_le_bytes());
    let sum: u32 = bytes.map(|(a, b)| u32::from(a.abs_diff(b))).sum();
    let value = addend(cpu, o).wrapping_add(sum);
    cpu.set(o.d, value);
    cpu.next(rest)
}

pub(in crate::cpu) fn smull<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    let product = i64::from(cpu.get(o.n) as i32) * i64::from(cpu.get(o.m) as i32);
    set_long(cpu, o, product as u64);
    cpu.next(rest)
}

pub(in crate::cpu) fn umull<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    let product = u64::from(cpu.get(o.n)) * u64::from(cpu.get(o.m));
    set_long(cpu, o, product);
    cpu.next(rest)
}

pub(in crate::cpu) fn smlal<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    let product = i64::from(cpu.get(o.n) as i32) * i64::from(cpu.get(o.m) as i32);
    let sum = long(cpu, o).wrapping_add(product as u64);
    set_long(cpu, o, sum);
    cpu.next(rest)
}

pub(in crate::cpu) fn umlal<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    let sum = long(cpu, o).wrapping_add(u64::from(cpu.get(o.n)) * u64::from(cpu.get(o.m)));
    set_long(cpu, o, sum);
    cpu.next(rest)
}

/// UMAAL: product and both words of the accumulator; never overflows.
pub(in crate::cpu) fn umaal<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    let product = u64::from(cpu.get(o.n)) * u64::from(cpu.get(o.m));
    let sum = product + u64::from(cpu.get(o.d)) + u64::from(cpu.get(o.x));
    set_long(cpu, o, sum);
    cpu.next(rest)
}

/// SMLALxy: `immediate` as in `smla_halves`.
pub(in crate::cpu) fn smlal_halves<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    let product = half(cpu.get(o.n), o.immediate & 2 != 0) * half(cpu.get(o.m), o.immediate & 1 != 0);
    let sum = long(cpu, o).wrapping_add(product as u64);
    set_long(cpu, o, sum);
    cpu.next(rest)
}

pub(in crate::cpu) fn smlald<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    let (low, high) = products(cpu, o);
    let sum = long(cpu, o).wrapping_add((low + high) as u64);
    set_long(cpu, o, sum);
    cpu.next(rest)
}

pub(in crate::cpu) fn smlsld<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    let (low, high) = products(cpu, o);
    let sum = long(cpu, o).wrapping_add((low - high) as u64);
    set_long(cpu, o, sum);
    cpu.next(rest)
}

/// SDIV: rounds towards zero; the one quotient that does not fit wraps.
pub(in crate::cpu) fn sdiv<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    let (n, m) = (cpu.get(o.n) as i32, cpu.get(o.m) as i32);
    if m == 0 && cpu.system.traps_division() {
        return cpu.trap(rest, Trap::DivisionByZero);
    }
    let quotient = if m == 0 { 0 } else { n.wrapping_div(m) };
    cpu.set(o.d, quotient as u32);
    cpu.next(rest)
}

pub(in crate::cpu) fn udiv<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    let m = cpu.get(o.m);
    if m == 0 && cpu.system.traps_division() {
        return cpu.trap(rest, Trap::DivisionByZero);
    }
    let quotient = cpu.get(o.n).checked_div(m).unwrap_or(0);
    cpu.set(o.d, quotient);
    cpu.next(rest)
}
