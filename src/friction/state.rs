//! What the friction model looks at: the joint's state, the box it was trained in, and how signals are scaled.

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

/// A closed range of one signal, Q16.16; `low <= high`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Range {
    /// Lowest value.
    pub low: i32,
    /// Highest value.
    pub high: i32,
}

impl Range {
    /// The range of a signal that the model does not depend on: never left.
    pub const ANY: Self = Self { low: i32::MIN, high: i32::MAX };

    /// Middle of the range, rounded up.
    pub const fn centre(self) -> i32 {
        ((self.low as i64 + self.high as i64 + 1) >> 1) as i32
    }

    /// Largest distance of an end from the centre: half the width, rounded up; at most 2^31.
    pub const fn half_width(self) -> u32 {
        let centre = self.centre() as i64;
        let (below, above) = (centre - self.low as i64, self.high as i64 - centre);
        (if below > above { below } else { above }) as u32
    }

    /// The range with `margin` (Q16.16, in half widths) added on both sides, cut at the limits of Q16.16.
    pub const fn widened(self, margin: u32) -> Self {
        let extra = (self.half_width() as u64 * margin as u64) >> 16;
        let extra = if extra > 1 << 32 { 1i64 << 32 } else { extra as i64 };
        let (low, high) = (self.low as i64 - extra, self.high as i64 + extra);
        Self {
            low: if low < i32::MIN as i64 { i32::MIN } else { low as i32 },
            high: if high > i32::MAX as i64 { i32::MAX } else { high as i32 },
        }
    }
}

/// The box of signals that a parameter set was trained in: one range a signal, in the order of [`Signal::ALL`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Domain {
    /// Trained ranges.
    pub ranges: [Range; SIGNALS],
    /// How far beyond its half width a signal may go until the model has faded out, Q16.16: the network has no weight left at
    /// one margin, the physical model none at two.
    pub margin: u32,
    /// Temperature at which the physical parameters hold, Q16.16.
    pub reference_temperature: i32,
}

impl Domain {
    /// The box with one margin added on every side: where the physical model is evaluated. Beyond it, signals are clamped.
    pub fn widened(&self) -> [Range; SIGNALS] {
        self.ranges.map(|range| range.widened(self.margin))
    }

    /// Full scale of each signal in the physical model, as the left shift that brings a signal of the widened box to Q31.
    ///
    /// Full scale is the smallest power of two that the signal's magnitude stays below in the widened box (temperature:
    /// the difference from the reference); in SI it is 2^(15 - shift).
    pub fn shifts(&self) -> [u32; SIGNALS] {
        let mut ranges = self.widened();
        let temperature = &mut ranges[Signal::Temperature as usize];
        temperature.low = temperature.low.saturating_sub(self.reference_temperature);
        temperature.high = temperature.high.saturating_sub(self.reference_temperature);
        ranges.map(|range| {
            let magnitude = range.low.unsigned_abs().max(range.high.unsigned_abs());
            magnitude.leading_zeros().saturating_sub(1).min(MAX_SHIFT)
        })
    }
}

/// A signal that is always zero would allow any shift; this is the largest.
const MAX_SHIFT: u32 = 30;

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn signals_and_state_convert_both_ways() {
        let signals = [1, -2, 3, -4, 5, -6];
        assert_eq!(JointState::from_signals(signals).signals(), signals);
        assert_eq!(JointState::from_signals(signals).acceleration, Acceleration::from_bits(-6));
    }

    proptest! {
        #[test]
        fn every_value_of_a_range_is_within_half_a_width_of_its_centre(a: i32, b: i32, t in 0.0f64..=1.0) {
            let range = Range { low: a.min(b), high: a.max(b) };
            let value = (range.low as f64 + t * (range.high as f64 - range.low as f64)) as i32;
            let distance = (value.clamp(range.low, range.high) as i64 - range.centre() as i64).unsigned_abs();
            prop_assert!(distance <= range.half_width() as u64);
        }

        #[test]
        fn shifting_never_overflows_in_the_widened_box(a: i32, b: i32, margin in 0u32..=4 << 16, reference: i32) {
            let range = Range { low: a.min(b), high: a.max(b) };
            let domain = Domain { ranges: [range; SIGNALS], margin, reference_temperature: reference };
            for (signal, (shift, wide)) in domain.shifts().into_iter().zip(domain.widened()).enumerate() {
                for end in [wide.low, wide.high] {
                    let origin = if signal == Signal::Temperature as usize { reference } else { 0 };
                    let value = end.saturating_sub(origin);
                    prop_assert_eq!((value << shift) >> shift, value);
                }
            }
        }
    }
}
