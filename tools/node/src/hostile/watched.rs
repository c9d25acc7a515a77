//! The program around the objects under attack: it stores, and notes what it must never have been asked for.

use crate::storage::Storage;
use joint_firmware::canopen::Event;
use joint_firmware::joint::configuration::{BridgeConfiguration, Configuration};
use joint_firmware::joint::history::History;
use joint_firmware::motor::open_loop::Window;
use joint_firmware::objects::{NotConfigured, Program};
use joint_firmware::parameters::authentication::Key;
use joint_firmware::parameters::slots::SlotError;
use joint_firmware::reset_record::LastReset;

/// The program.
#[derive(Debug)]
pub struct Watched {
    bridge: BridgeConfiguration,
    pub storage: Storage,
    /// The joint is under current.
    pub armed: bool,
    has_key: bool,
    /// Configurations taken since somebody looked.
    pub configured: u32,
    /// Wrong tags since somebody looked.
    pub forged: u32,
    /// What must not have happened.
    pub problem: Option<&'static str>,
}

impl Watched {
    pub fn new(bridge: BridgeConfiguration, storage: Storage, has_key: bool) -> Self {
        Self { bridge, storage, armed: false, has_key, configured: 0, forged: 0, problem: None }
    }
}

impl Program for Watched {
    fn configure(&mut self, configuration: &Configuration) -> Result<(), NotConfigured> {
        configuration.prepare(&self.bridge).map_err(NotConfigured::Refused)?;
        self.configured += 1;
        Ok(())
    }

    fn window(&self) -> Window {
        Window::NOTHING
    }

    fn bridge(&self) -> &BridgeConfiguration {
        &self.bridge
    }

    fn record<R>(&self, read: impl FnOnce(Option<&[u8]>) -> R) -> R {
        read(self.storage.clone().configuration().as_deref())
    }

    fn store(&mut self, record: &[u8]) -> Result<(), SlotError> {
        if self.armed {
            self.problem = Some("a record is stored under current");
        }
        self.storage.store_configuration(record)
    }

    fn keep(&mut self, floor: u32, failures: u16) -> Result<(), SlotError> {
        if floor < self.storage.counts().0 {
            self.problem = Some("the version floor came down");
        }
        self.forged += u32::from(failures > self.storage.counts().1);
        self.storage.store_counts(floor, failures)
    }

    fn provision(&mut self, key: &Key) -> Result<(), SlotError> {
        if self.has_key {
            self.problem = Some("the key is replaced");
        }
        self.has_key = true;
        self.storage.store_key(key)
    }

    fn read_image(&mut self, offset: u32, out: &mut [u8]) -> bool {
        let bytes = self.storage.images.active().unwrap_or_default();
        let start = offset as usize;
        let Some(piece) = bytes.get(start..start.saturating_add(out.len())) else { return false };
        out.copy_from_slice(piece);
        true
    }

    fn history<R>(&self, read: impl FnOnce(&History) -> R) -> Option<R> {
        None.map(read)
    }

    fn last_reset(&self) -> LastReset {
        LastReset::POWER_UP
    }

    fn event(&mut self, _event: Event) {}
}
