//! A joint whose measurements are held, one control step at a time.

use super::Found;
use joint_firmware::default_configuration::BoardConfiguration;
use joint_firmware::joint::active::SLOW_RATE;
use joint_firmware::joint::configuration::MOTION_STEPS;
use joint_firmware::joint::fault::Faults;
use joint_firmware::joint::state_machine::{Controlword, State};
use joint_firmware::joint::{Active, Command, Demand, Joint, Measurements, Mode, OFFSET_STEPS, Slow};
use joint_firmware::motor::phases::Phases;
use joint_firmware::motor::thermal::WindingTemperature;
use std::f64::consts::TAU;

/// A joint, its board's measurements and its slow task.
pub struct Bench {
    pub board: BoardConfiguration,
    pub demand: Demand,
    pub measured: Measurements,
    /// Rotor's angle, rad.
    pub angle: f64,
    /// Rotor's speed, rad/s.
    pub speed: f64,
    /// No set-point arrives.
    pub silent: bool,
    /// Phase currents are what the joint wants.
    pub follows: bool,
    joint: Joint,
    active: Active,
    slow: Slow,
    winding: WindingTemperature,
    steps: u64,
}

impl Bench {
    /// A joint at rest before its first control step.
    pub fn new(board: &BoardConfiguration) -> Self {
        let active = board.joint.prepare(&board.bridge).unwrap();
        let (lowest, highest) = board.joint.limits.bus_voltage;
        Self {
            board: *board,
            demand: Demand::default(),
            measured: Measurements {
                phase_currents: Phases::uniform(0.0),
                bus_voltage: 0.5 * (lowest + highest),
                encoder: 0,
                encoder_valid: true,
                encoder_referenced: true,
                winding_temperature: 25.0,
                bridge_temperature: 25.0,
                bridge_fault: false,
                overrun: false,
            },
            angle: 0.0,
            speed: 0.0,
            silent: false,
            follows: false,
            joint: Joint::new(),
            winding: WindingTemperature::new(&active.thermal, 25.0).unwrap(),
            active,
            slow: Slow::default(),
            steps: 0,
        }
    }

    /// A joint that has started, at rest, in "switched on".
    pub fn switched_on(board: &BoardConfiguration) -> Self {
        Self::new(board).switch_on()
    }

    /// A joint in "operation enabled", in torque mode, at rest.
    pub fn enabled(board: &BoardConfiguration) -> Self {
        let mut bench = Self::switched_on(board);
        bench.enable();
        assert_eq!(bench.state(), State::OperationEnabled);
        bench
    }

    /// A joint in the open loop.
    pub fn open_loop(board: &BoardConfiguration) -> Self {
        let mut bench = Self::new(board);
        bench.demand.command = Command { mode: Mode::OpenLoop, ..Command::default() };
        let mut bench = bench.switch_on();
        bench.enable();
        assert_eq!(bench.state(), State::OpenLoop);
        bench
    }

    /// Starts; whatever is set has no fault so far.
    pub fn switch_on(mut self) -> Self {
        for _ in 0..=OFFSET_STEPS {
            self.step();
        }
        for word in [Controlword::SHUTDOWN, Controlword::SWITCH_ON] {
            self.demand.controlword = word;
            self.step();
        }
        assert_eq!(self.state(), State::SwitchedOn, "{:?}", self.joint.latched_faults());
        self
    }

    /// Asks for "operation enabled"; a step.
    pub fn enable(&mut self) -> Faults {
        self.demand.controlword = Controlword::ENABLE_OPERATION;
        self.follows = true;
        self.step()
    }

    /// A control step; the faults that are there.
    pub fn step(&mut self) -> Faults {
        if !self.silent {
            self.demand.sequence = self.demand.sequence.wrapping_add(1);
        }
        self.measured.encoder = ((self.angle / TAU).rem_euclid(1.0) * 2f64.powi(32)) as u64 as u32;
        if self.follows {
            let angle = self.board.joint.motor.alignment.electrical(self.measured.encoder);
            let current = self.joint.telemetry().reference;
            self.measured.phase_currents = current.to_stationary(angle.sin_cos()).to_phases();
        }
        self.joint.control_step(&self.active, &self.demand, &self.slow, &self.measured);
        let rate = f64::from(self.board.bridge.rate);
        self.angle += self.speed / rate;
        self.steps += 1;
        if self.steps.is_multiple_of((rate / f64::from(SLOW_RATE)) as u64) {
            self.winding.step(self.joint.take_mean_square_current(), self.measured.winding_temperature);
            self.slow.derating = self.winding.derating();
        }
        self.joint.telemetry().faults
    }

    /// A round of the motion loop, and the part of the torque asked for, Nm, that is made at its end.
    pub fn asked(&mut self, torque: f64) -> Found {
        self.demand.command.torque = torque as f32;
        let faults = (0..MOTION_STEPS).fold(Faults::NONE, |faults, _| faults.union(self.step()));
        let made = f64::from(self.joint.telemetry().reference.q) * self.torque_per_current();
        Found { faults, part: made / torque }
    }

    /// Torque at the joint of an ampere, Nm/A.
    pub fn torque_per_current(&self) -> f64 {
        f64::from(self.board.joint.motor.torque_constant) * f64::from(self.board.joint.gear.ratio)
    }

    pub fn state(&self) -> State {
        self.joint.telemetry().state
    }
}
