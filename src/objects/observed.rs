//! Observation of the joint at one instant, and the actual values that objects show of it; receive interrupt and task.

use super::field::{Actual, SetPoint};
use super::friction_statistics::FrictionStatistics;
use super::number::{temperature, to_i16, to_i32, to_u16, to_u32};
use super::operation::Operation;
use super::shared::Shared;
use crate::joint::adaptation;
use crate::joint::configuration::LOADS;
use crate::joint::external_torque;
use crate::joint::fault::Faults;
use crate::joint::state_machine::State;
use crate::joint::{PROFILES, Telemetry};
use friction_compensation::compensation::{Parts, Reason};
use friction_compensation::quantity::Torque;

/// A copy of what the control step and the slow task know.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observed {
    /// Telemetry of a control step.
    pub telemetry: Telemetry,
    /// Faults since the last acknowledgement.
    pub latched: Faults,
    /// Torque of the command that this step followed, [`Command::torque`](crate::joint::Command::torque), Nm.
    pub feedforward_torque: f32,
    /// °C; NaN where it is not known.
    pub winding_temperature: f32,
    /// °C; NaN where the board has no sensor.
    pub bridge_temperature: f32,
    /// Statistics of the compensation.
    pub friction: FrictionStatistics,
    /// Report of adaptation.
    pub adaptation: adaptation::Report,
    /// Report of the external torque; no byte of it where a program has no room.
    pub external: [external_torque::Report; LOADS as usize],
}

impl Default for Observed {
    /// Observation before the first control step.
    fn default() -> Self {
        Self {
            telemetry: Telemetry::default(),
            latched: Faults::NONE,
            feedforward_torque: 0.0,
            winding_temperature: f32::NAN,
            bridge_temperature: f32::NAN,
            friction: FrictionStatistics::default(),
            adaptation: adaptation::Report::default(),
            external: [external_torque::Report::NOTHING; LOADS as usize],
        }
    }
}

impl Observed {
    /// Torque that neither the command's feed-forward nor compensation explain, Nm: in position, velocity and impedance
    /// mode what is left for the controller, which is what a better friction model would take over.
    pub fn residual(&self) -> f32 {
        self.telemetry.torque() - self.feedforward_torque - self.telemetry.compensated.torque
    }

    /// A part of the model's torque, Nm.
    fn part(&self, part: fn(&Parts) -> Torque) -> f32 {
        self.telemetry.compensated.output.parts.first().map_or(0.0, |parts| nm(part(parts)))
    }

    /// Demanded position at this instant, rad: where nothing demands one, the actual position.
    pub(super) fn position_demand(&self) -> f32 {
        let t = &self.telemetry;
        if t.state.makes_torque() { t.position_demand } else { t.motion.position }
    }

    /// The value as its object carries it, sign-extended.
    pub(super) fn actual(&self, actual: Actual, shared: &Shared) -> u64 {
        let t = &self.telemetry;
        let permille = |torque: f32| {
            let rated = shared.rated_torque();
            let part = if rated > 0.0 { torque / rated } else { 0.0 };
            signed(to_i16(1e3 * part).into())
        };
        let milli = |value: f32| signed(to_i16(1e3 * value).into());
        let tenths = |value: f32| signed(temperature(value).into());
        match actual {
            Actual::Statusword => {
                // In profile velocity mode the bit tells of a standstill.
                let told = PROFILES && shared.mode() == Some(Operation::ProfileVelocity);
                let follows = t.state == State::OperationEnabled && shared.follows() && !t.held && !told;
                (t.statusword() | u16::from(follows) << 12 | shared.status()).into()
            }
            Actual::Mode => shared.set_point(SetPoint::Mode),
            Actual::Position => signed(to_i32(1e6 * t.motion.position)),
            Actual::Velocity => signed(to_i32(1e3 * t.motion.velocity)),
            Actual::Torque => permille(t.torque()),
            Actual::TorqueDemand => permille(t.wanted.torque),
            Actual::PositionDemand
            | Actual::FollowingError
            | Actual::Current
            | Actual::DcLink
            | Actual::PhysicalTorque
            | Actual::NetworkTorque
            | Actual::PreSlidingTorque
            | Actual::AdaptationTorque
                if !PROFILES =>
            {
                0
            }
            Actual::PositionDemand => signed(to_i32(1e6 * self.position_demand())),
            Actual::FollowingError => signed(to_i32(1e6 * (self.position_demand() - t.motion.position))),
            Actual::Current => {
                let rated = shared.rated_current();
                let part = if rated > 0.0 { t.current.q / rated } else { 0.0 };
                signed(to_i16(1e3 * part).into())
            }
            Actual::DcLink => to_u32(1e3 * t.bus_voltage).into(),
            Actual::RatedTorque => to_u32(1e3 * shared.rated_torque()).into(),
            Actual::ErrorCode => self.latched.iter().next().map_or(0, |fault| fault.error_code().into()),
            Actual::CompensationTorque => milli(t.compensated.torque),
            Actual::Residual => milli(self.residual()),
            Actual::BusVoltage => to_u16(100.0 * t.bus_voltage).into(),
            Actual::WindingTemperature => tenths(self.winding_temperature),
            Actual::BridgeTemperature => tenths(self.bridge_temperature),
            Actual::GearTemperature => tenths(t.gear_temperature),
            Actual::LatchedFaults => fault_bits(self.latched).into(),
            Actual::ActingModel => t.compensated.output.acting as u64,
            Actual::Reason => reason_number(t.compensated.output.reason).into(),
            Actual::Violations => self.friction.violations().into(),
            Actual::ShadowRms => self.friction.shadow_rms().to_bits().into(),
            Actual::Permitted => to_u16(1e3 * t.compensated.permitted).into(),
            Actual::Learning => self.adaptation.learning as u64,
            Actual::AdaptedFactor => self.adaptation.factors.factor.to_bits().into(),
            Actual::FactorDeviation => self.adaptation.deviation.to_bits().into(),
            Actual::AdaptedViscous => self.adaptation.factors.viscous.to_bits().into(),
            Actual::PhysicalTorque => milli(self.part(|parts| parts.physical)),
            Actual::NetworkTorque => milli(self.part(|parts| parts.network)),
            Actual::PreSlidingTorque => milli(self.part(|parts| parts.pre_sliding)),
            Actual::AdaptationTorque => {
                milli(t.compensated.torque - t.compensated.permitted * nm(t.compensated.output.torque))
            }
            Actual::Outputs => u64::from(!t.outputs.brake_open()) | u64::from(t.outputs.chopper()) << 16,
            Actual::ExternalTorque => self.external.first().map_or(0, |external| permille(external.torque)),
            Actual::ExternalUncertainty => self.external.first().map_or(0, |external| permille(external.uncertainty)),
            Actual::Collisions => self.external.first().map_or(0, |external| external.collisions.into()),
            Actual::ImageVersion => shared.image_version().into(),
            Actual::ImageState => shared.image_state().into(),
        }
    }
}

fn nm(torque: Torque) -> f32 {
    torque.to_bits() as f32 * (1.0 / 65_536.0)
}

/// Value as an object carries it: the low bytes are the value's, whatever its length.
pub(super) fn signed(value: i32) -> u64 {
    i64::from(value) as u64
}

/// A bit for each fault: n - 1 for fault n.
pub(super) fn fault_bits(faults: Faults) -> u16 {
    faults.iter().fold(0, |bits, fault| bits | 1u16.checked_shl((fault as u32).wrapping_sub(1)).unwrap_or(0))
}

/// The number of a reason in object 2200h:8.
pub(super) const fn reason_number(reason: Reason) -> u8 {
    match reason {
        Reason::AsRequested => 0,
        Reason::Off => 1,
        Reason::NoModel => 2,
        Reason::NoNetwork => 3,
        Reason::OutsideTrainedBox(signal) => 16 + signal as u8,
        Reason::FarOutsideTrainedBox(signal) => 32 + signal as u8,
    }
}
