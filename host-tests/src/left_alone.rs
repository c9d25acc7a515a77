//! A joint that nobody commands, with a model that is wrong in every parameter and sensors up to two periods late: what
//! it does by itself. Judged by energy.

use crate::borne::configured;
use crate::commission::Commissioned;
use crate::driving::{COMMAND_STEPS, follow, moves};
use crate::in_the_loop::delivered;
use crate::informed::informed;
use crate::variant::{DEFAULT, Variant, measured};
use friction_compensation::compensation::Request;
use friction_compensation::friction::FrictionModel;
use joint_firmware::joint::adaptation::Adaptation;
use joint_firmware::joint::configuration::LoadConfiguration;
use joint_firmware::joint::state_machine::{Controlword, State};
use joint_firmware::joint::{Command, Demand, Mode};
use plant::actuator::ActuatorParameters;
use plant::excitation::{Segment, Trajectory};
use plant::friction_factors::FrictionFactors;
use plant::virtual_joint::Setup;

/// Time for which a joint moves at least before it is left alone with experience, s.
const LEARNED: f64 = 10.0;
/// Error of every parameter of the model.
pub const ERROR: f64 = 0.5;

/// Motion of a joint in a scenario.
#[derive(Clone, Copy, Debug, Default)]
pub struct Seen {
    /// Largest distance from the start before the push, rad.
    pub drift: f64,
    /// Largest mechanical energy during the push, J, over that at rest.
    pub pushed: f64,
    /// Largest growth of the energy over a tenth of a second after the push, J.
    pub growth: f64,
    /// Friction's work in the last half second of the run, J: what a limit cycle would have to deliver.
    pub lost: f64,
    /// Energy that the bristles hold when they break away, J: the scale of what creep at rest can store and give back.
    pub breakaway: f64,
    /// Largest withheld share of the compensation.
    pub withheld: f64,
}

/// Way in which a joint is left alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Alone {
    /// Torque mode, no torque.
    Free,
    /// A spring and a damper hold the position.
    Held,
    /// Torque mode: a controller holds the position by such a spring and damper, 1,000 times a second, and says that it
    /// pushes.
    Sprung,
    /// Torque mode: a controller bears the payload's gravity.
    Borne,
    /// Torque mode, no torque: the payload swings.
    Swinging,
    /// Joint with its payload, away from where that hangs, held in position by a spring and a damper; the joint's own
    /// feedforward bears a gravity that is configured wrong.
    HeldBearing(Gravity),
    /// The same without spring and damper: the payload floats.
    Floating(Gravity),
}

/// Errors of the configured gravity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Gravity {
    /// 30 % too little.
    Little,
    /// 30 % too much.
    Much,
    /// The other way round.
    Reversed,
}

impl Gravity {
    /// Part of the true gravity's torque that the feedforward gives.
    const fn factor(self) -> f64 {
        match self {
            Self::Little => 0.7,
            Self::Much => 1.3,
            Self::Reversed => -1.0,
        }
    }
}

impl Alone {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Free, Self::Held, Self::Sprung, Self::Borne, Self::Swinging];

    /// Ways with a feedforward of gravity.
    pub const BEARING: [Self; 6] = [
        Self::HeldBearing(Gravity::Little),
        Self::HeldBearing(Gravity::Much),
        Self::HeldBearing(Gravity::Reversed),
        Self::Floating(Gravity::Little),
        Self::Floating(Gravity::Much),
        Self::Floating(Gravity::Reversed),
    ];

    /// True where the joint has its payload.
    const fn loaded(self) -> bool {
        matches!(self, Self::Borne | Self::Swinging) || self.gravity().is_some()
    }

    /// The feedforward of gravity, where there is one.
    const fn gravity(self) -> Option<Gravity> {
        match self {
            Self::HeldBearing(gravity) | Self::Floating(gravity) => Some(gravity),
            _ => None,
        }
    }

    /// True where a spring of the joint's own holds the position.
    const fn held(self) -> bool {
        matches!(self, Self::Held | Self::HeldBearing(_))
    }
}

/// Kind of random joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// [`ActuatorParameters::randomised`], configured by what it is.
    Randomised,
    /// [`ActuatorParameters::judging`], configured by its data sheet.
    Judging,
}

impl Kind {
    /// Joint `seed` without its payload or with it, and its configuration.
    fn joint(self, seed: u64, loaded: bool) -> (ActuatorParameters, Setup) {
        let whole = match self {
            Self::Randomised => ActuatorParameters::randomised(seed),
            Self::Judging => ActuatorParameters::judging(seed),
        };
        let parameters = if loaded { whole.aligned() } else { whole.aligned().without_payload() };
        let setup = match self {
            Self::Randomised => Setup::of(&parameters),
            Self::Judging => Setup::by_data_sheet(&parameters, seed),
        };
        (parameters, setup)
    }
}

/// Knowledge that a joint that is left alone has of its friction.
#[derive(Clone, Copy)]
pub enum Knowledge<'a> {
    /// A model with every parameter wrong by [`ERROR`].
    Wrong,
    /// The same, after motion on command with adaptation on.
    Experienced,
    /// Its own image, with the uncertainty that its fit states.
    Image(&'a Commissioned),
}

/// Learned friction of a joint that has moved over its travel.
fn learned(
    parameters: &ActuatorParameters,
    setup: &Setup,
    model: &FrictionModel,
    variant: &Variant,
    seed: u64,
) -> Result<Adaptation, String> {
    let joint = variant.enabled(parameters, setup, Some(model.clone()), 0.0, seed);
    let mut joint = joint.map_err(|error| error.to_string())?;
    let trajectory = moves(parameters, LEARNED)?;
    follow(&mut joint, &trajectory, |_, _, _| ()).map_err(|state| format!("learning ended in {state:?}"))?;
    Ok(*joint.learned())
}

/// The way to half of the travel, and a rest there.
fn go_away(parameters: &ActuatorParameters) -> Result<Trajectory, String> {
    let limits = &parameters.joint.limits;
    let acceleration = 0.5 * parameters.joint.usable_acceleration().min(20.0);
    let way = Segment::Move { to: 0.5 * limits.travel, speed: 0.5 * limits.speed, acceleration };
    Trajectory::new(vec![way, Segment::Rest { duration: 0.5 }]).map_err(|error| error.to_string())
}

/// Part of the mode's damping beside the spring that holds the position.
const DAMPING: f32 = 0.2;

/// Leaves joint `seed` alone, pushes it once, and leaves it alone again; with a compensation that differs from the
/// default in `variant`, or none. Friction is computed for the measured velocity, the source that feeds back; the
/// command's has nothing to add while nothing is commanded.
///
/// # Errors
/// A joint that does not stay enabled.
pub fn run(
    (kind, seed): (Kind, u64),
    alone: Alone,
    variant: Option<&Variant>,
    knowledge: Knowledge,
    steps: u32,
) -> Result<Seen, String> {
    let (parameters, setup) = kind.joint(seed, alone.loaded());
    // Half of the models are wrong at the corners of the range, with most of them too strong.
    let factors = match seed % 4 {
        0 => FrictionFactors::drawn(seed, ERROR),
        1 => FrictionFactors::extreme(seed, ERROR),
        _ => FrictionFactors::uniform(1.0 + ERROR),
    };
    let wrong = parameters.joint.friction.scaled(&factors).map_err(|error| error.to_string())?;
    let compensates = variant.is_some();
    // If a way leads there, it ends in the same state with compensation and without.
    let acts = if matches!(knowledge, Knowledge::Image(_)) { Request::PhysicalAndNetwork } else { Request::Physical };
    let request = if compensates || alone.gravity().is_some() { acts } else { Request::Off };
    let mut setup = setup.compensating(request);
    measured(&mut setup.configuration);
    let bears = alone.gravity().map_or(0.0, Gravity::factor);
    if alone.gravity().is_some() {
        setup.configuration.load = LoadConfiguration {
            gravity: (bears.abs() * parameters.joint.load.gravity_amplitude()) as f32,
            hanging: if bears < 0.0 { core::f32::consts::PI } else { 0.0 },
            payload_mass: 0.0,
            ..configured(&parameters, bears.abs())
        };
    }
    let model = match knowledge {
        Knowledge::Image(found) => {
            setup.configuration.compensation.uncertainty =
                found.uncertainty.unwrap_or(setup.configuration.compensation.uncertainty);
            found.model.clone()
        }
        _ => FrictionModel::new(&informed(&parameters, &wrong), setup.bridge.motion_rate()),
    };
    let variant = variant.unwrap_or(&DEFAULT);
    let mut joint =
        variant.enabled(&parameters, &setup, Some(model.clone()), 0.0, seed).map_err(|error| error.to_string())?;
    if request != Request::Off && matches!(knowledge, Knowledge::Experienced) {
        joint.set_adaptation(learned(&parameters, &setup, &model, variant, seed)?);
    }

    if alone.gravity().is_some() {
        let away = go_away(&parameters)?;
        follow(&mut joint, &away, |_, _, _| ()).map_err(|state| format!("on its way: {state:?}"))?;
    }
    let gains = setup.configuration.gains;
    let spring = if alone.gravity().is_some() { joint.actuator().state().joint.position } else { 0.0 };
    let mut command = Command::default();
    if alone.held() || alone.gravity().is_some() {
        command = Command { mode: Mode::Impedance, position: spring as f32, ..command };
    }
    if alone.held() {
        (command.stiffness, command.damping) = (gains.stiffness, DAMPING * gains.damping);
    }
    let friction = &parameters.joint.friction;
    let strength = 3.0 * friction.breakaway.forward.max(friction.breakaway.backward);
    let mut demand = Demand { controlword: Controlword::ENABLE_OPERATION, command, ..Demand::default() };
    if alone.gravity().is_some() {
        // The spring that brought it here goes slowly: at once it would be a push of the command's.
        (0..SETTLING).for_each(|n| {
            let left = 1.0 - n as f32 / SETTLING as f32;
            let (stiffness, damping) = (command.stiffness, command.damping);
            demand.command.stiffness = stiffness + left * (gains.stiffness - stiffness);
            demand.command.damping = damping + left * (gains.damping - damping);
            demand.sequence = n / COMMAND_STEPS as u32;
            joint.step(&demand, 0.0);
        });
        demand.command = command;
        if !compensates {
            let off = setup.compensating(Request::Off);
            joint.set_active(off.configuration.prepare(&off.bridge).map_err(|error| error.to_string())?);
        }
    }
    let start = joint.actuator().state().joint.position;
    let level = friction.breakaway.forward.max(friction.breakaway.backward);
    let mut seen = Seen { breakaway: 0.5 * level * level / friction.bristle_stiffness, ..Seen::default() };
    let (mut window, mut rest, mut begin) = (f64::NAN, 0.0, f64::NAN);
    let speed = parameters.joint.limits.speed;
    let mut pushing = false;
    for n in 0..steps {
        demand.sequence = demand.sequence.wrapping_add(u32::from(n % COMMAND_STEPS as u32 == 0));
        // Quiet for 0.3 s, then a push until a quarter of the speed limit, a tenth of a second at most.
        let state = joint.actuator().state().joint;
        pushing = (n == 6_000 || pushing) && n < 8_000 && state.velocity < 0.25 * speed;
        let external = if pushing { strength } else { 0.0 };
        let gravity = parameters.joint.load.gravity_torque(state.position)
            / delivered(&parameters, &setup, joint.actuator().state());
        let asks = n % COMMAND_STEPS as u32 == 0;
        if asks && alone == Alone::Borne {
            demand.command.torque = gravity as f32;
        } else if asks && alone == Alone::Sprung {
            let (position, velocity) = (state.position as f32, state.velocity as f32);
            demand.command.torque = -gains.stiffness * position - DAMPING * gains.damping * velocity;
            demand.command.push = demand.command.torque;
        }
        let telemetry = joint.step(&demand, external);
        if telemetry.state != State::OperationEnabled {
            return Err(format!("{:?} {:?}", telemetry.state, telemetry.faults));
        }
        let state = joint.actuator().state().joint;
        let position = state.position;
        let held = match alone {
            // The spring is as stiff as the torque that arrives makes it.
            _ if alone.held() || alone == Alone::Sprung => {
                let arrives = delivered(&parameters, &setup, joint.actuator().state());
                0.5 * arrives * f64::from(gains.stiffness) * (position - spring).powi(2)
            }
            // Work of a load that the command bears is no energy of the joint's.
            Alone::Borne => -parameters.joint.load.gravity_amplitude() * (1.0 - position.cos()),
            _ => 0.0,
        } - bears * parameters.joint.load.gravity_amplitude() * (1.0 - position.cos());
        let energy = joint.actuator().joint().stored_energy() + held;
        seen.withheld = seen.withheld.max(1.0 - f64::from(telemetry.compensated.permitted));
        if n < 6_000 {
            seen.drift = seen.drift.max((state.position - start).abs());
            rest = energy;
        }
        if n >= 8_000 && n % 2_000 == 0 {
            if n > 8_000 {
                seen.growth = seen.growth.max(energy - window);
            }
            window = energy;
        } else if n < 8_000 {
            seen.pushed = seen.pushed.max(energy - rest);
        }
        if alone.gravity().is_some() {
            // Motion that a wrongly borne weight causes counts as a push does.
            begin = if begin.is_nan() { energy } else { begin };
            seen.pushed = seen.pushed.max(begin - energy);
        }
        if n + LAST >= steps {
            seen.lost += (state.friction_torque * state.velocity * joint.period()).abs();
        }
    }
    Ok(seen)
}

/// Returns `true` if a joint that was left alone moved by itself; with what it did without compensation.
pub fn moves_by_itself(alone: Alone, with: &Seen, without: &Seen) -> bool {
    // A weight that is borne wrong moves a joint that its friction does not hold, whatever compensation does.
    let falls = alone.gravity().is_some() && without.drift > 1e-3;
    let starts = with.drift > without.drift + 1e-3 && !falls;
    let gains_energy = with.growth > without.growth + 0.01 * with.pushed + 0.1 * with.breakaway;
    // A weakly damped spring still creeps back against friction; with less friction, for longer.
    let keeps = with.lost > 2.0 * without.lost + 0.01 * with.pushed + 0.1 * with.breakaway;
    starts || gains_energy || keeps
}

/// Control steps of a run, and of one that shows whether what still moves then comes to rest.
const STEPS: (u32, u32) = (30_000, 120_000);
/// The same of the longer one with a payload that is borne wrong: it swings from half of the travel.
const SWINGING: u32 = 400_000;
/// Control steps from the end of the way there until it is left alone.
const SETTLING: u32 = 6_000;
/// Control steps in which friction's work is counted.
const LAST: u32 = 10_000;

/// Joint `seed` in situations with a compensation: the largest drift, rad, and what moved by itself.
pub fn judged(
    (kind, seed): (Kind, u64),
    situations: &[Alone],
    variant: &Variant,
    knowledge: Knowledge,
) -> (f64, Vec<String>) {
    let (mut drift, mut bad) = (0.0f64, Vec::new());
    for &alone in situations {
        // With less friction a joint creeps for longer. What is a limit cycle goes on; creep comes to rest.
        let (short, long) = if alone.gravity().is_some() { (STEPS.0, SWINGING) } else { STEPS };
        let (largest, moves) = compared((kind, seed), alone, variant, knowledge, short);
        drift = drift.max(largest);
        if moves.is_some() {
            bad.extend(compared((kind, seed), alone, variant, knowledge, long).1);
        }
    }
    (drift, bad)
}

/// The drift with compensation, and what joint and compensation did where that moves by itself.
fn compared(
    joint: (Kind, u64),
    alone: Alone,
    variant: &Variant,
    knowledge: Knowledge,
    steps: u32,
) -> (f64, Option<String>) {
    let (with, without) =
        (run(joint, alone, Some(variant), knowledge, steps), run(joint, alone, None, knowledge, steps));
    let moves = match (&with, &without) {
        (Ok(with), Ok(without)) => moves_by_itself(alone, with, without),
        _ => true,
    };
    let drift = with.as_ref().map_or(0.0, |with| with.drift);
    let shown = || format!("{joint:?}, {alone:?}: {with:?}, without compensation {without:?}");
    (drift, moves.then(shown))
}
