//! Time of a robot's identification against joints and samples: the equations, least squares with standard errors, and
//! the convex fit of physical links.

use divan::Bencher;
use nalgebra::{DMatrix, DVector};
use rigid_body::random_tree::{Shape, state, tree, urdf};
use rigid_body::{Robot, Tree};
use robot::convex::{self, Prior};
use robot::equations::{GROUPS, Layout, Normal, Rows, rigid_columns};
use robot::friction_columns::Friction;
use robot::least_squares::{Weighting, base, solve};

fn main() {
    divan::main();
}

/// Joints and samples.
const SIZES: [(usize, usize); 6] = [(2, 1000), (6, 1000), (12, 1000), (6, 2000), (6, 4000), (12, 4000)];

fn robot(joints: usize) -> Robot {
    let tree: Tree = tree(Shape { joints, branches: false, prismatic: 0.0, armature: false }, 1);
    let drives: String = tree.joints.iter().map(|joint| format!("[joint.{}]\n", joint.name)).collect();
    let urdf = urdf(&tree, (-3.0, 3.0), 3.0);
    Robot::new(&format!("urdf = ''\n{drives}"), "robot.toml", &urdf, "robot.urdf").expect("a random tree is a robot")
}

/// Equations at random states, with the efforts of the robot's own links and something beside them.
fn rows(robot: &Robot, samples: usize) -> Rows {
    let n = robot.tree.len();
    let mut unknowns = DVector::zeros(11 * n);
    unknowns.rows_mut(0, 10 * n).copy_from_slice(&robot.tree.parameters());
    let states: Vec<[Vec<f64>; 3]> = (0..samples as u64).map(|seed| state(n, seed)).collect();
    let rigid: Vec<DMatrix<f64>> = states.iter().map(|[q, v, a]| rigid_columns(robot, q, v, a)).collect();
    let effort = |j: usize| {
        let of =
            |(columns, [q, ..]): (&DMatrix<f64>, &[Vec<f64>; 3])| (columns * &unknowns)[j] + 0.1 * (9.0 * q[j]).sin();
        rigid.iter().zip(&states).map(of).collect()
    };
    Rows {
        layout: Layout { joints: n, friction: Friction::None, shared: false },
        effort: (0..n).map(effort).collect(),
        friction: vec![vec![]; n],
        group: (0..samples).map(|i| Some(i * GROUPS / samples)).collect(),
        run: vec![0; samples],
        still: vec![vec![false; samples]; n],
        rigid,
    }
}

#[divan::bench(args = SIZES)]
fn equations(bencher: Bencher, (joints, samples): (usize, usize)) {
    let robot = robot(joints);
    bencher.bench_local(|| rows(&robot, samples));
}

#[divan::bench(args = SIZES)]
fn least_squares(bencher: Bencher, (joints, samples): (usize, usize)) {
    let robot = robot(joints);
    let (rows, base) = (rows(&robot, samples), base(&robot, 1));
    bencher.bench_local(|| solve(&rows, &base, Weighting::ByJoint));
}

#[divan::bench(args = [2, 6, 12])]
fn convex_fit(bencher: Bencher, joints: usize) {
    let robot = robot(joints);
    let rows = rows(&robot, 1000);
    let mut sum = Normal::zero(rows.layout.unknowns());
    for j in 0..joints {
        rows.normal(j, |_| 1.0).iter().for_each(|group| sum.add(group, 1.0));
    }
    let prior = Prior::of(&robot);
    bencher.bench_local(|| convex::solve(&sum, rows.layout, &prior, 0.1));
}
