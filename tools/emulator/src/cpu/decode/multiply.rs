//! Multiplications and divisions (A5.3.16, A5.3.17).

use super::{Decoded, Refused, bad, bits, unless};
use crate::bus::Bus;
use crate::cpu::execute::multiply::{
    mla, mls, sdiv, smla_halves, smlad, smlal, smlal_halves, smlald, smlaw, smlsd, smlsld, smmla, smmls, smull, udiv,
    umaal, umlal, umull, usada8,
};
use crate::cpu::operation::{Action, Execute, Operation};
use crate::cpu::timing::DIVISION;

/// Results of 32 bits.
pub(super) fn word<B: Bus>(first: u32, second: u32) -> Decoded<B> {
    let (d, n, m, a) = (bits(second, 11, 8), bits(first, 3, 0), bits(second, 3, 0), bits(second, 15, 12));
    let variant = bits(second, 5, 4);
    let (execute, action): (Execute<B>, _) = match (bits(first, 6, 4), variant) {
        _ if bits(second, 7, 6) != 0 => return Err(Refused::Unknown),
        (0, 0) => (mla, Action::Multiply),
        (0, 1) => (mls, Action::MultiplySubtract),
        (1, _) => (smla_halves, Action::Other),
        (2, 0 | 1) => (smlad, Action::Other),
        (3, 0 | 1) => (smlaw, Action::Other),
        (4, 0 | 1) => (smlsd, Action::Other),
        (5, 0 | 1) => (smmla, Action::MultiplyHigh),
        (6, 0 | 1) => (smmls, Action::Other),
        (7, 0) => (usada8, Action::Other),
        _ => return Err(Refused::Unknown),
    };
    // Two of them have no form without addend.
    let needs_addend = matches!((bits(first, 6, 4), variant), (0, 1) | (6, _));
    let open = bad(d) || bad(n) || bad(m) || a == 13 || needs_addend && a == 15;
    unless(open, Operation::new(execute).does(action).d(d).n(n).m(m).x(a).immediate(variant))
}

/// Results of 64 bits, and divisions.
pub(super) fn long<B: Bus>(first: u32, second: u32) -> Decoded<B> {
    let (high, n, m, low) = (bits(second, 11, 8), bits(first, 3, 0), bits(second, 3, 0), bits(second, 15, 12));
    let open = bad(low) || bad(high) || bad(n) || bad(m) || low == high;
    let variant = bits(second, 5, 4);
    let (execute, action): (Execute<B>, _) = match (bits(first, 6, 4), bits(second, 7, 4)) {
        (0, 0) => (smull, Action::MultiplyLong { signed: true, accumulates: false }),
        (2, 0) => (umull, Action::MultiplyLong { signed: false, accumulates: false }),
        (4, 0) => (smlal, Action::MultiplyLong { signed: true, accumulates: true }),
        (4, 8..=11) => (smlal_halves, Action::Other),
        (4, 12 | 13) => (smlald, Action::Other),
        (5, 12 | 13) => (smlsld, Action::Other),
        (6, 0) => (umlal, Action::MultiplyLong { signed: false, accumulates: true }),
        (6, 6) => (umaal, Action::Other),
        (1 | 3, 15) => {
            let signed = bits(first, 6, 4) == 1;
            let execute = if signed { sdiv } else { udiv };
            let open = bad(high) || bad(n) || bad(m) || low != 15;
            return unless(
                open,
                Operation::new(execute).does(Action::Divide { signed }).d(high).n(n).m(m).cycles(DIVISION),
            );
        }
        _ => return Err(Refused::Unknown),
    };
    unless(open, Operation::new(execute).does(action).d(low).x(high).n(n).m(m).immediate(variant))
}
