//! Fields of the objects of this joint; any context. The [table](super::table) says which index means which field,
//! nothing else does.

use super::operation::Operation;
use super::settings::Setting;
use crate::joint::PROFILES;

/// Field that an object reads or writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Field {
    /// Served by [`canopen`](canopen_node).
    Server,
    /// Sub-index 0 of a record: its highest sub-index.
    Highest(u8),
    /// A number that never changes.
    Constant(Constant),
    /// Set-point of the joint.
    SetPoint(SetPoint),
    /// The range of a part of the impedance frame.
    Range(Range),
    /// A number for the profile modes or the statusword.
    Profile(ProfileParameter),
    /// Actual value of the joint.
    Actual(Actual),
    /// A setting of the configuration: staged, and taken with all others by a command.
    Setting(Setting),
    /// A setting that acts at once: of the compensation, and how the joint stops.
    AtOnce(Setting),
    /// A setting in use as a whole number of thousandths, to be read.
    Milli(Setting),
    /// A limit in use as a whole number of millionths. Written, it is taken at once, while the motor is off.
    Micro(Setting),
    /// Taking the configuration, and why it was refused.
    Configuration(ConfigurationField),
    /// The open loop's last window.
    OpenLoop(OpenLoopField),
    /// The life of a parameter image.
    Image(ImageField),
    /// Ownership of the joint.
    Owner(OwnerField),
    /// The control steps before a fault.
    History,
    /// Reason for the program's start.
    Reset(ResetField),
    /// Report of the board on its hardware.
    Hardware(HardwareField),
    /// State of the storage.
    Storage(StorageField),
    /// Log of faults that outlives the power.
    Log(LogField),
}

/// A part of the log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LogField {
    /// Number of power-ups.
    PowerUps,
    /// Faults that are not in it.
    Missed,
    /// Its newest faults, a stream.
    Faults,
}

/// A part of the storage's state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StorageField {
    /// Parts that were found damaged.
    Damaged,
    /// Number of records that may be written.
    StoresLeft,
}

/// A part of what the board tells of its hardware.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HardwareField {
    /// Fault status 1 of the gate driver.
    DriverStatus1,
    /// Fault status 2 of the gate driver.
    DriverStatus2,
    /// Faults of the gate driver since the start.
    DriverFaults,
    /// Missing part of the gate driver's set-up.
    DriverSetup,
    /// Family and revision of the board.
    Revision,
    /// Option bytes of the chip.
    OptionsFound,
    /// The same as they are needed.
    OptionsNeeded,
    /// Mask of the wrong ones.
    OptionsWrong,
    /// Sets them.
    SetOptions,
}

/// A number that never changes. Without the number itself, which is wider than all other fields, an entry of the table
/// takes six bytes less.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Constant {
    /// Modes of operation, a bit each.
    SupportedModes,
}

impl Constant {
    /// The number.
    pub const fn number(self) -> i32 {
        match self {
            Self::SupportedModes => Operation::SUPPORTED as i32,
        }
    }
}

/// A part of why the program started.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ResetField {
    /// Causes of the chip's reset.
    Causes,
    /// Cause of the program's stop.
    Stop,
    /// Address of the instruction that it stopped at.
    Address,
    /// Detail of that cause.
    Detail,
    /// Stops in a row.
    Repeats,
    /// Source file.
    Place,
}

/// Set-point of the joint. Everything but the mode ends with the NMT state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum SetPoint {
    /// Controlword of the state machine.
    Controlword = 0,
    /// Mode of operation.
    Mode = 1,
    /// Counter of the master's set-points.
    Counter = 2,
    /// Torque mode; added in velocity and position mode.
    TargetTorque = 3,
    /// Position mode.
    TargetPosition = 4,
    /// Velocity mode.
    TargetVelocity = 5,
    /// Impedance mode: all of its five set-points.
    ImpedanceFrame = 6,
    /// Velocity of the joint that shares this joint's drive.
    CoupledVelocity = 7,
    /// Open loop: all of its four set-points.
    OpenLoop = 8,
    /// Added in every mode but the open loop: what holds the joint.
    TorqueOffset = 9,
    /// Profile position mode: velocity on the way.
    ProfileVelocity = 10,
    /// Profile modes: acceleration.
    ProfileAcceleration = 11,
    /// Profile modes: deceleration.
    ProfileDeceleration = 12,
    /// Largest torque in every mode but the open loop.
    MaxTorque = 13,
    /// Added in cyclic synchronous position mode.
    PositionOffset = 14,
    /// Added in cyclic synchronous velocity mode.
    VelocityOffset = 15,
}

impl SetPoint {
    /// Mode, profile and largest torque: they stay whatever the NMT state is, and ask nothing of the joint by
    /// themselves.
    pub(super) const fn is_choice(self) -> bool {
        let of_profiles = matches!(
            self,
            Self::ProfileVelocity | Self::ProfileAcceleration | Self::ProfileDeceleration | Self::MaxTorque
        );
        matches!(self, Self::Mode) || PROFILES && of_profiles
    }
}

/// Several set-points, a bit each.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Several(u16);

const _: () = assert!(SET_POINTS <= 16);

impl Several {
    pub(super) const NONE: Self = Self(0);
    /// Everything that is asked of the joint: not choices, the counter and a neighbour's velocity.
    pub(super) const ASKED: Self = Self::one(SetPoint::Controlword)
        .and(SetPoint::OpenLoop)
        .and(SetPoint::TargetTorque)
        .and(SetPoint::TargetPosition)
        .and(SetPoint::TargetVelocity)
        .and(SetPoint::ImpedanceFrame)
        .and(SetPoint::TorqueOffset)
        .and(SetPoint::PositionOffset)
        .and(SetPoint::VelocityOffset);

    /// Target of a cyclic mode, which its master has to renew: what is added to it is none. None in the other
    /// modes, where every PDO or value that is asked of the joint is a sign of life.
    pub(super) const fn target(mode: Operation) -> Self {
        match mode {
            Operation::Position => Self::one(SetPoint::TargetPosition),
            Operation::Velocity => Self::one(SetPoint::TargetVelocity),
            Operation::Torque => Self::one(SetPoint::TargetTorque),
            Operation::Impedance => Self::one(SetPoint::ImpedanceFrame),
            Operation::OpenLoop
            | Operation::None
            | Operation::ProfilePosition
            | Operation::ProfileVelocity
            | Operation::Homing => Self::NONE,
        }
    }

    pub(super) const fn one(set_point: SetPoint) -> Self {
        Self(1 << set_point as u16)
    }

    /// These and one more.
    pub(super) const fn and(self, set_point: SetPoint) -> Self {
        Self(self.0 | Self::one(set_point).0)
    }

    /// Those of them that are among `others`, too.
    pub(super) const fn among(self, others: Self) -> Self {
        Self(self.0 & others.0)
    }

    pub(super) const fn has(self, set_point: SetPoint) -> bool {
        self.among(Self::one(set_point)).0 != 0
    }
}

/// Number of [`SetPoint`]s.
pub(super) const SET_POINTS: usize = FIRST_OF_PROFILES + PROFILE_SET_POINTS;
/// The first one that only a program with [`PROFILES`] has.
pub(super) const FIRST_OF_PROFILES: usize = 10;
/// Number of these.
pub(super) const PROFILE_SET_POINTS: usize = 6 * PROFILES as usize;

/// A number that a master sets for the profile modes, or for what the statusword tells. It lasts until the program
/// ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum ProfileParameter {
    /// Following error from which on bit 13 is set, raw position.
    FollowingErrorWindow = 0,
    /// Time for which it has to be beyond, ms.
    FollowingErrorTime = 1,
    /// Distance to the target within which the joint has to be, raw position.
    PositionWindow = 2,
    /// Time for which the position has to be within, ms.
    PositionTime = 3,
    /// Difference to the target velocity within which the velocity has to be, raw velocity.
    VelocityWindow = 4,
    /// Below it the joint stands, raw velocity.
    VelocityThreshold = 5,
    /// Position that the joint has where it is homed, raw.
    HomeOffset = 6,
    /// Method of finding the zero.
    HomingMethod = 7,
    /// Speed on the way to the index, raw velocity.
    HomingSpeed = 8,
    /// Acceleration of it, raw.
    HomingAcceleration = 9,
    /// Speed on the way to a switch, raw velocity: no method looks for one.
    SwitchSpeed = 10,
    /// Time between two set-points of the cyclic modes; 0: they are not interpolated.
    InterpolationTime = 11,
    /// Its unit, as a power of ten in seconds, an INTEGER8.
    InterpolationExponent = 12,
}

/// Number of [`ProfileParameter`]s that a program has.
pub(super) const PROFILE_PARAMETERS: usize = if PROFILES { 13 } else { 0 };

impl ProfileParameter {
    /// Returns `true` if it may have this value: not an acceleration of zero, nor a method that there is none of.
    pub(super) const fn permits(self, value: u32) -> bool {
        match self {
            Self::HomingMethod => matches!(value, 0 | 33 | 34 | 35 | 37),
            Self::InterpolationExponent => matches!(value as i8, -6..=0),
            Self::HomingSpeed | Self::HomingAcceleration | Self::SwitchSpeed => value > 0,
            _ => true,
        }
    }

    /// Values at the start.
    pub const DEFAULTS: [u32; 13] = [u32::MAX, 0, 10_000, 0, 50, 20, 0, 0, 100, u32::MAX, 100, 0, -3i8 as u8 as u32];
}

/// A part of the impedance frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Range {
    /// rad, to both sides.
    Position = 0,
    /// rad/s, to both sides.
    Velocity = 1,
    /// Nm/rad, from 0.
    Stiffness = 2,
    /// Nm s/rad, from 0.
    Damping = 3,
    /// Nm, to both sides.
    Torque = 4,
}

/// Number of [`Range`]s.
pub const RANGES: usize = 5;

impl Range {
    /// All of them, by number.
    pub const ALL: [Self; RANGES] = [Self::Position, Self::Velocity, Self::Stiffness, Self::Damping, Self::Torque];

    /// The widest that is taken: what a command may ask for at most.
    pub const fn widest(self) -> f32 {
        match self {
            Self::Position => 1_000.0,
            Self::Velocity => 200.0,
            Self::Stiffness => 1e5,
            Self::Damping => 1e4,
            Self::Torque => 2_000.0,
        }
    }
}

/// Actual value of the joint. The receive interrupt has all of it, for TPDOs that follow SYNC.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Actual {
    /// State machine.
    Statusword,
    /// Mode of operation.
    Mode,
    /// Position of the joint.
    Position,
    /// Velocity of the joint.
    Velocity,
    /// Torque of the measured current.
    Torque,
    /// Torque that the command asks for within all limits, before compensation.
    TorqueDemand,
    /// Position that the command asks for at this instant.
    PositionDemand,
    /// Distance that is missing to it.
    FollowingError,
    /// Current that makes torque.
    Current,
    /// Supply, in the profile's unit.
    DcLink,
    /// Torque that permille of torque refer to.
    RatedTorque,
    /// Code of the first latched fault.
    ErrorCode,
    /// Torque that compensation adds.
    CompensationTorque,
    /// Torque that neither feed-forward nor compensation explain.
    Residual,
    /// Supply.
    BusVoltage,
    /// Winding's sensor or model.
    WindingTemperature,
    /// Bridge's sensor.
    BridgeTemperature,
    /// Temperature that friction is computed for.
    GearTemperature,
    /// Faults since the last acknowledgement, a bit each.
    LatchedFaults,
    /// Friction model that acts.
    ActingModel,
    /// Reason for which less acts than was asked for.
    Reason,
    /// Number of departures from the range that the joint's friction was learned in.
    Violations,
    /// Distance of the full model from what acts.
    ShadowRms,
    /// Part of the compensation that standstill and energy guard let through.
    Permitted,
    /// Learning state of adaptation: that it learns, or why not.
    Learning,
    /// Factor of the image's friction.
    AdaptedFactor,
    /// Its standard deviation.
    FactorDeviation,
    /// Added viscous friction.
    AdaptedViscous,
    /// External torque on the link.
    ExternalTorque,
    /// Bound of its error.
    ExternalUncertainty,
    /// Collisions since the start.
    Collisions,
    /// Version of the image in use.
    ImageVersion,
    /// State of a staged image.
    ImageState,
    /// States of the board's outputs.
    Outputs,
    /// Torque of the physical friction model.
    PhysicalTorque,
    /// Torque of the friction network.
    NetworkTorque,
    /// Torque of pre-sliding within the physical model's.
    PreSlidingTorque,
    /// Torque that adaptation adds to the image's.
    AdaptationTorque,
}

/// Taking the staged configuration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ConfigurationField {
    /// 1 takes what is staged, 2 forgets it.
    Command,
    /// Result of the last command.
    Result,
    /// The setting that was refused.
    RefusedSetting,
    /// Value that was refused.
    RefusedValue,
    /// Least value that is possible.
    Lowest,
    /// Greatest value that is possible.
    Highest,
    /// Flag: what is staged differs from what is in use.
    Changed,
}

/// The open loop's last window. Reading the number holds the rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OpenLoopField {
    /// Number of the window.
    Number,
    /// Mean current along the field.
    CurrentAlong,
    /// Mean current across the field.
    CurrentAcross,
    /// Mean voltage along the field.
    VoltageAlong,
    /// Mean voltage across the field.
    VoltageAcross,
    /// Current along the field in phase with the alternating voltage.
    InPhaseAlong,
    /// Current along the field a quarter of a period ahead.
    QuadratureAlong,
    /// Current across the field in phase with the alternating voltage.
    InPhaseAcross,
    /// Current across the field a quarter of a period ahead.
    QuadratureAcross,
    /// Amplitude of the alternating voltage along the field.
    AlternatingAlong,
    /// Amplitude of the alternating voltage across the field.
    AlternatingAcross,
    /// Encoder in the window's last step.
    Encoder,
    /// Field in the window's last step.
    Field,
    /// Mean supply.
    BusVoltage,
    /// Flag: the encoder's zero is known.
    Referenced,
    /// Control steps a second.
    ControlRate,
    /// Kind of the encoder.
    EncoderKind,
}

/// The life of a parameter image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageField {
    /// Upload.
    Staging,
    /// The image in use, as it is stored.
    Active,
    /// Command on what is staged.
    Command,
    /// Reason for which the last command was refused.
    Result,
    /// Bytes staged.
    Length,
    /// Checksum of the bytes staged.
    Checksum,
    /// Remaining time of a trial.
    TrialLeft,
    /// Time of the trials that follow.
    TrialTime,
    /// Reason for which the last trial ended by itself.
    Ending,
    /// A stored image.
    Stored(Which, StoredField),
    /// Lowest version that is taken.
    Floor,
    /// Wrong tags and responses so far.
    Failures,
}

/// A part of the joint's ownership.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OwnerField {
    /// Flag: the joint has an owner.
    KeyPresent,
    /// Number of the key.
    KeyNumber,
    /// The key itself, to be written.
    Key,
    /// Challenge that the next response answers.
    Challenge,
    /// Opens a session, or takes the key back.
    Response,
    /// Remaining time of the session; 0 ends it.
    Session,
    /// Flag: somebody is at the joint.
    Presence,
    /// Takes the key back where somebody is.
    Forget,
}

/// One of the two stored images.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Which {
    /// Image in use.
    Active,
    /// Image that a roll back would make active.
    Previous,
}

/// Property of a stored image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StoredField {
    /// Version.
    Version,
    /// Its checksum.
    Checksum,
    /// Physical model alone, or with a network.
    Model,
    /// Slot in which it lies.
    Slot,
    /// Time at which it was made.
    Created,
}
