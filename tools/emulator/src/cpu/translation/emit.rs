//! A region as a function: its blocks, what time they take, and how it is left.
//!
//! Registers are variables, and written to the core as well; flags are written where the function is left. Cycles and instructions are counted together, the latter in the upper half of a word, once for each block. A block begins only
//! if its last instruction begins before something is due.

use super::host::{Compiler, LONGEST};
use super::memory::LEAST;
use super::region::{Place, Region};
use super::{Action, Fields, Instruction, Left};
use crate::cpu::execute::data_processing::{ALWAYS, OUTSIDE_IT, TEST};
use crate::cpu::operation::{Flow, behind};
use crate::cpu::timing::REFILL;
use cranelift_codegen::ir::condcodes::{FloatCC, IntCC};
use cranelift_codegen::ir::immediates::Offset32;
use cranelift_codegen::ir::{
    AliasRegionData, Block, BlockArg, Function, Inst, InstBuilder, MemFlagsData, Opcode, SigRef, Type, UserFuncName,
    Value, types,
};
use cranelift_frontend::{FunctionBuilder, FunctionBuilderContext, Variable};
use std::collections::{HashMap, HashSet};

/// Flags, as `Emitter::flags` has them.
pub(super) const NEGATIVE: usize = 0;
pub(super) const ZERO: usize = 1;
pub(super) const CARRY: usize = 2;
pub(super) const OVERFLOW: usize = 3;

/// An instruction in the count of instructions and cycles.
const ONE: u64 = 1 << 32;

/// Operands of the last comparison, whose flags are still those.
#[derive(Clone, Copy)]
pub(super) enum Compared {
    Words(Value, Value),
    /// None of them is a NaN.
    Floats(Value, Value),
}

pub(super) struct Emitter<'a, 'b> {
    pub b: FunctionBuilder<'b>,
    pub fields: &'a Fields,
    pub region: &'a Region,
    pub cpu: Value,
    pub memory: Value,
    /// Cycles up to which blocks may begin.
    room: Variable,
    /// How fields of the core, and memory, are accessed.
    pub core: MemFlagsData,
    pub data: MemFlagsData,
    /// Of what calls an instruction.
    signature: SigRef,
    registers: [Variable; 15],
    floats: [Variable; 32],
    flags: [Variable; 4],
    spent: Variable,
    /// What is not part of `spent` yet.
    pending: u64,
    /// Where the instruction is that is translated.
    place: Place,
    /// The condition of an instruction that is executed either way, but changes nothing if that does not hold.
    guard: Option<Value>,
    /// Where the function is left: with where the core goes on, `spent`, how it is left, and flags.
    out: Block,
    /// Where the instruction that is translated is called instead, if it is.
    aside: Option<Block>,
    /// Variables that it has set, and where they are written to.
    written: Vec<(Variable, Type, i32)>,
    pub compared: Option<Compared>,
    /// What the last comparison of floats left, which is not taken over yet.
    pub compared_floats: Option<(Value, Value)>,
    /// In this block the floating-point unit was found ready; in the usual mode.
    pub ready: bool,
    pub usual: bool,
    /// It was ready before the instruction that is translated.
    pub was_ready: bool,
    blocks: HashMap<Place, Block>,
    waiting: Vec<Place>,
}

/// The function of the region from an address on; none where that is nothing.
pub(super) fn function(compiler: &Compiler, fields: &Fields, region: &Region) -> Option<Function> {
    let entry = region.entry;
    if !region.holds(entry) || region.memory < LEAST {
        return None;
    }
    let mut function = Function::with_name_signature(UserFuncName::default(), compiler.signature());
    let mut context = FunctionBuilderContext::new();
    let mut b = FunctionBuilder::new(&mut function, &mut context);
    let begin = b.create_block();
    b.append_block_params_for_function_params(begin);
    b.switch_to_block(begin);
    b.seal_block(begin);
    let &[cpu, memory] = b.block_params(begin) else { return None };
    let mut region_of = |user_id, description: &'static str| {
        b.func.dfg.alias_regions.insert(AliasRegionData { user_id, description: description.into() })
    };
    let (of_core, of_data) = (region_of(0, "core"), region_of(1, "memory"));
    let core = MemFlagsData::trusted().with_alias_region(Some(of_core));
    let data = MemFlagsData::new().with_notrap().with_alias_region(Some(of_data));
    let signature = b.import_signature(compiler.signature_of_call());
    let now = b.ins().load(types::I64, core, cpu, fields.now);
    let attention = b.ins().load(types::I64, core, cpu, fields.attention);
    let left = b.ins().isub(attention, now);
    let most = b.ins().iconst(types::I64, LONGEST as i64);
    let room = b.ins().umin(left, most);
    let cycles = b.ins().ireduce(types::I32, room);
    let room = b.declare_var(types::I32);
    b.def_var(room, cycles);
    let mut variable = |kind: Type, offset: Option<i32>| {
        let variable = b.declare_var(kind);
        let value = match offset {
            Some(offset) => b.ins().load(kind, core, cpu, offset),
            None => b.ins().iconst(kind, 0),
        };
        b.def_var(variable, value);
        variable
    };
    let registers = std::array::from_fn(|i| variable(types::I32, Some(fields.registers + 4 * i as i32)));
    let floats = std::array::from_fn(|i| variable(types::F32, Some(fields.floats + 4 * i as i32)));
    let flags = fields.flags.map(|offset| variable(types::I8, Some(offset)));
    let spent = variable(types::I64, None);
    let mut emitter = Emitter {
        b,
        fields,
        region,
        cpu,
        memory,
        room,
        core,
        data,
        signature,
        registers,
        floats,
        flags,
        spent,
        pending: 0,
        place: Place::at(entry),
        guard: None,
        out: begin,
        aside: None,
        written: Vec::new(),
        compared: None,
        compared_floats: None,
        ready: false,
        usual: false,
        was_ready: false,
        blocks: HashMap::new(),
        waiting: Vec::new(),
    };
    emitter.out = emitter.b.create_block();
    emitter.b.set_cold_block(emitter.out);
    let first = emitter.block_at(Place::at(entry));
    emitter.b.ins().jump(first, &[]);
    while let Some(place) = emitter.waiting.pop() {
        emitter.block(place)?;
    }
    emitter.end();
    emitter.b.seal_all_blocks();
    emitter.b.finalize(compiler.isa.frontend_config());
    drop_unused(&mut function);
    Some(function)
}

/// Leaves out loads of what nothing uses, which the compiler would not.
fn drop_unused(function: &mut Function) {
    let (dfg, layout) = (&function.stencil.dfg, &mut function.stencil.layout);
    let mut used = HashSet::new();
    for block in layout.blocks() {
        for inst in layout.block_insts(block) {
            used.extend(dfg.inst_values(inst).map(|value| dfg.resolve_aliases(value)));
        }
    }
    let unused = |inst: &Inst| dfg.insts[*inst].opcode() == Opcode::Load && !used.contains(&dfg.first_result(*inst));
    let unused: Vec<_> = layout.blocks().flat_map(|block| layout.block_insts(block)).filter(unused).collect();
    for inst in unused {
        layout.remove_inst(inst);
    }
}

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

    /// Whether an instruction sets flags.
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

    /// Whether a condition holds (ConditionPassed).
    fn holds(&mut self, condition: u8) -> Value {
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

    /// The block of a place; it is translated later.
    fn block_at(&mut self, place: Place) -> Block {
        let (b, waiting) = (&mut self.b, &mut self.waiting);
        *self.blocks.entry(place).or_insert_with(|| {
            waiting.push(place);
            b.create_block()
        })
    }

    /// Makes what was counted part of a variable.
    fn count(&mut self) {
        if self.pending != 0 {
            let (spent, pending) = (self.b.use_var(self.spent), self.pending as i64);
            let pending = self.b.ins().iconst(types::I64, pending);
            let spent = self.b.ins().iadd(spent, pending);
            self.b.def_var(self.spent, spent);
            self.pending = 0;
        }
    }

    /// Leaves the function. The core goes on at `target`.
    fn leave(&mut self, left: Left, target: Value, place: Place) {
        self.count();
        let how = self.constant(left as u32 | u32::from(place.single) << 8 | u32::from(place.it) << 16);
        let spent = self.b.use_var(self.spent);
        let flags = [NEGATIVE, ZERO, CARRY, OVERFLOW].map(|flag| self.get_flag(flag));
        let arguments: Vec<_> = [target, spent, how].into_iter().chain(flags).map(BlockArg::from).collect();
        self.b.ins().jump(self.out, &arguments);
    }

    /// Where the function is left.
    fn end(&mut self) {
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

    /// The instruction is called, instead of what is translated, if something is `unusual`. Nothing has changed up to there.
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
    fn translate_or_call(
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
        // What it has taken is counted: nothing is left of what is counted for it behind it.
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
    fn reload(&mut self) {
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

    /// Calls the instruction. The function is left if something else follows than what is translated, or too early for the `remaining` cycles of
    /// the block.
    fn call(&mut self, follows: Place, remaining: u32) {
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
    fn aside(&mut self, translate: impl FnOnce(&mut Self)) {
        let kept = (self.pending, self.place, self.compared, self.compared_floats, self.ready, self.usual);
        translate(self);
        (self.pending, self.place, self.compared, self.compared_floats, self.ready, self.usual) = kept;
    }

    /// Goes on at a place, in this function if it is part of it.
    fn go_to(&mut self, place: Place) {
        if self.region.holds(place.address) {
            self.count();
            let block = self.block_at(place);
            self.b.ins().jump(block, &[]);
        } else {
            let target = self.constant(place.address);
            self.leave(Left::Jumped, target, place);
        }
    }

    /// Goes to where a branch leads, whose own cycles are `cost`, and which takes some more because of where that is.
    fn branch(&mut self, target: u32, cost: u64, waits: u64) {
        self.pending += cost + REFILL + waits;
        self.go_to(Place::at(target));
    }

    /// A block, from a place on.
    fn block(&mut self, begin: Place) -> Option<()> {
        let block = self.blocks.get(&begin).copied()?;
        self.b.switch_to_block(block);
        (self.pending, self.place, self.guard) = (0, begin, None);
        (self.compared, self.compared_floats, self.ready, self.usual) = (None, None, false, false);
        let instructions = self.region.block(begin.address);
        let mut cycles = 0;
        let mut before_last = 0;
        let mut single = begin.single;
        let mut ends = Vec::new();
        for (_, instruction) in &instructions {
            before_last = cycles;
            cycles += self.cost(instruction, single) & (ONE - 1);
            ends.push(cycles);
            single = instruction.timing.single;
        }
        let spent = self.b.use_var(self.spent);
        let spent = self.b.ins().ireduce(types::I32, spent);
        // Cycles from the end of each to the beginning of the last.
        let remaining: Vec<_> = ends.iter().map(|end| before_last.saturating_sub(*end) as u32).collect();
        let before_last = self.constant(before_last as u32);
        let begins = self.b.ins().iadd(spent, before_last);
        let room = self.b.use_var(self.room);
        let late = self.compare(IntCC::UnsignedGreaterThanOrEqual, begins, room);
        self.leave_if(late);
        for ((address, instruction), remaining) in instructions.into_iter().zip(remaining) {
            self.place.address = address;
            if self.instruction(instruction, remaining)? {
                return Some(());
            }
        }
        self.go_to(self.place);
        Some(())
    }

    /// What an instruction counts.
    fn cost(&self, instruction: &Instruction, single: bool) -> u64 {
        let timing = instruction.timing;
        let overlaps = if single { timing.overlaps } else { 0 };
        ONE + u64::from(timing.cycles - overlaps) + self.waits(instruction)
    }

    /// An instruction; true where nothing follows it.
    fn instruction(&mut self, instruction: Instruction, remaining: u32) -> Option<bool> {
        let Place { single, it, .. } = self.place;
        let timing = instruction.timing;
        let branches = matches!(instruction.action, Action::Branch | Action::Call | Action::BranchToRegister { .. })
            || timing.flow == Flow::Elsewhere;
        if it != 0 && (timing.flow == Flow::Block || timing.flow == Flow::Perhaps || branches && behind(it) != 0) {
            // The architecture leaves open what those do in an IT block, or elsewhere than at its end.
            let target = self.constant(self.place.address);
            self.leave(Left::Call, target, self.place);
            return Some(true);
        }
        let follows = Place {
            address: self.place.address.wrapping_add(timing.length.into()),
            single: timing.single,
            it: if timing.flow == Flow::Block { instruction.operands.x } else { behind(it) },
        };
        let cost = self.cost(&instruction, single);
        if it == 0 || it >> 4 == 14 {
            let ended = self.translate_or_call(instruction, cost, follows, remaining)?;
            if !ended {
                (self.pending, self.place) = (self.pending + cost, follows);
            }
            return Some(ended);
        }
        let condition = self.holds(it >> 4);
        if is_pure(instruction.action) && timing.cycles == 1 {
            self.guard = Some(condition);
            let ended = self.translate_or_call(instruction, cost, follows, remaining)?;
            self.guard = None;
            (self.pending, self.place) = (self.pending + cost, follows);
            return Some(ended);
        }
        self.count();
        let (then, otherwise) = (self.b.create_block(), self.b.create_block());
        self.b.ins().brif(condition, then, &[], otherwise, &[]);
        self.b.seal_block(then);
        self.b.switch_to_block(then);
        let passed = Place { single: false, ..follows };
        let skipped = ONE + 1 - if single { u64::from(timing.overlaps) } else { 0 };
        let kept = (self.place, self.compared_floats, self.ready, self.usual);
        let ended = self.translate_or_call(instruction, cost, follows, remaining)?;
        if timing.single {
            // What follows takes another time behind it.
            self.pending += cost;
            self.go_to(follows);
            self.b.seal_block(otherwise);
            self.b.switch_to_block(otherwise);
            (self.pending, self.place) = (skipped, passed);
            self.go_to(passed);
            return Some(true);
        }
        let join = self.b.create_block();
        if !ended {
            self.pending += cost;
            self.count();
            self.b.ins().jump(join, &[]);
        }
        self.b.seal_block(otherwise);
        self.b.switch_to_block(otherwise);
        self.pending = skipped;
        self.count();
        self.b.ins().jump(join, &[]);
        self.b.seal_block(join);
        self.b.switch_to_block(join);
        (_, self.compared_floats, self.ready, self.usual) = kept;
        (self.place, self.compared, self.pending) = (passed, None, 0);
        Some(false)
    }

    /// What an instruction does; true where nothing follows it.
    fn translate(&mut self, instruction: Instruction, cost: u64, follows: Place) -> Option<bool> {
        let o = instruction.operands;
        match instruction.action {
            Action::Branch => self.branch(o.immediate, cost, instruction.waits.into()),
            Action::Call => {
                let link = self.constant(follows.address | 1);
                self.set(14, link);
                self.branch(o.immediate, cost, instruction.waits.into());
            }
            Action::BranchIf | Action::BranchIfZero => {
                let condition = match instruction.action {
                    Action::BranchIf => self.holds(o.x),
                    _ => {
                        let (n, zero) = (self.get(o.n), self.constant(0));
                        self.compare(if o.x == 0 { IntCC::Equal } else { IntCC::NotEqual }, n, zero)
                    }
                };
                let (taken, on) = (self.b.create_block(), self.b.create_block());
                self.b.ins().brif(condition, taken, &[], on, &[]);
                self.b.seal_block(taken);
                self.b.seal_block(on);
                self.b.switch_to_block(taken);
                let pending = self.pending;
                self.branch(o.immediate, cost, instruction.waits.into());
                self.b.switch_to_block(on);
                self.pending = pending + cost;
                self.go_to(follows);
            }
            Action::BranchToRegister { link } => {
                let target = self.get(o.m);
                if link {
                    let link = self.constant(follows.address | 1);
                    self.branch_to(target, cost, |emitter| emitter.set(14, link));
                } else {
                    self.branch_to(target, cost, |_| {});
                }
            }
            Action::Several { load: true } if o.immediate >> 15 != 0 => self.load_several(o, Some(cost)),
            _ => {
                self.plain(instruction)?;
                return Some(false);
            }
        }
        Some(true)
    }

    /// Goes to where a register says, after something else; exceptions' returns and what is no Thumb code are left to be called.
    pub fn branch_to(&mut self, target: Value, cost: u64, before: impl FnOnce(&mut Self)) {
        let (one, returns) = (self.constant(1), self.constant(0xf000_0000));
        let thumb = self.b.ins().band(target, one);
        let zero = self.constant(0);
        let arm = self.compare(IntCC::Equal, thumb, zero);
        let special = self.compare(IntCC::UnsignedGreaterThanOrEqual, target, returns);
        let unusual = self.b.ins().bor(arm, special);
        self.call_if(unusual);
        before(self);
        self.pending += cost;
        let target = self.b.ins().bxor(target, one);
        self.leave(Left::Branched, target, Place::at(0));
    }

    /// Offset of what is accessed.
    pub fn offset(bytes: u32) -> Offset32 {
        Offset32::new(bytes as i32)
    }
}

/// Whether an instruction changes nothing but registers and flags, and never leaves the function for what they are.
fn is_pure(action: Action) -> bool {
    matches!(
        action,
        Action::Nothing
            | Action::Data { .. }
            | Action::Shift { .. }
            | Action::ShiftByRegister { .. }
            | Action::Add
            | Action::Constant
            | Action::UpperHalf
            | Action::Extract { .. }
            | Action::Insert
            | Action::Extend { .. }
            | Action::CountZeros
            | Action::Multiply
            | Action::MultiplySubtract
            | Action::MultiplyHigh
            | Action::MultiplyLong { .. }
            | Action::FloatConstant
            | Action::MoveFloat
            | Action::MoveToOrFromFloat { .. }
    )
}
