//! The joint with its electrical side, at the control rate: duties in, sensor readings out; host.
//!
//! One call of [`Actuator::advance`] is one PWM period. Between two calls, [`Actuator::measure`] gives what a control
//! step may know. Powers add up in every period, see [`Powers`].
//!
//! ```text
//! duties -> [shadow register] -> legs: quantised, dead time, body diodes, broken leads
//!        -> windings in dq -> torque (+ cogging) -> joint: gear, LuGre friction, load, contact, heat
//!        -> current taken from the bus -> source, capacitor
//! truth  -> sensors: offset, gain, noise, range, counts, eccentricity, lag, delay, failures -> DriveSample
//! ```
//!
//! - [`frame`]: phases to dq and back
//! - [`legs`]: what each phase is connected to
//! - [`windings`]: voltages to currents and torque
//! - [`freewheel`]: currents that diodes decide
//! - [`inverter`]: duties to leg voltages, dead time, the bridge's heat
//! - [`bus`]: source and capacitor
//! - [`accessories`]: holding brake and brake chopper
//! - [`current_sensors`], [`rotor_encoder`], [`thermistor`], [`sensors`]: what is measured
//! - [`faults`]: what can break
//! - [`parameters`], [`effects`], [`randomised`]: everything that describes an actuator, effects one by one, random
//!   actuators
//! - [`judging`]: random actuators that are less like the firmware's model, and what a data sheet says of them
//! - [`lockstep`]: all of it together

pub mod accessories;
pub mod bus;
pub mod current_sensors;
pub mod effects;
pub mod faults;
pub mod frame;
pub mod freewheel;
pub mod inverter;
pub mod judging;
pub mod legs;
pub mod lockstep;
pub mod parameters;
pub mod randomised;
pub mod rotor_encoder;
pub mod sensors;
pub mod thermistor;
pub mod windings;

mod delay;

pub use accessories::Accessories;
pub use delay::MAXIMUM_DELAY;
pub use effects::Effect;
pub use faults::{Channel, Failure, Fault};
pub use legs::Phase;
pub use lockstep::{Actuator, ActuatorState, Powers};
pub use parameters::ActuatorParameters;
pub use sensors::DriveSample;
