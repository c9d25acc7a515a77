//! 16-bit encodings (A5.2).

use super::{Decoded, Refused, bits, unless};
use crate::bus::Bus;
use crate::cpu::arithmetic::{ARITHMETIC, LEFT, RIGHT, ROTATE, immediate_shift, sign_extend};
use crate::cpu::execute::data_processing::{
    ADC, ADD, AND, BIC, CONSTANT, EOR, MOV, MUL, MVN, NEVER, ORR, OUTSIDE_IT, REGISTER, RSB, SBC, SUB, TEST,
    add_immediate, constant, data_of, extend, reverse, shift_immediate_of, shift_register_of,
};
use crate::cpu::execute::load_store::{
    ABSOLUTE, BELOW, CHANGES, INDEXED, LDR, LDRB, LDRH, OFFSET, STR, STRB, STRH, access_of, access_part, load_several,
    loads, store_several,
};
use crate::cpu::execute::{branch, system};
use crate::cpu::operation::{Action, Execute, Flow, Operation, Part};
use crate::cpu::timing::several;

/// Arithmetic and logic.
fn data<B: Bus>(operation: u8, second: u8, flags: u8) -> Operation<B> {
    Operation::new(data_of(operation, second, flags)).does(Action::Data { operation, second, flags })
}

/// A load or a store of one register.
fn access<B: Bus>(what: u8, address: u8) -> Operation<B> {
    Operation::new(access_of(what, address)).does(Action::Access { what, address })
}

pub(super) fn decode<B: Bus>(address: u32, word: u32) -> Decoded<B> {
    let (low, middle, high) = (bits(word, 2, 0), bits(word, 5, 3), bits(word, 8, 6));
    let (byte, of_byte) = (word & 0xff, bits(word, 10, 8));
    let op = Operation::<B>::new;
    // The program counter reads as this.
    let pc = address.wrapping_add(4);
    match bits(word, 15, 11) {
        kind @ 0..=2 => {
            let (kind, amount) = immediate_shift(kind, bits(word, 10, 6));
            Ok(op(shift_immediate_of(kind, OUTSIDE_IT))
                .d(low)
                .m(middle)
                .immediate(amount)
                .does(Action::Shift { kind, flags: OUTSIDE_IT }))
        }
        3 => {
            let operation = if bits(word, 9, 9) == 0 { ADD } else { SUB };
            let second = if bits(word, 10, 10) == 0 { REGISTER } else { CONSTANT };
            Ok(data(operation, second, OUTSIDE_IT).d(low).n(middle).m(high).immediate(high))
        }
        4 => Ok(data(MOV, CONSTANT, OUTSIDE_IT).d(of_byte).immediate(byte).part(Part::NarrowConstant)),
        5 => Ok(data(SUB, CONSTANT, TEST).n(of_byte).immediate(byte).part(Part::CompareConstant)),
        6 => Ok(data(ADD, CONSTANT, OUTSIDE_IT).d(of_byte).n(of_byte).immediate(byte)),
        7 => {
            let decoded = data(SUB, CONSTANT, OUTSIDE_IT).d(of_byte).n(of_byte).immediate(byte);
            Ok(decoded.part(Part::SubtractConstant))
        }
        8 if bits(word, 10, 10) == 0 => Ok(data_register(word)),
        8 => high_registers(word, pc),
        9 => Ok(access(LDR, ABSOLUTE).d(of_byte).immediate((pc & !3).wrapping_add(4 * byte)).single(true)),
        10 | 11 => {
            let what = bits(word, 11, 9) as u8;
            Ok(access(what, INDEXED).d(low).n(middle).m(high).single(loads(what)))
        }
        kind @ 12..=17 => {
            let (what, scale) = [(STR, 4), (LDR, 4), (STRB, 1), (LDRB, 1), (STRH, 2), (LDRH, 2)][kind as usize - 12];
            let offset = scale * bits(word, 10, 6);
            let decoded = access(what, OFFSET).d(low).n(middle).immediate(offset).single(loads(what));
            Ok(decoded.part(access_part(what, OFFSET)))
        }
        kind @ 18..=19 => {
            let what = if kind == 18 { STR } else { LDR };
            let decoded = access(what, OFFSET).d(of_byte).n(13).immediate(4 * byte).single(loads(what));
            Ok(decoded.part(access_part(what, OFFSET)))
        }
        20 => Ok(op(constant).does(Action::Constant).d(of_byte).immediate((pc & !3).wrapping_add(4 * byte))),
        21 => Ok(op(add_immediate).does(Action::Add).d(of_byte).n(13).immediate(4 * byte).part(Part::AddConstant)),
        22 | 23 => miscellaneous(word, pc),
        kind @ 24..=25 => {
            let (load, in_list) = (kind == 25, byte >> of_byte & 1 != 0);
            // A store of the base as anything but the first register stores what is left open.
            let open = byte == 0 || !load && in_list && byte & ((1 << of_byte) - 1) != 0;
            let change = if load && in_list { 0 } else { CHANGES };
            let execute = if load { load_several } else { store_several };
            let cycles = several(byte.count_ones());
            unless(open, op(execute).does(Action::Several { load }).n(of_byte).immediate(byte).x(change).cycles(cycles))
        }
        26 | 27 => match bits(word, 11, 8) {
            14 => Ok(op(system::undefined)),
            15 => Ok(op(system::supervisor_call).immediate(byte)),
            condition => {
                let target = pc.wrapping_add(sign_extend(byte << 1, 9));
                Ok(op(branch::branch_if_of(condition))
                    .does(Action::BranchIf)
                    .x(condition)
                    .immediate(target)
                    .flow(Flow::Perhaps)
                    .part(Part::Branch))
            }
        },
        28 => Ok(op(branch::branch)
            .does(Action::Branch)
            .immediate(pc.wrapping_add(sign_extend(bits(word, 10, 0) << 1, 12)))),
        _ => Err(Refused::Unknown),
    }
}

/// A5.2.2.
fn data_register<B: Bus>(word: u32) -> Operation<B> {
    let (d, m) = (bits(word, 2, 0), bits(word, 5, 3));
    let two = |operation: u8, flags: u8| data(operation, REGISTER, flags).d(d).n(d).m(m);
    let shift = |kind: u8| {
        Operation::new(shift_register_of(kind, OUTSIDE_IT))
            .d(d)
            .n(d)
            .m(m)
            .does(Action::ShiftByRegister { kind, flags: OUTSIDE_IT })
    };
    match bits(word, 9, 6) {
        0 => two(AND, OUTSIDE_IT),
        1 => two(EOR, OUTSIDE_IT),
        2 => shift(LEFT),
        3 => shift(RIGHT),
        4 => shift(ARITHMETIC),
        5 => two(ADC, OUTSIDE_IT),
        6 => two(SBC, OUTSIDE_IT),
        7 => shift(ROTATE),
        8 => two(AND, TEST),
        9 => data(RSB, CONSTANT, OUTSIDE_IT).d(d).n(m),
        10 => two(SUB, TEST).part(Part::CompareRegister),
        11 => two(ADD, TEST),
        12 => two(ORR, OUTSIDE_IT),
        13 => two(MUL, OUTSIDE_IT),
        14 => two(BIC, OUTSIDE_IT),
        _ => two(MVN, OUTSIDE_IT),
    }
}

/// A5.2.3: instructions that reach all registers.
fn high_registers<B: Bus>(word: u32, pc: u32) -> Decoded<B> {
    let (d, m) = (bits(word, 7, 7) << 3 | bits(word, 2, 0), bits(word, 6, 3));
    let op = Operation::<B>::new;
    match bits(word, 9, 8) {
        0 if d == 15 => unless(m == 15, op(branch::add_to_pc).m(m).immediate(pc).flow(Flow::Elsewhere)),
        // The program counter as an operand is a constant.
        0 if m == 15 => Ok(op(add_immediate).does(Action::Add).d(d).n(d).immediate(pc)),
        0 => Ok(data(ADD, REGISTER, NEVER).d(d).n(d).m(m)),
        1 => unless(
            d < 8 && m < 8 || d == 15 || m == 15,
            data(SUB, REGISTER, TEST).n(d).m(m).part(Part::CompareRegister),
        ),
        2 if d == 15 => unless(m == 15, op(branch::move_to_pc).m(m).flow(Flow::Elsewhere)),
        2 if m == 15 => Ok(op(constant).does(Action::Constant).d(d).immediate(pc)),
        2 => Ok(data(MOV, REGISTER, NEVER).d(d).m(m).part(Part::Register)),
        _ if bits(word, 2, 0) != 0 || m == 15 => Err(Refused::Unpredictable),
        _ if bits(word, 7, 7) != 0 => {
            Ok(op(branch::call_register).does(Action::BranchToRegister { link: true }).m(m).flow(Flow::Elsewhere))
        }
        _ => Ok(op(branch::branch_register).does(Action::BranchToRegister { link: false }).m(m).flow(Flow::Elsewhere)),
    }
}

/// A5.2.5.
fn miscellaneous<B: Bus>(word: u32, pc: u32) -> Decoded<B> {
    let op = Operation::<B>::new;
    let (low, middle) = (bits(word, 2, 0), bits(word, 5, 3));
    match bits(word, 11, 8) {
        0 if word & 0x80 == 0 => Ok(op(add_immediate).does(Action::Add).d(13).n(13).immediate(4 * (word & 0x7f))),
        0 => Ok(op(add_immediate).does(Action::Add).d(13).n(13).immediate((4 * (word & 0x7f)).wrapping_neg())),
        1 | 3 | 9 | 11 => {
            let target = pc.wrapping_add(bits(word, 9, 9) << 6 | bits(word, 7, 3) << 1);
            let decoded =
                op(branch::branch_if_zero).does(Action::BranchIfZero).n(low).x(bits(word, 11, 11)).immediate(target);
            Ok(decoded.flow(Flow::Perhaps).part(Part::BranchIfZero))
        }
        // sxth, sxtb, uxth, uxtb: the wide ones without rotation and addition.
        2 => {
            let (execute, kind): (Execute<B>, _) = match bits(word, 7, 6) {
                0 => (extend::<B, 0>, 0),
                1 => (extend::<B, 4>, 4),
                2 => (extend::<B, 1>, 1),
                _ => (extend::<B, 5>, 5),
            };
            Ok(op(execute).does(Action::Extend { kind }).d(low).n(15).m(middle))
        }
        4 | 5 => {
            let list = word & 0xff | bits(word, 8, 8) << 14;
            let cycles = several(list.count_ones());
            let decoded = op(store_several)
                .does(Action::Several { load: false })
                .n(13)
                .immediate(list)
                .x(CHANGES | BELOW)
                .cycles(cycles);
            unless(list == 0, decoded.part(Part::Push))
        }
        6 if word & 0xffec == 0xb660 => unless(word & 3 == 0, op(system::change_state).x(word & 0x13)),
        10 => {
            let execute = match bits(word, 7, 6) {
                0 => reverse::<B, 0>,
                1 => reverse::<B, 1>,
                3 => reverse::<B, 3>,
                _ => return Err(Refused::Unknown),
            };
            Ok(op(execute).d(low).m(middle))
        }
        12 | 13 => {
            let list = word & 0xff | bits(word, 8, 8) << 15;
            let cycles = several(list.count_ones());
            unless(
                list == 0,
                op(load_several)
                    .does(Action::Several { load: true })
                    .n(13)
                    .immediate(list)
                    .x(CHANGES)
                    .cycles(cycles)
                    .flow_by(list),
            )
        }
        14 => Ok(op(system::breakpoint).x(word & 0xff)),
        15 if word & 0xf != 0 => {
            let condition = bits(word, 7, 4);
            // "Always" has no opposite.
            let open = condition == 15 || condition == 14 && (word & 0xf).count_ones() != 1;
            unless(open, op(branch::it).does(Action::Nothing).x(word & 0xff).flow(Flow::Block))
        }
        15 => hint(bits(word, 7, 4)),
        _ => Err(Refused::Unknown),
    }
}

/// NOP and its like; what has no number yet does nothing.
pub(super) fn hint<B: Bus>(number: u32) -> Decoded<B> {
    Ok(match number {
        2 => Operation::new(system::wait_for_event),
        3 => Operation::new(system::wait_for_interrupt),
        4 => Operation::new(system::send_event),
        _ => Operation::new(system::nothing).does(Action::Nothing),
    })
}
