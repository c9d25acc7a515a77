//! Bad files: each error names file, joint or link, and what to do.

use rigid_body::pairs::Pair;
use rigid_body::shape::Shape;
use rigid_body::{LinkInertia, Robot};

const LINK: &str = r#"<inertial><origin xyz="0 0 0.1"/><mass value="2"/>
    <inertia ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.01"/></inertial>"#;

fn urdf() -> String {
    format!(
        r#"<robot name="two">
<link name="base"/>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/></joint>
<link name="upper">{LINK}</link>
<joint name="elbow" type="continuous"><parent link="upper"/><child link="lower"/><origin xyz="0 0 0.4" rpy="0 0 0"/><axis xyz="0 1 0"/></joint>
<link name="lower">{LINK}</link>
<joint name="flange" type="fixed"><parent link="lower"/><child link="tool"/><origin xyz="0 0 0.3"/></joint>
<link name="tool">{LINK}</link>
</robot>"#
    )
}

const TOML: &str =
    "urdf = 'two.urdf'\n[joint.shoulder]\ngain = 2.0\n[joint.elbow]\nratio = 50.0\nrotor_inertia = 1e-4\n";

fn robot(toml: &str, urdf: &str) -> Result<Robot, String> {
    Robot::new(toml, "robot.toml", urdf, "two.urdf").map_err(|error| error.to_string())
}

#[test]
fn a_robot_is_read_and_what_is_fixed_to_a_link_is_part_of_it() {
    let robot = robot(TOML, &urdf()).unwrap();
    let names: Vec<_> = robot.tree.joints.iter().map(|joint| joint.name.as_str()).collect();
    assert_eq!(names, ["shoulder", "elbow"]);
    let forearm = robot.tree.joints[1].link;
    assert_eq!(forearm.mass, 4.0);
    assert!((forearm.centre().z - 0.25).abs() < 1e-12);
    assert_eq!((robot.gains()[(0, 0)], robot.gains()[(1, 1)]), (2.0, 50.0));
    assert_eq!(robot.rotor_matrix(&[0.0, 1e-4])[(1, 1)], 0.25);
}

#[test]
fn shapes_of_a_link_are_placed_in_it_and_none_are_known_where_a_part_of_the_mass_has_none() {
    let collision = |rest: &str| format!("<collision>{rest}</collision>");
    let shapes = |link: &str, tool: &str| {
        let text = urdf().replace("name=\"lower\">", &format!("name=\"lower\">{link}"));
        robot(TOML, &text.replace("name=\"tool\">", &format!("name=\"tool\">{tool}"))).map(|robot| robot.shapes)
    };
    let rod = collision("<geometry><cylinder radius=\"0.05\" length=\"0.3\"/></geometry>");
    let mesh = collision("<origin xyz=\"0 0 0.1\"/><geometry><mesh filename=\"a.stl\" scale=\"1 2 3\"/></geometry>");
    let found = shapes(&rod, &mesh).unwrap();
    assert_eq!(found[0], None);
    let Some([rod_found, mesh_found]) = found[1].as_deref() else { panic!("{found:?}") };
    assert_eq!(rod_found.shape, Shape::Cylinder { radius: 0.05, length: 0.3 });
    assert_eq!(mesh_found.shape, Shape::Mesh { file: "a.stl".into(), scale: [1.0, 2.0, 3.0] });
    let heights = [rod_found, mesh_found].map(|placed| placed.placement.translation.z);
    assert!(heights[0] == 0.0 && (heights[1] - 0.4).abs() < 1e-12, "{heights:?}");
    let odd = collision("<geometry><capsule radius=\"1\"/></geometry>");
    for (link, tool) in [("", rod.as_str()), (&rod, ""), (&rod, &odd), (&odd, &rod), (&rod, &collision(""))] {
        assert_eq!(shapes(link, tool).unwrap(), [None, None], "{link} {tool}");
    }
    for (geometry, expected) in [
        ("<box size=\"1 2\"/>", "size is \"1 2\", expected 3 finite numbers"),
        ("<box/>", "box has no size; add it"),
        ("<cylinder radius=\"1\"/>", "cylinder has no length; add it"),
        ("<sphere/>", "sphere has no radius; add it"),
        ("<mesh/>", "mesh has no filename; add it"),
        ("<mesh filename=\"a.stl\" scale=\"x\"/>", "scale is \"x\""),
    ] {
        let error = shapes(&collision(&format!("<geometry>{geometry}</geometry>")), "").unwrap_err();
        assert!(error.starts_with("two.urdf:7: ") && error.contains(expected), "{error}");
    }
}

#[test]
fn each_defect_names_its_file_its_joint_and_a_remedy() {
    let good = urdf();
    let with = |from: &str, to: &str| (TOML.to_owned(), good.replacen(from, to, 1));
    let toml = |text: &str| (text.to_owned(), good.clone());
    let coupled = |rest: &str| (format!("{}[coupling]\n{rest}", TOML.replace("ratio = 50.0\n", "")), good.clone());
    let pair = |rest: &str| (format!("{TOML}[[pair]]\n{rest}"), good.clone());
    let cases = [
        (with("</robot>", ""), "two.urdf", "no URDF"),
        (with("<origin xyz=\"0 0 0.1\"/>", "<origin xyz=\"0 0 0.1 m\"/>"), "two.urdf:", "xyz is \"0 0 0.1 m\""),
        (with("<parent link=\"upper\"/>", "<parent link=\"lower\"/>"), "two.urdf", "joint elbow is part of a ring"),
        (
            with("<link name=\"base\"/>\n", ""),
            "two.urdf",
            "joint shoulder: there is no link base; check parent and child",
        ),
        (
            with(
                "</robot>",
                "<joint name='back' type='fixed'><parent link='tool'/><child link='base'/></joint></robot>",
            ),
            "two.urdf",
            "joint shoulder is part of a ring of joints that no base leads to",
        ),
        (with("<mass value=\"2\"/>", "<mass value=\"0\"/>"), "two.urdf:", "link upper: no body has a mass of 0 kg"),
        (
            with("<child link=\"upper\"/>", "<child link=\"upper\"/><limit lower=\"low\" upper=\"1\"/>"),
            "two.urdf:",
            "lower is \"low\", expected 1 finite numbers",
        ),
        (with("mass value=\"2\"", "mass value=\"$(arg m)\""), "two.urdf:", "xacro"),
        (with("<child link=\"lower\"/>", "<child link=\"lowre\"/>"), "two.urdf", "joint elbow: there is no link lowre"),
        (
            with("<link name=\"base\"/>", "<link name=\"base\"/><link name=\"x\"/>"),
            "two.urdf",
            "base, x are no child of any joint",
        ),
        (with("<parent link=\"base\"/>", "<parent link=\"lower\"/>"), "two.urdf", "joint shoulder is part of a ring"),
        (
            with("</robot>", "<joint name='j' type='fixed'><parent link='base'/><child link='tool'/></joint></robot>"),
            "two.urdf",
            "link tool is the child of joint flange and of joint j",
        ),
        (
            with("<link name=\"tool\">", "<link name=\"upper\"></link><link name=\"tool\">"),
            "two.urdf",
            "link upper is there twice",
        ),
        (with(LINK, ""), "two.urdf", "link upper moves with joint shoulder and has no mass"),
        (
            with("izz=\"0.01\"", "izz=\"0.05\""),
            "two.urdf:",
            "link upper: no body has a mass of 2 kg with principal inertias",
        ),
        (with("mass value=\"2\"", "mass value=\"-2\""), "two.urdf:", "link upper"),
        (with("iyz=\"0\"", ""), "two.urdf:", "upper has no inertial/inertia iyz"),
        (with("continuous", "planar"), "two.urdf:", "joint elbow is of type \"planar\""),
        (with("<axis xyz=\"0 1 0\"/></joint>", "<axis xyz=\"0 0 0\"/></joint>"), "two.urdf:", "shoulder has no axis"),
        (
            with(
                "</robot>",
                "<transmission name='t'><joint name='elbow'/><actuator name='m'><mechanicalReduction>100</mechanicalReduction></actuator></transmission></robot>",
            ),
            "robot.toml",
            "joint elbow: ratio is 50, the URDF's mechanicalReduction 100",
        ),
        (
            toml("urdf = 'two.urdf'\n[joint.shoulder]\n"),
            "robot.toml",
            "joint elbow of the URDF moves and has no [joint.elbow]",
        ),
        (
            toml(&format!("{TOML}[joint.elbo]\n")),
            "robot.toml",
            "joint elbo is not in the URDF; elbow is meant, perhaps",
        ),
        (
            toml(&format!("{TOML}[joint.flange]\n")),
            "robot.toml",
            "joint flange has a drive, but it is fixed in the URDF",
        ),
        (
            toml(&format!("locked = ['elbow']\n{TOML}")),
            "robot.toml",
            "joint elbow has a drive, but it is listed under `locked`",
        ),
        (
            toml(&TOML.replace("50.0", "0.0")),
            "robot.toml",
            "joint elbow: ratio is 0, expected a finite number other than 0",
        ),
        (toml(&TOML.replace("ratio", "ration")), "robot.toml", "ration"),
        (coupled("joints = ['shoulder', 'elbow']\nmatrix = [[1.0, 1.0]]"), "robot.toml", "matrix is not 2 x 2"),
        (
            coupled("joints = ['shoulder', 'elbow']\nmatrix = [[1.0, 1.0], [2.0, 2.0]]"),
            "robot.toml",
            "matrix is singular",
        ),
        (coupled("joints = ['wrist']\nmatrix = [[1.0]]"), "robot.toml", "joint wrist is not in the URDF"),
        (coupled("joints = []\nmatrix = []"), "robot.toml", "it has no joints; name them, or remove [coupling]"),
        (
            coupled("joints = ['shoulder', 'shoulder']\nmatrix = [[1.0, 0.0], [0.0, 2.0]]"),
            "robot.toml",
            "coupling of shoulder, shoulder: shoulder is there twice",
        ),
        (
            coupled("joints = ['shoulder', 'elbow']\nmatrix = [[1.0, 1.0], [1.0]]"),
            "robot.toml",
            "coupling of shoulder, elbow: matrix is not 2 x 2",
        ),
        (coupled("joints = ['elbow']\nmatrix = [[inf]]"), "robot.toml", "coupling of elbow: matrix has inf"),
        (
            toml(
                "urdf = 'two.urdf'\nlocked = ['elbow']\n[joint.shoulder]\n[coupling]\njoints = ['elbow']\nmatrix = [[2.0]]",
            ),
            "robot.toml",
            "elbow is listed under `locked` and does not move; remove one of the two",
        ),
        (
            toml(&format!("{TOML}[coupling]\njoints = ['elbow']\nmatrix = [[2.0]]\n")),
            "robot.toml",
            "coupling of elbow: elbow has a ratio of 50 as well; leave it out",
        ),
        (
            pair("joints = ['shoulder', 'wrist']"),
            "robot.toml",
            "pair of shoulder and wrist: there is no moving joint wrist; correct its name, or remove the pair",
        ),
        (
            pair("joints = ['elbow', 'elbow']"),
            "robot.toml",
            "pair of elbow and elbow: elbow cannot share a drive with itself; name the other joint",
        ),
        (
            pair("joints = ['shoulder', 'elbow']\n[[pair]]\njoints = ['elbow', 'shoulder']"),
            "robot.toml",
            "pair of elbow and shoulder: elbow is in another pair as well; a joint has one partner",
        ),
        (
            toml("urdf = 'two.urdf'\nlocked = ['elbow']\n[joint.shoulder]\n[[pair]]\njoints = ['shoulder', 'elbow']"),
            "robot.toml",
            "elbow is listed under `locked` and does not move; remove one of the two",
        ),
        (pair("joints = ['shoulder']"), "robot.toml", "length 2"),
        (
            pair("joints = ['shoulder', 'elbow']\nband = 0.0"),
            "robot.toml",
            "pair of shoulder and elbow: band is 0, expected a number above 0, at most 10",
        ),
        (toml(&TOML.replace("gain = 2.0", "gain = 0.0")), "robot.toml", "joint shoulder: gain is 0, expected"),
        (toml(&TOML.replace("1e-4", "-1e-9")), "robot.toml", "joint elbow: rotor_inertia is -0.000000001, expected"),
        (toml(&TOML.replace("gain = 2.0", "velocity = 0.0")), "robot.toml", "joint shoulder: velocity is 0, expected"),
        (
            toml(&TOML.replace("gain = 2.0", "position = [1.0, 1.0]")),
            "robot.toml",
            "joint shoulder: highest position is 1, expected a finite number above the lowest position",
        ),
        (toml(&format!("floor = nan\n{TOML}")), "robot.toml", "floor is NaN, expected finite numbers"),
        (
            toml("locked = ['shoulder', 'elbow']\nurdf = 'two.urdf'\n[joint]\n"),
            "robot.toml",
            "no joint moves; describe at least one drive",
        ),
    ];
    for ((toml, urdf), file, text) in cases {
        let error = robot(&toml, &urdf).expect_err(text);
        assert!(error.starts_with(file) && error.contains(text), "{error:?}, expected {file}: {text}");
    }
}

#[test]
fn a_joint_of_a_pair_has_the_other_one_as_its_partner() {
    let found = robot(&format!("{TOML}[[pair]]\njoints = ['elbow', 'shoulder']\n"), &urdf()).unwrap();
    assert_eq!(found.pairs, [Pair { joints: [1, 0], band: 0.05 }]);
    assert_eq!([0, 1, 2].map(|joint| found.pairs[0].partner(joint)), [Some(1), Some(0), None]);
    assert!(robot(TOML, &urdf()).unwrap().pairs.is_empty());
}

#[test]
fn limits_are_those_of_robot_toml_else_of_the_urdf_and_a_placeholder_is_none() {
    let limit = |text: &str| urdf().replacen("<child link=\"upper\"/>", &format!("<child link=\"upper\"/>{text}"), 1);
    let limits = |toml: &str, text: &str| robot(toml, &limit(text)).unwrap().limits[0];
    let urdf = limits(TOML, "<limit lower=\"-1\" upper=\"2\" effort=\"1\" velocity=\"3\"/>");
    assert_eq!((urdf.position, urdf.velocity, urdf.acceleration), (Some((-1.0, 2.0)), Some(3.0), None));
    let own = TOML.replace("gain = 2.0", "position = [-0.5, 0.5]\nacceleration = 7.0");
    let own = limits(&own, "<limit lower=\"-1\" upper=\"2\" effort=\"1\" velocity=\"3\"/>");
    assert_eq!((own.position, own.velocity, own.acceleration), (Some((-0.5, 0.5)), Some(3.0), Some(7.0)));
    assert_eq!(
        limits(TOML, "<limit lower=\"0\" upper=\"0\" effort=\"0\" velocity=\"0\"/>"),
        rigid_body::Limits::default()
    );
}

#[test]
fn the_heights_are_those_of_all_moving_frames_against_gravity() {
    // Shoulder and elbow turn about y: at q = (pi/2, 0) the arm lies along x.
    let arm = robot(TOML, &urdf()).unwrap();
    let names: Vec<&str> = arm.frames.iter().map(|frame| frame.link.as_str()).collect();
    assert_eq!(names, ["upper", "lower", "tool"]);
    let close = |found: Vec<f64>, expected: [f64; 3]| {
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?}");
    };
    close(arm.heights(&[0.0, 0.0]), [0.0, 0.4, 0.7]);
    close(arm.heights(&[std::f64::consts::FRAC_PI_2, 0.0]), [0.0, 0.0, 0.0]);
    close(arm.heights(&[0.0, std::f64::consts::PI]), [0.0, 0.4, 0.1]);
    let hanging = robot(&format!("gravity = [0.0, 0.0, 9.81]\n{TOML}"), &urdf()).unwrap();
    close(hanging.heights(&[0.0, 0.0]), [0.0, -0.4, -0.7]);
}

#[test]
fn a_differential_shares_torques_and_rotors_and_its_forward_dynamics_is_the_inverse() {
    let text = format!(
        "{}[coupling]\njoints = ['shoulder', 'elbow']\nmatrix = [[30.0, 30.0], [30.0, -30.0]]\n",
        TOML.replace("ratio = 50.0\n", "")
    );
    let robot = robot(&text, &urdf()).unwrap();
    assert_eq!(robot.gains()[(0, 0)], 60.0);
    assert_eq!(robot.gains()[(1, 1)], -30.0);
    let (q, v, a, rotors) = ([0.3, -0.7], [1.0, 0.5], [2.0, -3.0], [1e-4, 3e-4]);
    let torque = robot.inverse_dynamics(&q, &v, &a, &rotors);
    let found = robot.forward_dynamics(&q, &v, &torque, &rotors).unwrap();
    assert!(found.iter().zip(a).all(|(found, a)| (found - a).abs() < 1e-9), "{found:?}");
    let efforts = robot.efforts(&torque);
    let back = robot.gains() * nalgebra::DVector::from_vec(efforts);
    assert!(back.iter().zip(&torque).all(|(back, torque)| (back - torque).abs() < 1e-9));
}

#[test]
fn identified_values_are_written_into_the_urdf_and_read_back_and_the_rest_stays() {
    use rigid_body::urdf::{LinkValues, with_values};
    let before = robot(TOML, &urdf()).unwrap();
    let values = |j: usize| LinkValues {
        joint: before.tree.joints[j].name.clone(),
        link: before.links[j].clone(),
        inertia: LinkInertia::from_centre(3.0, nalgebra::Vector3::new(0.0, 0.1, 0.2), nalgebra::Matrix3::identity()),
        damping: 0.5,
        friction: 1.5,
    };
    let text = with_values(&urdf(), "two.urdf", &[values(0), values(1)]).unwrap();
    assert!(text.contains("<link name=\"tool\"></link>") && text.contains("damping=\"5e-1\" friction=\"1.5e0\""));
    let after = robot(TOML, &text).unwrap();
    for joint in &after.tree.joints {
        assert!(joint.link.parameters().iter().zip(values(0).inertia.parameters()).all(|(a, b)| (a - b).abs() < 1e-12));
    }
    assert_eq!(after.tree.joints[1].placement, before.tree.joints[1].placement);
}
