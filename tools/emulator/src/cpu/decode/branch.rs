//! Wide branches, special registers, barriers and hints (A5.3.4 to A5.3.6).

use super::{Decoded, Refused, bad, bits, narrow, unless};
use crate::bus::Bus;
use crate::cpu::arithmetic::sign_extend;
use crate::cpu::execute::load_store::clear_exclusive;
use crate::cpu::execute::{branch, system};
use crate::cpu::operation::{Action, Execute, Flow, Operation, Part};

pub(super) fn decode<B: Bus>(address: u32, first: u32, second: u32) -> Decoded<B> {
    let pc = address.wrapping_add(4);
    let sign = bits(first, 10, 10);
    let (j1, j2, low) = (bits(second, 13, 13), bits(second, 11, 11), bits(second, 10, 0));
    let op = Operation::<B>::new;
    match (bits(second, 14, 14), bits(second, 12, 12)) {
        (link, 1) => {
            let (i1, i2) = (1 ^ j1 ^ sign, 1 ^ j2 ^ sign);
            let offset = sign << 24 | i1 << 23 | i2 << 22 | bits(first, 9, 0) << 12 | low << 1;
            let target = pc.wrapping_add(sign_extend(offset, 25));
            let (execute, action): (Execute<B>, _) = match link {
                1 => (branch::call, Action::Call),
                _ => (branch::branch, Action::Branch),
            };
            Ok(op(execute).does(action).immediate(target).flow(Flow::Elsewhere))
        }
        (0, _) if bits(first, 9, 7) != 7 => {
            let offset = sign << 20 | j2 << 19 | j1 << 18 | bits(first, 5, 0) << 12 | low << 1;
            let target = pc.wrapping_add(sign_extend(offset, 21));
            let condition = bits(first, 9, 6);
            Ok(op(branch::branch_if_of(condition))
                .does(Action::BranchIf)
                .x(condition)
                .immediate(target)
                .flow(Flow::Perhaps)
                .part(Part::Branch))
        }
        (0, _) => special(first, second),
        // udf
        _ if bits(first, 10, 4) == 0x7f && bits(second, 15, 12) == 10 => Ok(op(system::undefined)),
        _ => Err(Refused::Unknown),
    }
}

fn special<B: Bus>(first: u32, second: u32) -> Decoded<B> {
    let op = Operation::<B>::new;
    match (first, second) {
        _ if first & 0xfff0 == 0xf380 && second & 0xf300 == 0x8000 => {
            let (n, number, fields) = (bits(first, 3, 0), second & 0xff, bits(second, 11, 10));
            // Fields are chosen for the flags alone; everything else has the one that means all.
            let open = bad(n) || fields == 0 || number > 3 && fields != 2;
            unless(open, op(system::msr).n(n).immediate(number).x(fields))
        }
        (0xf3ef, _) if second & 0xf000 == 0x8000 => {
            let d = bits(second, 11, 8);
            unless(bad(d), op(system::mrs).d(d).immediate(second & 0xff))
        }
        (0xf3af, 0x8000..=0x8004) => narrow::hint(second & 0xff),
        // Debug hints, and what has no number yet, do nothing.
        (0xf3af, 0x8005..=0x80ff) => Ok(op(system::nothing).does(Action::Nothing)),
        (0xf3bf, 0x8f2f) => Ok(op(clear_exclusive)),
        // dsb, dmb, isb
        (0xf3bf, _) if matches!(second & 0xfff0, 0x8f40 | 0x8f50 | 0x8f60) => {
            Ok(op(system::nothing).does(Action::Nothing).part(Part::Nothing))
        }
        _ => Err(Refused::Unknown),
    }
}
