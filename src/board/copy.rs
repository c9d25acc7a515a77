//! Copying and clearing whole words, from CCM SRAM; any context, the control interrupt among them.
//!
//! The compiler calls these by their names of the ARM run-time ABI (RTABI, 4.3.4) wherever it moves a struct. The
//! library's own are made for speed at any size and take 2.6 KiB, a quarter of the smaller chip's CCM SRAM; its symbols
//! are weak, so these take their place in the whole program. Where the name has a 4 or an 8, source and destination are
//! aligned to words, as it promises; the others, which move bytes of frames and images in tasks, go byte by byte.

use core::arch::naked_asm;

/// Forward, four words at a time.
#[unsafe(no_mangle)]
#[unsafe(naked)]
#[unsafe(link_section = ".ccm.copy")]
unsafe extern "C" fn __aeabi_memcpy4(to: *mut u8, from: *const u8, bytes: usize) {
    naked_asm!(
        "push {{r4, r5, r6, lr}}",
        "b 2f",
        "1:",
        "ldmia r1!, {{r3, r4, r5, r6}}",
        "stmia r0!, {{r3, r4, r5, r6}}",
        "2:",
        "subs r2, #16",
        "bhs 1b",
        "adds r2, #12",
        "bmi 4f",
        "3:",
        "ldr r3, [r1], #4",
        "str r3, [r0], #4",
        "subs r2, #4",
        "bpl 3b",
        "4:",
        "adds r2, #4",
        "beq 6f",
        "5:",
        "ldrb r3, [r1], #1",
        "strb r3, [r0], #1",
        "subs r2, #1",
        "bne 5b",
        "6:",
        "pop {{r4, r5, r6, pc}}",
    )
}

#[unsafe(no_mangle)]
#[unsafe(naked)]
#[unsafe(link_section = ".ccm.copy")]
unsafe extern "C" fn __aeabi_memcpy8(to: *mut u8, from: *const u8, bytes: usize) {
    naked_asm!("b {copy}", copy = sym __aeabi_memcpy4)
}

/// Backward, where source and destination overlap that way.
#[unsafe(no_mangle)]
#[unsafe(naked)]
#[unsafe(link_section = ".ccm.copy")]
unsafe extern "C" fn __aeabi_memmove4(to: *mut u8, from: *const u8, bytes: usize) {
    naked_asm!(
        "subs r3, r0, r1",
        "cmp r3, r2",
        "blo 1f",
        "b {copy}",
        "1:",
        "cbz r2, 3f",
        "2:",
        "subs r2, #1",
        "ldrb r3, [r1, r2]",
        "strb r3, [r0, r2]",
        "bne 2b",
        "3:",
        "bx lr",
        copy = sym __aeabi_memcpy4,
    )
}

#[unsafe(no_mangle)]
#[unsafe(naked)]
#[unsafe(link_section = ".ccm.copy")]
unsafe extern "C" fn __aeabi_memmove8(to: *mut u8, from: *const u8, bytes: usize) {
    naked_asm!("b {copy}", copy = sym __aeabi_memmove4)
}

/// Zeros, four words at a time.
#[unsafe(no_mangle)]
#[unsafe(naked)]
#[unsafe(link_section = ".ccm.copy")]
unsafe extern "C" fn __aeabi_memclr4(to: *mut u8, bytes: usize) {
    naked_asm!(
        "movs r2, #0",
        "movs r3, #0",
        "b 2f",
        "1:",
        "stmia r0!, {{r2, r3}}",
        "stmia r0!, {{r2, r3}}",
        "2:",
        "subs r1, #16",
        "bhs 1b",
        "adds r1, #12",
        "bmi 4f",
        "3:",
        "str r3, [r0], #4",
        "subs r1, #4",
        "bpl 3b",
        "4:",
        "adds r1, #4",
        "beq 6f",
        "5:",
        "strb r3, [r0], #1",
        "subs r1, #1",
        "bne 5b",
        "6:",
        "bx lr",
    )
}

#[unsafe(no_mangle)]
#[unsafe(naked)]
#[unsafe(link_section = ".ccm.copy")]
unsafe extern "C" fn __aeabi_memclr8(to: *mut u8, bytes: usize) {
    naked_asm!("b {clear}", clear = sym __aeabi_memclr4)
}

/// Bytes, forward.
#[unsafe(no_mangle)]
#[unsafe(naked)]
unsafe extern "C" fn __aeabi_memcpy(to: *mut u8, from: *const u8, bytes: usize) {
    naked_asm!("b 2f", "1:", "ldrb r3, [r1], #1", "strb r3, [r0], #1", "2:", "subs r2, #1", "bhs 1b", "bx lr",)
}

/// Zeros, byte by byte.
#[unsafe(no_mangle)]
#[unsafe(naked)]
unsafe extern "C" fn __aeabi_memclr(to: *mut u8, bytes: usize) {
    naked_asm!("movs r3, #0", "b 2f", "1:", "strb r3, [r0], #1", "2:", "subs r1, #1", "bhs 1b", "bx lr")
}
