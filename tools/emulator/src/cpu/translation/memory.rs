//! Loads and stores where memory answers at once, and loads of words that do not change.

use super::emit::Emitter;
use super::{Action, Instruction, Word};
use crate::cpu::execute::load_store::{
    ABSOLUTE, AFTER, BEFORE, BELOW, CHANGES, INDEXED, LDR, LDRH, LDRSB, LDRSH, OFFSET, PRE, STR, STRH, loads,
};
use crate::cpu::operation::Operands;
use cranelift_codegen::ir::condcodes::IntCC;
use cranelift_codegen::ir::{InstBuilder, Type, Value, types};

/// Address at which it begins.
const SRAM: u32 = 0x2000_0000;

impl Emitter<'_, '_> {
    /// Cycles that an instruction takes more because of where it loads from.
    pub fn waits(&self, instruction: &Instruction) -> u64 {
        match instruction.word {
            Word::Constant { waits, .. } => waits.into(),
            _ => 0,
        }
    }

    /// Translation of an instruction that loads, stores or concerns floating point.
    pub fn memory_or_float(&mut self, instruction: Instruction) -> Option<()> {
        let o = instruction.operands;
        match instruction.action {
            Action::Access { what, address } => self.access(instruction, what, address),
            Action::Several { load: true } => self.load_several(o, None),
            Action::Several { load: false } => self.store_several(o),
            Action::Pair { load } => self.pair(o, load),
            Action::PairAt => {
                let at = self.constant(o.immediate);
                let at = self.checked(at, 4, 2, false);
                let words = [0, 1].map(|i| self.load(types::I32, at, i));
                self.set(o.d, words[0]);
                self.set(o.m, words[1]);
            }
            Action::LoadExclusive { bytes } => {
                let address = self.address(o);
                let at = self.checked(address, bytes.into(), 1, false);
                let value = self.load_extended(bytes.into(), false, at);
                let own = self.flag(true);
                self.set_field(self.fields.exclusive, own);
                self.set(o.d, value);
            }
            Action::StoreExclusive { bytes } => {
                let address = self.address(o);
                let at = self.checked(address, bytes.into(), 1, true);
                // If the mark is gone nothing is stored, which is seldom.
                let own = self.field(types::I8, self.fields.exclusive);
                let no = self.flag(false);
                let lost = self.compare(IntCC::Equal, own, no);
                self.call_if(lost);
                self.set_field(self.fields.exclusive, no);
                let value = self.get(o.m);
                self.store_narrowed(bytes.into(), value, at);
                let done = self.constant(0);
                self.set(o.d, done);
            }
            _ => return self.floating_point(instruction),
        }
        Some(())
    }

    /// n and a constant.
    fn address(&mut self, o: Operands) -> Value {
        let (n, offset) = (self.get(o.n), self.constant(o.immediate));
        self.b.ins().iadd(n, offset)
    }

    /// One register.
    fn access(&mut self, instruction: Instruction, what: u8, address: u8) {
        let o = instruction.operands;
        if let Some(value) = self.known(&instruction) {
            return self.set(o.d, value);
        }
        let (from, changed) = match address {
            OFFSET => (self.address(o), None),
            INDEXED => {
                let (n, m, by) = (self.get(o.n), self.get(o.m), self.constant(o.immediate & 3));
                let m = self.b.ins().ishl(m, by);
                (self.b.ins().iadd(n, m), None)
            }
            ABSOLUTE => (self.constant(o.immediate), None),
            BEFORE => {
                let address = self.address(o);
                (address, Some(address))
            }
            _ => (self.get(o.n), Some(self.address(o))),
        };
        debug_assert!(address <= AFTER);
        let bytes = match what {
            STR | LDR => 4,
            STRH | LDRH | LDRSH => 2,
            _ => 1,
        };
        let at = match self.fixed(&instruction) {
            Some(at) => at,
            None => self.checked(from, bytes, 1, !loads(what)),
        };
        if loads(what) {
            let value = self.load_extended(bytes, matches!(what, LDRSB | LDRSH), at);
            self.set(o.d, value);
        } else {
            let value = self.get(o.d);
            self.store_narrowed(bytes, value, at);
        }
        if let Some(changed) = changed {
            self.set(o.n, changed);
        }
    }

    /// A word that is loaded from where it does not change.
    pub fn known(&mut self, instruction: &Instruction) -> Option<Value> {
        match instruction.word {
            Word::Constant { value, .. } => Some(self.constant(value)),
            _ => None,
        }
    }

    /// Address in memory from which a word is loaded, if that is known.
    pub fn fixed(&mut self, instruction: &Instruction) -> Option<Value> {
        let Word::Memory(place) = instruction.word else { return None };
        let (memory, place) = (self.memory, self.b.ins().iconst(types::I64, place as i64));
        Some(self.b.ins().iadd(memory, place))
    }

    /// Address in the host's memory of values of `bytes` bytes, so many of them, which have to be a multiple of those.
    /// The function is left if they do not, or lie elsewhere, or are code that is stored to.
    pub fn checked(&mut self, address: Value, bytes: u32, values: u32, stores: bool) -> Value {
        let start = self.constant(SRAM);
        let offset = self.b.ins().isub(address, start);
        // An offset that is no multiple of a word is behind the end when its lowest bits are its highest.
        let mut unusual = match bytes {
            4 => {
                let two = self.constant(2);
                let place = self.b.ins().rotr(offset, two);
                let last = self.constant((self.region.memory - 4 * values) / 4);
                self.compare(IntCC::UnsignedGreaterThan, place, last)
            }
            _ => {
                let last = self.constant(self.region.memory - bytes);
                let behind = self.compare(IntCC::UnsignedGreaterThan, offset, last);
                let (mask, zero) = (self.constant(bytes - 1), self.constant(0));
                let low = self.b.ins().band(address, mask);
                let odd = self.compare(IntCC::NotEqual, low, zero);
                if bytes == 1 { behind } else { self.b.ins().bor(behind, odd) }
            }
        };
        let code = self.region.changeable.clone();
        if stores && !code.is_empty() {
            // First address from which something that is stored reaches into it.
            let first = self.constant(code.start.wrapping_sub(4 * (values - 1)));
            let length = self.constant(code.end - code.start + 4 * (values - 1));
            let into = self.b.ins().isub(address, first);
            let changes = self.compare(IntCC::UnsignedLessThan, into, length);
            unusual = self.b.ins().bor(unusual, changes);
        }
        self.call_if(unusual);
        let (offset, memory) = (self.b.ins().uextend(types::I64, offset), self.memory);
        self.b.ins().iadd(memory, offset)
    }

    /// The `i`th word from somewhere on.
    pub fn load(&mut self, kind: Type, at: Value, i: u32) -> Value {
        let data = self.data;
        self.b.ins().load(kind, data, at, Self::offset(4 * i))
    }

    pub fn store(&mut self, value: Value, at: Value, i: u32) {
        let data = self.data;
        self.b.ins().store(data, value, at, Self::offset(4 * i));
    }

    fn load_extended(&mut self, bytes: u32, signed: bool, at: Value) -> Value {
        let data = self.data;
        match (bytes, signed) {
            (4, _) => self.load(types::I32, at, 0),
            (2, false) => self.b.ins().uload16(types::I32, data, at, 0),
            (2, true) => self.b.ins().sload16(types::I32, data, at, 0),
            (_, false) => self.b.ins().uload8(types::I32, data, at, 0),
            (_, true) => self.b.ins().sload8(types::I32, data, at, 0),
        }
    }

    fn store_narrowed(&mut self, bytes: u32, value: Value, at: Value) {
        let data = self.data;
        match bytes {
            4 => self.store(value, at, 0),
            2 => {
                self.b.ins().istore16(data, value, at, 0);
            }
            _ => {
                self.b.ins().istore8(data, value, at, 0);
            }
        }
    }

    /// Lowest address of a block of words, and what the base becomes.
    pub fn block_of(&mut self, n: u8, words: u32, x: u8) -> (Value, Value) {
        let (base, bytes) = (self.get(n), self.constant(4 * words));
        match u32::from(x) & BELOW {
            0 => (base, self.b.ins().iadd(base, bytes)),
            _ => {
                let start = self.b.ins().isub(base, bytes);
                (start, start)
            }
        }
    }

    /// LDM, POP; where the program counter is loaded, with what the instruction counts.
    pub fn load_several(&mut self, o: Operands, jumps: Option<u64>) {
        let words = o.immediate.count_ones();
        let (start, changed) = self.block_of(o.n, words, o.x);
        let at = self.checked(start, 4, words, false);
        let list = (0..16u8).filter(|register| o.immediate >> register & 1 != 0).zip(0..);
        let loaded: Vec<_> = list.map(|(register, i)| (register, self.load(types::I32, at, i))).collect();
        let changes = u32::from(o.x) & CHANGES != 0;
        let set = |emitter: &mut Self| {
            if changes {
                emitter.set(o.n, changed);
            }
            for (register, value) in &loaded {
                emitter.set(*register, *value);
            }
        };
        match (jumps, loaded.last()) {
            (Some(cost), Some((15, target))) => self.branch_to(*target, cost, set),
            _ => set(self),
        }
    }

    /// STM, PUSH.
    fn store_several(&mut self, o: Operands) {
        let words = o.immediate.count_ones();
        let (start, changed) = self.block_of(o.n, words, o.x);
        let at = self.checked(start, 4, words, true);
        for (register, i) in (0..16u8).filter(|register| o.immediate >> register & 1 != 0).zip(0..) {
            let value = self.get(register);
            self.store(value, at, i);
        }
        if u32::from(o.x) & CHANGES != 0 {
            self.set(o.n, changed);
        }
    }

    /// LDRD, STRD.
    fn pair(&mut self, o: Operands, load: bool) {
        let changed = self.address(o);
        let from = if u32::from(o.x) & PRE != 0 { changed } else { self.get(o.n) };
        let at = self.checked(from, 4, 2, !load);
        let words = match load {
            true => Some([0, 1].map(|i| self.load(types::I32, at, i))),
            false => {
                for (register, i) in [(o.d, 0), (o.m, 1)] {
                    let value = self.get(register);
                    self.store(value, at, i);
                }
                None
            }
        };
        if u32::from(o.x) & CHANGES != 0 {
            self.set(o.n, changed);
        }
        if let Some([first, second]) = words {
            self.set(o.d, first);
            self.set(o.m, second);
        }
    }
}

/// The address that an instruction loads a word from, if decoding knows it.
pub(super) fn absolute(action: Action, o: Operands) -> Option<u32> {
    let address = match action {
        Action::Access { what: LDR, address: ABSOLUTE } => Some(o.immediate),
        Action::Float { load: true } if o.n == 15 && o.x == 1 => Some(o.immediate),
        _ => None,
    };
    address.filter(|address| address.is_multiple_of(4))
}
