//! A joint on a CAN bus: its configuration and friction model come from flash, its commands from the bus.

mod bus;
mod node;
mod program;
mod store;

use super::adaptation::Adapting;
use super::load::Bearing;
use super::{NotStarted, Started};
use crate::board::control::{Commands, Report};
use crate::board::flash::Parameters;
use crate::board::{can, control, oscillator, shadow};
use bus::Node;
use embassy_executor::Spawner;
use embassy_stm32::Peri;
use embassy_stm32::can::CanConfigurator;
use embassy_stm32::peripherals::FLASH;
use friction_compensation::friction::regime::Memory;
use joint_firmware::objects::{FrictionStatistics, Observed};
use program::BoardProgram;
use store::Store;

/// Parts of the board that belong to the bus.
pub struct Parts {
    /// The CAN controller.
    pub can: CanConfigurator<'static>,
    /// Flash in which parameters lie.
    pub flash: Peri<'static, FLASH>,
}

/// The joint's place on the bus.
pub struct Connection {
    node: &'static mut Node,
}

/// Offers the first configuration and starts the receive interrupt.
#[inline(never)]
pub fn start(commands: Commands, parts: Parts) -> Result<(Connection, Started), NotStarted> {
    let mut program = BoardProgram::new(commands.active, commands.window, Store::open(Parameters::new(parts.flash))?);
    let start = program.start();
    oscillator::trim(start.configuration.oscillator_trim);
    let thermal = program.begin(&start.configuration)?;
    // By now what a loss of power left undecided in flash is decided.
    control::release();
    let node = node::start(program, &start, commands.demand, parts.can);
    Ok((Connection { node }, Started { thermal, encoder_counts: start.configuration.motor.encoder_counts }))
}

impl Connection {
    /// Once the executors run.
    pub fn spawn(self, slow: Spawner) -> Watching {
        // Spawned once, so its only place is free.
        slow.spawn(defmt::unwrap!(bus::serve(self.node)));
        Watching {
            statistics: FrictionStatistics::default(),
            memory: Memory::default(),
            adapting: Adapting::NOTHING,
            bearing: Bearing::NOTHING,
        }
    }
}

/// State of the joint that the bus shows beside its control steps.
pub struct Watching {
    statistics: FrictionStatistics,
    /// Memory of the model in shadow.
    memory: Memory,
    adapting: Adapting,
    bearing: Bearing,
}

impl Watching {
    /// Every millisecond: computes the model in shadow, adapts the one that acts, bears the load, and leaves for the
    /// bus what is known of the joint. Temperatures in °C.
    pub fn look(&mut self, bridge_temperature: f32, winding_temperature: f32) {
        let Some(Report { telemetry, latched, .. }) = control::report() else { return };
        let mut seen = telemetry;
        if let Some(torque) = shadow::torque(&mut self.memory, &seen) {
            seen.compensated.output.shadow = torque;
        }
        self.statistics.note(&seen);
        let external = self.bearing.look(&telemetry, &self.adapting.in_service());
        let adaptation = self.adapting.look(&telemetry);
        can::observe(&Observed {
            telemetry,
            latched,
            feedforward_torque: 0.0,
            winding_temperature,
            bridge_temperature,
            friction: self.statistics,
            adaptation,
            external,
        });
    }
}

/// Logs the state of the bus.
pub fn log() {
    defmt::info!("bus {}, dropped {}", can::condition(), can::dropped());
}
