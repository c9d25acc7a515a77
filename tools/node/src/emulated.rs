//! A board's program on an emulated board as a node on a bus.

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
}

impl<W: Wired, R: FnMut(&mut Emulation<W>, emulator::chip::time::Instant) -> Result<(), String>> EmulatedNode<W, R> {
    /// A board that `run` runs up to an instant, or says what ended it.
    pub const fn new(emulation: Emulation<W>, run: R) -> Self {
        Self { emulation, run }
    }
}

impl<W: Wired, R: FnMut(&mut Emulation<W>, emulator::chip::time::Instant) -> Result<(), String>> Served
    for EmulatedNode<W, R>
{
    fn now(&self) -> Duration {
        Duration::from_nanos(self.emulation.now().0 / 1_000)
    }

    fn live_until(&mut self, instant: Duration) -> Result<(), String> {
        (self.run)(&mut self.emulation, emulator::chip::time::Instant(instant.as_nanos() as u64 * 1_000))
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
