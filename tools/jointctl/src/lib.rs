//! From a recorded joint to a certified parameter image: the pipeline behind the `jointctl` program.
//!
//! Data flows one way: a data set is described and loaded, cleaned, filtered and differentiated, classified and
//! split; the rigid body and the physical friction are identified, a network is trained on what is left, the better
//! model on validation data is quantised, certified and judged by the same `no_std` code that the board runs.
//!
//! Beside it, [`simulation`] closes the firmware's control step over a simulated actuator, and [`joint_text`] is a
//! joint's configuration as a file. [`remote`] is a joint over a bus, [`describe`] tells other people's tools of it.
//! [`robot`] identifies all joints of an arm at once and hands each to this pipeline.

pub mod augment;
pub mod certificate_search;
pub mod choice;
pub mod classify;
pub mod clean;
pub mod commands;
pub mod commission;
pub mod dataset;
pub mod describe;
pub mod differentiate;
pub mod equalise;
pub mod evaluate;
pub mod filter;
pub mod fit;
pub mod friction_model;
pub mod friction_parameter;
pub mod identify;
pub mod image_text;
pub mod joint_model;
pub mod joint_text;
pub mod key_file;
pub mod levenberg_marquardt;
pub mod metrics;
pub mod network;
pub mod page;
pub mod pre_sliding;
pub mod presets;
pub mod progress;
pub mod quantize;
pub mod remote;
pub mod rigid;
pub mod robot;
pub mod sample_table;
pub mod samples;
pub mod simulation;
pub mod split;
pub mod torque_error;
pub mod train;
