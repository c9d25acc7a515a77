//! The division of 64-bit numbers, bit by bit; any context.
//!
//! The compiler's own takes 1 KB of flash and a tenth of the time. On the board whose flash is nearly full, a few are
//! divided for each configuration and image, and the time in milliseconds; the control interrupt divides none.

/// The quotient of two unsigned numbers in r0 and r1, and what is left in r2 and r3: the run-time ABI's name (RTABI32,
/// 5.3.2), which the linker prefers to the compiler's own. By zero the quotient is all ones; the language checks
/// before. Some 700 cycles.
#[unsafe(no_mangle)]
#[unsafe(naked)]
unsafe extern "C" fn __aeabi_uldivmod() {
    core::arch::naked_asm!(
        "push {{r4, r5, r6, r7, r8, lr}}",
        "movs r4, #0",
        "movs r5, #0",
        "mov.w r8, #64",
        // The dividend's highest bit goes into what is left, and the quotient's next one takes its place at the other
        // end.
        "2:",
        "adds r0, r0, r0",
        "adcs r1, r1",
        "adcs r4, r4",
        "adcs r5, r5",
        // A 65th bit: it is larger than any divisor.
        "bcs 3f",
        "subs r6, r4, r2",
        "sbcs.w r7, r5, r3",
        "bcc 4f",
        "mov r4, r6",
        "mov r5, r7",
        "adds r0, #1",
        "4:",
        "subs.w r8, r8, #1",
        "bne 2b",
        "mov r2, r4",
        "mov r3, r5",
        "pop {{r4, r5, r6, r7, r8, pc}}",
        "3:",
        "subs r4, r4, r2",
        "sbcs.w r5, r5, r3",
        "adds r0, #1",
        "b 4b",
    )
}

/// The same of signed numbers: the quotient is rounded towards zero, what is left has the dividend's sign. The least
/// number over -1 is itself.
#[unsafe(no_mangle)]
#[unsafe(naked)]
unsafe extern "C" fn __aeabi_ldivmod() {
    core::arch::naked_asm!(
        "push {{r4, r5, r6, lr}}",
        "mov r5, r1",
        "eor r4, r1, r3",
        "cmp r1, #0",
        "bpl 2f",
        "rsbs r0, r0, #0",
        "sbc.w r1, r1, r1, lsl #1",
        "2:",
        "cmp r3, #0",
        "bpl 3f",
        "rsbs r2, r2, #0",
        "sbc.w r3, r3, r3, lsl #1",
        "3:",
        "bl {unsigned}",
        "cmp r4, #0",
        "bpl 4f",
        "rsbs r0, r0, #0",
        "sbc.w r1, r1, r1, lsl #1",
        "4:",
        "cmp r5, #0",
        "bpl 5f",
        "rsbs r2, r2, #0",
        "sbc.w r3, r3, r3, lsl #1",
        "5:",
        "pop {{r4, r5, r6, pc}}",
        unsigned = sym __aeabi_uldivmod,
    )
}
