//! Defects of a robot's files: URDF and `robot.toml`.

use crate::pairs::PairDefect;

/// A defect of a robot's files.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{file}{}: {defect}", line.map_or(String::new(), |line| format!(":{line}")))]
pub struct RobotError {
    /// The file.
    pub file: String,
    /// The line, from 1; None where the whole file is meant.
    pub line: Option<u32>,
    /// The defect, its place and the remedy.
    pub defect: Defect,
}

/// Kinds of defects.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Defect {
    /// No XML, or no robot.
    #[error("no URDF: {reason}")]
    Xml {
        /// Reason.
        reason: String,
    },
    /// No TOML, or unknown keys.
    #[error("{reason}")]
    Toml {
        /// Reason.
        reason: String,
    },
    /// An element or attribute is not there.
    #[error("{of} has no {value}; add it")]
    Missing {
        /// Link or joint.
        of: String,
        /// The element or attribute.
        value: String,
    },
    /// An attribute does not hold its numbers.
    #[error("{attribute} is {text:?}, expected {count} finite numbers; xacro files are to be expanded first")]
    NotANumber {
        /// The attribute.
        attribute: String,
        /// Its text.
        text: String,
        /// Expected numbers.
        count: usize,
    },
    /// Two links or joints of one name.
    #[error("{what} {name} is there twice; rename one of them")]
    Twice {
        /// "link" or "joint".
        what: &'static str,
        /// The name.
        name: String,
    },
    /// An inertia that no body has.
    #[error(
        "link {link}: no body has a mass of {mass} kg with principal inertias of {:e}, {:e} and {:e} kg m^2: the mass is to be above 0, \
         each inertia at least 0 and at most the sum of the other two; check units, signs and ixx to izz", principal[0], principal[1], principal[2]
    )]
    Impossible {
        /// The link.
        link: String,
        /// Its mass, kg.
        mass: f64,
        /// Its principal inertias, kg m^2.
        principal: [f64; 3],
    },
    /// A joint of an unknown kind.
    #[error("joint {joint} is of type {kind:?}; known are revolute, continuous, prismatic and fixed")]
    Kind {
        /// The joint.
        joint: String,
        /// Its type.
        kind: String,
    },
    /// A joint that follows another.
    #[error("joint {joint} mimics {other}; make it fixed, or list it under `locked` in robot.toml without <mimic>")]
    Mimic {
        /// The joint.
        joint: String,
        /// The other.
        other: String,
    },
    /// A joint refers to a link that is not there.
    #[error("joint {joint}: there is no link {link}; check parent and child")]
    NoLink {
        /// The joint.
        joint: String,
        /// The link.
        link: String,
    },
    /// A link has two parents.
    #[error(
        "link {link} is the child of joint {first} and of joint {second}: this is no tree; closed chains are not supported, cut one of them"
    )]
    TwoParents {
        /// The link.
        link: String,
        /// One joint.
        first: String,
        /// The other.
        second: String,
    },
    /// Number of links without a parent that is not one.
    #[error("{} are no child of any joint: a tree has one base; join them by fixed joints", roots.join(", "))]
    Roots {
        /// Links without a parent.
        roots: Vec<String>,
    },
    /// Links that the base does not lead to.
    #[error("joint {joint} is part of a ring of joints that no base leads to: this is no tree; correct its parent")]
    Ring {
        /// A joint of the ring.
        joint: String,
    },
    /// A link that moves without mass.
    #[error(
        "link {link} moves with joint {joint} and has no mass, nor has anything that is fixed to it; give it an <inertial>"
    )]
    Massless {
        /// The link.
        link: String,
        /// Its joint.
        joint: String,
    },
    /// A joint without a drive.
    #[error(
        "joint {joint} of the URDF moves and has no [joint.{joint}]; describe its drive, or list it under `locked`"
    )]
    NoDrive {
        /// The joint.
        joint: String,
    },
    /// A drive without a joint.
    #[error("joint {joint} is not in the URDF{}", near.as_ref().map_or(String::new(), |near| format!("; {near} is meant, perhaps")))]
    Unknown {
        /// The name.
        joint: String,
        /// A similar one.
        near: Option<String>,
    },
    /// A drive of a joint that does not move.
    #[error("joint {joint} has a drive, but {why}; remove one of the two")]
    DoesNotMove {
        /// The joint.
        joint: String,
        /// Reason for which it does not move.
        why: &'static str,
    },
    /// A number beyond its range.
    #[error("joint {joint}: {key} is {value}, expected {expected}")]
    Range {
        /// The joint.
        joint: String,
        /// The key.
        key: &'static str,
        /// Its value.
        value: f64,
        /// Values that it may have.
        expected: &'static str,
    },
    /// Two files with two ratios.
    #[error("joint {joint}: ratio is {ratio}, the URDF's mechanicalReduction {reduction}; make them agree")]
    Ratio {
        /// The joint.
        joint: String,
        /// Ratio of robot.toml.
        ratio: f64,
        /// Ratio of the URDF.
        reduction: f64,
    },
    /// A coupling that is no square matrix, or singular.
    #[error("coupling of {}: {reason}", joints.join(", "))]
    Coupling {
        /// Its joints.
        joints: Vec<String>,
        /// Reason for which it cannot be used.
        reason: String,
    },
    /// Two joints that cannot share a drive.
    #[error(transparent)]
    Pair(#[from] PairDefect),
    /// No joint moves.
    #[error("no joint moves; describe at least one drive")]
    NothingMoves,
}
