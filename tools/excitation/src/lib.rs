//! Excitation for identification: a finite Fourier series whose samples tell inertia, gravity and friction apart as
//! well as the joint's limits permit; host.
//!
//! The form of the series is that of the non-symmetric-Coulomb paper (002, section III-B), see [`plant::fourier`]; it
//! fades in and out, so that it begins and ends at rest. It is about the middle of the position limits.
//!
//! Data flows one way: limits become a series by a search (`optimise`) over sums of single harmonics ([`basis`]), each
//! judged by what its samples tell apart, a condition number ([`regressor`]). The series is written as coefficients and
//! as a table of samples ([`mod@file`]); whether a table keeps the limits is checked apart from its origin ([`check`]).

pub mod basis;
pub mod check;
pub mod file;
mod optimise;
pub mod regressor;

pub use optimise::{Effort, Found, optimise};

use plant::excitation::Reference;
use plant::fourier::FourierSeries;

/// Bounds that a motion may not exceed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Lowest and highest position, rad.
    pub position: (f64, f64),
    /// Largest velocity, rad/s.
    pub velocity: f64,
    /// Largest acceleration, rad/s².
    pub acceleration: f64,
}

/// A Fourier series about a position.
#[derive(Clone, Debug, PartialEq)]
pub struct Excitation {
    /// The series.
    pub series: FourierSeries,
    /// Position that it begins, ends and moves about, rad.
    pub centre: f64,
    /// Duration, s.
    pub duration: f64,
}

/// Reason for which there is no excitation.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ExciteError {
    /// A choice outside its range.
    #[error("{name} is {value}, must lie in {low} to {high}{unit}")]
    Choice {
        /// The choice.
        name: &'static str,
        /// Its value.
        value: f64,
        /// Least possible value.
        low: f64,
        /// Greatest possible value.
        high: f64,
        /// Unit with a space before it, or nothing.
        unit: &'static str,
    },
}

/// Checks that a choice lies within its range.
///
/// # Errors
/// [`ExciteError::Choice`].
pub fn within(name: &'static str, unit: &'static str, value: f64, (low, high): (f64, f64)) -> Result<(), ExciteError> {
    match (low..=high).contains(&value) {
        true => Ok(()),
        false => Err(ExciteError::Choice { name, value, low, high, unit }),
    }
}

impl Bounds {
    /// Checks that there is room to move.
    ///
    /// # Errors
    /// [`ExciteError::Choice`].
    pub fn validate(&self) -> Result<(), ExciteError> {
        let (low, high) = self.position;
        within("lowest position", " rad", low, (-1000.0, 1000.0))?;
        within("highest position", " rad", high, (low + 1e-3, 1000.0))?;
        within("velocity", " rad/s", self.velocity, (1e-3, 200.0))?;
        within("acceleration", " rad/s²", self.acceleration, (1e-3, 1e5))
    }

    /// Middle of the positions, rad.
    #[must_use]
    pub fn centre(&self) -> f64 {
        0.5 * (self.position.0 + self.position.1)
    }

    /// Part of the tightest bound that a motion uses; above 1 beyond it.
    #[must_use]
    pub fn use_of(&self, motion: &Reference) -> f64 {
        let half = 0.5 * (self.position.1 - self.position.0);
        let position = (motion.position - self.centre()).abs() / half;
        position.max(motion.velocity.abs() / self.velocity).max(motion.acceleration.abs() / self.acceleration)
    }
}

impl Excitation {
    /// Reference of the joint at `time` (s).
    #[must_use]
    pub fn at(&self, time: f64) -> Reference {
        let mut motion = self.series.faded(time, self.duration);
        motion.position += self.centre;
        motion
    }

    /// The motion every `period` (s), from its begin to its end.
    pub fn samples(&self, period: f64) -> impl Iterator<Item = (f64, Reference)> + '_ {
        let steps = (self.duration / period).round().max(1.0) as u64;
        (0..=steps).map(move |step| {
            let time = self.duration * step as f64 / steps as f64;
            (time, self.at(time))
        })
    }
}

#[cfg(test)]
mod tests;
