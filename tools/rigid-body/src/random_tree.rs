//! Random robots and states, from a seed: what laws are tested on.

use crate::inertia::LinkInertia;
use crate::placement::Placement;
use crate::tree::{Joint, JointKind, Tree};
use nalgebra::{Matrix3, Rotation3, Unit, Vector3};
use rand::{Rng, RngExt};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use std::fmt::Write;

/// Shape of a random robot.
#[derive(Clone, Copy, Debug)]
pub struct Shape {
    /// Moving joints.
    pub joints: usize,
    /// Joints may have any earlier one as parent; false: one chain.
    pub branches: bool,
    /// Part of the joints that are prismatic, 0 to 1.
    pub prismatic: f64,
    /// Rotor inertias, 0 to 0.1 kg m^2 on the joint's side.
    pub armature: bool,
}

/// A robot with physical links of 0.2 to 5 kg, some 0.3 m from joint to joint.
pub fn tree(shape: Shape, seed: u64) -> Tree {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let joints = (0..shape.joints).map(|i| {
        let parent = match i {
            0 => None,
            i if shape.branches => Some(random.random_range(0..i)),
            i => Some(i - 1),
        };
        let prismatic = random.random_range(0.0..1.0) < shape.prismatic;
        Joint {
            name: format!("joint_{i}"),
            parent,
            placement: placement(&mut random),
            kind: if prismatic { JointKind::Prismatic } else { JointKind::Revolute },
            axis: Unit::new_normalize(vector(&mut random, 1.0) + Vector3::new(0.0, 0.0, 1.5)),
            link: link(&mut random),
            armature: if shape.armature { random.random_range(0.0..0.1) } else { 0.0 },
        }
    });
    Tree { joints: joints.collect(), gravity: Vector3::new(0.0, 0.0, -9.81) }
}

/// Positions (rad or m), velocities and accelerations of every joint, within 2, 2 and 5 of their units.
pub fn state(joints: usize, seed: u64) -> [Vec<f64>; 3] {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    [2.0, 2.0, 5.0].map(|limit: f64| (0..joints).map(|_| random.random_range(-limit..limit)).collect())
}

/// The tree as a URDF, with `<limit>` elements of these ends of travel (rad or m) and this velocity (rad/s or m/s); its
/// links are `link_0`, `link_1` and so on, behind `base`.
pub fn urdf(tree: &Tree, (low, high): (f64, f64), velocity: f64) -> String {
    let mut text = "<robot name='random'><link name='base'/>\n".to_owned();
    for (i, joint) in tree.joints.iter().enumerate() {
        let parent = joint.parent.map_or("base".to_owned(), |parent| format!("link_{parent}"));
        let (roll, pitch, yaw) = joint.placement.rotation.euler_angles();
        let (at, axis) = (joint.placement.translation, joint.axis);
        let kind = if joint.kind == JointKind::Revolute { "revolute" } else { "prismatic" };
        let (centre, inertia) = (joint.link.centre(), joint.link.about_centre());
        let entry = |row: usize, column: usize| inertia[(row, column)];
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "<joint name='{}' type='{kind}'><parent link='{parent}'/><child link='link_{i}'/>\
             <origin xyz='{:e} {:e} {:e}' rpy='{roll:e} {pitch:e} {yaw:e}'/><axis xyz='{:e} {:e} {:e}'/>\
             <limit lower='{low}' upper='{high}' effort='1' velocity='{velocity}'/></joint>\n\
             <link name='link_{i}'><inertial><origin xyz='{:e} {:e} {:e}'/><mass value='{:e}'/>\
             <inertia ixx='{:e}' ixy='{:e}' ixz='{:e}' iyy='{:e}' iyz='{:e}' izz='{:e}'/></inertial></link>",
            joint.name,
            at.x,
            at.y,
            at.z,
            axis.x,
            axis.y,
            axis.z,
            centre.x,
            centre.y,
            centre.z,
            joint.link.mass,
            entry(0, 0),
            entry(0, 1),
            entry(0, 2),
            entry(1, 1),
            entry(1, 2),
            entry(2, 2)
        );
    }
    text + "</robot>"
}

/// A body of four to eight points and a ball: always physical.
fn link(random: &mut impl Rng) -> LinkInertia {
    let ball = random.random_range(0.1..1.0);
    let mut link = LinkInertia::from_centre(ball, vector(random, 0.1), Matrix3::identity() * (0.002 * ball));
    for _ in 0..random.random_range(4..8) {
        let point = LinkInertia::from_centre(random.random_range(0.05..0.5), vector(random, 0.2), Matrix3::zeros());
        link = link.joined(&point);
    }
    link
}

fn placement(random: &mut impl Rng) -> Placement {
    let [roll, pitch, yaw]: [f64; 3] = std::array::from_fn(|_| random.random_range(-3.0..3.0));
    Placement { rotation: Rotation3::from_euler_angles(roll, pitch, yaw), translation: vector(random, 0.3) }
}

fn vector(random: &mut impl Rng, limit: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| random.random_range(-limit..limit))
}
