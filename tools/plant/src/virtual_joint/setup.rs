//! The configuration of a commissioned joint: what its makers know of motor and gear, limits around what it can do, and
//! gains from its inertia. Nothing here knows the friction.

use crate::actuator::ActuatorParameters;
use friction_compensation::compensation::Request;
use joint_firmware::default_configuration::MOTEUS_R4;
use joint_firmware::joint::BoardLimits;
use joint_firmware::joint::configuration::{
    BridgeConfiguration, CompensationConfiguration, Configuration, Gains, GearConfiguration, Limits,
    MotorConfiguration, ThermalConfiguration,
};
use joint_firmware::motor::angle::{Direction, ElectricalAngle, EncoderAlignment};
use std::f64::consts::TAU;

/// Values of what a virtual joint does not set: all that is off on a joint that nobody has commissioned.
const UNCOMMISSIONED: Configuration = MOTEUS_R4.joint;
/// Control rate of the virtual joint, Hz.
pub const RATE: f32 = 20_000.0;
/// Bandwidth of the position loop, Hz.
pub const POSITION_BANDWIDTH: f64 = 6.0;
/// Damping ratio of the position loop.
const DAMPING_RATIO: f64 = 1.0;

/// Shortest time constant J / D against the delays of the loops, s (`joint::limit_law`).
const SHORTEST: f64 = 1e-3;
/// Time constant of gains that are quiet, s.
const QUIET: f64 = 2.0 * SHORTEST;

/// A board for every joint of the plant: it bears whatever may be asked of it, and sees as far as its sensors do.
fn board_limits(parameters: &ActuatorParameters) -> BoardLimits {
    let (currents, bus) = (&parameters.sensors.currents, &parameters.sensors.bus);
    // Without counts, so little of the range.
    let half_a_count = |resolution: f64, span: f64| 0.5 * resolution.max(1e-3 * span);
    let of_current = half_a_count(currents.resolution, currents.highest - currents.lowest);
    BoardLimits {
        supply: 100.0,
        over_current: 500.0,
        current: 200.0,
        bridge_temperature: 150.0,
        command_deadline: 10.0,
        current_range: ((currents.lowest + of_current) as f32, (currents.highest - of_current) as f32),
        supply_end: (bus.highest - half_a_count(bus.resolution, bus.highest)) as f32,
    }
}

/// A joint's configuration and its bridge's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setup {
    /// Configuration.
    pub configuration: Configuration,
    /// The board's part.
    pub bridge: BridgeConfiguration,
}

impl Setup {
    /// The configuration of a joint with these parameters, [aligned](ActuatorParameters::aligned). Compensation is off.
    #[must_use]
    pub fn of(parameters: &ActuatorParameters) -> Self {
        let joint = &parameters.joint;
        let motor = &joint.motor;
        let inertia = joint.inertia();
        let bandwidth = TAU * POSITION_BANDWIDTH;
        let stiffness = inertia * bandwidth * bandwidth;
        let damping = 2.0 * DAMPING_RATIO * inertia * bandwidth;
        let torque = motor.torque_limit();
        let deceleration = joint.usable_acceleration();
        let mut limits = Limits {
            torque: torque as f32,
            velocity: (1.5 * joint.limits.speed) as f32,
            position: (-(joint.limits.travel + 0.5) as f32, (joint.limits.travel + 0.5) as f32),
            position_margin: 0.3,
            damping: 0.0,
            over_current: (1.4 * motor.current_limit) as f32,
            bus_voltage: ((0.6 * parameters.bus.source_voltage) as f32, (1.3 * parameters.bus.source_voltage) as f32),
            // Two thirds of the way up from the supply's own voltage: the rest is for its rise before the current
            // follows.
            regeneration_band: (0.2 * parameters.bus.source_voltage) as f32,
            bridge_temperature: 110.0,
            winding_temperature: 130.0,
            command_deadline: 0.1,
            ..UNCOMMISSIONED.limits
        };
        // Least damping permitted, and enough for the margin where the quick stop's deceleration takes half the torque.
        let stopping = torque / (deceleration * f64::from(limits.position_margin)).sqrt();
        limits.damping = limits.least_damping().max(stopping as f32);
        let phase_resistance = motor.resistance / 1.5;
        Self {
            configuration: Configuration {
                node_id: 1,
                motor: MotorConfiguration {
                    resistance: phase_resistance as f32,
                    inductance_d: parameters.windings.inductance_d as f32,
                    inductance_q: parameters.windings.inductance_q as f32,
                    torque_constant: motor.torque_constant as f32,
                    current_limit: motor.current_limit as f32,
                    alignment: EncoderAlignment {
                        pole_pairs: parameters.windings.pole_pairs as u32,
                        direction: Direction::Forward,
                        electrical_zero: ElectricalAngle(0),
                    },
                    encoder_latency: parameters.sensors.encoder.delay as f32 / RATE,
                    ..UNCOMMISSIONED.motor
                },
                gear: GearConfiguration { ratio: motor.gear_ratio as f32, zero: 0.0 },
                limits,
                gains: Gains {
                    current_bandwidth: 800.0,
                    observer_bandwidth: 200.0,
                    stiffness: stiffness as f32,
                    damping: damping as f32,
                    integral: (2.0 * stiffness) as f32,
                    acceleration: (0.5 * joint.usable_acceleration()) as f32,
                    quick_stop_deceleration: deceleration as f32,
                    braking_time: 1.0,
                    ..UNCOMMISSIONED.gains
                },
                compensation: CompensationConfiguration {
                    gain: 0.98,
                    clamp: (0.5 * torque) as f32,
                    slew: (50.0 * torque).min(30e3) as f32,
                    standstill_velocity: 0.01,
                    ..CompensationConfiguration::OFF
                },
                thermal: ThermalConfiguration {
                    winding_capacity: joint.thermal.winding_capacity as f32,
                    housing_capacity: joint.thermal.housing_capacity as f32,
                    winding_to_housing: joint.thermal.winding_to_housing as f32,
                    housing_to_ambient: joint.thermal.housing_to_ambient as f32,
                    ambient: joint.thermal.ambient as f32,
                },
                ..UNCOMMISSIONED
            },
            bridge: BridgeConfiguration {
                rate: RATE,
                duty: (0.02, 0.95),
                dead_time: parameters.inverter.dead_time as f32,
                dead_time_band: (3.0 * parameters.inverter.clamping_current) as f32,
                has_bridge_sensor: parameters.sensors.bridge.fitted,
                has_winding_sensor: parameters.sensors.winding.fitted,
                counts_an_encoder: false,
                has_chopper_output: true,
                limits: board_limits(parameters),
            },
        }
    }

    /// The configuration that somebody makes who has a data sheet of such an actuator
    /// ([`ActuatorParameters::as_data_sheet`]) and tunes it until it is quiet. Compensation is off.
    #[must_use]
    pub fn by_data_sheet(parameters: &ActuatorParameters, seed: u64) -> Self {
        let sheet = parameters.as_data_sheet(seed);
        let mut setup = Self::of(&sheet);
        if parameters.joint.transmission.is_some() {
            setup.bear_alone(sheet.joint.motor.reflected_inertia());
        }
        setup
    }

    /// Gains and limits that a motor of this inertia, kg m², bears without its link: within a gap, and above the
    /// resonance of an elastic gear, it is alone.
    fn bear_alone(&mut self, inertia: f64) {
        let Configuration { gains, limits, .. } = &mut self.configuration;
        let share = ((inertia / QUIET) as f32 / gains.damping).min(1.0);
        gains.damping *= share;
        gains.stiffness *= share * share;
        gains.integral *= share * share * share;
        // The limits' damping is less for a higher velocity limit and a wider margin.
        let most = (inertia / SHORTEST) as f32;
        limits.velocity *= (limits.least_damping() / most).max(1.0);
        if limits.damping > most {
            limits.damping = most.max(limits.least_damping());
            let fade = limits.torque / limits.damping;
            limits.position_margin = limits.position_margin.max(fade * fade / gains.quick_stop_deceleration);
        }
    }

    /// The same with compensation as requested.
    #[must_use]
    pub fn compensating(mut self, request: Request) -> Self {
        self.configuration.compensation.request = request;
        self
    }
}
