//! Mass matrix by composite rigid bodies (Featherstone 2008, table 6.2).

use crate::tree::{Joint, JointKind, Tree};
use nalgebra::{DMatrix, Vector6};

/// Motion of the link, angular above linear, for a unit velocity of its joint.
pub fn motion_subspace(joint: &Joint) -> Vector6<f64> {
    let axis = joint.axis;
    match joint.kind {
        JointKind::Revolute => Vector6::new(axis.x, axis.y, axis.z, 0.0, 0.0, 0.0),
        JointKind::Prismatic => Vector6::new(0.0, 0.0, 0.0, axis.x, axis.y, axis.z),
    }
}

/// M(q), n x n, kg m^2 (kg, kg m where prismatic joints take part), armature included.
pub fn mass_matrix(tree: &Tree, q: &[f64]) -> DMatrix<f64> {
    let n = tree.len();
    let transforms: Vec<_> = tree.joints.iter().zip(q).map(|(joint, q)| joint.at(*q).motion_matrix()).collect();
    let mut composite: Vec<_> = tree.joints.iter().map(|joint| joint.link.spatial()).collect();
    let mut matrix = DMatrix::zeros(n, n);
    for (i, joint) in tree.joints.iter().enumerate().rev() {
        if let Some(parent) = joint.parent {
            let moved = transforms[i].transpose() * composite[i] * transforms[i];
            composite[parent] += moved;
        }
        let subspace = motion_subspace(joint);
        let mut force = composite[i] * subspace;
        matrix[(i, i)] = subspace.dot(&force) + joint.armature;
        let mut at = i;
        while let Some(parent) = tree.joints[at].parent {
            force = transforms[at].transpose() * force;
            at = parent;
            let entry = motion_subspace(&tree.joints[at]).dot(&force);
            matrix[(i, at)] = entry;
            matrix[(at, i)] = entry;
        }
    }
    matrix
}
