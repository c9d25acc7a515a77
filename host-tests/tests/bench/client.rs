//! A CANopen client on an emulated board's bus, in the emulated time.

use super::Bench;
use bus::client::lss::request;
use bus::client::sdo::{Failure, Method, Settings, Transfer};
use bus::client::{Object, cob_id};
use emulator::board::Wired;
use emulator::chip::fdcan::line::CanFrame;
use libtest_mimic::Failed;
use std::time::Duration;

/// Node id that the board gets.
pub const NODE: u8 = 5;
/// What a command of LSS gets to be answered in; storing writes flash.
const LSS: f64 = 0.1;

impl<W: Wired> Bench<W> {
    /// Sends a frame.
    pub fn send(&mut self, id: u16, data: &[u8]) -> Result<(), Failed> {
        let frame = CanFrame::standard(id.into(), data).ok_or("no such frame")?;
        let now = self.emulation.now();
        self.board().line().send(now, frame);
        self.emulation.cpu.bus.wiring_changed();
        Ok(())
    }

    /// What the board has sent since it was asked last.
    pub fn received(&mut self) -> Vec<(u16, Vec<u8>)> {
        let line = self.board().line();
        let frames = std::iter::from_fn(|| line.receive());
        frames.map(|(_, frame)| (frame.id as u16, frame.data[..usize::from(frame.length)].to_vec())).collect()
    }

    /// Sends a frame, and gives what the board sends in the time behind it.
    pub fn exchange(&mut self, id: u16, data: &[u8], seconds: f64) -> Result<Vec<(u16, Vec<u8>)>, Failed> {
        self.received();
        self.send(id, data)?;
        self.run(seconds)?;
        Ok(self.received())
    }

    /// Gives a new node its id, which it keeps; its boot-up message has to come.
    pub fn take_part(&mut self) -> Result<(), Failed> {
        self.exchange(cob_id::LSS_MASTER, &request::switch_global(true), LSS)?;
        for (message, answer) in [(request::configure_node_id(NODE), 0x11), (request::store(), 0x17)] {
            let answers = self.exchange(cob_id::LSS_MASTER, &message, LSS)?;
            if answers != [(cob_id::LSS_SLAVE, vec![answer, 0, 0, 0, 0, 0, 0, 0])] {
                return Err(format!("answer to LSS {answer:02x}h: {answers:x?}").into());
            }
        }
        let booted = self.exchange(cob_id::LSS_MASTER, &request::switch_global(false), LSS)?;
        self.has_booted(&booted)
    }

    /// Whether the boot-up message is among what was received.
    pub fn has_booted(&self, frames: &[(u16, Vec<u8>)]) -> Result<(), Failed> {
        match frames.contains(&(cob_id::HEARTBEAT | u16::from(NODE), vec![0])) {
            true => Ok(()),
            false => Err(format!("no boot-up message: {frames:x?}\n{}", self.log()).into()),
        }
    }

    /// Writes an object.
    pub fn download(&mut self, index: u16, sub_index: u8, data: &[u8], method: Method) -> Result<(), Failed> {
        let transfer = Transfer::download(Object { node: NODE, index, sub_index }, data, method, Settings::default());
        self.transfer(transfer).map(drop)
    }

    /// Reads an object.
    pub fn upload(&mut self, index: u16, sub_index: u8, method: Method) -> Result<Vec<u8>, Failed> {
        self.transfer(Transfer::upload(Object { node: NODE, index, sub_index }, method, Settings::default()))
    }

    /// Reads a number.
    pub fn number(&mut self, index: u16, sub_index: u8) -> Result<u32, Failed> {
        let mut bytes = [0; 4];
        let read = self.upload(index, sub_index, Method::Automatic)?;
        bytes.iter_mut().zip(&read).for_each(|(place, byte)| *place = *byte);
        Ok(u32::from_le_bytes(bytes))
    }

    fn transfer(&mut self, mut transfer: Transfer) -> Result<Vec<u8>, Failed> {
        let object = transfer.object();
        loop {
            let now = Duration::from_secs_f64(self.emulation.now().seconds());
            while let Some(message) = transfer.poll(now) {
                self.send(cob_id::SDO_RECEIVE | u16::from(NODE), &message)?;
            }
            match transfer.outcome() {
                Some(Ok(data)) => return Ok(data.clone()),
                Some(Err(failure)) => return Err(describe(object, failure, &self.log()).into()),
                None => {}
            }
            self.run(0.001)?;
            let now = Duration::from_secs_f64(self.emulation.now().seconds());
            for (id, data) in self.received() {
                if id == cob_id::SDO_TRANSMIT | u16::from(NODE) {
                    transfer.receive(&data, now);
                }
            }
        }
    }
}

fn describe(object: Object, failure: &Failure, log: &str) -> String {
    format!("{:04X}h:{}: {failure:?}\n{log}", object.index, object.sub_index)
}
