//! A decoded instruction: what to call, with which operands, how long it is and how long it takes.

use super::Cpu;
use crate::bus::Bus;

/// Reason for which an instruction did not complete.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Trap {
    /// The instruction is undefined by definition.
    Undefined,
    /// Thumb state was left.
    NotThumb,
    /// A return from an exception that does not hold together.
    Return,
    /// The floating-point unit is switched off.
    NoCoprocessor,
    /// An address that is not a multiple of the width, where it has to be.
    Unaligned,
    /// A division by zero, with the trap switched on.
    DivisionByZero,
    /// No answer to a load or a store; the address is in `Cpu::trapped_address`.
    Data,
    /// No answer to the fetch.
    Fetch,
    /// Code must not lie there.
    ExecuteNever,
    /// A supervisor call or a breakpoint that nothing can take.
    Escalated,
    /// The run ends; why is in `Cpu::end`.
    End,
}

/// Continuation after an instruction if not the one behind it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Leave {
    /// Jump: it has gone elsewhere, or begun an IT block: `Cpu::pc` and `Cpu::it` are to be looked at.
    Jumped,
    /// Trap: it did not complete.
    Trapped(Trap),
}

impl From<Trap> for Leave {
    fn from(trap: Trap) -> Self {
        Self::Trapped(trap)
    }
}

/// End of an instruction; nearly always with the one behind it as the next.
pub(super) type Done = Result<(), Leave>;

/// Fields of an encoding, or what decoding made of them.
#[derive(Clone, Copy, Default, PartialEq, Eq, Hash)]
pub(super) struct Operands {
    /// Constant, offset, list of registers, absolute address.
    pub immediate: u32,
    /// Destination, in the lower bits.
    pub d: u8,
    /// First operand, or base address.
    pub n: u8,
    /// Second operand.
    pub m: u8,
    /// Another operand: a fourth register, a condition, a position.
    pub x: u8,
}

/// Bit of `d`, whose lower bits number a register: the instruction is in an IT block.
const IN_BLOCK: u8 = 0x80;

impl Operands {
    /// The same in an IT block, where some instructions set no flags.
    pub fn in_block(mut self) -> Self {
        self.d |= IN_BLOCK;
        self
    }

    #[inline(always)]
    pub fn is_in_block(self) -> bool {
        self.d & IN_BLOCK != 0
    }
}

/// Executes an instruction, and what follows it in its stretch.
pub(super) type Execute<B> = fn(&mut Cpu<B>, Operands, Rest<B>) -> Done;

/// Steps that follow an instruction in its stretch (see `stretch`); nothing where it is executed by itself.
pub(super) type Rest<'a, B> = &'a [Step<B>];

/// An instruction of a stretch.
pub(super) struct Step<B: Bus> {
    pub execute: Execute<B>,
    pub operands: Operands,
}

// Not derived: that would ask the same of the bus.
impl<B: Bus> Clone for Step<B> {
    fn clone(&self) -> Self {
        Self { execute: self.execute, operands: self.operands }
    }
}

/// The state of an IT block behind an instruction (ITAdvance).
pub(super) const fn behind(block: u8) -> u8 {
    if block & 7 == 0 { 0 } else { block & 0xe0 | block << 1 & 0x1f }
}

/// A decoded instruction.
pub(super) struct Operation<B: Bus> {
    pub execute: Execute<B>,
    pub operands: Operands,
    pub timing: Timing,
    pub action: Action,
}

/// Length of an instruction, and its time.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct Timing {
    /// Bytes; 0 for what is not decoded yet.
    pub length: u8,
    /// Cycles without wait states, branch and pipelining.
    pub cycles: u8,
    /// `true` if it loads or stores one register, and the cycles that it saves behind another that does (see `timing`).
    pub single: bool,
    pub overlaps: u8,
    pub flow: Flow,
    pub part: Part,
}

/// Role that an instruction can have in a pair that is executed at once (see `execute::pairs`).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Part {
    None,
    /// CMP of n with a constant, with register m; SUBS of a constant, outside of IT blocks.
    CompareConstant,
    CompareRegister,
    SubtractConstant,
    /// A branch by condition x; CBZ and CBNZ.
    Branch,
    BranchIfZero,
    /// MOVW, and MOV of a constant that sets no flags; MOVS, which sets none in an IT block; MOV of register m; MOVT.
    Constant,
    NarrowConstant,
    Register,
    UpperHalf,
    /// ADD of a constant that sets no flags.
    AddConstant,
    /// A load and a store of a word at n and a constant; the same of the floating-point unit.
    Load,
    Store,
    LoadFloat,
    StoreFloat,
    /// PUSH.
    Push,
    /// VMOV of registers; VADD; VMUL; VCMP; VMRS of the flags.
    Float,
    AddFloats,
    MultiplyFloats,
    CompareFloats,
    TakeFlags,
    /// A barrier.
    Nothing,
}

/// Action of an instruction, as far as it can be translated (see `translation`); the fields are those that its function
/// is chosen by.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Action {
    /// Is always called.
    Other,
    /// A barrier; IT.
    Nothing,
    Data {
        operation: u8,
        second: u8,
        flags: u8,
    },
    Shift {
        kind: u8,
        flags: u8,
    },
    ShiftByRegister {
        kind: u8,
        flags: u8,
    },
    Add,
    Constant,
    UpperHalf,
    Extract {
        signed: bool,
    },
    Insert,
    Extend {
        kind: u8,
    },
    CountZeros,
    Multiply,
    MultiplySubtract,
    MultiplyHigh,
    MultiplyLong {
        signed: bool,
        accumulates: bool,
    },
    Divide {
        signed: bool,
    },
    Access {
        what: u8,
        address: u8,
    },
    Several {
        load: bool,
    },
    Pair {
        load: bool,
    },
    PairAt,
    LoadExclusive {
        bytes: u8,
    },
    StoreExclusive {
        bytes: u8,
    },
    Branch,
    BranchIf,
    BranchIfZero,
    Call,
    BranchToRegister {
        link: bool,
    },
    Floats {
        operation: u8,
    },
    FloatConstant,
    MoveFloat,
    CompareFloats,
    TakeFlags,
    MoveToOrFromFloat {
        load: bool,
    },
    Float {
        load: bool,
    },
    SeveralFloats {
        load: bool,
    },
    ToFixed,
    FromFixed,
}

/// Flow behind an instruction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Flow {
    /// The one behind it.
    On,
    /// A branch may be taken.
    Perhaps,
    /// Another flow.
    Elsewhere,
    /// An IT block, whose state is `x`.
    Block,
}

// Not derived: that would ask the same of the bus.
impl<B: Bus> Clone for Operation<B> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<B: Bus> Copy for Operation<B> {}

impl<B: Bus> Operation<B> {
    /// One cycle, no operands; the length is filled in by `decode`.
    pub fn new(execute: Execute<B>) -> Self {
        let timing = Timing { length: 0, cycles: 1, single: false, overlaps: 0, flow: Flow::On, part: Part::None };
        Self { execute, operands: Operands::default(), timing, action: Action::Other }
    }

    pub fn d(mut self, register: u32) -> Self {
        self.operands.d = register as u8;
        self
    }

    pub fn n(mut self, register: u32) -> Self {
        self.operands.n = register as u8;
        self
    }

    pub fn m(mut self, register: u32) -> Self {
        self.operands.m = register as u8;
        self
    }

    pub fn x(mut self, value: u32) -> Self {
        self.operands.x = value as u8;
        self
    }

    pub fn immediate(mut self, value: u32) -> Self {
        self.operands.immediate = value;
        self
    }

    pub fn length(mut self, bytes: u8) -> Self {
        self.timing.length = bytes;
        self
    }

    pub fn flow(mut self, flow: Flow) -> Self {
        self.timing.flow = flow;
        self
    }

    pub fn part(mut self, part: Part) -> Self {
        self.timing.part = part;
        self
    }

    /// Sets its action, which it is called for otherwise.
    pub fn does(mut self, action: Action) -> Self {
        self.action = action;
        self
    }

    /// Goes elsewhere if register 15 is in a list.
    pub fn flow_by(self, list: u32) -> Self {
        if list >> 15 & 1 != 0 { self.flow(Flow::Elsewhere) } else { self }
    }

    pub fn cycles(mut self, cycles: u32) -> Self {
        self.timing.cycles = cycles as u8;
        self
    }

    /// Takes the cycles of a load or a store of one register.
    pub fn single(mut self, load: bool) -> Self {
        self.timing.single = true;
        self.timing.overlaps = u8::from(load);
        self.cycles(if load { 2 } else { 1 })
    }
}
