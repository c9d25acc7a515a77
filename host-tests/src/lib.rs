//! Parts that several scenarios share: friction parameters and joint states drawn from a seed, the friction model once
//! more in arithmetic too wide to overflow, images as bytes, joints in the loop: commissioned, driven, left alone; and
//! the boards' programs on emulated boards.

pub mod bare_core;
pub mod bare_metal;
pub mod borne;
pub mod certified;
pub mod commission;
pub mod control_steps;
pub mod counted_steps;
pub mod driving;
pub mod emulated;
pub mod image_bytes;
pub mod in_the_loop;
pub mod informed;
pub mod left_alone;
pub mod limits;
pub mod parameters;
pub mod peer_networks;
pub mod recordings;
pub mod samples;
pub mod states;
pub mod touched;
pub mod variant;
pub mod virtual_arm;
pub mod wide;
