//! Direction, pole pairs and electrical zero: the field turns slowly there and back and takes the rotor along; control step.
//!
//! Friction makes the rotor lag behind the field, and its back-EMF makes the current lag behind the voltage, one way there and the other
//! way back: in the mean of both it drops out, and half the difference is the lag. Cogging repeats with the electrical turn and drops out of the mean over whole turns. The half turn before and
//! after them is for the rotor to catch up with the field and is not evaluated.

use super::Next;
use super::failure::Failure;
use super::settings::{MOST_POLE_PAIRS, Plan};
use crate::motor::angle::{Direction, ElectricalAngle, EncoderAlignment, STEPS};
use crate::motor::transform::Dq;

/// Largest lag, electrical turns: beyond 60° the rotor is about to slip.
const LARGEST_LAG: f32 = 1.0 / 6.0;
/// Part of the current with which the zero is looked for again. Where x is not zero, it differs then by 10 to 30 degrees unless
/// psi is less than a quarter of (L_q - L_d) I.
pub(super) const LESS_CURRENT: f32 = 0.6;
/// Largest difference of the zeros, electrical turns: 8 degrees, which cost 1 % of the torque.
const LARGEST_DIFFERENCE: f32 = 8.0 / 360.0;
/// How far the measured ratio of turns may be from a whole number.
const LARGEST_FRACTION: f32 = 0.2;

/// What one sweep over whole electrical turns gave.
#[derive(Clone, Copy, Debug, Default)]
struct Sweep {
    /// Encoder at the beginning and the end, 2^32 a turn.
    first: i64,
    last: i64,
    /// Sums over all steps, of the encoder's way since the start and of the field's.
    encoder: i64,
    field: i64,
}

#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Alignment {
    start: Option<i64>,
    /// Steps of both sweeps.
    steps: u32,
    /// Field since the start, 2^32 an electrical turn.
    field: i64,
    forward: Sweep,
    backward: Sweep,
}

impl Alignment {
    /// Takes the encoder over all turns; the alignment and the lag in electrical turns.
    pub fn step(&mut self, plan: &Plan, voltage: f32, position: i64) -> Result<Next<(EncoderAlignment, f32)>, Failure> {
        let start = *self.start.get_or_insert(position);
        let one_way = (plan.electrical_turns + 1) * plan.turn_steps;
        let back = self.steps >= one_way;
        let step = if back { self.steps - one_way } else { self.steps };
        let half = plan.turn_steps / 2;
        let sweep = if back { &mut self.backward } else { &mut self.forward };
        if step >= half && step < half + plan.electrical_turns * plan.turn_steps {
            let way = position.wrapping_sub(start);
            if step == half {
                sweep.first = way;
            }
            sweep.last = way;
            sweep.encoder = sweep.encoder.wrapping_add(way);
            sweep.field = sweep.field.wrapping_add(self.field);
        }
        self.steps += 1;
        if self.steps == one_way {
            self.moved(plan)?;
        }
        if self.steps >= 2 * one_way {
            return self.evaluate(plan, start).map(Next::Finished);
        }
        let field_step = plan.field_step as i64;
        self.field += if self.steps > one_way { -field_step } else { field_step };
        let field = ElectricalAngle(self.field as u32).sin_cos();
        Ok(Next::Continue(Dq { d: voltage, q: 0.0 }.to_stationary(field)))
    }

    /// Whether the rotor followed the first sweep at all.
    fn moved(&self, plan: &Plan) -> Result<(), Failure> {
        let turns = self.forward.turns();
        let least = 0.5 * plan.electrical_turns as f32 / plan.expected_pole_pairs.unwrap_or(MOST_POLE_PAIRS) as f32;
        if turns.abs() < least { Err(Failure::RotorDidNotMove { turns, least }) } else { Ok(()) }
    }

    fn evaluate(&self, plan: &Plan, start: i64) -> Result<(EncoderAlignment, f32), Failure> {
        let (forward, backward) = (self.forward.turns(), self.backward.turns());
        if (forward + backward).abs() > 0.1 * forward.abs() {
            return Err(Failure::RotorSlipped { forward, backward: -backward });
        }
        let ratio = 2.0 * plan.electrical_turns as f32 / (forward - backward).abs();
        let pole_pairs = (ratio + 0.5) as u32;
        let whole = (ratio - pole_pairs as f32).abs() <= LARGEST_FRACTION;
        if !(whole && (1..=MOST_POLE_PAIRS).contains(&pole_pairs)) {
            return Err(Failure::PolePairsUnclear { ratio });
        }
        if let Some(expected) = plan.expected_pole_pairs
            && expected != pole_pairs
        {
            return Err(Failure::PolePairs { counted: pole_pairs, expected });
        }
        let direction = if forward > 0.0 { Direction::Forward } else { Direction::Reverse };
        // The rotor is where the field is, less the lag there and plus it back.
        let without_zero = EncoderAlignment { pole_pairs, direction, electrical_zero: ElectricalAngle(0) };
        let count = (plan.electrical_turns * plan.turn_steps) as i64;
        let zero = |sweep: &Sweep| {
            let mean = |sum: i64| sum.checked_div(count).unwrap_or(0);
            let encoder = start.wrapping_add(mean(sweep.encoder)) as u32;
            without_zero.electrical(encoder).0.wrapping_sub(mean(sweep.field) as u32)
        };
        let (there, back) = (zero(&self.forward), zero(&self.backward));
        let lag = (back.wrapping_sub(there) as i32) >> 1;
        let lag_turns = lag as f32 / STEPS;
        if lag_turns.abs() > LARGEST_LAG {
            return Err(Failure::LagTooLarge { lag: lag_turns, limit: LARGEST_LAG });
        }
        let electrical_zero = ElectricalAngle(there.wrapping_add(lag as u32));
        Ok((EncoderAlignment { electrical_zero, ..without_zero }, lag_turns))
    }
}

/// Whether the zero with less current is the same.
pub(super) fn is_the_same(found: &EncoderAlignment, again: &EncoderAlignment) -> Result<(), Failure> {
    let difference = again.electrical_zero.0.wrapping_sub(found.electrical_zero.0) as i32;
    let turns = difference as f32 / STEPS;
    if turns.abs() > LARGEST_DIFFERENCE {
        return Err(Failure::RotorBesideField { turns, limit: LARGEST_DIFFERENCE });
    }
    Ok(())
}

impl Sweep {
    /// Way of the encoder, turns.
    fn turns(&self) -> f32 {
        self.last.wrapping_sub(self.first) as f32 / STEPS
    }
}
