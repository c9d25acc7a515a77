//! Calibration in place of motion; control step.
//!
//! It runs only while the joint is off: in "not ready to switch on" and "switch on disabled". Any way out of these, by a command as well as
//! by a fault, gives it up and has the bridge off in the same step. Not ready is permitted, because a joint whose encoder has no
//! reference and cannot be turned by hand would never become ready otherwise.

use super::active::Active;
use super::signals::{Bridge, BridgeState, Measurements};
use super::state_machine::State;
use crate::motor::calibration::{CalibrationInput, CalibrationSequence, CalibrationSettings, Progress};
use crate::motor::phases::Phases;
use crate::motor::setting::SettingError;
use crate::motor::transform::{AlphaBeta, Dq};

/// The calibration that runs or ran last.
#[derive(Clone, Debug, Default)]
pub(super) struct Calibrating {
    sequence: Option<CalibrationSequence>,
    runs: bool,
}

const OFF: (Bridge, Dq) = (Bridge::OFF, Dq { d: 0.0, q: 0.0 });

impl Calibrating {
    pub fn begin(&mut self, state: State, settings: &CalibrationSettings) -> Result<(), SettingError> {
        self.sequence = Some(CalibrationSequence::new(settings)?);
        self.runs = true;
        if !is_off(state) {
            self.abort();
        }
        Ok(())
    }

    pub fn abort(&mut self) {
        if let Some(sequence) = &mut self.sequence {
            sequence.abort();
        }
        self.runs = false;
    }

    /// Whether it has not ended.
    pub const fn runs(&self) -> bool {
        self.runs
    }

    pub fn progress(&self) -> Option<Progress> {
        self.sequence.as_ref().map(CalibrationSequence::progress)
    }

    /// The bridge for the next period, and the current that flows, A: a vector that stands still, and heats like one that turns.
    #[inline(always)]
    pub fn step(&mut self, state: State, active: &Active, measured: &Measurements, currents: Phases) -> (Bridge, Dq) {
        if self.runs { self.run(state, active, measured, currents) } else { OFF }
    }

    /// A function of its own, which may lie where code waits for the flash: on a board that has only one bank, nothing is written there
    /// while this runs.
    #[inline(never)]
    fn run(&mut self, state: State, active: &Active, measured: &Measurements, currents: Phases) -> (Bridge, Dq) {
        if !is_off(state) {
            self.abort();
        }
        let Some(sequence) = &mut self.sequence else { return OFF };
        let input = CalibrationInput {
            phase_currents: measured.phase_currents,
            encoder: measured.encoder,
            encoder_valid: measured.encoder_valid,
            bus_voltage: measured.bus_voltage,
        };
        let step = sequence.step(&input);
        self.runs = !matches!(step.progress, Progress::Done(_) | Progress::Failed(_));
        let Some(voltage) = step.voltage else { return OFF };
        let modulated = active.field_oriented.modulator.modulate(voltage, measured.bus_voltage, currents);
        let AlphaBeta { alpha, beta } = AlphaBeta::from_phases(currents);
        (Bridge { state: BridgeState::Switching, duties: modulated.duties }, Dq { d: alpha, q: beta })
    }
}

/// Whether a joint in this state may be calibrated.
const fn is_off(state: State) -> bool {
    matches!(state, State::NotReadyToSwitchOn | State::SwitchOnDisabled)
}
