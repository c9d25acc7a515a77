//! Wide loads and stores (A5.3.5, A5.3.6, A5.3.7 to A5.3.10).

use super::{Decoded, Refused, bad, bits, unless};
use crate::bus::Bus;
use crate::cpu::execute::load_store::{
    ABSOLUTE, AFTER, BEFORE, BELOW, CHANGES, INDEXED, LDR, LDRB, LDRH, LDRSB, LDRSH, OFFSET, PRE, STR, STRB, STRH,
    access_of, access_part, ldrd, ldrd_absolute, load_branch_of, load_exclusive, load_several, loads, store_exclusive,
    store_several, strd,
};
use crate::cpu::execute::{branch, system};
use crate::cpu::operation::{Action, Execute, Flow, Operation};
use crate::cpu::timing;

/// LDM, STM.
pub(super) fn several_registers<B: Bus>(first: u32, list: u32, below: bool) -> Decoded<B> {
    let (n, load, change) = (bits(first, 3, 0), bits(first, 4, 4) == 1, bits(first, 5, 5) == 1);
    let forbidden = if load { 0x2000 } else { 0xa000 };
    let open = n == 15
        || list.count_ones() < 2
        || list & forbidden != 0
        || load && list & 0xc000 == 0xc000
        || change && list >> n & 1 != 0;
    let x = if change { CHANGES } else { 0 } | if below { BELOW } else { 0 };
    let execute = if load { load_several } else { store_several };
    let operation = Operation::new(execute)
        .does(Action::Several { load })
        .n(n)
        .immediate(list)
        .x(x)
        .cycles(timing::several(list.count_ones()));
    unless(open, operation.flow_by(list))
}

pub(super) fn several<B: Bus>(first: u32, second: u32) -> Decoded<B> {
    match bits(first, 8, 7) {
        1 => several_registers(first, second, false),
        2 => several_registers(first, second, true),
        _ => Err(Refused::Unknown),
    }
}

/// Two registers, exclusive accesses, table branches.
pub(super) fn pair<B: Bus>(address: u32, first: u32, second: u32) -> Decoded<B> {
    let (n, t, t2, low) = (bits(first, 3, 0), bits(second, 15, 12), bits(second, 11, 8), bits(second, 3, 0));
    let (before, up, change) = (bits(first, 8, 8) == 1, bits(first, 7, 7) == 1, bits(first, 5, 5) == 1);
    let load = bits(first, 4, 4) == 1;
    let pc = address.wrapping_add(4);
    let offset = 4 * (second & 0xff);
    let op = Operation::<B>::new;
    if before || change {
        let signed = if up { offset } else { offset.wrapping_neg() };
        let x = if change { CHANGES } else { 0 } | if before { PRE } else { 0 };
        let open = bad(t) || bad(t2) || change && (n == t || n == t2);
        if load && n == 15 {
            let at = (pc & !3).wrapping_add(signed);
            return unless(
                open || change || t == t2,
                op(ldrd_absolute).does(Action::PairAt).d(t).m(t2).immediate(at).cycles(timing::several(2)),
            );
        }
        let open = open || n == 15 || load && t == t2;
        let execute = if load { ldrd } else { strd };
        return unless(
            open,
            op(execute).does(Action::Pair { load }).d(t).m(t2).n(n).immediate(signed).x(x).cycles(timing::several(2)),
        );
    }
    // Exclusive accesses take the two cycles of a load with a base address.
    let kind = bits(second, 7, 4);
    match (up, load) {
        (false, false) => {
            let open = bad(t) || bad(t2) || n == 15 || t2 == n || t2 == t;
            unless(
                open,
                op(store_exclusive::<B, 4>)
                    .does(Action::StoreExclusive { bytes: 4 })
                    .d(t2)
                    .m(t)
                    .n(n)
                    .immediate(offset)
                    .cycles(2),
            )
        }
        (false, true) => unless(
            bad(t) || n == 15 || t2 != 15,
            op(load_exclusive::<B, 4>).does(Action::LoadExclusive { bytes: 4 }).d(t).n(n).immediate(offset).cycles(2),
        ),
        (true, false) => {
            let open = bad(low) || bad(t) || n == 15 || low == n || low == t || t2 != 15;
            let (execute, bytes): (Execute<B>, _) = match kind {
                4 => (store_exclusive::<B, 1>, 1),
                5 => (store_exclusive::<B, 2>, 2),
                _ => return Err(Refused::Unknown),
            };
            unless(open, op(execute).does(Action::StoreExclusive { bytes }).d(low).m(t).n(n).cycles(2))
        }
        (true, true) => {
            let open = bad(t) || n == 15 || t2 != 15 || low != 15;
            match kind {
                0 | 1 => {
                    let open = n == 13 || bad(low) || t != 15 || t2 != 0;
                    unless(open, op(branch::table).n(n).m(low).x(kind).immediate(pc).cycles(2).flow(Flow::Elsewhere))
                }
                4 => unless(
                    open,
                    op(load_exclusive::<B, 1>).does(Action::LoadExclusive { bytes: 1 }).d(t).n(n).cycles(2),
                ),
                5 => unless(
                    open,
                    op(load_exclusive::<B, 2>).does(Action::LoadExclusive { bytes: 2 }).d(t).n(n).cycles(2),
                ),
                _ => Err(Refused::Unknown),
            }
        }
    }
}

/// Size and sign of what a wide access moves, as encoded.
fn what(first: u32) -> Result<u8, Refused> {
    let (signed, size, load) = (bits(first, 8, 8), bits(first, 6, 5), bits(first, 4, 4));
    Ok(match (load, signed, size) {
        (0, 0, 0) => STRB,
        (0, 0, 1) => STRH,
        (0, 0, 2) => STR,
        (1, 0, 0) => LDRB,
        (1, 0, 1) => LDRH,
        (1, 0, 2) => LDR,
        (1, 1, 0) => LDRSB,
        (1, 1, 1) => LDRSH,
        _ => return Err(Refused::Unknown),
    })
}

/// One register.
pub(super) fn single<B: Bus>(address: u32, first: u32, second: u32) -> Decoded<B> {
    let what = what(first)?;
    let load = loads(what);
    let (n, t, m) = (bits(first, 3, 0), bits(second, 15, 12), bits(second, 3, 0));
    let (far, near) = (second & 0xfff, second & 0xff);
    let up = bits(first, 7, 7) == 1;
    let signed = |up: bool, offset: u32| if up { offset } else { offset.wrapping_neg() };
    let (mode, offset, open) = if n == 15 {
        if !load {
            return Err(Refused::Unknown);
        }
        let pc = address.wrapping_add(4) & !3;
        (ABSOLUTE, pc.wrapping_add(signed(up, far)), false)
    } else if up {
        (OFFSET, far, false)
    } else if bits(second, 11, 11) == 1 {
        let (before, up, change) = (bits(second, 10, 10), bits(second, 9, 9) == 1, bits(second, 8, 8));
        match (before, change) {
            (0, 0) => return Err(Refused::Unknown),
            // Also what loads and stores without privilege: the same without a memory protection unit, but for the
            // core's own registers.
            (1, 0) => (OFFSET, signed(up, near), up && t == 15),
            (1, _) => (BEFORE, signed(up, near), n == t),
            _ => (AFTER, signed(up, near), n == t),
        }
    } else if bits(second, 11, 6) == 0 {
        (INDEXED, bits(second, 5, 4), bad(m))
    } else {
        return Err(Refused::Unknown);
    };
    let changes = mode == BEFORE || mode == AFTER;
    if t == 15 && load && what != LDR {
        // Preloads; a change of the base makes it something that there is not.
        let open = open || changes || what == LDRSH;
        return unless(open, Operation::new(system::nothing).does(Action::Nothing));
    }
    if t == 15 && load {
        let decoded = Operation::new(load_branch_of(mode)).n(n).m(m).immediate(offset).cycles(2).flow(Flow::Elsewhere);
        return unless(open, decoded);
    }
    let word = what == LDR || what == STR;
    let open = open || t == 15 || t == 13 && !word;
    let decoded = Operation::new(access_of(what, mode))
        .does(Action::Access { what, address: mode })
        .d(t)
        .n(n)
        .m(m)
        .immediate(offset)
        .single(load);
    unless(open, decoded.part(access_part(what, mode)))
}
