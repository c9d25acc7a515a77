//! Durations, in cycles of the core: the published timings, and what this model assumes beyond them.
//!
//! Sources: Cortex-M4 Technical Reference Manual (Arm 100166), 3.3.1 (instructions), 3.3.2 (loads and stores), 7.2.3
//! (floating point) and 5 (exceptions). Assumed:
//! - Data-processing and multiply instructions take 1 cycle, integer multiply-accumulates included.
//! - A load takes 2 cycles, 1 right behind another single load or store, whatever the registers; a store takes 1: the
//!   write buffer hides the rest. Loads and stores of several registers take one cycle more than there are registers.
//! - A branch that is taken takes 2 cycles more (1 to 3 are published), the same for every kind of branch.
//! - A division takes 12 cycles, the longest of the published 2 to 12: the rule by which it ends early is not
//!   published.
//! - An instruction that an IT block skips takes 1 cycle; IT itself takes 1, it is never folded into its neighbour.
//! - Fetching in sequence costs no wait states: the flash's prefetch is taken to keep up. A taken branch costs those of
//!   its target once, a load costs those of its address each time: the accelerator's caches (RM0440, 3.3.5) are taken
//!   to miss always. With `chip::Waiting` it is otherwise: without wait states at all, or with those of each line of
//!   code also in sequence, which bounds what there can be (a load from flash is taken to leave the line that code is
//!   fetched from). Where code lies in CCM SRAM, which has none, none of this matters.
//! - SRAM from 0x2000_0000 to 0x3fff_ffff has no wait states and no contention with DMA; devices have those that the
//!   bus states.
//! - A barrier, CPS, MRS and MSR take what TRM 3.3.1 gives as least: nothing outstanding is modelled that they could
//!   wait for.
//! - Instructions are never interrupted half-way: a load of several registers or a division completes first. A store
//!   that nothing answers faults at its own instruction; the write buffer of the hardware may report it later.
//! - Waking from sleep takes no time by itself.

/// A taken branch beyond its own cycle: refilling the pipeline.
pub(super) const REFILL: u64 = 2;
/// Cycles from an interrupt to the first instruction of its handler.
pub(super) const ENTRY: u64 = 12;
/// The same from one handler to the next, without unstacking between.
pub(super) const TAIL_CHAIN: u64 = 6;
/// Cycles from a handler back to what it interrupted.
pub(super) const RETURN: u64 = 10;
/// Seventeen floating-point words to or from the stack: at entry, at return, or at the first use of the unit in a
/// handler.
pub(super) const FLOATING_POINT_FRAME: u64 = 17;
/// SDIV and UDIV.
pub(super) const DIVISION: u32 = 12;
/// VDIV and VSQRT.
pub(super) const FLOATING_POINT_DIVISION: u32 = 14;
/// VMLA, VFMA and their like.
pub(super) const FLOATING_POINT_MULTIPLY_ACCUMULATE: u32 = 3;
/// Registers that go between memory and core, several with one instruction.
pub(super) const fn several(registers: u32) -> u32 {
    registers + 1
}
