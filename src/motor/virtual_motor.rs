//! A small motor, inverter and encoder for the tests of the current loop; host, tests only.
//!
//! The dq machine of [`super::current`] in double precision with a rotor, Coulomb and viscous friction, dead time,
//! current-sensor offsets, an encoder with any direction and offset, and a phase that may be open. Duties act in the
//! period after the one that computed them.

use super::angle::{Direction, ElectricalAngle, EncoderAlignment};
use super::phases::Phases;
use super::transform::Dq;
use core::f64::consts::TAU;

/// Control steps a second.
pub const RATE: f64 = 20_000.0;
const SUBSTEPS: usize = 20;

pub struct VirtualMotor {
    pub resistance: f64,
    pub inductance: (f64, f64),
    pub flux_linkage: f64,
    pub pole_pairs: u32,
    /// kg m^2, as the rotor sees it.
    pub inertia: f64,
    /// Nm.
    pub coulomb_friction: f64,
    /// Nm s/rad.
    pub viscous_friction: f64,
    /// Part of the period, each commutation.
    pub dead_time: f64,
    pub direction: Direction,
    /// Encoder's reading where the rotor's mechanical angle is 0, turns.
    pub encoder_offset: f64,
    /// Number of encoder steps in a turn.
    pub resolution: f64,
    pub current_offsets: Phases,
    /// Phase without a connection: 0, 1 or 2.
    pub open_phase: Option<usize>,
    /// Mechanical rad/s that something else imposes.
    pub held_speed: Option<f64>,
    /// Mechanical turns.
    pub position: f64,
    /// Mechanical rad/s.
    pub speed: f64,
    /// Stops at these mechanical turns.
    pub stops: (f64, f64),
    pub d: f64,
    pub q: f64,
    /// Current from the phase after the open one to the one after that, A.
    pub single: f64,
    pub next: Option<Phases>,
}

impl Default for VirtualMotor {
    fn default() -> Self {
        Self {
            resistance: 0.12,
            inductance: (60e-6, 90e-6),
            flux_linkage: 0.005,
            pole_pairs: 14,
            inertia: 5e-5,
            coulomb_friction: 0.02,
            viscous_friction: 1e-3,
            dead_time: 0.0,
            direction: Direction::Forward,
            encoder_offset: 0.0,
            resolution: 16_384.0,
            current_offsets: Phases::default(),
            open_phase: None,
            held_speed: None,
            position: 0.0,
            speed: 0.0,
            stops: (f64::NEG_INFINITY, f64::INFINITY),
            d: 0.0,
            q: 0.0,
            single: 0.0,
            next: None,
        }
    }
}

impl VirtualMotor {
    /// Real alignment of the encoder on the motor.
    pub fn alignment(&self) -> EncoderAlignment {
        let turns = self.encoder_offset * self.pole_pairs as f64 * self.direction.sign() as f64;
        let electrical_zero = ElectricalAngle((turns.rem_euclid(1.0) * 2f64.powi(32)) as u64 as u32);
        EncoderAlignment { pole_pairs: self.pole_pairs, direction: self.direction, electrical_zero }
    }

    pub fn encoder(&self) -> u32 {
        let turns = self.direction.sign() as f64 * self.position + self.encoder_offset;
        let step = (turns.rem_euclid(1.0) * self.resolution).round() / self.resolution;
        (step * 2f64.powi(32)) as u64 as u32
    }

    pub fn current(&self) -> Dq {
        Dq { d: self.d as f32, q: self.q as f32 }
    }

    fn phase_currents(&self) -> [f64; 3] {
        if let Some(open) = self.open_phase {
            let mut currents = [0.0; 3];
            (currents[(open + 1) % 3], currents[(open + 2) % 3]) = (self.single, -self.single);
            return currents;
        }
        let angle = TAU * self.position * self.pole_pairs as f64;
        [0.0, 1.0, 2.0].map(|phase| {
            let (sin, cos) = (angle - TAU * phase / 3.0).sin_cos();
            self.d * cos - self.q * sin
        })
    }

    pub fn measured_currents(&self) -> Phases {
        let [a, b, c] = self.phase_currents().map(|current| current as f32);
        let offsets = self.current_offsets;
        Phases { a: a + offsets.a, b: b + offsets.b, c: c + offsets.c }
    }

    /// A period with the duties of the step before; `duties` act in the next one. None: the bridge is off at once.
    pub fn period(&mut self, duties: Option<Phases>, bus_voltage: f64) {
        let step = 1.0 / RATE / SUBSTEPS as f64;
        for _ in 0..SUBSTEPS {
            match (self.next, duties) {
                (Some(acting), Some(_)) => self.electrical(acting, bus_voltage, step),
                // The diodes drive the current to zero within a few periods; how does not matter here.
                _ => (self.d, self.q, self.single) = (0.0, 0.0, 0.0),
            }
            self.mechanical(step);
        }
        self.next = duties;
    }

    fn electrical(&mut self, duties: Phases, bus_voltage: f64, step: f64) {
        let currents = self.phase_currents();
        let mut legs = [duties.a as f64, duties.b as f64, duties.c as f64];
        for (leg, current) in legs.iter_mut().zip(currents) {
            *leg = (*leg - self.dead_time * (current / 0.02).clamp(-1.0, 1.0)) * bus_voltage;
        }
        let (ld, lq) = self.inductance;
        if let Some(open) = self.open_phase {
            let line = legs[(open + 1) % 3] - legs[(open + 2) % 3];
            self.single += step * (line - 2.0 * self.resistance * self.single) / (ld + lq);
            return;
        }
        let angle = TAU * self.position * self.pole_pairs as f64;
        let (mut vd, mut vq) = (0.0, 0.0);
        for (phase, leg) in legs.into_iter().enumerate() {
            let (sin, cos) = (angle - TAU * phase as f64 / 3.0).sin_cos();
            vd += 2.0 / 3.0 * leg * cos;
            vq -= 2.0 / 3.0 * leg * sin;
        }
        let w = self.speed * self.pole_pairs as f64;
        let (d, q) = (self.d, self.q);
        self.d += step * (vd - self.resistance * d + w * lq * q) / ld;
        self.q += step * (vq - self.resistance * q - w * (ld * d + self.flux_linkage)) / lq;
    }

    fn mechanical(&mut self, step: f64) {
        if let Some(speed) = self.held_speed {
            self.speed = speed;
        } else {
            let (ld, lq) = self.inductance;
            let torque = 1.5 * self.pole_pairs as f64 * (self.flux_linkage + (ld - lq) * self.d) * self.q;
            let free = self.speed + step * (torque - self.viscous_friction * self.speed) / self.inertia;
            let friction = step * self.coulomb_friction / self.inertia;
            self.speed = if free.abs() <= friction { 0.0 } else { free - friction * free.signum() };
        }
        self.position += step * self.speed / TAU;
        if self.position < self.stops.0 || self.position > self.stops.1 {
            self.position = self.position.clamp(self.stops.0, self.stops.1);
            self.speed = 0.0;
        }
    }
}
