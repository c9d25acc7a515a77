//! The joint: motor, gear, friction, load and heat, integrated in steps of at most [`MAXIMUM_STEP`].
//!
//! Velocity and bristles are solved together by the backward Euler rule, the position follows from the new velocity
//! (semi-implicit Euler): a frictionless pendulum keeps its energy, and stiff bristles cannot make the joint
//! unstable. Behind a [`transmission`](crate::transmission) the link is a second body, and both velocities are solved
//! together.

use crate::contact::Contact;
use crate::error::{ParameterError, within};
use crate::friction::{Bristles, FrictionStep, Surroundings};
use crate::parameters::JointParameters;
use crate::thermal::Heat;
use crate::transmission::{Line, Transmission};

/// Longest integration step, s.
pub const MAXIMUM_STEP: f64 = 1e-4;

/// Time constant with which the gear's torque becomes tooth load and so friction, s. Without it, friction and
/// acceleration would define each other within one step.
pub const GEAR_LOAD_LAG: f64 = 2e-3;

/// The joint's true motion, torques and temperatures; none of it is measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct State {
    /// Position of the motor at the scale of the link, rad; zero hangs straight down, not wrapped. Without a
    /// transmission that gives way it is the link's.
    pub position: f64,
    /// Its velocity, rad/s.
    pub velocity: f64,
    /// Position of the link, rad.
    pub link_position: f64,
    /// Velocity of the link, rad/s.
    pub link_velocity: f64,
    /// Acceleration over the last step, rad/s².
    pub acceleration: f64,
    /// Torque of the motor at the link before friction, Nm.
    pub motor_torque: f64,
    /// Friction torque, Nm; opposes a motion of its own sign.
    pub friction_torque: f64,
    /// Gravity, contact and external torque that the motor has to hold, Nm.
    pub load_torque: f64,
    /// Torque that the gear transmits to link and payload, after [`GEAR_LOAD_LAG`], Nm.
    pub gear_torque: f64,
    /// Heat that the friction makes, W; never negative.
    pub friction_loss: f64,
    /// Temperatures of winding, housing and gear, °C.
    pub heat: Heat,
}

/// Answer to a torque on the link in the next step, before its velocity is known: the torque that is there already, and
/// inertia and slope of the friction that stand against a change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Answer {
    /// Motor torque less friction and gravity at the velocity before, Nm.
    pub torque: f64,
    /// Inertia of rotor and link, kg m².
    pub inertia: f64,
    /// Slope of the friction over the velocity, Nm s/rad.
    pub slope: f64,
}

/// A virtual joint in motion.
#[derive(Clone, Debug)]
pub struct Joint {
    parameters: JointParameters,
    bristles: Bristles,
    transmission: Option<Transmission>,
    contact: Option<Contact>,
    relief: f64,
    state: State,
}

impl Joint {
    /// A joint at rest with its link hanging down and `temperature` (°C, -40 to 150) throughout.
    ///
    /// # Errors
    /// The first parameter, or the temperature, that is outside its range.
    pub fn new(parameters: JointParameters, temperature: f64) -> Result<Self, ParameterError> {
        parameters.validate()?;
        within("temperature", temperature, -40.0, 150.0)?;
        let state = State {
            position: 0.0,
            velocity: 0.0,
            link_position: 0.0,
            link_velocity: 0.0,
            acceleration: 0.0,
            motor_torque: 0.0,
            friction_torque: 0.0,
            load_torque: 0.0,
            gear_torque: 0.0,
            friction_loss: 0.0,
            heat: Heat::uniform(temperature),
        };
        let transmission = parameters.transmission.map(Transmission::new);
        Ok(Self { parameters, bristles: Bristles::default(), transmission, contact: None, relief: 1.0, state })
    }

    /// The same joint at `position` (rad) and `velocity` (rad/s), with unbent bristles and no twist.
    #[must_use]
    pub fn released_at(mut self, position: f64, velocity: f64) -> Self {
        (self.state.position, self.state.link_position) = (position, position);
        (self.state.velocity, self.state.link_velocity) = (velocity, velocity);
        self.transmission = self.parameters.transmission.map(Transmission::new);
        self.bristles = Bristles::default();
        self
    }

    /// Parameters of this joint.
    #[must_use]
    pub fn parameters(&self) -> &JointParameters {
        &self.parameters
    }

    /// State of the joint now.
    #[must_use]
    pub fn state(&self) -> &State {
        &self.state
    }

    /// Puts something into the link's way, or takes it out again.
    ///
    /// # Errors
    /// The first parameter of the contact that is outside its range.
    pub fn set_contact(&mut self, contact: Option<Contact>) -> Result<(), ParameterError> {
        contact.map_or(Ok(()), |contact| contact.validate())?;
        self.hold(contact);
        Ok(())
    }

    /// Counterpart of [`Self::set_contact`] for a contact that is known to be valid.
    pub(crate) fn hold(&mut self, contact: Option<Contact>) {
        self.contact = contact;
    }

    /// Factor of the dry friction from the next step on, above 0 to 1: what a joint that shares the drive leaves of it.
    pub(crate) fn relieve(&mut self, relief: f64) {
        self.relief = relief;
    }

    /// Contact in the link's way.
    #[must_use]
    pub fn contact(&self) -> Option<&Contact> {
        self.contact.as_ref()
    }

    /// Kinetic, potential, bristle, transmission and contact energy, J; zero when it hangs at rest.
    #[must_use]
    pub fn stored_energy(&self) -> f64 {
        let State { position, velocity, link_position, link_velocity, .. } = self.state;
        let (motor, load) = (&self.parameters.motor, &self.parameters.load);
        let kinetic = 0.5 * motor.reflected_inertia() * velocity * velocity
            + 0.5 * load.total_inertia() * link_velocity * link_velocity;
        let potential = load.gravity_amplitude() * (1.0 - libm::cos(link_position));
        let twisted = self.transmission.map_or(0.0, |transmission| transmission.energy(position - link_position));
        let contact = self.contact.map_or(0.0, |contact| contact.energy(link_position));
        kinetic + potential + self.bristles.energy(&self.parameters.friction) + twisted + contact
    }

    /// Moves on by `duration` (s, above zero) while the torque-producing `current` (A, limited to the current limit)
    /// and the `external_torque` (Nm at the link, positive pushes forward) stay the same.
    pub fn advance(&mut self, current: f64, external_torque: f64, duration: f64) {
        let limit = self.parameters.motor.current_limit;
        let current = current.clamp(-limit, limit);
        let motor_torque = self.parameters.motor.torque_per_ampere() * current;
        self.drive(motor_torque, self.parameters.motor.copper_loss(current), external_torque, duration);
    }

    /// Moves on by `duration` (s, above zero) while a motor with windings of its own gives `motor_torque` (Nm at the
    /// link, before friction) and loses `copper_loss` (W) in them; nothing is limited here.
    ///
    /// # Panics
    /// With a duration of zero or less.
    pub fn drive(&mut self, motor_torque: f64, copper_loss: f64, external_torque: f64, duration: f64) {
        assert!(duration > 0.0, "a joint advances by {duration} s");
        let steps = (duration / MAXIMUM_STEP - 1e-9).ceil().max(1.0);
        let step = duration / steps;
        for _ in 0..steps as u64 {
            self.step(motor_torque, copper_loss, external_torque, step);
        }
    }

    /// Answer to a torque on the link over the next `step` (s, at most [`MAXIMUM_STEP`]) under `motor_torque` (Nm at
    /// the link); contacts aside.
    #[must_use]
    pub fn answer(&self, motor_torque: f64, step: f64) -> Answer {
        let friction = self.next_friction(step);
        let gravity = self.parameters.load.gravity_torque(self.state.position);
        Answer {
            torque: motor_torque - gravity - friction.torque(self.state.velocity),
            inertia: self.parameters.inertia(),
            slope: friction.slope(),
        }
    }

    /// The friction of the next step.
    fn next_friction(&self, step: f64) -> FrictionStep {
        let State { position, velocity, gear_torque, heat, .. } = self.state;
        let surroundings = Surroundings { position, gear_torque, temperature: heat.gear, relief: self.relief };
        self.bristles.prepare(&self.parameters.friction, velocity, &surroundings, step)
    }

    fn step(&mut self, motor_torque: f64, copper_loss: f64, external_torque: f64, step: f64) {
        let friction = self.next_friction(step);
        let before = self.state.velocity;
        let (load_torque, transmitted) = match self.transmission {
            None => (self.move_as_one(&friction, motor_torque, external_torque, step), None),
            Some(mut transmission) => {
                let moved = self.move_as_two(&mut transmission, &friction, motor_torque, external_torque, step);
                self.transmission = Some(transmission);
                (moved.0, Some(moved.1))
            }
        };
        let parameters = &self.parameters;
        let state = &mut self.state;
        state.acceleration = (state.velocity - before) / step;
        state.position += step * state.velocity;

        let stored = self.bristles.energy(&parameters.friction);
        state.friction_torque = self.bristles.advance(&parameters.friction, &friction, state.velocity);
        let newly_stored = self.bristles.energy(&parameters.friction) - stored;
        state.friction_loss = state.friction_torque * state.velocity - newly_stored / step;
        state.motor_torque = motor_torque;
        state.load_torque = load_torque;

        let transmitted = transmitted.unwrap_or(load_torque + parameters.load.total_inertia() * state.acceleration);
        state.gear_torque += (transmitted - state.gear_torque) * step / (step + GEAR_LOAD_LAG);
        if self.transmission.is_none() {
            (state.link_position, state.link_velocity) = (state.position, state.velocity);
        }

        state.heat.advance(&parameters.thermal, copper_loss, state.friction_loss, step);
    }

    /// New velocity where motor and link are one body; the load's torque.
    fn move_as_one(&mut self, friction: &FrictionStep, motor_torque: f64, external_torque: f64, step: f64) -> f64 {
        let parameters = &self.parameters;
        let state = &mut self.state;
        let inertia = parameters.inertia();
        let before = state.velocity;
        let mut load_torque = parameters.load.gravity_torque(state.position) - external_torque;

        // The friction is a straight line over the new velocity, so the implicit step is one division.
        let net_torque = motor_torque - load_torque - friction.torque(before);
        state.velocity = before + step * net_torque / (inertia + step * friction.slope());
        if let Some(contact) = &self.contact {
            // The contact is another straight line; a wall that would have to pull is not touched.
            let (pressed, slope) = contact.prepare(state.position, step);
            let net_torque = net_torque - pressed - slope * before;
            let held = before + step * net_torque / (inertia + step * (friction.slope() + slope));
            if contact.gives(pressed + slope * held) {
                state.velocity = held;
                load_torque += pressed + slope * held;
            }
        }
        load_torque
    }

    /// New velocities of motor and link, and the link's position; the load's torque and the transmission's.
    fn move_as_two(
        &mut self,
        transmission: &mut Transmission,
        friction: &FrictionStep,
        motor_torque: f64,
        external_torque: f64,
        step: f64,
    ) -> (f64, f64) {
        let (parameters, state) = (&self.parameters, &mut self.state);
        let (motor, link) = (state.velocity, state.link_velocity);
        let inertias = [parameters.motor.reflected_inertia(), parameters.load.total_inertia()];
        let driving = motor_torque - friction.torque(motor);
        let load = parameters.load.gravity_torque(state.link_position) - external_torque;
        let twist = state.position - state.link_position;
        // Straight lines over both new velocities; of the ends that may touch, the first that need not pull.
        let solved = |line: &Line, (pressed, slope): (f64, f64)| {
            let between = line.torque(motor - link);
            let right = [step * (driving - between), step * (between - load - pressed - slope * link)];
            let coupled = -step * line.slope;
            let (a, d) =
                (inertias[0] + step * (friction.slope() + line.slope), inertias[1] + step * (slope + line.slope));
            let determinant = a * d - coupled * coupled;
            let motor = motor + (right[0] * d - coupled * right[1]) / determinant;
            let link = link + (right[1] * a - coupled * right[0]) / determinant;
            (motor, link, line.torque(motor - link), pressed + slope * link)
        };
        let mut found = solved(&Line::FREE, (0.0, 0.0));
        for line in transmission.prepare(twist, motor - link, step) {
            if let Some(contact) = &self.contact {
                let held = solved(&line, contact.prepare(state.link_position, step));
                if line.holds(held.0 - held.1) && contact.gives(held.3) {
                    found = held;
                    break;
                }
            }
            let free = solved(&line, (0.0, 0.0));
            let touches = |contact: &Contact| {
                let (pressed, slope) = contact.prepare(state.link_position, step);
                contact.gives(pressed + slope * free.1)
            };
            if line.holds(free.0 - free.1) && !self.contact.as_ref().is_some_and(touches) {
                found = free;
                break;
            }
        }
        let (moved, carried, transmitted, pressed) = found;
        transmission.advance(motor - link, moved - carried, step);
        state.velocity = moved;
        state.link_velocity = carried;
        state.link_position += step * carried;
        (load + pressed, transmitted)
    }
}
