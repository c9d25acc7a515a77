// Recorded runs of whole control steps, the same on the board's core and on the host: included by the program `step`
// and by the test that records and counts.
//
// The run is recorded in closed loop on the host. Because the control step gives the same bits everywhere, the
// recording is a closed loop for the core too; where it gave other bits, the hash would tell.

use friction_compensation::compensation::Request;
use friction_compensation::friction::FrictionModel;
use friction_compensation::parameters::image::Image;
use joint_firmware::default_configuration::B_G431B_ESC1;
use joint_firmware::joint::adaptation::Factors;
use joint_firmware::joint::configuration::{BridgeConfiguration, Configuration, VelocitySource};
use joint_firmware::joint::state_machine::Controlword;
use joint_firmware::joint::{
    Active, BoardLimits, Bridge, Command, Demand, Joint, Measurements, Mode, OFFSET_STEPS, Slow,
};
use joint_firmware::motor::phases::Phases;

/// Scenario of a run.
#[derive(Clone, Copy)]
pub struct Scenario {
    /// Mode of operation.
    pub mode: Mode,
    /// Compensation.
    pub request: Request,
    /// Velocity that friction is computed for.
    pub source: VelocitySource,
}

/// The runs, each from the same start. The last one is the longest way through a control step: the approach of a
/// position, all of the model, and the energy guard.
pub const SCENARIOS: [Scenario; 5] = [
    Scenario { mode: Mode::Torque, request: Request::Off, source: VelocitySource::Reference },
    Scenario { mode: Mode::Impedance, request: Request::Physical, source: VelocitySource::Reference },
    Scenario { mode: Mode::Impedance, request: Request::PhysicalAndNetwork, source: VelocitySource::Reference },
    Scenario { mode: Mode::Torque, request: Request::PhysicalAndNetwork, source: VelocitySource::Measured },
    Scenario { mode: Mode::Position, request: Request::PhysicalAndNetwork, source: VelocitySource::Measured },
];
/// Control steps until the joint is enabled.
pub const START: u32 = OFFSET_STEPS + 4;
/// Control steps of a run: 10 ms.
pub const STEPS: u32 = 200;
/// Words of a recorded step.
pub const WORDS: usize = 12;
/// Steps between two commands: a bus at 1 kHz.
const COMMAND_STEPS: u32 = 20;

/// The joint of a scenario: a motor of 0.2 ohm behind a gear of 50, on 36 V.
pub fn configuration(scenario: &Scenario) -> (Configuration, BridgeConfiguration) {
    let mut joint = B_G431B_ESC1.joint;
    joint.motor.resistance = 0.2;
    (joint.motor.inductance_d, joint.motor.inductance_q) = (1.8e-4, 2.2e-4);
    (joint.motor.torque_constant, joint.motor.current_limit) = (0.09, 20.0);
    joint.gear.ratio = 50.0;
    (joint.limits.torque, joint.limits.velocity, joint.limits.over_current) = (80.0, 8.0, 28.0);
    joint.limits.damping = joint.limits.least_damping();
    (joint.limits.position, joint.limits.bus_voltage) = ((-3.0, 3.0), (20.0, 48.0));
    joint.limits.regeneration_band = 7.2;
    (joint.limits.bridge_temperature, joint.limits.winding_temperature) = (110.0, 130.0);
    (joint.gains.current_bandwidth, joint.gains.observer_bandwidth) = (800.0, 200.0);
    (joint.gains.stiffness, joint.gains.damping, joint.gains.integral) = (1000.0, 60.0, 2000.0);
    (joint.gains.acceleration, joint.gains.quick_stop_deceleration) = (40.0, 80.0);
    joint.compensation.request = scenario.request;
    joint.compensation.velocity_source = scenario.source;
    (joint.compensation.gain, joint.compensation.clamp, joint.compensation.slew) = (0.98, 20.0, 3000.0);
    joint.compensation.standstill_velocity = 0.01;
    let bridge = BridgeConfiguration {
        rate: 20_000.0,
        duty: (0.02, 0.95),
        dead_time: 5e-7,
        dead_time_band: 0.3,
        has_bridge_sensor: true,
        has_winding_sensor: true,
        counts_an_encoder: false,
        has_chopper_output: true,
        limits: BoardLimits {
            supply: 60.0,
            over_current: 60.0,
            bridge_temperature: 110.0,
            current_range: (-60.0, 60.0),
            supply_end: 72.0,
            ..B_G431B_ESC1.bridge.limits
        },
    };
    (joint, bridge)
}

/// Prepared configuration; none where an image or the configuration is refused.
pub fn prepare(scenario: &Scenario, image: &[u8]) -> Option<Active> {
    let (configuration, bridge) = configuration(scenario);
    let image = Image::decode(image).ok()?;
    let active = configuration.prepare(&bridge).ok()?;
    Some(active.with_friction(Some(FrictionModel::new(&image.friction, bridge.motion_rate()))))
}

/// Demand in step `n` of the start.
pub fn starting(n: u32) -> Demand {
    let controlword = match n {
        0..=OFFSET_STEPS => Controlword::DISABLE_VOLTAGE,
        _ if n == OFFSET_STEPS + 1 => Controlword::SHUTDOWN,
        _ if n == OFFSET_STEPS + 2 => Controlword::SWITCH_ON,
        _ => Controlword::ENABLE_OPERATION,
    };
    Demand { controlword, ..Demand::default() }
}

/// Demand in step `n` of a run: half of it one way, then the other.
pub fn demand(scenario: &Scenario, n: u32) -> Demand {
    let forward = n < STEPS / 2;
    let time = (n / COMMAND_STEPS * COMMAND_STEPS) as f32 / 20_000.0;
    let impedance = matches!(scenario.mode, Mode::Impedance);
    let sign = if forward { 1.0 } else { -1.0 };
    let command = Command {
        mode: scenario.mode,
        position: if impedance { 20.0 * time * time } else { sign },
        velocity: if forward { 40.0 * time } else { 0.4 - 40.0 * time },
        torque: if impedance { 0.0 } else { 6.0 * sign },
        stiffness: 200.0,
        damping: 60.0,
        ..Command::NOTHING
    };
    let controlword = Controlword::ENABLE_OPERATION;
    Demand { controlword, command, sequence: 1 + n / COMMAND_STEPS, ..Demand::default() }
}

/// A step as words.
pub fn words(measured: &Measurements, slow: &Slow) -> [u32; WORDS] {
    let Measurements { phase_currents: Phases { a, b, c }, bus_voltage, encoder, .. } = *measured;
    let flags =
        u32::from(measured.encoder_valid) | u32::from(measured.bridge_fault) << 1 | u32::from(measured.overrun) << 2;
    let [a, b, c, bus_voltage] = [a, b, c, bus_voltage].map(f32::to_bits);
    let [winding, bridge] = [measured.winding_temperature, measured.bridge_temperature].map(f32::to_bits);
    let Slow { derating, gear_temperature, factors: Factors { factor, viscous } } = *slow;
    let [derating, gear, factor, viscous] = [derating, gear_temperature, factor, viscous].map(f32::to_bits);
    [a, b, c, bus_voltage, encoder, flags, winding, bridge, derating, gear, factor, viscous]
}

/// The step of these words.
pub fn measured(words: &[u32; WORDS]) -> (Measurements, Slow) {
    let [a, b, c, bus_voltage, encoder, flags, winding, bridge, derating, gear, factor, viscous] = *words;
    let [a, b, c, bus_voltage] = [a, b, c, bus_voltage].map(f32::from_bits);
    let measurements = Measurements {
        phase_currents: Phases { a, b, c },
        bus_voltage,
        encoder,
        encoder_valid: flags & 1 != 0,
        encoder_referenced: true,
        winding_temperature: f32::from_bits(winding),
        bridge_temperature: f32::from_bits(bridge),
        bridge_fault: flags & 2 != 0,
        overrun: flags & 4 != 0,
    };
    let [derating, gear_temperature, factor, viscous] = [derating, gear, factor, viscous].map(f32::from_bits);
    (measurements, Slow { derating, gear_temperature, factors: Factors { factor, viscous } })
}

/// FNV-1a over what a step leads to.
pub fn hash(sum: u32, joint: &Joint, bridge: &Bridge) -> u32 {
    let telemetry = joint.telemetry();
    let Phases { a, b, c } = bridge.duties;
    let numbers = [a, b, c, telemetry.wanted.torque, telemetry.compensated.torque, telemetry.motion.velocity];
    let words =
        numbers.map(f32::to_bits).into_iter().chain([telemetry.state as u32, joint.latched_faults().is_empty() as u32]);
    words.fold(sum, |sum, word| (sum ^ word).wrapping_mul(0x0100_0193))
}

/// Initial value of a hash.
pub const SEED: u32 = 0x811c_9dc5;
