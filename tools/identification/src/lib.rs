//! Identification of one joint: from its recording to a certified parameter image and a report of what it was made
//! from, what was found and how good it is. Nothing here asks, moves or waits for a joint.
//!
//! Data flows one way. A data set is described and loaded ([`dataset`]), cleaned ([`clean`]), filtered and
//! differentiated ([`filter`], [`differentiate`]), classified and split ([`classify`], [`split`]) into [`samples`]. The
//! rigid body and the physical friction are identified ([`mod@identify`], with the models of [`rigid`] and
//! [`friction_model`]), a network is trained on what is left ([`mod@train`]), and choices are made on motions that were
//! left out ([`choice`]). The model is quantised ([`quantize`]), certified, and judged by the same `no_std` code that
//! the board runs ([`joint_model`], [`mod@evaluate`]). [`mod@fit`] is the whole way; [`page`] shows it, [`image_text`]
//! and [`image_file`] are the image as files.

pub mod augment;
pub mod certificate_search;
pub mod choice;
pub mod classify;
pub mod clean;
pub mod dataset;
pub mod differentiate;
pub mod equalise;
pub mod evaluate;
pub mod filter;
pub mod fit;
pub mod friction_model;
pub mod friction_parameter;
pub mod identify;
pub mod image_file;
pub mod image_text;
pub mod joint_model;
pub mod levenberg_marquardt;
pub mod metrics;
pub mod network;
pub mod page;
pub mod pre_sliding;
pub mod presets;
pub mod progress;
pub mod quantize;
pub mod rigid;
pub mod sample_table;
pub mod samples;
pub mod split;
pub mod torque_error;
pub mod train;
