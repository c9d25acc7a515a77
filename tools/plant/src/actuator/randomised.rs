//! Actuators drawn at random around the joints of [`crate::randomised`].
//!
//! The joint comes first. Its motor is then rewound for a battery drawn at random (same peak torque, same copper loss,
//! other current), so that torque and speed fit the supply; where 60 A do not suffice, the speed limit gives way.
//!
//! | what | range |
//! |---|---|
//! | joint | as in [`crate::randomised`], but for current limit, torque constant, resistance, speed limit |
//! | battery, current limit | 20..52 V, 4..60 A so that speed limit and peak torque together need 75 % of the linear range |
//! | battery resistance, capacitor | 0.5..5 % of battery voltage / current limit, 0.2..2 mF |
//! | pole pairs | 4..21, at most 4000 rad/s of electrical speed at the speed limit |
//! | time constant L/R | 0.3..3 ms; above 0.25 ms less where the reactance would take over 35 % of the voltage |
//! | L_q over L_d, copper | 1..1.5, 0.00385 per K |
//! | electrical zero, phase order | any, either |
//! | cogging | 0.1..1 % of the motor's peak torque, 6 or 12 periods per pole pair and turn |
//! | dead time, clamping current | 0.2..0.9 µs, 0.2..2 % of the current limit |
//! | duty steps, delay | 2000..8500, one period |
//! | transistor, shunt and lead | 1..10 mOhm, at most 30 % of the winding's resistance; diode 0.6..1.0 V |
//! | bridge | 4..15 K/W, 2..10 J/K, 0.3..2 W of idle power |
//! | current sensors | offset ±1 %, noise 0.1..0.5 %, range ±150 % of the current limit in 4096 counts; gain ±1 % |
//! | encoder | 2^12..2^17 counts per turn of the rotor, any zero, either direction, noise 0..1 count |
//! | encoder eccentricity, delay | 0.001..0.01 rad, 0..2 periods |
//! | bus sensor | gain ±1 %, noise 0.02..0.2 %, range 160 % of the battery in 4096 counts |
//! | thermistors | 1..8 s, 0.1..1 K; the winding has one in 7 of 10, the bridge always |

use super::bus::BusParameters;
use super::current_sensors::CurrentSensorParameters;
use super::inverter::InverterParameters;
use super::parameters::ActuatorParameters;
use super::rotor_encoder::EncoderParameters;
use super::sensors::{DriveSensorParameters, VoltageSensorParameters};
use super::thermistor::ThermistorParameters;
use super::windings::{COPPER_RISE, Cogging, PhaseOrder, WindingParameters};
use crate::noise::Noise;
use crate::parameters::JointParameters;
use std::f64::consts::PI;

/// Share of the bridge's linear range that speed limit and peak torque together need.
const VOLTAGE_SHARE: f64 = 0.75;

/// Largest electrical speed at the speed limit, rad/s.
const FASTEST: f64 = 4000.0;

impl ActuatorParameters {
    /// The actuator number `seed` of all actuators within the ranges of this module's table; always valid.
    #[must_use]
    pub fn randomised(seed: u64) -> Self {
        let mut draw = Noise::new(seed, 101);
        let battery = draw.uniform(20.0, 52.0);
        let joint = rewound(JointParameters::randomised(seed), VOLTAGE_SHARE * battery / 3.0_f64.sqrt());
        let windings = windings(&mut draw, &joint, VOLTAGE_SHARE * battery / 3.0_f64.sqrt());
        let inverter = inverter(&mut draw, &joint);
        let current_limit = joint.motor.current_limit;
        let bus = BusParameters {
            source_voltage: battery,
            source_resistance: draw.scale(0.005, 0.05) * battery / current_limit,
            capacitance: draw.scale(2e-4, 2e-3),
            takes_back: true,
        };
        let sensors = sensors(&mut draw, current_limit, battery);
        Self { joint, windings, inverter, bus, sensors }
    }
}

/// The same motor with other turns, so that it needs `voltage` (V, peak of a phase) at speed limit and peak torque.
fn rewound(mut joint: JointParameters, voltage: f64) -> JointParameters {
    let motor = &mut joint.motor;
    let resistive = motor.resistance / 1.5 * motor.current_limit;
    let induced = motor.torque_constant / 1.5 * motor.gear_ratio * joint.limits.speed;
    let before = motor.current_limit;
    motor.current_limit = (before * (resistive + induced) / voltage).clamp(4.0, 60.0);
    let turns = before / motor.current_limit;
    motor.torque_constant *= turns;
    motor.resistance *= turns * turns;
    let left = voltage - motor.resistance / 1.5 * motor.current_limit;
    let reachable = 1.5 * left / (motor.torque_constant * motor.gear_ratio);
    joint.limits.speed = joint.limits.speed.min(reachable);
    joint
}

fn windings(draw: &mut Noise, joint: &JointParameters, voltage: f64) -> WindingParameters {
    let motor = &joint.motor;
    let rotor_speed = motor.gear_ratio * joint.limits.speed;
    let pole_pairs = draw.uniform(4.0, 22.0).min(FASTEST / rotor_speed).floor().max(1.0);
    let resistance = motor.resistance / 1.5;
    let reactance_bound = 0.35 * voltage / (pole_pairs * rotor_speed * motor.current_limit);
    let inductance_d = (resistance * draw.scale(3e-4, 3e-3)).min(reactance_bound).max(2.5e-4 * resistance);
    let teeth = if draw.uniform(0.0, 1.0) < 0.5 { 6.0 } else { 12.0 };
    WindingParameters {
        pole_pairs: pole_pairs as usize,
        inductance_d,
        inductance_q: inductance_d * draw.uniform(1.0, 1.5),
        resistance_rise: COPPER_RISE,
        flux_fall: 0.0,
        electrical_zero: draw.uniform(-PI, PI),
        phase_order: if draw.uniform(0.0, 1.0) < 0.5 { PhaseOrder::Forward } else { PhaseOrder::Exchanged },
        cogging: Cogging {
            amplitude: motor.torque_constant * motor.current_limit * draw.scale(0.001, 0.01),
            periods_per_turn: teeth * pole_pairs,
            phase: draw.uniform(-PI, PI),
        },
    }
}

fn inverter(draw: &mut Noise, joint: &JointParameters) -> InverterParameters {
    let motor = &joint.motor;
    InverterParameters {
        dead_time: draw.uniform(2e-7, 9e-7),
        clamping_current: motor.current_limit * draw.scale(0.002, 0.02),
        duty_steps: draw.uniform(2000.0, 8501.0) as usize,
        duty_delay: 1,
        on_resistance: draw.scale(1e-3, 1e-2).min(0.3 * motor.resistance / 1.5),
        diode_drop: draw.uniform(0.6, 1.0),
        thermal_resistance: draw.uniform(4.0, 15.0),
        heat_capacity: draw.uniform(2.0, 10.0),
        idle_power: draw.uniform(0.3, 2.0),
    }
}

fn sensors(draw: &mut Noise, current_limit: f64, battery: f64) -> DriveSensorParameters {
    let mut one_percent = || [0.0; 3].map(|_: f64| draw.uniform(-0.01, 0.01));
    let currents = CurrentSensorParameters {
        offset: one_percent().map(|share| share * current_limit),
        gain_error: one_percent(),
        noise: current_limit * draw.scale(0.001, 0.005),
        resolution: 3.0 * current_limit / 4096.0,
        lowest: -1.5 * current_limit,
        highest: 1.5 * current_limit,
        delay: 0,
    };
    let counts_per_turn = 1 << (draw.uniform(12.0, 18.0) as usize);
    let encoder = EncoderParameters {
        counts_per_turn,
        zero: draw.uniform(0.0, 1.0),
        reversed: draw.uniform(0.0, 1.0) < 0.5,
        noise: draw.uniform(0.0, 1.0) / counts_per_turn as f64,
        eccentricity: draw.scale(0.001, 0.01),
        eccentricity_phase: draw.uniform(-PI, PI),
        delay: draw.uniform(0.0, 3.0) as usize,
    };
    let highest = 1.6 * battery;
    let bus = VoltageSensorParameters {
        gain_error: draw.uniform(-0.01, 0.01),
        noise: battery * draw.scale(2e-4, 2e-3),
        resolution: highest / 4096.0,
        highest,
    };
    let mut thermistor = |fitted| ThermistorParameters {
        fitted,
        lag: draw.scale(1.0, 8.0),
        resolution: draw.scale(0.1, 1.0),
        lowest: -50.0,
        highest: 250.0,
    };
    let (winding, bridge) = (thermistor(true), thermistor(true));
    let winding = ThermistorParameters { fitted: draw.uniform(0.0, 1.0) < 0.7, ..winding };
    DriveSensorParameters { currents, encoder, bus, winding, bridge }
}
