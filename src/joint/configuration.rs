//! Configuration of a joint, what it is and may do: one record in SI units, checked as a whole and prepared for the
//! control step; task, host.
//!
//! It is separate from the friction image: it changes when the joint is built or its limits are set, the image whenever
//! the friction is learned anew.

use super::board_limits::BoardLimits;
use super::stop_options::StopConfiguration;
use crate::motor::angle::EncoderAlignment;
use crate::motor::number::lesser;
use crate::motor::setting::{Name, SettingError, in_range, within_range};
use friction_compensation::compensation::{Request, SettingsError};
#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

pub use super::limits::Limits;

/// Presence of the load's model in this program. With the feature `little-room` a chip's program does not have it; on
/// the host nothing changes.
pub const LOADS: bool = !cfg!(all(feature = "little-room", target_os = "none"));
/// Control steps of a round of the motion loop, each of which does a [stage](super::motion_loop::Stage) of it.
pub const MOTION_STEPS: u32 = 5;

/// Values of keys in files of programs that did not have them yet, where these are not the default of their type; host.
#[cfg(feature = "serde")]
mod earlier {
    pub const fn encoder_counts() -> u32 {
        4_000
    }

    pub const fn voltage_fraction() -> f32 {
        1.0
    }

    pub const fn friction_uncertainty() -> f32 {
        super::FRICTION_UNCERTAINTY
    }

    pub const fn load_uncertainty() -> f32 {
        super::LOAD_UNCERTAINTY
    }

    pub const fn oscillator_trim() -> u8 {
        super::FACTORY_TRIM
    }
}

/// Motor and encoder on its shaft.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(deny_unknown_fields))]
pub struct MotorConfiguration {
    /// Resistance of a phase at 25 °C, Ω; 0.001 to 100.
    pub resistance: f32,
    /// Inductance along the magnet's flux, H; 1 µH to 0.1 H.
    pub inductance_d: f32,
    /// Inductance across the magnet's flux, H; 1 µH to 0.1 H.
    pub inductance_q: f32,
    /// Torque at the rotor by q current, Nm/A; 0.001 to 5.
    pub torque_constant: f32,
    /// Largest current, A; 0.1 to the board's largest.
    pub current_limit: f32,
    /// Largest d current that makes loss of braking energy which the supply does not take, A; 0 (none) to the current
    /// limit.
    pub loss_current: f32,
    /// Largest d current that weakens the field, A; 0 (off) to the current limit, and to flux linkage over inductance.
    /// See [`crate::motor::field_weakening`].
    #[cfg_attr(feature = "serde", serde(default))]
    pub field_weakening_current: f32,
    /// Alignment of the encoder on the motor.
    pub alignment: EncoderAlignment,
    /// Age of an encoder sample when the control step sees it, s; 0 to 1 ms.
    pub encoder_latency: f32,
    /// Counts a turn of an incremental encoder, four times its lines; 16 to 65,535. An absolute one has no use for it.
    #[cfg_attr(feature = "serde", serde(default = "earlier::encoder_counts"))]
    pub encoder_counts: u32,
}

/// Gear and joint.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(deny_unknown_fields))]
pub struct GearConfiguration {
    /// Rotor revolutions per revolution of the joint, 1 to 500; negative where a positive rotor turns the joint
    /// backwards.
    pub ratio: f32,
    /// Joint's position where the encoder's first sample reads zero, rad; -1000 to 1000.
    pub zero: f32,
}

/// Gains with which the joint follows its commands.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(deny_unknown_fields))]
pub struct Gains {
    /// Bandwidth of the current loop, Hz; 10 to an eighteenth of the control rate.
    pub current_bandwidth: f32,
    /// Bandwidth of the tracking observer, Hz; 1 to a tenth of the control rate.
    pub observer_bandwidth: f32,
    /// Longest voltage vector, over the longest one that fits at any angle; 0.1 to 2 / sqrt 3, where it reaches the
    /// corners of the hexagon.
    #[cfg_attr(feature = "serde", serde(default = "earlier::voltage_fraction"))]
    pub voltage_fraction: f32,
    /// Stiffness of the position mode, Nm/rad; 0 to 1e5.
    pub stiffness: f32,
    /// Damping of position and velocity mode, Nm s/rad; 0 to 1e4.
    pub damping: f32,
    /// Integral of the velocity error in velocity mode, Nm/rad; 0 to 1e6. Position mode integrates at a tenth of it.
    pub integral: f32,
    /// Acceleration of ramps, rad/s²; 0.1 to 1e5.
    pub acceleration: f32,
    /// Deceleration of quick stop and fault reaction, rad/s²; 0.1 to 1e5.
    pub quick_stop_deceleration: f32,
    /// Longest time that braking may take before the bridge switches off, s; 0.01 to 10.
    pub braking_time: f32,
}

/// Form of [`Request`] in a file; host. A twin, because the crate that it belongs to is used without files.
#[cfg(feature = "serde")]
#[derive(Serialize, Deserialize)]
#[serde(remote = "Request", rename_all = "kebab-case")]
enum RequestText {
    Off,
    Physical,
    PhysicalAndNetwork,
    NetworkInShadow,
}

/// Source of the velocity that friction is computed for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(rename_all = "kebab-case"))]
pub enum VelocitySource {
    /// The command's velocity where the mode has one (velocity, position, impedance), the measured one in torque mode.
    /// The compensation of the first three is then pure feedforward: no error of the model can destabilise the
    /// loop.
    #[default]
    Reference,
    /// Always the measured velocity.
    Measured,
}

/// Friction's uncertainty where nobody has set another one. A model whose every parameter is half too large, its
/// Stribeck velocity too, has up to twice the joint's friction at some velocities; with less, some such joints keep
/// moving (docs/energy-guard.md).
pub const FRICTION_UNCERTAINTY: f32 = 0.6;

/// Request of adaptation in service ([`super::adaptation`]).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(rename_all = "kebab-case"))]
pub enum AdaptationRequest {
    /// No adaptation.
    #[default]
    Off = 0,
    /// Adaptation that learns and reports, and does not act.
    Shadow = 1,
    /// Adaptation that learns and acts.
    On = 2,
}

/// Configuration of compensation.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(deny_unknown_fields))]
pub struct CompensationConfiguration {
    /// Requested compensation.
    #[cfg_attr(feature = "serde", serde(with = "RequestText"))]
    pub request: Request,
    /// Share of the estimate that is added; 0 to 1.
    pub gain: f32,
    /// Largest compensation torque, Nm; 0 to the torque limit.
    pub clamp: f32,
    /// Largest change of the compensation torque, Nm/s.
    pub slew: f32,
    /// Source of the velocity that friction is computed for.
    pub velocity_source: VelocitySource,
    /// Velocity below which compensation fades out in proportion, rad/s; 0.0001 to 10.
    pub standstill_velocity: f32,
    /// Uncertainty of friction: by how much it may be less than gain times the model, as a part of it; 0 to 1. It is
    /// what the energy guard may take of a compensation for the measured velocity; see [`super::friction_feedforward`].
    #[cfg_attr(feature = "serde", serde(default = "earlier::friction_uncertainty"))]
    pub uncertainty: f32,
    /// Requested adaptation.
    #[cfg_attr(feature = "serde", serde(default))]
    pub adaptation: AdaptationRequest,
}

impl CompensationConfiguration {
    /// No compensation: none is requested, and gain and clamp permit none.
    pub const OFF: Self = Self {
        request: Request::Off,
        gain: 0.0,
        clamp: 0.0,
        slew: 1.0,
        velocity_source: VelocitySource::Reference,
        standstill_velocity: 0.1,
        uncertainty: FRICTION_UNCERTAINTY,
        adaptation: AdaptationRequest::Off,
    };
}

/// Torques of the configured load that the joint adds by itself ([`super::load_feedforward`]).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(rename_all = "kebab-case"))]
pub enum LoadFeedforwardRequest {
    /// None.
    #[default]
    Off = 0,
    /// Inertia times the reference's acceleration.
    Acceleration = 1,
    /// Gravity.
    Gravity = 2,
    /// Both.
    Both = 3,
}

/// Reaction to a collision ([`super::external_torque`]). Until it is acknowledged the joint keeps to it, whatever the
/// set-points say.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(rename_all = "kebab-case"))]
pub enum CollisionReaction {
    /// None: collisions are counted.
    #[default]
    Off = 0,
    /// A message.
    Warning = 1,
    /// A message and a quick stop, as its option code has it.
    QuickStop = 2,
    /// A message and halt, as its option code has it: the joint stops, and holds where it came to a stop.
    Hold = 3,
    /// A message, and the joint gives way: neither spring nor damper, only the load is borne, as the feedforward is
    /// configured.
    Yield = 4,
}

impl CollisionReaction {
    /// The reaction with this number.
    pub fn at(number: u32) -> Option<Self> {
        let all = [Self::Off, Self::Warning, Self::QuickStop, Self::Hold, Self::Yield];
        all.into_iter().find(|reaction| *reaction as u32 == number)
    }
}

/// Uncertainty of the load where nobody states it.
pub const LOAD_UNCERTAINTY: f32 = 0.3;

/// Inertia and gravity at the joint's output, as far as a single joint can know them: an axis that does not move
/// against gravity.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(deny_unknown_fields))]
pub struct LoadConfiguration {
    /// Torques that are added.
    pub request: LoadFeedforwardRequest,
    /// Inertia about the joint, rotor times the gear ratio squared included, without payload, kg m²; 0 to 1000.
    pub inertia: f32,
    /// Largest gravity torque without payload, with the lever level, Nm; 0 to 2000.
    pub gravity: f32,
    /// Position in which the lever, and with it the payload, hangs straight down, rad; -1000 to 1000.
    pub hanging: f32,
    /// Payload, kg; 0 to 1000.
    pub payload_mass: f32,
    /// Distance of the payload's centre of mass from the axis, m; 0 to 10.
    pub payload_arm: f32,
    /// Part of true inertia and gravity by which the configured ones may be wrong; 0 to 0.9.
    #[cfg_attr(feature = "serde", serde(default = "earlier::load_uncertainty"))]
    pub uncertainty: f32,
    /// External torque beyond its uncertainty that is a collision, Nm; 0 to 2000.
    #[cfg_attr(feature = "serde", serde(default))]
    pub collision_threshold: f32,
    /// Reaction to one.
    #[cfg_attr(feature = "serde", serde(default))]
    pub collision_reaction: CollisionReaction,
}

impl LoadConfiguration {
    /// Unknown load: nothing is added.
    pub const NONE: Self = Self {
        request: LoadFeedforwardRequest::Off,
        inertia: 0.0,
        gravity: 0.0,
        hanging: 0.0,
        payload_mass: 0.0,
        payload_arm: 0.0,
        uncertainty: LOAD_UNCERTAINTY,
        collision_threshold: 0.0,
        collision_reaction: CollisionReaction::Off,
    };

    fn check(&self) -> Result<(), ConfigurationError> {
        in_range!("inertia of the load", "kg m²", self.inertia, 0.0, 1000.0)?;
        in_range!("gravity torque", "Nm", self.gravity, 0.0, 2000.0)?;
        in_range!("hanging position", "rad", self.hanging, -1000.0, 1000.0)?;
        in_range!("payload's mass", "kg", self.payload_mass, 0.0, 1000.0)?;
        in_range!("payload's arm", "m", self.payload_arm, 0.0, 10.0)?;
        in_range!("uncertainty of the load", "", self.uncertainty, 0.0, 0.9)?;
        in_range!("collision threshold", "Nm", self.collision_threshold, 0.0, 2000.0)?;
        Ok(())
    }
}

impl Default for LoadConfiguration {
    fn default() -> Self {
        Self::NONE
    }
}

/// The bridge and its timing: what the board knows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BridgeConfiguration {
    /// Control steps a second, Hz; 1 kHz to 100 kHz.
    pub rate: f32,
    /// Least and greatest duty of a high side that leaves room to sample the shunts; 0 to 0.4, 0.6 to 1.
    pub duty: (f32, f32),
    /// Dead time, s; 0 to 5 µs.
    pub dead_time: f32,
    /// Current below which dead-time compensation is in proportion to it, A; 0.001 to 100.
    pub dead_time_band: f32,
    /// The board measures the bridge's temperature: a reading out of range is a fault.
    pub has_bridge_sensor: bool,
    /// The motor has a temperature sensor: a reading out of range is a fault.
    pub has_winding_sensor: bool,
    /// The encoder is an incremental one with an index, which it has to meet after each start; otherwise it is
    /// absolute.
    pub counts_an_encoder: bool,
    /// The board has an output for a brake chopper.
    pub has_chopper_output: bool,
    /// Limits that no configuration may exceed.
    pub limits: BoardLimits,
}

impl BridgeConfiguration {
    /// Rounds of the motion loop a second, Hz: the rate that the motion law, a friction model and compensation are
    /// prepared for.
    pub const fn motion_rate(&self) -> u32 {
        self.rate as u32 / MOTION_STEPS
    }
}

/// Heat paths of the motor.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(deny_unknown_fields))]
pub struct ThermalConfiguration {
    /// Heat capacity of the winding, J/K.
    pub winding_capacity: f32,
    /// Heat capacity of the housing, J/K.
    pub housing_capacity: f32,
    /// Thermal resistance from winding to housing, K/W.
    pub winding_to_housing: f32,
    /// Thermal resistance from housing to ambient, K/W.
    pub housing_to_ambient: f32,
    /// Temperature of the surroundings, °C.
    pub ambient: f32,
}

/// Trim of the oscillator as the chip comes from the factory (RM0440, 7.4.2: reset value of HSITRIM).
pub const FACTORY_TRIM: u8 = 64;
/// Steps to either side of it: at least 2 % by the smallest step of the data sheet, which is what the oscillator may be
/// off by at any temperature.
const TRIM_STEPS: f32 = 10.0;

/// Configuration of a joint: everything that it is and may do.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(deny_unknown_fields))]
pub struct Configuration {
    /// Node on the CAN bus, 1 to 127; 255 where none is assigned yet.
    pub node_id: u8,
    /// Trim of the board's oscillator, steps of some 0.3 %; 54 to 74, from the factory 64.
    #[cfg_attr(feature = "serde", serde(default = "earlier::oscillator_trim"))]
    pub oscillator_trim: u8,
    /// Motor and encoder.
    pub motor: MotorConfiguration,
    /// Gear.
    pub gear: GearConfiguration,
    /// Limits.
    pub limits: Limits,
    /// Gains.
    pub gains: Gains,
    /// Stops.
    #[cfg_attr(feature = "serde", serde(default))]
    pub stops: StopConfiguration,
    /// Compensation.
    pub compensation: CompensationConfiguration,
    /// Load.
    #[cfg_attr(feature = "serde", serde(default))]
    pub load: LoadConfiguration,
    /// Heat.
    pub thermal: ThermalConfiguration,
}

/// Reason for which a configuration is refused.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ConfigurationError {
    /// A value is out of its range.
    Setting(SettingError),
    /// A compensation setting is out of its range.
    Compensation(SettingsError),
    /// The node id is neither 1 to 127 nor 255.
    NodeId(u8),
    /// The motor has no poles.
    PolePairs(u32),
    /// The encoder cannot have so many counts a turn.
    EncoderCounts(u32),
    /// An option code of a stop that there is not.
    StopOption,
}

impl From<SettingError> for ConfigurationError {
    fn from(error: SettingError) -> Self {
        Self::Setting(error)
    }
}

impl From<SettingsError> for ConfigurationError {
    fn from(error: SettingsError) -> Self {
        Self::Compensation(error)
    }
}

impl core::fmt::Display for ConfigurationError {
    fn fmt(&self, f: &mut core::fmt::Formatter) -> core::fmt::Result {
        match self {
            Self::Setting(error) => error.fmt(f),
            Self::Compensation(error) => error.fmt(f),
            Self::NodeId(id) => write!(f, "node id is {id}, must be 1 to 127, or 255 for none"),
            Self::PolePairs(pairs) => write!(f, "motor has {pairs} pole pairs, must have 1 to 64"),
            Self::StopOption => f.write_str(
                "an option code of a stop is not possible: quick_stop must be 0, 1, 2, 5 or 6, shutdown and disable_operation 0 or 1, \
                 halt 1 or 2, fault_reaction 0 to 2, late_command 1 or 3",
            ),
            Self::EncoderCounts(counts) => write!(f, "encoder has {counts} counts a turn, must have 16 to 65535"),
        }
    }
}

impl core::error::Error for ConfigurationError {}

/// Name and range of each number whose range does not depend on another: as a table they take a third less flash than
/// as calls.
static RANGES: [(Name, f32, f32); 24] = [
    (Name::of("control rate", "Hz"), 1e3, 100e3),
    (Name::of("dead time", "s"), 0.0, 5e-6),
    (Name::of("torque constant", "Nm/A"), 1e-3, 5.0),
    (Name::of("encoder's latency", "s"), 0.0, 1e-3),
    (Name::of("gear ratio's magnitude", ""), 1.0, 500.0),
    (Name::of("joint's zero", "rad"), -1000.0, 1000.0),
    (Name::of("torque limit", "Nm"), 0.01, 2000.0),
    (Name::of("velocity limit", "rad/s"), 0.1, 200.0),
    (Name::of("lowest position", "rad"), -1000.0, 1000.0),
    (Name::of("margin beyond the position limits", "rad"), 1e-3, 10.0),
    (Name::of("winding temperature limit", "°C"), 60.0, 200.0),
    (Name::of("stiffness", "Nm/rad"), 0.0, 1e5),
    (Name::of("damping", "Nm s/rad"), 0.0, 1e4),
    (Name::of("integral gain", "Nm/rad"), 0.0, 1e6),
    (Name::of("acceleration", "rad/s²"), 0.1, 1e5),
    (Name::of("quick-stop deceleration", "rad/s²"), 0.1, 1e5),
    (Name::of("braking time", "s"), 0.01, 10.0),
    (Name::of("compensation gain", ""), 0.0, 1.0),
    (Name::of("compensation slew limit", "Nm/s"), 0.5, 32e3),
    (Name::of("standstill velocity", "rad/s"), 1e-4, 10.0),
    (Name::of("friction uncertainty", ""), 0.0, 1.0),
    (Name::of("brake chopper's share of the time", ""), 1e-3, 1.0),
    (Name::of("holding brake's release time", "s"), 0.0, 5.0),
    (Name::of("holding brake's apply time", "s"), 0.0, 5.0),
];

impl Configuration {
    /// Checks every number that [`Configuration::prepare`] does not check where it uses it.
    pub(super) fn check(&self, bridge: &BridgeConfiguration) -> Result<(), ConfigurationError> {
        if !matches!(self.node_id, 1..=127 | 255) {
            return Err(ConfigurationError::NodeId(self.node_id));
        }
        if !(1..=64).contains(&self.motor.alignment.pole_pairs) {
            return Err(ConfigurationError::PolePairs(self.motor.alignment.pole_pairs));
        }
        if !(16..=65_535).contains(&self.motor.encoder_counts) {
            return Err(ConfigurationError::EncoderCounts(self.motor.encoder_counts));
        }
        if !self.stops.is_possible() {
            return Err(ConfigurationError::StopOption);
        }
        let Self { motor, gear, limits, gains, stops, compensation, .. } = self;
        let magnitude = if gear.ratio < 0.0 { -gear.ratio } else { gear.ratio };
        let ((lowest, highest), (lowest_supply, highest_supply)) = (limits.position, limits.bus_voltage);
        // In the order of the table.
        let values = [
            bridge.rate,
            bridge.dead_time,
            motor.torque_constant,
            motor.encoder_latency,
            magnitude,
            gear.zero,
            limits.torque,
            limits.velocity,
            lowest,
            limits.position_margin,
            limits.winding_temperature,
            gains.stiffness,
            gains.damping,
            gains.integral,
            gains.acceleration,
            gains.quick_stop_deceleration,
            gains.braking_time,
            compensation.gain,
            compensation.slew,
            compensation.standstill_velocity,
            compensation.uncertainty,
            limits.chopper_share,
            stops.brake_release,
            stops.brake_apply,
        ];
        for ((name, low, high), value) in RANGES.iter().zip(values) {
            within_range(*name, value, *low, *high)?;
        }
        in_range!("highest position", "rad", highest, lowest + 1e-3, 1000.0)?;
        let board = &bridge.limits;
        in_range!("current limit", "A", motor.current_limit, 0.1, board.current)?;
        in_range!("over-current limit", "A", limits.over_current, 1.05 * motor.current_limit, board.over_current)?;
        in_range!("lowest supply voltage", "V", lowest_supply, 5.0, board.supply - 1.0)?;
        in_range!("highest supply voltage", "V", highest_supply, lowest_supply + 1.0, board.supply)?;
        in_range!("regeneration band", "V", limits.regeneration_band, 0.1, highest_supply - lowest_supply)?;
        if limits.chopper_voltage != 0.0 {
            let highest = if bridge.has_chopper_output { highest_supply - limits.regeneration_band } else { 0.0 };
            let lowest = lesser(lowest_supply + 1.0, highest);
            in_range!("brake chopper's voltage", "V", limits.chopper_voltage, lowest, highest)?;
        }
        in_range!("loss current", "A", motor.loss_current, 0.0, motor.current_limit)?;
        in_range!("field-weakening current", "A", motor.field_weakening_current, 0.0, motor.current_limit)?;
        in_range!("bridge temperature limit", "°C", limits.bridge_temperature, 40.0, board.bridge_temperature)?;
        in_range!("command deadline", "s", limits.command_deadline, 1e-3, board.command_deadline)?;
        in_range!("limit damping", "Nm s/rad", limits.damping, limits.least_damping(), 1e6)?;
        in_range!("compensation clamp", "Nm", compensation.clamp, 0.0, limits.torque)?;
        let factory = f32::from(FACTORY_TRIM);
        let trim = f32::from(self.oscillator_trim);
        in_range!("oscillator trim", "", trim, factory - TRIM_STEPS, factory + TRIM_STEPS)?;
        if LOADS { self.load.check() } else { Ok(()) }
    }
}
