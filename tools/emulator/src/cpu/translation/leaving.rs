//! Ways in which a function is left, and in which it calls for an instruction that it does not execute itself.

use super::emit::Emitter;
use super::region::Place;
use super::registers::{CARRY, NEGATIVE, OVERFLOW, ZERO};
use super::{Action, Instruction, Left};
use cranelift_codegen::ir::{BlockArg, InstBuilder, Value, types};

impl Emitter<'_, '_> {
    /// Leaves the function. The core goes on at `target`.
    pub fn leave(&mut self, left: Left, target: Value, place: Place) {
        self.count();
        let how = self.constant(left as u32 | u32::from(place.single) << 8 | u32::from(place.it) << 16);
        let spent = self.b.use_var(self.spent);
        let flags = [NEGATIVE, ZERO, CARRY, OVERFLOW].map(|flag| self.get_flag(flag));
        let arguments: Vec<_> = [target, spent, how].into_iter().chain(flags).map(BlockArg::from).collect();
        self.b.ins().jump(self.out, &arguments);
    }

    /// Block in which the function is left.
    pub fn end(&mut self) {
        let out = self.out;
        let kinds = [types::I32, types::I64, types::I32, types::I8, types::I8, types::I8, types::I8];
        let [target, spent, how, flags @ ..] = kinds.map(|kind| self.b.append_block_param(out, kind));
        self.b.switch_to_block(out);
        for (offset, flag) in self.fields.flags.into_iter().zip(flags) {
            self.set_field(offset, flag);
        }
        self.set_field(self.fields.pc, target);
        for (offset, by) in [(self.fields.single, 8), (self.fields.it, 16)] {
            let by = self.constant(by);
            let value = self.b.ins().ushr(how, by);
            let value = self.b.ins().ireduce(types::I8, value);
            self.set_field(offset, value);
        }
        let cycles = self.b.ins().ireduce(types::I32, spent);
        let cycles = self.b.ins().uextend(types::I64, cycles);
        let half = self.constant(32);
        let instructions = self.b.ins().ushr(spent, half);
        for (offset, more) in [(self.fields.now, cycles), (self.fields.instructions, instructions)] {
            let before = self.field(types::I64, offset);
            let after = self.b.ins().iadd(before, more);
            self.set_field(offset, after);
        }
        let mask = self.constant(0xff);
        let left = self.b.ins().band(how, mask);
        self.b.ins().return_(&[left]);
    }

    /// Leaves the function before the instruction that is translated if it is `unusual`.
    pub fn leave_if(&mut self, unusual: Value) {
        let (out, on) = (self.b.create_block(), self.b.create_block());
        self.b.set_cold_block(out);
        self.b.ins().brif(unusual, out, &[], on, &[]);
        self.b.seal_block(out);
        self.b.seal_block(on);
        self.b.switch_to_block(out);
        self.aside(|emitter| {
            let (place, guard) = (emitter.place, emitter.guard.take());
            let target = emitter.constant(place.address);
            emitter.leave(Left::Call, target, place);
            emitter.guard = guard;
        });
        self.b.switch_to_block(on);
    }

    /// The instruction is called, instead of what is translated, if something is `unusual`. Nothing has changed up to
    /// there.
    pub fn call_if(&mut self, unusual: Value) {
        let aside = match self.aside {
            Some(aside) => aside,
            None => {
                let aside = self.b.create_block();
                self.b.set_cold_block(aside);
                self.aside = Some(aside);
                aside
            }
        };
        let on = self.b.create_block();
        self.b.ins().brif(unusual, aside, &[], on, &[]);
        self.b.seal_block(on);
        self.b.switch_to_block(on);
    }

    /// Translates an instruction, and the call of it where that is what happens; true where nothing follows.
    pub fn translate_or_call(
        &mut self,
        instruction: Instruction,
        cost: u64,
        follows: Place,
        remaining: u32,
    ) -> Option<bool> {
        let before = self.pending;
        if instruction.action == Action::Other {
            self.call(follows, remaining);
            let none = self.b.ins().iconst(types::I64, before.wrapping_add(cost).wrapping_neg() as i64);
            self.b.def_var(self.spent, none);
            self.reload();
            self.pending = before;
            return Some(false);
        }
        (self.aside, self.written) = (None, Vec::new());
        let ended = self.translate(instruction, cost, follows)?;
        let Some(aside) = self.aside.take() else { return Some(ended) };
        let after = self.b.create_block();
        if !ended {
            self.b.ins().jump(after, &[]);
        }
        self.b.seal_block(aside);
        self.b.switch_to_block(aside);
        let guard = self.guard.take();
        let pending = std::mem::replace(&mut self.pending, before);
        self.call(follows, remaining);
        // Cycles that it has taken are counted: nothing is left of what is counted for it behind it.
        let none = self.b.ins().iconst(types::I64, before.wrapping_add(cost).wrapping_neg() as i64);
        self.b.def_var(self.spent, none);
        for (variable, kind, offset) in std::mem::take(&mut self.written) {
            let value = self.field(kind, offset);
            self.b.def_var(variable, value);
        }
        (self.guard, self.pending) = (guard, pending);
        if ended {
            // It has gone elsewhere, and the function was left.
            let left = self.constant(Left::Jumped as u32);
            self.b.ins().return_(&[left]);
            return Some(true);
        }
        self.b.ins().jump(after, &[]);
        self.b.seal_block(after);
        self.b.switch_to_block(after);
        Some(false)
    }

    /// Anything may have changed.
    pub fn reload(&mut self) {
        let registers = self
            .registers
            .into_iter()
            .zip(0..)
            .map(|(variable, i)| (variable, types::I32, self.fields.registers + 4 * i));
        let floats =
            self.floats.into_iter().zip(0..).map(|(variable, i)| (variable, types::F32, self.fields.floats + 4 * i));
        let flags =
            self.flags.into_iter().zip(self.fields.flags).map(|(variable, offset)| (variable, types::I8, offset));
        for (variable, kind, offset) in registers.chain(floats).chain(flags) {
            let value = self.field(kind, offset);
            self.b.def_var(variable, value);
        }
        (self.compared, self.compared_floats, self.ready, self.usual) = (None, None, false, false);
    }

    /// Calls the instruction. The function is left if something else follows than what is translated, or too early for
    /// the `remaining` cycles of the block.
    pub fn call(&mut self, follows: Place, remaining: u32) {
        for flag in 0..4 {
            let value = self.get_flag(flag);
            self.set_field(self.fields.flags[flag], value);
        }
        self.count();
        let place = self.place;
        let how = u32::from(place.single) | u32::from(place.it) << 8 | u32::from(follows.it) << 16;
        let spent = self.b.use_var(self.spent);
        let arguments = [place.address, follows.address, how, remaining].map(|argument| self.constant(argument));
        let arguments: Vec<_> = [self.cpu, spent].into_iter().chain(arguments).collect();
        let one = self.b.ins().iconst(types::I64, self.fields.call as i64);
        let call = self.b.ins().call_indirect(self.signature, one, &arguments);
        let Some(room) = self.b.inst_results(call).first().copied() else { return };
        let (left, on) = (self.b.create_block(), self.b.create_block());
        self.b.set_cold_block(on);
        self.b.set_cold_block(left);
        self.b.ins().brif(room, on, &[], left, &[]);
        self.b.seal_block(on);
        self.b.seal_block(left);
        self.b.switch_to_block(left);
        let jumped = self.constant(Left::Jumped as u32);
        self.b.ins().return_(&[jumped]);
        self.b.switch_to_block(on);
        self.b.def_var(self.room, room);
    }

    /// Translates something that is not on the way: what it counts does not count for what follows.
    pub fn aside(&mut self, translate: impl FnOnce(&mut Self)) {
        let kept = (self.pending, self.place, self.compared, self.compared_floats, self.ready, self.usual);
        translate(self);
        (self.pending, self.place, self.compared, self.compared_floats, self.ready, self.usual) = kept;
    }
}
