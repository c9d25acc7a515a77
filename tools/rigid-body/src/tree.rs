//! Joints and links of a robot as a tree, parents first.

use crate::inertia::{LinkInertia, PARAMETERS};
use crate::placement::Placement;
use nalgebra::{Rotation3, Unit, Vector3};

/// Kind of a moving joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JointKind {
    /// Rotation about the axis; rad.
    Revolute,
    /// Translation along the axis; m.
    Prismatic,
}

/// A moving joint with the link behind it.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Name.
    pub name: String,
    /// Index of the joint before it, lower than its own; None: the base.
    pub parent: Option<usize>,
    /// Frame of the joint at position 0 in the frame of the parent's link.
    pub placement: Placement,
    /// Kind.
    pub kind: JointKind,
    /// Axis in the joint's frame.
    pub axis: Unit<Vector3<f64>>,
    /// Inertia of the link and all that is fixed to it.
    pub link: LinkInertia,
    /// Inertia that belongs to this joint alone, of its rotor: kg m^2 (or kg) on the joint's side.
    pub armature: f64,
}

impl Joint {
    /// Placement of the link in its parent at position `q`.
    pub fn at(&self, q: f64) -> Placement {
        let moved = match self.kind {
            JointKind::Revolute => {
                Placement { rotation: Rotation3::from_axis_angle(&self.axis, q), translation: Vector3::zeros() }
            }
            JointKind::Prismatic => {
                Placement { rotation: Rotation3::identity(), translation: self.axis.into_inner() * q }
            }
        };
        self.placement.then(&moved)
    }

    /// The part of a moment or a force at the joint's frame that its motor bears.
    pub fn along_axis(&self, moment: &Vector3<f64>, force: &Vector3<f64>) -> f64 {
        match self.kind {
            JointKind::Revolute => self.axis.dot(moment),
            JointKind::Prismatic => self.axis.dot(force),
        }
    }
}

/// A robot's joints.
#[derive(Clone, Debug, PartialEq)]
pub struct Tree {
    /// Joints, parents first.
    pub joints: Vec<Joint>,
    /// Gravity in the frame of the base, m/s^2.
    pub gravity: Vector3<f64>,
}

impl Tree {
    /// Number of moving joints.
    pub fn len(&self) -> usize {
        self.joints.len()
    }

    /// True without a moving joint.
    pub fn is_empty(&self) -> bool {
        self.joints.is_empty()
    }

    /// Placement of every link in the base at positions `q`.
    pub fn placements(&self, q: &[f64]) -> Vec<Placement> {
        let mut all: Vec<Placement> = Vec::with_capacity(self.len());
        for (joint, q) in self.joints.iter().zip(q) {
            let own = joint.at(*q);
            all.push(joint.parent.map_or(own, |parent| all[parent].then(&own)));
        }
        all
    }

    /// Inertial parameters of all links, ten after ten.
    pub fn parameters(&self) -> Vec<f64> {
        self.joints.iter().flat_map(|joint| joint.link.parameters()).collect()
    }

    /// The same tree with other inertial parameters (ten per link).
    #[must_use]
    pub fn with_parameters(&self, parameters: &[f64]) -> Self {
        let mut tree = self.clone();
        for (joint, own) in tree.joints.iter_mut().zip(parameters.chunks_exact(PARAMETERS)) {
            let mut all = [0.0; PARAMETERS];
            all.copy_from_slice(own);
            joint.link = LinkInertia::from_parameters(&all);
        }
        tree
    }
}
