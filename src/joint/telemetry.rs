//! A control step's findings and deeds, for tasks that report them; any context.

use super::Outputs;
use super::active::JointMotion;
use super::adaptation::ADAPTS;
use super::fault::{Fault, Faults};
use super::friction_feedforward::Compensated;
use super::motion_law::Wanted;
use super::state_machine::State;
use crate::motor::transform::Dq;

/// Findings and deeds of a control step, for tasks that report them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Telemetry {
    /// State after the step.
    pub state: State,
    /// Faults present in the step.
    pub faults: Faults,
    /// Motion of the joint.
    pub motion: JointMotion,
    /// Torque and velocity that the command wanted.
    pub wanted: Wanted,
    /// Position that it asks for at this instant, rad; in modes without one the joint's own. With
    /// [`PROFILES`](super::PROFILES) alone.
    pub position_demand: f32,
    /// Torque that compensation added.
    pub compensated: Compensated,
    /// Torque of the measured current, Nm.
    pub measured_torque: f32,
    /// Its mean over the last whole millisecond, Nm; where a program does not adapt, nothing.
    pub mean_torque: f32,
    /// Temperature that friction was computed for, °C.
    pub gear_temperature: f32,
    /// Wanted current, A.
    pub reference: Dq,
    /// Measured current, A.
    pub current: Dq,
    /// Supply, V.
    pub bus_voltage: f32,
    /// An enabled joint holds where it is instead of following its command: its brake opens, or it is to stop.
    pub held: bool,
    /// State of the board's outputs.
    pub outputs: Outputs,
}

impl Default for Telemetry {
    fn default() -> Self {
        Self::NOTHING
    }
}

impl Telemetry {
    /// Telemetry before the first step.
    pub const NOTHING: Self = Self {
        state: State::NotReadyToSwitchOn,
        faults: Faults::NONE,
        motion: JointMotion { position: 0.0, velocity: 0.0, acceleration: 0.0 },
        wanted: Wanted { torque: 0.0, velocity: None, push: 0.0 },
        position_demand: 0.0,
        compensated: Compensated::NOTHING,
        measured_torque: 0.0,
        mean_torque: 0.0,
        gear_temperature: 0.0,
        reference: Dq { d: 0.0, q: 0.0 },
        current: Dq { d: 0.0, q: 0.0 },
        bus_voltage: 0.0,
        held: false,
        outputs: Outputs::OFF,
    };

    /// Torque of the current, Nm: the mean over a millisecond, where the program takes it.
    pub const fn torque(&self) -> f32 {
        if ADAPTS { self.mean_torque } else { self.measured_torque }
    }

    /// The statusword, object 6041h: state, voltage present, and that the joint follows its commands.
    pub fn statusword(&self) -> u16 {
        // Before the start is complete nobody has looked at the supply.
        let started = self.state != State::NotReadyToSwitchOn;
        let voltage = (started && !self.faults.contains(Fault::UnderVoltage)) as u16;
        let remote = 1 << 9;
        self.state.statusword() | voltage << 4 | remote
    }
}
