//! A robot from its two files, checked: tree, drives and the coupling between motors and joints.

use crate::articulated_body::forward_dynamics;
use crate::defect::{Defect, RobotError};
use crate::drives::{Drive, RobotDescription};
use crate::inertia::LinkInertia;
use crate::limits::{Frame, Limits};
use crate::mass_matrix::mass_matrix;
use crate::newton_euler::inverse_dynamics;
use crate::pairs::{Pair, pairs};
use crate::placement::Placement;
use crate::shape::Placed;
use crate::tree::{Joint, JointKind, Tree};
use crate::urdf::{Allowed, Link, Urdf, UrdfJoint, parse};
use nalgebra::{DMatrix, DVector, Vector3};

/// A robot.
#[derive(Clone, Debug, PartialEq)]
pub struct Robot {
    /// Name in the URDF.
    pub name: String,
    /// Joints and links; rotor inertias are not part of it.
    pub tree: Tree,
    /// Name of each joint's link.
    pub links: Vec<String>,
    /// Collision shapes of each joint's link and of all that is fixed to it, in its frame; None where a part of its
    /// mass has none.
    pub shapes: Vec<Option<Vec<Placed>>>,
    /// Drive of each joint's motor.
    pub drives: Vec<Drive>,
    /// Motor velocities = coupling * joint velocities.
    pub coupling: DMatrix<f64>,
    /// Joints that share a drive.
    pub pairs: Vec<Pair>,
    /// Limits of each joint's motion.
    pub limits: Vec<Limits>,
    /// Frames of all moving links, those that are fixed to another included.
    pub frames: Vec<Frame>,
    /// Least height of these frames above the base's origin, m; None: no floor.
    pub floor: Option<f64>,
}

impl Robot {
    /// A robot from the texts of `robot.toml` and URDF, and the names by which errors call them.
    ///
    /// # Errors
    /// The first defect, with file, joint and remedy.
    pub fn new(toml: &str, toml_file: &str, urdf: &str, urdf_file: &str) -> Result<Self, RobotError> {
        let description = describe(toml, toml_file)?;
        let urdf = parse(urdf, urdf_file)?;
        let in_toml = |defect| RobotError { file: toml_file.to_owned(), line: None, defect };
        let in_urdf = |defect| RobotError { file: urdf_file.to_owned(), line: None, defect };
        consistent(&description, &urdf).map_err(in_toml)?;
        let Moving { tree, links, shapes, limits, frames } =
            moving(&description, &urdf).map_err(|(in_drives, defect)| match in_drives {
                true => in_toml(defect),
                false => in_urdf(defect),
            })?;
        let drives: Vec<Drive> = tree.joints.iter().map(|joint| description.joint[&joint.name]).collect();
        let coupling = coupling(&description, &tree, &drives).map_err(in_toml)?;
        let pairs = pairs(&description, &tree).map_err(|defect| in_toml(defect.into()))?;
        Ok(Self {
            name: urdf.name,
            tree,
            links,
            shapes,
            drives,
            coupling,
            pairs,
            limits,
            frames,
            floor: description.floor,
        })
    }

    /// Height of each of [`Self::frames`] above the base's origin at positions `q`, against gravity (along z without
    /// gravity), m.
    pub fn heights(&self, q: &[f64]) -> Vec<f64> {
        let up = (-self.tree.gravity).try_normalize(1e-9).unwrap_or_else(Vector3::z);
        let placements = self.tree.placements(q);
        let height = |frame: &Frame| {
            let placement = &placements[frame.carrier];
            up.dot(&(placement.translation + placement.rotation * frame.origin))
        };
        self.frames.iter().map(height).collect()
    }

    /// Joint torques per unit of each motor's effort: joint torques = this * efforts.
    pub fn gains(&self) -> DMatrix<f64> {
        let gains = DVector::from_iterator(self.drives.len(), self.drives.iter().map(|drive| drive.gain));
        self.coupling.transpose() * DMatrix::from_diagonal(&gains)
    }

    /// Efforts of the motors from joint torques.
    pub fn efforts(&self, torques: &[f64]) -> Vec<f64> {
        let solved = self.gains().lu().solve(&DVector::from_row_slice(torques));
        solved.map_or_else(|| vec![f64::NAN; torques.len()], |efforts| efforts.iter().copied().collect())
    }

    /// Inertia that the rotors add to the mass matrix, from their own inertias, kg m^2.
    pub fn rotor_matrix(&self, rotors: &[f64]) -> DMatrix<f64> {
        self.coupling.transpose() * DMatrix::from_diagonal(&DVector::from_row_slice(rotors)) * &self.coupling
    }

    /// Joint torques of a motion, rotors included.
    pub fn inverse_dynamics(&self, q: &[f64], v: &[f64], a: &[f64], rotors: &[f64]) -> Vec<f64> {
        let links = inverse_dynamics(&self.tree, q, v, a);
        let rotors = self.rotor_matrix(rotors) * DVector::from_row_slice(a);
        links.iter().zip(rotors.iter()).map(|(link, rotor)| link + rotor).collect()
    }

    /// Accelerations under joint torques, friction taken off. By articulated bodies where each rotor belongs to its
    /// joint alone, else through the mass matrix. None where a joint would move without inertia.
    pub fn forward_dynamics(&self, q: &[f64], v: &[f64], torque: &[f64], rotors: &[f64]) -> Option<Vec<f64>> {
        let added = self.rotor_matrix(rotors);
        let own = DMatrix::from_diagonal(&added.diagonal());
        if (&added - own).norm() == 0.0 {
            let mut tree = self.tree.clone();
            for (joint, armature) in tree.joints.iter_mut().zip(added.diagonal().iter()) {
                joint.armature += armature;
            }
            return forward_dynamics(&tree, q, v, torque);
        }
        let bias = inverse_dynamics(&self.tree, q, v, &vec![0.0; q.len()]);
        let left = DVector::from_iterator(q.len(), torque.iter().zip(&bias).map(|(torque, bias)| torque - bias));
        let solved = (mass_matrix(&self.tree, q) + added).cholesky()?.solve(&left);
        Some(solved.iter().copied().collect())
    }
}

/// The content of `robot.toml`; `file` is named in errors.
///
/// # Errors
/// No TOML, unknown keys, or numbers beyond their range.
pub fn describe(text: &str, file: &str) -> Result<RobotDescription, RobotError> {
    let error = |defect| RobotError { file: file.to_owned(), line: None, defect };
    let description: RobotDescription =
        toml::from_str(text).map_err(|e| error(Defect::Toml { reason: e.to_string().trim_end().to_owned() }))?;
    for (joint, drive) in &description.joint {
        let not_zero = "a finite number other than 0";
        let rotor = drive.rotor_inertia.unwrap_or_default();
        let [low, high] = drive.position.unwrap_or([0.0, 1.0]);
        let (velocity, acceleration) = (drive.velocity.unwrap_or(1.0), drive.acceleration.unwrap_or(1.0));
        for (key, value, fits, expected) in [
            ("gain", drive.gain, drive.gain.is_finite() && drive.gain != 0.0, not_zero),
            ("ratio", drive.ratio, drive.ratio.is_finite() && drive.ratio != 0.0, not_zero),
            ("rotor_inertia", rotor, rotor.is_finite() && rotor >= 0.0, "a finite number, 0 or greater"),
            ("lowest position", low, low.is_finite(), "a finite number"),
            ("highest position", high, high.is_finite() && high > low, "a finite number above the lowest position"),
            ("velocity", velocity, velocity.is_finite() && velocity > 0.0, "a finite number above 0"),
            ("acceleration", acceleration, acceleration.is_finite() && acceleration > 0.0, "a finite number above 0"),
        ] {
            if !fits {
                return Err(error(Defect::Range { joint: joint.clone(), key, value, expected }));
            }
        }
    }
    for (key, values) in [("gravity", &description.gravity[..]), ("floor", description.floor.as_slice())] {
        if let Some(value) = values.iter().copied().find(|component| !component.is_finite()) {
            let joint = "base".to_owned();
            return Err(error(Defect::Range { joint, key, value, expected: "finite numbers" }));
        }
    }
    Ok(description)
}

/// Names and ratios of both files agree.
fn consistent(description: &RobotDescription, urdf: &Urdf) -> Result<(), Defect> {
    let named = |name: &String| urdf.joints.iter().find(|joint| joint.name == *name);
    let unknown = |name: &String| {
        let similar = |joint: &&UrdfJoint| {
            let (a, b) = (joint.name.to_lowercase(), name.to_lowercase());
            a.contains(&b) || b.contains(&a) || a.chars().filter(|c| b.contains(*c)).count() + 1 >= a.len()
        };
        let near = urdf.joints.iter().filter(|joint| joint.allowed != Allowed::Fixed).find(similar);
        Defect::Unknown { joint: name.clone(), near: near.map(|joint| joint.name.clone()) }
    };
    for (name, drive) in &description.joint {
        let joint = named(name).ok_or_else(|| unknown(name))?;
        if joint.allowed == Allowed::Fixed {
            return Err(Defect::DoesNotMove { joint: name.clone(), why: "it is fixed in the URDF" });
        }
        if description.locked.contains(name) {
            return Err(Defect::DoesNotMove { joint: name.clone(), why: "it is listed under `locked`" });
        }
        // A reduction of 1 is the value that generators write for none.
        if let Some(reduction) =
            joint.reduction.filter(|r| *r != 1.0 && (r.abs() - drive.ratio.abs()).abs() > 1e-6 * r.abs())
        {
            return Err(Defect::Ratio { joint: name.clone(), ratio: drive.ratio, reduction });
        }
    }
    match description.locked.iter().find(|name| named(name).is_none()) {
        Some(name) => Err(unknown(name)),
        None => Ok(()),
    }
}

/// Limits of `robot.toml`, else those of the URDF.
fn limits(drive: &Drive, joint: &UrdfJoint) -> Limits {
    Limits {
        position: drive.position.map(|[low, high]| (low, high)).or(joint.limits.position),
        velocity: drive.velocity.or(joint.limits.velocity),
        acceleration: drive.acceleration,
    }
}

/// Parts of a robot that move.
struct Moving {
    tree: Tree,
    links: Vec<String>,
    shapes: Vec<Option<Vec<Placed>>>,
    limits: Vec<Limits>,
    frames: Vec<Frame>,
}

/// Joints and links, parents first, with what is fixed to a link joined to it. An error with `true` belongs to
/// robot.toml.
fn moving(description: &RobotDescription, urdf: &Urdf) -> Result<Moving, (bool, Defect)> {
    let in_urdf = |defect| (false, defect);
    let exists = |name: &String| urdf.links.iter().any(|link| link.name == *name);
    for joint in &urdf.joints {
        if let Some(link) = [&joint.parent, &joint.child].into_iter().find(|link| !exists(link)) {
            return Err(in_urdf(Defect::NoLink { joint: joint.name.clone(), link: link.clone() }));
        }
        let same = |other: &&UrdfJoint| other.child == joint.child && other.name != joint.name;
        if let Some(other) = urdf.joints.iter().find(same) {
            let (link, first, second) = (joint.child.clone(), joint.name.clone(), other.name.clone());
            return Err(in_urdf(Defect::TwoParents { link, first, second }));
        }
    }
    let is_child = |link: &String| urdf.joints.iter().any(|joint| joint.child == *link);
    let roots: Vec<String> = urdf.links.iter().map(|link| link.name.clone()).filter(|link| !is_child(link)).collect();
    match &roots[..] {
        [] => {
            let joint = urdf.joints.first().map_or(String::new(), |joint| joint.name.clone());
            return Err(in_urdf(Defect::Ring { joint }));
        }
        [_] => {}
        _ => return Err(in_urdf(Defect::Roots { roots })),
    }
    let (joints, links, shapes, limits, frames) = (vec![], vec![], vec![], vec![], vec![]);
    let mut walk = Walk { description, urdf, joints, links, shapes, limits, frames, reached: vec![] };
    walk.behind(&roots[0], None, Placement::identity())?;
    if let Some(joint) = urdf.joints.iter().find(|joint| !walk.reached.contains(&joint.name)) {
        return Err(in_urdf(Defect::Ring { joint: joint.name.clone() }));
    }
    if walk.joints.is_empty() {
        return Err((true, Defect::NothingMoves));
    }
    for (joint, link) in walk.joints.iter().zip(&walk.links) {
        if joint.link.mass == 0.0 {
            return Err(in_urdf(Defect::Massless { link: link.clone(), joint: joint.name.clone() }));
        }
    }
    let Walk { joints, links, shapes, limits, frames, .. } = walk;
    Ok(Moving { tree: Tree { joints, gravity: Vector3::from(description.gravity) }, links, shapes, limits, frames })
}

struct Walk<'a> {
    description: &'a RobotDescription,
    urdf: &'a Urdf,
    joints: Vec<Joint>,
    links: Vec<String>,
    shapes: Vec<Option<Vec<Placed>>>,
    limits: Vec<Limits>,
    frames: Vec<Frame>,
    reached: Vec<String>,
}

impl Walk<'_> {
    /// Adds a link, which `placement` places in the link of the moving joint `carrier`, and all behind it.
    fn behind(&mut self, link: &str, carrier: Option<usize>, placement: Placement) -> Result<(), (bool, Defect)> {
        let written = self.urdf.links.iter().find(|own| own.name == link);
        let own = written.and_then(|own| own.inertia);
        if let (Some(carrier), Some(written)) = (carrier, written) {
            self.shape(carrier, written, placement);
        }
        if let Some(carrier) = carrier {
            self.frames.push(Frame { link: link.to_owned(), carrier, origin: placement.translation });
        }
        if let (Some(carrier), Some(own)) = (carrier, own) {
            let joint = &mut self.joints[carrier];
            joint.link = joint.link.joined(&own.in_parent(&placement));
        }
        for joint in self.urdf.joints.iter().filter(|joint| joint.parent == link) {
            self.reached.push(joint.name.clone());
            let frame = placement.then(&joint.placement);
            let kind = match joint.allowed {
                Allowed::Rotation => JointKind::Revolute,
                Allowed::Translation => JointKind::Prismatic,
                Allowed::Fixed => {
                    self.behind(&joint.child, carrier, frame)?;
                    continue;
                }
            };
            if self.description.locked.contains(&joint.name) {
                self.behind(&joint.child, carrier, frame)?;
                continue;
            }
            let Some(drive) = self.description.joint.get(&joint.name) else {
                return Err((true, Defect::NoDrive { joint: joint.name.clone() }));
            };
            self.limits.push(limits(drive, joint));
            self.joints.push(Joint {
                name: joint.name.clone(),
                parent: carrier,
                placement: frame,
                kind,
                axis: joint.axis,
                link: LinkInertia::zero(),
                armature: 0.0,
            });
            self.links.push(joint.child.clone());
            self.shapes.push(Some(vec![]));
            self.behind(&joint.child, Some(self.joints.len() - 1), Placement::identity())?;
        }
        Ok(())
    }

    /// Adds the shapes of a link to those of the moving joint that carries it.
    fn shape(&mut self, carrier: usize, link: &Link, placement: Placement) {
        let placed = |one: &Placed| Placed { placement: placement.then(&one.placement), shape: one.shape.clone() };
        match (&link.shapes, &mut self.shapes[carrier]) {
            (Some(own), Some(all)) if link.inertia.is_none() || !own.is_empty() => all.extend(own.iter().map(placed)),
            (_, all) if link.inertia.is_some() => *all = None,
            _ => {}
        }
    }
}

/// The matrix from joint to motor velocities.
fn coupling(description: &RobotDescription, tree: &Tree, drives: &[Drive]) -> Result<DMatrix<f64>, Defect> {
    let mut matrix = DMatrix::from_diagonal(&DVector::from_iterator(drives.len(), drives.iter().map(|d| d.ratio)));
    let Some(coupled) = &description.coupling else { return Ok(matrix) };
    let n = coupled.joints.len();
    let wrong = |reason: &str| Defect::Coupling { joints: coupled.joints.clone(), reason: reason.to_owned() };
    if n == 0 {
        return Err(wrong("it has no joints; name them, or remove [coupling]"));
    }
    if coupled.matrix.len() != n || coupled.matrix.iter().any(|row| row.len() != n) {
        return Err(wrong(&format!("matrix is not {n} x {n}; it has a row per motor and a column per joint")));
    }
    let place = |name: &String| tree.joints.iter().position(|joint| joint.name == *name);
    let mut places = Vec::new();
    for name in &coupled.joints {
        let at = match place(name) {
            Some(at) => at,
            None if description.locked.contains(name) => {
                return Err(wrong(&format!(
                    "{name} is listed under `locked` and does not move; remove one of the two"
                )));
            }
            None => return Err(Defect::Unknown { joint: name.clone(), near: None }),
        };
        if places.contains(&at) {
            return Err(wrong(&format!("{name} is there twice; each joint has one row and one column")));
        }
        if drives[at].ratio != 1.0 {
            return Err(wrong(&format!("{name} has a ratio of {} as well; leave it out", drives[at].ratio)));
        }
        places.push(at);
    }
    for (row, &i) in coupled.matrix.iter().zip(&places) {
        for (value, &j) in row.iter().zip(&places) {
            matrix[(i, j)] = *value;
        }
    }
    let part = DMatrix::from_fn(n, n, |i, j| coupled.matrix[i][j]);
    if let Some(value) = part.iter().find(|value| !value.is_finite()) {
        return Err(wrong(&format!("matrix has {value}, expected finite numbers")));
    }
    let largest = part.amax();
    if part.svd(false, false).singular_values.min() <= 1e-9 * largest {
        return Err(wrong("matrix is singular: the motors could not hold every motion of the joints; correct it"));
    }
    Ok(matrix)
}
