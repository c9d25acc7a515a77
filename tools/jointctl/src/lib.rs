//! From a recorded joint to a certified parameter image: the pipeline behind the `jointctl` program.
//!
//! Data flows one way: a data set is described and loaded, cleaned, filtered and differentiated, classified and
//! split; the rigid body and the physical friction are identified, a network is trained on what is left, the better
//! model on validation data is quantised, certified and judged by the same `no_std` code that the board runs.

pub mod augment;
pub mod classify;
pub mod clean;
pub mod dataset;
pub mod differentiate;
pub mod equalise;
pub mod filter;
pub mod levenberg_marquardt;
pub mod samples;
pub mod split;
