//! Critical sections that do not delay the control interrupt.
//!
//! The usual implementation masks every interrupt; the log alone would then hold the control interrupt up for
//! microseconds a line. This one raises BASEPRI to the second priority: only the control interrupt and the PWM timer's,
//! at the first, stay enabled. The price: these two must not use anything that a critical section protects (wakers,
//! channels, the log). They talk to the tasks through atomics.

use core::arch::asm;
use critical_section::RawRestoreState;

/// Priorities from this one on (in the four implemented, upper bits) are masked.
const MASKED: u32 = 1 << 4;

struct BelowControl;
critical_section::set_impl!(BelowControl);

// SAFETY: between acquire and release no interrupt runs that may enter a critical section: all but the control
// interrupt and the PWM timer's have a priority below the mask from before they are enabled (`entry`), and these two
// enter none. One core.
unsafe impl critical_section::Impl for BelowControl {
    // Functions of their own: there are some fifty sections.
    #[inline(never)]
    unsafe fn acquire() -> RawRestoreState {
        let before: u32;
        // SAFETY: reads and raises BASEPRI; without `nomem`, so no access moves out of the section.
        unsafe {
            asm!("mrs {0}, BASEPRI", "msr BASEPRI, {1}", "isb", out(reg) before, in(reg) MASKED, options(nostack))
        };
        before != 0
    }

    #[inline(never)]
    unsafe fn release(was_masked: RawRestoreState) {
        if !was_masked {
            // SAFETY: lowers BASEPRI to what it was before the outermost section.
            unsafe { asm!("msr BASEPRI, {0}", in(reg) 0, options(nostack)) };
        }
    }
}
