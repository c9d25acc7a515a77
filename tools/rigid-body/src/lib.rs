//! Rigid-body dynamics of a robot: from URDF and `robot.toml` to torques, regressors and accelerations.
//!
//! Notation: q joint positions (rad or m), v velocities, a accelerations, tau joint torques (Nm or N); one entry per
//! moving joint, parents first. phi: ten inertial parameters per link ([`LinkInertia`]). All vectors of a link are in
//! its own frame, whose origin is that of its joint, as in URDF.
//!
//! | module | content |
//! |---|---|
//! | [`urdf`], [`drives`], [`limits`], [`defect`], [`robot`] | the files, their checks, and the robot that they describe |
//! | [`tree`], [`placement`], [`inertia`] | joints and links, frames, inertial parameters and their physical consistency |
//! | [`shape`], [`ellipsoid`] | shapes of links, and ellipsoids that hold their mass |
//! | [`newton_euler`] | tau from q, v, a |
//! | [`regressor`], [`base_parameters`] | tau as a linear function of phi, and which combinations of phi it shows |
//! | [`mass_matrix`], [`articulated_body`] | the mass matrix, and a from q, v, tau |
//! | [`mjcf`] | the robot for MuJoCo |
//! | [`random_tree`] | robots to test with |
//!
//! Algorithms: R. Featherstone, Rigid Body Dynamics Algorithms, 2008, tables 5.1, 6.2 and 7.1; pseudo-inertia: P.
//! Wensing, S. Kim, J.-J. Slotine, Linear Matrix Inequalities for Physically Consistent Inertial Parameter
//! Identification, 2018.

pub mod articulated_body;
pub mod base_parameters;
pub mod defect;
pub mod drives;
pub mod ellipsoid;
pub mod inertia;
pub mod limits;
pub mod mass_matrix;
pub mod mjcf;
pub mod newton_euler;
pub mod pairs;
pub mod placement;
pub mod random_tree;
pub mod regressor;
pub mod robot;
pub mod shape;
pub mod tree;
pub mod urdf;

pub use defect::RobotError;
pub use inertia::LinkInertia;
pub use limits::Limits;
pub use placement::Placement;
pub use robot::Robot;
pub use tree::{Joint, JointKind, Tree};
