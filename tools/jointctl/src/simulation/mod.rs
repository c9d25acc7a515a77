//! The firmware's joint in closed loop with the simulated actuator: what `jointctl sim` runs; host.
//!
//! - [`motion`]: what a joint is asked to do over time
//! - [`scenario`]: the named scenarios, each in one or several parts
//! - [`mod@run`]: a part run at the control rate, commanded as over a bus, recorded
//! - [`recording`]: the log that a user would record, for identification
//! - [`log`]: what is recorded
//! - [`mod@judge`]: how well the joint did
//! - [`table`], [`page`]: the judgements for a terminal, the runs as a page with figures

pub mod judge;
pub mod log;
pub mod motion;
pub mod page;
pub mod recording;
pub mod run;
pub mod scenario;
pub mod table;

pub use judge::{Judgement, judge};
pub use log::{Log, Row};
pub use motion::Motion;
pub use run::{Choices, Ending, Run, run};
pub use scenario::{Part, Scenario};

/// Reason for which nothing was simulated.
#[derive(Debug, thiserror::Error)]
pub enum SimulationError {
    /// Plant, configuration or the joint's start.
    #[error(transparent)]
    Joint(#[from] plant::virtual_joint::VirtualJointError),
    /// A number of the scenario that the plant refuses.
    #[error(transparent)]
    Plant(#[from] plant::ParameterError),
    /// No excitation within the joint's limits.
    #[error(transparent)]
    Excitation(#[from] excitation::ExciteError),
    /// A recording that a fault ended.
    #[error("run {run} of the recording {reason}")]
    Recording {
        /// Number of the run, from 0.
        run: usize,
        /// Time, and fault.
        reason: String,
    },
    /// A torque that is not a number.
    #[error(transparent)]
    Metrics(#[from] identification::metrics::MetricsError),
}

#[cfg(test)]
mod tests;
