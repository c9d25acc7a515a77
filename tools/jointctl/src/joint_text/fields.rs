//! Meaning of each key of `joint.toml`, with its unit and range; host.
//!
//! Table and key are the path of the [`Setting`], unit and range those of its object: a key costs a line here.

use crate::remote::entry::Entry;
use joint_firmware::objects::settings::Setting;
use std::sync::LazyLock;

/// One key.
#[derive(Clone, Debug, PartialEq)]
pub struct Field {
    /// Table that it stands in; empty at the top.
    pub table: String,
    /// Key.
    pub key: &'static str,
    /// Meaning, with what else limits it.
    pub meaning: &'static str,
    /// Unit; empty for a ratio, a number of things or a choice.
    pub unit: String,
    /// Lowest and highest value where these are fixed numbers; of each entry, where there are two.
    pub range: Option<(f64, f64)>,
}

impl Field {
    /// The comment above the key.
    #[must_use]
    pub fn comment(&self) -> String {
        let range = self.range.map(|(low, high)| format!("{low} to {high}"));
        let unit = (!self.unit.is_empty()).then(|| self.unit.clone());
        let limits: Vec<String> = unit.into_iter().chain(range).collect();
        match limits.is_empty() {
            true => self.meaning.to_owned(),
            false => format!("{} [{}]", self.meaning, limits.join(", ")),
        }
    }
}

/// A setting's key, with the range of its object.
fn ranged(setting: Setting, meaning: &'static str) -> Field {
    Field { range: Entry::of_setting(setting).text.limits, ..explained(setting, meaning) }
}

/// The same without: the meaning names the choices, or the other settings that limit this one.
fn explained(setting: Setting, meaning: &'static str) -> Field {
    let (&key, table) = setting.path().split_last().unwrap_or((&"", &[]));
    // As people type it.
    let unit = Entry::of_setting(setting).text.unit.replace('Ω', "Ohm").replace('²', "^2");
    Field { table: table.join("."), key, meaning, unit, range: None }
}

/// All keys. The node id has no object of its own: it is the bus's.
pub static FIELDS: LazyLock<Vec<Field>> = LazyLock::new(|| {
    vec![
        Field {
            table: String::new(),
            key: "node_id",
            meaning: "Node on the CAN bus, 1 to 127; 255 where none is assigned yet",
            unit: String::new(),
            range: None,
        },
        ranged(Setting::OscillatorTrim, "Trim of the board's oscillator, steps of some 0.3 %"),
        ranged(Setting::Resistance, "Resistance of a phase at 25 °C"),
        ranged(Setting::InductanceD, "Inductance along the magnet's flux"),
        ranged(Setting::InductanceQ, "Inductance across the magnet's flux"),
        ranged(Setting::TorqueConstant, "Torque at the rotor by q current"),
        ranged(Setting::CurrentLimit, "Largest current; at most the board's"),
        explained(
            Setting::LossCurrent,
            "Largest d current that burns braking energy which the supply does not take; 0 (none) to the current limit",
        ),
        explained(
            Setting::FieldWeakeningCurrent,
            "Largest d current against the magnet's flux; 0 (none) to the current limit and flux linkage over inductance",
        ),
        ranged(Setting::EncoderLatency, "Age of an encoder sample when it is used"),
        ranged(Setting::EncoderCounts, "Counts a turn of an incremental encoder, four times its lines"),
        ranged(Setting::PolePairs, "Electrical turns in a mechanical one"),
        explained(Setting::Direction, "The encoder counts \"forward\" with the field, or in \"reverse\""),
        explained(Setting::ElectricalZero, "Electrical angle where the d axis lies on phase A, 0 to below 1"),
        explained(
            Setting::GearRatio,
            "Rotor revolutions per revolution of the joint, 1 to 500; negative where it turns backwards",
        ),
        ranged(Setting::JointZero, "Joint's position where the encoder's first sample reads zero"),
        ranged(Setting::TorqueLimit, "Largest torque at the joint"),
        ranged(Setting::VelocityLimit, "Largest velocity; a fault 20 % above it"),
        ranged(Setting::LowestPosition, "Lowest and highest position"),
        ranged(Setting::PositionMargin, "Distance beyond the position limits that is a fault"),
        explained(
            Setting::LimitDamping,
            "Torque fades with it towards the limits, and the joint brakes with it; 5 times the torque limit over the velocity limit to 1e6",
        ),
        explained(
            Setting::OverCurrent,
            "Phase current that switches the bridge off; 1.05 times the current limit to the board's",
        ),
        ranged(Setting::LowestBusVoltage, "Lowest and highest supply; at most the board's"),
        explained(
            Setting::RegenerationBand,
            "Span below the highest supply over which braking current fades; 0.1 to highest less lowest",
        ),
        explained(
            Setting::ChopperVoltage,
            "Supply at which a brake chopper conducts; 0 (none), or 1 V above the lowest supply to where the regeneration band begins",
        ),
        ranged(
            Setting::ChopperShare,
            "Largest part of the time in which it may conduct, over 10 s: power times resistance over chopper_voltage squared",
        ),
        ranged(
            Setting::BridgeTemperature,
            "Highest temperature of the bridge, at most the board's; derated over the last 20 K",
        ),
        ranged(Setting::WindingTemperature, "Highest temperature of the winding; derated over the last 20 K"),
        ranged(Setting::CommandDeadline, "Time without a command after which the joint brakes; at most the board's"),
        explained(Setting::CurrentBandwidth, "Bandwidth of the current loop; 10 to an eighteenth of the control rate"),
        explained(Setting::ObserverBandwidth, "Bandwidth of the tracking observer; 1 to a tenth of the control rate"),
        ranged(
            Setting::VoltageFraction,
            "Longest voltage vector over the longest one that fits at any angle; 1.1547 uses the whole hexagon",
        ),
        ranged(Setting::Stiffness, "Stiffness of the position mode"),
        ranged(Setting::Damping, "Damping of position and velocity mode"),
        ranged(Setting::Integral, "Integral of the velocity error; a tenth of it in position mode"),
        ranged(Setting::Acceleration, "Acceleration of ramps"),
        ranged(Setting::QuickStopDeceleration, "Deceleration of quick stop and fault reaction"),
        ranged(Setting::BrakingTime, "Longest time of braking before the bridge switches off"),
        explained(
            Setting::QuickStop,
            "605Ah: 0 off at once, 1 along the ramp of the modes, 2 along its own; 5, 6 the same, then it holds",
        ),
        explained(Setting::Shutdown, "605Bh: 0 off at once, 1 along the ramp of the modes"),
        explained(Setting::DisableOperation, "605Ch: 0 off at once, 1 along the ramp of the modes"),
        explained(Setting::Halt, "605Dh: 1 along the ramp of the modes, 2 of the quick stop; then it holds"),
        explained(
            Setting::FaultReaction,
            "605Eh, where a fault permits braking: 0 off at once, 1 along the ramp of the modes, 2 of the quick stop",
        ),
        explained(Setting::LateCommand, "6007h: a command that is late is 1 a fault, 3 a quick stop"),
        ranged(Setting::BrakeRelease, "Time in which the holding brake opens"),
        ranged(Setting::BrakeApply, "Time in which the holding brake closes"),
        explained(Setting::Request, "\"off\", \"physical\", \"physical-and-network\" or \"network-in-shadow\""),
        ranged(Setting::CompensationGain, "Share of the estimated friction that is added"),
        explained(Setting::Clamp, "Largest compensation torque; 0 to the torque limit"),
        ranged(Setting::Slew, "Largest change of the compensation torque"),
        explained(
            Setting::VelocitySource,
            "Friction is computed for the \"reference\" velocity or the \"measured\" one",
        ),
        ranged(Setting::StandstillVelocity, "Velocity below which compensation fades out"),
        ranged(
            Setting::Uncertainty,
            "By how much friction may be less than gain times the model; what the energy guard may take",
        ),
        explained(Setting::Adaptation, "Adaptation in service: \"off\", \"shadow\" (without effect) or \"on\""),
        explained(
            Setting::LoadFeedforward,
            "Torques of the load that the joint adds by itself: \"off\", \"acceleration\", \"gravity\" or \"both\"",
        ),
        ranged(
            Setting::LoadInertia,
            "Inertia about the joint without payload, rotor times the gear ratio squared included",
        ),
        ranged(Setting::LoadGravity, "Largest gravity torque without payload, with the lever level"),
        ranged(Setting::HangingPosition, "Position in which the lever hangs straight down"),
        ranged(Setting::PayloadMass, "Payload"),
        ranged(Setting::PayloadArm, "Distance of the payload's centre of mass from the axis"),
        ranged(
            Setting::LoadUncertainty,
            "Part of true inertia and gravity by which those of this section may be wrong",
        ),
        ranged(Setting::CollisionThreshold, "External torque beyond its uncertainty that is a collision"),
        explained(
            Setting::CollisionReaction,
            "Reaction to a collision: \"off\" (it counts), \"warning\" (EMCY), \"quick-stop\", \"hold\" or \"yield\"",
        ),
        explained(Setting::WindingCapacity, "Heat capacity of the winding; to 10000"),
        explained(Setting::HousingCapacity, "Heat capacity of the housing; to 100000"),
        ranged(Setting::WindingToHousing, "Thermal resistance from winding to housing"),
        ranged(Setting::HousingToAmbient, "Thermal resistance from housing to ambient"),
        ranged(Setting::Ambient, "Temperature of the surroundings"),
    ]
});
