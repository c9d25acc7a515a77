//! Centre-aligned PWM: duties into compare values, and when they take effect; control interrupt.
//!
//! The counter runs from 0 up to half a period and back. The low sides conduct around the top: there the currents are
//! sampled, and a control step begins. Its duties act from the next top on, a whole period after the sample, and in the
//! middle one and a half periods after it, which is what the current loop counts on (`motor::current::DELAY_PERIODS`).
//!
//! The delay must not depend on how long the step took. The timer loads compare values at the bottom as well as at the
//! top, and the moteus r4's has no repetition counter to change that. So a step only [holds](hold) its duties, and the
//! timer's update interrupt, of the same priority, writes them while the counter runs up: at the bottom, or at the end
//! of a step that took longer than that. Loading is held while the three are written, so that a period never has the
//! duties of two steps.

use core::sync::atomic::{AtomicU16, Ordering};
use joint_firmware::motor::modulation::compare_value;
use joint_firmware::motor::phases::Phases;

/// Clock of the timers, Hz.
pub const TIMER_HZ: u32 = 170_000_000;

/// Compare values of the next period.
static HELD: [AtomicU16; 3] = [const { AtomicU16::new(0) }; 3];

/// Top of the counter for a PWM frequency in Hz.
pub const fn top(frequency: u32) -> u16 {
    (TIMER_HZ / (2 * frequency)) as u16
}

/// Holds duties for the period after the next top; the largest duty leaves the low side on long
/// enough for the current to settle and be sampled.
#[inline(always)]
pub fn hold(duties: Phases, top: u16, largest_duty: f32) {
    let compare = |duty| compare_value(duty, top, largest_duty);
    let [a, b, c] = &HELD;
    a.store(compare(duties.a), Ordering::Relaxed);
    b.store(compare(duties.b), Ordering::Relaxed);
    c.store(compare(duties.c), Ordering::Relaxed);
}

/// The compare values that are held.
#[inline(always)]
pub fn held() -> [u16; 3] {
    let [a, b, c] = &HELD;
    [a.load(Ordering::Relaxed), b.load(Ordering::Relaxed), c.load(Ordering::Relaxed)]
}
