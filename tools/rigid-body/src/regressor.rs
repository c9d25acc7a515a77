//! Joint torques as a linear function of the inertial parameters: tau = Y(q, v, a) phi.

use crate::inertia::{PARAMETERS, wrench_regressor};
use crate::newton_euler::link_motions;
use crate::tree::Tree;
use nalgebra::{DMatrix, Vector3};

/// Y: one row per joint, ten columns per link ([`crate::inertia::NAMES`]); armature is no part of it.
pub fn regressor(tree: &Tree, q: &[f64], v: &[f64], a: &[f64]) -> DMatrix<f64> {
    let motions = link_motions(tree, q, v, a);
    let mut matrix = DMatrix::zeros(tree.len(), PARAMETERS * tree.len());
    for (i, motion) in motions.iter().enumerate() {
        let columns = wrench_regressor(&motion.angular_velocity, &motion.angular_acceleration, &motion.acceleration);
        for (k, wrench) in columns.iter().enumerate() {
            let mut moment: Vector3<f64> = wrench.fixed_rows::<3>(0).into();
            let mut force: Vector3<f64> = wrench.fixed_rows::<3>(3).into();
            let mut joint = Some(i);
            while let Some(j) = joint {
                matrix[(j, PARAMETERS * i + k)] = tree.joints[j].along_axis(&moment, &force);
                (moment, force) = motions[j].placement.wrench_to_parent(&moment, &force);
                joint = tree.joints[j].parent;
            }
        }
    }
    matrix
}
