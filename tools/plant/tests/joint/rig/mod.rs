//! A virtual joint in a test's hands: commanded as a network would, with what goes wrong counted in control steps;
//! host.

pub mod table;

use joint_firmware::joint::fault::{Fault, Faults};
use joint_firmware::joint::state_machine::{Controlword, State};
use joint_firmware::joint::{BridgeState, Command, Demand, Mode};
use plant::VirtualJoint;
use plant::actuator::{ActuatorParameters, Fault as Broken};
use plant::virtual_joint::Setup;

/// Control steps between two set-points: 1 ms.
const SET_POINT_STEPS: u32 = 20;

/// The reference actuator, commissioned.
pub fn reference() -> ActuatorParameters {
    ActuatorParameters::reference().aligned()
}

pub const fn velocity(velocity: f32) -> Command {
    Command { mode: Mode::Velocity, velocity, ..NOTHING }
}

pub const fn position(position: f32) -> Command {
    Command { mode: Mode::Position, position, ..NOTHING }
}

pub const fn torque(torque: f32) -> Command {
    Command { mode: Mode::Torque, torque, ..NOTHING }
}

const NOTHING: Command = Command::NOTHING;

/// A virtual joint, what it is told, and the largest motor torque since [`Rig::forget`].
#[derive(Clone)]
pub struct Rig {
    pub joint: VirtualJoint,
    pub demand: Demand,
    /// No set-point arrives any more.
    pub silent: bool,
    /// Every control step takes longer than its period.
    pub always_late: bool,
    /// Control steps since the last set-point.
    pub without_set_point: u32,
    /// Nm at the link.
    pub worst_torque: f64,
    steps: u32,
}

impl Rig {
    /// A joint that is switched off.
    pub fn off(parameters: ActuatorParameters, setup: &Setup) -> Self {
        Self::off_at(parameters, setup, 25.0)
    }

    /// The same at another temperature, °C.
    pub fn off_at(parameters: ActuatorParameters, setup: &Setup, temperature: f64) -> Self {
        let joint = VirtualJoint::new(parameters, setup, temperature, 1).unwrap();
        Self {
            joint,
            demand: Demand::default(),
            silent: false,
            always_late: false,
            without_set_point: 0,
            worst_torque: 0.0,
            steps: 0,
        }
    }

    /// A joint that is enabled, without torque.
    pub fn enabled(parameters: ActuatorParameters, setup: &Setup) -> Self {
        let mut rig = Self::off(parameters, setup);
        rig.enable();
        rig
    }

    /// The reference joint, enabled, that has followed `command` for `time` s.
    pub fn following(command: Command, time: f64) -> Self {
        let parameters = reference();
        let mut rig = Self::enabled(parameters, &Setup::of(&parameters));
        rig.follow(command, time);
        rig
    }

    pub fn enable(&mut self) {
        self.joint.enable().unwrap();
        self.demand.controlword = Controlword::ENABLE_OPERATION;
        // The rig counts on from where the joint's own start left off.
        self.demand.sequence = self.demand.sequence.max(1000);
    }

    /// One control step.
    pub fn step(&mut self) -> State {
        if self.steps.is_multiple_of(SET_POINT_STEPS) && !self.silent {
            self.demand.sequence = self.demand.sequence.wrapping_add(1);
            self.without_set_point = 0;
        } else {
            self.without_set_point += 1;
        }
        self.steps += 1;
        if self.always_late {
            self.joint.overrun();
        }
        self.joint.step(&self.demand, 0.0);
        self.worst_torque = self.worst_torque.max(self.motor_torque().abs());
        self.state()
    }

    /// Goes on for `time` s.
    pub fn run(&mut self, time: f64) {
        for _ in 0..self.steps_in(time) {
            self.step();
        }
    }

    /// Follows `command` for `time` s; panics where a fault comes in the way.
    pub fn follow(&mut self, command: Command, time: f64) {
        self.demand.command = command;
        for _ in 0..self.steps_in(time) {
            let state = self.step();
            assert_eq!(
                state,
                State::OperationEnabled,
                "{command:?}: {:?} {:?}",
                self.latched(),
                self.joint.joint().telemetry()
            );
        }
    }

    pub fn steps_in(&self, time: f64) -> u32 {
        (time / self.joint.period()).round() as u32
    }

    pub fn motor_torque(&self) -> f64 {
        self.joint.actuator().state().joint.motor_torque
    }

    pub fn position(&self) -> f64 {
        self.joint.actuator().state().joint.position
    }

    pub fn velocity(&self) -> f64 {
        self.joint.actuator().state().joint.velocity
    }

    pub fn torque_limit(&self) -> f64 {
        f64::from(self.joint.active().limits.torque)
    }

    pub fn state(&self) -> State {
        self.joint.joint().telemetry().state
    }

    pub fn is_switching(&self) -> bool {
        self.joint.bridge().state == BridgeState::Switching
    }

    pub fn latched(&self) -> Vec<Fault> {
        self.joint.joint().latched_faults().iter().collect()
    }

    pub fn latched_set(&self) -> Faults {
        self.joint.joint().latched_faults()
    }

    /// Control steps until a fault is latched, the first one counted as 1; none within `steps`.
    pub fn steps_to_fault(&mut self, steps: u32) -> Option<u32> {
        (1..=steps).find(|_| {
            self.step();
            !self.latched_set().is_empty()
        })
    }
}

/// Breaks something, which stays so.
pub fn break_down(rig: &mut Rig, what: Broken) {
    rig.joint.actuator_mut().inject(what).unwrap();
}

/// Mends everything.
pub fn mend(rig: &mut Rig) {
    rig.joint.actuator_mut().clear_faults();
}

/// Acknowledges a fault.
pub fn reset(rig: &mut Rig) {
    rig.demand.controlword = Controlword::DISABLE_VOLTAGE;
    rig.step();
    rig.demand.controlword = Controlword::FAULT_RESET;
    rig.step();
    rig.demand.controlword = Controlword::DISABLE_VOLTAGE;
}
