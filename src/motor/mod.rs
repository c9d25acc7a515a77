//! The current loop: everything between a wanted torque and three duty cycles; control step.
//!
//! Single-precision floating point in SI units. The Cortex-M4F and the host both compute it by IEEE 754 without
//! contraction, so the bits are the same as long as nothing calls a mathematics library: angles are 32-bit fractions of
//! a turn, their sine and cosine come from integers ([`friction_compensation::sine`]), square roots from [`number`].
//!
//! In the order of a control step:
//!  - [`phases`]: one value for each of the three phases;
//!  - [`angle`]: where the rotor's magnetic axis is, and its sine and cosine;
//!  - [`observer`]: position, velocity and acceleration from the encoder;
//!  - [`transform`]: phases to the stationary frame to the rotor's frame, and back;
//!  - [`current`]: from wanted to needed voltage in the rotor's frame;
//!  - [`modulation`]: from a voltage to three duties;
//!  - [`field_oriented`]: the five above put together, phase currents in and duties out.
//!
//! Beside it:
//!  - [`thermal`]: how hot the winding is and how much current it bears; slow task;
//!  - [`open_loop`]: a field of a commanded voltage, and means of the winding's answer, for commissioning; control
//!    step;
//!  - [`setting`]: how a setting out of its range is refused; task, host;
//!  - [`number`]: limits and roots that treat NaN the same everywhere.

pub mod angle;
pub mod current;
pub mod field_oriented;
pub mod field_weakening;
pub mod modulation;
pub mod number;
pub mod observer;
pub mod open_loop;
pub mod phases;
pub mod setting;
pub mod thermal;
pub mod transform;
#[cfg(test)]
mod virtual_motor;
