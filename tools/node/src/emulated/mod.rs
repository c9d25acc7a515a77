//! A board's program on an emulated board as a node on a bus, with its flash in a file and somebody at its bench.

mod command;
mod flash_file;
mod workbench;

pub use command::{Command, DriverFault};
pub use flash_file::{FlashFile, FlashFileError};
pub use workbench::Workbench;

use crate::serve::Served;
use bus::Frame;
use emulator::board::Wired;
use emulator::chip::fdcan::line::CanFrame;
use emulator::emulation::Emulation;
use std::time::Duration;

/// An emulated board and what runs it.
pub struct EmulatedNode<W: Wired, R> {
    /// The board.
    pub emulation: Emulation<W>,
    run: R,
    /// Time without power so far.
    dark: Duration,
}

impl<W: Wired, R: FnMut(&mut Emulation<W>, emulator::chip::time::Instant) -> Result<(), String>> EmulatedNode<W, R> {
    /// A board that `run` runs up to an instant, or says what ended it.
    pub const fn new(emulation: Emulation<W>, run: R) -> Self {
        Self { emulation, run, dark: Duration::ZERO }
    }
}

impl<W: Wired, R: FnMut(&mut Emulation<W>, emulator::chip::time::Instant) -> Result<(), String>> Served
    for EmulatedNode<W, R>
{
    fn now(&self) -> Duration {
        Duration::from_nanos(self.emulation.now().0 / 1_000) + self.dark
    }

    fn live_until(&mut self, instant: Duration) -> Result<(), String> {
        let until = instant.saturating_sub(self.dark).as_nanos() as u64 * 1_000;
        (self.run)(&mut self.emulation, emulator::chip::time::Instant(until))?;
        if !self.emulation.is_powered() {
            // Its own time stands still, that of the bus does not.
            self.dark += instant.saturating_sub(self.now());
        }
        Ok(())
    }

    fn receive(&mut self, frame: &Frame) {
        // A frame of the bus is one of CAN's.
        let Some(frame) = CanFrame::standard(frame.id().into(), frame.data()) else { return };
        let now = self.emulation.now();
        self.emulation.cpu.bus.wiring_mut().line().send(now, frame);
        self.emulation.cpu.bus.wiring_changed();
    }

    fn take_frame(&mut self) -> Option<Frame> {
        let line = self.emulation.cpu.bus.wiring_mut().line();
        // No program of a board sends extended frames or remote ones; who does is not heard.
        std::iter::from_fn(|| line.receive()).find_map(|(_, frame)| {
            let data = frame.data.get(..frame.length.into())?;
            if frame.extended || frame.remote { None } else { Frame::new(frame.id as u16, data) }
        })
    }
}
