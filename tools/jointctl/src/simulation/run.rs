//! One part of a scenario, run at the control rate; host.
//!
//! Commands come once a millisecond, as over a bus, and hold in between; each is the set-point of the middle of its
//! millisecond, so that holding it delays nothing on average. What is recorded follows from the seed alone.

use super::SimulationError;
use super::log::{Log, Row};
use super::motion::Controller;
use super::scenario::Part;
use friction_compensation::compensation::Reason;
use friction_compensation::friction::FrictionModel;
use joint_firmware::joint::Demand;
use joint_firmware::joint::fault::{Fault, Faults};
use joint_firmware::joint::state_machine::{Controlword, State};
use plant::VirtualJoint;
use plant::virtual_joint::Setup;

/// Time between two rows of a log as users record it over the bus, s.
pub const USUAL_SAMPLE_PERIOD: f64 = 4e-3;

/// Commands a second.
pub const COMMAND_RATE: f64 = 1000.0;

/// Options of a part's run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Choices {
    /// Seed of the sensors' noise.
    pub seed: u64,
    /// Time between two rows of the log, s; at least a control period.
    pub sample_period: f64,
}

impl Default for Choices {
    fn default() -> Self {
        Self { seed: 1, sample_period: USUAL_SAMPLE_PERIOD }
    }
}

/// End of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Ending {
    /// The motion was run to its end.
    Whole,
    /// The joint left "operation enabled".
    Stopped {
        /// Time, s since the motion started.
        time: f64,
        /// The state that it went to.
        state: State,
        /// Faults that caused it.
        faults: Faults,
    },
}

impl std::fmt::Display for Ending {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Whole => f.write_str("run to its end"),
            Self::Stopped { time, faults, .. } => {
                let names: Vec<String> = faults.iter().map(|fault: Fault| fault.to_string()).collect();
                write!(f, "stopped after {time:.4} s: {}", names.join(", "))
            }
        }
    }
}

/// Results of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    /// Log until it ended.
    pub log: Log,
    /// End of it.
    pub ending: Ending,
    /// Time that was simulated, with the joint's start, s.
    pub simulated: f64,
}

/// Runs a part with `friction` as the joint's friction model.
///
/// # Errors
/// Refusals of plant or firmware, and a joint that cannot be enabled. A fault in motion is no error: the run ends with
/// it.
pub fn run(
    part: &Part,
    setup: &Setup,
    friction: Option<&FrictionModel>,
    choices: &Choices,
) -> Result<Run, SimulationError> {
    let mut log = Log::default();
    let mut ramp = None;
    let (ending, simulated) = drive(part, setup, friction, choices.seed, |joint, step| {
        let period = joint.period();
        let telemetry = joint.joint().telemetry();
        let velocity = f64::from(telemetry.wanted.velocity.unwrap_or(0.0));
        let ramped = ramp.get_or_insert(f64::from(telemetry.motion.position));
        *ramped += velocity * period;
        let per_row = every(choices.sample_period, period);
        if (step + 1) % per_row == 0 {
            let time = (step + 1) as f64 * period;
            let (position, velocity) = match part.motion.reference(time) {
                Some(reference) => (reference.position, reference.velocity),
                None => (*ramped, velocity),
            };
            log.rows.push(Row { time, reference_position: position, reference_velocity: velocity, ..row(joint) });
        }
    })?;
    Ok(Run { log, ending, simulated })
}

/// Drives a joint through a part; `look` sees it after every control step, counted from 0. How it ended, and the time
/// that was simulated, with the joint's start, s.
///
/// # Errors
/// Refusals of plant or firmware, and a joint that cannot be enabled.
pub fn drive(
    part: &Part,
    setup: &Setup,
    friction: Option<&FrictionModel>,
    seed: u64,
    mut look: impl FnMut(&VirtualJoint, u64),
) -> Result<(Ending, f64), SimulationError> {
    let mut joint = VirtualJoint::new(part.plant, setup, part.temperature, seed)?;
    joint.actuator_mut().set_contact(part.contact)?;
    joint.set_friction(friction.cloned());
    joint.enable()?;
    let gains = &setup.configuration.gains;
    // Half the frequency needs a quarter of the stiffness and half of the damping.
    let controller = Controller {
        stiffness: part.softness * part.softness * f64::from(gains.stiffness),
        damping: part.softness * f64::from(gains.damping),
    };
    let period = joint.period();
    let per_command = every(1.0 / COMMAND_RATE, period);
    let steps = (part.motion.duration() / period).round() as u64;
    let mut demand = Demand { controlword: Controlword::ENABLE_OPERATION, ..Demand::default() };
    for step in 0..steps {
        if step % per_command == 0 {
            let time = step as f64 * period + 0.5 / COMMAND_RATE;
            let position = f64::from(joint.joint().telemetry().motion.position);
            demand.command = part.motion.command(time, position, &part.plant.joint, &controller);
            // Zero is what the joint has seen before.
            demand.sequence = demand.sequence.wrapping_add(1);
        }
        let state = joint.step(&demand, 0.0).state;
        look(&joint, step);
        if state != State::OperationEnabled {
            let time = (step + 1) as f64 * period;
            let ending = Ending::Stopped { time, state, faults: joint.joint().latched_faults() };
            return Ok((ending, joint.time()));
        }
    }
    Ok((Ending::Whole, joint.time()))
}

/// Control steps in a time, at least one.
pub(super) fn every(time: f64, period: f64) -> u64 {
    (time / period).round().max(1.0) as u64
}

/// Values that the joint knows, and the true ones, after a control step.
fn row(joint: &VirtualJoint) -> Row {
    let (telemetry, truth) = (joint.joint().telemetry(), &joint.actuator().state().joint);
    let value = f64::from;
    Row {
        position: value(telemetry.motion.position),
        velocity: value(telemetry.motion.velocity),
        commanded_torque: value(telemetry.wanted.torque),
        compensation_torque: value(telemetry.compensated.torque),
        faded: matches!(
            telemetry.compensated.output.reason,
            Reason::OutsideTrainedBox(_) | Reason::FarOutsideTrainedBox(_)
        ),
        measured_torque: value(telemetry.measured_torque),
        current_d: value(telemetry.current.d),
        current_q: value(telemetry.current.q),
        bus_voltage: value(telemetry.bus_voltage),
        winding_temperature: value(joint.measured().winding_temperature),
        gear_temperature: value(joint.slow().gear_temperature),
        true_position: truth.position,
        true_velocity: truth.velocity,
        true_motor_torque: truth.motor_torque,
        true_friction_torque: truth.friction_torque,
        true_load_torque: truth.load_torque,
        true_gear_temperature: truth.heat.gear,
        ..Row::default()
    }
}
