//! A fleet of joints on one machine: which joints have changed, since when, and in which way; host.
//!
//! A data set of a fleet is a folder of Parquet, `joint=NAME/day=YYYY-MM-DD/*.parquet` ([`partition`]). Of each joint
//! and day [`sums`] keeps what a linear model needs, some hundred numbers; the rows are not read again. From the sums:
//! parameters by day ([`estimate`]), and a finding for each joint ([`finding`]).
//!
//! [`registry`] has the images that were made and those that joints run, [`roll_call`] compares it with a bus.
//!
//! [`night`] does it for a folder: in parallel, going on where it was interrupted, with the same bytes whatever the
//! number of threads.

pub mod estimate;
pub mod finding;
pub mod night;
pub mod partition;
pub mod registry;
pub mod roll_call;
pub mod stored;
pub mod sums;
pub mod windows;
