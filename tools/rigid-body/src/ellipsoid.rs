//! An ellipsoid around a body, and the room that a distribution of mass has in it.
//!
//! Mass within { x : (x - c)^T A (x - c) <= 1 } has tr(Q P) >= 0, P its pseudo-inertia and
//! Q = [-A, A c; c^T A, 1 - c^T A c] (P. Wensing, S. Kim, J.-J. Slotine, Linear Matrix Inequalities for Physically
//! Consistent Inertial Parameter Identification, 2018). The ellipsoid of least volume is found by L. Khachiyan's
//! algorithm, Rounding of Polytopes in the Real Number Model of Computation, 1996.

use crate::shape::directions;
use nalgebra::{Matrix3, Matrix4, Vector3, Vector4};

/// Relative excess of a point over the ellipsoid at which its search ends; it is widened by as much then.
const TOLERANCE: f64 = 1e-3;
/// Steps of the search at the most.
const STEPS: usize = 20_000;

/// An ellipsoid.
#[derive(Clone, Debug, PartialEq)]
pub struct Ellipsoid {
    /// Centre c, m.
    pub centre: Vector3<f64>,
    /// A, 1/m^2: symmetric and positive definite.
    pub shape: Matrix3<f64>,
}

impl Ellipsoid {
    /// An ellipsoid that holds all points and has about the least volume; None where they lie in a plane, are fewer
    /// than four, or not finite.
    pub fn around(points: &[Vector3<f64>]) -> Option<Self> {
        let extreme = extreme(points);
        let lifted: Vec<Vector4<f64>> = extreme.iter().map(|point| point.push(1.0)).collect();
        let mut weights = vec![1.0 / lifted.len().max(1) as f64; lifted.len()];
        for _ in 0..STEPS {
            let moments: Matrix4<f64> = lifted.iter().zip(&weights).map(|(q, u)| q * q.transpose() * *u).sum();
            let inverse = moments.cholesky()?.inverse();
            let excess = |q: &Vector4<f64>| q.dot(&(inverse * q));
            let (farthest, most) = lifted.iter().map(excess).enumerate().max_by(|a, b| a.1.total_cmp(&b.1))?;
            if most <= 4.0 * (1.0 + TOLERANCE) {
                break;
            }
            let step = (most - 4.0) / (4.0 * (most - 1.0));
            weights.iter_mut().for_each(|weight| *weight *= 1.0 - step);
            weights[farthest] += step;
        }
        let centre: Vector3<f64> = extreme.iter().zip(&weights).map(|(point, u)| point * *u).sum();
        let away = |point: &Vector3<f64>| point - centre;
        let spread: Matrix3<f64> =
            extreme.iter().zip(&weights).map(|(point, u)| away(point) * away(point).transpose() * *u).sum();
        let shape = (3.0 * spread).cholesky()?.inverse();
        let farthest = points.iter().map(|point| away(point).dot(&(shape * away(point)))).fold(0.0, f64::max);
        (farthest.is_finite() && farthest > 0.0).then(|| Self { centre, shape: shape / farthest })
    }

    /// Q.
    pub fn matrix(&self) -> Matrix4<f64> {
        let across = self.shape * self.centre;
        let mut matrix = Matrix4::zeros();
        matrix.fixed_view_mut::<3, 3>(0, 0).copy_from(&-self.shape);
        matrix.fixed_view_mut::<3, 1>(0, 3).copy_from(&across);
        matrix.fixed_view_mut::<1, 3>(3, 0).copy_from(&across.transpose());
        matrix[(3, 3)] = 1.0 - self.centre.dot(&across);
        matrix
    }

    /// tr(Q P), kg: the mass where all of it is at the centre, two fifths of it where it fills the ellipsoid evenly, 0
    /// where it lies on the surface, below 0 where a part is outside for certain.
    pub fn room(&self, pseudo_inertia: &Matrix4<f64>) -> f64 {
        (self.matrix() * pseudo_inertia).trace()
    }
}

/// The points that lie farthest in some direction: a mesh has a hundred thousand, most of them within the others.
fn extreme(points: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let farthest = |direction: &Vector3<f64>| {
        (0..points.len()).max_by(|&a, &b| points[a].dot(direction).total_cmp(&points[b].dot(direction)))
    };
    let mut found: Vec<usize> = directions().iter().filter_map(farthest).collect();
    found.sort_unstable();
    found.dedup();
    found.into_iter().map(|at| points[at]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inertia::LinkInertia;
    use crate::shape::Shape;

    fn around(shape: Shape, centre: Vector3<f64>) -> Ellipsoid {
        let points: Vec<Vector3<f64>> = shape.points().unwrap().into_iter().map(|point| point + centre).collect();
        Ellipsoid::around(&points).unwrap()
    }

    #[test]
    fn a_box_has_the_ellipsoid_of_least_volume_through_its_corners() {
        let centre = Vector3::new(0.3, -0.2, 0.1);
        let found = around(Shape::Box { size: [0.2, 0.4, 0.6] }, centre);
        assert!((found.centre - centre).norm() < 1e-3, "{found:?}");
        // Half axes are those of the box times the root of three.
        for (axis, half) in [0.1f64, 0.2, 0.3].into_iter().enumerate() {
            let expected = 1.0 / (3.0 * half * half);
            assert!((found.shape[(axis, axis)] / expected - 1.0).abs() < 5e-3, "{found:?}");
        }
    }

    #[test]
    fn spheres_and_cylinders_are_held_and_not_much_widened() {
        let ball = around(Shape::Sphere { radius: 0.1 }, Vector3::x());
        let rod = around(Shape::Cylinder { radius: 0.1, length: 0.4 }, Vector3::y());
        for k in 0..500 {
            let (turn, height) = (0.7 * k as f64, (k as f64 / 250.0) - 1.0);
            let round = (1.0 - height * height).sqrt();
            let on_ball = 0.1 * Vector3::new(round * turn.cos(), round * turn.sin(), height);
            let on_rod = Vector3::new(0.1 * turn.cos(), 0.1 * turn.sin(), 0.2 * height.signum());
            assert!(on_ball.dot(&(ball.shape * on_ball)) <= 1.0 + 1e-9, "{ball:?}");
            assert!(
                (on_rod + Vector3::y() - rod.centre).dot(&(rod.shape * (on_rod + Vector3::y() - rod.centre))) < 1.0
            );
        }
        assert!((ball.shape[(0, 0)].powf(-0.5) / 0.1 - 1.0).abs() < 0.03, "{ball:?}");
        // Half axes of the least one: r sqrt(3/2), and sqrt(3) times half of the length.
        assert!((rod.shape[(0, 0)].powf(-0.5) / (0.1 * 1.5f64.sqrt()) - 1.0).abs() < 0.03, "{rod:?}");
        assert!((rod.shape[(2, 2)].powf(-0.5) / (0.2 * 3f64.sqrt()) - 1.0).abs() < 0.03, "{rod:?}");
    }

    #[test]
    fn all_points_of_an_irregular_cloud_are_held_and_some_lie_on_the_surface() {
        for seed in 1..20 {
            let at = |k: u32| (1e4 * f64::from(k + 1_000 * seed).sin()).fract();
            let points: Vec<_> = (1..60).map(|k| Vector3::new(at(3 * k), 2.0 * at(3 * k + 1), at(3 * k + 2))).collect();
            let Ellipsoid { centre, shape } = Ellipsoid::around(&points).unwrap();
            let farthest = points.iter().map(|p| (p - centre).dot(&(shape * (p - centre)))).fold(0.0, f64::max);
            assert!((farthest - 1.0).abs() < 1e-9, "{seed}: {farthest}");
        }
    }

    #[test]
    fn room_is_that_of_points_at_the_centre_within_and_just_outside() {
        let centre = Vector3::new(0.3, -0.2, 0.1);
        let found = around(Shape::Box { size: [0.2, 0.4, 0.6] }, centre);
        let surface = Vector3::x() / found.shape[(0, 0)].sqrt();
        let room = |at: Vector3<f64>| {
            let point = LinkInertia::from_centre(2.0, found.centre + at, Matrix3::zeros());
            found.room(&point.pseudo_inertia())
        };
        assert!((room(Vector3::zeros()) - 2.0).abs() < 1e-9);
        assert!(room(0.999 * surface) > 0.0 && room(1.001 * surface) < 0.0);
    }

    #[test]
    fn points_in_a_plane_have_none_nor_do_few_or_numbers_that_are_none() {
        let flat = Shape::Box { size: [0.2, 0.4, 0.0] }.points().unwrap();
        assert_eq!(Ellipsoid::around(&flat), None);
        assert_eq!(Ellipsoid::around(&flat[..2]), None);
        assert_eq!(Ellipsoid::around(&[]), None);
        let mut wrong = Shape::Box { size: [0.2, 0.4, 0.1] }.points().unwrap();
        wrong[0].x = f64::NAN;
        assert_eq!(Ellipsoid::around(&wrong), None);
    }
}
