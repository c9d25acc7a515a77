//! Registers, flags, and the conditions that they are asked for.

use super::emit::{Compared, Emitter};
use crate::cpu::execute::data_processing::{ALWAYS, OUTSIDE_IT, TEST};
use cranelift_codegen::ir::condcodes::{FloatCC, IntCC};
use cranelift_codegen::ir::{InstBuilder, Type, Value, types};
use cranelift_frontend::Variable;

/// Flags, as `Emitter::flags` has them.
pub(super) const NEGATIVE: usize = 0;
pub(super) const ZERO: usize = 1;
pub(super) const CARRY: usize = 2;
pub(super) const OVERFLOW: usize = 3;

impl Emitter<'_, '_> {
    /// A constant of 32 bits.
    pub fn constant(&mut self, value: u32) -> Value {
        self.b.ins().iconst(types::I32, i64::from(value))
    }

    /// A constant flag.
    pub fn flag(&mut self, value: bool) -> Value {
        self.b.ins().iconst(types::I8, i64::from(value))
    }

    pub fn get(&mut self, register: u8) -> Value {
        match self.registers.get(usize::from(register & 15)) {
            Some(variable) => self.b.use_var(*variable),
            None => self.constant(0),
        }
    }

    /// Sets a general register; the lowest two bits of the stack pointer are always 0.
    pub fn set(&mut self, register: u8, value: Value) {
        let register = register & 15;
        let Some(variable) = self.registers.get(usize::from(register)).copied() else { return };
        let value = match register {
            13 => {
                let kept = self.constant(!3);
                self.b.ins().band(value, kept)
            }
            _ => value,
        };
        let value = self.guarded(value, variable);
        self.b.def_var(variable, value);
        let offset = self.fields.registers + 4 * i32::from(register);
        self.set_field(offset, value);
        self.written.push((variable, types::I32, offset));
    }

    pub fn float(&mut self, register: u8) -> Value {
        self.b.use_var(self.floats[usize::from(register & 31)])
    }

    pub fn set_float(&mut self, register: u8, value: Value) {
        let register = register & 31;
        let variable = self.floats[usize::from(register)];
        let value = self.guarded(value, variable);
        self.b.def_var(variable, value);
        let offset = self.fields.floats + 4 * i32::from(register);
        self.set_field(offset, value);
        self.written.push((variable, types::F32, offset));
    }

    pub fn get_flag(&mut self, flag: usize) -> Value {
        self.b.use_var(self.flags[flag])
    }

    pub fn set_flag(&mut self, flag: usize, value: Value) {
        let variable = self.flags[flag];
        let value = self.guarded(value, variable);
        self.b.def_var(variable, value);
        self.written.push((variable, types::I8, self.fields.flags[flag]));
        self.compared = None;
    }

    fn guarded(&mut self, value: Value, variable: Variable) -> Value {
        match self.guard {
            Some(guard) => {
                let kept = self.b.use_var(variable);
                self.b.ins().select(guard, value, kept)
            }
            None => value,
        }
    }

    /// Sets N and Z.
    pub fn set_negative_zero(&mut self, result: Value) {
        let zero = self.constant(0);
        let (negative, zero) =
            (self.compare(IntCC::SignedLessThan, result, zero), self.compare(IntCC::Equal, result, zero));
        self.set_flag(NEGATIVE, negative);
        self.set_flag(ZERO, zero);
    }

    /// Returns `true` if an instruction sets flags.
    pub fn sets(&self, flags: u8) -> bool {
        flags == ALWAYS || flags == TEST || flags == OUTSIDE_IT && self.place.it == 0
    }

    /// Remembers what was compared; not where it may not have been.
    pub fn remember(&mut self, compared: Compared) {
        self.compared = self.guard.is_none().then_some(compared);
    }

    pub fn compare(&mut self, condition: IntCC, a: Value, b: Value) -> Value {
        self.b.ins().icmp(condition, a, b)
    }

    /// A field of the core that is not kept in a variable.
    pub fn field(&mut self, kind: Type, offset: i32) -> Value {
        let (core, cpu) = (self.core, self.cpu);
        self.b.ins().load(kind, core, cpu, offset)
    }

    pub fn set_field(&mut self, offset: i32, value: Value) {
        let (core, cpu) = (self.core, self.cpu);
        self.b.ins().store(core, value, cpu, offset);
    }

    /// Value that is true if a condition holds (ConditionPassed).
    pub fn holds(&mut self, condition: u8) -> Value {
        let of_words = [
            IntCC::Equal,
            IntCC::NotEqual,
            IntCC::UnsignedGreaterThanOrEqual,
            IntCC::UnsignedLessThan,
            IntCC::UnsignedGreaterThan,
            IntCC::UnsignedLessThanOrEqual,
            IntCC::SignedGreaterThanOrEqual,
            IntCC::SignedLessThan,
            IntCC::SignedGreaterThan,
            IntCC::SignedLessThanOrEqual,
        ];
        let at = match condition {
            0..=3 => Some(condition),
            8..=13 => Some(condition - 4),
            _ => None,
        };
        let word = at.and_then(|at| of_words.get(usize::from(at)).copied());
        match self.compared {
            Some(Compared::Words(a, b)) if let Some(word) = word => return self.compare(word, a, b),
            Some(Compared::Floats(a, b)) => {
                let float = match condition {
                    0 => FloatCC::Equal,
                    1 => FloatCC::NotEqual,
                    2 | 5 | 10 => FloatCC::GreaterThanOrEqual,
                    3 | 4 | 11 => FloatCC::LessThan,
                    8 | 12 => FloatCC::GreaterThan,
                    9 | 13 => FloatCC::LessThanOrEqual,
                    _ => return self.flag(condition == 7),
                };
                return self.b.ins().fcmp(float, a, b);
            }
            _ => {}
        }
        let plain = match condition >> 1 {
            0 => self.get_flag(ZERO),
            1 => self.get_flag(CARRY),
            2 => self.get_flag(NEGATIVE),
            3 => self.get_flag(OVERFLOW),
            4 => {
                let (carry, zero) = (self.get_flag(CARRY), self.get_flag(ZERO));
                self.b.ins().band_not(carry, zero)
            }
            kind => {
                let (negative, overflow) = (self.get_flag(NEGATIVE), self.get_flag(OVERFLOW));
                let same = self.compare(IntCC::Equal, negative, overflow);
                match kind {
                    5 => same,
                    _ => {
                        let zero = self.get_flag(ZERO);
                        self.b.ins().band_not(same, zero)
                    }
                }
            }
        };
        match condition & 1 {
            0 => plain,
            _ => {
                let one = self.flag(true);
                self.b.ins().bxor(plain, one)
            }
        }
    }
}
