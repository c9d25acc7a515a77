//! Laws in which a joint's friction departs from the ones that the firmware's model has: other exponents, a ripple that
//! is no sine, and what friction remembers.
//!
//! ```text
//! s(v) = exp(-|v / v_s|^a)                        Stribeck curve; 2 is the model's
//! w(v) = (|v| / V + 0.01)^(b - 1)                 factor of the viscous coefficient; 1 is the model's
//! l(t) = 1 + loss t0 (|t| / t0)^c / F_c           load; 1 is the model's
//! ```
//!
//! Frictional lag: the level answers to a speed of the past (Hess and Soom 1990). Aging: at rest the level rises and
//! falls again within a way of sliding (the aging law of Dieterich 1979 and Ruina 1983, normalised). Film: at rest the
//! lubricant leaves the contact, and motion is more viscous until the way has brought it back. Running in: the level
//! falls with the way travelled.

use crate::error::{ParameterError, within};
use serde::{Deserialize, Serialize};

/// Something that grows while the joint rests and is undone by a way of motion.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Rest {
    /// Relative rise after a long rest, 0 to 2.
    pub rise: f64,
    /// Time constant at rest, 0.01 to 1e5 s.
    pub time: f64,
    /// Way that undoes it, 1e-5 to 100 rad.
    pub way: f64,
}

impl Rest {
    /// No effect.
    pub const NONE: Self = Self { rise: 0.0, time: 1.0, way: 1.0 };

    fn validate(&self, names: [&'static str; 3]) -> Result<(), ParameterError> {
        within(names[0], self.rise, 0.0, 2.0)?;
        within(names[1], self.time, 0.01, 1e5)?;
        within(names[2], self.way, 1e-5, 100.0)
    }

    /// State after a step, 0 to 1, by the backward Euler rule.
    fn after(&self, state: f64, velocity: f64, step: f64) -> f64 {
        let grown = step / self.time;
        (state + grown) / (1.0 + grown + velocity.abs() * step / self.way)
    }
}

/// Departures of a joint's friction.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct FrictionShape {
    /// Exponent a of the Stribeck curve, 0.3 to 4.
    pub stribeck: f64,
    /// Exponent b of the viscous torque, 0.3 to 2.
    pub viscous: f64,
    /// Speed V at which the viscous coefficient is the stated one, 0.05 to 50 rad/s.
    pub viscous_speed: f64,
    /// Exponent c of the load, 0.3 to 2.
    pub load: f64,
    /// Torque t0 at which the gear loss is the stated one, 0.01 to 1000 Nm.
    pub load_torque: f64,
    /// Skew of the ripple, 0 (a sine) to 0.9: sin(x + skew sin x).
    pub ripple_skew: f64,
    /// Frictional lag, 0 to 0.2 s.
    pub lag: f64,
    /// Rise of the dry friction at rest.
    pub aging: Rest,
    /// Rise of the viscous friction at rest.
    pub film: Rest,
    /// Relative dry friction that running in takes away, 0 to 1.
    pub run_in: f64,
    /// Way of running in, 1 to 1e6 rad.
    pub run_in_way: f64,
}

impl FrictionShape {
    /// Laws of the firmware's model.
    pub const MODEL: Self = Self {
        stribeck: 2.0,
        viscous: 1.0,
        viscous_speed: 1.0,
        load: 1.0,
        load_torque: 1.0,
        ripple_skew: 0.0,
        lag: 0.0,
        aging: Rest::NONE,
        film: Rest::NONE,
        run_in: 0.0,
        run_in_way: 1.0,
    };

    /// Checks every parameter against its documented range.
    ///
    /// # Errors
    /// The first parameter that is outside its range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        within("friction.shape.stribeck", self.stribeck, 0.3, 4.0)?;
        within("friction.shape.viscous", self.viscous, 0.3, 2.0)?;
        within("friction.shape.viscous_speed", self.viscous_speed, 0.05, 50.0)?;
        within("friction.shape.load", self.load, 0.3, 2.0)?;
        within("friction.shape.load_torque", self.load_torque, 0.01, 1000.0)?;
        within("friction.shape.ripple_skew", self.ripple_skew, 0.0, 0.9)?;
        within("friction.shape.lag", self.lag, 0.0, 0.2)?;
        self.aging.validate(["friction.shape.aging.rise", "friction.shape.aging.time", "friction.shape.aging.way"])?;
        self.film.validate(["friction.shape.film.rise", "friction.shape.film.time", "friction.shape.film.way"])?;
        within("friction.shape.run_in", self.run_in, 0.0, 1.0)?;
        within("friction.shape.run_in_way", self.run_in_way, 1.0, 1e6)
    }

    /// Stribeck curve, 1 at rest to 0, at a `ratio` of velocity and Stribeck velocity.
    pub(crate) fn stribeck(&self, ratio: f64) -> f64 {
        libm::exp(-libm::pow(ratio.abs(), self.stribeck))
    }

    /// Torque (Nm) whose loss is that of `torque` in a linear law.
    pub(crate) fn load(&self, torque: f64) -> f64 {
        self.load_torque * libm::pow(torque.abs() / self.load_torque, self.load)
    }

    /// Factor of the viscous coefficient at `velocity`, rad/s.
    pub(crate) fn viscous(&self, velocity: f64) -> f64 {
        libm::pow(velocity.abs() / self.viscous_speed + 0.01, self.viscous - 1.0)
    }

    /// One period of the ripple at `phase`, rad.
    pub(crate) fn ripple(&self, phase: f64) -> f64 {
        libm::sin(phase + self.ripple_skew * libm::sin(phase))
    }
}

/// Memory that friction has of the motion before.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Memory {
    speed: f64,
    aging: f64,
    film: f64,
    way: f64,
}

impl Memory {
    /// Velocity whose level of dry friction holds, in the direction of `velocity`, rad/s.
    pub(crate) fn velocity(&self, shape: &FrictionShape, velocity: f64) -> f64 {
        if shape.lag == 0.0 { velocity } else { self.speed.copysign(velocity) }
    }

    /// Factor of the dry friction.
    pub(crate) fn dry(&self, shape: &FrictionShape) -> f64 {
        (1.0 + shape.aging.rise * self.aging) * (1.0 + shape.run_in * libm::expm1(-self.way / shape.run_in_way))
    }

    /// Factor of the viscous friction.
    pub(crate) fn viscous(&self, shape: &FrictionShape) -> f64 {
        1.0 + shape.film.rise * self.film
    }

    /// Moves on by a step that ended at `velocity`, rad/s.
    pub(crate) fn advance(&mut self, shape: &FrictionShape, velocity: f64, step: f64) {
        self.speed += (velocity.abs() - self.speed) * step / (step + shape.lag);
        self.aging = shape.aging.after(self.aging, velocity, step);
        self.film = shape.film.after(self.film, velocity, step);
        self.way += velocity.abs() * step;
    }
}
