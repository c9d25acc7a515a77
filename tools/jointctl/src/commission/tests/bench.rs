//! A bench with a plant behind it: the joint's open loop in plain words, in f64, without dead-time compensation.

use crate::commission::bench::{Bench, Condition, DEAD_MAN, Frame, Motion, SLEW, Stopped, Window};
use joint_firmware::objects::settings::Setting;
use plant::actuator::frame::Frame as Phases;
use plant::{Actuator, ActuatorParameters};
use std::f64::consts::TAU;

pub const RATE: f64 = 20_000.0;
const STEPS: u32 = 128;

/// Intervention on the joint in the middle of something.
pub type Event = fn(&mut Simulated);

pub struct Simulated {
    pub actuator: Actuator,
    pub settings: Vec<(Setting, f64)>,
    /// The encoder has an index, and counts from anywhere until it meets it.
    pub incremental: bool,
    /// Initial reading of the encoder, 2^32 a turn.
    pub start: u32,
    pub condition: Condition,
    /// Called before each control step.
    pub event: Option<Event>,
    /// Joint's velocity in a motion over what is asked for.
    pub follows: f64,
    /// Torque of a load at the joint, Nm, and what friction adds to it on the way up.
    pub load: [f64; 2],
    pub torque_gain: f64,
    /// Inertia at the joint, kg m^2, that a motion in velocity mode speeds up, Coulomb friction, Nm, and viscous
    /// friction, Nm s/rad.
    pub swung: [f64; 3],
    /// Control steps so far.
    pub step: u32,
    /// Of these with the bridge on.
    pub on: bool,
    pub fault: Option<Stopped>,
    pub stored: bool,
    /// The host does not come back in time at this control step.
    pub late_at: Option<u32>,
    /// Time until the host comes back after it changed the field's speed, s.
    pub hesitates: f64,
    pub highest_current: f64,
    wanted: Frame,
    applied: Frame,
    field: f64,
    renewed: u32,
    sums: [f64; 10],
    last: Window,
    index: Option<u32>,
    raw: u32,
    motion: Option<(Motion, f64)>,
    joint: [f64; 2],
    swing: f64,
}

impl Simulated {
    pub fn new(parameters: ActuatorParameters) -> Self {
        let actuator = Actuator::new(parameters, 25.0, 1).unwrap();
        let settings = [
            (Setting::Resistance, 0.1),
            (Setting::InductanceD, f64::from(20e-6f32)),
            (Setting::InductanceQ, f64::from(20e-6f32)),
            (Setting::TorqueConstant, f64::from(0.02f32)),
            (Setting::CurrentLimit, 20.0),
            (Setting::OverCurrent, 30.0),
            (Setting::PolePairs, 7.0),
            (Setting::Direction, 0.0),
            (Setting::ElectricalZero, 0.0),
            (Setting::EncoderCounts, 4000.0),
            (Setting::GearRatio, 50.0),
            (Setting::JointZero, 0.0),
            (Setting::VelocityLimit, 10.0),
            (Setting::LowestPosition, -0.5),
            (Setting::HighestPosition, 0.5),
            (Setting::Acceleration, 1.0),
            (Setting::LowestBusVoltage, 10.0),
            (Setting::HighestBusVoltage, 50.0),
            (Setting::WindingTemperature, 80.0),
            (Setting::BridgeTemperature, 70.0),
        ];
        Self {
            condition: Condition {
                state: "disabled".into(),
                faults: String::new(),
                armed: false,
                staged: false,
                supply: parameters.bus.source_voltage,
                winding: 25.0,
                bridge: 25.0,
            },
            actuator,
            settings: settings.into(),
            incremental: false,
            start: 0,
            event: None,
            follows: 1.0,
            load: [0.0; 2],
            torque_gain: 1.0,
            swung: [0.0; 3],
            step: 0,
            on: false,
            fault: None,
            stored: false,
            late_at: None,
            hesitates: 0.0,
            highest_current: 0.0,
            wanted: Frame::default(),
            applied: Frame::default(),
            field: 0.0,
            renewed: 0,
            sums: [0.0; 10],
            last: Window::default(),
            index: None,
            raw: 0,
            motion: None,
            joint: [0.3, 0.0],
            swing: 0.0,
        }
    }

    /// The field turns.
    pub fn is_turning(&self) -> bool {
        self.on && self.wanted.speed != 0.0
    }

    /// The index has never been met.
    pub fn forget_index(&mut self) {
        self.index = None;
    }

    fn stop(&mut self, why: Stopped) {
        self.fault = Some(why);
        self.on = false;
    }

    fn control_step(&mut self) {
        if let Some(event) = self.event {
            event(self);
        }
        let measured = self.actuator.measure();
        let frame = Phases::at(TAU * self.field);
        let [along, across] = frame.dq(measured.phase_currents);
        self.highest_current = self.highest_current.max(along.hypot(across));
        if self.on && self.step - self.renewed > (DEAD_MAN * RATE) as u32 {
            self.stop(Stopped::Late);
        }
        if self.on && measured.phase_currents.iter().any(|current| current.abs() > 30.0) {
            self.stop(Stopped::Joint("over-current (2310h)".into()));
        }
        let raw = measured.encoder;
        // The index is where the reading passes zero, by the shorter way.
        let moved = raw.wrapping_sub(self.raw) as i32;
        let (before, after) = (i64::from(self.raw), i64::from(self.raw) + i64::from(moved));
        if self.step > 0 && before.div_euclid(1 << 32) != after.div_euclid(1 << 32) {
            self.index = Some(0);
        }
        self.raw = raw;
        let n = self.step % 8;
        let sine = (TAU / 8.0 * f64::from(n)).sin();
        let cosine = (TAU / 8.0 * f64::from(n)).cos();
        let towards = |applied: &mut f64, wanted: f64| *applied += (wanted - *applied).clamp(-SLEW / RATE, SLEW / RATE);
        if self.on {
            towards(&mut self.applied.voltage, self.wanted.voltage);
            towards(&mut self.applied.along, self.wanted.along);
            towards(&mut self.applied.across, self.wanted.across);
            self.field += self.wanted.speed / RATE;
        } else {
            self.applied = Frame::default();
        }
        let Frame { voltage, along: d, across: q, .. } = self.applied;
        let dq = [voltage + d * sine, q * sine];
        let phases = Phases::at(TAU * self.field).phases(dq);
        let supply = self.actuator.state().bus_voltage;
        let duties = phases.map(|volts| (0.5 + volts / supply).clamp(0.0, 1.0));
        self.actuator.advance(self.on, duties, 0.0, 1.0 / RATE);
        let terms = [along, across, dq[0], dq[1], along * sine, along * cosine, across * sine, across * cosine, d, q];
        for (sum, term) in self.sums.iter_mut().zip(terms) {
            *sum += term;
        }
        self.step += 1;
        if self.step.is_multiple_of(STEPS) {
            let mean = self.sums.map(|sum| sum / f64::from(STEPS));
            self.last = Window {
                number: self.last.number + 1,
                current: [mean[0], mean[1]],
                voltage: [mean[2], mean[3]],
                ripple_along: 2.0 * mean[4].hypot(mean[5]),
                ripple_across: 2.0 * mean[6].hypot(mean[7]),
                alternating: [mean[8], mean[9]],
                encoder: self.encoder(),
                field: (self.field.rem_euclid(1.0) * 2f64.powi(32)) as u64 as u32,
                referenced: self.referenced(),
            };
            self.sums = [0.0; 10];
        }
    }

    fn referenced(&self) -> bool {
        !self.incremental || self.index.is_some()
    }

    fn encoder(&self) -> u32 {
        if self.referenced() { self.raw } else { self.raw.wrapping_sub(self.start) }
    }
}

impl Bench for Simulated {
    fn enable(&mut self) -> Result<(), Stopped> {
        if let Some(fault) = &self.fault {
            return Err(Stopped::Joint(format!("in a fault: {fault}")));
        }
        (self.on, self.field, self.renewed) = (true, 0.0, self.step);
        (self.wanted, self.applied) = (Frame::default(), Frame::default());
        Ok(())
    }

    fn apply(&mut self, frame: &Frame) -> Result<(), Stopped> {
        self.pass(0.002)?;
        let changed = self.wanted.speed != frame.speed;
        (self.wanted, self.renewed) = (*frame, self.step);
        if changed { self.pass(self.hesitates) } else { Ok(()) }
    }

    fn window(&mut self, ripple: bool) -> Result<Window, Stopped> {
        self.pass(if ripple { 0.008 } else { 0.005 })?;
        Ok(self.last)
    }

    fn pass(&mut self, seconds: f64) -> Result<(), Stopped> {
        let steps = (seconds * RATE) as u32;
        let late = self.late_at.is_some_and(|at| at < self.step + steps);
        let late = if late {
            self.late_at = None;
            (0.2 * RATE) as u32
        } else {
            0
        };
        let on = self.on;
        for _ in 0..steps + late {
            self.control_step();
            if let Some((Motion::Velocity, velocity)) = self.motion {
                let (ramp, last) = (self.setting(Setting::Acceleration)? / RATE, self.joint[1]);
                self.joint[1] += (self.follows * velocity - last).clamp(-ramp, ramp);
                self.swing = self.swung[0] * (self.joint[1] - last) * RATE
                    + self.swung[1] * self.joint[1].signum()
                    + self.swung[2] * self.joint[1];
                self.joint[0] += self.joint[1] / RATE;
            }
        }
        match &self.fault {
            Some(fault) if on || !self.on => Err(fault.clone()),
            _ => Ok(()),
        }
    }

    fn off(&mut self) -> Result<(), Stopped> {
        self.on = false;
        self.motion = None;
        Ok(())
    }

    fn acknowledge(&mut self) -> Result<(), Stopped> {
        self.fault = None;
        self.condition.faults.clear();
        Ok(())
    }

    fn condition(&mut self) -> Result<Condition, Stopped> {
        Ok(self.condition.clone())
    }

    fn rate(&mut self) -> Result<f64, Stopped> {
        Ok(RATE)
    }

    fn setting(&mut self, setting: Setting) -> Result<f64, Stopped> {
        let found = self.settings.iter().find(|(known, _)| *known == setting);
        Ok(found.unwrap_or_else(|| panic!("{setting:?}")).1)
    }

    fn set(&mut self, settings: &[(Setting, f64)]) -> Result<(), Stopped> {
        assert!(!self.on, "settings are taken with the motor off");
        for (setting, value) in settings {
            self.settings.retain(|(known, _)| known != setting);
            self.settings.push((*setting, *value));
        }
        Ok(())
    }

    fn store(&mut self, _: bool) -> Result<(), Stopped> {
        assert!(!self.on, "nothing is stored under current");
        self.stored = true;
        Ok(())
    }

    fn begin_motion(&mut self, mode: Motion) -> Result<(), Stopped> {
        self.motion = Some((mode, if mode == Motion::Position { self.joint[0] } else { 0.0 }));
        Ok(())
    }

    fn move_to(&mut self, set_point: f64) -> Result<(), Stopped> {
        if let Some((mode, last)) = &mut self.motion {
            if *mode == Motion::Position && set_point != *last {
                self.load[1] = self.load[1].abs() * (set_point - *last).signum();
            }
            *last = set_point;
        }
        Ok(())
    }

    fn motion(&mut self) -> Result<[f64; 3], Stopped> {
        let zero = self.setting(Setting::JointZero)?;
        Ok([self.joint[0] + zero, self.joint[1], self.torque_gain * (self.load[0] + self.load[1] + self.swing)])
    }
}
