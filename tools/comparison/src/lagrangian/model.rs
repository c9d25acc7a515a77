//! The model of 002, figure 1: inertia and potential energy by networks, friction and rotors by linear layers, and
//! the gradient of its error; host.
//!
//! Efforts come out in the units of the recording (A, say): torques of the Lagrangian over the drive gains, which are
//! given as they are to least squares; gains differ by joint, so efforts themselves have no symmetric mass matrix.
//! Each joint's coordinate is scaled so that the networks learn numbers near 1, which changes no model that can be
//! learned: with velocities c v and torques tau / c, M keeps its symmetry.

use super::dynamics::Lagrangian;
use super::network::{Activation, Network, Pass};
use nalgebra::{DMatrix, SMatrix, SVector};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

/// Slope of the Coulomb friction at standstill, s/rad (002, section III-A).
const SLOPE: f64 = 100.0;

/// Place of the rotor inertia among a joint's coefficients.
const ROTOR: usize = 3;

/// All joints at one time.
#[derive(Clone, Copy, Debug)]
pub struct Sample<const N: usize> {
    /// Positions, rad.
    pub q: SVector<f64, N>,
    /// Velocities, rad/s.
    pub v: SVector<f64, N>,
    /// Accelerations, rad/s^2.
    pub a: SVector<f64, N>,
    /// Efforts.
    pub effort: SVector<f64, N>,
}

/// Inputs of the networks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Inputs {
    /// Angles, rad.
    Angles,
    /// Sines and cosines of the angles.
    SinesAndCosines,
}

/// Linear layers beside the networks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Friction {
    /// Viscous and symmetric Coulomb friction: the earlier DeLaN in 002, table I.
    Symmetric,
    /// Viscous friction, Coulomb friction of each direction, rotor inertia: 002, section III-A.
    Nonsymmetric,
}

impl Friction {
    /// Number of coefficients of a joint.
    pub const fn width(self) -> usize {
        match self {
            Self::Symmetric => 2,
            Self::Nonsymmetric => 4,
        }
    }

    /// Columns of a joint: viscous, Coulomb, or viscous, Coulomb forward, Coulomb backward, rotor.
    fn columns(self, v: f64, a: f64) -> [f64; 4] {
        let direction = (SLOPE * v).tanh();
        match self {
            Self::Symmetric => [v, direction, 0.0, 0.0],
            Self::Nonsymmetric => [v, direction.max(0.0), direction.min(0.0), a],
        }
    }
}

/// Shape of a model.
#[derive(Clone, Debug, PartialEq)]
pub struct Shape {
    /// Inputs of both networks.
    pub inputs: Inputs,
    /// Hidden layers of both networks.
    pub hidden: Vec<(usize, Activation)>,
    /// Linear layers.
    pub friction: Friction,
    /// Upper triangular Cholesky factor instead of a lower one.
    pub upper: bool,
}

/// A model and its weights.
#[derive(Clone, Debug)]
pub struct Model<const N: usize> {
    shape: Shape,
    inertia: Network,
    potential: Network,
    scales: Scales<N>,
    /// Weights: inertia, potential, then the coefficients of each joint.
    pub weights: Vec<f64>,
}

/// Units in which the weights are near 1.
#[derive(Clone, Debug)]
struct Scales<const N: usize> {
    /// Torque per unit of effort.
    gain: SVector<f64, N>,
    /// Root of the inertia.
    joint: SVector<f64, N>,
    /// Potential energy.
    potential: f64,
    /// Effort per unit of each linear coefficient.
    linear: [[f64; 4]; N],
}

/// Root mean square of each joint.
pub fn root_mean_square<const N: usize>(values: impl Iterator<Item = SVector<f64, N>>) -> SVector<f64, N> {
    let (sum, count) =
        values.fold((SVector::zeros(), 0.0), |(sum, n), x: SVector<f64, N>| (sum + x.component_mul(&x), n + 1.0));
    (sum / f64::max(count, 1.0)).map(f64::sqrt)
}

impl<const N: usize> Model<N> {
    /// A model with random weights, scaled to these samples; `gain`: torque per unit of effort.
    pub fn new(shape: &Shape, samples: &[Sample<N>], gain: SVector<f64, N>, seed: u64) -> Self {
        let inputs = match shape.inputs {
            Inputs::Angles => N,
            Inputs::SinesAndCosines => 2 * N,
        };
        let network = |outputs| Network { inputs, hidden: shape.hidden.clone(), outputs };
        let (inertia, potential) = (network(N * (N + 1) / 2), network(1));
        let rms = |of: fn(&Sample<N>) -> SVector<f64, N>| root_mean_square(samples.iter().map(of));
        let (effort, v, a) = (rms(|s| s.effort), rms(|s| s.v), rms(|s| s.a));
        let torque = effort.component_mul(&gain);
        let scales = Scales {
            gain,
            joint: torque.zip_map(&a, |torque, a| (torque / a).sqrt()),
            potential: torque.max(),
            linear: std::array::from_fn(|j| match shape.friction {
                Friction::Symmetric => [effort[j] / v[j], effort[j], 0.0, 0.0],
                Friction::Nonsymmetric => [effort[j] / v[j], effort[j], effort[j], effort[j] / a[j]],
            }),
        };
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut weights = inertia.random(&mut random);
        weights.extend(potential.random(&mut random));
        weights.resize(weights.len() + N * shape.friction.width(), 0.0);
        Self { shape: shape.clone(), inertia, potential, scales, weights }
    }

    /// Number of the networks' weights; linear coefficients follow.
    pub fn networks(&self) -> usize {
        self.inertia.len() + self.potential.len()
    }

    /// Weight decay of each weight, of those of the networks' matrices alone: inertia and potential energy.
    pub fn decays(&self, [inertia, potential]: [f64; 2]) -> Vec<f64> {
        let of = |network: &Network, decay: f64| {
            network.matrices().map(move |of_matrix| if of_matrix { decay } else { 0.0 })
        };
        let mut decays: Vec<f64> = of(&self.inertia, inertia).chain(of(&self.potential, potential)).collect();
        decays.resize(self.weights.len(), 0.0);
        decays
    }

    /// Takes rotor inertias that are negative to 0: no rotor has one, and M(q) would grow by as much.
    pub fn bound_rotors(&mut self) {
        let (width, begin) = (self.shape.friction.width(), self.networks());
        for own in self.weights[begin..].chunks_exact_mut(width).filter(|own| own.len() > ROTOR) {
            own[ROTOR] = own[ROTOR].max(0.0);
        }
    }

    /// Coefficients of a joint's linear layers, in units of effort.
    pub fn linear(&self, joint: usize) -> [f64; 4] {
        let (width, begin) = (self.shape.friction.width(), self.networks());
        let own = |k: usize| self.weights[begin + joint * width + k] * self.scales.linear[joint][k];
        std::array::from_fn(|k| if k < width { own(k) } else { 0.0 })
    }

    /// Rotor inertia of a joint, on the joint's side.
    pub fn rotor(&self, joint: usize) -> f64 {
        self.linear(joint)[ROTOR] * self.scales.gain[joint]
    }

    /// Mass matrix without rotors of the linear layer.
    pub fn mass_matrix(&self, q: &SVector<f64, N>) -> SMatrix<f64, N, N> {
        let (lagrangians, _) = self.forward(&[*q]);
        SMatrix::from_diagonal(&self.scales.joint)
            * lagrangians[0].mass_matrix()
            * SMatrix::from_diagonal(&self.scales.joint)
    }

    /// Efforts at the samples' states.
    pub fn efforts(&self, samples: &[Sample<N>]) -> Vec<SVector<f64, N>> {
        let positions: Vec<_> = samples.iter().map(|sample| sample.q).collect();
        let (lagrangians, _) = self.forward(&positions);
        samples.iter().zip(&lagrangians).map(|(sample, lagrangian)| self.effort(sample, lagrangian)).collect()
    }

    fn effort(&self, sample: &Sample<N>, lagrangian: &Lagrangian<N>) -> SVector<f64, N> {
        let Scales { gain, joint, linear, .. } = &self.scales;
        let torques = lagrangian.efforts(&joint.component_mul(&sample.v), &joint.component_mul(&sample.a));
        let (width, begin) = (self.shape.friction.width(), self.networks());
        SVector::from_fn(|j, _| {
            let columns = self.shape.friction.columns(sample.v[j], sample.a[j]);
            let own = (0..width).map(|k| self.weights[begin + j * width + k] * linear[j][k] * columns[k]);
            joint[j] / gain[j] * torques[j] + own.sum::<f64>()
        })
    }

    /// Sum over samples and joints of importance * (effort - measured)^2; its gradient is added to `gradient`.
    pub fn error(&self, samples: &[Sample<N>], importance: &SVector<f64, N>, gradient: &mut [f64]) -> f64 {
        let positions: Vec<_> = samples.iter().map(|sample| sample.q).collect();
        let (lagrangians, [inertia_pass, potential_pass]) = self.forward(&positions);
        let Scales { gain, joint, potential, linear } = &self.scales;
        let (width, begin) = (self.shape.friction.width(), self.networks());
        let mut inertia = DMatrix::zeros(self.inertia.outputs, inertia_pass.outputs.ncols());
        let mut energy = DMatrix::zeros(1, potential_pass.outputs.ncols());
        let (mut error, n) = (0.0, samples.len());
        for (i, (sample, lagrangian)) in samples.iter().zip(&lagrangians).enumerate() {
            let residual = self.effort(sample, lagrangian) - sample.effort;
            error += residual.component_mul(&residual).dot(importance);
            let adjoint = 2.0 * residual.component_mul(importance);
            for j in 0..N {
                let columns = self.shape.friction.columns(sample.v[j], sample.a[j]);
                for k in 0..width {
                    gradient[begin + j * width + k] += adjoint[j] * linear[j][k] * columns[k];
                }
            }
            let torques = adjoint.component_mul(joint).component_div(gain);
            let (v, a) = (joint.component_mul(&sample.v), joint.component_mul(&sample.a));
            let adjoint = lagrangian.adjoint(&v, &a, &torques);
            entries::<N>(self.shape.upper, |row, column, entry| {
                let values = &inertia_pass.outputs;
                let of_tangent = |k: usize| adjoint.factor_by[k][(row, column)] / joint[k];
                if row == column {
                    let [_, slope, curvature] = Activation::Softplus.at(values[(entry, i)]);
                    let bent: f64 = (0..N).map(|k| values[(entry, i + n * (k + 1))] * of_tangent(k)).sum();
                    inertia[(entry, i)] = slope * adjoint.factor[(row, row)] + curvature * bent;
                    (0..N).for_each(|k| inertia[(entry, i + n * (k + 1))] = slope * of_tangent(k));
                } else {
                    inertia[(entry, i)] = adjoint.factor[(row, column)];
                    (0..N).for_each(|k| inertia[(entry, i + n * (k + 1))] = of_tangent(k));
                }
            });
            (0..N).for_each(|k| energy[i + n * (k + 1)] = adjoint.potential_by[k] * potential / joint[k]);
        }
        let (of_inertia, of_potential) = gradient[..begin].split_at_mut(self.inertia.len());
        let (inertia_weights, potential_weights) = self.weights[..begin].split_at(self.inertia.len());
        self.inertia.backward(inertia_weights, &inertia_pass, inertia, of_inertia);
        self.potential.backward(potential_weights, &potential_pass, energy, of_potential);
        error
    }

    /// Lagrangians at these positions, and the passes of both networks.
    fn forward(&self, positions: &[SVector<f64, N>]) -> (Vec<Lagrangian<N>>, [Pass; 2]) {
        let (inputs, n) = (self.inputs(positions), positions.len());
        let (inertia, potential) = self.weights[..self.networks()].split_at(self.inertia.len());
        let inertia = self.inertia.forward(inertia, n, inputs.clone());
        let potential = self.potential.forward(potential, n, inputs);
        let Scales { joint, potential: energy, .. } = &self.scales;
        let lagrangian = |i: usize| {
            let mut factor = SMatrix::zeros();
            let mut factor_by = [SMatrix::zeros(); N];
            entries::<N>(self.shape.upper, |row, column, entry| {
                let [value, slope, _] = match inertia.outputs[(entry, i)] {
                    raw if row == column => Activation::Softplus.at(raw),
                    raw => [raw, 1.0, 0.0],
                };
                factor[(row, column)] = value;
                for (k, by) in factor_by.iter_mut().enumerate() {
                    by[(row, column)] = slope * inertia.outputs[(entry, i + n * (k + 1))] / joint[k];
                }
            });
            let potential_by = SVector::from_fn(|k, _| energy * potential.outputs[i + n * (k + 1)] / joint[k]);
            Lagrangian { factor, factor_by, potential_by }
        };
        ((0..n).map(lagrangian).collect(), [inertia, potential])
    }

    /// Inputs of the networks with their tangents.
    fn inputs(&self, positions: &[SVector<f64, N>]) -> DMatrix<f64> {
        let n = positions.len();
        let mut inputs = DMatrix::zeros(self.inertia.inputs, n * (N + 1));
        for (i, q) in positions.iter().enumerate() {
            for j in 0..N {
                let tangent = i + n * (j + 1);
                match self.shape.inputs {
                    Inputs::Angles => {
                        inputs[(j, i)] = q[j];
                        inputs[(j, tangent)] = 1.0;
                    }
                    Inputs::SinesAndCosines => {
                        let (sine, cosine) = q[j].sin_cos();
                        (inputs[(j, i)], inputs[(N + j, i)]) = (sine, cosine);
                        (inputs[(j, tangent)], inputs[(N + j, tangent)]) = (cosine, -sine);
                    }
                }
            }
        }
        inputs
    }
}

/// Calls `of` with row, column and place among the outputs of each entry of a triangle.
fn entries<const N: usize>(upper: bool, mut of: impl FnMut(usize, usize, usize)) {
    (0..N).for_each(|row| {
        (0..=row).for_each(|column| {
            let entry = row * (row + 1) / 2 + column;
            if upper { of(column, row, entry) } else { of(row, column, entry) }
        })
    });
}
