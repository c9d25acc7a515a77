//! The firmware's joint running on a virtual actuator: the same control step as in the board's interrupt, one call a
//! PWM period.
//!
//! - [`setup`]: the configuration that a commissioned joint of given parameters would have
//! - `signals`: the seam, in the types of both sides

pub mod setup;
mod signals;

use crate::actuator::lockstep::Driven;
use crate::actuator::{Actuator, ActuatorParameters};
use crate::error::ParameterError;
use crate::joint::Answer;
use friction_compensation::friction::FrictionModel;
use joint_firmware::joint::active::SLOW_RATE;
use joint_firmware::joint::adaptation::{self, Adaptation, Factors, LOOK_RATE};
use joint_firmware::joint::configuration::ConfigurationError;
use joint_firmware::joint::external_torque::{self, ExternalTorque};
use joint_firmware::joint::load_feedforward::LoadFeedforward;
use joint_firmware::joint::state_machine::{Controlword, State};
use joint_firmware::joint::{Active, Bridge, BridgeState, Demand, Joint, Measurements, Slow, Telemetry};
use joint_firmware::motor::thermal::WindingTemperature;
pub use setup::Setup;

/// Reason for which a virtual joint cannot be made.
#[derive(Clone, Debug, PartialEq)]
pub enum VirtualJointError {
    /// The plant refuses its parameters.
    Plant(ParameterError),
    /// The firmware refuses its configuration.
    Configuration(ConfigurationError),
    /// The joint did not reach "operation enabled"; the state it stayed in.
    NotEnabled(State),
}

impl std::fmt::Display for VirtualJointError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Plant(error) => error.fmt(f),
            Self::Configuration(error) => error.fmt(f),
            Self::NotEnabled(state) => write!(f, "the joint cannot be enabled: it stays in {state:?}"),
        }
    }
}

impl std::error::Error for VirtualJointError {}

impl From<ParameterError> for VirtualJointError {
    fn from(error: ParameterError) -> Self {
        Self::Plant(error)
    }
}

impl From<ConfigurationError> for VirtualJointError {
    fn from(error: ConfigurationError) -> Self {
        Self::Configuration(error)
    }
}

/// Control step that runs: the firmware's, or the one that was built without compensation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Build {
    /// Firmware as flashed.
    #[default]
    Whole,
    /// Step without compensation.
    WithoutCompensation,
}

/// Actuator and firmware in closed loop.
#[derive(Clone, Debug)]
pub struct VirtualJoint {
    actuator: Actuator,
    joint: Joint,
    active: Active,
    winding: WindingTemperature,
    slow: Slow,
    adaptation: Adaptation,
    /// Corrections in service: those that it has learned, where it is on.
    corrections: Factors,
    load: LoadFeedforward,
    /// Torque that the feedforward of the load adds, Nm.
    load_torque: f32,
    /// Observer of the external torque.
    external: ExternalTorque,
    look_divider: u64,
    build: Build,
    period: f64,
    steps: u64,
    slow_divider: u64,
    overrun: bool,
    measured: Measurements,
    bridge: Bridge,
}

impl VirtualJoint {
    /// A joint at rest at `temperature` (°C), switched off; the noise of its sensors follows from `seed`.
    ///
    /// # Errors
    /// Refusals of plant or firmware.
    pub fn new(
        parameters: ActuatorParameters,
        setup: &Setup,
        temperature: f64,
        seed: u64,
    ) -> Result<Self, VirtualJointError> {
        let active = setup.configuration.prepare(&setup.bridge)?;
        let winding = WindingTemperature::new(&active.thermal, temperature as f32).map_err(ConfigurationError::from)?;
        let mut actuator = Actuator::new(parameters, temperature, seed)?;
        let measured = signals::measurements(&actuator.measure(), false);
        let rate = f64::from(setup.bridge.rate);
        Ok(Self {
            actuator,
            joint: Joint::new(),
            active,
            winding,
            slow: Slow { gear_temperature: temperature as f32, ..Slow::default() },
            adaptation: Adaptation::NOTHING,
            corrections: Factors::IMAGE,
            load: LoadFeedforward::NOTHING,
            load_torque: 0.0,
            external: ExternalTorque::NOTHING,
            look_divider: (rate / f64::from(LOOK_RATE)).round() as u64,
            build: Build::Whole,
            period: 1.0 / rate,
            steps: 0,
            slow_divider: (rate / f64::from(SLOW_RATE)).round() as u64,
            overrun: false,
            measured,
            bridge: Bridge::OFF,
        })
    }

    /// The same with another build of the control step.
    #[must_use]
    pub fn with_build(mut self, build: Build) -> Self {
        self.build = build;
        self
    }

    /// The same with firmware that believes motor and gear to be at another temperature, °C: so does a board that was
    /// reset while its joint was warm, and starts from the sensor on its bridge.
    #[must_use]
    pub fn believing(mut self, temperature: f64) -> Self {
        self.winding = self.winding.starting_at(temperature as f32);
        self.slow.gear_temperature = self.winding.housing();
        self
    }

    /// Changes the friction model between two control steps, as the firmware does after an upload.
    pub fn set_friction(&mut self, model: Option<FrictionModel>) {
        self.adaptation = Adaptation::NOTHING;
        self.active.friction = model;
    }

    /// Replaces everything prepared between two control steps; the friction model stays.
    pub fn set_active(&mut self, active: Active) {
        self.active = active.with_friction(self.active.friction.take());
    }

    /// Configuration that the control step reads.
    #[must_use]
    pub fn active(&self) -> &Active {
        &self.active
    }

    /// External torque on the link as the firmware finds it.
    #[must_use]
    pub fn external_torque(&self) -> &external_torque::Report {
        self.external.report()
    }

    /// A demand as the control step gets it: with the feedforward of the load.
    #[must_use]
    pub fn bearing(&self, demand: &Demand) -> Demand {
        let mut demand = *demand;
        demand.command.bear(self.load_torque);
        demand
    }

    /// One control step, then one PWM period of physics with an external torque (Nm at the link).
    pub fn step(&mut self, demand: &Demand, external_torque: f64) -> Telemetry {
        let driven = self.drive(demand);
        self.follow(driven, external_torque)
    }

    /// The control step, and the electrical half of the period.
    pub(crate) fn drive(&mut self, demand: &Demand) -> Driven {
        self.measured = signals::measurements(&self.actuator.measure(), self.overrun);
        self.overrun = false;
        let demand = &self.bearing(demand);
        let (active, slow, measured) = (&self.active, &self.slow, &self.measured);
        self.bridge = match self.build {
            Build::Whole => self.joint.control_step(active, demand, slow, measured),
            Build::WithoutCompensation => self.joint.control_step_without_compensation(active, demand, slow, measured),
        };
        let outputs = self.joint.outputs();
        self.actuator.set_outputs(outputs.brake_open(), outputs.chopper());
        let duties = self.bridge.duties;
        let duties = [duties.a, duties.b, duties.c].map(f64::from);
        let switching = self.bridge.state == BridgeState::Switching;
        self.actuator.drive(switching, duties, self.period)
    }

    /// Answer to a torque on the link in the mechanical half.
    pub(crate) fn answer(&self, driven: &Driven) -> Answer {
        self.actuator.answer(driven, self.period)
    }

    /// The mechanical half of the period, and what the firmware's tasks do behind a control step.
    pub(crate) fn follow(&mut self, driven: Driven, external_torque: f64) -> Telemetry {
        self.actuator.follow(driven, external_torque, self.period);
        self.steps += 1;
        if self.steps.is_multiple_of(self.slow_divider) {
            self.winding.step(self.joint.take_mean_square_current(), self.measured.winding_temperature);
            (self.slow.derating, self.slow.gear_temperature) = (self.winding.derating(), self.winding.housing());
        }
        let telemetry = self.joint.telemetry();
        if self.steps.is_multiple_of(self.look_divider) {
            self.external.look(&external_torque::Settings::of(&self.active), &telemetry, &self.corrections);
            let settings = adaptation::Settings::of(&self.active);
            self.corrections = self.adaptation.look(&settings, &telemetry);
            self.slow.factors = self.corrections.guarded(&settings, &telemetry);
            self.load_torque = self.load.look(self.active.load(), &telemetry);
        }
        telemetry
    }

    /// Starts the joint and enables operation, in torque mode without torque.
    ///
    /// # Errors
    /// The state in which it stays where a fault keeps it from being enabled.
    pub fn enable(&mut self) -> Result<(), VirtualJointError> {
        let words = [Controlword::SHUTDOWN, Controlword::SWITCH_ON, Controlword::ENABLE_OPERATION];
        let mut sequence = 0;
        let mut ask = |joint: &mut Self, controlword: Controlword| {
            sequence += 1;
            joint.step(&Demand { controlword, sequence, ..Demand::default() }, 0.0).state
        };
        for _ in 0..=joint_firmware::joint::OFFSET_STEPS {
            ask(self, Controlword::DISABLE_VOLTAGE);
        }
        let mut state = State::NotReadyToSwitchOn;
        for word in words {
            state = ask(self, word);
        }
        match state {
            State::OperationEnabled => Ok(()),
            state => Err(VirtualJointError::NotEnabled(state)),
        }
    }

    /// Pretends that the next control step's predecessor took longer than its period.
    pub fn overrun(&mut self) {
        self.overrun = true;
    }

    /// Duration of a control step, s.
    #[must_use]
    pub fn period(&self) -> f64 {
        self.period
    }

    /// Time since the start, s.
    #[must_use]
    pub fn time(&self) -> f64 {
        self.steps as f64 * self.period
    }

    /// The firmware's side.
    #[must_use]
    pub fn joint(&self) -> &Joint {
        &self.joint
    }

    /// The physics.
    #[must_use]
    pub fn actuator(&self) -> &Actuator {
        &self.actuator
    }

    /// The physics, for faults and contacts.
    pub fn actuator_mut(&mut self) -> &mut Actuator {
        &mut self.actuator
    }

    /// Measurements that the last control step was told.
    #[must_use]
    pub fn measured(&self) -> &Measurements {
        &self.measured
    }

    /// Command of the step to the bridge.
    #[must_use]
    pub fn bridge(&self) -> &Bridge {
        &self.bridge
    }

    /// Goes on from what another joint of its kind has learned of friction in service, or the same one before.
    pub fn set_adaptation(&mut self, adaptation: Adaptation) {
        self.adaptation = adaptation;
    }

    /// State of everything that it has learned.
    #[must_use]
    pub fn learned(&self) -> &Adaptation {
        &self.adaptation
    }

    /// State of what of it acts.
    #[must_use]
    pub fn adaptation(&self) -> adaptation::Report {
        self.adaptation.report(&adaptation::Settings::of(&self.active))
    }

    /// Values that the slow task knows.
    #[must_use]
    pub fn slow(&self) -> &Slow {
        &self.slow
    }
}
