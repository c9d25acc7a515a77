//! URDF: links with their inertias and collision shapes, and joints, as far as dynamics needs them; everything else is
//! passed over.
//!
//! The elements are those of the ROS XML specification of URDF (link/inertial, link/collision, joint,
//! transmission/mechanicalReduction). Read with roxmltree, which keeps places: errors name lines, and identified
//! values are written back into the text as it was.

use crate::defect::{Defect, RobotError};
use crate::inertia::LinkInertia;
use crate::limits::Limits;
use crate::placement::Placement;
use crate::shape::{Placed, Shape};
use nalgebra::{Matrix3, Unit, Vector3};
use roxmltree::{Document, Node};
use std::collections::BTreeMap;

/// A link as written.
#[derive(Clone, Debug, PartialEq)]
pub struct Link {
    /// Name.
    pub name: String,
    /// Inertia about the link's frame; None without an `inertial` element.
    pub inertia: Option<LinkInertia>,
    /// Its `collision` elements; None where one is of an unknown shape.
    pub shapes: Option<Vec<Placed>>,
}

/// Motions that a joint allows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Allowed {
    /// No motion.
    Fixed,
    /// Rotation; `continuous` as well.
    Rotation,
    /// Translation.
    Translation,
}

/// A joint as written.
#[derive(Clone, Debug, PartialEq)]
pub struct UrdfJoint {
    /// Name.
    pub name: String,
    /// Motions that it allows.
    pub allowed: Allowed,
    /// Name of the link before it.
    pub parent: String,
    /// Name of the link behind it.
    pub child: String,
    /// Frame of the joint in the parent.
    pub placement: Placement,
    /// Axis in the joint's frame.
    pub axis: Unit<Vector3<f64>>,
    /// Reduction of its transmission; None where none is written.
    pub reduction: Option<f64>,
    /// Travel and velocity; a limit that leaves no room to move is a placeholder of generators and not stated.
    pub limits: Limits,
}

/// A whole URDF.
#[derive(Clone, Debug, PartialEq)]
pub struct Urdf {
    /// Name of the robot.
    pub name: String,
    /// Links, in the order of the file.
    pub links: Vec<Link>,
    /// Joints, in the order of the file.
    pub joints: Vec<UrdfJoint>,
}

/// Reads the text of a URDF; `file` is named in errors.
///
/// # Errors
/// No XML, missing or impossible values, links of impossible inertia, names that are twice there. Whether it is a tree
/// is checked by [`crate::Robot::new`].
pub fn parse(text: &str, file: &str) -> Result<Urdf, RobotError> {
    let error = |line: u32, defect| RobotError { file: file.to_owned(), line: Some(line), defect };
    let document = Document::parse(text).map_err(|e| error(e.pos().row, Defect::Xml { reason: e.to_string() }))?;
    let root = document.root_element();
    let reader = Reader { document: &document, file };
    if !root.has_tag_name("robot") {
        return Err(reader.error(root, Defect::Xml { reason: "the root element is not <robot>".to_owned() }));
    }
    let mut reductions = BTreeMap::new();
    for transmission in elements(root, "transmission") {
        let of = |name: &str| transmission.descendants().find(|node| node.has_tag_name(name));
        let joint = elements(transmission, "joint").next().and_then(|joint| joint.attribute("name"));
        let reduction = of("mechanicalReduction").and_then(|node| node.text()).and_then(|t| t.trim().parse().ok());
        if let (Some(joint), Some(reduction)) = (joint, reduction) {
            reductions.insert(joint.to_owned(), reduction);
        }
    }
    let mut urdf = Urdf { name: root.attribute("name").unwrap_or("robot").to_owned(), links: vec![], joints: vec![] };
    for node in elements(root, "link") {
        let link = reader.link(node)?;
        if urdf.links.iter().any(|other| other.name == link.name) {
            return Err(reader.error(node, Defect::Twice { what: "link", name: link.name }));
        }
        urdf.links.push(link);
    }
    for node in elements(root, "joint") {
        let mut joint = reader.joint(node)?;
        if urdf.joints.iter().any(|other| other.name == joint.name) {
            return Err(reader.error(node, Defect::Twice { what: "joint", name: joint.name }));
        }
        joint.reduction = reductions.get(&joint.name).copied();
        urdf.joints.push(joint);
    }
    Ok(urdf)
}

fn elements<'a>(node: Node<'a, 'a>, name: &'static str) -> impl Iterator<Item = Node<'a, 'a>> {
    node.children().filter(move |child| child.has_tag_name(name))
}

struct Reader<'a> {
    document: &'a Document<'a>,
    file: &'a str,
}

impl Reader<'_> {
    fn error(&self, node: Node, defect: Defect) -> RobotError {
        let line = self.document.text_pos_at(node.range().start).row;
        RobotError { file: self.file.to_owned(), line: Some(line), defect }
    }

    fn name(&self, node: Node, what: &'static str) -> Result<String, RobotError> {
        let name = node.attribute("name").filter(|name| !name.is_empty());
        name.map(str::to_owned).ok_or_else(|| self.missing(node, what, "name"))
    }

    fn missing(&self, node: Node, what: &'static str, value: &str) -> RobotError {
        let of = node.attribute("name").unwrap_or(what).to_owned();
        self.error(node, Defect::Missing { of, value: value.to_owned() })
    }

    /// `count` numbers of an attribute; None where it is not there.
    fn numbers<const N: usize>(&self, node: Node, attribute: &str) -> Result<Option<[f64; N]>, RobotError> {
        let Some(text) = node.attribute(attribute) else { return Ok(None) };
        let found: Vec<f64> = text.split_whitespace().map(|word| word.parse().unwrap_or(f64::NAN)).collect();
        let numbers = <[f64; N]>::try_from(found).ok().filter(|all| all.iter().all(|x| x.is_finite()));
        let wrong = Defect::NotANumber { attribute: attribute.to_owned(), text: text.to_owned(), count: N };
        numbers.map(Some).ok_or_else(|| self.error(node, wrong))
    }

    fn origin(&self, node: Node) -> Result<Placement, RobotError> {
        let Some(origin) = node.children().find(|child| child.has_tag_name("origin")) else {
            return Ok(Placement::identity());
        };
        let xyz = self.numbers(origin, "xyz")?.unwrap_or_default();
        Ok(Placement::from_xyz_rpy(xyz, self.numbers(origin, "rpy")?.unwrap_or_default()))
    }

    fn link(&self, node: Node) -> Result<Link, RobotError> {
        let name = self.name(node, "link")?;
        let shapes = elements(node, "collision").map(|collision| self.shape(collision));
        let shapes = shapes.collect::<Result<Vec<_>, _>>()?.into_iter().collect();
        let Some(inertial) = node.children().find(|child| child.has_tag_name("inertial")) else {
            return Ok(Link { name, inertia: None, shapes });
        };
        let child = |tag: &'static str| {
            let found = inertial.children().find(|child| child.has_tag_name(tag));
            found.ok_or_else(|| self.missing(node, "link", &format!("inertial/{tag}")))
        };
        let mass = child("mass")?;
        let [mass] = self.numbers(mass, "value")?.ok_or_else(|| self.missing(node, "link", "inertial/mass value"))?;
        let inertia = child("inertia")?;
        let mut entries = [0.0; 6];
        for (entry, attribute) in entries.iter_mut().zip(["ixx", "ixy", "ixz", "iyy", "iyz", "izz"]) {
            let found = self.numbers(inertia, attribute)?;
            let absent = || self.missing(node, "link", &format!("inertial/inertia {attribute}"));
            *entry = found.map(|[value]| value).ok_or_else(absent)?;
        }
        let [xx, xy, xz, yy, yz, zz] = entries;
        let about_centre = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
        let body = LinkInertia::from_centre(mass, Vector3::zeros(), about_centre).in_parent(&self.origin(inertial)?);
        if mass == 0.0 && about_centre == Matrix3::zeros() {
            return Ok(Link { name, inertia: None, shapes });
        }
        if mass < 0.0 || mass > 0.0 && !could_be(&about_centre) || mass == 0.0 {
            return Err(self.error(node, Defect::Impossible { link: name, mass, principal: principal(&about_centre) }));
        }
        Ok(Link { name, inertia: Some(body), shapes })
    }

    /// The shape of a `collision` element; None for one that is unknown.
    fn shape(&self, collision: Node) -> Result<Option<Placed>, RobotError> {
        let geometry = collision.children().find(|child| child.has_tag_name("geometry"));
        let Some(shape) = geometry.and_then(|geometry| geometry.children().find(Node::is_element)) else {
            return Ok(None);
        };
        let tag = shape.tag_name().name();
        let missing =
            |attribute: &str| self.error(shape, Defect::Missing { of: tag.to_owned(), value: attribute.to_owned() });
        let length = |attribute: &str| {
            let found = self.numbers(shape, attribute)?;
            found.map(|[value]| value).ok_or_else(|| missing(attribute))
        };
        let shape = match tag {
            "box" => Shape::Box { size: self.numbers(shape, "size")?.ok_or_else(|| missing("size"))? },
            "cylinder" => Shape::Cylinder { radius: length("radius")?, length: length("length")? },
            "sphere" => Shape::Sphere { radius: length("radius")? },
            "mesh" => Shape::Mesh {
                file: shape.attribute("filename").ok_or_else(|| missing("filename"))?.to_owned(),
                scale: self.numbers(shape, "scale")?.unwrap_or([1.0; 3]),
            },
            _ => return Ok(None),
        };
        Ok(Some(Placed { placement: self.origin(collision)?, shape }))
    }

    fn joint(&self, node: Node) -> Result<UrdfJoint, RobotError> {
        let name = self.name(node, "joint")?;
        let end = |tag: &'static str| {
            let element = node.children().find(|child| child.has_tag_name(tag));
            let link = element.and_then(|element| element.attribute("link"));
            link.map(str::to_owned).ok_or_else(|| self.missing(node, "joint", &format!("{tag} link")))
        };
        let kind = node.attribute("type").unwrap_or_default();
        let allowed = match kind {
            "fixed" => Allowed::Fixed,
            "revolute" | "continuous" => Allowed::Rotation,
            "prismatic" => Allowed::Translation,
            other => return Err(self.error(node, Defect::Kind { joint: name, kind: other.to_owned() })),
        };
        if let Some(mimic) = node.children().find(|child| child.has_tag_name("mimic")) {
            let other = mimic.attribute("joint").unwrap_or("?").to_owned();
            return Err(self.error(node, Defect::Mimic { joint: name, other }));
        }
        let axis = match node.children().find(|child| child.has_tag_name("axis")) {
            Some(axis) => Vector3::from(self.numbers(axis, "xyz")?.unwrap_or([1.0, 0.0, 0.0])),
            None => Vector3::x(),
        };
        let Some(axis) = Unit::try_new(axis, 1e-9) else {
            return Err(self.error(node, Defect::Missing { of: name, value: "axis of a length".to_owned() }));
        };
        let limits = self.limits(node, kind)?;
        Ok(UrdfJoint {
            name,
            allowed,
            parent: end("parent")?,
            child: end("child")?,
            placement: self.origin(node)?,
            axis,
            reduction: None,
            limits,
        })
    }

    /// Limits of a joint of this type; a continuous joint has no ends of travel.
    fn limits(&self, node: Node, kind: &str) -> Result<Limits, RobotError> {
        let Some(limit) = node.children().find(|child| child.has_tag_name("limit")) else {
            return Ok(Limits::default());
        };
        let number = |attribute: &str| Ok(self.numbers(limit, attribute)?.map(|[value]: [f64; 1]| value));
        let (low, high) = (number("lower")?.unwrap_or(0.0), number("upper")?.unwrap_or(0.0));
        Ok(Limits {
            position: (kind != "continuous" && low < high).then_some((low, high)),
            velocity: number("velocity")?.filter(|velocity| *velocity > 0.0),
            acceleration: None,
        })
    }
}

/// Principal inertias, ascending, kg m^2.
fn principal(about_centre: &Matrix3<f64>) -> [f64; 3] {
    let mut all: Vec<f64> = about_centre.symmetric_eigenvalues().iter().copied().collect();
    all.sort_by(f64::total_cmp);
    [all[0], all[1], all[2]]
}

/// True for an inertia that a body can have; flat bodies and rods included, with a thousandth for the rounding of
/// files.
fn could_be(about_centre: &Matrix3<f64>) -> bool {
    let [least, middle, most] = principal(about_centre);
    least >= -1e-3 * most && least + middle >= most * (1.0 - 1e-3)
}

/// Identified values of a joint and its link.
#[derive(Clone, Debug, PartialEq)]
pub struct LinkValues {
    /// The joint.
    pub joint: String,
    /// Its link.
    pub link: String,
    /// Inertia of the link with all that is fixed to it.
    pub inertia: LinkInertia,
    /// Viscous friction, Nm s/rad (N s/m).
    pub damping: f64,
    /// Coulomb friction, Nm (N).
    pub friction: f64,
}

/// The text of a URDF with these values, and everything else as it was. Links that are fixed to one of these lose
/// their own inertia: it is part of that one's.
///
/// # Errors
/// Those of [`parse`].
pub fn with_values(text: &str, file: &str, values: &[LinkValues]) -> Result<String, RobotError> {
    let urdf = parse(text, file)?;
    let error = |e: roxmltree::Error| RobotError {
        file: file.to_owned(),
        line: Some(e.pos().row),
        defect: Defect::Xml { reason: e.to_string() },
    };
    let document = Document::parse(text).map_err(error)?;
    let root = document.root_element();
    // Pieces of the text and what takes their place.
    let mut edits: Vec<(std::ops::Range<usize>, String)> = Vec::new();
    for node in elements(root, "link") {
        let name = node.attribute("name").unwrap_or_default();
        let own = values.iter().find(|values| values.link == name);
        let inertial = node.children().find(|child| child.has_tag_name("inertial"));
        match (own, inertial) {
            (Some(values), Some(inertial)) => edits.push((inertial.range(), written(&values.inertia))),
            (Some(values), None) => edits.push(inside(text, &node, &written(&values.inertia))),
            (None, Some(inertial)) if carried(&urdf, name, values) => edits.push((inertial.range(), String::new())),
            (None, _) => {}
        }
    }
    for node in elements(root, "joint") {
        let Some(values) = values.iter().find(|values| Some(values.joint.as_str()) == node.attribute("name")) else {
            continue;
        };
        let written = format!("<dynamics damping=\"{:e}\" friction=\"{:e}\"/>", values.damping, values.friction);
        match node.children().find(|child| child.has_tag_name("dynamics")) {
            Some(dynamics) => edits.push((dynamics.range(), written)),
            None => edits.push(inside(text, &node, &written)),
        }
    }
    edits.sort_by_key(|(range, _)| std::cmp::Reverse(range.start));
    let mut changed = text.to_owned();
    for (range, with) in edits {
        changed.replace_range(range, &with);
    }
    Ok(changed)
}

/// An edit that adds a child to an element, before its end.
fn inside(text: &str, node: &Node, child: &str) -> (std::ops::Range<usize>, String) {
    let range = node.range();
    let all = &text[range.clone()];
    match all.ends_with("/>") {
        true => {
            let tag = node.tag_name().name();
            (range.end - 2..range.end, format!(">{child}</{tag}>"))
        }
        false => {
            let end = range.start + all.rfind("</").unwrap_or(all.len());
            (end..end, child.to_owned())
        }
    }
}

/// True for a link that hangs on one of these links by joints that are not among `values`.
fn carried(urdf: &Urdf, link: &str, values: &[LinkValues]) -> bool {
    let mut at = link;
    while let Some(joint) = urdf.joints.iter().find(|joint| joint.child == at) {
        if values.iter().any(|values| values.joint == joint.name) {
            return true;
        }
        at = &joint.parent;
    }
    false
}

fn written(link: &LinkInertia) -> String {
    let (centre, inertia) = (link.centre(), link.about_centre());
    let entry = |row, column| inertia[(row, column)];
    format!(
        "<inertial><origin xyz=\"{:e} {:e} {:e}\" rpy=\"0 0 0\"/><mass value=\"{:e}\"/><inertia ixx=\"{:e}\" ixy=\"{:e}\" ixz=\"{:e}\" \
         iyy=\"{:e}\" iyz=\"{:e}\" izz=\"{:e}\"/></inertial>",
        centre.x,
        centre.y,
        centre.z,
        link.mass,
        entry(0, 0),
        entry(0, 1),
        entry(0, 2),
        entry(1, 1),
        entry(1, 2),
        entry(2, 2)
    )
}
