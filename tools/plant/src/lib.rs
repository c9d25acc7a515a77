//! A virtual joint: what the friction identification and the control step are tested against.
//!
//! Its friction is deliberately *not* the model that the project fits. It is a LuGre bristle with a state of its
//! own, so an estimator that merely finds its own equations again cannot pass here.
//!
//! All quantities are on the link side of the gear and in SI units unless a name says otherwise; temperatures are
//! in degrees Celsius. Position zero is the link hanging straight down.
//!
//! ```text
//! friction   z' = v - sigma0 |v| / g z                          bristle deflection z, rad
//!            F  = sigma0 z + sigma1(v) z' + sigma2(+/-) w(T) v
//!            g  = (F_c(+/-) + (F_s(+/-) - F_c(+/-)) exp(-(v/v_s)^2)) c(T) r(q) l(load)
//! joint      (N^2 J_rotor + J_link + m l^2) a = N K_t i - m g l sin q + external - F
//! heat       C_w T_w' = R i^2 - (T_w - T_h)/R_wh        C_h T_h' = (T_w - T_h)/R_wh + P_F - (T_h - T_a)/R_ha
//! ```
//!
//! The friction is C. Canudas de Wit, H. Olsson, K. J. Åström, P. Lischinsky, "A new model for control of systems
//! with friction", IEEE Trans. Automatic Control 40(3), 1995, eq. 1-3 and 6; its dependence on direction, load,
//! temperature and position is this crate's, see [`friction`]. The excitation is the finite Fourier series of
//! "Non-symmetric Coulomb friction with Deep Lagrangian Networks", section III-B, see [`fourier`].
//!
//! From the physics outwards:
//!
//! - [`friction`]: bristle friction, passive in every time step
//! - [`friction_shape`]: laws in which friction departs from the firmware's model, and what it remembers
//! - [`friction_factors`]: the same friction with other numbers, for models that are wrong on purpose
//! - [`load`]: the link as a pendulum
//! - [`motor`]: current to torque and copper loss
//! - [`thermal`]: winding and housing
//! - [`transmission`]: elasticity, hysteresis and backlash between motor and link
//! - [`contact`]: what the link runs into
//! - [`joint`]: all of these, integrated
//! - [`actuator`]: the joint behind windings, bridge, supply and a drive's sensors, at the control rate; with faults
//! - [`fourier`], [`excitation`]: the motions that are recorded
//! - [`parameters`], [`randomised`]: everything that describes a joint, and joints drawn at random
//! - [`virtual_joint`]: the firmware's own control step, closed over the actuator
//! - [`arm`]: several of them on one tree of links; [`links`]: these links; [`pair`]: two joints that share a drive
//! - [`error`]: what is refused, and the range that would not be

#![forbid(unsafe_code)]

pub mod actuator;
pub mod arm;
pub mod contact;
pub mod error;
pub mod excitation;
pub mod fourier;
pub mod friction;
pub mod friction_factors;
pub mod friction_shape;
pub mod joint;
pub mod links;
pub mod load;
pub mod motor;
pub mod pair;
pub mod parameters;
pub mod randomised;
pub mod thermal;
pub mod transmission;
pub mod virtual_joint;

mod noise;

pub use actuator::{Actuator, ActuatorParameters};
pub use arm::Arm;
pub use error::ParameterError;
pub use excitation::Excitation;
pub use joint::Joint;
pub use links::{ArmError, Links};
pub use pair::Pair;
pub use parameters::JointParameters;
pub use virtual_joint::VirtualJoint;
