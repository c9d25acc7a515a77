//! Half-words and bytes in parallel, saturating arithmetic, selection.

use crate::bus::Bus;
use crate::cpu::Cpu;
use crate::cpu::arithmetic::{ARITHMETIC, LEFT, saturate_signed, saturate_unsigned, shift};
use crate::cpu::operation::{Done, Execute, Operands, Rest};

/// Operations, as the encodings number them.
const ADD8: u8 = 0;
const ADD16: u8 = 1;
const ASX: u8 = 2;
const SUB8: u8 = 4;
const SUB16: u8 = 5;
const SAX: u8 = 6;
/// Treatment of each result: kept modulo its width with the greater-or-equal flags set, saturated, halved; 4 more
/// without sign.
const MODULO: u8 = 0;
const SATURATING: u8 = 1;
const HALVING: u8 = 2;
const UNSIGNED: u8 = 4;

/// SADD16 and its like: 36 instructions of one pattern.
fn parallel<B: Bus, const OPERATION: u8, const KIND: u8>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    let (n, m) = (cpu.get(o.n), cpu.get(o.m));
    let bytes = OPERATION == ADD8 || OPERATION == SUB8;
    let (lanes, bits) = if bytes { (4, 8) } else { (2, 16) };
    // Exchanged half-words of m: the lower lane works with its upper half.
    let m = if OPERATION == ASX || OPERATION == SAX { m.rotate_right(16) } else { m };
    let mask = u32::MAX >> (32 - bits);
    let mut result = 0;
    let mut greater = 0;
    for lane in 0..lanes {
        let of = |word: u32| {
            let field = word >> (lane * bits) & mask;
            match KIND & UNSIGNED {
                0 => ((field << (32 - bits)) as i32 >> (32 - bits)) as i64,
                _ => i64::from(field),
            }
        };
        let subtracts = match OPERATION {
            ADD8 | ADD16 => false,
            SUB8 | SUB16 => true,
            ASX => lane == 0,
            _ => lane == 1,
        };
        let exact = if subtracts { of(n) - of(m) } else { of(n) + of(m) };
        let value = match KIND {
            SATURATING => saturate_signed(exact, bits).0 as u32,
            5 => saturate_unsigned(exact, bits).0,
            HALVING | 6 => (exact >> 1) as u32,
            _ => exact as u32,
        };
        result |= (value & mask) << (lane * bits);
        // An unsigned sum is greater or equal where it carries, everything else where it is not negative.
        let reached = if KIND & UNSIGNED != 0 && !subtracts { exact >> bits != 0 } else { exact >= 0 };
        let flags = if bytes { 1 } else { 3 };
        greater |= (u8::from(reached) * flags) << (lane * bits / 8);
    }
    if KIND & 3 == MODULO {
        cpu.greater = greater;
    }
    cpu.set(o.d, result);
    cpu.next(rest)
}

/// The function of a parallel instruction; None for numbers that there are not.
pub(in crate::cpu) fn parallel_of<B: Bus>(operation: u8, kind: u8) -> Option<Execute<B>> {
    macro_rules! kind {
        ($operation:ident) => {
            match kind {
                MODULO => parallel::<B, $operation, MODULO>,
                SATURATING => parallel::<B, $operation, SATURATING>,
                HALVING => parallel::<B, $operation, HALVING>,
                4 => parallel::<B, $operation, 4>,
                5 => parallel::<B, $operation, 5>,
                6 => parallel::<B, $operation, 6>,
                _ => return None,
            }
        };
    }
    Some(match operation {
        ADD8 => kind!(ADD8),
        ADD16 => kind!(ADD16),
        ASX => kind!(ASX),
        SUB8 => kind!(SUB8),
        SUB16 => kind!(SUB16),
        SAX => kind!(SAX),
        _ => return None,
    })
}

/// SEL: each byte of n where its flag is set, of m where not.
pub(in crate::cpu) fn sel<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    let mask = (0..4).filter(|lane| cpu.greater >> lane & 1 != 0).fold(0, |mask, lane| mask | 0xff << (8 * lane));
    let value = cpu.get(o.n) & mask | cpu.get(o.m) & !mask;
    cpu.set(o.d, value);
    cpu.next(rest)
}

/// QADD, QDADD, QSUB, QDSUB: x as the encoding numbers them. The first operand is m.
pub(in crate::cpu) fn saturating<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    let (n, m) = (i64::from(cpu.get(o.n) as i32), i64::from(cpu.get(o.m) as i32));
    let (n, doubled) = match o.x & 1 {
        0 => (n as i32, false),
        _ => saturate_signed(2 * n, 32),
    };
    let exact = if o.x & 2 == 0 { m + i64::from(n) } else { m - i64::from(n) };
    let (value, saturated) = saturate_signed(exact, 32);
    cpu.saturated |= doubled | saturated;
    cpu.set(o.d, value as u32);
    cpu.next(rest)
}

/// SSAT: to x bits, n shifted by `immediate`, arithmetically right where m is not 0.
pub(in crate::cpu) fn ssat<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    let shifted = shifted(cpu, o);
    let (value, saturated) = saturate_signed(shifted, u32::from(o.x.clamp(1, 32)));
    cpu.saturated |= saturated;
    cpu.set(o.d, value as u32);
    cpu.next(rest)
}

/// USAT, like SSAT.
pub(in crate::cpu) fn usat<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    let shifted = shifted(cpu, o);
    let (value, saturated) = saturate_unsigned(shifted, u32::from(o.x.min(31)));
    cpu.saturated |= saturated;
    cpu.set(o.d, value);
    cpu.next(rest)
}

fn shifted<B: Bus>(cpu: &Cpu<B>, o: Operands) -> i64 {
    let kind = if o.m != 0 { ARITHMETIC } else { LEFT };
    let (value, _) = shift(kind, cpu.get(o.n), o.immediate, false);
    i64::from(value as i32)
}

/// SSAT16; USAT16 with m not 0. To x bits each.
pub(in crate::cpu) fn saturate_halves<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    let n = cpu.get(o.n);
    let mut result = 0;
    for (at, half) in [(0, n as i16), (16, (n >> 16) as i16)] {
        let (value, saturated) = match o.m {
            0 => {
                let (value, saturated) = saturate_signed(i64::from(half), u32::from(o.x.clamp(1, 16)));
                (value as u32, saturated)
            }
            _ => saturate_unsigned(i64::from(half), u32::from(o.x.min(15))),
        };
        cpu.saturated |= saturated;
        result |= (value & 0xffff) << at;
    }
    cpu.set(o.d, result);
    cpu.next(rest)
}
