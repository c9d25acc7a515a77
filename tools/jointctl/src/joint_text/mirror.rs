//! The configuration's form in a file: the firmware's own records, key by key; host.
//!
//! The firmware knows nothing of files, so serde is told here what its records look like; a field that is added to one
//! of them and not here does not compile.

use friction_compensation::compensation::Request;
use joint_firmware::joint::configuration::{
    AdaptationRequest, CollisionReaction, CompensationConfiguration, Configuration, FACTORY_TRIM, FRICTION_UNCERTAINTY,
    Gains, GearConfiguration, LOAD_UNCERTAINTY, Limits, LoadConfiguration, LoadFeedforwardRequest, MotorConfiguration,
    ThermalConfiguration, VelocitySource,
};
use joint_firmware::joint::stop_options::StopConfiguration;
use joint_firmware::motor::angle::{Direction, ElectricalAngle, EncoderAlignment};
use serde::{Deserialize, Serialize};

/// A whole file.
#[derive(Serialize, Deserialize)]
#[serde(transparent)]
pub(super) struct Text(#[serde(with = "ConfigurationText")] pub Configuration);

#[derive(Serialize, Deserialize)]
#[serde(remote = "Configuration", deny_unknown_fields)]
struct ConfigurationText {
    node_id: u8,
    #[serde(default = "oscillator_trim")]
    oscillator_trim: u8,
    #[serde(with = "MotorText")]
    motor: MotorConfiguration,
    #[serde(with = "GearText")]
    gear: GearConfiguration,
    #[serde(with = "LimitsText")]
    limits: Limits,
    #[serde(with = "GainsText")]
    gains: Gains,
    #[serde(default, with = "StopText")]
    stops: StopConfiguration,
    #[serde(with = "CompensationText")]
    compensation: CompensationConfiguration,
    #[serde(default, with = "LoadText")]
    load: LoadConfiguration,
    #[serde(with = "ThermalText")]
    thermal: ThermalConfiguration,
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "MotorConfiguration", deny_unknown_fields)]
struct MotorText {
    resistance: f32,
    inductance_d: f32,
    inductance_q: f32,
    torque_constant: f32,
    current_limit: f32,
    loss_current: f32,
    #[serde(default)]
    field_weakening_current: f32,
    #[serde(with = "AlignmentText")]
    alignment: EncoderAlignment,
    encoder_latency: f32,
    #[serde(default = "encoder_counts")]
    encoder_counts: u32,
}

/// Default of a file that says nothing of it.
fn oscillator_trim() -> u8 {
    FACTORY_TRIM
}

/// Default of a file that says nothing of it.
fn encoder_counts() -> u32 {
    4_000
}

/// Default of a file that says nothing of it.
fn chopper_share() -> f32 {
    0.1
}

/// Default of a file that says nothing of it.
fn voltage_fraction() -> f32 {
    1.0
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "EncoderAlignment", deny_unknown_fields)]
struct AlignmentText {
    pole_pairs: u32,
    #[serde(with = "DirectionText")]
    direction: Direction,
    #[serde(with = "turns")]
    electrical_zero: ElectricalAngle,
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "Direction", rename_all = "kebab-case")]
enum DirectionText {
    Forward,
    Reverse,
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "GearConfiguration", deny_unknown_fields)]
struct GearText {
    ratio: f32,
    zero: f32,
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "Limits", deny_unknown_fields)]
struct LimitsText {
    torque: f32,
    velocity: f32,
    position: (f32, f32),
    position_margin: f32,
    damping: f32,
    over_current: f32,
    bus_voltage: (f32, f32),
    regeneration_band: f32,
    #[serde(default)]
    chopper_voltage: f32,
    #[serde(default = "chopper_share")]
    chopper_share: f32,
    bridge_temperature: f32,
    winding_temperature: f32,
    command_deadline: f32,
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "Gains", deny_unknown_fields)]
struct GainsText {
    current_bandwidth: f32,
    observer_bandwidth: f32,
    #[serde(default = "voltage_fraction")]
    voltage_fraction: f32,
    stiffness: f32,
    damping: f32,
    integral: f32,
    acceleration: f32,
    quick_stop_deceleration: f32,
    braking_time: f32,
}

/// A file of an earlier program has none of this.
#[derive(Serialize, Deserialize)]
#[serde(remote = "StopConfiguration", deny_unknown_fields)]
struct StopText {
    quick_stop: u8,
    shutdown: u8,
    disable_operation: u8,
    halt: u8,
    fault_reaction: u8,
    late_command: u8,
    brake_release: f32,
    brake_apply: f32,
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "CompensationConfiguration", deny_unknown_fields)]
struct CompensationText {
    #[serde(with = "RequestText")]
    request: Request,
    gain: f32,
    clamp: f32,
    slew: f32,
    #[serde(with = "VelocitySourceText")]
    velocity_source: VelocitySource,
    standstill_velocity: f32,
    #[serde(default = "uncertainty")]
    uncertainty: f32,
    #[serde(default, with = "AdaptationText")]
    adaptation: AdaptationRequest,
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "AdaptationRequest", rename_all = "kebab-case")]
enum AdaptationText {
    Off,
    Shadow,
    On,
}

/// A file of an earlier program has none of this.
#[derive(Serialize, Deserialize)]
#[serde(remote = "LoadConfiguration", deny_unknown_fields)]
struct LoadText {
    #[serde(with = "LoadFeedforwardText")]
    request: LoadFeedforwardRequest,
    inertia: f32,
    gravity: f32,
    hanging: f32,
    payload_mass: f32,
    payload_arm: f32,
    #[serde(default = "load_uncertainty")]
    uncertainty: f32,
    #[serde(default)]
    collision_threshold: f32,
    #[serde(default, with = "CollisionText")]
    collision_reaction: CollisionReaction,
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "CollisionReaction", rename_all = "kebab-case")]
enum CollisionText {
    Off,
    Warning,
    QuickStop,
    Hold,
    Yield,
}

const fn load_uncertainty() -> f32 {
    LOAD_UNCERTAINTY
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "LoadFeedforwardRequest", rename_all = "kebab-case")]
enum LoadFeedforwardText {
    Off,
    Acceleration,
    Gravity,
    Both,
}

/// Files of earlier programs have none.
fn uncertainty() -> f32 {
    FRICTION_UNCERTAINTY
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "Request", rename_all = "kebab-case")]
enum RequestText {
    Off,
    Physical,
    PhysicalAndNetwork,
    NetworkInShadow,
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "VelocitySource", rename_all = "kebab-case")]
enum VelocitySourceText {
    Reference,
    Measured,
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "ThermalConfiguration", deny_unknown_fields)]
struct ThermalText {
    winding_capacity: f32,
    housing_capacity: f32,
    winding_to_housing: f32,
    housing_to_ambient: f32,
    ambient: f32,
}

/// An angle as a fraction of an electrical turn: 32 bits fit a double exactly.
mod turns {
    use super::ElectricalAngle;
    use serde::de::Error;
    use serde::{Deserialize, Deserializer, Serializer};

    /// Steps in a turn.
    const STEPS: f64 = 4_294_967_296.0;

    pub fn serialize<S: Serializer>(angle: &ElectricalAngle, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_f64(f64::from(angle.0) / STEPS)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<ElectricalAngle, D::Error> {
        let turns = f64::deserialize(deserializer)?;
        if !(0.0..1.0).contains(&turns) {
            return Err(D::Error::custom(format!("electrical_zero is {turns} turns, must lie in 0 to below 1")));
        }
        // An angle within half a step of a whole turn is zero again.
        Ok(ElectricalAngle((turns * STEPS).round() as u64 as u32))
    }
}
