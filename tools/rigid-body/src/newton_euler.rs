//! Recursive Newton-Euler: joint torques from a motion; and the motion of every link, which the regressor needs, too.
//!
//! Accelerations are those of the frames' origins (not spatial ones), less gravity: the base is accelerated upwards
//! instead of every link being pulled down (Featherstone 2008, section 5.3).

use crate::placement::Placement;
use crate::tree::{JointKind, Tree};
use nalgebra::Vector3;

/// Motion of a link in its own frame.
#[derive(Clone, Copy, Debug)]
pub struct LinkMotion {
    /// Placement in the parent.
    pub placement: Placement,
    /// Angular velocity, rad/s.
    pub angular_velocity: Vector3<f64>,
    /// Angular acceleration, rad/s^2.
    pub angular_acceleration: Vector3<f64>,
    /// Acceleration of the origin less gravity, m/s^2.
    pub acceleration: Vector3<f64>,
}

/// The motion of all links at positions `q`, velocities `v` and accelerations `a`, one of each per joint.
pub fn link_motions(tree: &Tree, q: &[f64], v: &[f64], a: &[f64]) -> Vec<LinkMotion> {
    let mut motions: Vec<LinkMotion> = Vec::with_capacity(tree.len());
    for (i, joint) in tree.joints.iter().enumerate() {
        let placement = joint.at(q[i]);
        let zero = Vector3::zeros();
        let (w, alpha, acceleration) = match joint.parent {
            Some(parent) => {
                let parent = &motions[parent];
                (parent.angular_velocity, parent.angular_acceleration, parent.acceleration)
            }
            None => (zero, zero, -tree.gravity),
        };
        let r = placement.translation;
        let back = placement.rotation.inverse();
        let origin = back * (acceleration + alpha.cross(&r) + w.cross(&w.cross(&r)));
        let (w, alpha) = (back * w, back * alpha);
        let axis = joint.axis.into_inner();
        motions.push(match joint.kind {
            JointKind::Revolute => LinkMotion {
                placement,
                angular_velocity: w + axis * v[i],
                angular_acceleration: alpha + axis * a[i] + w.cross(&axis) * v[i],
                acceleration: origin,
            },
            JointKind::Prismatic => LinkMotion {
                placement,
                angular_velocity: w,
                angular_acceleration: alpha,
                acceleration: origin + axis * a[i] + 2.0 * w.cross(&axis) * v[i],
            },
        });
    }
    motions
}

/// Joint torques (Nm, or N of prismatic joints) of the motion, armature included; friction is not part of it.
pub fn inverse_dynamics(tree: &Tree, q: &[f64], v: &[f64], a: &[f64]) -> Vec<f64> {
    let motions = link_motions(tree, q, v, a);
    let mut wrenches: Vec<(Vector3<f64>, Vector3<f64>)> = (tree.joints.iter().zip(&motions))
        .map(|(joint, m)| joint.link.wrench(&m.angular_velocity, &m.angular_acceleration, &m.acceleration))
        .collect();
    let mut torques = vec![0.0; tree.len()];
    for (i, joint) in tree.joints.iter().enumerate().rev() {
        let (moment, force) = wrenches[i];
        torques[i] = joint.along_axis(&moment, &force) + joint.armature * a[i];
        if let Some(parent) = joint.parent {
            let (moment, force) = motions[i].placement.wrench_to_parent(&moment, &force);
            wrenches[parent].0 += moment;
            wrenches[parent].1 += force;
        }
    }
    torques
}
