//! Commands for a joint and its friction: what the `jointctl` program does, over the crates that do it.
//!
//! [`commands`] reads arguments, calls a crate and writes files and a few lines of text. Beside it stands what only the
//! commands and the panel need: [`remote`] is a joint over a bus and [`commission`] the way from a new board to a
//! turning motor on it, [`describe`] tells other people's tools of a joint, [`joint_text`] is its configuration and
//! [`key_file`] its key as a file, and [`simulation`] closes the firmware's control step over a simulated actuator.
//!
//! Data flows from the crates to the commands: `identification` makes an image of a recording, `robot` those of all
//! joints of an arm, `excitation` the motions to record, `report` the pages of all of them.

pub mod commands;
pub mod commission;
pub mod describe;
pub mod joint_text;
pub mod key_file;
pub mod remote;
pub mod simulation;
