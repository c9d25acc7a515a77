//! Ellipsoids around the links of a robot, from the collision shapes of its URDF: mass lies where the link is (000,
//! section 3.1); host.
//!
//! Meshes are read with mesh-loader: STL, and OBJ. A link is left without a bound where a part of its mass has no shape
//! or one that cannot be read.

use nalgebra::Vector3;
use rigid_body::Robot;
use rigid_body::ellipsoid::Ellipsoid;
use rigid_body::shape::{Placed, Shape};
use std::path::{Path, PathBuf};

/// Bounds of a robot's links.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Bounds {
    /// Ellipsoid around each joint's link and what is fixed to it; None: its mass may be anywhere.
    pub ellipsoids: Vec<Option<Ellipsoid>>,
    /// Reasons for links that have collision shapes and no bound.
    pub notes: Vec<String>,
}

impl Bounds {
    /// The bounds of a robot whose URDF is this file.
    pub fn of(robot: &Robot, urdf: &Path) -> Self {
        let mut bounds = Self::default();
        for (link, shapes) in robot.links.iter().zip(&robot.shapes) {
            let around = shapes.as_deref().filter(|shapes| !shapes.is_empty()).map(|shapes| around(shapes, urdf));
            let found = around.transpose().unwrap_or_else(|reason| {
                bounds.notes.push(format!("link {link} is not held to its collision shapes: {reason}"));
                None
            });
            bounds.ellipsoids.push(found);
        }
        bounds
    }
}

fn around(shapes: &[Placed], urdf: &Path) -> Result<Ellipsoid, String> {
    let mut points = Vec::new();
    for placed in shapes {
        points.extend(match &placed.shape {
            Shape::Mesh { file, scale } => placed.to_link(vertices(file, *scale, urdf)?),
            shape => placed.to_link(shape.points().unwrap_or_default()),
        });
    }
    Ellipsoid::around(&points).ok_or_else(|| "they are flat, or have a number that is none".to_owned())
}

/// The vertices of the surface in a file, m.
fn vertices(file: &str, scale: [f64; 3], urdf: &Path) -> Result<Vec<Vector3<f64>>, String> {
    let path = found(file, urdf).ok_or_else(|| format!("mesh {file} is not found beside the URDF"))?;
    let scene = mesh_loader::Loader::default().load(&path).map_err(|error| format!("mesh {file}: {error}"))?;
    let scale = Vector3::from(scale);
    let scaled = |[x, y, z]: [f32; 3]| Vector3::new(x.into(), y.into(), z.into()).component_mul(&scale);
    let vertices: Vec<_> = scene.meshes.iter().flat_map(|mesh| &mesh.vertices).copied().map(scaled).collect();
    if vertices.is_empty() { Err(format!("mesh {file} has no vertices")) } else { Ok(vertices) }
}

/// The file that a mesh of a URDF means: a path from the URDF's folder, or one from a package, whose folder is above
/// the URDF or beside a folder above it.
fn found(file: &str, urdf: &Path) -> Option<PathBuf> {
    let file = file.strip_prefix("file://").unwrap_or(file);
    let urdf = urdf.canonicalize().ok()?;
    let mut folders = urdf.ancestors().skip(1);
    match file.strip_prefix("package://") {
        None => folders.next().map(|folder| folder.join(file)).filter(|path| path.is_file()),
        Some(in_package) => folders.map(|folder| folder.join(in_package)).find(|path| path.is_file()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tetrahedron in mm, as an ASCII STL.
    const TETRAHEDRON: [[f64; 3]; 4] = [[0.0, 0.0, 0.0], [100.0, 0.0, 0.0], [0.0, 200.0, 0.0], [0.0, 0.0, 300.0]];

    fn stl() -> String {
        let corner =
            |at: usize| format!("vertex {} {} {}\n", TETRAHEDRON[at][0], TETRAHEDRON[at][1], TETRAHEDRON[at][2]);
        let face = |[a, b, c]: [usize; 3]| {
            format!("facet normal 0 0 0\nouter loop\n{}{}{}endloop\nendfacet\n", corner(a), corner(b), corner(c))
        };
        format!("solid t\n{}endsolid t\n", [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]].map(face).concat())
    }

    /// The bounds of one joint whose link and tip, fixed 1 m along x, have these collision elements.
    fn bounds(folder: &Path, link: &str, tip: &str) -> Bounds {
        let inertial =
            "<inertial><mass value='2'/><inertia ixx='.02' ixy='0' ixz='0' iyy='.02' iyz='0' izz='.01'/></inertial>";
        let urdf = format!(
            "<robot name='one'><link name='base'/><link name='a'>{inertial}{link}</link><link name='tip'>{inertial}{tip}</link>\
             <joint name='one' type='revolute'><parent link='base'/><child link='a'/></joint>\
             <joint name='end' type='fixed'><parent link='a'/><child link='tip'/><origin xyz='1 0 0'/></joint></robot>"
        );
        let file = folder.join("arm_description/urdf/one.urdf");
        std::fs::create_dir_all(file.parent().unwrap()).unwrap();
        std::fs::write(&file, &urdf).unwrap();
        Bounds::of(&Robot::new("urdf = ''\n[joint.one]\n", "robot.toml", &urdf, "one.urdf").unwrap(), &file)
    }

    fn collision(geometry: &str) -> String {
        format!("<collision><geometry>{geometry}</geometry></collision>")
    }

    #[test]
    fn meshes_of_packages_and_paths_and_shapes_of_fixed_links_are_held_by_one_ellipsoid() {
        let folder = tempfile::tempdir().unwrap();
        let meshes = folder.path().join("arm_description/meshes");
        std::fs::create_dir_all(&meshes).unwrap();
        std::fs::write(meshes.join("a.stl"), stl()).unwrap();
        let cube = collision("<box size='0.2 0.2 0.2'/>");
        let corners = (0..8).map(|k| Vector3::new(k as f64 % 2.0, (k / 2) as f64 % 2.0, (k / 4) as f64) * 0.2);
        let corners = corners.map(|corner| corner - Vector3::repeat(0.1) + Vector3::x());
        let tetrahedron = TETRAHEDRON.map(|corner| Vector3::from(corner) * 1e-3);
        let expected = Ellipsoid::around(&tetrahedron.into_iter().chain(corners).collect::<Vec<_>>()).unwrap();
        for file in ["package://arm_description/meshes/a.stl", "../meshes/a.stl"] {
            let mesh = collision(&format!("<mesh filename='{file}' scale='0.001 0.001 0.001'/>"));
            let found = bounds(folder.path(), &mesh, &cube);
            assert!(found.notes.is_empty(), "{:?}", found.notes);
            let found = found.ellipsoids[0].clone().unwrap();
            // STL has single precision.
            assert!((found.centre - expected.centre).norm() < 1e-4, "{file}: {found:?}, expected {expected:?}");
            assert!((found.shape - expected.shape).norm() < 1e-3 * expected.shape.norm(), "{file}");
        }
    }

    #[test]
    fn a_link_is_free_where_a_part_of_its_mass_has_no_shape_and_says_so_where_one_cannot_be_read() {
        let folder = tempfile::tempdir().unwrap();
        let cube = collision("<box size='0.2 0.2 0.2'/>");
        let free = |link: &str, tip: &str| {
            let Bounds { ellipsoids, notes } = bounds(folder.path(), link, tip);
            assert_eq!(ellipsoids, [None], "{link} {tip}");
            notes.concat()
        };
        assert_eq!(free("", ""), "");
        assert_eq!(free(&cube, ""), "");
        assert_eq!(free(&cube, &collision("<capsule radius='0.1' length='1'/>")), "");
        let mesh = |file: &str| free(&collision(&format!("<mesh filename='{file}'/>")), &cube);
        for file in ["package://arm_description/meshes/none.stl", "none.stl", "package://none"] {
            let expected =
                format!("link a is not held to its collision shapes: mesh {file} is not found beside the URDF");
            assert_eq!(mesh(file), expected);
        }
        for (name, content) in [("a.dae", "<COLLADA/>"), ("a.stl", "solid"), ("a.obj", "v 1 2\n")] {
            std::fs::write(folder.path().join("arm_description/urdf").join(name), content).unwrap();
            let found = mesh(name);
            assert!(found.starts_with("link a is not held to its collision shapes: "), "{name}: {found}");
        }
    }
}
