//! Offsets of the current sensors: their mean while the bridge is off and the rotor stands still; control step.

use super::failure::{Failure, Phase};
use super::settings::Plan;
use crate::motor::angle::STEPS;
use crate::motor::phases::Phases;

/// The rotor may turn by this much meanwhile, turns: an encoder's noise. A rotor that turns drives a current through the diodes.
const LARGEST_WAY: f32 = 0.005;

#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Offsets {
    sum: Phases,
    steps: u32,
    start: Option<i64>,
}

impl Offsets {
    /// The offsets, when there are enough samples.
    pub fn step(&mut self, plan: &Plan, currents: Phases, position: i64) -> Result<Option<Phases>, Failure> {
        let start = *self.start.get_or_insert(position);
        let turns = position.wrapping_sub(start) as f32 / STEPS;
        if turns.abs() > LARGEST_WAY {
            return Err(Failure::RotorMoves { turns, limit: LARGEST_WAY });
        }
        self.sum = Phases { a: self.sum.a + currents.a, b: self.sum.b + currents.b, c: self.sum.c + currents.c };
        self.steps += 1;
        if self.steps < plan.offset_steps {
            return Ok(None);
        }
        let each = 1.0 / self.steps as f32;
        let offsets = Phases { a: self.sum.a * each, b: self.sum.b * each, c: self.sum.c * each };
        for (phase, offset) in [(Phase::A, offsets.a), (Phase::B, offsets.b), (Phase::C, offsets.c)] {
            if offset.abs() > plan.highest_offset {
                return Err(Failure::OffsetTooLarge { phase, offset, limit: plan.highest_offset });
            }
        }
        Ok(Some(offsets))
    }
}
