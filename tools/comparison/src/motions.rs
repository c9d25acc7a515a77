//! Samples of all joints of a robot over several motions, as inputs of networks and columns of linear friction; host.

use identification::samples::Samples;
use nalgebra::DMatrix;
use rigid_body::Robot;
use robot::friction_columns::Friction;

/// Samples of all joints of a robot.
#[derive(Clone, Debug, Default)]
pub struct Motions {
    /// Positions, velocities and accelerations of the joints, sample by sample.
    pub states: Vec<[Vec<f64>; 3]>,
    /// Efforts of the motors, sample by sample.
    pub efforts: Vec<Vec<f64>>,
    /// Motion that each sample belongs to.
    pub motion: Vec<usize>,
}

impl Motions {
    /// Samples of one motion, in order.
    pub fn of(&self, motion: usize) -> Vec<usize> {
        (0..self.motion.len()).filter(|&i| self.motion[i] == motion).collect()
    }

    /// Joints, one row a sample: positions, velocities and, where wanted, measured efforts (000, section 3.2).
    pub fn network_inputs(&self, with_effort: bool) -> DMatrix<f64> {
        let joints = self.efforts.first().map_or(0, Vec::len);
        let kinds = if with_effort { 3 } else { 2 };
        DMatrix::from_fn(self.states.len(), kinds * joints, |i, column| match (column / joints, column % joints) {
            (2, j) => self.efforts[i][j],
            (kind, j) => self.states[i][kind][j],
        })
    }

    /// Measured efforts, samples x joints.
    pub fn effort(&self) -> DMatrix<f64> {
        let joints = self.efforts.first().map_or(0, Vec::len);
        DMatrix::from_fn(self.efforts.len(), joints, |i, j| self.efforts[i][j])
    }

    /// Viscous, Coulomb and offset columns of each motor, at its own speed on the joint's side of its gear.
    pub fn friction(&self, robot: &Robot) -> Vec<Vec<f64>> {
        let speed = |j: usize, v: &[f64]| {
            let coupled = robot.coupling.row(j).iter().zip(v).map(|(c, v)| c * v).sum::<f64>();
            coupled / robot.coupling[(j, j)]
        };
        let joint = |j: usize| {
            let velocity: Vec<f64> = self.states.iter().map(|[_, v, _]| speed(j, v)).collect();
            let samples = Samples { position: vec![0.0; velocity.len()], velocity, ..Samples::default() };
            Friction::Simple.columns(&samples, None, false)
        };
        (0..robot.tree.len()).map(joint).collect()
    }
}

/// Root mean square of each column over these rows.
pub fn rms(matrix: &DMatrix<f64>, rows: &[usize]) -> Vec<f64> {
    let square = |j: usize| rows.iter().map(|&i| matrix[(i, j)].powi(2)).sum::<f64>();
    (0..matrix.ncols()).map(|j| (square(j) / rows.len().max(1) as f64).sqrt()).collect()
}
