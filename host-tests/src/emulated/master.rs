//! A CANopen master on an emulated board's bus, in emulated time.

use super::Bench;
use bus::client::Object;
use bus::client::cob_id::{HEARTBEAT, LSS_MASTER, LSS_SLAVE, SDO_RECEIVE, SDO_TRANSMIT};
use bus::client::lss::request;
use bus::client::sdo::{Failure, Method, Settings, Transfer};
use emulator::board::Wired;
use emulator::chip::fdcan::line::CanFrame;
use emulator::emulation::Emulation;
use libtest_mimic::Failed;
use std::time::Duration;

/// Time that a master lets pass between two looks at the bus, s.
const TICK: f64 = 0.000_25;
/// Time that an answer by LSS may take, s: storing writes flash.
const LSS: f64 = 0.1;

/// A data frame with an 11-bit identifier.
pub type Heard = (u16, Vec<u8>);

/// Puts a frame on the bus.
///
/// # Errors
/// There is no such frame.
pub fn send<W: Wired>(emulation: &mut Emulation<W>, id: u16, data: &[u8]) -> Result<(), Failed> {
    let frame = CanFrame::standard(id.into(), data).ok_or("no such frame")?;
    let now = emulation.now();
    emulation.cpu.bus.wiring_mut().line().send(now, frame);
    emulation.cpu.bus.wiring_changed();
    Ok(())
}

/// Frames that the joint has sent since this was last asked.
pub fn heard<W: Wired>(emulation: &mut Emulation<W>) -> Vec<Heard> {
    let line = emulation.cpu.bus.wiring_mut().line();
    let frames = std::iter::from_fn(|| line.receive());
    frames.map(|(_, frame)| (frame.id as u16, frame.data[..usize::from(frame.length)].to_vec())).collect()
}

impl<W: Wired> Bench<W> {
    /// Sends a frame and lets some time pass; what the joint sent meanwhile.
    ///
    /// # Errors
    /// The run ended.
    pub fn exchange(&mut self, id: u16, data: &[u8], seconds: f64) -> Result<Vec<Heard>, Failed> {
        send(&mut self.emulation, id, data)?;
        self.run(seconds)?;
        Ok(heard(&mut self.emulation))
    }

    /// Gives the only node on the bus an id by LSS (CiA 305), which it is to keep, and lets it boot.
    ///
    /// # Errors
    /// It does not take it, or sends no boot-up message.
    pub fn give_node_id(&mut self, id: u8) -> Result<(), Failed> {
        self.exchange(LSS_MASTER, &request::switch_global(true), LSS)?;
        for message in [request::configure_node_id(id), request::store()] {
            let answers = self.exchange(LSS_MASTER, &message, LSS)?;
            if answers != [(LSS_SLAVE, vec![message[0], 0, 0, 0, 0, 0, 0, 0])] {
                return Err(format!("answer to {message:x?}: {answers:x?}").into());
            }
        }
        let booted = self.exchange(LSS_MASTER, &request::switch_global(false), LSS)?;
        self.has_booted(id, &booted)
    }

    /// A node's boot-up message is among frames.
    ///
    /// # Errors
    /// It is not.
    pub fn has_booted(&self, id: u8, heard: &[Heard]) -> Result<(), Failed> {
        match heard.contains(&(HEARTBEAT + u16::from(id), vec![0])) {
            true => Ok(()),
            false => Err(format!("no boot-up message: {heard:x?}\n{}", self.log()).into()),
        }
    }

    /// Reads an object.
    ///
    /// # Errors
    /// The joint refuses or is silent.
    pub fn upload(&mut self, node: u8, index: u16, sub_index: u8) -> Result<Vec<u8>, Failed> {
        let object = Object { node, index, sub_index };
        self.done(Transfer::upload(object, Method::Automatic, Settings::default()))
    }

    /// Reads an object in blocks.
    ///
    /// # Errors
    /// The joint refuses or is silent.
    pub fn upload_in_blocks(&mut self, node: u8, index: u16, sub_index: u8) -> Result<Vec<u8>, Failed> {
        let object = Object { node, index, sub_index };
        self.done(Transfer::upload(object, Method::Block, Settings::default()))
    }

    /// Writes an object.
    ///
    /// # Errors
    /// The joint refuses or is silent.
    pub fn download(&mut self, node: u8, index: u16, sub_index: u8, data: &[u8]) -> Result<(), Failed> {
        let object = Object { node, index, sub_index };
        self.done(Transfer::download(object, data, Method::Automatic, Settings::default())).map(drop)
    }

    /// Reads a number of up to four bytes.
    ///
    /// # Errors
    /// The joint refuses or is silent.
    pub fn number(&mut self, node: u8, index: u16, sub_index: u8) -> Result<u32, Failed> {
        let mut bytes = [0; 4];
        let read = self.upload(node, index, sub_index)?;
        bytes.iter_mut().zip(&read).for_each(|(place, byte)| *place = *byte);
        Ok(u32::from_le_bytes(bytes))
    }

    fn done(&mut self, transfer: Transfer) -> Result<Vec<u8>, Failed> {
        let object = transfer.object();
        Ok(self.transfer(transfer)?.map_err(|failure| format!("{object:?}: {failure:?}"))?)
    }

    /// Carries out a transfer; what came of it.
    ///
    /// # Errors
    /// The run ended.
    pub fn transfer(&mut self, mut transfer: Transfer) -> Result<Result<Vec<u8>, Failure>, Failed> {
        let node = u16::from(transfer.object().node);
        loop {
            let now = Duration::from_secs_f64(self.emulation.now().seconds());
            while let Some(message) = transfer.poll(now) {
                send(&mut self.emulation, SDO_RECEIVE + node, &message)?;
            }
            if let Some(outcome) = transfer.outcome() {
                return Ok(outcome.clone());
            }
            self.run(TICK)?;
            let now = Duration::from_secs_f64(self.emulation.now().seconds());
            for (id, data) in heard(&mut self.emulation) {
                if id == SDO_TRANSMIT + node {
                    transfer.receive(&data, now);
                }
            }
        }
    }
}
