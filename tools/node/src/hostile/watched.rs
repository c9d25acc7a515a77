//! The program around the objects under attack: it stores, and notes what it must never have been asked for.

use crate::storage::Storage;
use canopen_node::Event;
use friction_compensation::parameters::authentication::{CHALLENGE, Key};
use friction_compensation::parameters::guard::Guard;
use friction_compensation::parameters::slots::SlotError;
use joint_firmware::joint::configuration::{BridgeConfiguration, Configuration};
use joint_firmware::joint::history::History;
use joint_firmware::motor::open_loop::Window;
use joint_firmware::objects::{NotConfigured, Program};
use joint_firmware::reset_record::LastReset;

/// The program.
#[derive(Debug)]
pub struct Watched {
    bridge: BridgeConfiguration,
    pub storage: Storage,
    /// The joint is under current.
    pub armed: bool,
    /// Configurations taken since somebody looked.
    pub configured: u32,
    /// Wrong tags since somebody looked.
    pub forged: u32,
    /// Event that must not have happened.
    pub problem: Option<&'static str>,
}

impl Watched {
    pub fn new(bridge: BridgeConfiguration, storage: Storage) -> Self {
        Self { bridge, storage, armed: false, configured: 0, forged: 0, problem: None }
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

    fn note_stores_left(&mut self, _left: u8) {}

    fn keep(&mut self, guard: &Guard) -> Result<(), SlotError> {
        let kept = self.storage.guard();
        if guard.floor < kept.floor {
            self.problem = Some("the version floor came down");
        }
        if kept.key.is_some() && guard.key.as_ref().map(Key::id) != kept.key.as_ref().map(Key::id) {
            self.problem = Some("the key is replaced");
        }
        self.forged += u32::from(guard.failures > kept.failures);
        self.storage.store_guard(guard)
    }

    fn random(&mut self) -> Option<[u8; CHALLENGE]> {
        // The attackers do not have the key, so any challenge will do.
        Some([7; CHALLENGE])
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
