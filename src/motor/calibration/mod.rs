//! Calibration of a motor, its current sensors and its encoder: a sequence that is stepped once a control period; control step.
//!
//! It takes measurements and says which voltage to apply; it knows nothing of hardware. In this order:
//!  - `offsets`: the bridge is off, what the current sensors read is their offset;
//!  - `resistance`: the current along phase A rises to two levels; the rotor turns into line;
//!  - `inductance`: a small alternating voltage on top of the second level, along the magnet and then across it;
//!  - `alignment`: the field turns slowly there and back and takes the rotor along: direction, pole pairs, electrical zero; once more with
//!    less current, with which the zero must be the same;
//!  - the voltage falls to zero and the bridge goes off.
//!
//! The joint moves by [`CalibrationSettings::electrical_turns`] and one electrical turn more, and back, so it must be free to. Every
//! stage ends by itself, within [`CalibrationSequence::longest`] in all; every failure, and [`CalibrationSequence::abort`],
//! switches the bridge off in the same step.

mod alignment;
mod failure;
mod inductance;
mod offsets;
mod resistance;
mod settings;

pub use failure::{Failure, Phase};
pub use settings::CalibrationSettings;

use super::angle::EncoderAlignment;
use super::phases::Phases;
use super::setting::SettingError;
use super::transform::AlphaBeta;
use alignment::Alignment;
use inductance::Inductance;
use offsets::Offsets;
use resistance::{Hold, Resistance};
use settings::Plan;

/// Steps without an encoder's answer that are borne.
pub const TOLERATED_ENCODER_LOSS: u32 = 10;

/// What a step of the calibration starts from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CalibrationInput {
    /// Phase currents as measured, offsets and all, A.
    pub phase_currents: Phases,
    /// Encoder's angle: 2^32 a turn.
    pub encoder: u32,
    /// Whether the encoder answered.
    pub encoder_valid: bool,
    /// Supply, V.
    pub bus_voltage: f32,
}

/// What was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Calibration {
    /// What the current sensors read without current, A.
    pub current_offsets: Phases,
    /// Resistance of a phase at the winding's present temperature, Ω; leads and transistors included.
    pub resistance: f32,
    /// Voltage that a leg loses to dead time and transistors whatever the current, V; what compensation already makes up for is not in
    /// it.
    pub lost_voltage: f32,
    /// Inductance along the magnet at the calibration current, H.
    pub inductance_d: f32,
    /// Inductance across the magnet, H; too low where the rotor is light enough to give way: by the part
    /// 3/2 (pole pairs x flux linkage / w)^2 / (inertia x inductance) with w = 2 pi rate / 8, which is 0.7 % for 14 pole pairs,
    /// 5 mWb, 50 kg mm^2, 90 µH and 20 kHz.
    pub inductance_q: f32,
    /// Direction, pole pairs and electrical zero of the encoder.
    pub alignment: EncoderAlignment,
    /// How far the rotor lagged behind the field, electrical turns: friction against the calibration current, and the back-EMF against the
    /// voltage.
    pub lag: f32,
}

/// Where the sequence is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Progress {
    /// Measuring the current sensors' offsets; the bridge is off.
    Offsets,
    /// Measuring the resistance.
    Resistance,
    /// Measuring the inductance along the magnet, then across it.
    Inductance,
    /// Turning the rotor.
    Alignment,
    /// Taking the voltage away.
    RampDown,
    /// Finished; the bridge is off.
    Done(Calibration),
    /// Given up; the bridge is off.
    Failed(Failure),
}

/// What to do until the next step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CalibrationStep {
    /// Voltage to apply in the stationary frame, V; none: the bridge is to be off.
    pub voltage: Option<AlphaBeta>,
    /// Where the sequence is.
    pub progress: Progress,
}

/// A stage with what it needs to remember.
#[derive(Clone, Copy, Debug)]
enum Stage {
    Offsets(Offsets),
    Resistance(Resistance),
    InductanceD(Hold, Inductance),
    InductanceQ(Hold, f32, Inductance),
    Alignment(Hold, [f32; 2], Alignment),
    Again(Calibration, f32, Alignment),
    RampDown(Calibration, f32),
    Done(Calibration),
    Failed(Failure),
}

/// What a stage says after a step.
enum Next<T, V = AlphaBeta> {
    /// Apply this voltage and go on.
    Continue(V),
    /// The stage has its result.
    Finished(T),
}

/// The calibration from one control step to the next.
#[derive(Clone, Copy, Debug)]
pub struct CalibrationSequence {
    plan: Plan,
    stage: Stage,
    offsets: Phases,
    /// Encoder over all turns, 2^32 a turn; its lower half is the encoder's angle.
    position: Option<i64>,
    encoder_lost: u32,
    steps: u32,
}

impl CalibrationSequence {
    /// Checks settings and begins.
    pub fn new(settings: &CalibrationSettings) -> Result<Self, SettingError> {
        let plan = Plan::new(settings)?;
        let stage = Stage::Offsets(Offsets::default());
        Ok(Self { plan, stage, offsets: Phases::default(), position: None, encoder_lost: 0, steps: 0 })
    }

    /// The longest time that the sequence can take, s.
    pub fn longest(&self) -> f32 {
        self.plan.longest as f32 / self.plan.rate
    }

    /// Where the sequence is.
    pub fn progress(&self) -> Progress {
        match self.stage {
            Stage::Offsets(_) => Progress::Offsets,
            Stage::Resistance(_) => Progress::Resistance,
            Stage::InductanceD(..) | Stage::InductanceQ(..) => Progress::Inductance,
            Stage::Alignment(..) | Stage::Again(..) => Progress::Alignment,
            Stage::RampDown(..) => Progress::RampDown,
            Stage::Done(calibration) => Progress::Done(calibration),
            Stage::Failed(failure) => Progress::Failed(failure),
        }
    }

    /// Gives up at once, unless the sequence is over: the bridge is to be off from now on.
    pub fn abort(&mut self) -> CalibrationStep {
        if !matches!(self.stage, Stage::Done(_) | Stage::Failed(_)) {
            self.stage = Stage::Failed(Failure::Aborted);
        }
        CalibrationStep { voltage: None, progress: self.progress() }
    }

    /// One control step.
    pub fn step(&mut self, input: &CalibrationInput) -> CalibrationStep {
        let voltage = match self.stage {
            Stage::Done(_) | Stage::Failed(_) => None,
            _ => match self.guard(input).and_then(|(currents, position)| self.advance(currents, position)) {
                Ok(voltage) => voltage,
                Err(failure) => {
                    self.stage = Stage::Failed(failure);
                    None
                }
            },
        };
        CalibrationStep { voltage, progress: self.progress() }
    }

    /// What must hold in every step. Currents without offsets, and the position.
    fn guard(&mut self, input: &CalibrationInput) -> Result<(Phases, i64), Failure> {
        self.steps = self.steps.saturating_add(1);
        if self.steps > self.plan.longest {
            return Err(Failure::TooLong { limit: self.longest() });
        }
        let (bus, least) = (input.bus_voltage, self.plan.least_bus_voltage);
        if !(bus >= least && bus.is_finite()) {
            return Err(Failure::SupplyTooLow { voltage: bus, least });
        }
        let (raw, offsets, limit) = (input.phase_currents, self.offsets, self.plan.highest_current);
        let currents = Phases { a: raw.a - offsets.a, b: raw.b - offsets.b, c: raw.c - offsets.c };
        for (phase, current) in [(Phase::A, currents.a), (Phase::B, currents.b), (Phase::C, currents.c)] {
            if current.is_nan() || current.abs() > limit {
                return Err(Failure::OverCurrent { phase, current, limit });
            }
        }
        if input.encoder_valid {
            let way = |last: i64| input.encoder.wrapping_sub(last as u32) as i32 as i64;
            let position = self.position.map_or(input.encoder as i64, |last| last.wrapping_add(way(last)));
            self.position = Some(position);
            self.encoder_lost = 0;
        } else {
            self.encoder_lost = self.encoder_lost.saturating_add(1);
            if self.encoder_lost > TOLERATED_ENCODER_LOSS {
                return Err(Failure::EncoderLost { steps: self.encoder_lost });
            }
        }
        Ok((currents, self.position.unwrap_or(0)))
    }

    /// Steps the present stage, and begins the next where it has its result.
    fn advance(&mut self, currents: Phases, position: i64) -> Result<Option<AlphaBeta>, Failure> {
        let plan = &self.plan;
        let along_a = |voltage: f32| AlphaBeta { alpha: voltage, beta: 0.0 };
        let voltage = match &mut self.stage {
            Stage::Offsets(offsets) => {
                if let Some(found) = offsets.step(plan, currents, position)? {
                    self.offsets = found;
                    self.stage = Stage::Resistance(Resistance::default());
                }
                return Ok(None);
            }
            Stage::Resistance(resistance) => match resistance.step(plan, currents)? {
                Next::Continue(voltage) => voltage,
                Next::Finished(hold) => {
                    self.stage = Stage::InductanceD(hold, Inductance::default());
                    along_a(hold.voltage)
                }
            },
            Stage::InductanceD(hold, inductance) => {
                match inductance.step(plan, hold, AlphaBeta::from_phases(currents).alpha)? {
                    Next::Continue(ripple) => along_a(hold.voltage + ripple),
                    Next::Finished(d) => {
                        let hold = *hold;
                        self.stage = Stage::InductanceQ(hold, d, Inductance::default());
                        along_a(hold.voltage)
                    }
                }
            }
            Stage::InductanceQ(hold, d, inductance) => {
                match inductance.step(plan, hold, AlphaBeta::from_phases(currents).beta)? {
                    Next::Continue(ripple) => AlphaBeta { alpha: hold.voltage, beta: ripple },
                    Next::Finished(q) => {
                        let (hold, d) = (*hold, *d);
                        self.stage = Stage::Alignment(hold, [d, q], Alignment::default());
                        along_a(hold.voltage)
                    }
                }
            }
            Stage::Alignment(hold, inductances, alignment) => match alignment.step(plan, hold.voltage, position)? {
                Next::Continue(voltage) => voltage,
                Next::Finished((found, lag)) => {
                    let [inductance_d, inductance_q] = *inductances;
                    let calibration = Calibration {
                        current_offsets: self.offsets,
                        resistance: hold.resistance,
                        lost_voltage: hold.lost_voltage,
                        inductance_d,
                        inductance_q,
                        alignment: found,
                        lag,
                    };
                    let voltage = hold.with_less_current(alignment::LESS_CURRENT);
                    self.stage = Stage::Again(calibration, voltage, Alignment::default());
                    along_a(voltage)
                }
            },
            Stage::Again(calibration, voltage, alignment) => match alignment.step(plan, *voltage, position)? {
                Next::Continue(voltage) => voltage,
                Next::Finished((again, _)) => {
                    alignment::is_the_same(&calibration.alignment, &again)?;
                    let (calibration, voltage) = (*calibration, *voltage);
                    self.stage = Stage::RampDown(calibration, voltage);
                    along_a(voltage)
                }
            },
            Stage::RampDown(calibration, voltage) => {
                *voltage -= plan.ramp;
                let left = *voltage;
                if left > 0.0 {
                    along_a(left)
                } else {
                    self.stage = Stage::Done(*calibration);
                    return Ok(None);
                }
            }
            Stage::Done(_) | Stage::Failed(_) => return Ok(None),
        };
        Ok(Some(voltage))
    }
}

#[cfg(test)]
mod tests;
