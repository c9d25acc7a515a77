//! Faults that can occur, as data: sensors, leads, transistors, supply, load.

use super::legs::Phase;
use crate::error::{ParameterError, within};
use serde::{Deserialize, Serialize};

/// A measured quantity; its unit is that of a [`Failure`]'s numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Channel {
    /// Current of phase A, A.
    CurrentA,
    /// Current of phase B, A.
    CurrentB,
    /// Current of phase C, A.
    CurrentC,
    /// Rotor encoder, turns.
    Encoder,
    /// Bus voltage, V.
    BusVoltage,
    /// Winding temperature, °C.
    WindingTemperature,
    /// Bridge temperature, °C.
    BridgeTemperature,
}

impl Channel {
    /// All channels, in order.
    pub const ALL: [Self; 7] = [
        Self::CurrentA,
        Self::CurrentB,
        Self::CurrentC,
        Self::Encoder,
        Self::BusVoltage,
        Self::WindingTemperature,
        Self::BridgeTemperature,
    ];

    /// The current sensor of `phase`.
    #[must_use]
    pub fn current(phase: Phase) -> Self {
        match phase {
            Phase::A => Self::CurrentA,
            Phase::B => Self::CurrentB,
            Phase::C => Self::CurrentC,
        }
    }
}

/// Failure of a sensor.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Failure {
    /// Stuck reading: it repeats the last one before the failure.
    Stuck,
    /// Its line is interrupted: the lowest reading of its range, for a thermistor the cold end. An encoder answers with
    /// ones only and its reading is not valid.
    Open,
    /// Its line is shorted: the highest reading of its range, for a thermistor the hot end. An encoder answers with
    /// zeros only, and an even parity passes them as valid.
    Shorted,
    /// Every reading from now on is off by this much, -1e6 to 1e6.
    Offset(f64),
    /// Readings gain noise of this standard deviation, 0 to 1e6.
    Noisy(f64),
}

/// Fault of the actuator or its load.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Fault {
    /// A sensor fails.
    Sensor(Channel, Failure),
    /// A motor lead breaks.
    PhaseOpen(Phase),
    /// A low-side transistor conducts for good: the phase is tied to the negative rail, and its high side, when it
    /// switches, shorts the bus.
    PhaseShorted(Phase),
    /// The source takes this voltage without load, 0 to 1000 V.
    SourceVoltage(f64),
    /// The gate driver reports a fault; the bridge itself is healthy.
    GateDriver,
    /// Blocked load: something holds the link where it is.
    LoadBlocked,
    /// External torque on the link, -1e5 to 1e5 Nm.
    ExternalTorque(f64),
}

impl Fault {
    /// Checks the fault's number against its documented range.
    ///
    /// # Errors
    /// The number, when it is outside its range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        match *self {
            Self::Sensor(_, Failure::Offset(offset)) => within("fault.offset", offset, -1e6, 1e6),
            Self::Sensor(_, Failure::Noisy(deviation)) => within("fault.noisy", deviation, 0.0, 1e6),
            Self::SourceVoltage(voltage) => within("fault.source_voltage", voltage, 0.0, 1000.0),
            Self::ExternalTorque(torque) => within("fault.external_torque", torque, -1e5, 1e5),
            _ => Ok(()),
        }
    }
}

/// Faults that are active at one time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ActiveFaults {
    /// Failure of each channel, in the order of [`Channel::ALL`]; of several the last injected counts.
    pub sensors: [Option<Failure>; 7],
    /// Phases whose lead is broken.
    pub open: [bool; 3],
    /// Phases that are tied to the negative rail.
    pub shorted: [bool; 3],
    /// Voltage of the source, V.
    pub source_voltage: Option<f64>,
    /// The gate driver reports a fault.
    pub gate_driver: bool,
    /// The link is held.
    pub blocked: bool,
    /// Sum of the torques on the link, Nm.
    pub external_torque: f64,
}

impl ActiveFaults {
    fn add(&mut self, fault: Fault) {
        match fault {
            Fault::Sensor(channel, failure) => self.sensors[channel as usize] = Some(failure),
            Fault::PhaseOpen(phase) => self.open[phase.index()] = true,
            Fault::PhaseShorted(phase) => self.shorted[phase.index()] = true,
            Fault::SourceVoltage(voltage) => self.source_voltage = Some(voltage),
            Fault::GateDriver => self.gate_driver = true,
            Fault::LoadBlocked => self.blocked = true,
            Fault::ExternalTorque(torque) => self.external_torque += torque,
        }
    }
}

/// Faults and when they are there.
#[derive(Clone, Debug, Default)]
pub(crate) struct Schedule {
    planned: Vec<(Fault, f64, f64)>,
    next_change: Option<f64>,
}

impl Schedule {
    /// `fault` from `start` to before `end`, s.
    pub(crate) fn plan(&mut self, fault: Fault, start: f64, end: f64) {
        self.planned.push((fault, start, end));
        self.next_change = Some(f64::MIN);
    }

    /// Forgets every fault, present and planned.
    pub(crate) fn clear(&mut self) {
        self.planned.clear();
        self.next_change = Some(f64::MIN);
    }

    /// Faults that are active at `time` (s), where that has changed since the last call.
    pub(crate) fn changed(&mut self, time: f64) -> Option<ActiveFaults> {
        if self.next_change.is_none_or(|change| time < change) {
            return None;
        }
        let mut active = ActiveFaults::default();
        let mut next = f64::INFINITY;
        for (fault, start, end) in &self.planned {
            if time < *start {
                next = next.min(*start);
            } else if time < *end {
                next = next.min(*end);
                active.add(*fault);
            }
        }
        self.next_change = next.is_finite().then_some(next);
        Some(active)
    }
}
