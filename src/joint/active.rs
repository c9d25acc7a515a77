//! A configuration as the control step uses it: gains, limits and scales prepared, nothing left to divide; task, host.

use super::chopper::{CHOPS, ChopperGains};
use super::configuration::{
    AdaptationRequest, BridgeConfiguration, Configuration, ConfigurationError, GearConfiguration, LOADS, Limits,
    MOTION_STEPS, MotorConfiguration, VelocitySource,
};
use super::limit_gains::LimitGains;
use super::load::LoadGains;
use super::stop_options::StopGains;
use crate::motor::angle::{Direction, EncoderAlignment, STEPS, TAU};
use crate::motor::current::{CurrentSettings, MotorConstants};
use crate::motor::field_oriented::FieldOrientedGains;
use crate::motor::field_weakening::{WeakeningGains, WeakeningSettings};
use crate::motor::modulation::ModulationSettings;
use crate::motor::number::{greater, lesser, within};
use crate::motor::observer::{Motion, ObserverGains, ObserverSettings};
use crate::motor::open_loop::OpenLoopGains;
use crate::motor::setting::{SettingError, in_range};
use crate::motor::thermal::{ThermalSettings, WindingTemperature};
use crate::motor::transform::Dq;
use core::mem::MaybeUninit;
use friction_compensation::compensation::Settings;
use friction_compensation::friction::FrictionModel;
use friction_compensation::quantity::Torque;

/// Steps of the slow task a second, Hz.
pub const SLOW_RATE: f32 = 100.0;
/// Temperature at which the heat paths are checked, °C.
const REFERENCE_TEMPERATURE: f32 = 25.0;
/// Span over which the current is derated below the limits of winding and bridge, K.
pub const DERATING: f32 = 20.0;
/// Part of the regeneration band in which braking current fades. In the rest nothing feeds the supply: the board takes
/// so little that its voltage comes to rest where almost all is withheld, and there noise would find the limit.
const FADE: f32 = 0.8;
/// A velocity this much above its limit is a fault.
pub(super) const OVER_SPEED: f32 = 1.2;
/// Peak of the voltage between two phases over that of one.
const SQRT_3: f32 = 1.732_050_8;
/// Fastest rotor that the observer follows, beyond the velocity limit.
const OBSERVER_RESERVE: f32 = 2.0;
/// Highest rotor acceleration, rad/s²: a rotor of 1e-6 kg m² under 1 Nm.
const HIGHEST_ACCELERATION: f32 = 1e6;
/// Largest sum of the phase currents as a part of the over-current limit: at the current limit, three sensors that are
/// 2 % off and noise of 1 % make up half of it.
const CURRENT_SUM: f32 = 0.1;
/// Voltage that may be unexplained in any case, as a part of the highest supply.
const UNEXPLAINED: f32 = 0.015;
/// And besides what of the dead time is not compensated.
const BESIDES_DEAD_TIME: f32 = 0.003;
/// Voltage that the dead time takes as a part of the supply, for its part of the period: 4/3 of it in space-vector
/// components.
const DEAD_TIME: f32 = 4.0 / 3.0;
/// Part of that which is not compensated although the current is large: a phase's around its zero crossing is half of
/// all, and the transistors' delays come on top. Near zero current it is all.
const UNCOMPENSATED: f32 = 0.75;
/// Noise of a current as a part of the current limit that may be taken for a change: differentiated with the windings'
/// inductance it is a voltage, in windings of many turns more than all the rest.
const CURRENT_NOISE: f32 = 0.005;
/// Time in which the energy guard takes compensation away, s.
const BACK_OFF: f32 = 0.005;
/// Time in which it comes back, s.
const RECOVERY: f32 = 0.1;
/// Time over which the energy guard compares the speed, s.
const MEMORY: f32 = 0.01;
/// Time over which it takes the mean velocity, s.
const DRIFT: f32 = 0.05;
/// Mean velocity from which on the joint moves, over the standstill velocity.
const MOVES: f32 = 5.0;
/// Part of a voltage that is left in its filter from one control step to the next: a time constant of 8 steps.
const LEFT: f32 = 0.875;
/// Part of the voltage of a round of the motion loop that goes into the filter.
pub(super) const VOLTAGE_FILTER: f32 = 1.0 - LEFT * LEFT * LEFT * LEFT * LEFT;
const _: () = assert!(MOTION_STEPS == 5, "as many factors as a round has steps");

/// Scales between rotor and joint.
#[derive(Clone, Copy, Debug)]
pub struct Scales {
    /// Joint's rad for an encoder's turn, signed.
    turn: f32,
    /// Joint's rad for one 2^-32 of a turn.
    fraction: f32,
    /// Joint's rad/s for an encoder's rad/s.
    velocity: f32,
    zero: f32,
    /// A of q current for Nm at the joint.
    pub current_per_torque: f32,
    /// Nm at the joint for A of q current.
    pub torque_per_current: f32,
}

/// Motion of the joint.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JointMotion {
    /// rad.
    pub position: f32,
    /// rad/s.
    pub velocity: f32,
    /// rad/s².
    pub acceleration: f32,
}

impl Scales {
    fn new(gear: &GearConfiguration, alignment: &EncoderAlignment, torque_constant: f32) -> Self {
        // A joint that turns forward with positive q current: the encoder's direction and the gear's sign.
        let velocity = alignment.direction.sign() / gear.ratio;
        let torque_per_current = torque_constant * gear.ratio;
        Self {
            turn: TAU * velocity,
            fraction: TAU * velocity / STEPS,
            velocity,
            zero: gear.zero,
            current_per_torque: 1.0 / torque_per_current,
            torque_per_current,
        }
    }

    /// Joint's position where the encoder's first sample reads zero, rad.
    #[inline(always)]
    pub(super) const fn zero(&self) -> f32 {
        self.zero
    }

    /// The joint's motion from the rotor's. Whole turns and fraction are converted by themselves: together they have
    /// more digits than a single-precision number.
    #[inline(always)]
    pub fn joint(&self, motion: &Motion) -> JointMotion {
        let turns = (motion.position >> 32) as i32 as f32;
        let fraction = motion.position as u32 as f32;
        JointMotion {
            position: self.zero + turns * self.turn + fraction * self.fraction,
            velocity: motion.velocity * self.velocity,
            acceleration: motion.acceleration * self.velocity,
        }
    }
}

/// Gains with which the joint follows commands, per round of the motion loop.
#[derive(Clone, Copy, Debug)]
pub struct MotionGains {
    /// Rounds a second, Hz.
    pub rate: f32,
    /// s.
    pub period: f32,
    /// Nm/rad.
    pub stiffness: f32,
    /// Nm s/rad.
    pub damping: f32,
    /// Nm/rad of the velocity error's integral, times the period.
    pub velocity_integral: f32,
    /// Nm/(rad s), times the period.
    pub position_integral: f32,
    /// Change of a ramp in a round, rad/s.
    pub velocity_step: f32,
    /// rad/s².
    pub acceleration: f32,
    /// Change of a quick stop's ramp in a round, rad/s.
    pub quick_stop_step: f32,
    /// The same of a fault reaction.
    pub fault_step: f32,
    /// The same of a joint that is to hold.
    pub hold_step: f32,
    /// Control steps that braking may take.
    pub braking_steps: u32,
}

/// Time over which the mean torque is taken, s.
const MEAN: f32 = 1e-3;

/// The energy guard's time constants as parts of a round of the motion loop: what would be divisions in every round.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GuardGains {
    /// Part of a round's velocity that goes into its slow mean.
    pub drift: f32,
    /// Part of a round's speed that goes into its mean.
    pub mean: f32,
    /// s/rad: the joint moves where its mean velocity times this is above 1, and at 2 for certain.
    pub moves: f32,
    /// Part that is taken away in a round.
    pub back_off: f32,
    /// Part that comes back in a round.
    pub recovery: f32,
}

impl GuardGains {
    /// Gains for a motion loop with rounds of `period` s, and a standstill velocity, rad/s.
    fn new(period: f32, standstill: f32) -> Self {
        Self {
            drift: within(period / DRIFT, 0.0, 1.0),
            moves: 1.0 / (MOVES * standstill),
            mean: within(period / MEMORY, 0.0, 1.0),
            back_off: period / BACK_OFF,
            recovery: period / RECOVERY,
        }
    }
}

/// Values that compensation uses besides the friction model.
#[derive(Clone, Copy, Debug)]
pub struct CompensationGains {
    /// Gain, clamp, slew.
    pub settings: Settings,
    /// Source of the velocity.
    pub source: VelocitySource,
    /// 1 / standstill velocity, s/rad.
    pub inverse_standstill: f32,
    /// rad/s.
    pub standstill: f32,
    /// Time from one round of the motion loop to the next, s.
    pub period: f32,
    /// Part of the compensation that the energy guard leaves alone where the joint moves, 0 to 1.
    pub certain: f32,
    /// The energy guard, per round.
    pub guard: GuardGains,
}

/// Values that adaptation in service uses, beside what all use.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdaptationGains {
    /// Requested adaptation.
    pub request: AdaptationRequest,
    /// The compensation's gain, 0 to 1.
    pub gain: f32,
    /// The compensation's clamp, Nm.
    pub clamp: f32,
    /// Largest change of what it adds, Nm a round.
    pub slew: f32,
    /// Control steps of a mean torque: a millisecond's.
    pub mean_steps: u32,
    /// 1 / them.
    pub mean_share: f32,
}

/// Prepared configuration, complete, as the control step reads it. It is replaced as a whole between two steps.
///
/// In this order, the friction model and what follows it last: the core's floating-point loads reach no further than
/// 1020 bytes.
#[derive(Clone, Debug)]
#[repr(C)]
pub struct Active {
    /// Current loop and modulation.
    pub field_oriented: FieldOrientedGains,
    /// Observer.
    pub observer: ObserverGains,
    /// Alignment of the encoder on the motor.
    pub alignment: EncoderAlignment,
    /// Rotor to joint.
    pub scales: Scales,
    /// Limits, the board's among them.
    pub limits: Limits,
    /// Gains of the torque's fade towards them.
    pub limit_gains: LimitGains,
    /// Velocity beyond which it is a fault, rad/s.
    pub over_speed: f32,
    /// Positions beyond which it is a fault, rad: the limits with their margin.
    pub fault_position: (f32, f32),
    /// Largest offset of a current sensor, A.
    pub largest_offset: f32,
    /// Largest current, A.
    pub current_limit: f32,
    /// Largest sum of the phase currents, A.
    pub current_sum_limit: f32,
    /// Voltage that the motor's equations may leave unexplained at rest, V.
    pub implausible_voltage: Dq,
    /// And besides without current, where none of the dead time is compensated, V.
    pub uncompensated_voltage: f32,
    /// Decrease of it per ampere of torque current, V/A.
    pub compensated_slope: f32,
    /// Electrical constants for that check: resistance, Ω, inductances, H, and flux linkage, Wb.
    pub resistance: f32,
    /// H.
    pub inductance: Dq,
    /// Wb.
    pub flux_linkage: f32,
    /// Rotor's way, rad, that an innovation of the observer may have.
    pub jump_limit: f32,
    /// Silent steps of the encoder after which the rotor's turns are still known: in which it makes a quarter of a
    /// turn at the fastest.
    pub bridged_steps: u32,
    /// Control steps without a new command.
    pub deadline_steps: u32,
    /// Open loop.
    pub open_loop: OpenLoopGains,
    /// Supply from which on braking current is withheld, V.
    pub onset: f32,
    /// Part of it that a volt above withholds, 1/V.
    pub withheld_per_volt: f32,
    /// Largest d current that flows instead, A.
    pub loss_current: f32,
    /// Motion.
    pub motion: MotionGains,
    /// Compensation.
    pub compensation: CompensationGains,
    /// Rotor's speed, rad/s, for a way of the encoder in a control step, 2^32 a turn.
    pub encoder_speed: f32,
    /// The board measures the bridge's temperature.
    pub has_bridge_sensor: bool,
    /// The motor has a temperature sensor.
    pub has_winding_sensor: bool,
    /// Settings for the slow task.
    pub thermal: ThermalSettings,
    /// The verified friction model; none: no compensation.
    pub friction: Option<FrictionModel>,
    /// Gains of its stops.
    pub stops: StopGains,
    /// Brake chopper.
    pub chopper: ChopperGains,
    /// Gains of adaptation, where a program has it.
    pub adaptation: AdaptationGains,
    /// Gains of the feedforward of the load, where a program has it.
    load: [LoadGains; LOADS as usize],
}

impl Configuration {
    /// Checks the whole record and prepares it for the control step on a bridge.
    pub fn prepare(&self, bridge: &BridgeConfiguration) -> Result<Active, ConfigurationError> {
        Ok(Checked::of(self, bridge)?.active(self, bridge))
    }

    /// The same in its place. A friction model's place is 2 KiB, which a board's stack would have to bear otherwise.
    #[inline(never)]
    pub fn prepare_in<'a>(
        &self,
        bridge: &BridgeConfiguration,
        place: &'a mut MaybeUninit<Active>,
    ) -> Result<&'a mut Active, ConfigurationError> {
        let checked = Checked::of(self, bridge)?;
        Ok(place.write(checked.active(self, bridge)))
    }

    /// Checks whether [`Configuration::prepare`] would refuse it.
    pub fn verify(&self, bridge: &BridgeConfiguration) -> Result<(), ConfigurationError> {
        Checked::of(self, bridge).map(|_| ())
    }
}

/// Parts of an [`Active`] that can be refused.
struct Checked {
    field_oriented: FieldOrientedGains,
    observer: ObserverGains,
    settings: Settings,
    thermal: ThermalSettings,
    flux_linkage: f32,
    rotor_velocity: f32,
}

/// Field weakening up to an electrical speed, rad/s, on a highest supply, V. Refused are a d current that would raise
/// the voltage again, and a speed at which the diodes would bring the supply above its limit once the bridge is off:
/// the peak between two phases is sqrt 3 of that of a phase.
#[inline(never)]
fn weakening(
    motor: &MotorConfiguration,
    current: &CurrentSettings,
    gains: &FieldOrientedGains,
    supply: f32,
    speed: f32,
) -> Result<WeakeningGains, SettingError> {
    let MotorConstants { flux_linkage, inductance_d, .. } = current.motor;
    let most = motor.field_weakening_current;
    in_range!("field-weakening current", "A", most, 0.0, flux_linkage / inductance_d)?;
    in_range!("voltage induced where over-speed is a fault", "V", SQRT_3 * flux_linkage * speed, 0.0, supply)?;
    Ok(WeakeningGains::new(&WeakeningSettings {
        current: most,
        bandwidth: current.bandwidth,
        rate: current.rate,
        resistance: current.motor.resistance,
        inductance_d,
        flux_linkage,
        highest_reach: gains.modulator.reach(supply),
        highest_speed: speed,
    }))
}

impl Checked {
    #[inline(never)]
    fn of(configuration: &Configuration, bridge: &BridgeConfiguration) -> Result<Self, ConfigurationError> {
        configuration.check(bridge)?;
        let Configuration { motor, gear, limits, gains, compensation, thermal, .. } = configuration;
        let rate = bridge.rate;
        let pole_pairs = motor.alignment.pole_pairs as f32;
        // Torque is 3/2 times pole pairs times flux linkage times i_q.
        let flux_linkage = motor.torque_constant / (1.5 * pole_pairs);
        let constants = MotorConstants {
            resistance: motor.resistance,
            inductance_d: motor.inductance_d,
            inductance_q: motor.inductance_q,
            flux_linkage,
        };
        let (lowest_voltage, highest_voltage) = limits.bus_voltage;
        let magnitude = if gear.ratio < 0.0 { -gear.ratio } else { gear.ratio };
        let rotor_velocity = OBSERVER_RESERVE * limits.velocity * magnitude;
        let torque = |value: f32| Torque::from_bits((value * 65536.0) as i32);
        let current_settings =
            CurrentSettings { motor: constants, bandwidth: gains.current_bandwidth, rate, highest_voltage };
        let mut field_oriented = FieldOrientedGains::new(
            &current_settings,
            &ModulationSettings {
                voltage_fraction: gains.voltage_fraction,
                minimum_duty: bridge.duty.0,
                maximum_duty: bridge.duty.1,
                dead_time: bridge.dead_time * rate,
                dead_time_band: bridge.dead_time_band,
                minimum_bus_voltage: 0.5 * lowest_voltage,
            },
        )?;
        if motor.field_weakening_current > 0.0 {
            let supply = bridge.limits.hold(limits).bus_voltage.1;
            let speed = OVER_SPEED * limits.velocity * magnitude * pole_pairs;
            field_oriented.weakening = weakening(motor, &current_settings, &field_oriented, supply, speed)?;
        }
        let heat = ThermalSettings {
            resistance: motor.resistance,
            winding_capacity: thermal.winding_capacity,
            housing_capacity: thermal.housing_capacity,
            winding_to_housing: thermal.winding_to_housing,
            housing_to_ambient: thermal.housing_to_ambient,
            ambient: thermal.ambient,
            correction_time: 60.0,
            warning: limits.winding_temperature - DERATING,
            limit: limits.winding_temperature,
            rate: SLOW_RATE,
        };
        WindingTemperature::new(&heat, REFERENCE_TEMPERATURE)?;
        Ok(Self {
            field_oriented,
            observer: ObserverGains::new(&ObserverSettings {
                bandwidth: gains.observer_bandwidth,
                rate,
                latency: motor.encoder_latency,
                highest_velocity: rotor_velocity,
                highest_acceleration: HIGHEST_ACCELERATION,
            })?,
            settings: Settings::new(
                compensation.request,
                (compensation.gain * 65536.0) as u32,
                torque(compensation.clamp),
                torque(compensation.slew),
                bridge.motion_rate(),
            )?,
            thermal: heat,
            flux_linkage,
            rotor_velocity,
        })
    }

    /// Always inlined: what it gives is built where the caller wants it.
    #[inline(always)]
    fn active(self, configuration: &Configuration, bridge: &BridgeConfiguration) -> Active {
        let Configuration { motor, gear, gains, stops, compensation, .. } = configuration;
        let limits = bridge.limits.hold(&configuration.limits);
        let current_limit = lesser(motor.current_limit, bridge.limits.current);
        let (rate, motion_rate) = (bridge.rate, bridge.motion_rate() as f32);
        let mean_steps = (MEAN * rate + 0.5) as u32;
        let period = 1.0 / motion_rate;
        let (quick, slow) = (gains.quick_stop_deceleration * period, gains.acceleration * period);
        // Odd codes are those of the modes' ramp.
        let ramp = |code: u8| if code & 1 == 1 { slow } else { quick };
        let pole_pairs = motor.alignment.pole_pairs as f32;
        let (_, highest_voltage) = limits.bus_voltage;
        let current_slope = CURRENT_NOISE * motor.current_limit * VOLTAGE_FILTER * motion_rate;
        let dead_time = DEAD_TIME * bridge.dead_time * rate;
        let part = |uncompensated: f32| greater(UNEXPLAINED, BESIDES_DEAD_TIME + uncompensated * dead_time);
        let (large, small) = (part(UNCOMPENSATED), part(1.0));
        let uncompensated_voltage = (small - large) * highest_voltage;
        let unexplained = |inductance: f32| large * highest_voltage + inductance * current_slope;
        Active {
            field_oriented: self.field_oriented,
            observer: self.observer,
            alignment: motor.alignment,
            scales: Scales::new(gear, &motor.alignment, motor.torque_constant),
            limit_gains: LimitGains::new(&limits, gains, period),
            over_speed: OVER_SPEED * limits.velocity,
            fault_position: (limits.position.0 - limits.position_margin, limits.position.1 + limits.position_margin),
            limits,
            largest_offset: bridge.limits.largest_offset(limits.over_current),
            current_limit,
            current_sum_limit: CURRENT_SUM * limits.over_current,
            implausible_voltage: Dq { d: unexplained(motor.inductance_d), q: unexplained(motor.inductance_q) },
            uncompensated_voltage,
            compensated_slope: uncompensated_voltage / bridge.dead_time_band,
            resistance: motor.resistance,
            inductance: Dq { d: motor.inductance_d, q: motor.inductance_q },
            flux_linkage: self.flux_linkage,
            // Half an electrical radian: with it the torque would already be a tenth less than commanded.
            jump_limit: 0.5 / pole_pairs,
            bridged_steps: (0.25 * TAU / self.rotor_velocity * rate) as u32,
            deadline_steps: (limits.command_deadline * rate) as u32,
            stops: StopGains {
                options: *stops,
                release_rounds: (stops.brake_release * motion_rate) as u32,
                apply_steps: (stops.brake_apply * rate) as u32,
            },
            chopper: if CHOPS { ChopperGains::new(&limits, rate) } else { ChopperGains::NONE },
            open_loop: OpenLoopGains::new(rate),
            onset: highest_voltage - limits.regeneration_band,
            withheld_per_volt: 1.0 / (FADE * limits.regeneration_band),
            loss_current: lesser(motor.loss_current, current_limit),
            motion: MotionGains {
                rate: motion_rate,
                period,
                stiffness: gains.stiffness,
                damping: gains.damping,
                velocity_integral: gains.integral * period,
                position_integral: 0.1 * gains.integral * period,
                velocity_step: slow,
                acceleration: gains.acceleration,
                quick_stop_step: ramp(stops.quick_stop),
                fault_step: ramp(stops.fault_reaction),
                hold_step: ramp(stops.halt),
                braking_steps: (gains.braking_time * rate) as u32,
            },
            compensation: CompensationGains {
                settings: self.settings,
                source: compensation.velocity_source,
                inverse_standstill: 1.0 / compensation.standstill_velocity,
                standstill: compensation.standstill_velocity,
                certain: 1.0 - compensation.uncertainty,
                period,
                guard: GuardGains::new(period, compensation.standstill_velocity),
            },
            encoder_speed: TAU / STEPS * rate,
            has_bridge_sensor: bridge.has_bridge_sensor,
            has_winding_sensor: bridge.has_winding_sensor,
            adaptation: AdaptationGains {
                request: compensation.adaptation,
                gain: compensation.gain,
                clamp: compensation.clamp,
                slew: compensation.slew * period,
                mean_steps,
                mean_share: 1.0 / mean_steps as f32,
            },
            load: core::array::from_fn(|_| LoadGains::of(configuration)),
            friction: None,
            thermal: self.thermal,
        }
    }
}

impl Active {
    /// The same with a verified friction model.
    pub fn with_friction(mut self, model: Option<FrictionModel>) -> Self {
        self.friction = model;
        self
    }

    /// Gains of the feedforward of the load.
    pub fn load(&self) -> &LoadGains {
        self.load.first().unwrap_or(&LoadGains::NONE)
    }

    /// The sign of the encoder against the rotor's.
    pub const fn direction(&self) -> Direction {
        self.alignment.direction
    }
}
