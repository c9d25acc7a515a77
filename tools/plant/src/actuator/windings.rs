//! The windings of a permanent-magnet synchronous motor in the rotor's dq frame.
//!
//! ```text
//! v_d = R i_d + L_d i_d' - w L_q i_q            T = 3/2 p (psi i_q + (L_d - L_q) i_d i_q)
//! v_q = R i_q + L_q i_q' + w (L_d i_d + psi)    K_t = 3/2 p psi
//! ```
//!
//! with w = p times the rotor's speed (textbook form, for example D. W. Novotny, T. A. Lipo, "Vector Control and
//! Dynamics of AC Drives", 1996, ch. 2). While every phase is driven they are integrated by the implicit midpoint rule:
//! stable for every step, and power in = copper loss + torque x speed + change of the magnetic energy holds to
//! rounding. Where diodes or an open lead decide, the step is that of [`freewheel`](super::freewheel).

use super::frame::{Frame, dot};
use super::freewheel::ImplicitStep;
use super::legs::{Leg, Rails};
use crate::error::{ParameterError, count_within, within};
use crate::motor::MotorParameters;
use serde::{Deserialize, Serialize};

/// Temperature at which the resistance holds, °C.
pub const REFERENCE_TEMPERATURE: f64 = 25.0;

/// Rise of copper's resistance, 1/K, at 25 °C.
pub const COPPER_RISE: f64 = 3.85e-3;

/// Order in which the motor's phases are wired to the bridge.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum PhaseOrder {
    /// A current vector that turns forward turns the rotor forward.
    Forward,
    /// B and C are exchanged: it turns the rotor backward.
    Exchanged,
}

/// Torque between magnets and teeth.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Cogging {
    /// Amplitude at the rotor, 0 to 10 Nm.
    pub amplitude: f64,
    /// Periods per turn of the rotor, 1 to 1000: the least common multiple of slots and poles.
    pub periods_per_turn: f64,
    /// Phase at rotor angle zero, -pi to pi rad.
    pub phase: f64,
}

impl Cogging {
    /// Torque on the rotor at `angle` (rad), Nm.
    #[must_use]
    pub fn torque(&self, angle: f64) -> f64 {
        if self.amplitude == 0.0 {
            return 0.0;
        }
        self.amplitude * libm::sin(self.periods_per_turn * angle + self.phase)
    }
}

/// Parameters of the windings beyond [`MotorParameters`]. Torque constant and resistance are there: the flux linkage is
/// K_t / (3/2 p), and the resistance of a phase is two thirds of the one that turns i_q into copper loss.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct WindingParameters {
    /// Pole pairs p, 1 to 64.
    pub pole_pairs: usize,
    /// Inductance L_d, 1e-6 to 0.1 H.
    pub inductance_d: f64,
    /// Inductance L_q, 1e-6 to 0.1 H.
    pub inductance_q: f64,
    /// Relative rise of the resistance, 0 to 0.01 per K above [`REFERENCE_TEMPERATURE`]; copper: [`COPPER_RISE`].
    pub resistance_rise: f64,
    /// Relative fall of the magnets' flux, 0 to 0.003 per K above 25 °C; ferrite 0.002, neodymium 0.001.
    #[serde(default)]
    pub flux_fall: f64,
    /// Electrical angle of the d axis before phase A when the rotor's angle is zero, -pi to pi rad.
    pub electrical_zero: f64,
    /// Order of the phases.
    pub phase_order: PhaseOrder,
    /// Cogging torque.
    pub cogging: Cogging,
}

impl WindingParameters {
    /// Checks every parameter against its documented range.
    ///
    /// # Errors
    /// The first parameter that is outside its range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        const PI: f64 = std::f64::consts::PI;
        count_within("windings.pole_pairs", self.pole_pairs, 1, 64)?;
        within("windings.inductance_d", self.inductance_d, 1e-6, 0.1)?;
        within("windings.inductance_q", self.inductance_q, 1e-6, 0.1)?;
        within("windings.resistance_rise", self.resistance_rise, 0.0, 0.01)?;
        within("windings.flux_fall", self.flux_fall, 0.0, 0.003)?;
        within("windings.electrical_zero", self.electrical_zero, -PI, PI)?;
        within("windings.cogging.amplitude", self.cogging.amplitude, 0.0, 10.0)?;
        within("windings.cogging.periods_per_turn", self.cogging.periods_per_turn, 1.0, 1000.0)?;
        within("windings.cogging.phase", self.cogging.phase, -PI, PI)
    }

    /// Flux linkage psi of the magnets, peak, Vs.
    #[must_use]
    pub fn flux_linkage(&self, motor: &MotorParameters) -> f64 {
        motor.torque_constant / (1.5 * self.pole_pairs as f64)
    }

    /// Resistance of one phase with the winding at `temperature` (°C), ohm; at least a tenth of that at 25 °C.
    #[must_use]
    pub fn phase_resistance(&self, motor: &MotorParameters, temperature: f64) -> f64 {
        let rise = 1.0 + self.resistance_rise * (temperature - REFERENCE_TEMPERATURE);
        motor.resistance / 1.5 * rise.max(0.1)
    }
}

/// The rotor during one step of the windings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rotation {
    /// Frame of the electrical angle in the middle of the step.
    pub frame: Frame,
    /// Electrical speed, rad/s.
    pub velocity: f64,
}

/// Flow of current during one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flow {
    /// Phase currents as the bridge sees them, A, positive into the motor.
    pub phase_currents: [f64; 3],
    /// Torque on the rotor without cogging, Nm.
    pub torque: f64,
    /// Heat in the windings, W.
    pub copper_loss: f64,
}

impl Flow {
    /// No flow.
    pub const NONE: Self = Self { phase_currents: [0.0; 3], torque: 0.0, copper_loss: 0.0 };
}

/// The windings with the currents in them.
#[derive(Clone, Debug)]
pub struct Windings {
    parameters: WindingParameters,
    motor: MotorParameters,
    flux: f64,
    current: [f64; 2],
}

impl Windings {
    /// Windings without current.
    ///
    /// # Errors
    /// The first parameter that is outside its range.
    pub fn new(parameters: WindingParameters, motor: MotorParameters) -> Result<Self, ParameterError> {
        parameters.validate()?;
        motor.validate()?;
        Ok(Self { parameters, motor, flux: parameters.flux_linkage(&motor), current: [0.0; 2] })
    }

    /// Magnets of this temperature, °C, from now on.
    pub fn warm(&mut self, temperature: f64) {
        let fall = self.parameters.flux_fall * (temperature - REFERENCE_TEMPERATURE);
        self.flux = self.parameters.flux_linkage(&self.motor) * (1.0 - fall);
    }

    /// Currents along d and q, A.
    #[must_use]
    pub fn current(&self) -> [f64; 2] {
        self.current
    }

    /// Currents in the phases as the bridge sees them, A, with the rotor as in `frame`.
    #[must_use]
    pub fn phase_currents(&self, frame: &Frame) -> [f64; 3] {
        self.ordered(frame.phases(self.current))
    }

    /// Energy in the windings' inductances, J.
    #[must_use]
    pub fn magnetic_energy(&self) -> f64 {
        let [d, q] = self.current;
        0.75 * (self.parameters.inductance_d * d * d + self.parameters.inductance_q * q * q)
    }

    /// Resistance of one phase at `temperature`, °C, in ohm.
    #[must_use]
    pub fn phase_resistance(&self, temperature: f64) -> f64 {
        self.parameters.phase_resistance(&self.motor, temperature)
    }

    /// Moves on by `step` seconds with the phases at `legs` and the rotor turning as `rotation` says. `resistance` is a
    /// phase's, `outside` that of the bridge and leads in series, ohm.
    pub fn advance(
        &mut self,
        legs: &[Leg; 3],
        rails: &Rails,
        rotation: &Rotation,
        resistance: f64,
        outside: f64,
        step: f64,
    ) -> Flow {
        let legs = self.ordered(*legs);
        let total = resistance + outside;
        let mean = match legs {
            [Leg::Driven { voltage: a, .. }, Leg::Driven { voltage: b, .. }, Leg::Driven { voltage: c, .. }] => {
                self.driven(rotation.frame.dq([a, b, c]), rotation.velocity, total, step)
            }
            _ => self.floating(&legs, rails, rotation, total, step),
        };
        let [d, q] = mean;
        let (inductance_d, inductance_q) = (self.parameters.inductance_d, self.parameters.inductance_q);
        Flow {
            phase_currents: self.ordered(rotation.frame.phases(mean)),
            torque: 1.5 * self.parameters.pole_pairs as f64 * (self.flux + (inductance_d - inductance_q) * d) * q,
            copper_loss: 1.5 * resistance * dot(mean, mean),
        }
    }

    /// Returns `true` if there is no current and, with the phases at `legs`, none starts to flow.
    #[must_use]
    pub fn rests(&self, legs: &[Leg; 3], rails: &Rails, rotation: &Rotation, step: f64) -> bool {
        let legs = self.ordered(*legs);
        self.current == [0.0; 2] && self.implicit(&legs, rails, rotation, 0.0, step).rests()
    }

    /// Implicit midpoint; returns the mean current of the step.
    fn driven(&mut self, voltage: [f64; 2], velocity: f64, resistance: f64, step: f64) -> [f64; 2] {
        let (inductance_d, inductance_q) = (self.parameters.inductance_d, self.parameters.inductance_q);
        let (rate_d, rate_q) = (2.0 * inductance_d / step, 2.0 * inductance_q / step);
        let (diagonal_d, diagonal_q) = (rate_d + resistance, rate_q + resistance);
        let (coupling_d, coupling_q) = (velocity * inductance_q, velocity * inductance_d);
        // (2 L_d/h + R) d - w L_q q = right_d,   w L_d d + (2 L_q/h + R) q = right_q: Cramer's rule.
        let right_d = voltage[0] + rate_d * self.current[0];
        let right_q = voltage[1] + rate_q * self.current[1] - velocity * self.flux;
        let scale = 1.0 / (diagonal_d * diagonal_q + coupling_d * coupling_q);
        let d = (right_d * diagonal_q + coupling_d * right_q) * scale;
        let q = (right_q * diagonal_d - coupling_q * right_d) * scale;
        self.current = [2.0 * d - self.current[0], 2.0 * q - self.current[1]];
        [d, q]
    }

    /// Diodes and open leads; returns the mean current of the step. Half a step of backward Euler, continued to its
    /// end, is the midpoint rule; it is taken where every phase conducts or floats throughout, and backward Euler
    /// elsewhere.
    fn floating(
        &mut self,
        legs: &[Leg; 3],
        rails: &Rails,
        rotation: &Rotation,
        resistance: f64,
        step: f64,
    ) -> [f64; 2] {
        let frame = &rotation.frame;
        let before = self.current;
        let middle = self.implicit(legs, rails, rotation, resistance, 0.5 * step).solve();
        let after = [2.0 * middle[0] - before[0], 2.0 * middle[1] - before[1]];
        // Seen from the frame of the middle, a phase that floats throughout starts with what the rotor's turn within
        // half a step makes of the others' currents.
        let turned = 1e-9 + rotation.velocity.abs() * step * (before[0].abs() + before[1].abs());
        let [first, mid, last] = [before, middle, after].map(|current| frame.phases(current));
        let steady = (0..3).all(|k| match legs[k] {
            Leg::Driven { .. } => true,
            _ if mid[k].abs() < 1e-9 => first[k].abs() < turned,
            _ => first[k] * mid[k] > 0.0 && mid[k] * last[k] > 0.0,
        });
        let (mean, end) = if steady && middle != [0.0; 2] {
            (middle, after)
        } else {
            let end = self.implicit(legs, rails, rotation, resistance, step).solve();
            (end, end)
        };
        // At the end of the step the line on which a phase carries nothing has turned on in dq.
        let mean_phases = frame.phases(mean);
        let floats = (0..3).find(|k| !matches!(legs[*k], Leg::Driven { .. }) && mean_phases[*k].abs() < 1e-9);
        self.current = floats.map_or(end, |k| {
            let [x, y] = frame.directions[k];
            let along = -y * end[0] + x * end[1];
            let turn = 0.5 * rotation.velocity * step;
            [along * (-y + turn * x), along * (x + turn * y)]
        });
        mean
    }

    /// Backward Euler; the coupling between d and q is taken at the beginning of the step.
    fn implicit(
        &self,
        legs: &[Leg; 3],
        rails: &Rails,
        Rotation { frame, velocity }: &Rotation,
        resistance: f64,
        step: f64,
    ) -> ImplicitStep {
        let [d, q] = self.current;
        let (inductance_d, inductance_q) = (self.parameters.inductance_d, self.parameters.inductance_q);
        let middle = 0.5 * rails.voltage;
        let applied = frame.dq(legs.map(|leg| if let Leg::Driven { voltage, .. } = leg { voltage } else { middle }));
        let size = 2.0 / 3.0 * (middle + rails.diode_drop);
        ImplicitStep {
            impedance: [inductance_d / step + resistance, inductance_q / step + resistance],
            voltage: [
                applied[0] + inductance_d / step * d + velocity * inductance_q * q,
                applied[1] + inductance_q / step * q - velocity * (inductance_d * d + self.flux),
            ],
            directions: frame.directions,
            against: legs.map(|leg| if leg == Leg::Diodes { size } else { 0.0 }),
            open: legs.map(|leg| leg == Leg::Open),
        }
    }

    fn ordered<T>(&self, [a, b, c]: [T; 3]) -> [T; 3] {
        match self.parameters.phase_order {
            PhaseOrder::Forward => [a, b, c],
            PhaseOrder::Exchanged => [a, c, b],
        }
    }
}
