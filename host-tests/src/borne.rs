//! A random joint with its payload, moved with and without the feedforward of its load, whose configuration is right or
//! wrong by a factor.

use crate::driving::{COMMAND_STEPS, demand, moves};
use crate::informed::informed;
use crate::variant::DEFAULT;
use friction_compensation::compensation::Request;
use friction_compensation::friction::FrictionModel;
use joint_firmware::joint::configuration::{LoadConfiguration, LoadFeedforwardRequest};
use joint_firmware::joint::state_machine::State;
use joint_firmware::joint::{Command, Demand, Mode};
use plant::actuator::ActuatorParameters;
use plant::virtual_joint::Setup;

/// The load of an actuator as a user would configure it, every number of it times `factor`: rotor and link, and the
/// payload by mass and arm.
pub fn configured(parameters: &ActuatorParameters, factor: f64) -> LoadConfiguration {
    let joint = &parameters.joint;
    let load = &joint.load;
    LoadConfiguration {
        request: LoadFeedforwardRequest::Both,
        inertia: (factor * (joint.inertia() - load.mass * load.length * load.length)) as f32,
        gravity: 0.0,
        hanging: 0.0,
        payload_mass: (factor * load.mass) as f32,
        payload_arm: load.length as f32,
        ..LoadConfiguration::NONE
    }
}

/// A move's errors.
#[derive(Clone, Copy, Debug)]
pub struct Errors {
    /// RMS of the position error, rad.
    pub position: f64,
    /// RMS of what the feedforward leaves of inertia and gravity, % of their RMS.
    pub torque: f64,
}

/// Moves joint `seed` over most of its travel and speed for some 10 s in a mode, friction compensated by a model that
/// knows the plant's parameters, with a load feedforward as `load` configures it.
///
/// In impedance mode the error is that from the trajectory; in position mode, which has a ramp of its own, from the
/// reference of that ramp (60F4h).
///
/// # Errors
/// Refusals of plant or firmware, and a joint that does not stay enabled.
pub fn moved(seed: u64, mode: Mode, load: impl Fn(&ActuatorParameters) -> LoadConfiguration) -> Result<Errors, String> {
    let failed = |error: String| format!("joint {seed}, {mode:?}: {error}");
    let parameters = ActuatorParameters::randomised(seed).aligned();
    let mut setup = Setup::of(&parameters).compensating(Request::Physical);
    setup.configuration.load = load(&parameters);
    let model = FrictionModel::new(&informed(&parameters, &parameters.joint.friction), setup.bridge.motion_rate());
    let joint = DEFAULT.enabled(&parameters, &setup, Some(model), 0.0, seed);
    let mut joint = joint.map_err(|error| failed(error.to_string()))?;
    let trajectory = moves(&parameters, 10.0).map_err(failed)?;
    let plant = &parameters.joint;
    let (mut squares, mut left, mut all, mut count) = (0.0, 0.0, 0.0, 0.0);
    // The reference velocity in the steps of the command before.
    let mut before = [0.0; COMMAND_STEPS as usize];
    for n in 0..(trajectory.duration() / joint.period()) as u64 {
        let asked = demand(&joint, &trajectory, n);
        let asked = match mode {
            Mode::Impedance => asked,
            _ => Demand { command: Command { mode, position: asked.command.position, ..Command::NOTHING }, ..asked },
        };
        let borne = f64::from(joint.bearing(&asked).command.torque);
        let telemetry = joint.step(&asked, 0.0);
        if telemetry.state != State::OperationEnabled {
            return Err(failed(format!("ended in {:?}: {:?}", telemetry.state, telemetry.faults)));
        }
        let state = joint.actuator().state().joint;
        let asked_for = match mode {
            Mode::Impedance => f64::from(asked.command.position),
            _ => f64::from(telemetry.position_demand),
        };
        squares += (asked_for - state.position).powi(2);
        let velocity = f64::from(telemetry.wanted.velocity.unwrap_or(0.0));
        let place = &mut before[(n % COMMAND_STEPS) as usize];
        let acceleration = (velocity - *place) / (COMMAND_STEPS as f64 * joint.period());
        *place = velocity;
        let needed = plant.inertia() * acceleration + plant.load.gravity_torque(state.position);
        left += (needed - borne).powi(2);
        all += needed * needed;
        count += 1.0;
    }
    Ok(Errors { position: f64::sqrt(squares / count), torque: 100.0 * f64::sqrt(left / all) })
}
