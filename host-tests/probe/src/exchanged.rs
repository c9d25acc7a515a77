// Memory that whoever emulates the core reads and writes while the program waits at a breakpoint. Included by the
// programs that have some.

use core::cell::UnsafeCell;

/// Memory that is written and read from outside while the program waits.
#[repr(transparent)]
pub struct Exchanged<T>(UnsafeCell<T>);
// SAFETY: there is one thread; from outside it is used only while that waits at a breakpoint.
unsafe impl<T> Sync for Exchanged<T> {}

impl<T> Exchanged<T> {
    pub const fn new(value: T) -> Self {
        Self(UnsafeCell::new(value))
    }

    pub fn get(&self) -> &T {
        // SAFETY: no reference outlives the next breakpoint, and `put` is not called while there is one.
        unsafe { &*self.0.get() }
    }

    pub fn put(&self, value: T) {
        // SAFETY: as for `get`.
        unsafe { self.0.get().write(value) }
    }
}

/// Waits until whoever emulates the core has written what comes next.
pub fn hand_over<const NUMBER: u32>(word: u32) {
    // SAFETY: a breakpoint; memory may be another one behind it, which an asm block implies.
    unsafe { core::arch::asm!("bkpt {number}", number = const NUMBER, in("r0") word, options(nostack)) }
}
