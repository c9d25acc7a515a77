//! Resistance: voltage over current between two levels along phase A; control step.
//!
//! Between two levels, because dead time and transistors take a voltage that does not depend on the current: it drops out of the
//! difference. The voltage rises by an integral of the current's error, gently, and the rotor turns into line with phase A
//! meanwhile.

use super::Next;
use super::failure::{Failure, Phase};
use super::settings::{Plan, REACH};
use crate::motor::number::{limited, within};
use crate::motor::phases::Phases;
use crate::motor::transform::AlphaBeta;

/// Resistances of motors, Ω.
const PLAUSIBLE: (f32, f32) = (1e-3, 100.0);

/// What is lost along phase A, where the whole current flows through A and half of it through B and through C, over what one leg loses.
const ALONG_A: f32 = 4.0 / 3.0;

/// The second level, which the rotor is held with from here on.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hold {
    /// V.
    pub voltage: f32,
    /// Ω.
    pub resistance: f32,
    /// V.
    pub lost_voltage: f32,
}

impl Hold {
    /// Voltage for a part of the current.
    pub fn with_less_current(&self, part: f32) -> f32 {
        let lost = ALONG_A * self.lost_voltage;
        lost + part * (self.voltage - lost)
    }
}

/// Means at one level.
#[derive(Clone, Copy, Debug)]
struct Level {
    voltage: f32,
    current: f32,
}

#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Resistance {
    voltage: f32,
    /// The first level, when it has been measured.
    first: Option<Level>,
    /// Steps since the level began, until its current was reached; then since that.
    steps: u32,
    reached: bool,
    sum: Phases,
    sum_voltage: f32,
}

impl Resistance {
    pub fn step(&mut self, plan: &Plan, currents: Phases) -> Result<Next<Hold>, Failure> {
        let wanted = if self.first.is_none() { 0.5 * plan.current } else { plan.current };
        let current = AlphaBeta::from_phases(currents).alpha;
        let part = limited((wanted - current) / wanted, 1.0);
        self.voltage = within(self.voltage + plan.ramp * part, 0.0, plan.highest_voltage);
        self.steps += 1;

        if !self.reached {
            if part.abs() < 0.05 {
                self.begin(true);
            } else if self.steps >= REACH * plan.settle_steps {
                return Err(Self::why_not(currents, current, wanted, self.voltage));
            }
        } else if self.steps > plan.settle_steps {
            self.sum = Phases { a: self.sum.a + currents.a, b: self.sum.b + currents.b, c: self.sum.c + currents.c };
            self.sum_voltage += self.voltage;
            if self.steps >= 2 * plan.settle_steps {
                let level = self.level(plan, wanted)?;
                let Some(first) = self.first else {
                    self.first = Some(level);
                    self.begin(false);
                    return Ok(Next::Continue(AlphaBeta { alpha: self.voltage, beta: 0.0 }));
                };
                return Self::hold(first, level, wanted).map(Next::Finished);
            }
        }
        Ok(Next::Continue(AlphaBeta { alpha: self.voltage, beta: 0.0 }))
    }

    fn begin(&mut self, reached: bool) {
        *self = Self { reached, steps: 0, sum: Phases::default(), sum_voltage: 0.0, ..*self };
    }

    /// The means of a level, where the phases share the current as they should.
    fn level(&self, plan: &Plan, wanted: f32) -> Result<Level, Failure> {
        let each = 1.0 / (self.steps - plan.settle_steps) as f32;
        let mean = Phases { a: self.sum.a * each, b: self.sum.b * each, c: self.sum.c * each };
        let (sum, limit) = (mean.a + mean.b + mean.c, 0.2 * wanted);
        for (phase, current) in [(Phase::B, mean.b), (Phase::C, mean.c)] {
            if current.abs() < 0.1 * wanted {
                return Err(Failure::PhaseOpen { phase, current, expected: -0.5 * wanted });
            }
        }
        if sum.abs() > limit {
            return Err(Failure::CurrentsDoNotAddUp { sum, limit });
        }
        Ok(Level { voltage: self.sum_voltage * each, current: AlphaBeta::from_phases(mean).alpha })
    }

    fn why_not(currents: Phases, current: f32, wanted: f32, voltage: f32) -> Failure {
        let none = |current: f32| current.abs() < 0.1 * wanted;
        if none(currents.a) && none(currents.b) && none(currents.c) {
            Failure::PhaseOpen { phase: Phase::A, current: currents.a, expected: wanted }
        } else {
            Failure::CurrentNotReached { current, wanted, voltage }
        }
    }

    fn hold(first: Level, second: Level, wanted: f32) -> Result<Hold, Failure> {
        let rise = second.current - first.current;
        if rise < 0.2 * wanted {
            return Err(Failure::CurrentNotReached { current: second.current, wanted, voltage: second.voltage });
        }
        let resistance = (second.voltage - first.voltage) / rise;
        let (least, greatest) = PLAUSIBLE;
        if resistance < least || resistance > greatest {
            return Err(Failure::ResistanceImplausible { resistance, least, greatest });
        }
        // Along phase A a leg's loss v shows as 4/3 v: its own, and a third of both others'.
        let lost_voltage = (second.voltage - resistance * second.current) / ALONG_A;
        Ok(Hold { voltage: second.voltage, resistance, lost_voltage })
    }
}
