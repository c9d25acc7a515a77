//! A region as a function: its blocks, what time they take, and how it is left.
//!
//! Registers are variables, and written to the core as well (`registers`); flags are written where the function is left
//! (`leaving`). Cycles and instructions are counted together, the latter in the upper half of a word, once for each
//! block. A block begins only if its last instruction begins before something is due.

use super::region::{LEAST, Place, Region};
use super::{Action, Fields, Instruction, Left};
use crate::cpu::operation::{Flow, behind};
use crate::cpu::timing::REFILL;
use cranelift_codegen::ir::condcodes::IntCC;
use cranelift_codegen::ir::immediates::Offset32;
use cranelift_codegen::ir::{
    AliasRegionData, Block, Function, Inst, InstBuilder, MemFlagsData, Opcode, SigRef, Signature, Type, UserFuncName,
    Value, types,
};
use cranelift_codegen::isa::TargetFrontendConfig;
use cranelift_frontend::{FunctionBuilder, FunctionBuilderContext, Variable};
use std::collections::{HashMap, HashSet};

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
    pub room: Variable,
    /// Access to fields of the core, and to memory.
    pub core: MemFlagsData,
    pub data: MemFlagsData,
    /// Signature of what calls an instruction.
    pub signature: SigRef,
    pub registers: [Variable; 15],
    pub floats: [Variable; 32],
    pub flags: [Variable; 4],
    pub spent: Variable,
    /// Cycles that are not part of `spent` yet.
    pub pending: u64,
    /// Place of the instruction that is translated.
    pub place: Place,
    /// The condition of an instruction that is executed either way, but changes nothing if that does not hold.
    pub guard: Option<Value>,
    /// Block in which the function is left: with where the core goes on, `spent`, how it is left, and flags.
    pub out: Block,
    /// Block in which the instruction that is translated is called instead, if it is.
    pub aside: Option<Block>,
    /// Variables that it has set, and where they are written to.
    pub written: Vec<(Variable, Type, i32)>,
    pub compared: Option<Compared>,
    /// Values that the last comparison of floats left, which are not taken over yet.
    pub compared_floats: Option<(Value, Value)>,
    /// `true` if in this block the floating-point unit was found ready; in the usual mode.
    pub ready: bool,
    pub usual: bool,
    /// `true` if it was ready before the instruction that is translated.
    pub was_ready: bool,
    pub blocks: HashMap<Place, Block>,
    pub waiting: Vec<Place>,
}

/// Cycles that a function may take at once.
pub(super) const LONGEST: u64 = 1 << 30;

/// Calling conventions of the host.
pub(super) struct Conventions {
    /// Signature of a function.
    pub own: Signature,
    /// Signature of what calls one instruction.
    pub of_call: Signature,
    pub frontend: TargetFrontendConfig,
}

/// The function of the region from an address on; none where that is nothing.
pub(super) fn function(conventions: Conventions, fields: &Fields, region: &Region) -> Option<Function> {
    let Conventions { own, of_call, frontend } = conventions;
    let entry = region.entry;
    if !region.holds(entry) || region.memory < LEAST {
        return None;
    }
    let mut function = Function::with_name_signature(UserFuncName::default(), own);
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
    let signature = b.import_signature(of_call);
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
    emitter.b.finalize(frontend);
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
    /// The block of a place; it is translated later.
    fn block_at(&mut self, place: Place) -> Block {
        let (b, waiting) = (&mut self.b, &mut self.waiting);
        *self.blocks.entry(place).or_insert_with(|| {
            waiting.push(place);
            b.create_block()
        })
    }

    /// Makes what was counted part of a variable.
    pub fn count(&mut self) {
        if self.pending != 0 {
            let (spent, pending) = (self.b.use_var(self.spent), self.pending as i64);
            let pending = self.b.ins().iconst(types::I64, pending);
            let spent = self.b.ins().iadd(spent, pending);
            self.b.def_var(self.spent, spent);
            self.pending = 0;
        }
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

    /// Cycles that an instruction counts.
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
            // The following instruction takes another time behind it.
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

    /// Translates what an instruction does; true where nothing follows it.
    pub fn translate(&mut self, instruction: Instruction, cost: u64, follows: Place) -> Option<bool> {
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

    /// Goes to where a register says, after something else; exceptions' returns and what is no Thumb code are left to
    /// be called.
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

/// Returns `true` if an instruction changes nothing but registers and flags, and never leaves the function for what
/// they are.
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
