//! Wide data processing: constants, shifted registers, registers (A5.3.1, A5.3.3, A5.3.11, A5.3.12).

use super::{Decoded, Refused, bad, bits, simd, unless};
use crate::bus::Bus;
use crate::cpu::arithmetic::{LEFT, expanded, immediate_shift};
use crate::cpu::execute::data_processing::{
    ADC, ADD, ALWAYS, AND, BIC, CONSTANT, EOR, MOV, MVN, NEVER, ORN, ORR, REGISTER, RSB, SBC, SHIFTED, SUB, TEST,
    add_immediate, bfi, constant, data_of, extend, movt, pkh, sbfx, shift_register_of, ubfx,
};
use crate::cpu::execute::simd::{saturate_halves, ssat, usat};
use crate::cpu::operation::{Action, Operation, Part};

/// Meaning of an operation of the table A5-10 or A5-22, with registers that mean something else: operation, flags,
/// whether its outcome is open. `second` is the second operand's register, None for a constant; `plain` says that it is
/// not shifted, or by at most 3 to the left.
fn choose(first: u32, d: u32, second: Option<u32>, plain: bool, unshifted: bool) -> Result<(u8, u8, bool), Refused> {
    let n = bits(first, 3, 0);
    let sets = bits(first, 4, 4) == 1;
    let flags = if sets { ALWAYS } else { NEVER };
    let test = sets && d == 15;
    let m_bad = second.is_some_and(bad);
    let strict = bad(d) || bad(n) || m_bad;
    // Additions may have the stack pointer as base, and then as destination.
    let stack = if n == 13 { d == 15 || d == 13 && !plain } else { bad(d) };
    let sum = stack || n == 15 || m_bad;
    Ok(match bits(first, 8, 5) {
        0 if test => (AND, TEST, bad(n) || m_bad),
        0 => (AND, flags, strict),
        1 => (BIC, flags, strict),
        2 if n == 15 && second.is_some() && unshifted => {
            let m = second.unwrap_or(0);
            let open = if sets { bad(d) || bad(m) } else { d == 15 || m == 15 || d == 13 && m == 13 };
            (MOV, flags, open)
        }
        2 if n == 15 => (MOV, flags, bad(d) || m_bad),
        2 => (ORR, flags, strict),
        3 if n == 15 => (MVN, flags, bad(d) || m_bad),
        3 => (ORN, flags, strict),
        4 if test => (EOR, TEST, bad(n) || m_bad),
        4 => (EOR, flags, strict),
        8 if test => (ADD, TEST, n == 15 || m_bad),
        8 => (ADD, flags, sum),
        10 => (ADC, flags, strict),
        11 => (SBC, flags, strict),
        13 if test => (SUB, TEST, n == 15 || m_bad),
        13 => (SUB, flags, sum),
        14 => (RSB, flags, strict),
        _ => return Err(Refused::Unknown),
    })
}

/// A5.3.1.
pub(super) fn modified_immediate<B: Bus>(first: u32, second: u32) -> Decoded<B> {
    let d = bits(second, 11, 8);
    let (operation, flags, open) = choose(first, d, None, true, true)?;
    let field = bits(first, 10, 10) << 11 | bits(second, 14, 12) << 8 | second & 0xff;
    let (value, carry) = expanded(field).ok_or(Refused::Unpredictable)?;
    let part = match (operation, flags) {
        (SUB, TEST) => Part::CompareConstant,
        (MOV, NEVER) => Part::Constant,
        (ADD, NEVER) => Part::AddConstant,
        _ => Part::None,
    };
    let decoded = Operation::new(data_of(operation, CONSTANT, flags)).part(part).does(Action::Data {
        operation,
        second: CONSTANT,
        flags,
    });
    unless(open, decoded.d(d).n(bits(first, 3, 0)).immediate(value).x(carry))
}

/// A5.3.11.
pub(super) fn shifted_register<B: Bus>(first: u32, second: u32) -> Decoded<B> {
    let (d, n, m) = (bits(second, 11, 8), bits(first, 3, 0), bits(second, 3, 0));
    let field = bits(second, 14, 12) << 2 | bits(second, 7, 6);
    let (kind, amount) = immediate_shift(bits(second, 5, 4), field);
    if second & 0x8000 != 0 {
        return Err(Refused::Unpredictable);
    }
    if bits(first, 8, 5) == 6 {
        let top = bits(second, 5, 5);
        let open = bits(first, 4, 4) != 0 || bits(second, 4, 4) != 0;
        if open {
            return Err(Refused::Unknown);
        }
        let decoded = Operation::new(pkh).d(d).n(n).m(m).immediate(amount).x(top);
        return unless(bad(d) || bad(n) || bad(m), decoded);
    }
    let unshifted = kind == LEFT && amount == 0;
    let (operation, flags, open) = choose(first, d, Some(m), kind == LEFT && amount <= 3, unshifted)?;
    let source = if unshifted { REGISTER } else { SHIFTED };
    let decoded =
        Operation::new(data_of(operation, source, flags)).does(Action::Data { operation, second: source, flags });
    unless(open, decoded.d(d).n(n).m(m).immediate(amount).x(u32::from(kind)))
}

/// A5.3.3.
pub(super) fn plain_immediate<B: Bus>(address: u32, first: u32, second: u32) -> Decoded<B> {
    let (d, n) = (bits(second, 11, 8), bits(first, 3, 0));
    let value = bits(first, 10, 10) << 11 | bits(second, 14, 12) << 8 | second & 0xff;
    let position = bits(second, 14, 12) << 2 | bits(second, 7, 6);
    let width = bits(second, 4, 0);
    let pc = address.wrapping_add(4) & !3;
    let op = Operation::<B>::new;
    let stack = if n == 13 { d == 15 } else { bad(d) };
    // Bits that bit-field and saturating instructions have as zeros.
    let stray = bits(first, 10, 10) != 0 || bits(second, 5, 5) != 0;
    match bits(first, 8, 4) {
        0x00 if n == 15 => unless(bad(d), op(constant).d(d).immediate(pc.wrapping_add(value)).does(Action::Constant)),
        0x0a if n == 15 => unless(bad(d), op(constant).d(d).immediate(pc.wrapping_sub(value)).does(Action::Constant)),
        0x00 => unless(stack, op(add_immediate).d(d).n(n).immediate(value).part(Part::AddConstant).does(Action::Add)),
        0x0a => unless(
            stack,
            op(add_immediate).d(d).n(n).immediate(value.wrapping_neg()).part(Part::AddConstant).does(Action::Add),
        ),
        0x04 => {
            unless(bad(d), op(constant).d(d).immediate(n << 12 | value).part(Part::Constant).does(Action::Constant))
        }
        0x0c => unless(bad(d), op(movt).d(d).immediate(n << 12 | value).part(Part::UpperHalf).does(Action::UpperHalf)),
        kind @ (0x10 | 0x12 | 0x18 | 0x1a) => {
            let (unsigned, shifts_right) = (kind & 8 != 0, kind & 2 != 0);
            let open = bad(d) || bad(n) || stray;
            let to = if unsigned { width } else { width + 1 };
            if shifts_right && position == 0 {
                let to = if unsigned { width & 0xf } else { (width & 0xf) + 1 };
                let halves = op(saturate_halves).d(d).n(n).x(to).m(u32::from(unsigned));
                return unless(open || width > 15, halves);
            }
            let execute = if unsigned { usat } else { ssat };
            unless(open, op(execute).d(d).n(n).x(to).m(u32::from(shifts_right)).immediate(position))
        }
        0x14 => unless(
            bad(d) || bad(n) || stray || position + width > 31,
            field(sbfx, d, n, position, width + 1).does(Action::Extract { signed: true }),
        ),
        0x1c => unless(
            bad(d) || bad(n) || stray || position + width > 31,
            field(ubfx, d, n, position, width + 1).does(Action::Extract { signed: false }),
        ),
        0x16 => {
            let open = bad(d) || n == 13 || stray || width < position;
            unless(open, field(bfi, d, n, position, (width + 1).saturating_sub(position)).does(Action::Insert))
        }
        _ => Err(Refused::Unknown),
    }
}

fn field<B: Bus>(execute: crate::cpu::operation::Execute<B>, d: u32, n: u32, lowest: u32, width: u32) -> Operation<B> {
    Operation::new(execute).d(d).n(n).m(lowest).x(width)
}

/// A5.3.12.
pub(super) fn register<B: Bus>(first: u32, second: u32) -> Decoded<B> {
    let (d, n, m) = (bits(second, 11, 8), bits(first, 3, 0), bits(second, 3, 0));
    if bits(second, 15, 12) != 15 {
        return Err(Refused::Unknown);
    }
    let kind = bits(first, 7, 4);
    match bits(second, 7, 4) {
        0 if kind < 8 => {
            let flags = if kind & 1 == 1 { ALWAYS } else { NEVER };
            let decoded = Operation::new(shift_register_of((kind >> 1) as u8, flags))
                .does(Action::ShiftByRegister { kind: (kind >> 1) as u8, flags });
            unless(bad(d) || bad(n) || bad(m), decoded.d(d).n(n).m(m))
        }
        rotation @ 8..=15 if kind < 6 => {
            let execute = match kind {
                0 => extend::<B, 0>,
                1 => extend::<B, 1>,
                2 => extend::<B, 2>,
                3 => extend::<B, 3>,
                4 => extend::<B, 4>,
                _ => extend::<B, 5>,
            };
            let decoded = Operation::new(execute)
                .d(d)
                .n(n)
                .m(m)
                .immediate(8 * (rotation & 3))
                .does(Action::Extend { kind: kind.min(5) as u8 });
            unless(bad(d) || n == 13 || bad(m) || rotation & 4 != 0, decoded)
        }
        0..=7 if kind >= 8 => simd::parallel(first, second),
        8..=11 if (8..12).contains(&kind) => simd::miscellaneous(first, second),
        _ => Err(Refused::Unknown),
    }
}
