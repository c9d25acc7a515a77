//! Limits of a joint: what it is permitted, and where a fault is; task, host.

#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

/// Limits that the joint may never exceed.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(deny_unknown_fields))]
pub struct Limits {
    /// Torque at the joint, Nm; 0.01 to 2000.
    pub torque: f32,
    /// Velocity, rad/s; 0.1 to 200. A fault 20 % above it.
    pub velocity: f32,
    /// Lowest and highest position, rad; the second above the first. A fault when passed by more than the margin.
    pub position: (f32, f32),
    /// Margin beyond the position limits, rad; 0.001 to 10.
    pub position_margin: f32,
    /// Damping of the limits and of braking, Nm s/rad; 5 times the torque limit over the velocity limit to 1e6. See
    /// [`super::limit_law`].
    pub damping: f32,
    /// Phase current at which the bridge switches off, A; 5 % above the motor's current limit at least, and at most
    /// the board's highest.
    pub over_current: f32,
    /// Lowest and highest supply, V; 5 to the board's highest, the second 1 V above the first at least.
    pub bus_voltage: (f32, f32),
    /// Span below the highest supply over which a braking current that feeds it fades to nothing, V; 0.1 to what lies
    /// between lowest and highest supply.
    pub regeneration_band: f32,
    /// Supply at which a brake chopper conducts, V; 0 (none), or 1 V above the lowest supply to where the regeneration
    /// band begins. 0 on a board without an output for one.
    #[cfg_attr(feature = "serde", serde(default))]
    pub chopper_voltage: f32,
    /// Largest part of the time in which it may conduct, over some 10 s; 0.001 to 1.
    #[cfg_attr(feature = "serde", serde(default = "earlier_chopper_share"))]
    pub chopper_share: f32,
    /// Bridge temperature, °C; 40 to the board's highest. Current is derated over the last 20 K.
    pub bridge_temperature: f32,
    /// Winding temperature, °C; 40 to 200. Current is derated over the last 20 K.
    pub winding_temperature: f32,
    /// Time without a command after which the joint brakes, s; 0.001 to the board's longest.
    pub command_deadline: f32,
}

/// Share in a file of a program that knew no brake chopper; host.
#[cfg(feature = "serde")]
const fn earlier_chopper_share() -> f32 {
    0.1
}

/// Velocity limit over the widest fade of the torque towards it.
const LEAST_FADE: f32 = 5.0;

impl Limits {
    /// Least limit damping, Nm s/rad: the torque fades over a fifth of the velocity limit. Where nobody has set another
    /// one, it is the one to take: the less damping, the lighter a joint may be.
    pub const fn least_damping(&self) -> f32 {
        LEAST_FADE * self.torque / self.velocity
    }
}
