//! Arithmetic, logic, shifts, bit fields, multiplications: as `execute` does them.

use super::emit::{Compared, Emitter};
use super::registers::{CARRY, OVERFLOW};
use super::{Action, Instruction};
use crate::cpu::arithmetic::{ARITHMETIC, CARRY_CLEARED, CARRY_KEPT, EXTEND, LEFT, RIGHT};
use crate::cpu::execute::data_processing::{
    ADC, ADD, AND, BIC, BYTE_SIGNED, BYTES_SIGNED, BYTES_UNSIGNED, CONSTANT, EOR, HALF_SIGNED, HALF_UNSIGNED, MOV, MUL,
    MVN, ORN, ORR, REGISTER, SBC, SUB, TEST,
};
use crate::cpu::operation::Operands;
use cranelift_codegen::ir::condcodes::IntCC;
use cranelift_codegen::ir::{InstBuilder, Value, types};

impl Emitter<'_, '_> {
    /// Translation of an instruction that goes on with the one behind it; none where it cannot be translated.
    pub fn plain(&mut self, instruction: Instruction) -> Option<()> {
        let o = instruction.operands;
        match instruction.action {
            Action::Nothing => {}
            Action::Data { operation, second, flags } => self.data_processing(o, operation, second, flags),
            Action::Shift { kind, flags } => {
                let (value, carry) = (self.get(o.m), self.get_flag(CARRY));
                let (result, carry) = self.shift(kind, value, o.immediate, carry);
                self.shifted(o.d, result, carry, flags);
            }
            Action::ShiftByRegister { kind, flags } => {
                let (result, carry) = self.shift_by_register(kind, o);
                self.shifted(o.d, result, carry, flags);
            }
            Action::Add => {
                let (n, more) = (self.get(o.n), self.constant(o.immediate));
                let sum = self.b.ins().iadd(n, more);
                self.set(o.d, sum);
            }
            Action::Constant => {
                let value = self.constant(o.immediate);
                self.set(o.d, value);
            }
            Action::UpperHalf => {
                let (d, kept, upper) = (self.get(o.d), self.constant(0xffff), self.constant(o.immediate << 16));
                let lower = self.b.ins().band(d, kept);
                let value = self.b.ins().bor(lower, upper);
                self.set(o.d, value);
            }
            Action::Extract { signed } => {
                let (n, width) = (self.get(o.n), u32::from(o.x.clamp(1, 32)));
                let unused = 32 - width;
                let up = self.constant(unused.saturating_sub(u32::from(o.m & 31)));
                let (left, down) = (self.b.ins().ishl(n, up), self.constant(unused));
                let value = if signed { self.b.ins().sshr(left, down) } else { self.b.ins().ushr(left, down) };
                self.set(o.d, value);
            }
            Action::Insert => {
                let field = u32::MAX >> (32 - u32::from(o.x.clamp(1, 32))) << (o.m & 31);
                let (d, kept) = (self.get(o.d), self.constant(!field));
                let rest = self.b.ins().band(d, kept);
                let value = match o.n {
                    15 => rest,
                    n => {
                        let (n, by, field) = (self.get(n), self.constant(u32::from(o.m & 31)), self.constant(field));
                        let moved = self.b.ins().ishl(n, by);
                        let inserted = self.b.ins().band(moved, field);
                        self.b.ins().bor(rest, inserted)
                    }
                };
                self.set(o.d, value);
            }
            Action::Extend { kind } => self.extend(o, kind),
            Action::CountZeros => {
                let m = self.get(o.m);
                let zeros = self.b.ins().clz(m);
                self.set(o.d, zeros);
            }
            Action::Multiply | Action::MultiplySubtract => {
                let (n, m) = (self.get(o.n), self.get(o.m));
                let product = self.b.ins().imul(n, m);
                let value = match instruction.action {
                    Action::Multiply if o.x == 15 => product,
                    Action::Multiply => {
                        let addend = self.get(o.x);
                        self.b.ins().iadd(addend, product)
                    }
                    _ => {
                        let from = self.get(o.x);
                        self.b.ins().isub(from, product)
                    }
                };
                self.set(o.d, value);
            }
            Action::MultiplyHigh => {
                let product = self.product(o, true);
                let rounding = self.b.ins().iconst(types::I64, i64::from(o.immediate & 1) << 31);
                let mut sum = self.b.ins().iadd(product, rounding);
                let half = self.constant(32);
                if o.x != 15 {
                    let addend = self.get(o.x);
                    let addend = self.b.ins().uextend(types::I64, addend);
                    let addend = self.b.ins().ishl(addend, half);
                    sum = self.b.ins().iadd(sum, addend);
                }
                let high = self.b.ins().ushr(sum, half);
                let high = self.b.ins().ireduce(types::I32, high);
                self.set(o.d, high);
            }
            Action::MultiplyLong { signed, accumulates } => {
                let mut product = self.product(o, signed);
                let half = self.constant(32);
                if accumulates {
                    let (low, high) = (self.get(o.d), self.get(o.x));
                    let (low, high) = (self.b.ins().uextend(types::I64, low), self.b.ins().uextend(types::I64, high));
                    let high = self.b.ins().ishl(high, half);
                    let sum = self.b.ins().bor(low, high);
                    product = self.b.ins().iadd(product, sum);
                }
                let low = self.b.ins().ireduce(types::I32, product);
                let high = self.b.ins().ushr(product, half);
                let high = self.b.ins().ireduce(types::I32, high);
                self.set(o.d, low);
                self.set(o.x, high);
            }
            Action::Divide { signed } => {
                let (n, m, zero) = (self.get(o.n), self.get(o.m), self.constant(0));
                // The quotient that does not fit as well.
                let least = self.constant(if signed { 2 } else { 1 });
                let one = self.constant(1);
                let shifted = if signed { self.b.ins().iadd(m, one) } else { m };
                let unusual = self.compare(IntCC::UnsignedLessThan, shifted, least);
                let unusual = match signed {
                    true => {
                        let by_zero = self.compare(IntCC::Equal, m, zero);
                        self.b.ins().bor(unusual, by_zero)
                    }
                    false => unusual,
                };
                self.call_if(unusual);
                let quotient = if signed { self.b.ins().sdiv(n, m) } else { self.b.ins().udiv(n, m) };
                self.set(o.d, quotient);
            }
            _ => return self.memory_or_float(instruction),
        }
        Some(())
    }

    fn product(&mut self, o: Operands, signed: bool) -> Value {
        let (n, m) = (self.get(o.n), self.get(o.m));
        let (n, m) = match signed {
            true => (self.b.ins().sextend(types::I64, n), self.b.ins().sextend(types::I64, m)),
            false => (self.b.ins().uextend(types::I64, n), self.b.ins().uextend(types::I64, m)),
        };
        self.b.ins().imul(n, m)
    }

    /// Result and flags of a shift.
    fn shifted(&mut self, d: u8, result: Value, carry: Value, flags: u8) {
        if self.sets(flags) {
            self.set_negative_zero(result);
            self.set_flag(CARRY, carry);
        }
        self.set(d, result);
    }

    /// Shifted value and carry out, by an amount that is known (see `arithmetic::shift`).
    fn shift(&mut self, kind: u8, value: Value, amount: u32, carry: Value) -> (Value, Value) {
        let mut bit = |number: u32| {
            let (by, one) = (self.constant(number), self.constant(1));
            let moved = self.b.ins().ushr(value, by);
            let bit = self.b.ins().band(moved, one);
            self.b.ins().ireduce(types::I8, bit)
        };
        if kind == EXTEND {
            let out = bit(0);
            let (one, top) = (self.constant(1), self.constant(31));
            let carry = self.b.ins().uextend(types::I32, carry);
            let (carry, rest) = (self.b.ins().ishl(carry, top), self.b.ins().ushr(value, one));
            return (self.b.ins().bor(rest, carry), out);
        }
        if amount == 0 {
            return (value, carry);
        }
        let out = match kind {
            LEFT if amount > 32 => self.flag(false),
            LEFT => bit(32 - amount),
            RIGHT if amount > 32 => self.flag(false),
            RIGHT => bit(amount - 1),
            ARITHMETIC => bit(amount.min(32) - 1),
            _ => bit((amount + 31) & 31),
        };
        let by = self.constant(amount & 31);
        let result = match kind {
            LEFT | RIGHT if amount > 31 => self.constant(0),
            LEFT => self.b.ins().ishl(value, by),
            RIGHT => self.b.ins().ushr(value, by),
            ARITHMETIC => {
                let by = self.constant(amount.min(31));
                self.b.ins().sshr(value, by)
            }
            _ => self.b.ins().rotr(value, by),
        };
        (result, out)
    }

    /// The same by the lowest byte of m.
    fn shift_by_register(&mut self, kind: u8, o: Operands) -> (Value, Value) {
        let (value, m, byte) = (self.get(o.n), self.get(o.m), self.constant(0xff));
        let amount = self.b.ins().band(m, byte);
        let (half, zero, one, top) = (self.constant(32), self.constant(0), self.constant(1), self.constant(31));
        let none = self.b.ins().iconst(types::I64, 0);
        let far = self.compare(IntCC::UnsignedGreaterThan, amount, half);
        let (result, out) = match kind {
            LEFT => {
                let wide = self.b.ins().uextend(types::I64, value);
                let moved = self.b.ins().ishl(wide, amount);
                let moved = self.b.ins().select(far, none, moved);
                let (low, high) = (self.b.ins().ireduce(types::I32, moved), self.b.ins().ushr(moved, half));
                (low, self.b.ins().ireduce(types::I32, high))
            }
            RIGHT | ARITHMETIC => {
                let wide = self.b.ins().uextend(types::I64, value);
                let wide = self.b.ins().ishl(wide, half);
                let moved = match kind {
                    RIGHT => {
                        let moved = self.b.ins().ushr(wide, amount);
                        self.b.ins().select(far, none, moved)
                    }
                    _ => {
                        let amount = self.b.ins().umin(amount, half);
                        self.b.ins().sshr(wide, amount)
                    }
                };
                let high = self.b.ins().ushr(moved, half);
                let (high, low) = (self.b.ins().ireduce(types::I32, high), self.b.ins().ireduce(types::I32, moved));
                (high, self.b.ins().ushr(low, top))
            }
            _ => {
                let rotated = self.b.ins().rotr(value, amount);
                (rotated, self.b.ins().ushr(rotated, top))
            }
        };
        let out = self.b.ins().band(out, one);
        let out = self.b.ins().ireduce(types::I8, out);
        let (kept, before) = (self.compare(IntCC::Equal, amount, zero), self.get_flag(CARRY));
        (result, self.b.ins().select(kept, before, out))
    }

    /// d = n operation second operand.
    fn data_processing(&mut self, o: Operands, operation: u8, second: u8, flags: u8) {
        let carry = self.get_flag(CARRY);
        let (second, carry_out) = match second {
            CONSTANT => match u32::from(o.x) {
                CARRY_KEPT => (self.constant(o.immediate), carry),
                action => (self.constant(o.immediate), self.flag(action != CARRY_CLEARED)),
            },
            REGISTER => (self.get(o.m), carry),
            _ => {
                let m = self.get(o.m);
                self.shift(o.x, m, o.immediate, carry)
            }
        };
        let first = self.get(o.n);
        let sets = self.sets(flags);
        let mut compared = None;
        let (result, carry_out, overflow) = match operation {
            AND => (self.b.ins().band(first, second), carry_out, None),
            BIC => (self.b.ins().band_not(first, second), carry_out, None),
            ORR => (self.b.ins().bor(first, second), carry_out, None),
            ORN => (self.b.ins().bor_not(first, second), carry_out, None),
            EOR => (self.b.ins().bxor(first, second), carry_out, None),
            MOV => (second, carry_out, None),
            MVN => (self.b.ins().bnot(second), carry_out, None),
            MUL => (self.b.ins().imul(first, second), carry_out, None),
            ADD => {
                let sum = self.b.ins().iadd(first, second);
                let carry = self.compare(IntCC::UnsignedLessThan, sum, first);
                (sum, carry, Some((first, second)))
            }
            ADC => self.add_with_carry(first, second, carry),
            SBC => {
                let complement = self.b.ins().bnot(second);
                self.add_with_carry(first, complement, carry)
            }
            _ => {
                let (from, less) = if operation == SUB { (first, second) } else { (second, first) };
                let difference = self.b.ins().isub(from, less);
                let carry = self.compare(IntCC::UnsignedGreaterThanOrEqual, from, less);
                compared = Some(Compared::Words(from, less));
                let complement = self.b.ins().bnot(less);
                (difference, carry, Some((from, complement)))
            }
        };
        if sets {
            self.set_negative_zero(result);
            self.set_flag(CARRY, carry_out);
            if let Some((a, b)) = overflow {
                // Both operands have another sign than the result.
                let (a, b) = (self.b.ins().bxor(a, result), self.b.ins().bxor(b, result));
                let (both, zero) = (self.b.ins().band(a, b), self.constant(0));
                let overflow = self.compare(IntCC::SignedLessThan, both, zero);
                self.set_flag(OVERFLOW, overflow);
            }
            if let Some(compared) = compared {
                self.remember(compared);
            }
        }
        if flags != TEST {
            self.set(o.d, result);
        }
    }

    fn add_with_carry(&mut self, a: Value, b: Value, carry: Value) -> (Value, Value, Option<(Value, Value)>) {
        let half = self.constant(32);
        let (wide_a, wide_b) = (self.b.ins().uextend(types::I64, a), self.b.ins().uextend(types::I64, b));
        let carry = self.b.ins().uextend(types::I64, carry);
        let sum = self.b.ins().iadd(wide_a, wide_b);
        let sum = self.b.ins().iadd(sum, carry);
        let out = self.b.ins().ushr(sum, half);
        let (sum, out) = (self.b.ins().ireduce(types::I32, sum), self.b.ins().ireduce(types::I8, out));
        (sum, out, Some((a, b)))
    }

    /// SXTH and its like.
    fn extend(&mut self, o: Operands, kind: u8) {
        let (m, by) = (self.get(o.m), self.constant(o.immediate));
        let value = self.b.ins().rotr(m, by);
        let narrow = |kind| if matches!(kind, HALF_SIGNED | HALF_UNSIGNED) { types::I16 } else { types::I8 };
        let result = match kind {
            BYTES_SIGNED | BYTES_UNSIGNED => {
                let (mask, half) = (self.constant(0xff), self.constant(16));
                let upper = self.b.ins().ushr(value, half);
                let [low, high] = [value, upper].map(|value| match kind {
                    BYTES_SIGNED => {
                        let byte = self.b.ins().ireduce(types::I8, value);
                        self.b.ins().sextend(types::I32, byte)
                    }
                    _ => self.b.ins().band(value, mask),
                });
                let base = if o.n == 15 { self.constant(0) } else { self.get(o.n) };
                let upper = self.b.ins().ushr(base, half);
                let (low, high) = (self.b.ins().iadd(base, low), self.b.ins().iadd(upper, high));
                let mask = self.constant(0xffff);
                let (low, high) = (self.b.ins().band(low, mask), self.b.ins().ishl(high, half));
                let both = self.b.ins().bor(low, high);
                return self.set(o.d, both);
            }
            HALF_SIGNED | BYTE_SIGNED => {
                let part = self.b.ins().ireduce(narrow(kind), value);
                self.b.ins().sextend(types::I32, part)
            }
            _ => {
                let part = self.b.ins().ireduce(narrow(kind), value);
                self.b.ins().uextend(types::I32, part)
            }
        };
        let result = match o.n {
            15 => result,
            n => {
                let base = self.get(n);
                self.b.ins().iadd(base, result)
            }
        };
        self.set(o.d, result);
    }
}
