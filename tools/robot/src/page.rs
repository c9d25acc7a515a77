//! The page of an identified robot: errors, what the effort of each joint consists of, parameters with their errors,
//! and what the motion leaves open; host.

use super::fit::{BaseParameter, FittedRobot};
use super::recording::Recording;
use identification::page::Role;
use identification::samples::Part;
use maud::{Markup, html};
use report::figures::{Curve, Figure, FigureError, Ink, Plot, over_time};
use report::html::{document, gallery};
use report::number::significant;
use rigid_body::{LinkInertia, Robot};

/// Samples of a curve at the most.
const POINTS: usize = 1_500;
/// Inks and names of the parts of an effort.
const PARTS: [(Ink, &str); 6] = [
    (Ink::Measured, "measured"),
    (Ink::Physical, "inertia"),
    (Ink::Mark, "Coriolis and centrifugal"),
    (Ink::Nothing, "gravity"),
    (Ink::Network, "friction by the image"),
    (Ink::PhysicalCurve, "residual"),
];

/// The page.
///
/// # Errors
/// [`FigureError`].
pub fn page(recording: &Recording, fitted: &FittedRobot) -> Result<String, FigureError> {
    let title = format!("Robot {}", recording.robot.name);
    let figure = decomposition(recording, fitted)?;
    let [simplest, bodies, image] = fitted.mean_percent();
    let verdict = format!(
        "Links, rotors and images leave {image:.2} % of the joints' effort on test samples; links and rotors with their own \
         friction {bodies:.2} %, least squares with viscous and Coulomb friction {simplest:.2} %."
    );
    let body = html! {
        header { h1 { (title) } }
        p class=(if image <= simplest { "verdict good" } else { "verdict bad" }) { (verdict) }
        main {
            section { h2 { "Errors on test samples" } (errors(fitted)) }
            section { h2 { "What the effort consists of" } (gallery(&[&figure])) }
            section { h2 { "Base parameters" } (base(recording, fitted)) }
            section { h2 { "Links" } (links(recording, fitted)) }
            section { h2 { "Choices" } ul { @for note in &fitted.bodies.notes { li { (note) } } } }
        }
        footer {
            "Made by jointctl " (env!("CARGO_PKG_VERSION")) ". All numbers: robot.json, parameters.toml. Each joint has a report of its own: \
             JOINT/report.html."
        }
    };
    Ok(document(&title, &body))
}

fn errors(fitted: &FittedRobot) -> Markup {
    let percent = |part: f64, whole: f64| format!("{:.2}", 100.0 * part / whole);
    html! {
        p { "RMS of what is left, in % of the effort's RMS. Simplest: least squares with viscous and Coulomb friction and an offset." }
        div.scroll { table {
            thead { tr {
                th { "joint" } th.number { "effort, RMS" } th { "unit" } th.number { "simplest" } th.number { "bodies" }
                th.number { "image" } th { "model of the image" }
            } }
            tbody { @for joint in &fitted.errors { tr {
                td { (joint.joint) }
                td.number { (significant(joint.effort, 4)) }
                td { (joint.unit) }
                td.number { (percent(joint.simplest, joint.effort)) }
                td.number { (percent(joint.bodies, joint.effort)) }
                td.number { (percent(joint.image, joint.effort)) }
                td { (joint.model) }
            } } }
        } }
    }
}

/// Parts of every joint's effort at one sample, without friction and residual: inertia, Coriolis, gravity.
fn parts(robot: &Robot, rotors: &[f64], [q, v, a]: &[Vec<f64>; 3]) -> Vec<[f64; 3]> {
    let zero = vec![0.0; q.len()];
    let efforts = |v: &[f64], a: &[f64]| robot.efforts(&robot.inverse_dynamics(q, v, a, rotors));
    let (all, uniform, still) = (efforts(v, a), efforts(v, &zero), efforts(&zero, &zero));
    (0..q.len()).map(|j| [all[j] - uniform[j], uniform[j] - still[j], still[j]]).collect()
}

fn decomposition(recording: &Recording, fitted: &FittedRobot) -> Result<Figure, FigureError> {
    let mut robot = recording.robot.clone();
    robot.tree.joints.iter_mut().zip(&fitted.links).for_each(|(joint, link)| joint.link = *link);
    let test: Vec<usize> = (0..recording.len()).filter(|&i| recording.part(i) == Part::Test).collect();
    let shown: Vec<usize> = test.iter().copied().step_by(test.len().div_ceil(POINTS).max(1)).collect();
    let rigid: Vec<Vec<[f64; 3]>> = shown.iter().map(|&i| parts(&robot, &fitted.rotors, &recording.state(i))).collect();
    let joints = recording.robot.tree.joints.iter();
    let labels: Vec<String> =
        joints.zip(&fitted.errors).map(|(joint, errors)| format!("{} [{}]", joint.name, errors.unit)).collect();
    let plots: Vec<Plot> = (fitted.joints.iter().enumerate())
        .map(|(j, one)| {
            let samples = &recording.joints[j].samples;
            let image = one.predictions.iter().find(|prediction| prediction.role == Role::FixedPoint);
            let of = |part: usize, at: usize| {
                let (i, rigid) = (shown[at], rigid[at][j]);
                let predicted = image.map_or(f64::NAN, |image| image.effort[i]);
                match part {
                    0 => samples.effort[i],
                    4 => predicted - rigid.iter().sum::<f64>(),
                    5 => samples.effort[i] - predicted,
                    part => rigid[part - 1],
                }
            };
            let curve = |(part, (ink, name)): (usize, (Ink, &'static str))| Curve {
                ink,
                name,
                points: (0..shown.len()).map(|at| (samples.time[shown[at]], of(part, at))).collect(),
            };
            Plot { label: &labels[j], curves: PARTS.into_iter().enumerate().map(curve).collect() }
        })
        .collect();
    let caption = "Test samples. Inertia, Coriolis and gravity are those of the identified links and rotors; friction is what the image \
                   and its own rigid part add to them.";
    over_time("decomposition", "Effort of each joint", caption, &plots)
}

fn base(recording: &Recording, fitted: &FittedRobot) -> Markup {
    let solution = &fitted.bodies.base;
    let all = fitted.base_parameters(&recording.robot);
    let open: Vec<&BaseParameter> = all.iter().filter(|parameter| !parameter.standard_error.is_finite()).collect();
    let hidden = fitted.bodies.rows.layout.rigid() - all.len();
    html! {
        p {
            "By weighted least squares; each stands for the combination of parameters that moves the same motors. Condition number of \
             the regressor: " (significant(solution.condition, 3)) ". "
            (hidden) " of " (fitted.bodies.rows.layout.rigid()) " parameters move no motor by themselves: they show in these combinations alone, \
             or not at all."
        }
        @if !open.is_empty() {
            p { strong {
                "The motion leaves open: " (open.iter().map(|parameter| parameter.name.clone()).collect::<Vec<_>>().join(", "))
                ". A motion of those joints, faster or in other poses, shows them: jointctl robot excite."
            } }
        }
        div.scroll { table {
            thead { tr { th { "parameter" } th.number { "value" } th.number { "standard error" } th.number { "%" } } }
            tbody { @for parameter in &all { tr {
                td { (parameter.name) }
                td.number { (significant(parameter.value, 4)) }
                @if parameter.standard_error.is_finite() {
                    td.number { (significant(parameter.standard_error, 2)) }
                    td.number { (significant(100.0 * (parameter.standard_error / parameter.value).abs(), 2)) }
                } @else { td.number { "open" } td {} }
            } } }
        } }
    }
}

/// Least eigenvalue of a link's pseudo-inertia over the sum of all: 0 at the limit of what a body can have.
fn consistency(link: &LinkInertia) -> f64 {
    let eigenvalues = link.pseudo_inertia().symmetric_eigenvalues();
    eigenvalues.min() / eigenvalues.sum()
}

fn links(recording: &Recording, fitted: &FittedRobot) -> Markup {
    let robot = &recording.robot;
    html! {
        p {
            "By the convex fit, which keeps every link one that a body can have. The last column is the least eigenvalue of the \
             pseudo-inertia over the sum of all; it is above 0 exactly for those."
        }
        div.scroll { table {
            thead { tr {
                th { "link" } th { "joint" } th.number { "mass, kg" } th.number { "centre, m" } th.number { "rotor, kg m²" }
                th.number { "consistency" }
            } }
            tbody { @for (j, link) in fitted.links.iter().enumerate() { tr {
                td { (robot.links[j]) }
                td { (robot.tree.joints[j].name) }
                td.number { (significant(link.mass, 4)) }
                td.number { (link.centre().iter().map(|x| format!("{x:.4}")).collect::<Vec<_>>().join(", ")) }
                td.number { (significant(fitted.rotors[j], 3)) }
                td.number { (format!("{:.1e}", consistency(link))) }
            } } }
        } }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    #[test]
    fn the_parts_of_an_effort_add_up_and_each_is_what_it_says() {
        let urdf = "<robot name='arm'><link name='base'/>\
            <joint name='j0' type='revolute'><parent link='base'/><child link='l0'/><axis xyz='0 1 0'/>\
            <limit lower='-9' upper='9' effort='1' velocity='9'/></joint>\
            <link name='l0'><inertial><origin xyz='0.5 0 0'/><mass value='2'/>\
            <inertia ixx='0.1' ixy='0' ixz='0' iyy='0.1' iyz='0' izz='0.1'/></inertial></link></robot>";
        let robot = Robot::new("urdf = ''\n[joint.j0]\nrotor_inertia = 0.0\n", "robot.toml", urdf, "arm.urdf").unwrap();
        let [part] = parts(&robot, &[0.25], &[vec![0.3], vec![2.0], vec![4.0]]).try_into().unwrap();
        let [inertia, coriolis, gravity] = part;
        assert!((inertia - 4.0 * (0.1 + 2.0 * 0.25 + 0.25)).abs() < 1e-12, "{inertia}");
        assert!(coriolis.abs() < 1e-12, "{coriolis}");
        // A lever along x that turns about y falls towards positive angles.
        assert!((gravity + 2.0 * 9.81 * 0.5 * 0.3f64.cos()).abs() < 1e-12, "{gravity}");
    }

    #[test]
    fn a_ball_is_far_from_the_limit_and_a_rod_at_it() {
        let ball = LinkInertia::from_centre(1.0, Vector3::zeros(), nalgebra::Matrix3::identity() * 0.4);
        let rod = LinkInertia::from_centre(
            1.0,
            Vector3::zeros(),
            nalgebra::Matrix3::from_diagonal(&Vector3::new(0.0, 1.0, 1.0)),
        );
        assert!(consistency(&ball) > 0.1 && consistency(&rod).abs() < 1e-12);
    }
}
