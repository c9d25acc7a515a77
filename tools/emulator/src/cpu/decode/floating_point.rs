//! Floating point: what the coprocessors 10 and 11 are on this core (A6.4 to A6.7). Arithmetic in double precision is
//! undefined.

use super::{Decoded, Refused, bad, bits, unless};
use crate::bus::Bus;
use crate::cpu::execute::floating_point::{
    NARROW, TO_HALF, TOP, TOWARDS_ZERO, UNSIGNED, VADD, VDIV, VFMS, VFNMS, VMLA, VMUL, VNMLA, from_core, three_of,
    to_core, two_from_core, two_to_core, vcmp, vcvt_from_fixed, vcvt_half, vcvt_to_fixed, vldm, vldr, vmov,
    vmov_constant, vmrs, vmrs_flags, vmsr, vsqrt, vstm, vstr,
};
use crate::cpu::execute::load_store::{BELOW, CHANGES};
use crate::cpu::operation::{Action, Execute, Operation, Part};
use crate::cpu::timing::{FLOATING_POINT_DIVISION, FLOATING_POINT_MULTIPLY_ACCUMULATE, several};

/// Single-precision register: four bits and the lowest one.
fn single(high: u32, low: u32) -> u32 {
    high << 1 | low
}

pub(super) fn decode<B: Bus>(address: u32, first: u32, second: u32) -> Decoded<B> {
    if !matches!(bits(second, 11, 8), 10 | 11) || bits(first, 12, 12) == 1 {
        return Err(Refused::Unknown);
    }
    match (bits(first, 9, 8), bits(second, 4, 4)) {
        (2, 0) => data_processing(first, second),
        (2, _) => transfer(first, second),
        (0 | 1, _) if first & 0x1e0 == 0x40 => transfer_two(first, second),
        (0 | 1, _) => load_store(address, first, second),
        _ => Err(Refused::Unknown),
    }
}

/// A6.4.
fn data_processing<B: Bus>(first: u32, second: u32) -> Decoded<B> {
    if bits(second, 8, 8) == 1 && (bits(first, 7, 7), bits(first, 5, 4)) != (1, 3) {
        return Err(Refused::Unknown);
    }
    let d = single(bits(second, 15, 12), bits(first, 6, 6));
    let n = single(bits(first, 3, 0), bits(second, 7, 7));
    let m = single(bits(second, 3, 0), bits(second, 5, 5));
    let operation = (bits(first, 7, 7) << 3 | bits(first, 5, 4) << 1 | bits(second, 6, 6)) as u8;
    if operation >= 14 {
        return other(first, second, d, m);
    }
    let execute = three_of(operation).ok_or(Refused::Unknown)?;
    let cycles = match operation {
        VMLA..=VNMLA | VFNMS..=VFMS => FLOATING_POINT_MULTIPLY_ACCUMULATE,
        VDIV => FLOATING_POINT_DIVISION,
        _ => 1,
    };
    let part = match operation {
        VADD => Part::AddFloats,
        VMUL => Part::MultiplyFloats,
        _ => Part::None,
    };
    Ok(Operation::new(execute).does(Action::Floats { operation }).d(d).n(n).m(m).cycles(cycles).part(part))
}

/// Operations with one operand.
fn other<B: Bus>(first: u32, second: u32, d: u32, m: u32) -> Decoded<B> {
    let op = Operation::<B>::new;
    let (opcode, upper) = (bits(first, 3, 0), bits(second, 7, 7));
    let fixed = matches!(opcode, 10 | 11 | 14 | 15) && bits(second, 6, 6) == 1;
    if bits(second, 8, 8) == 1 {
        return Err(Refused::Unknown);
    }
    if bits(second, 6, 6) == 0 {
        let byte = bits(first, 3, 0) << 4 | bits(second, 3, 0);
        let exponent = if byte & 0x40 != 0 { 0x3e00_0000 } else { 0x4000_0000 };
        let value = (byte & 0x80) << 24 | exponent | (byte & 0x3f) << 19;
        return unless(second & 0xa0 != 0, op(vmov_constant).does(Action::FloatConstant).d(d).immediate(value));
    }
    if fixed {
        let narrow = upper == 0;
        let behind = bits(second, 3, 0) << 1 | bits(second, 5, 5);
        let width = if narrow { 16 } else { 32 };
        let x = if bits(first, 0, 0) == 1 { UNSIGNED } else { 0 } | if narrow { NARROW } else { 0 };
        let (execute, action): (Execute<B>, _) = match bits(first, 2, 2) {
            1 => (vcvt_to_fixed, Action::ToFixed),
            _ => (vcvt_from_fixed::<B, false>, Action::FromFixed),
        };
        let fraction = u32::saturating_sub(width, behind);
        return unless(behind > width, op(execute).does(action).d(d).m(d).x(x | TOWARDS_ZERO).immediate(fraction));
    }
    Ok(match (opcode, upper) {
        (0, 0) => op(vmov).does(Action::MoveFloat).d(d).m(m).part(Part::Float),
        (0, _) => op(vmov).does(Action::MoveFloat).d(d).m(m).immediate(1 << 31),
        (1, 0) => op(vmov).does(Action::MoveFloat).d(d).m(m).x(1),
        (1, _) => op(vsqrt).d(d).m(m).cycles(FLOATING_POINT_DIVISION),
        (2 | 3, _) => {
            op(vcvt_half).d(d).m(m).x(if upper == 1 { TOP } else { 0 } | if opcode == 3 { TO_HALF } else { 0 })
        }
        (4, _) => op(vcmp).does(Action::CompareFloats).d(d).m(m).x(upper).part(Part::CompareFloats),
        (5, _) if second & 0x2f != 0 => return Err(Refused::Unpredictable),
        (5, _) => op(vcmp).does(Action::CompareFloats).d(d).x(upper).immediate(1).part(Part::CompareFloats),
        (8, _) => {
            op(vcvt_from_fixed::<B, true>).does(Action::FromFixed).d(d).m(m).x(if upper == 0 { UNSIGNED } else { 0 })
        }
        (12 | 13, _) => {
            let x = if opcode == 12 { UNSIGNED } else { 0 } | if upper == 1 { TOWARDS_ZERO } else { 0 };
            op(vcvt_to_fixed).does(Action::ToFixed).d(d).m(m).x(x)
        }
        _ => return Err(Refused::Unknown),
    })
}

/// A6.6: one core register.
fn transfer<B: Bus>(first: u32, second: u32) -> Decoded<B> {
    let op = Operation::<B>::new;
    let (t, load) = (bits(second, 15, 12), bits(first, 4, 4) == 1);
    let stray = second & 0x6f != 0;
    match (bits(second, 8, 8), bits(first, 7, 5)) {
        (0, 0) => {
            let n = single(bits(first, 3, 0), bits(second, 7, 7));
            unless(
                bad(t) || stray,
                op(if load { to_core } else { from_core }).does(Action::MoveToOrFromFloat { load }).d(t).n(n),
            )
        }
        (0, 7) if bits(first, 3, 0) == 1 => {
            let open = stray || second & 0x80 != 0 || t == 13 || t == 15 && !load;
            match load && t == 15 {
                true => unless(open, op(vmrs_flags).does(Action::TakeFlags).part(Part::TakeFlags)),
                false => unless(open, op(if load { vmrs } else { vmsr }).d(t)),
            }
        }
        // Half of a double-precision register.
        (1, half @ (0 | 1)) if second & 0x60 == 0 => {
            let register = bits(second, 7, 7) << 4 | bits(first, 3, 0);
            let open = bad(t) || second & 0xf != 0 || register > 15;
            unless(
                open,
                op(if load { to_core } else { from_core })
                    .does(Action::MoveToOrFromFloat { load })
                    .d(t)
                    .n(register << 1 | half),
            )
        }
        _ => Err(Refused::Unknown),
    }
}

/// A6.7: two core registers.
fn transfer_two<B: Bus>(first: u32, second: u32) -> Decoded<B> {
    let (t, t2, load) = (bits(second, 15, 12), bits(first, 3, 0), bits(first, 4, 4) == 1);
    if second & 0xd0 != 0x10 {
        return Err(Refused::Unknown);
    }
    let double = bits(second, 8, 8) == 1;
    let m = match double {
        true => (bits(second, 5, 5) << 4 | bits(second, 3, 0)) << 1,
        false => single(bits(second, 3, 0), bits(second, 5, 5)),
    };
    let open = bad(t) || bad(t2) || m > 30 || load && t == t2;
    let execute = if load { two_to_core } else { two_from_core };
    unless(open, Operation::new(execute).d(t).x(t2).m(m).cycles(2))
}

/// A6.5.
fn load_store<B: Bus>(address: u32, first: u32, second: u32) -> Decoded<B> {
    let op = Operation::<B>::new;
    let n = bits(first, 3, 0);
    let (before, up) = (bits(first, 8, 8) == 1, bits(first, 7, 7) == 1);
    let (change, load) = (bits(first, 5, 5) == 1, bits(first, 4, 4) == 1);
    let double = bits(second, 8, 8) == 1;
    let words = second & 0xff;
    let d = match double {
        true => (bits(first, 6, 6) << 4 | bits(second, 15, 12)) << 1,
        false => single(bits(second, 15, 12), bits(first, 6, 6)),
    };
    if before && !change {
        let offset = if up { 4 * words } else { (4 * words).wrapping_neg() };
        let count = if double { 2 } else { 1 };
        let open = d + count > 32 || !load && n == 15;
        let pc = address.wrapping_add(4) & !3;
        let immediate = if n == 15 { pc.wrapping_add(offset) } else { offset };
        let decoded =
            op(if load { vldr } else { vstr }).does(Action::Float { load }).d(d).n(n).immediate(immediate).x(count);
        let decoded = decoded.part(if load { Part::LoadFloat } else { Part::StoreFloat });
        return unless(open, if double { decoded.cycles(several(2)) } else { decoded.single(load) });
    }
    let below = before && !up;
    if !(below && change || !before && up) {
        return Err(Refused::Unknown);
    }
    // An odd number of words of double registers is the form with padding that nobody should use.
    let open = words == 0 || words > 32 || d + words > 32 || double && words & 1 == 1 || n == 15;
    let x = if change { CHANGES } else { 0 } | if below { BELOW } else { 0 };
    let decoded = op(if load { vldm } else { vstm })
        .does(Action::SeveralFloats { load })
        .d(d)
        .n(n)
        .m(words)
        .immediate(4 * words)
        .x(x);
    unless(open, decoded.cycles(several(words)))
}
