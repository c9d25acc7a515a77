//! The encoder on the rotor: counts per turn, mounting, eccentricity, noise and age.

use super::delay::MAXIMUM_DELAY;
use crate::error::{ParameterError, count_within, within};
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};

/// Encoder and how it is mounted.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct EncoderParameters {
    /// Counts per turn of the rotor, 16 to 2^26.
    pub counts_per_turn: usize,
    /// Reading at rotor angle zero, 0 to 1 turn.
    pub zero: f64,
    /// `true` if it counts down while the rotor turns forward.
    pub reversed: bool,
    /// Standard deviation before quantisation, 0 to 0.1 turn.
    pub noise: f64,
    /// Amplitude of the error once per turn from a magnet or disc off centre, 0 to 0.2 rad.
    pub eccentricity: f64,
    /// Phase of that error at rotor angle zero, -pi to pi rad.
    pub eccentricity_phase: f64,
    /// Age of a reading, 0 to 7 periods.
    pub delay: usize,
}

impl EncoderParameters {
    /// Checks every parameter against its documented range.
    ///
    /// # Errors
    /// The first parameter that is outside its range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        count_within("encoder.counts_per_turn", self.counts_per_turn, 16, 67_108_864)?;
        within("encoder.zero", self.zero, 0.0, 1.0)?;
        within("encoder.noise", self.noise, 0.0, 0.1)?;
        within("encoder.eccentricity", self.eccentricity, 0.0, 0.2)?;
        within("encoder.eccentricity_phase", self.eccentricity_phase, -PI, PI)?;
        count_within("encoder.delay", self.delay, 0, MAXIMUM_DELAY)
    }

    /// Reading of the encoder's disc at the rotor's true `angle` (rad), turns, not wrapped.
    #[must_use]
    pub fn shown(&self, angle: f64) -> f64 {
        let eccentric = match self.eccentricity {
            0.0 => 0.0,
            amplitude => amplitude * libm::sin(angle + self.eccentricity_phase),
        };
        let turns = (angle + eccentric) / TAU;
        self.zero + if self.reversed { -turns } else { turns }
    }

    /// The nearest whole count of `turns`, as a fraction of a turn in units of 2^-32.
    #[must_use]
    pub fn counted(&self, turns: f64) -> u32 {
        let fraction = turns - turns.floor();
        let counts = self.counts_per_turn as u64;
        let count = (fraction * counts as f64).round() as u64 % counts;
        ((count << 32) / counts) as u32
    }
}
