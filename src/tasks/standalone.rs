//! A joint without a bus: the board's own configuration, and nobody who commands; the bridge stays off.

use super::{NotStarted, Started};
use crate::board::control::Commands;
use crate::board::{self, BoardConfiguration, Publisher};
use embassy_executor::Spawner;
use joint_firmware::joint::Demand;
use joint_firmware::joint::state_machine::Controlword;

/// Nothing of the board belongs to a bus.
pub struct Parts;

/// Whoever would command.
pub struct Connection {
    demand: Publisher<Demand>,
}

/// Offers the board's own configuration.
pub fn start(mut commands: Commands, _parts: Parts) -> Result<(Connection, Started), NotStarted> {
    let BoardConfiguration { bridge, joint, .. } = &board::CONFIGURATION;
    // Nothing has been offered, so there is a place.
    let prepared = defmt::unwrap!(commands.active.prepare(|place| joint.prepare_in(bridge, place), |_, _| ()))?;
    let thermal = prepared.value().thermal;
    prepared.offer();
    Ok((Connection { demand: commands.demand }, Started { thermal, encoder_counts: joint.motor.encoder_counts }))
}

impl Connection {
    /// Once the executors run.
    pub fn spawn(self, _slow: Spawner) -> Watching {
        Watching { demand: self.demand, sequence: 0 }
    }
}

/// Who would watch the joint for the bus; here it commands the joint instead, as nobody else does.
pub struct Watching {
    demand: Publisher<Demand>,
    sequence: u32,
}

impl Watching {
    /// Every millisecond: "disable voltage".
    pub fn look(&mut self, _bridge_temperature: f32, _winding_temperature: f32) {
        self.sequence = self.sequence.wrapping_add(1);
        let (controlword, sequence) = (Controlword::DISABLE_VOLTAGE, self.sequence);
        self.demand.publish(&Demand { controlword, sequence, ..Demand::default() });
    }
}

/// Nothing to log.
pub fn log() {}
