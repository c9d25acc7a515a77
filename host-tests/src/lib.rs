//! What several scenarios share: friction parameters and joint states drawn from a seed, the friction model once more in
//! arithmetic too wide to overflow, images as bytes, joints in the loop: commissioned, driven, left alone; and the boards' programs on emulated boards.

pub mod bare_metal;
pub mod commission;
pub mod driving;
pub mod emulated;
pub mod image_bytes;
pub mod in_the_loop;
pub mod informed;
pub mod left_alone;
pub mod parameters;
pub mod states;
pub mod variant;
pub mod wide;
