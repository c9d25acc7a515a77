//! Content of a board's flash at power-up: the stored configuration and a friction image, in the slots that
//! the program reads (`src/tasks/connection/store.rs`).

use super::observed::Observed;
use emulator::board::Wired;
use emulator::emulation::Emulation;
use emulator::program::Program;
use friction_compensation::compensation::Request;
use friction_compensation::parameters::slots::{BLANK, Layout, PAGE, PAGE_WORDS, SlotFlash, Slots};
use joint_firmware::joint::configuration::Configuration;
use joint_firmware::objects::{DEFAULT_RANGES, Part, RECORD, Update};
use libtest_mimic::Failed;
use node::flash::Flash;
use plant::ActuatorParameters;
use plant::virtual_joint::Setup;

/// The configuration of the actuator on a board, with a node id and with compensation as requested.
pub fn configuration<W: Observed>(actuator: &ActuatorParameters, node: u8, request: Request) -> Configuration {
    let board = W::CONFIGURATION;
    let mut configuration = Setup::of(actuator).compensating(request).configuration;
    configuration.node_id = node;
    configuration.limits.bridge_temperature = board.bridge.limits.bridge_temperature;
    configuration.motor.encoder_latency = board.joint.motor.encoder_latency;
    configuration
}

/// Pages of the program's slots.
const PAGES: usize = 6;

/// Contents that are kept.
#[derive(Clone, Copy, Debug)]
pub struct Kept<'a> {
    /// Its node id is the one that LSS stored.
    pub configuration: &'a Configuration,
    /// None where it is empty.
    pub image: &'a [u8],
}

impl Kept<'_> {
    /// Writes it into the flash of a board that has not been started.
    ///
    /// # Errors
    /// Contents that do not fit.
    pub fn write<W: Wired>(&self, emulation: &mut Emulation<W>, program: &Program) -> Result<(), Failed> {
        let mut flash = Flash::erased(PAGES);
        let mut store = |first, kind, bytes: &[u8]| -> Result<(), Failed> {
            let layout = Layout::new(first, 1, kind).ok_or("no layout")?;
            let mut slots = Slots::open(&mut flash, layout).map_err(|error| format!("{error:?}"))?;
            Ok(slots.store(&mut flash, bytes).map_err(|error| format!("{error:?}"))?)
        };
        if !self.image.is_empty() {
            store(0, 1, self.image)?;
        }
        let mut record = [0; RECORD];
        let update = Update {
            node_id: Some(self.configuration.node_id),
            application: Part::New((self.configuration, DEFAULT_RANGES)),
            communication: Part::Removed,
        };
        let length = update.encode(None, false, &mut record).ok_or("the record does not fit")?;
        store(2, 2, &record[..length])?;

        // Before them lies the log of faults, where a program has one.
        let end = program.symbol("__parameters_end").ok_or("the program names no parameters")?.address;
        let start = end - (PAGES * PAGE) as u32;
        for word in 0..PAGES * PAGE_WORDS {
            let bytes = flash.read(word).map_err(|error| format!("{error:?}"))?;
            let written = bytes != BLANK;
            if written && !emulation.cpu.bus.program(start + 8 * word as u32, &bytes) {
                return Err("the parameters lie outside of the flash".into());
            }
        }
        Ok(())
    }
}
