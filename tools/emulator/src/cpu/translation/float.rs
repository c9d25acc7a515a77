//! The floating-point unit, where the host's arithmetic is the unit's (see `cpu::float`).

use super::emit::{Compared, Emitter};
use super::registers::{CARRY, NEGATIVE, OVERFLOW, ZERO};
use super::{Action, Instruction};
use crate::cpu::execute::floating_point::{NARROW, TOWARDS_ZERO, UNSIGNED, VADD, VDIV, VMLA, VMLS, VMUL, VNMUL, VSUB};
use crate::cpu::execute::load_store::CHANGES;
use crate::cpu::float::Status;
use crate::cpu::operation::Operands;
use cranelift_codegen::ir::condcodes::{FloatCC, IntCC};
use cranelift_codegen::ir::{InstBuilder, MemFlagsData, Value, types};

impl Emitter<'_, '_> {
    /// Translation of an instruction of the unit; none where it cannot be translated.
    pub fn floating_point(&mut self, instruction: Instruction) -> Option<()> {
        let o = instruction.operands;
        self.check_ready(instruction.action == Action::CompareFloats);
        match instruction.action {
            Action::Floats { operation } => {
                self.check_usual();
                let (d, n, m) = (self.float(o.d), self.float(o.n), self.float(o.m));
                let result = match operation {
                    VMUL => self.multiply(n, m),
                    VNMUL => {
                        let product = self.multiply(n, m);
                        self.b.ins().fneg(product)
                    }
                    VADD | VSUB => {
                        let sum = if operation == VADD { self.b.ins().fadd(n, m) } else { self.b.ins().fsub(n, m) };
                        self.finite(sum)
                    }
                    VMLA | VMLS => {
                        let product = self.multiply(n, m);
                        let product = if operation == VMLA { product } else { self.b.ins().fneg(product) };
                        let sum = self.b.ins().fadd(d, product);
                        self.finite(sum)
                    }
                    VDIV => {
                        let quotient = self.b.ins().fdiv(n, m);
                        let normal = self.is_normal(quotient);
                        self.call_unless(normal);
                        quotient
                    }
                    _ => self.called(o.d),
                };
                self.set_float(o.d, result);
            }
            Action::FloatConstant => {
                let bits = self.constant(o.immediate);
                self.set_bits(o.d, bits);
            }
            Action::MoveFloat => {
                let value = self.float(o.m);
                let value = match (o.immediate, o.x) {
                    (0, 0) => value,
                    (0, _) => self.b.ins().fneg(value),
                    _ => self.b.ins().fabs(value),
                };
                self.set_float(o.d, value);
            }
            Action::CompareFloats => self.compare_floats(o),
            Action::TakeFlags => self.take_flags(),
            Action::MoveToOrFromFloat { load: true } => {
                let bits = self.bits(o.n);
                self.set(o.d, bits);
            }
            Action::MoveToOrFromFloat { load: false } => {
                let bits = self.get(o.d);
                self.set_bits(o.n, bits);
            }
            Action::Float { load: true } => {
                if let Some(word) = self.known(&instruction) {
                    self.set_bits(o.d, word);
                    return Some(());
                }
                let at = match self.fixed(&instruction) {
                    Some(at) => at,
                    None => self.checked_float(o, false),
                };
                let values: Vec<_> = (0..o.x).map(|i| self.load(types::F32, at, i.into())).collect();
                for (value, i) in values.into_iter().zip(0..) {
                    self.set_float(o.d + i, value);
                }
            }
            Action::Float { load: false } => {
                let at = self.checked_float(o, true);
                for i in 0..o.x {
                    let value = self.float(o.d + i);
                    self.store(value, at, i.into());
                }
            }
            Action::SeveralFloats { load } => {
                let (start, changed) = self.block_of(o.n, o.m.into(), o.x);
                let at = self.checked(start, 4, o.m.into(), !load);
                for i in 0..o.m {
                    if load {
                        let value = self.load(types::F32, at, i.into());
                        self.set_float(o.d + i, value);
                    } else {
                        let value = self.float(o.d + i);
                        self.store(value, at, i.into());
                    }
                }
                if u32::from(o.x) & CHANGES != 0 {
                    self.set(o.n, changed);
                }
            }
            Action::FromFixed => {
                self.check_usual();
                let x = u32::from(o.x);
                // Others are seldom.
                if x & NARROW != 0 || o.immediate > 32 {
                    let called = self.called(o.d);
                    self.set_float(o.d, called);
                    return Some(());
                }
                let bits = self.bits(o.m);
                let value = match x & UNSIGNED {
                    0 => self.b.ins().fcvt_from_sint(types::F32, bits),
                    _ => {
                        let wide = self.b.ins().uextend(types::I64, bits);
                        self.b.ins().fcvt_from_sint(types::F32, wide)
                    }
                };
                let value = match o.immediate {
                    0 => value,
                    fraction => {
                        let one = self.b.ins().f32const((1u64 << fraction) as f32);
                        self.b.ins().fdiv(value, one)
                    }
                };
                self.set_float(o.d, value);
            }
            Action::ToFixed => self.convert_to_fixed(o),
            _ => return None,
        }
        Some(())
    }

    /// The unit is used: it was prepared already.
    fn check_ready(&mut self, compares: bool) {
        self.was_ready = self.ready || compares;
        if !self.ready {
            let (ready, no) = (self.field(types::I8, self.fields.floating_ready), self.flag(false));
            let unusual = self.compare(IntCC::Equal, ready, no);
            // Instructions behind a comparison have to know what was compared.
            if compares {
                self.leave_if(unusual)
            } else {
                self.call_if(unusual)
            }
            self.ready = true;
        }
    }

    /// The usual mode (see `Status::is_usual`).
    fn check_usual(&mut self) {
        if !self.usual {
            let (status, mask, usual) = (self.status(), self.constant(Status::USUAL.0), self.constant(Status::USUAL.1));
            let kept = self.b.ins().band(status, mask);
            let unusual = self.compare(IntCC::NotEqual, kept, usual);
            self.leave_if(unusual);
            // The unit's preparation may change the mode.
            self.usual = self.was_ready;
        }
    }

    fn status(&mut self) -> Value {
        self.field(types::I32, self.fields.status)
    }

    fn bits_of(&mut self, value: Value) -> Value {
        self.b.ins().bitcast(types::I32, MemFlagsData::new(), value)
    }

    fn bits(&mut self, register: u8) -> Value {
        let value = self.float(register);
        self.bits_of(value)
    }

    fn set_bits(&mut self, register: u8, bits: Value) {
        let value = self.b.ins().bitcast(types::F32, MemFlagsData::new(), bits);
        self.set_float(register, value);
    }

    fn call_unless(&mut self, usual: Value) {
        let no = self.flag(false);
        let unusual = self.compare(IntCC::Equal, usual, no);
        self.call_if(unusual);
    }

    /// Calls an operation that sets a register and is not translated. What the register is otherwise.
    fn called(&mut self, d: u8) -> Value {
        let always = self.flag(true);
        self.call_if(always);
        self.float(d)
    }

    /// Exponent, where it is.
    fn exponent(&mut self, value: Value) -> Value {
        let (bits, mask) = (self.bits_of(value), self.constant(0x7f80_0000));
        self.b.ins().band(bits, mask)
    }

    /// Counterpart of `Status::trusts`.
    fn is_normal(&mut self, value: Value) -> Value {
        let (exponent, least, range) = (self.exponent(value), self.constant(0x0100_0000), self.constant(0x7e80_0000));
        let above = self.b.ins().isub(exponent, least);
        self.compare(IntCC::UnsignedLessThan, above, range)
    }

    /// A value, where it is as `Status::trusts_finite`.
    fn finite(&mut self, value: Value) -> Value {
        let (exponent, infinite) = (self.exponent(value), self.constant(0x7f80_0000));
        let unusual = self.compare(IntCC::Equal, exponent, infinite);
        self.call_if(unusual);
        value
    }

    /// A product, also with zero; without a branch, because products with zero are no exception.
    fn multiply(&mut self, n: Value, m: Value) -> Value {
        let product = self.b.ins().fmul(n, m);
        let normal = self.is_normal(product);
        let none = self.b.ins().f32const(0.0);
        let (zero, either) = (self.b.ins().fcmp(FloatCC::Equal, n, none), self.b.ins().fcmp(FloatCC::Equal, m, none));
        let zero = self.b.ins().bor(zero, either);
        let (exponent, infinite) = (self.exponent(product), self.constant(0x7f80_0000));
        let finite = self.compare(IntCC::NotEqual, exponent, infinite);
        let zero = self.b.ins().band(zero, finite);
        let trusted = self.b.ins().bor(normal, zero);
        self.call_unless(trusted);
        product
    }

    /// VCMP of what is no NaN.
    fn compare_floats(&mut self, o: Operands) {
        // If denormal operands count as zero it is another comparison.
        self.check_usual();
        let a = self.float(o.d);
        let b = if o.immediate != 0 { self.b.ins().f32const(0.0) } else { self.float(o.m) };
        let unordered = self.b.ins().fcmp(FloatCC::Unordered, a, b);
        self.leave_if(unordered);
        let less = self.b.ins().fcmp(FloatCC::LessThan, a, b);
        let equal = self.b.ins().fcmp(FloatCC::Equal, a, b);
        let (of_less, of_equal, of_more) = (self.constant(8 << 28), self.constant(6 << 28), self.constant(2 << 28));
        let flags = self.b.ins().select(equal, of_equal, of_more);
        let flags = self.b.ins().select(less, of_less, flags);
        let (status, kept) = (self.status(), self.constant(0x0fff_ffff));
        let kept = self.b.ins().band(status, kept);
        let status = self.b.ins().bor(kept, flags);
        self.set_field(self.fields.status, status);
        self.compared_floats = Some((a, b));
    }

    /// VMRS of the flags.
    fn take_flags(&mut self) {
        if let Some((a, b)) = self.compared_floats {
            let less = self.b.ins().fcmp(FloatCC::LessThan, a, b);
            let equal = self.b.ins().fcmp(FloatCC::Equal, a, b);
            let not_less = self.b.ins().fcmp(FloatCC::GreaterThanOrEqual, a, b);
            let no = self.flag(false);
            for (flag, value) in [(NEGATIVE, less), (ZERO, equal), (CARRY, not_less), (OVERFLOW, no)] {
                self.set_flag(flag, value);
            }
            return self.remember(Compared::Floats(a, b));
        }
        let status = self.status();
        for (flag, bit) in [(NEGATIVE, 31), (ZERO, 30), (CARRY, 29), (OVERFLOW, 28)] {
            let (by, one) = (self.constant(bit), self.constant(1));
            let moved = self.b.ins().ushr(status, by);
            let value = self.b.ins().band(moved, one);
            let value = self.b.ins().ireduce(types::I8, value);
            self.set_flag(flag, value);
        }
    }

    /// VCVT towards zero, within range (see `float::to_fixed`).
    fn convert_to_fixed(&mut self, o: Operands) {
        let x = u32::from(o.x);
        self.check_usual();
        if x & NARROW != 0 || x & TOWARDS_ZERO == 0 || o.immediate > 32 {
            let called = self.called(o.d);
            return self.set_float(o.d, called);
        }
        let value = self.float(o.m);
        let wide = self.b.ins().fpromote(types::F64, value);
        let scale = self.b.ins().f64const((1u64 << o.immediate) as f64);
        let scaled = self.b.ins().fmul(wide, scale);
        // Neither NaN nor saturated: what is, is out of range.
        let whole = self.b.ins().fcvt_to_sint_sat(types::I64, scaled);
        let unordered = self.b.ins().fcmp(FloatCC::Unordered, scaled, scaled);
        let result = self.b.ins().ireduce(types::I32, whole);
        let back = match x & UNSIGNED {
            0 => self.b.ins().sextend(types::I64, result),
            _ => self.b.ins().uextend(types::I64, result),
        };
        let lost = self.compare(IntCC::NotEqual, back, whole);
        let unusual = self.b.ins().bor(lost, unordered);
        self.call_if(unusual);
        self.set_bits(o.d, result);
    }

    /// Address that VLDR and VSTR access.
    fn checked_float(&mut self, o: Operands, stores: bool) -> Value {
        let offset = self.constant(o.immediate);
        let address = match o.n {
            15 => offset,
            n => {
                let n = self.get(n);
                self.b.ins().iadd(n, offset)
            }
        };
        self.checked(address, 4, o.x.into(), stores)
    }
}
