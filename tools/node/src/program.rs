//! What a board's program does for the objects, done for the simulated joint: swaps wait for the next control step, records live in memory.

use crate::images::SlotImages;
use joint_firmware::canopen::Event;
use joint_firmware::joint::Active;
use joint_firmware::joint::configuration::{BridgeConfiguration, Configuration};
use joint_firmware::joint::history::History;
use joint_firmware::objects::{NotConfigured, Program};
use joint_firmware::parameters::authentication::Key;
use joint_firmware::parameters::slots::SlotError;

/// The program around the objects.
#[derive(Debug)]
pub struct VirtualProgram {
    bridge: BridgeConfiguration,
    /// Prepared, for the next control step.
    pub next: Option<Active>,
    pub images: SlotImages,
    /// What 1010h stored; outlasts a reset of the node, not of the program.
    pub record: Option<Vec<u8>>,
    pub floor: u32,
    pub failures: u16,
    pub key: Option<Key>,
    /// The steps before the latched fault.
    pub history: Option<History>,
    /// What the network told since the last look.
    pub events: Vec<Event>,
}

impl VirtualProgram {
    pub fn new(bridge: BridgeConfiguration, images: SlotImages) -> Self {
        Self {
            bridge,
            next: None,
            images,
            record: None,
            floor: 0,
            failures: 0,
            key: None,
            history: None,
            events: Vec::new(),
        }
    }
}

impl Program for VirtualProgram {
    fn configure(&mut self, configuration: &Configuration) -> Result<(), NotConfigured> {
        if self.next.is_some() {
            return Err(NotConfigured::Busy);
        }
        self.next = Some(configuration.prepare(&self.bridge).map_err(NotConfigured::Refused)?);
        Ok(())
    }

    fn store(&mut self, record: &[u8]) -> Result<(), SlotError> {
        self.record = Some(record.to_vec());
        Ok(())
    }

    fn keep(&mut self, floor: u32, failures: u16) -> Result<(), SlotError> {
        (self.floor, self.failures) = (floor, failures);
        Ok(())
    }

    fn provision(&mut self, key: &Key) -> Result<(), SlotError> {
        self.key = Some(key.clone());
        Ok(())
    }

    fn read_image(&mut self, offset: u32, out: &mut [u8]) -> bool {
        let bytes = self.images.active().unwrap_or_default();
        let start = offset as usize;
        match bytes.get(start..start.saturating_add(out.len())) {
            Some(piece) => {
                out.copy_from_slice(piece);
                true
            }
            None => false,
        }
    }

    fn history<R>(&self, read: impl FnOnce(&History) -> R) -> Option<R> {
        self.history.as_ref().map(read)
    }

    fn event(&mut self, event: Event) {
        self.events.push(event);
    }
}
