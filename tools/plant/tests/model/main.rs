//! Parts of a plant and what drives it: friction, arms, motions, random joints, their files. One program, as each links
//! the plant anew.

mod arm;
mod excitation;
mod files;
mod friction;
mod friction_shape;
mod motion;
mod randomised;
mod refusals;
mod transmission;
mod virtual_joint;
