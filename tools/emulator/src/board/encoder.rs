//! The encoder on the motor's shaft: counts, direction and zero.

use plant::{ActuatorParameters, ParameterError};

/// Counts of the finest encoder that the plant takes: where the board counts by itself.
const FINEST: usize = 1 << 26;
/// Range of the counts a turn.
const COUNTS: (u32, u32) = (16, 1 << 20);

/// An encoder, and how it is mounted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Encoder {
    /// Counts a turn, 16 to 1,048,576: of an incremental encoder four a line. A chip has those that it has.
    pub counts: u32,
    /// `true` if it counts down while the rotor turns forward.
    pub reversed: bool,
    /// Reading at rotor angle zero, 0 to 1 turn. An incremental encoder's index is where its reading is zero.
    pub offset: f64,
}

impl Encoder {
    /// Takes the encoder out of the plant, which shows the rotor's own angle then, as finely as it can. Noise and
    /// eccentricity stay there.
    pub(super) fn take(parameters: &mut ActuatorParameters) -> Self {
        let sensor = &mut parameters.sensors.encoder;
        let counts = u32::try_from(sensor.counts_per_turn).unwrap_or(u32::MAX);
        let encoder = Self { counts, reversed: sensor.reversed, offset: sensor.zero };
        (sensor.counts_per_turn, sensor.reversed, sensor.zero) = (FINEST, false, 0.0);
        encoder
    }

    /// Checks counts and offset.
    ///
    /// # Errors
    /// The first that is outside its range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        self.counts_within(COUNTS)?;
        if !(0.0..=1.0).contains(&self.offset) {
            let (name, value) = ("encoder.offset", self.offset);
            return Err(ParameterError::OutOfRange { name, value, minimum: 0.0, maximum: 1.0 });
        }
        Ok(())
    }

    /// The counts lie in a range: an encoder chip has those that it has.
    pub(super) fn counts_within(&self, (minimum, maximum): (u32, u32)) -> Result<(), ParameterError> {
        match (minimum..=maximum).contains(&self.counts) {
            true => Ok(()),
            false => Err(ParameterError::CountOutOfRange {
                name: "encoder.counts",
                value: self.counts as usize,
                minimum: minimum as usize,
                maximum: maximum as usize,
            }),
        }
    }

    /// Reading at an angle of the rotor, before it is counted; both 2^32 a turn.
    pub fn angle(&self, rotor: u32) -> u32 {
        let turned = if self.reversed { rotor.wrapping_neg() } else { rotor };
        // A whole turn is none.
        turned.wrapping_add((self.offset * 4_294_967_296.0) as u64 as u32)
    }

    /// The nearest count at an angle of the rotor (2^32 a turn), 0 to one less than the counts a turn.
    pub fn nearest(&self, rotor: u32) -> u32 {
        let counts = u64::from(self.counts);
        let count = (u64::from(self.angle(rotor)) * counts + (1 << 31)) >> 32;
        if count == counts { 0 } else { count as u32 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const QUARTER: u32 = 1 << 30;

    #[test]
    fn a_reversed_encoder_counts_down_from_its_offset() {
        let encoder = Encoder { counts: 16_384, reversed: true, offset: 0.75 };
        assert_eq!([0, QUARTER, 3 * QUARTER].map(|rotor| encoder.nearest(rotor)), [12_288, 8_192, 0]);
        let forward = Encoder { reversed: false, ..encoder };
        assert_eq!([0, QUARTER, 3 * QUARTER].map(|rotor| forward.nearest(rotor)), [12_288, 0, 8_192]);
    }

    #[test]
    fn the_nearest_count_is_half_a_count_away_at_most_and_round_the_turn_it_is_zero() {
        let encoder = Encoder { counts: 1_000, reversed: false, offset: 1.0 };
        assert_eq!([0, 2_147_483, 2_147_485, u32::MAX - 2_147_482].map(|rotor| encoder.nearest(rotor)), [0, 0, 1, 0]);
        assert_eq!(encoder.nearest(u32::MAX - 2_147_485), 999);
    }

    #[test]
    fn counts_and_offset_have_limits() {
        let encoder = Encoder { counts: 16, reversed: false, offset: 0.0 };
        assert!(encoder.validate().is_ok() && Encoder { counts: 1 << 20, offset: 1.0, ..encoder }.validate().is_ok());
        for wrong in [
            Encoder { counts: 15, ..encoder },
            Encoder { counts: (1 << 20) + 1, ..encoder },
            Encoder { offset: -1e-9, ..encoder },
            Encoder { offset: 1.000_001, ..encoder },
            Encoder { offset: f64::NAN, ..encoder },
        ] {
            assert!(wrong.validate().is_err(), "{wrong:?}");
        }
    }
}
