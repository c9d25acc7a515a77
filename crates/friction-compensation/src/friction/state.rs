//! Inputs of the friction model: the joint's state, as quantities and as a row of signals; any context.

use crate::quantity::{Acceleration, Position, Temperature, Torque, Velocity};

/// One joint at one instant, as the control step knows it before it computes the compensation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct JointState {
    /// Position of the joint.
    pub position: Position,
    /// Velocity of the joint.
    pub velocity: Velocity,
    /// Acceleration of the joint.
    pub acceleration: Acceleration,
    /// Commanded torque before compensation; in recorded data the rigid-body torque.
    pub theoretical_torque: Torque,
    /// Measured torque, or the torque of the measured current.
    pub measured_torque: Torque,
    /// Temperature of the gear (or the nearest sensor).
    pub temperature: Temperature,
    /// Velocity of the joint that shares this joint's drive, for [`Criterion::Coupled`](super::regime::Criterion).
    pub coupled_velocity: Velocity,
}

/// Number of [`Signal`]s.
pub const SIGNALS: usize = 6;

/// A signal that has a trained range. The first five are the network's inputs, in its order (001, section 3.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Signal {
    /// Position.
    Position = 0,
    /// Velocity.
    Velocity = 1,
    /// Theoretical torque.
    TheoreticalTorque = 2,
    /// Measured torque.
    MeasuredTorque = 3,
    /// Temperature.
    Temperature = 4,
    /// Acceleration.
    Acceleration = 5,
}

impl Signal {
    /// All signals, in order.
    pub const ALL: [Self; SIGNALS] = [
        Self::Position,
        Self::Velocity,
        Self::TheoreticalTorque,
        Self::MeasuredTorque,
        Self::Temperature,
        Self::Acceleration,
    ];

    /// The signal at a place of [`Signal::ALL`], without a table to look it up in.
    #[inline(always)]
    pub(crate) const fn at(place: usize) -> Option<Self> {
        Some(match place {
            0 => Self::Position,
            1 => Self::Velocity,
            2 => Self::TheoreticalTorque,
            3 => Self::MeasuredTorque,
            4 => Self::Temperature,
            5 => Self::Acceleration,
            _ => return None,
        })
    }

    /// The signal's name in text formats and messages.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Position => "position",
            Self::Velocity => "velocity",
            Self::TheoreticalTorque => "theoretical_torque",
            Self::MeasuredTorque => "measured_torque",
            Self::Temperature => "temperature",
            Self::Acceleration => "acceleration",
        }
    }
}

impl JointState {
    /// The signals in the order of [`Signal::ALL`], Q16.16.
    #[inline(always)]
    pub const fn signals(&self) -> [i32; SIGNALS] {
        [
            self.position.to_bits(),
            self.velocity.to_bits(),
            self.theoretical_torque.to_bits(),
            self.measured_torque.to_bits(),
            self.temperature.to_bits(),
            self.acceleration.to_bits(),
        ]
    }

    /// The state with these signals and no coupled joint.
    pub const fn from_signals(signals: [i32; SIGNALS]) -> Self {
        let [position, velocity, theoretical_torque, measured_torque, temperature, acceleration] = signals;
        Self {
            position: Position::from_bits(position),
            velocity: Velocity::from_bits(velocity),
            acceleration: Acceleration::from_bits(acceleration),
            theoretical_torque: Torque::from_bits(theoretical_torque),
            measured_torque: Torque::from_bits(measured_torque),
            temperature: Temperature::from_bits(temperature),
            coupled_velocity: Velocity::ZERO,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_signal_is_at_its_place() {
        for (place, signal) in Signal::ALL.into_iter().enumerate() {
            assert_eq!((Signal::at(place), signal as usize), (Some(signal), place));
        }
        assert_eq!(Signal::at(SIGNALS), None);
    }

    #[test]
    fn signals_and_state_convert_both_ways() {
        let signals = [1, -2, 3, -4, 5, -6];
        assert_eq!(JointState::from_signals(signals).signals(), signals);
        assert_eq!(JointState::from_signals(signals).acceleration, Acceleration::from_bits(-6));
    }
}
