//! Parallel additions and subtractions, and what is listed beside them (A5.3.13 to A5.3.15).

use super::{Decoded, Refused, bad, bits, unless};
use crate::bus::Bus;
use crate::cpu::execute::data_processing::{clz, reverse};
use crate::cpu::execute::simd::{parallel_of, saturating, sel};
use crate::cpu::operation::{Action, Operation};

pub(super) fn parallel<B: Bus>(first: u32, second: u32) -> Decoded<B> {
    let (d, n, m) = (bits(second, 11, 8), bits(first, 3, 0), bits(second, 3, 0));
    let execute = parallel_of(bits(first, 6, 4) as u8, bits(second, 6, 4) as u8).ok_or(Refused::Unknown)?;
    unless(bad(d) || bad(n) || bad(m), Operation::new(execute).d(d).n(n).m(m))
}

pub(super) fn miscellaneous<B: Bus>(first: u32, second: u32) -> Decoded<B> {
    let (d, n, m) = (bits(second, 11, 8), bits(first, 3, 0), bits(second, 3, 0));
    let kind = bits(second, 5, 4);
    // A single operand is encoded twice.
    let one = bad(d) || bad(m) || n != m;
    let op = Operation::<B>::new;
    match (bits(first, 5, 4), kind) {
        (0, _) => unless(bad(d) || bad(n) || bad(m), op(saturating).d(d).n(n).m(m).x(kind)),
        (1, 0) => unless(one, op(reverse::<B, 0>).d(d).m(m)),
        (1, 1) => unless(one, op(reverse::<B, 1>).d(d).m(m)),
        (1, 2) => unless(one, op(reverse::<B, 2>).d(d).m(m)),
        (1, _) => unless(one, op(reverse::<B, 3>).d(d).m(m)),
        (2, 0) => unless(bad(d) || bad(n) || bad(m), op(sel).d(d).n(n).m(m)),
        (3, 0) => unless(one, op(clz).does(Action::CountZeros).d(d).m(m)),
        _ => Err(Refused::Unknown),
    }
}
