//! A random joint that something touches, and one that nothing does: the firmware's external torque against the true
//! one, and collisions. Friction model and load are wrong by stated parts of the truth.

use crate::borne::configured;
use crate::driving::demand;
use crate::informed::informed;
use crate::variant::DEFAULT;
use friction_compensation::compensation::Request;
use friction_compensation::friction::FrictionModel;
use joint_firmware::joint::adaptation::LOOK_RATE;
use joint_firmware::joint::configuration::LoadConfiguration;
use joint_firmware::joint::state_machine::State;
use plant::VirtualJoint;
use plant::actuator::ActuatorParameters;
use plant::contact::{Contact, Side};
use plant::excitation::{Segment, Trajectory, slow_reversals};
use plant::friction_factors::FrictionFactors;
use plant::virtual_joint::Setup;

/// Parts of the truth by which the joint's knowledge is wrong: every friction parameter by up to so much, inertia and
/// payload by exactly so much, to either side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wrong {
    /// Friction.
    pub friction: f64,
    /// Load.
    pub load: f64,
}

/// Contacts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Touch {
    /// A step of the torque against the motion, as a part of the torque limit, for half a second.
    Push(f64),
    /// A wall or a hand at a third of the travel: stiffness in torque limits a radian.
    Wall(f64),
}

/// Errors of the external torque while nothing touches the joint, of one kind of motion.
#[derive(Clone, Copy, Debug, Default)]
pub struct Errors {
    /// Sum of the squared errors, % of the torque limit.
    squares: f64,
    bounds: f64,
    covered: f64,
    looks: f64,
}

impl Errors {
    fn note(&mut self, error: f64, bound: f64) {
        self.squares += error * error;
        self.bounds += bound;
        self.covered += f64::from(u8::from(error.abs() <= bound));
        self.looks += 1.0;
    }

    /// RMS of the error, % of the torque limit.
    pub fn rms(&self) -> f64 {
        (self.squares / self.looks).sqrt()
    }

    /// Mean uncertainty, % of the torque limit.
    pub fn bound(&self) -> f64 {
        self.bounds / self.looks
    }

    /// Share of the looks in which the uncertainty covers the error, %.
    pub fn covered(&self) -> f64 {
        100.0 * self.covered / self.looks
    }
}

/// A joint that nothing touched.
#[derive(Clone, Copy, Debug, Default)]
pub struct Untouched {
    /// Below twice the standstill velocity.
    pub at_rest: Errors,
    /// Above it.
    pub moving: Errors,
    /// Collisions that there were none of.
    pub collisions: u16,
}

/// A contact as it was found.
#[derive(Clone, Copy, Debug)]
pub struct Found {
    /// Time from the first touch to the collision, s; none where it was missed.
    pub after: Option<f64>,
    /// True external torque by then, or the largest of all, % of the torque limit.
    pub torque: f64,
}

struct Bench {
    parameters: ActuatorParameters,
    joint: VirtualJoint,
    limit: f64,
    standstill: f64,
}

impl Bench {
    /// Joint `seed`, in motion's beginning; `threshold` as a part of the torque limit.
    fn new(seed: u64, wrong: Wrong, threshold: f64) -> Result<Self, String> {
        let parameters = ActuatorParameters::randomised(seed).aligned();
        let mut setup = Setup::of(&parameters).compensating(Request::Physical);
        let limit = f64::from(setup.configuration.limits.torque);
        let sign = if seed.is_multiple_of(2) { 1.0 } else { -1.0 };
        setup.configuration.load = LoadConfiguration {
            collision_threshold: (threshold * limit) as f32,
            ..configured(&parameters, 1.0 + sign * wrong.load)
        };
        // Half of the models are wrong at the corners of the range.
        let factors = match seed % 4 {
            0 | 1 => FrictionFactors::drawn(seed, wrong.friction),
            _ => FrictionFactors::extreme(seed, wrong.friction),
        };
        let friction = parameters.joint.friction.scaled(&factors).map_err(|error| error.to_string())?;
        let model = FrictionModel::new(&informed(&parameters, &friction), setup.bridge.motion_rate());
        let joint = DEFAULT.enabled(&parameters, &setup, Some(model), 0.0, seed).map_err(|error| error.to_string())?;
        let standstill = f64::from(setup.configuration.compensation.standstill_velocity);
        Ok(Self { parameters, joint, limit, standstill })
    }

    /// External torque that really acts, Nm.
    fn external(&self) -> f64 {
        let state = self.joint.actuator().state().joint;
        self.parameters.joint.load.gravity_torque(state.position) - state.load_torque
    }

    fn wall(&mut self, stiffness: f64) -> Result<(), String> {
        let wall = Contact {
            position: self.parameters.joint.limits.travel / 3.0,
            stiffness: stiffness * self.limit,
            damping: 0.0,
            side: Side::Above,
        };
        self.joint.actuator_mut().set_contact(Some(wall)).map_err(|error| error.to_string())
    }

    /// Along a trajectory; `hand` gives the torque from the joint's velocity and the control step, and `look` sees
    /// every look of the observer, until it says that it has seen enough.
    fn follow(
        &mut self,
        trajectory: &Trajectory,
        hand: impl Fn(f64, u64) -> f64,
        mut look: impl FnMut(&Self, f64) -> bool,
    ) -> Result<(), String> {
        let steps = (trajectory.duration() / self.joint.period()) as u64;
        let per_look = (1.0 / (f64::from(LOOK_RATE) * self.joint.period())).round() as u64;
        for n in 0..steps {
            let asked = demand(&self.joint, trajectory, n);
            let torque = hand(self.joint.actuator().state().joint.velocity, n);
            let telemetry = self.joint.step(&asked, torque);
            if telemetry.state != State::OperationEnabled {
                return Err(format!("ended in {:?}: {:?}", telemetry.state, telemetry.faults));
            }
            if n % per_look == 0 && look(self, n as f64 * self.joint.period()) {
                return Ok(());
            }
        }
        Ok(())
    }
}

/// Moves over most of travel and speed, and a rest.
fn moves_and_rest(parameters: &ActuatorParameters) -> Result<Trajectory, String> {
    let limits = &parameters.joint.limits;
    let acceleration = 0.5 * parameters.joint.usable_acceleration().min(20.0);
    let go = |speed: f64, to: f64| Segment::Move { to: to * limits.travel, speed: speed * limits.speed, acceleration };
    let rest = Segment::Rest { duration: 0.5 };
    let way = vec![go(0.5, 0.6), rest.clone(), go(0.7, -0.6), go(0.2, 0.3), rest.clone(), go(0.05, 0.0), rest];
    Trajectory::new(way).map_err(|error| error.to_string())
}

/// Joint `seed` in moves, at rest and through slow reversals, touched by nothing; with a threshold as a part of the
/// torque limit.
///
/// # Errors
/// Refusals of plant or firmware, and a joint that does not stay enabled.
pub fn untouched(seed: u64, wrong: Wrong, threshold: f64) -> Result<Untouched, String> {
    let failed = |error: String| format!("joint {seed}, {wrong:?}: {error}");
    let mut bench = Bench::new(seed, wrong, threshold).map_err(failed)?;
    let limits = &bench.parameters.joint.limits;
    let acceleration = bench.parameters.joint.usable_acceleration().min(20.0);
    let slow = Trajectory::new(slow_reversals(0.01 * limits.speed, 0.5, acceleration, 3));
    let slow = slow.map_err(|error| failed(error.to_string()))?;
    let mut found = Untouched::default();
    for trajectory in [moves_and_rest(&bench.parameters).map_err(failed)?, slow] {
        let seen = bench.follow(
            &trajectory,
            |_, _| 0.0,
            |bench, _| {
                let report = bench.joint.external_torque();
                let rests = bench.joint.actuator().state().joint.velocity.abs() < 2.0 * bench.standstill;
                let errors = if rests { &mut found.at_rest } else { &mut found.moving };
                let percent = |torque: f32| 100.0 * f64::from(torque) / bench.limit;
                errors.note(percent(report.torque), percent(report.uncertainty));
                false
            },
        );
        seen.map_err(failed)?;
    }
    found.collisions = bench.joint.external_torque().collisions;
    Ok(found)
}

/// Joint `seed` touched on its moves, until the collision is found.
///
/// # Errors
/// Refusals of plant or firmware, a joint that does not stay enabled, and a collision before the touch.
pub fn touched(seed: u64, wrong: Wrong, threshold: f64, touch: Touch) -> Result<Found, String> {
    let failed = |error: String| format!("joint {seed}, {touch:?}: {error}");
    let mut bench = Bench::new(seed, wrong, threshold).map_err(failed)?;
    let trajectory = moves_and_rest(&bench.parameters).map_err(failed)?;
    if let Touch::Wall(stiffness) = touch {
        bench.wall(stiffness).map_err(failed)?;
    }
    let (limit, period) = (bench.limit, bench.joint.period());
    let (from, to) = ((0.3 / period) as u64, (0.8 / period) as u64);
    let hand = |velocity: f64, n: u64| match touch {
        Touch::Push(part) if (from..to).contains(&n) => -part * limit * velocity.signum(),
        _ => 0.0,
    };
    let (mut first, mut early) = (None, false);
    let mut found = Found { after: None, torque: 0.0 };
    let seen = bench.follow(&trajectory, hand, |bench, time| {
        let acts = 100.0 * bench.external().abs() / bench.limit;
        if acts > 0.01 {
            first = first.or(Some(time));
            found.torque = found.torque.max(acts);
        }
        let collides = bench.joint.external_torque().collisions > 0;
        early |= collides && first.is_none();
        if collides {
            found.after = first.map(|first| time - first);
            found.torque = acts;
        }
        // One contact is one chance.
        collides || first.is_some_and(|first| time > first + 0.6)
    });
    seen.map_err(failed)?;
    if early { Err(failed("a collision before the touch".into())) } else { Ok(found) }
}
