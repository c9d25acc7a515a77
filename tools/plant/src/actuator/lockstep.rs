//! Bridge, windings, bus, joint and sensors together, one PWM period at a time.
//!
//! In a period the windings take several steps (of at most [`LONGEST_STEP`], or [`LONGEST_DIODE_STEP`] where diodes or
//! a broken lead decide) at the speed that the rotor has at its beginning; then the joint moves on by the period with
//! the windings' mean torque and losses. Cogging acts on the joint only.

use super::accessories::{Accessories, Fitted};
use super::bus::Bus;
use super::faults::{ActiveFaults, Fault, Schedule};
use super::frame::Frame;
use super::inverter::{DeadTime, Inverter};
use super::legs::{Leg, Rails};
use super::parameters::ActuatorParameters;
use super::sensors::{DriveSample, DriveSensors, Sensed};
use super::windings::{Rotation, Windings};
use crate::contact::Contact;
use crate::error::{ParameterError, within};
use crate::joint::{Answer, Joint, State};

/// Longest step of the windings while the bridge drives them, s.
pub const LONGEST_STEP: f64 = 2.5e-5;

/// Longest step of the windings while diodes carry their current, s.
pub const LONGEST_DIODE_STEP: f64 = 5e-6;

/// Lowest bus voltage at which the board takes its idle power, V; below it has switched itself off.
const LOWEST_SUPPLY: f64 = 5.0;

/// Mean powers over the last period, W. Input = copper loss + bridge loss + mechanical + rise of the magnetic energy:
/// to rounding while all phases are driven; a step in which a diode starts or ends to conduct loses a little of the
/// magnetic energy.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Powers {
    /// Power from the bus into the bridge; negative while the motor feeds the bus. Neither the board's idle power nor
    /// what a shorted leg burns.
    pub input: f64,
    /// Heat in the windings.
    pub copper_loss: f64,
    /// Heat in the bridge.
    pub bridge_loss: f64,
    /// Power from the windings onto the rotor at the speed it had at the beginning of the period.
    pub mechanical: f64,
}

/// Ground truth of the actuator; none of it is measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ActuatorState {
    /// Time since the start, s.
    pub time: f64,
    /// Motion, torques and temperatures of the joint.
    pub joint: State,
    /// Angle of the rotor, rad, not wrapped.
    pub rotor_angle: f64,
    /// Speed of the rotor, rad/s.
    pub rotor_velocity: f64,
    /// Electrical angle, 0 to 2 pi rad, in the motor's own phase order.
    pub electrical_angle: f64,
    /// Currents along d and q, A.
    pub dq_current: [f64; 2],
    /// Phase currents at the bridge, A, positive into the motor.
    pub phase_currents: [f64; 3],
    /// Bus voltage, V.
    pub bus_voltage: f64,
    /// Current out of the source, A.
    pub source_current: f64,
    /// Temperature of the bridge, °C.
    pub bridge_temperature: f64,
    /// Energy in the windings' inductances, J.
    pub magnetic_energy: f64,
    /// Energy in the bus capacitor, J.
    pub bus_energy: f64,
    /// Powers of the last period.
    pub powers: Powers,
}

/// Result of the electrical half of a period for the mechanical one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Driven {
    /// Torque of the motor at the link, before friction, Nm.
    torque: f64,
    powers: Powers,
}

/// A virtual actuator in operation.
#[derive(Clone, Debug)]
pub struct Actuator {
    parameters: ActuatorParameters,
    joint: Joint,
    windings: Windings,
    inverter: Inverter,
    bus: Bus,
    fitted: Fitted,
    sensors: DriveSensors,
    schedule: Schedule,
    faults: ActiveFaults,
    contact: Option<Contact>,
    state: ActuatorState,
}

impl Actuator {
    /// An actuator at rest without current, its link hanging down, at `temperature` (°C, -40 to 150) throughout. `seed`
    /// draws the sensors' noise.
    ///
    /// # Errors
    /// The first parameter, or the temperature, that is outside its range.
    pub fn new(parameters: ActuatorParameters, temperature: f64, seed: u64) -> Result<Self, ParameterError> {
        parameters.validate()?;
        let joint = Joint::new(parameters.joint, temperature)?;
        let windings = Windings::new(parameters.windings, parameters.joint.motor)?;
        let inverter = Inverter::new(parameters.inverter, temperature)?;
        let bus = Bus::new(parameters.bus)?;
        let state = ActuatorState {
            time: 0.0,
            joint: *joint.state(),
            rotor_angle: 0.0,
            rotor_velocity: 0.0,
            electrical_angle: 0.0,
            dq_current: [0.0; 2],
            phase_currents: [0.0; 3],
            bus_voltage: bus.voltage(),
            source_current: 0.0,
            bridge_temperature: temperature,
            magnetic_energy: 0.0,
            bus_energy: bus.stored_energy(),
            powers: Powers::default(),
        };
        let sensors = DriveSensors::new(parameters.sensors, &sensed(&state), seed);
        let mut actuator = Self {
            parameters,
            joint,
            windings,
            inverter,
            bus,
            fitted: Fitted::default(),
            sensors,
            schedule: Schedule::default(),
            faults: ActiveFaults::default(),
            contact: None,
            state,
        };
        actuator.observe(Powers::default());
        Ok(actuator)
    }

    /// The same actuator with the link at `position` (rad) and `velocity` (rad/s), and sensors that have seen it there.
    #[must_use]
    pub fn released_at(mut self, position: f64, velocity: f64) -> Self {
        self.joint = self.joint.released_at(position, velocity);
        self.observe(Powers::default());
        self.sensors.settle(&sensed(&self.state));
        self
    }

    /// Parameters of this actuator.
    #[must_use]
    pub fn parameters(&self) -> &ActuatorParameters {
        &self.parameters
    }

    /// Ground truth of the actuator.
    #[must_use]
    pub fn state(&self) -> &ActuatorState {
        &self.state
    }

    /// The mechanics, with their stored energy.
    #[must_use]
    pub fn joint(&self) -> &Joint {
        &self.joint
    }

    /// Faults in the present period.
    #[must_use]
    pub fn faults(&self) -> &ActiveFaults {
        &self.faults
    }

    /// Puts something into the link's way, or takes it out again.
    ///
    /// # Errors
    /// The first parameter of the contact that is outside its range.
    pub fn set_contact(&mut self, contact: Option<Contact>) -> Result<(), ParameterError> {
        contact.map_or(Ok(()), |contact| contact.validate())?;
        self.contact = contact;
        self.grip_again();
        Ok(())
    }

    /// Fits what hangs at the board's outputs, in place of what was there; a brake is closed where the link is.
    pub fn fit(&mut self, accessories: Accessories) {
        self.fitted = Fitted::new(accessories, self.state.joint.link_position, self.parameters.joint.inertia());
        self.grip_again();
    }

    /// Sets the board's outputs from now on: the brake is to open, the chopper conducts.
    pub fn set_outputs(&mut self, brake_open: bool, chopper: bool) {
        self.fitted.set(brake_open, chopper);
    }

    /// Fitted devices, in operation.
    #[must_use]
    pub fn fitted(&self) -> &Fitted {
        &self.fitted
    }

    /// Factor of the dry friction from the next step on: what a joint that shares the drive leaves of it.
    pub(crate) fn relieve(&mut self, relief: f64) {
        self.joint.relieve(relief);
    }

    /// Sets what holds the link: a broken gear, a brake, or what is in its way.
    fn grip_again(&mut self) {
        if !self.faults.blocked {
            self.joint.hold(self.fitted.grip().or(self.contact));
        }
    }

    /// Lets `fault` happen now and stay.
    ///
    /// # Errors
    /// The fault's number, when it is outside its range.
    pub fn inject(&mut self, fault: Fault) -> Result<(), ParameterError> {
        self.schedule(fault, self.state.time, f64::INFINITY)
    }

    /// Another dead time of the bridge from now on, 0 to 5e-6 s.
    ///
    /// # Errors
    /// A dead time that is outside its range.
    pub fn set_dead_time(&mut self, seconds: f64) -> Result<(), ParameterError> {
        self.inverter.set_dead_time(seconds)
    }

    /// Plans `fault` from `start` to before `end` (s since the start of the actuator; `end` may be infinite).
    ///
    /// # Errors
    /// The fault's number or a time that is outside its range.
    pub fn schedule(&mut self, fault: Fault, start: f64, end: f64) -> Result<(), ParameterError> {
        fault.validate()?;
        within("fault.start", start, 0.0, 1e9)?;
        within("fault.end", end, start, f64::INFINITY)?;
        self.schedule.plan(fault, start, end);
        self.meet_faults();
        Ok(())
    }

    /// Mends everything and forgets what was planned.
    pub fn clear_faults(&mut self) {
        self.schedule.clear();
        self.meet_faults();
    }

    /// Measurements of the drive's electronics now. Every call draws new noise.
    pub fn measure(&mut self) -> DriveSample {
        self.sensors.sample(&self.faults)
    }

    /// Moves on by one PWM `period` (1e-6 to 1e-3 s). While the bridge is switching, the duties of as many calls ago as
    /// the timer's delay act; switching on and off acts at once. `external_torque` in Nm at the link, positive pushes
    /// forward.
    ///
    /// # Panics
    /// With another period.
    pub fn advance(&mut self, bridge_switching: bool, duties: [f64; 3], external_torque: f64, period: f64) {
        let driven = self.drive(bridge_switching, duties, period);
        self.follow(driven, external_torque, period);
    }

    /// The electrical half of a period: bridge, windings and supply, by the velocity before it.
    ///
    /// # Panics
    /// With a period outside of [`Self::advance`]'s range.
    pub(crate) fn drive(&mut self, bridge_switching: bool, duties: [f64; 3], period: f64) -> Driven {
        assert!((1e-6..=1e-3).contains(&period), "a PWM period of {period} s");
        let duties = self.inverter.load(duties);
        let (torque, powers, rail_current) = self.advance_windings(bridge_switching, duties, period);

        let idle = self.parameters.inverter.idle_power;
        let idle = if self.bus.voltage() > LOWEST_SUPPLY { idle / self.bus.voltage() } else { 0.0 };
        let across = self.shoot_through(bridge_switching, duties) + self.fitted.conductance();
        self.bus.advance(rail_current + idle, across, period);
        self.fitted.advance(
            self.bus.voltage(),
            self.state.joint.link_position,
            self.parameters.joint.inertia(),
            period,
        );
        self.grip_again();

        let ambient = self.parameters.joint.thermal.ambient;
        self.inverter.heat(powers.bridge_loss + idle * self.bus.voltage(), ambient, period);

        let cogging = self.parameters.windings.cogging.torque(self.state.rotor_angle);
        Driven { torque: (torque + cogging) * self.parameters.joint.motor.gear_ratio, powers }
    }

    /// Answer to a torque on the link in the mechanical half.
    pub(crate) fn answer(&self, driven: &Driven, period: f64) -> Answer {
        let answer = self.joint.answer(driven.torque, period);
        Answer { torque: answer.torque + self.faults.external_torque, ..answer }
    }

    /// The mechanical half of a period.
    pub(crate) fn follow(&mut self, driven: Driven, external_torque: f64, period: f64) {
        let Driven { torque, powers } = driven;
        self.joint.drive(torque, powers.copper_loss, external_torque + self.faults.external_torque, period);

        self.state.time += period;
        self.observe(powers);
        self.sensors.follow(&sensed(&self.state), period);
        self.meet_faults();
    }

    /// Steps the windings through one period; returns their mean torque on the rotor (Nm), the powers, and the mean
    /// current from the positive rail (A).
    fn advance_windings(&mut self, switching: bool, duties: [f64; 3], period: f64) -> (f64, Powers, f64) {
        let p = &self.parameters;
        let rails = Rails { voltage: self.bus.voltage(), diode_drop: p.inverter.diode_drop };
        let velocity = p.windings.pole_pairs as f64 * self.state.rotor_velocity;
        let start = self.state.electrical_angle;
        self.windings.warm(self.state.joint.heat.housing);
        let resistance = self.windings.phase_resistance(self.state.joint.heat.winding);
        let outside = p.inverter.on_resistance;
        let inductance = p.windings.inductance_d.min(p.windings.inductance_q);

        let plain = switching && self.faults.open == [false; 3];
        let longest = if plain { LONGEST_STEP } else { LONGEST_DIODE_STEP };
        let steps = (period / longest - 1e-9).ceil().max(1.0);
        let step = period / steps;
        let share = 1.0 / steps;

        let dead_time = self.inverter.dead_time(&rails, period, inductance, step);

        let (mut torque, mut powers, mut rail_current) = (0.0, Powers::default(), 0.0);
        if !plain {
            let rotation = Rotation { frame: Frame::at(start + 0.5 * velocity * period), velocity };
            let legs = self.legs(switching, duties, [0.0; 3], &rails, &dead_time);
            if self.windings.rests(&legs, &rails, &rotation, step) {
                return (torque, powers, rail_current);
            }
        }
        for n in 0..steps as u32 {
            let frame = Frame::at(start + velocity * step * (f64::from(n) + 0.5));
            let currents = self.windings.phase_currents(&frame);
            let legs = self.legs(switching, duties, currents, &rails, &dead_time);
            let rotation = Rotation { frame, velocity };
            let flow = self.windings.advance(&legs, &rails, &rotation, resistance, outside, step);
            let rail = Inverter::rail_current(&legs, &flow.phase_currents);
            // Power that the rails give and the motor's terminals do not get stays in transistors and diodes.
            let terminals: f64 = legs.iter().zip(flow.phase_currents).map(|(leg, i)| leg.power(&rails, i)).sum();
            let dissipated = outside / resistance * flow.copper_loss + rails.voltage * rail - terminals;
            torque += share * flow.torque;
            rail_current += share * rail;
            powers.copper_loss += share * flow.copper_loss;
            powers.bridge_loss += share * dissipated;
        }
        powers.input = rails.voltage * rail_current;
        powers.mechanical = torque * self.state.rotor_velocity;
        (torque, powers, rail_current)
    }

    fn legs(
        &self,
        switching: bool,
        duties: [f64; 3],
        currents: [f64; 3],
        rails: &Rails,
        dead_time: &DeadTime,
    ) -> [Leg; 3] {
        let mut legs = [Leg::Diodes; 3];
        for (k, leg) in legs.iter_mut().enumerate() {
            if self.faults.open[k] {
                *leg = Leg::Open;
            } else if self.faults.shorted[k] {
                *leg = Leg::Driven { voltage: 0.0, duty: 0.0 };
            } else if switching {
                *leg = dead_time.leg(duties[k], currents[k], rails);
            }
        }
        legs
    }

    /// Mean conductance of the legs that a switching high side shorts through a failed low side, 1/ohm.
    fn shoot_through(&self, switching: bool, duties: [f64; 3]) -> f64 {
        let both = 2.0 * self.parameters.inverter.on_resistance;
        let shorted = self.faults.shorted.iter().zip(duties).filter(|(shorted, _)| switching && **shorted);
        shorted.map(|(_, duty)| duty / both).sum()
    }

    /// Brings the state up to date after everything has moved.
    fn observe(&mut self, powers: Powers) {
        let joint = *self.joint.state();
        let electrical_angle = self.parameters.electrical_angle(joint.position);
        self.state = ActuatorState {
            time: self.state.time,
            joint,
            rotor_angle: self.parameters.rotor_angle(joint.position),
            rotor_velocity: joint.velocity * self.parameters.joint.motor.gear_ratio,
            electrical_angle,
            dq_current: self.windings.current(),
            phase_currents: self.windings.phase_currents(&Frame::at(electrical_angle)),
            bus_voltage: self.bus.voltage(),
            source_current: self.bus.source_current(),
            bridge_temperature: self.inverter.temperature(),
            magnetic_energy: self.windings.magnetic_energy(),
            bus_energy: self.bus.stored_energy(),
            powers,
        };
    }

    fn meet_faults(&mut self) {
        let Some(faults) = self.schedule.changed(self.state.time) else { return };
        let was_blocked = self.faults.blocked;
        self.faults = faults;
        self.bus.set_source_voltage(faults.source_voltage);
        if faults.blocked != was_blocked {
            self.joint.hold(Some(Contact::blocking(self.state.joint.link_position, self.parameters.joint.inertia())));
            self.grip_again();
        }
    }
}

fn sensed(state: &ActuatorState) -> Sensed {
    Sensed {
        phase_currents: state.phase_currents,
        bus_voltage: state.bus_voltage,
        rotor_angle: state.rotor_angle,
        winding_temperature: state.joint.heat.winding,
        bridge_temperature: state.bridge_temperature,
    }
}
