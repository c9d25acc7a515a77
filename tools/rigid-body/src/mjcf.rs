//! A robot as MJCF, MuJoCo's model: bodies, joints with armature, damping and frictionloss (MuJoCo documentation, XML
//! reference, elements `body`, `inertial` and `joint`).

use crate::limits::Limits;
use crate::tree::{Joint, JointKind, Tree};
use nalgebra::UnitQuaternion;
use std::fmt::Write;

/// Friction of a joint as MJCF has it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JointFriction {
    /// Viscous friction, Nm s/rad or N s/m.
    pub damping: f64,
    /// Coulomb friction, Nm or N.
    pub frictionloss: f64,
}

/// The robot with the friction and the travel of each joint; `remark` stands at the top, and `names` are those of the
/// links. Bodies have the frames of their joints, so that positions, velocities and torques are the tree's own.
pub fn mjcf(tree: &Tree, names: &[String], friction: &[JointFriction], limits: &[Limits], remark: &str) -> String {
    let gravity = tree.gravity;
    let mut text = String::from("<mujoco>\n");
    // Two hyphens would end it.
    remark.lines().for_each(|line| writes(&mut text, 1, &format!("<!-- {} -->", line.replace("--", "- -"))));
    writes(&mut text, 1, "<compiler angle=\"radian\"/>");
    writes(&mut text, 1, &format!("<option gravity=\"{:e} {:e} {:e}\"/>", gravity.x, gravity.y, gravity.z));
    writes(&mut text, 1, "<worldbody>");
    let bodies = Bodies { tree, names, friction, limits };
    bodies.behind(&mut text, None, 2);
    writes(&mut text, 1, "</worldbody>");
    text + "</mujoco>\n"
}

struct Bodies<'a> {
    tree: &'a Tree,
    names: &'a [String],
    friction: &'a [JointFriction],
    limits: &'a [Limits],
}

impl Bodies<'_> {
    /// All bodies behind one, each with those behind it.
    fn behind(&self, text: &mut String, parent: Option<usize>, depth: usize) {
        let children = self.tree.joints.iter().enumerate().filter(|(_, joint)| joint.parent == parent);
        for (i, joint) in children {
            let at = joint.placement.translation;
            let turned = UnitQuaternion::from_rotation_matrix(&joint.placement.rotation);
            let name = self.names.get(i).map_or("", String::as_str);
            let body = format!(
                "<body name=\"{}\" pos=\"{:e} {:e} {:e}\" quat=\"{:e} {:e} {:e} {:e}\">",
                escaped(name),
                at.x,
                at.y,
                at.z,
                turned.w,
                turned.i,
                turned.j,
                turned.k
            );
            writes(text, depth, &body);
            writes(text, depth + 1, &inertial(joint));
            writes(text, depth + 1, &self.joint(i, joint));
            self.behind(text, Some(i), depth + 1);
            writes(text, depth, "</body>");
        }
    }

    fn joint(&self, i: usize, joint: &Joint) -> String {
        let kind = if joint.kind == JointKind::Revolute { "hinge" } else { "slide" };
        let JointFriction { damping, frictionloss } = self.friction.get(i).copied().unwrap_or_default();
        let axis = joint.axis;
        let range = self
            .limits
            .get(i)
            .and_then(|limits| limits.position)
            .map_or_else(String::new, |(low, high)| format!(" limited=\"true\" range=\"{low:e} {high:e}\""));
        format!(
            "<joint name=\"{}\" type=\"{kind}\" axis=\"{:e} {:e} {:e}\" armature=\"{:e}\" damping=\"{damping:e}\" \
             frictionloss=\"{frictionloss:e}\"{range}/>",
            escaped(&joint.name),
            axis.x,
            axis.y,
            axis.z,
            joint.armature
        )
    }
}

fn inertial(joint: &Joint) -> String {
    let (centre, about) = (joint.link.centre(), joint.link.about_centre());
    let entry = |row: usize, column: usize| about[(row, column)];
    format!(
        "<inertial pos=\"{:e} {:e} {:e}\" mass=\"{:e}\" fullinertia=\"{:e} {:e} {:e} {:e} {:e} {:e}\"/>",
        centre.x,
        centre.y,
        centre.z,
        joint.link.mass,
        entry(0, 0),
        entry(1, 1),
        entry(2, 2),
        entry(0, 1),
        entry(0, 2),
        entry(1, 2)
    )
}

fn writes(text: &mut String, depth: usize, line: &str) {
    // Writing to a string cannot fail.
    let _ = writeln!(text, "{:1$}{line}", "", 2 * depth);
}

/// A name as the value of an attribute.
fn escaped(name: &str) -> String {
    name.replace('&', "&amp;").replace('"', "&quot;").replace('<', "&lt;")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random_tree::{Shape, tree};

    #[test]
    fn bodies_are_nested_as_joints_follow_each_other_and_hostile_names_stay_names() {
        let mut tree = tree(Shape { joints: 5, branches: true, prismatic: 0.5, armature: true }, 3);
        tree.joints[0].name = "a\"<&".to_owned();
        let names: Vec<String> = (0..5).map(|i| format!("link {i}")).collect();
        let friction = [JointFriction { damping: 0.25, frictionloss: 0.5 }; 5];
        let text = mjcf(&tree, &names, &friction, &[], "a -- remark\nof two lines");
        let document = roxmltree::Document::parse(&text).unwrap();
        let joints: Vec<_> = document.descendants().filter(|node| node.has_tag_name("joint")).collect();
        assert_eq!(joints.len(), 5);
        for joint in joints {
            let i = tree.joints.iter().position(|own| Some(own.name.as_str()) == joint.attribute("name")).unwrap();
            let behind = joint.parent().and_then(|body| body.parent()).and_then(|body| body.attribute("name"));
            assert_eq!(behind.map(str::to_owned), tree.joints[i].parent.map(|parent| names[parent].clone()));
            let number = |name: &str| joint.attribute(name).unwrap().parse::<f64>().unwrap();
            assert_eq!((number("damping"), number("frictionloss")), (0.25, 0.5));
            assert_eq!(number("armature"), tree.joints[i].armature);
        }
    }
}
