//! Shapes of a link's `<collision>` elements, as points whose convex hull holds them.

use crate::placement::Placement;
use nalgebra::Vector3;
use std::f64::consts::TAU;

/// Points around a cylinder, and on a meridian all the way round.
const AROUND: usize = 24;

/// A shape in its own frame, whose origin is its middle; lengths in m.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// A cuboid.
    Box {
        /// Lengths of its sides.
        size: [f64; 3],
    },
    /// A cylinder along z.
    Cylinder {
        /// Radius.
        radius: f64,
        /// Length.
        length: f64,
    },
    /// A ball.
    Sphere {
        /// Radius.
        radius: f64,
    },
    /// The surface in a file.
    Mesh {
        /// The file as written: a path, `file://` or `package://`.
        file: String,
        /// Factors of its coordinates.
        scale: [f64; 3],
    },
}

/// A shape with its place in the frame of a link.
#[derive(Clone, Debug, PartialEq)]
pub struct Placed {
    /// Placement in the link's frame.
    pub placement: Placement,
    /// The shape.
    pub shape: Shape,
}

impl Placed {
    /// Points of the shape in the link's frame, from points in its own.
    pub fn to_link(&self, points: impl IntoIterator<Item = Vector3<f64>>) -> Vec<Vector3<f64>> {
        points.into_iter().map(|point| self.placement.translation + self.placement.rotation * point).collect()
    }
}

impl Shape {
    /// Points whose convex hull holds the shape; None for a mesh, whose points are in its file.
    pub fn points(&self) -> Option<Vec<Vector3<f64>>> {
        let corner = (0.5 * TAU / AROUND as f64).cos();
        match *self {
            Self::Box { size: [x, y, z] } => {
                let signs = (0..8).map(|k| [k & 1, k >> 1 & 1, k >> 2].map(|bit| f64::from(bit) - 0.5));
                Some(signs.map(|[a, b, c]| Vector3::new(a * x, b * y, c * z)).collect())
            }
            Self::Cylinder { radius, length } => {
                let round = (0..AROUND).map(|k| (TAU * k as f64 / AROUND as f64).sin_cos());
                let ends = round.flat_map(|(sine, cosine)| [0.5, -0.5].map(|end| (sine, cosine, end)));
                let wide = radius / corner;
                Some(ends.map(|(sine, cosine, end)| Vector3::new(wide * cosine, wide * sine, end * length)).collect())
            }
            // A face of the grid of parallels and meridians is no nearer than the square of a corner's cosine.
            Self::Sphere { radius } => Some(directions().into_iter().map(|d| d * radius / (corner * corner)).collect()),
            Self::Mesh { .. } => None,
        }
    }
}

/// Unit vectors on a grid of parallels and meridians, every 15 degrees.
pub fn directions() -> Vec<Vector3<f64>> {
    let angle = |k: usize| (TAU * k as f64 / AROUND as f64).sin_cos();
    let parallels = (1..AROUND / 2).map(angle);
    let rings = parallels.flat_map(|(round, height)| {
        (0..AROUND).map(move |k| {
            let (sine, cosine) = angle(k);
            Vector3::new(round * cosine, round * sine, height)
        })
    });
    rings.chain([Vector3::z(), -Vector3::z()]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hulls_reach_as_far_as_their_shapes_in_every_direction_and_little_further() {
        let (radius, length) = (0.1, 0.4);
        let reach = |shape: &Shape, d: &Vector3<f64>| {
            shape.points().unwrap().iter().map(|point| point.dot(d)).fold(f64::NEG_INFINITY, f64::max)
        };
        for k in 0..500 {
            let (turn, height) = (0.7 * f64::from(k), f64::from(k) / 250.0 - 1.0);
            let round = (1.0 - height * height).sqrt();
            let d = Vector3::new(round * turn.cos(), round * turn.sin(), height);
            let cylinder = radius * round + 0.5 * length * height.abs();
            let cuboid = 0.5 * (0.2 * d.x.abs() + 0.4 * d.y.abs() + 0.6 * d.z.abs());
            for (shape, expected) in [
                (Shape::Sphere { radius }, radius),
                (Shape::Cylinder { radius, length }, cylinder),
                (Shape::Box { size: [0.2, 0.4, 0.6] }, cuboid),
            ] {
                let part = reach(&shape, &d) / expected;
                assert!((1.0 - 1e-9..1.02).contains(&part), "{shape:?} along {d:?}: {part}");
            }
        }
    }
}
