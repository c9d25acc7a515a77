//! Elastic transmission between motor and link: a spring that hardens, with hysteresis and damping, or with backlash.
//!
//! The motor's side is what the encoder sees and friction acts on; load, contacts and external torques act on the link.
//! The twist is the motor's position less the link's, both at the scale of the link.
//!
//! ```text
//! torque = k twist (1 + c twist^2) + h + d twist'
//! h' = kh (twist' - |twist'| h / H)
//! ```
//!
//! Source of the hysteresis: Dahl 1968; of a spring that hardens under torque: the data sheets of strain wave gears,
//! which state three stiffnesses. All of it is taken at the velocities at the end of a step (backward Euler), as
//! friction and contacts are. Backlash is two contacts, one at each end of the gap: neither of them pulls.

use crate::error::{ParameterError, within};
use serde::{Deserialize, Serialize};

/// Elasticity, hysteresis and backlash.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct TransmissionParameters {
    /// Stiffness k at no twist, 1 to 1e6 Nm/rad.
    pub stiffness: f64,
    /// Hardening c, 0 to 1e6 /rad².
    pub hardening: f64,
    /// Damping d, 0 to 1e4 Nm s/rad.
    pub damping: f64,
    /// Largest torque H of the hysteresis, 0 to 50 Nm; 0 with backlash.
    pub hysteresis: f64,
    /// Twist in which the hysteresis turns round, H / kh, 1e-6 to 0.1 rad.
    pub hysteresis_twist: f64,
    /// Free twist from one end of the gap to the other, 0 to 0.1 rad.
    pub backlash: f64,
}

impl TransmissionParameters {
    /// Checks every parameter against its documented range.
    ///
    /// # Errors
    /// The first parameter that is outside its range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        within("transmission.stiffness", self.stiffness, 1.0, 1e6)?;
        within("transmission.hardening", self.hardening, 0.0, 1e6)?;
        within("transmission.damping", self.damping, 0.0, 1e4)?;
        within("transmission.backlash", self.backlash, 0.0, 0.1)?;
        let most = if self.backlash > 0.0 { 0.0 } else { 50.0 };
        within("transmission.hysteresis", self.hysteresis, 0.0, most)?;
        within("transmission.hysteresis_twist", self.hysteresis_twist, 1e-6, 0.1)
    }
}

/// Transmission in motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transmission {
    parameters: TransmissionParameters,
    hysteresis: f64,
}

/// Torque over the velocity of the twist at the end of a step, and what it may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Line {
    /// Torque at velocity zero, Nm.
    pub offset: f64,
    /// Slope, Nm s/rad.
    pub slope: f64,
    /// Part of it by which the spring is bent.
    bending: f64,
    end: End,
}

/// End of the gap at which a [`Line`] touches.
#[derive(Clone, Copy, Debug, PartialEq)]
enum End {
    /// No gap.
    Fixed,
    /// The motor pushes the link forward.
    Forward,
    /// The motor pushes the link backward.
    Backward,
    /// Inside the gap.
    Free,
}

impl Line {
    /// Within the gap nothing is transmitted.
    pub const FREE: Self = Self { offset: 0.0, slope: 0.0, bending: 0.0, end: End::Free };

    /// Torque at this `velocity` (rad/s) at the end of the step, Nm.
    pub fn torque(&self, velocity: f64) -> f64 {
        self.offset + self.slope * velocity
    }

    /// Returns `true` if this end touches when the step ends at `velocity` (rad/s), and need not pull.
    pub fn holds(&self, velocity: f64) -> bool {
        let (bent, torque) = (self.offset + self.bending * velocity, self.torque(velocity));
        match self.end {
            End::Fixed | End::Free => true,
            End::Forward => bent > 0.0 && torque > 0.0,
            End::Backward => bent < 0.0 && torque < 0.0,
        }
    }
}

impl Transmission {
    /// A transmission without twist.
    #[must_use]
    pub fn new(parameters: TransmissionParameters) -> Self {
        Self { parameters, hysteresis: 0.0 }
    }

    /// Ways in which a step of `step` seconds can go on from a `twist` (rad) that changes by `velocity` (rad/s); the
    /// first that holds.
    pub(crate) fn prepare(&self, twist: f64, velocity: f64, step: f64) -> [Line; 3] {
        let p = &self.parameters;
        if p.backlash > 0.0 {
            let half = 0.5 * p.backlash;
            return [
                self.spring(twist - half, step, End::Forward),
                self.spring(twist + half, step, End::Backward),
                Line::FREE,
            ];
        }
        let mut line = self.spring(twist, step, End::Fixed);
        let relaxed = 1.0 + velocity.abs() * step / p.hysteresis_twist;
        line.offset += self.hysteresis / relaxed;
        line.slope += p.hysteresis / p.hysteresis_twist * step / relaxed;
        [line; 3]
    }

    fn spring(&self, twist: f64, step: f64, end: End) -> Line {
        let p = &self.parameters;
        let square = p.hardening * twist * twist;
        let tangent = p.stiffness * (1.0 + 3.0 * square);
        let bending = tangent * step;
        Line { offset: p.stiffness * twist * (1.0 + square), slope: bending + p.damping, bending, end }
    }

    /// Bends what holds the hysteresis through a step that was prepared with `before` (rad/s) and ended at `after`.
    pub(crate) fn advance(&mut self, before: f64, after: f64, step: f64) {
        let p = &self.parameters;
        let stiffness = p.hysteresis / p.hysteresis_twist;
        self.hysteresis =
            (self.hysteresis + stiffness * step * after) / (1.0 + before.abs() * step / p.hysteresis_twist);
    }

    /// Energy in springs at a `twist`, J.
    #[must_use]
    pub fn energy(&self, twist: f64) -> f64 {
        let p = &self.parameters;
        let half = 0.5 * p.backlash;
        let bent = twist - twist.clamp(-half, half);
        let spring = 0.5 * p.stiffness * bent * bent * (1.0 + 0.5 * p.hardening * bent * bent);
        let held = if p.hysteresis > 0.0 {
            0.5 * self.hysteresis * self.hysteresis * p.hysteresis_twist / p.hysteresis
        } else {
            0.0
        };
        spring + held
    }
}
