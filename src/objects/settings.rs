//! Settings of the [`Configuration`], each as the number that an object carries; the task. Which setting is which
//! member stands here and nowhere else.

use crate::joint::adaptation::ADAPTS;
use crate::joint::configuration::LOADS;
use crate::joint::configuration::{
    AdaptationRequest, CollisionReaction, Configuration, LoadConfiguration, LoadFeedforwardRequest, VelocitySource,
};
use crate::joint::stop_options::StopConfiguration;
use crate::motor::angle::Direction;
use friction_compensation::compensation::Request;

/// Declares the settings: their names and their members, first those that are real numbers.
macro_rules! settings {
    ($($name:ident => $($member:ident).+ $([$tuple:tt])?,)+ ; $($other:ident => $($others:ident).+,)+) => {
        /// A setting of the configuration.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[allow(missing_docs, reason = "the members of the configuration have these names")]
        pub enum Setting {
            $($name,)+
            $($other,)+
        }

        impl Setting {
            /// The member, where it is a real number.
            fn real(self, configuration: &mut Configuration) -> Option<&mut f32> {
                Some(match self {
                    $(Self::$name => &mut configuration.$($member).+ $(.$tuple)?,)+
                    $(Self::$other => return None,)+
                })
            }

            /// Names that lead to the member, its own last: the key of a file below its tables; host.
            pub const fn path(self) -> &'static [&'static str] {
                match self {
                    $(Self::$name => &[$(stringify!($member)),+],)+
                    $(Self::$other => &[$(stringify!($others)),+],)+
                }
            }
        }
    };
}

settings! {
    Resistance => motor.resistance,
    InductanceD => motor.inductance_d,
    InductanceQ => motor.inductance_q,
    TorqueConstant => motor.torque_constant,
    CurrentLimit => motor.current_limit,
    LossCurrent => motor.loss_current,
    FieldWeakeningCurrent => motor.field_weakening_current,
    EncoderLatency => motor.encoder_latency,
    GearRatio => gear.ratio,
    JointZero => gear.zero,
    TorqueLimit => limits.torque,
    VelocityLimit => limits.velocity,
    LowestPosition => limits.position[0],
    HighestPosition => limits.position[1],
    PositionMargin => limits.position_margin,
    LimitDamping => limits.damping,
    OverCurrent => limits.over_current,
    LowestBusVoltage => limits.bus_voltage[0],
    HighestBusVoltage => limits.bus_voltage[1],
    BridgeTemperature => limits.bridge_temperature,
    WindingTemperature => limits.winding_temperature,
    CommandDeadline => limits.command_deadline,
    RegenerationBand => limits.regeneration_band,
    ChopperVoltage => limits.chopper_voltage,
    ChopperShare => limits.chopper_share,
    CurrentBandwidth => gains.current_bandwidth,
    ObserverBandwidth => gains.observer_bandwidth,
    VoltageFraction => gains.voltage_fraction,
    Stiffness => gains.stiffness,
    Damping => gains.damping,
    Integral => gains.integral,
    Acceleration => gains.acceleration,
    QuickStopDeceleration => gains.quick_stop_deceleration,
    BrakingTime => gains.braking_time,
    BrakeRelease => stops.brake_release,
    BrakeApply => stops.brake_apply,
    CompensationGain => compensation.gain,
    Clamp => compensation.clamp,
    Slew => compensation.slew,
    StandstillVelocity => compensation.standstill_velocity,
    Uncertainty => compensation.uncertainty,
    LoadInertia => load.inertia,
    LoadGravity => load.gravity,
    HangingPosition => load.hanging,
    PayloadMass => load.payload_mass,
    PayloadArm => load.payload_arm,
    CollisionThreshold => load.collision_threshold,
    LoadUncertainty => load.uncertainty,
    WindingCapacity => thermal.winding_capacity,
    HousingCapacity => thermal.housing_capacity,
    WindingToHousing => thermal.winding_to_housing,
    HousingToAmbient => thermal.housing_to_ambient,
    Ambient => thermal.ambient,
    ;
    PolePairs => motor.alignment.pole_pairs,
    EncoderCounts => motor.encoder_counts,
    Direction => motor.alignment.direction,
    ElectricalZero => motor.alignment.electrical_zero,
    Request => compensation.request,
    VelocitySource => compensation.velocity_source,
    OscillatorTrim => oscillator_trim,
    Adaptation => compensation.adaptation,
    LoadFeedforward => load.request,
    CollisionReaction => load.collision_reaction,
    QuickStop => stops.quick_stop,
    Shutdown => stops.shutdown,
    DisableOperation => stops.disable_operation,
    Halt => stops.halt,
    FaultReaction => stops.fault_reaction,
    LateCommand => stops.late_command,
}

impl Setting {
    /// The number that the object carries: bits of a REAL32, or an unsigned number.
    pub fn get(self, configuration: &Configuration) -> u32 {
        // A copy, so that one declaration serves both ways.
        let mut copy = *configuration;
        if let Some(real) = self.real(&mut copy) {
            return real.to_bits();
        }
        match self {
            Self::PolePairs => copy.motor.alignment.pole_pairs,
            Self::EncoderCounts => copy.motor.encoder_counts,
            Self::Direction => (copy.motor.alignment.direction == Direction::Reverse).into(),
            Self::ElectricalZero => copy.motor.alignment.electrical_zero.0,
            Self::Request => copy.compensation.request as u32,
            Self::OscillatorTrim => copy.oscillator_trim.into(),
            Self::Adaptation => copy.compensation.adaptation as u32,
            Self::LoadFeedforward => copy.load.request as u32,
            Self::CollisionReaction => copy.load.collision_reaction as u32,
            Self::QuickStop => copy.stops.quick_stop.into(),
            Self::Shutdown => copy.stops.shutdown.into(),
            Self::DisableOperation => copy.stops.disable_operation.into(),
            Self::Halt => copy.stops.halt.into(),
            Self::FaultReaction => copy.stops.fault_reaction.into(),
            Self::LateCommand => copy.stops.late_command.into(),
            _ => (copy.compensation.velocity_source == VelocitySource::Measured).into(),
        }
    }

    /// Sets it; false, and nothing happens, for a number that stands for nothing. Ranges are the business of
    /// [`Configuration::prepare`].
    #[must_use]
    pub fn set(self, configuration: &mut Configuration, number: u32) -> bool {
        if let Some(real) = self.real(configuration) {
            *real = f32::from_bits(number);
            return true;
        }
        match (self, number) {
            (Self::PolePairs, _) => configuration.motor.alignment.pole_pairs = number,
            (Self::EncoderCounts, _) => configuration.motor.encoder_counts = number,
            (Self::OscillatorTrim, _) => configuration.oscillator_trim = number as u8,
            (Self::Direction, 0) => configuration.motor.alignment.direction = Direction::Forward,
            (Self::Direction, 1) => configuration.motor.alignment.direction = Direction::Reverse,
            (Self::ElectricalZero, _) => configuration.motor.alignment.electrical_zero.0 = number,
            (Self::Request, 0) => configuration.compensation.request = Request::Off,
            (Self::Request, 1) => configuration.compensation.request = Request::Physical,
            (Self::Request, 2) => configuration.compensation.request = Request::PhysicalAndNetwork,
            (Self::Request, 3) => configuration.compensation.request = Request::NetworkInShadow,
            (Self::VelocitySource, 0) => configuration.compensation.velocity_source = VelocitySource::Reference,
            (Self::VelocitySource, 1) => configuration.compensation.velocity_source = VelocitySource::Measured,
            (Self::Adaptation, 0) => configuration.compensation.adaptation = AdaptationRequest::Off,
            (Self::Adaptation, 1) if ADAPTS => configuration.compensation.adaptation = AdaptationRequest::Shadow,
            (Self::Adaptation, 2) if ADAPTS => configuration.compensation.adaptation = AdaptationRequest::On,
            (Self::LoadFeedforward, _) if LOADS => return set_feedforward(&mut configuration.load, number),
            (Self::CollisionReaction, _) if LOADS => return set_reaction(&mut configuration.load, number),
            _ => return self.set_option(&mut configuration.stops, number),
        }
        true
    }

    /// The same of an option code.
    fn set_option(self, stops: &mut StopConfiguration, number: u32) -> bool {
        let before = *stops;
        let place = match self {
            Self::QuickStop => &mut stops.quick_stop,
            Self::Shutdown => &mut stops.shutdown,
            Self::DisableOperation => &mut stops.disable_operation,
            Self::Halt => &mut stops.halt,
            Self::FaultReaction => &mut stops.fault_reaction,
            Self::LateCommand => &mut stops.late_command,
            _ => return false,
        };
        *place = if number < 256 { number as u8 } else { u8::MAX };
        let possible = stops.is_possible();
        if !possible {
            *stops = before;
        }
        possible
    }
}

fn set_feedforward(load: &mut LoadConfiguration, number: u32) -> bool {
    use LoadFeedforwardRequest::{Acceleration, Both, Gravity, Off};
    let request = [Off, Acceleration, Gravity, Both].into_iter().find(|request| *request as u32 == number);
    load.request = request.unwrap_or(load.request);
    request.is_some()
}

fn set_reaction(load: &mut LoadConfiguration, number: u32) -> bool {
    let reaction = CollisionReaction::at(number);
    load.collision_reaction = reaction.unwrap_or(load.collision_reaction);
    reaction.is_some()
}
