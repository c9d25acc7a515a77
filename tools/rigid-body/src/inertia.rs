//! Inertial parameters of a link, their sums in other frames, and physical consistency.

use crate::placement::{Placement, cross};
use nalgebra::{Matrix3, Matrix4, Matrix6, SVector, Vector3};

/// Inertial parameters of one link.
pub const PARAMETERS: usize = 10;
/// Names of the parameters, in order.
pub const NAMES: [&str; PARAMETERS] = ["m", "mx", "my", "mz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz"];
/// Row and column of the six inertias, in the order of the parameters.
const ENTRIES: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];

/// Inertial parameters of a link about the origin of its frame; tau is linear in them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinkInertia {
    /// Mass, kg.
    pub mass: f64,
    /// Mass times centre of mass, kg m.
    pub first_moment: Vector3<f64>,
    /// Rotational inertia about the frame's origin, kg m^2.
    pub inertia: Matrix3<f64>,
}

impl LinkInertia {
    /// No mass at all.
    pub fn zero() -> Self {
        Self { mass: 0.0, first_moment: Vector3::zeros(), inertia: Matrix3::zeros() }
    }

    /// Mass (kg), centre of mass (m) and inertia about the centre of mass (kg m^2, along the link's axes).
    pub fn from_centre(mass: f64, centre: Vector3<f64>, about_centre: Matrix3<f64>) -> Self {
        let lever = cross(&centre);
        Self { mass, first_moment: mass * centre, inertia: about_centre - mass * lever * lever }
    }

    /// Inertia from `[m, mx, my, mz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz]`.
    pub fn from_parameters(parameters: &[f64; PARAMETERS]) -> Self {
        let mut inertia = Matrix3::zeros();
        for ((row, column), value) in ENTRIES.into_iter().zip(&parameters[4..]) {
            inertia[(row, column)] = *value;
            inertia[(column, row)] = *value;
        }
        Self { mass: parameters[0], first_moment: Vector3::from_column_slice(&parameters[1..4]), inertia }
    }

    /// `[m, mx, my, mz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz]`: kg, kg m, kg m^2.
    pub fn parameters(&self) -> [f64; PARAMETERS] {
        let mut all = [self.mass; PARAMETERS];
        all[1..4].copy_from_slice(self.first_moment.as_slice());
        all[4..].copy_from_slice(&ENTRIES.map(|entry| self.inertia[entry]));
        all
    }

    /// Centre of mass, m; the origin without mass.
    pub fn centre(&self) -> Vector3<f64> {
        if self.mass == 0.0 { Vector3::zeros() } else { self.first_moment / self.mass }
    }

    /// Rotational inertia about the centre of mass, kg m^2.
    pub fn about_centre(&self) -> Matrix3<f64> {
        let lever = cross(&self.centre());
        self.inertia + self.mass * lever * lever
    }

    /// The same body in the frame's parent.
    pub fn in_parent(&self, placement: &Placement) -> Self {
        let rotation = placement.rotation.matrix();
        let centre = placement.rotation * self.centre() + placement.translation;
        Self::from_centre(self.mass, centre, rotation * self.about_centre() * rotation.transpose())
    }

    /// Both bodies as one.
    pub fn joined(&self, other: &Self) -> Self {
        Self {
            mass: self.mass + other.mass,
            first_moment: self.first_moment + other.first_moment,
            inertia: self.inertia + other.inertia,
        }
    }

    /// 6 x 6 matrix from a motion (angular, linear) to the momentum (angular, linear) about the origin.
    pub fn spatial(&self) -> Matrix6<f64> {
        let moment = cross(&self.first_moment);
        let mut matrix = Matrix6::identity() * self.mass;
        matrix.fixed_view_mut::<3, 3>(0, 0).copy_from(&self.inertia);
        matrix.fixed_view_mut::<3, 3>(0, 3).copy_from(&moment);
        matrix.fixed_view_mut::<3, 3>(3, 0).copy_from(&moment.transpose());
        matrix
    }

    /// Moment and force about the origin that the motion takes: angular velocity and acceleration (rad/s, rad/s^2) and
    /// the acceleration of the origin less gravity (m/s^2).
    pub fn wrench(
        &self,
        angular_velocity: &Vector3<f64>,
        angular_acceleration: &Vector3<f64>,
        acceleration: &Vector3<f64>,
    ) -> (Vector3<f64>, Vector3<f64>) {
        let (w, alpha, h) = (angular_velocity, angular_acceleration, &self.first_moment);
        let moment = self.inertia * alpha + w.cross(&(self.inertia * w)) + h.cross(acceleration);
        (moment, self.mass * acceleration + alpha.cross(h) + w.cross(&w.cross(h)))
    }

    /// Pseudo-inertia: the 4 x 4 matrix of second moments of the mass; positive definite exactly for what a body of
    /// positive density can have (Wensing 2018, eq. 12 to 14).
    pub fn pseudo_inertia(&self) -> Matrix4<f64> {
        let second = Matrix3::identity() * (0.5 * self.inertia.trace()) - self.inertia;
        let mut matrix = Matrix4::zeros();
        matrix.fixed_view_mut::<3, 3>(0, 0).copy_from(&second);
        matrix.fixed_view_mut::<3, 1>(0, 3).copy_from(&self.first_moment);
        matrix.fixed_view_mut::<1, 3>(3, 0).copy_from(&self.first_moment.transpose());
        matrix[(3, 3)] = self.mass;
        matrix
    }

    /// The body of a pseudo-inertia (Wensing 2018, eq. 13).
    pub fn from_pseudo_inertia(matrix: &Matrix4<f64>) -> Self {
        let second: Matrix3<f64> = matrix.fixed_view::<3, 3>(0, 0).into();
        Self {
            mass: matrix[(3, 3)],
            first_moment: matrix.fixed_view::<3, 1>(0, 3).into(),
            inertia: Matrix3::identity() * second.trace() - second,
        }
    }

    /// True where a body of positive density can have these parameters.
    pub fn is_physical(&self) -> bool {
        self.mass > 0.0 && self.pseudo_inertia().cholesky().is_some()
    }
}

/// Wrench of a link as a linear function of its parameters: 6 x 10, moment above force. The arguments are those of
/// [`LinkInertia::wrench`].
pub fn wrench_regressor(
    angular_velocity: &Vector3<f64>,
    angular_acceleration: &Vector3<f64>,
    acceleration: &Vector3<f64>,
) -> [SVector<f64, 6>; PARAMETERS] {
    std::array::from_fn(|k| {
        let mut unit = [0.0; PARAMETERS];
        unit[k] = 1.0;
        let (moment, force) =
            LinkInertia::from_parameters(&unit).wrench(angular_velocity, angular_acceleration, acceleration);
        SVector::from([moment.x, moment.y, moment.z, force.x, force.y, force.z])
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dumbbell() -> LinkInertia {
        LinkInertia::from_centre(
            2.0,
            Vector3::new(0.1, -0.2, 0.3),
            Matrix3::from_diagonal(&Vector3::new(0.4, 0.5, 0.6)),
        )
    }

    #[test]
    fn parameters_are_read_as_they_were_written_and_the_centre_comes_back() {
        let link = dumbbell();
        assert_eq!(LinkInertia::from_parameters(&link.parameters()), link);
        assert!((link.about_centre() - Matrix3::from_diagonal(&Vector3::new(0.4, 0.5, 0.6))).norm() < 1e-14);
    }

    #[test]
    fn the_triangle_inequality_decides_what_is_physical() {
        let with = |z: f64| {
            LinkInertia::from_centre(1.0, Vector3::x(), Matrix3::from_diagonal(&Vector3::new(0.4, 0.5, z)))
                .is_physical()
        };
        assert!(with(0.89) && !with(0.91) && with(0.11) && !with(0.09));
        assert!(!LinkInertia { mass: -1.0, ..dumbbell() }.is_physical());
        assert!(!LinkInertia::zero().is_physical());
    }

    #[test]
    fn a_body_is_the_same_in_every_frame() {
        let placement = Placement::from_xyz_rpy([0.3, 0.1, -0.4], [0.4, -1.1, 2.0]);
        let (child, parent) = (dumbbell().spatial(), dumbbell().in_parent(&placement).spatial());
        let matrix = placement.motion_matrix();
        assert!((matrix.transpose() * child * matrix - parent).norm() < 1e-12);
    }
}
