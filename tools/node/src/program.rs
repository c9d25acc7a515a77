//! Services of a board's program for the objects, done for the simulated joint: swaps wait for the next control step.

use crate::storage::Storage;
use canopen_node::{Event, Reset};
use friction_compensation::parameters::authentication::CHALLENGE;
use friction_compensation::parameters::fault_log::{FaultLog, LoggedFault};
use friction_compensation::parameters::guard::Guard;
use friction_compensation::parameters::slots::SlotError;
use joint_firmware::joint::Active;
use joint_firmware::joint::configuration::{BridgeConfiguration, Configuration};
use joint_firmware::joint::history::History;
use joint_firmware::motor::open_loop::Window;
use joint_firmware::objects::{NotConfigured, Program, STORES, Start};
use joint_firmware::reset_record::LastReset;

/// The program around the objects.
#[derive(Debug)]
pub struct VirtualProgram {
    bridge: BridgeConfiguration,
    /// Prepared, for the next control step.
    pub next: Option<Active>,
    pub storage: Storage,
    /// Log of faults in the pages of the storage.
    log: FaultLog,
    /// The open loop's last window.
    pub window: Window,
    /// The steps before the latched fault.
    pub history: Option<History>,
    /// The network asked for a reset of the node.
    pub reset: bool,
    /// Reason for its start.
    pub last_reset: LastReset,
}

impl VirtualProgram {
    pub fn new(bridge: BridgeConfiguration, mut storage: Storage) -> Self {
        Self {
            bridge,
            next: None,
            window: Window::NOTHING,
            log: storage.fault_log(true),
            storage,
            history: None,
            reset: false,
            last_reset: LastReset::POWER_UP,
        }
    }

    /// Start of the objects.
    pub fn power_on(&mut self, defaults: &Configuration) -> Start {
        let record = self.storage.configuration();
        let lost = self.storage.is_configuration_lost();
        Start { stores_left: STORES, ..Start::new(record.as_deref(), lost, defaults, &self.bridge) }
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

    fn window(&self) -> Window {
        self.window
    }

    fn bridge(&self) -> &BridgeConfiguration {
        &self.bridge
    }

    fn record<R>(&self, read: impl FnOnce(Option<&[u8]>) -> R) -> R {
        read(self.storage.clone().configuration().as_deref())
    }

    fn store(&mut self, record: &[u8]) -> Result<(), SlotError> {
        self.storage.store_configuration(record)
    }

    fn damaged(&self) -> u8 {
        self.storage.damaged()
    }

    /// The objects are not made anew with a reset over the bus.
    fn note_stores_left(&mut self, _left: u8) {}

    fn keep(&mut self, guard: &Guard) -> Result<(), SlotError> {
        self.storage.store_guard(guard)
    }

    fn random(&mut self) -> Option<[u8; CHALLENGE]> {
        let mut bytes = [0; CHALLENGE];
        getrandom::fill(&mut bytes).ok().map(|()| bytes)
    }

    fn read_image(&mut self, offset: u32, out: &mut [u8]) -> bool {
        let bytes = self.storage.images.active().unwrap_or_default();
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

    fn log_fault(&mut self, code: u16, fault: u8, time: u32) -> bool {
        self.log.append(self.storage.log(), code, fault, time).is_ok()
    }

    fn count_power_up(&mut self) {
        // If it is refused the next fault tries again.
        let _ = self.log.keep_power_up(self.storage.log());
    }

    fn logged_faults(&self) -> impl Iterator<Item = LoggedFault> {
        self.log.newest().copied()
    }

    fn power_ups(&self) -> u32 {
        self.log.power_ups()
    }

    fn last_reset(&self) -> LastReset {
        self.last_reset
    }

    fn event(&mut self, event: Event) {
        self.reset |= event == Event::Reset(Reset::Node);
    }
}
