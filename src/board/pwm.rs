//! Centre-aligned PWM: duties into compare values, and when they take effect; control interrupt.
//!
//! The counter runs from 0 up to half a period and back. The low sides conduct around the top: there the currents are
//! sampled. Compare values are loaded at the bottom and at the top. A control step begins at the top; if it has written its
//! duties before the bottom they act from there on, half a period after the sample. Later they act from the next top,
//! a whole period after it: [`Timing::Late`], which the statistics count. Loading is held while the three are written, so that a
//! period never has the duties of two steps.

/// When the written duties take effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Timing {
    /// Half a period after the sample.
    Prompt,
    /// A whole period after the sample.
    Late,
}

/// Clock of the timers, Hz.
pub const TIMER_HZ: u32 = 170_000_000;

/// Top of the counter for a PWM frequency in Hz.
pub const fn top(frequency: u32) -> u16 {
    (TIMER_HZ / (2 * frequency)) as u16
}

/// Compare value of a duty; a duty that is no number is 0. The largest duty leaves the low side on long enough for the current to
/// settle and be sampled.
#[inline(always)]
pub fn compare(duty: f32, top: u16, largest_duty: f32) -> u16 {
    // Not clamp: it panics where its bounds are in the wrong order. max before min turns NaN into 0.
    (duty.max(0.0).min(largest_duty) * f32::from(top)) as u16
}
