//! A friction model that is computed beside the one that acts, without effect; a task, a thousand times a second.

use super::Telemetry;
use friction_compensation::friction::FrictionModel;
use friction_compensation::friction::regime::Memory;
use friction_compensation::friction::state::JointState;
use friction_compensation::quantity::{Acceleration, Position, Temperature, Torque, Velocity};

/// The model with its regime's memory.
#[derive(Clone, Debug)]
pub struct Shadow {
    model: FrictionModel,
    memory: Memory,
}

impl Shadow {
    /// `model` as prepared for the rate at which [`Shadow::torque`] is called.
    pub fn new(model: FrictionModel) -> Self {
        Self { model, memory: Memory::default() }
    }

    /// Torque that the model would add, for the velocity that was asked for or else measured.
    pub fn torque(&mut self, telemetry: &Telemetry) -> Torque {
        torque(&self.model, &mut self.memory, telemetry)
    }
}

/// Torque that `model` would add, for the velocity that was asked for or else measured, where model and memory lie
/// apart.
pub fn torque(model: &FrictionModel, memory: &mut Memory, telemetry: &Telemetry) -> Torque {
    let q16 = |value: f32| (value * 65_536.0) as i32;
    let motion = &telemetry.motion;
    let state = JointState {
        position: Position::from_bits(q16(motion.position)),
        velocity: Velocity::from_bits(q16(telemetry.wanted.velocity.unwrap_or(motion.velocity))),
        acceleration: Acceleration::from_bits(q16(motion.acceleration)),
        theoretical_torque: Torque::from_bits(q16(telemetry.wanted.torque)),
        measured_torque: Torque::from_bits(q16(telemetry.measured_torque)),
        temperature: Temperature::from_bits(q16(telemetry.gear_temperature)),
        coupled_velocity: Velocity::ZERO,
    };
    let estimate = model.step(&state, memory);
    Torque::from_bits(estimate.physical.to_bits().saturating_add(estimate.network.to_bits()))
}
