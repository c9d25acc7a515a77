//! A CANopen master on an emulated board's bus, in emulated time.

use super::Bench;
use bus::client::Object;
use bus::client::cob_id::{SDO_RECEIVE, SDO_TRANSMIT};
use bus::client::sdo::{Method, Settings, Transfer};
use emulator::board::Wired;
use emulator::chip::fdcan::line::CanFrame;
use emulator::emulation::Emulation;
use libtest_mimic::Failed;
use std::time::Duration;

/// Time that a master lets pass between two looks at the bus, s.
const TICK: f64 = 0.000_25;
const LSS_MASTER: u16 = 0x7E5;

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

/// What the joint has sent since this was last asked.
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

    /// Gives the only node on the bus an id by LSS (CiA 305); what it sends then.
    ///
    /// # Errors
    /// It does not take it.
    pub fn give_node_id(&mut self, id: u8) -> Result<Vec<Heard>, Failed> {
        // All nodes to configuration; the id; back to waiting.
        self.exchange(LSS_MASTER, &[0x04, 1, 0, 0, 0, 0, 0, 0], 0.02)?;
        let taken = self.exchange(LSS_MASTER, &[0x11, id, 0, 0, 0, 0, 0, 0], 0.02)?;
        if taken != [(0x7E4, vec![0x11, 0, 0, 0, 0, 0, 0, 0])] {
            return Err(format!("answer to the node id: {taken:x?}").into());
        }
        self.exchange(LSS_MASTER, &[0x04, 0, 0, 0, 0, 0, 0, 0], 0.02)
    }

    /// Reads an object.
    ///
    /// # Errors
    /// The joint refuses or is silent.
    pub fn upload(&mut self, node: u8, index: u16, sub_index: u8) -> Result<Vec<u8>, Failed> {
        let object = Object { node, index, sub_index };
        self.transfer(Transfer::upload(object, Method::Automatic, Settings::default()))
    }

    /// Reads an object in blocks.
    ///
    /// # Errors
    /// The joint refuses or is silent.
    pub fn upload_in_blocks(&mut self, node: u8, index: u16, sub_index: u8) -> Result<Vec<u8>, Failed> {
        let object = Object { node, index, sub_index };
        self.transfer(Transfer::upload(object, Method::Block, Settings::default()))
    }

    /// Writes an object.
    ///
    /// # Errors
    /// The joint refuses or is silent.
    pub fn download(&mut self, node: u8, index: u16, sub_index: u8, data: &[u8]) -> Result<(), Failed> {
        let object = Object { node, index, sub_index };
        self.transfer(Transfer::download(object, data, Method::Automatic, Settings::default())).map(drop)
    }

    fn transfer(&mut self, mut transfer: Transfer) -> Result<Vec<u8>, Failed> {
        let node = u16::from(transfer.object().node);
        loop {
            let now = Duration::from_secs_f64(self.emulation.now().seconds());
            while let Some(message) = transfer.poll(now) {
                send(&mut self.emulation, SDO_RECEIVE + node, &message)?;
            }
            if let Some(outcome) = transfer.outcome() {
                let outcome = outcome.clone();
                return Ok(outcome.map_err(|failure| format!("{:?}: {failure:?}", transfer.object()))?);
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
