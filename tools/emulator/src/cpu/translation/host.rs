//! The host's side: from Cranelift's intermediate language to memory that can be executed.
//!
//! Cranelift compiles for x86-64 and AArch64 alike; on other hosts nothing is translated.

use super::emit::{self, Conventions, LONGEST};
use super::region::Region;
use super::{Fields, Left};
use crate::bus::Bus;
use crate::cpu::Cpu;
use cranelift_codegen::Context;
use cranelift_codegen::control::ControlPlane;
use cranelift_codegen::ir::{AbiParam, Signature, types};
use cranelift_codegen::isa::{CallConv, OwnedTargetIsa};
use cranelift_codegen::settings::{self, Configurable};
use memmap2::{Mmap, MmapMut};
use std::collections::HashMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Bytes of a line and of a page of the host's memory, as they usually are.
const LINE: usize = 64;
const PAGE: usize = 4096;

/// Number of functions that are kept for other cores, 40 MB.
const KEPT: usize = 4096;

/// Compiler of functions.
pub(in crate::cpu) struct Compiler {
    pub isa: OwnedTargetIsa,
    compiled: Mutex<HashMap<(Fields, Region), Option<Function>>>,
}

impl Compiler {
    /// None where the host has none.
    fn new() -> Option<Self> {
        let mut flags = settings::builder();
        flags.set("opt_level", "speed").ok()?;
        flags.set("enable_verifier", if cfg!(debug_assertions) { "true" } else { "false" }).ok()?;
        let builder = cranelift_native::builder().ok()?;
        let isa = builder.finish(settings::Flags::new(flags)).ok()?;
        (isa.pointer_type() == types::I64).then_some(Self { isa, compiled: Mutex::default() })
    }

    /// Core, and memory; why it was left.
    pub fn signature(&self) -> Signature {
        let mut signature = Signature::new(CallConv::triple_default(self.isa.triple()));
        signature.params.extend([types::I64; 2].map(AbiParam::new));
        signature.returns.push(AbiParam::new(types::I32));
        signature
    }

    /// Signature of what calls an instruction: see `call_one`.
    pub fn signature_of_call(&self) -> Signature {
        let mut signature = Signature::new(CallConv::triple_default(self.isa.triple()));
        let kinds = [types::I64, types::I64, types::I32, types::I32, types::I32, types::I32];
        signature.params.extend(kinds.map(AbiParam::new));
        signature.returns.push(AbiParam::new(types::I32));
        signature
    }

    /// Compiler of this host, once for all cores.
    pub fn of_host() -> Option<&'static Self> {
        static COMPILER: OnceLock<Option<Compiler>> = OnceLock::new();
        COMPILER.get_or_init(Self::new).as_ref()
    }

    /// A region; none where it cannot be compiled. What another core has compiled is not compiled again.
    pub fn compile(&self, fields: &Fields, region: Region) -> Option<Function> {
        let key = (fields.clone(), region);
        let mut compiled = self.compiled.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(function) = compiled.get(&key) {
            return function.clone();
        }
        let function = self.compile_anew(fields, &key.1);
        if compiled.len() >= KEPT {
            compiled.clear();
        }
        compiled.insert(key, function.clone());
        function
    }

    fn compile_anew(&self, fields: &Fields, region: &Region) -> Option<Function> {
        let (own, of_call) = (self.signature(), self.signature_of_call());
        let conventions = Conventions { own, of_call, frontend: self.isa.frontend_config() };
        let mut context = Context::for_function(emit::function(conventions, fields, region)?);
        let compiled = context.compile(&*self.isa, &mut ControlPlane::default()).ok()?;
        // No calls, and constants lie with the code: it can lie anywhere.
        if !compiled.buffer.relocs().is_empty() {
            return None;
        }
        let code = compiled.code_buffer();
        // Functions that all began with a page would compete for the same lines of the host's cache.
        let start = (region.entry as usize).wrapping_mul(LINE / 2) % PAGE;
        let mut memory = MmapMut::map_anon(start + code.len()).ok()?;
        memory.get_mut(start..)?.copy_from_slice(code);
        let code = Arc::new(memory.make_exec().ok()?);
        Some(Function { begin: code.get(start..)?.as_ptr(), _code: code, memory: region.memory })
    }
}

/// Executes one instruction, which lies at `address`, for a function that has counted `spent` so far. `how` has what is
/// known of the core: whether the instruction before loaded or stored one register, IT state, IT state behind it. The
/// cycles up to which what is translated may go on; 0 where the function is to be left, with the core as it is: what
/// follows does not lie at `next`, something has changed, or something is due before more than the `remaining` cycles.
pub(super) extern "C" fn call_one<B: Bus>(
    cpu: *mut Cpu<B>,
    spent: u64,
    address: u32,
    next: u32,
    how: u32,
    remaining: u32,
) -> u32 {
    // SAFETY: only translated functions call this, with the core that `Function::run` was given, which nothing else
    // uses meanwhile.
    let cpu = unsafe { &mut *cpu };
    cpu.now = cpu.now.wrapping_add(spent & 0xffff_ffff);
    cpu.instructions = cpu.instructions.wrapping_add(spent >> 32);
    (cpu.pc, cpu.single, cpu.it) = (address, how & 1 != 0, (how >> 8) as u8);
    if !cpu.code.holds(address) {
        cpu.code.enter(address);
    }
    let memory = cpu.bus.memory().as_ptr_range();
    cpu.instruct::<false>();
    let room = cpu.attention.saturating_sub(cpu.now).min(LONGEST) as u32;
    let same = cpu.pc == next && cpu.it == (how >> 16) as u8 && cpu.bus.memory().as_ptr_range() == memory;
    if same && room > remaining && !cpu.code.translations.is_unsettled() { room } else { 0 }
}

/// A function that the host can call.
#[derive(Clone)]
pub(in crate::cpu) struct Function {
    /// Begin of the function, in what is kept for it.
    begin: *const u8,
    _code: Arc<Mmap>,
    /// Bytes of memory that it was compiled for.
    memory: u32,
}

// SAFETY: what it points to lives as long as `_code`, and is never written.
unsafe impl Send for Function {}
// SAFETY: as above.
unsafe impl Sync for Function {}

impl Function {
    /// Runs it, for as long as the core and the memory are what it was compiled for.
    #[inline(always)]
    pub fn run<B: Bus>(&self, cpu: &mut Cpu<B>) -> Left {
        type Translated<B> = unsafe extern "C" fn(*mut Cpu<B>, *mut u8) -> u32;
        let memory = cpu.bus.memory();
        if memory.len() != self.memory as usize {
            return Left::Call;
        }
        let start = memory.as_mut_ptr();
        // SAFETY: the mapping holds a whole function with this signature, which the compiler made of `emit::function`,
        // and lives for as long as `self`. It reads and writes fields of the core, at the offsets that the
        // compiler of this program gives, and of memory only what lies within the length that it was compiled
        // for, which it has: each access is checked before. Both are borrowed for the call alone.
        let left = unsafe {
            let function = std::mem::transmute::<*const u8, Translated<B>>(self.begin);
            function(cpu, start)
        };
        match left {
            0 => Left::Jumped,
            1 => Left::Branched,
            _ => Left::Call,
        }
    }
}
