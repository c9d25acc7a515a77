//! Limits of a robot's motion: travel and speed of each joint, and a floor.
//!
//! URDF has travel and velocity (`<limit>`); `robot.toml` has what it lacks, and goes first where both state a limit.

use nalgebra::Vector3;

/// Limits of one joint's motion; None: not stated.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Limits {
    /// Lowest and highest position, rad or m.
    pub position: Option<(f64, f64)>,
    /// Largest velocity, rad/s or m/s.
    pub velocity: Option<f64>,
    /// Largest acceleration, rad/s^2 or m/s^2.
    pub acceleration: Option<f64>,
}

/// Frame of a URDF link that moves.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Name of the link.
    pub link: String,
    /// Index of the moving joint that carries it.
    pub carrier: usize,
    /// Its origin in the frame of that joint's link, m.
    pub origin: Vector3<f64>,
}
