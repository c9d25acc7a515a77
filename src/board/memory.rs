//! Copies the control interrupt's code into CCM SRAM; the first thing that the program does.
//!
//! cortex-m-rt copies `.data` only, and its `pre_init` runs before the language's rules hold; this is ordinary code, the first line
//! of `main`. The linker (sections.x) places the code and lends the three symbols. memcpy lies there too, so the
//! copy is a loop of volatile writes, which the compiler does not turn into a call of it.

use core::ptr::{addr_of, addr_of_mut};

unsafe extern "C" {
    static mut __ccm_start: u32;
    static __ccm_end: u32;
    static __ccm_load: u32;
}

/// Loads the code. Nothing in CCM SRAM may run before.
#[inline(always)]
pub fn load_control_code() {
    let (mut to, end, mut from) = (addr_of_mut!(__ccm_start), addr_of!(__ccm_end), addr_of!(__ccm_load));
    while to.cast_const() < end {
        // SAFETY: the linker gives a range of whole words in CCM SRAM and its image in flash; nothing else uses that memory, and
        // nothing runs from it yet.
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
