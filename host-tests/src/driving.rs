//! A virtual joint switched on and driven along a trajectory, as a controller on the bus would.

use joint_firmware::joint::state_machine::{Controlword, State};
use joint_firmware::joint::{Command, Demand, Mode, Telemetry};
use plant::VirtualJoint;
use plant::actuator::{ActuatorParameters, ActuatorState};
use plant::excitation::{Segment, Trajectory};
use plant::virtual_joint::{Setup, VirtualJointError};

/// Control steps between two commands: a bus at 1 kHz.
pub const COMMAND_STEPS: u64 = 20;

/// The demand of control step `n` along a trajectory: its position and velocity in impedance mode, with the joint's own
/// stiffness and damping.
pub fn demand(joint: &VirtualJoint, trajectory: &Trajectory, n: u64) -> Demand {
    let gains = joint.active().motion;
    let command = n / COMMAND_STEPS;
    let reference = trajectory.at((command * COMMAND_STEPS) as f64 * joint.period());
    Demand {
        controlword: Controlword::ENABLE_OPERATION,
        command: Command {
            mode: Mode::Impedance,
            position: reference.position as f32,
            velocity: reference.velocity as f32,
            torque: 0.0,
            stiffness: gains.stiffness,
            damping: gains.damping,
            ..Command::NOTHING
        },
        sequence: command as u32 + 1,
        ..Demand::default()
    }
}

/// Moves over most of a joint's travel and speed, again and again, for at least `duration` (s).
///
/// # Errors
/// Refusals of the plant.
pub fn moves(parameters: &ActuatorParameters, duration: f64) -> Result<Trajectory, String> {
    let limits = &parameters.joint.limits;
    let acceleration = parameters.joint.usable_acceleration().min(20.0);
    // Shares of speed limit and travel.
    let once = [(0.5, 0.6), (0.5, -0.6), (0.2, 0.3), (0.7, -0.3), (0.05, 0.0)].map(|(speed, to)| Segment::Move {
        to: to * limits.travel,
        speed: speed * limits.speed,
        acceleration: 0.5 * acceleration,
    });
    let trajectory = |times| {
        let many = core::iter::repeat_n(&once, times).flatten().cloned().collect();
        Trajectory::new(many).map_err(|error| error.to_string())
    };
    let times = (duration / trajectory(1)?.duration()).ceil().max(1.0) as usize;
    trajectory(times)
}

/// Follows a trajectory; `look` sees every control step. The state where the joint does not stay enabled.
pub fn follow(
    joint: &mut VirtualJoint,
    trajectory: &Trajectory,
    mut look: impl FnMut(f64, &Telemetry, &ActuatorState),
) -> Result<(), State> {
    let steps = (trajectory.duration() / joint.period()) as u64;
    for n in 0..steps {
        let demand = demand(joint, trajectory, n);
        let telemetry = joint.step(&demand, 0.0);
        if telemetry.state != State::OperationEnabled {
            return Err(telemetry.state);
        }
        look(n as f64 * joint.period(), &telemetry, joint.actuator().state());
    }
    Ok(())
}

/// A joint switched on, at rest.
pub fn enabled(
    parameters: &ActuatorParameters,
    setup: &Setup,
    warmth: f64,
    seed: u64,
) -> Result<VirtualJoint, VirtualJointError> {
    let temperature = parameters.joint.thermal.ambient + warmth;
    let mut joint = VirtualJoint::new(*parameters, setup, temperature, seed)?;
    joint.enable()?;
    Ok(joint)
}
