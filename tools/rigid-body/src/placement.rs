//! Placement of one frame in another, and how motions and forces change with it.

use nalgebra::{Matrix3, Matrix6, Rotation3, Vector3};

/// Placement of a child frame in its parent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Rotation from child coordinates to parent coordinates.
    pub rotation: Rotation3<f64>,
    /// Origin of the child in parent coordinates, m.
    pub translation: Vector3<f64>,
}

impl Placement {
    /// The child is the parent.
    pub fn identity() -> Self {
        Self { rotation: Rotation3::identity(), translation: Vector3::zeros() }
    }

    /// `xyz` (m) and `rpy` (rad) of a URDF: rotations about the fixed axes x, then y, then z.
    pub fn from_xyz_rpy(xyz: [f64; 3], [roll, pitch, yaw]: [f64; 3]) -> Self {
        Self { rotation: Rotation3::from_euler_angles(roll, pitch, yaw), translation: Vector3::from(xyz) }
    }

    /// Placement in the grandparent of a frame whose placement in `self`'s child is `inner`.
    pub fn then(&self, inner: &Self) -> Self {
        Self {
            rotation: self.rotation * inner.rotation,
            translation: self.translation + self.rotation * inner.translation,
        }
    }

    /// 6 x 6 matrix from a motion (angular, linear) in the parent to the same in the child; its transpose takes forces
    /// back.
    pub fn motion_matrix(&self) -> Matrix6<f64> {
        let back = self.rotation.inverse().into_inner();
        let mut matrix = Matrix6::zeros();
        matrix.fixed_view_mut::<3, 3>(0, 0).copy_from(&back);
        matrix.fixed_view_mut::<3, 3>(3, 3).copy_from(&back);
        matrix.fixed_view_mut::<3, 3>(3, 0).copy_from(&(-back * cross(&self.translation)));
        matrix
    }

    /// Moment and force in the parent of a moment and a force in the child.
    pub fn wrench_to_parent(&self, moment: &Vector3<f64>, force: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
        let force = self.rotation * force;
        (self.rotation * moment + self.translation.cross(&force), force)
    }
}

/// The matrix of the cross product: `cross(a) * b` is `a x b`.
pub fn cross(vector: &Vector3<f64>) -> Matrix3<f64> {
    vector.cross_matrix()
}
