//! Identification of all joints of a robot from one recording of all of them: rigid bodies, then the friction image of
//! each joint; host. The dynamics are those of the crate `rigid-body`, what a single joint needs is the crate
//! `identification`.
//!
//! Data flows one way:
//!
//! 1. [`recording`]: `recording.toml` names the robot and the columns of each joint; every joint is cleaned, filtered
//!    and split as a data set of one joint is.
//! 2. [`friction_columns`], [`equations`]: efforts as linear functions of inertial parameters, rotor inertias and a
//!    simple friction.
//! 3. [`least_squares`]: base parameters (IDIM-LS: ordinary, weighted, iteratively reweighted) with standard errors by
//!    [`noise`]; [`convex`]: all inertial parameters, each link physical and in its shapes ([`bounds`]); [`choose`]:
//!    the friction beside them and the regularisation, by motions that were left out.
//! 4. [`joints`]: the torque of the rigid bodies is the theoretical torque of each joint, and the pipeline of one joint
//!    does the rest: terms, pre-sliding, network, certificate, fixed point.
//! 5. [`mod@fit`] is the whole way, [`files`] its output, [`page`] the page of it; [`mod@evaluate`] judges that output
//!    on another recording.
//!
//! [`controller`] moves a robot by what came out. [`excite`] finds the motion of all joints that a recording should be
//! of.

pub mod bounds;
pub mod choose;
pub mod controller;
pub mod convex;
pub mod equations;
pub mod evaluate;
pub mod excite;
pub mod files;
pub mod fit;
pub mod friction_columns;
pub mod joints;
pub mod least_squares;
pub mod noise;
pub mod page;
pub mod recording;

pub use controller::Controller;
pub use fit::{FittedRobot, Options, fit};
pub use recording::{Recording, RobotFitError, read_robot, record};

#[cfg(test)]
mod tests;
