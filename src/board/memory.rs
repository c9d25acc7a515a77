//! Copies the control interrupt's code into CCM SRAM; once, at start.
//!
//! cortex-m-rt copies `.data` only, and its `pre_init` runs before the language's rules hold. This copy needs neither: it runs
//! in ordinary code, before the one interrupt that uses the copy is enabled. The linker (sections.x) places the code and
//! lends the three symbols.

use core::ptr::{addr_of, addr_of_mut, copy_nonoverlapping};

unsafe extern "C" {
    static mut __ccm_start: u32;
    static __ccm_end: u32;
    static __ccm_load: u32;
}

/// Loads the code. Nothing in CCM SRAM may run before.
pub fn load_control_code() {
    // SAFETY: the linker gives a range of whole words in CCM SRAM and its image in flash; nothing else uses that memory, and
    // nothing runs from it yet. The barriers make the copy visible to instruction fetches.
    unsafe {
        let start = addr_of_mut!(__ccm_start);
        let words = (addr_of!(__ccm_end) as usize - start as usize) / size_of::<u32>();
        copy_nonoverlapping(addr_of!(__ccm_load), start, words);
    }
    cortex_m::asm::dsb();
    cortex_m::asm::isb();
}
