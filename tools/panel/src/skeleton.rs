//! A robot as the page draws it: its joints with their nodes, each frame in that of the joint before it; no I/O.

use rigid_body::Robot;
use serde_json::{Value, json};

/// Joints in their order: name, node, index of the joint before it or null for the base, origin (m), rotation (row by
/// row) and axis of its frame, and the centre of its link in it (m), where the drawing of a last link ends.
///
/// # Errors
/// Another number of nodes than of joints.
pub fn skeleton(robot: &Robot, nodes: &[u8]) -> Result<Value, String> {
    let joints = &robot.tree.joints;
    if nodes.len() != joints.len() {
        return Err(format!("the robot has {} joints, --joints names {} nodes", joints.len(), nodes.len()));
    }
    let told = joints.iter().zip(nodes).map(|(joint, node)| {
        let placement = &joint.placement;
        json!({
            "name": joint.name,
            "node": node,
            "parent": joint.parent,
            "origin": placement.translation.as_slice(),
            // nalgebra's matrices are column by column.
            "rotation": placement.rotation.matrix().transpose().as_slice(),
            "axis": joint.axis.as_slice(),
            "tip": joint.link.centre().as_slice(),
        })
    });
    Ok(told.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    const URDF: &str = "<robot name='r'><link name='base'/><joint name='a' type='revolute'><parent link='base'/>\
        <child link='l'/><origin xyz='0 0 1' rpy='0 0 1.5707963267948966'/><axis xyz='0 1 0'/>\
        <limit lower='-1' upper='1' effort='1' velocity='1'/></joint><link name='l'><inertial>\
        <origin xyz='0.5 0 0'/><mass value='2'/><inertia ixx='0.1' ixy='0' ixz='0' iyy='0.1' iyz='0' izz='0.1'/>\
        </inertial></link></robot>";

    #[test]
    fn a_joint_is_told_with_its_frame_row_by_row_and_nodes_have_to_be_as_many() {
        let robot = Robot::new("urdf = 'r.urdf'\n[joint.a]\n", "robot.toml", URDF, "r.urdf").unwrap();
        let told = skeleton(&robot, &[7]).unwrap();
        assert_eq!((&told[0]["name"], &told[0]["node"], &told[0]["parent"]), (&json!("a"), &json!(7), &Value::Null));
        assert_eq!((&told[0]["origin"], &told[0]["tip"]), (&json!([0.0, 0.0, 1.0]), &json!([0.5, 0.0, 0.0])));
        // A quarter of a turn about z takes x to y.
        let rotation = told[0]["rotation"].as_array().unwrap();
        let number = |place: usize| rotation[place].as_f64().unwrap();
        assert!((number(1) + 1.0).abs() < 1e-9 && (number(3) - 1.0).abs() < 1e-9, "{told}");
        let error = skeleton(&robot, &[7, 8]).unwrap_err();
        assert_eq!(error, "the robot has 1 joints, --joints names 2 nodes");
    }
}
