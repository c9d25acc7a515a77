//! Forward dynamics by articulated bodies (Featherstone 2008, table 7.1): accelerations from torques in a time
//! proportional to the number of joints.

use crate::mass_matrix::motion_subspace;
use crate::placement::cross;
use crate::tree::Tree;
use nalgebra::{Matrix6, Vector3, Vector6};

/// Accelerations (rad/s^2 or m/s^2) at positions `q` and velocities `v` under joint torques `torque`, which friction
/// is already taken off. None where a joint would move without inertia.
pub fn forward_dynamics(tree: &Tree, q: &[f64], v: &[f64], torque: &[f64]) -> Option<Vec<f64>> {
    let n = tree.len();
    let transforms: Vec<_> = tree.joints.iter().zip(q).map(|(joint, q)| joint.at(*q).motion_matrix()).collect();
    let subspaces: Vec<_> = tree.joints.iter().map(motion_subspace).collect();
    let mut velocities: Vec<Vector6<f64>> = Vec::with_capacity(n);
    let mut biases: Vec<Vector6<f64>> = Vec::with_capacity(n);
    let mut bodies: Vec<Matrix6<f64>> = Vec::with_capacity(n);
    let mut forces: Vec<Vector6<f64>> = Vec::with_capacity(n);
    for (i, joint) in tree.joints.iter().enumerate() {
        let own = subspaces[i] * v[i];
        let velocity = joint.parent.map_or(own, |parent| transforms[i] * velocities[parent] + own);
        let inertia = joint.link.spatial();
        biases.push(cross_motion(&velocity) * own);
        forces.push(-cross_motion(&velocity).transpose() * (inertia * velocity));
        velocities.push(velocity);
        bodies.push(inertia);
    }
    let mut along: Vec<(Vector6<f64>, f64, f64)> = vec![(Vector6::zeros(), 0.0, 0.0); n];
    for (i, joint) in tree.joints.iter().enumerate().rev() {
        let force = bodies[i] * subspaces[i];
        let inertia = subspaces[i].dot(&force) + joint.armature;
        if inertia.is_nan() || inertia <= 0.0 {
            return None;
        }
        let left = torque[i] - subspaces[i].dot(&forces[i]);
        along[i] = (force, inertia, left);
        if let Some(parent) = joint.parent {
            let articulated = bodies[i] - force * force.transpose() / inertia;
            let moved = forces[i] + articulated * biases[i] + force * (left / inertia);
            bodies[parent] += transforms[i].transpose() * articulated * transforms[i];
            forces[parent] += transforms[i].transpose() * moved;
        }
    }
    let up = -tree.gravity;
    let base = Vector6::new(0.0, 0.0, 0.0, up.x, up.y, up.z);
    let mut accelerations: Vec<Vector6<f64>> = Vec::with_capacity(n);
    let mut result = Vec::with_capacity(n);
    for (i, joint) in tree.joints.iter().enumerate() {
        let before = joint.parent.map_or(base, |parent| accelerations[parent]);
        let acceleration = transforms[i] * before + biases[i];
        let (force, inertia, left) = &along[i];
        let own = (left - force.dot(&acceleration)) / inertia;
        accelerations.push(acceleration + subspaces[i] * own);
        result.push(own);
    }
    Some(result)
}

/// The matrix of the cross product of motions; less its transpose is that of motion and force.
fn cross_motion(motion: &Vector6<f64>) -> Matrix6<f64> {
    let angular = cross(&Vector3::new(motion[0], motion[1], motion[2]));
    let linear = cross(&Vector3::new(motion[3], motion[4], motion[5]));
    let mut matrix = Matrix6::zeros();
    matrix.fixed_view_mut::<3, 3>(0, 0).copy_from(&angular);
    matrix.fixed_view_mut::<3, 3>(3, 3).copy_from(&angular);
    matrix.fixed_view_mut::<3, 3>(3, 0).copy_from(&linear);
    matrix
}
