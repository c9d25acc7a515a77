//! Copies the control interrupt's code into CCM SRAM; the first thing that the program does. Before that, clears the
//! stack.
//!
//! cortex-m-rt copies `.data` only, and its `pre_init` runs before the language's rules hold; this is ordinary code,
//! the first line of `main`. The linker (sections.x) places the code and lends the three symbols. memcpy lies there
//! too, so the copy is a loop of volatile writes, which the compiler does not turn into a call of it.

use core::arch::naked_asm;
use core::ptr::{addr_of, addr_of_mut};

unsafe extern "C" {
    static mut __ccm_start: u32;
    static __ccm_end: u32;
    static __ccm_load: u32;
    static _stack_start: u32;
    static _stack_end: u32;
}

/// Clears the stack, called by the startup code, which clears and loads the variables afterwards. Where the parity of
/// the SRAM is checked (option SRAM_PE), a word that was read before it was ever written would be a parity error
/// (RM0440, 2.4.2), and compilers read words of the stack that they have not written, where they copy a structure with
/// gaps. All boards' stacks are whole multiples of 8 bytes.
#[unsafe(no_mangle)]
#[unsafe(naked)]
unsafe extern "C" fn __pre_init() {
    naked_asm!(
        "ldr r0, ={lowest}",
        "ldr r1, ={highest}",
        "movs r2, #0",
        "movs r3, #0",
        "1:",
        "stmia r0!, {{r2, r3}}",
        "cmp r0, r1",
        "bne 1b",
        "bx lr",
        lowest = sym _stack_end,
        highest = sym _stack_start,
    )
}

/// Loads the code. Nothing in CCM SRAM may run before.
#[inline(always)]
pub fn load_control_code() {
    let (mut to, end, mut from) = (addr_of_mut!(__ccm_start), addr_of!(__ccm_end), addr_of!(__ccm_load));
    while to.cast_const() < end {
        // SAFETY: the linker gives a range of whole words in CCM SRAM and its image in flash; nothing else uses that
        // memory, and nothing runs from it yet.
        unsafe {
            to.write_volatile(from.read());
            to = to.add(1);
            from = from.add(1);
        }
    }
    // The copy is visible to instruction fetches from here on.
    cortex_m::asm::dsb();
    cortex_m::asm::isb();
}
