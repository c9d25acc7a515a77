//! A bench under voltage: frames renewed in time, windows that are wholly after what was changed.

use super::bench::{Bench, DEAD_MAN, Frame, SLEW, Stopped, WINDOW_STEPS, Window};

/// Period of frames, s: a third of what the joint would bear.
const RENEW: f64 = DEAD_MAN / 3.0;
/// Time between two looks at the window, in windows.
const LOOK: f64 = 0.5;
/// Windows that may go by without a new one before the joint counts as not sampling.
const MISSED: u32 = 100;

/// A bench whose bridge is on.
pub(super) struct Drive<'b, B> {
    bench: &'b mut B,
    frame: Frame,
    /// s.
    window: f64,
}

/// Switches the bridge on, does something, and switches it off whatever happens.
pub(super) fn powered<B: Bench, T, E: From<Stopped>>(
    bench: &mut B,
    something: impl FnOnce(&mut Drive<'_, B>) -> Result<T, E>,
) -> Result<T, E> {
    let window = WINDOW_STEPS / bench.rate()?;
    let begun = bench.enable().map_err(E::from);
    let mut drive = Drive { bench, frame: Frame::default(), window };
    let done = begun.and_then(|()| something(&mut drive));
    // The first error is the one that is told.
    match (done, drive.bench.off()) {
        (Ok(_), Err(stopped)) => Err(stopped.into()),
        (done, _) => done,
    }
}

impl<B: Bench> Drive<'_, B> {
    /// Time of a window, s.
    pub const fn window_time(&self) -> f64 {
        self.window
    }

    /// Applies another frame, and waits until the voltages have been slewed to it.
    pub fn set(&mut self, frame: Frame) -> Result<(), Stopped> {
        let change =
            [frame.voltage - self.frame.voltage, frame.along - self.frame.along, frame.across - self.frame.across];
        let farthest = change.into_iter().fold(0.0, |most: f64, change| most.max(change.abs()));
        self.frame = frame;
        self.bench.apply(&frame)?;
        self.wait(farthest / SLEW)
    }

    /// Waits, and renews the frame.
    pub fn wait(&mut self, seconds: f64) -> Result<(), Stopped> {
        let mut left = seconds;
        while left > 0.0 {
            let part = left.min(RENEW);
            self.bench.pass(part)?;
            self.bench.apply(&self.frame)?;
            left -= part;
        }
        Ok(())
    }

    /// The last complete window, and the frame renewed.
    pub fn look(&mut self, ripple: bool) -> Result<Window, Stopped> {
        let window = self.bench.window(ripple)?;
        self.bench.apply(&self.frame)?;
        Ok(window)
    }

    /// The next window after one.
    pub fn after(&mut self, number: u32, ripple: bool) -> Result<Window, Stopped> {
        for _ in 0..MISSED {
            let window = self.look(ripple)?;
            if window.number.wrapping_sub(number) as i32 > 0 {
                return Ok(window);
            }
            self.bench.pass(LOOK * self.window)?;
        }
        Err(Stopped::Joint("it gives no new windows (2108h:1)".into()))
    }

    /// Windows that all began after now.
    pub fn fresh(&mut self, count: usize, ripple: bool) -> Result<Vec<Window>, Stopped> {
        // The one that is being filled has seen what was before.
        let mut number = self.look(false)?.number.wrapping_add(1);
        let mut windows = Vec::with_capacity(count);
        for _ in 0..count {
            let window = self.after(number, ripple)?;
            number = window.number;
            windows.push(window);
        }
        Ok(windows)
    }
}
