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
    /// Inputs of all networks.
    pub inputs: Inputs,
    /// Hidden layers of each network of the inertia.
    pub inertia: Vec<(usize, Activation)>,
    /// Hidden layers of the potential energy's network.
    pub potential: Vec<(usize, Activation)>,
    /// Linear layers.
    pub friction: Friction,
    /// Knowledge of the robot's links.
    pub structure: Structure,
}

/// Knowledge of the robot's links in a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Structure {
    /// Nothing: one network for all of a lower Cholesky factor.
    Any,
    /// Joints are those of a serial chain, from the base on: M = U U^T with an upper triangular U, whose row i depends
    /// on the positions after the i-th alone. A network for each row.
    Chain,
}

/// Weights that a training changes, beside those of the linear layers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Learned {
    /// All weights. Matrices decay to 0, biases do not.
    All,
    /// The networks' outputs, a linear combination of what their hidden layers have learned before. Its weights decay
    /// to what they were.
    Outputs,
}

/// Treatment of a weight by a training.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rule {
    /// True if it is changed.
    pub learned: bool,
    /// Weight decay.
    pub decay: f64,
}

/// A network for entries of the Cholesky factor.
#[derive(Clone, Debug)]
struct Block {
    network: Network,
    /// The first position that is an input; all after it are.
    from: usize,
    /// Row and column of each output.
    entries: Vec<(usize, usize)>,
}

/// A model and its weights.
#[derive(Clone, Debug)]
pub struct Model<const N: usize> {
    shape: Shape,
    inertia: Vec<Block>,
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
        let network = |from: usize, hidden: &[(usize, Activation)], outputs| Network {
            inputs: shape.inputs.of(N - from),
            hidden: hidden.to_vec(),
            outputs,
        };
        let block = |from, entries: Vec<(usize, usize)>| Block {
            network: network(from, &shape.inertia, entries.len()),
            from,
            entries,
        };
        let inertia = match shape.structure {
            Structure::Any => {
                vec![block(0, (0..N).flat_map(|row| (0..=row).map(move |column| (row, column))).collect())]
            }
            Structure::Chain => {
                (0..N).map(|row| block(row + 1, (row..N).map(|column| (row, column)).collect())).collect()
            }
        };
        let potential = network(0, &shape.potential, 1);
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
        let mut weights: Vec<f64> = inertia.iter().flat_map(|block| block.network.random(&mut random)).collect();
        weights.extend(potential.random(&mut random));
        weights.resize(weights.len() + N * shape.friction.width(), 0.0);
        Self { shape: shape.clone(), inertia, potential, scales, weights }
    }

    /// Number of the networks' weights; linear coefficients follow.
    pub fn networks(&self) -> usize {
        self.of_inertia() + self.potential.len()
    }

    /// Number of the weights of the inertia's networks.
    fn of_inertia(&self) -> usize {
        self.inertia.iter().map(|block| block.network.len()).sum()
    }

    /// Rule of each weight, with the decay of inertia and potential energy.
    pub fn rules(&self, learned: Learned, [inertia, potential]: [f64; 2]) -> Vec<Rule> {
        let of = |network: &Network, decay: f64| -> Vec<Rule> {
            let decayed = move |decays: bool| Rule { learned: true, decay: if decays { decay } else { 0.0 } };
            match learned {
                Learned::All => network.matrices().map(decayed).collect(),
                Learned::Outputs => {
                    let rule = |output: bool| Rule { learned: output, ..decayed(output) };
                    network.output_layer().map(rule).collect()
                }
            }
        };
        let mut rules: Vec<Rule> = self.inertia.iter().flat_map(|block| of(&block.network, inertia)).collect();
        rules.extend(of(&self.potential, potential));
        rules.resize(self.weights.len(), Rule { learned: true, decay: 0.0 });
        rules
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
        let (lagrangians, passes) = self.forward(&positions);
        let Scales { gain, joint, potential, linear } = &self.scales;
        let (width, begin) = (self.shape.friction.width(), self.networks());
        let zeros = |pass: &Pass| DMatrix::zeros(pass.outputs.nrows(), pass.outputs.ncols());
        let mut inertia: Vec<DMatrix<f64>> = passes.inertia.iter().map(zeros).collect();
        let mut energy: DMatrix<f64> = zeros(&passes.potential);
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
            for ((block, pass), inertia) in self.inertia.iter().zip(&passes.inertia).zip(&mut inertia) {
                let values = &pass.outputs;
                for (entry, &(row, column)) in block.entries.iter().enumerate() {
                    let of_tangent = |k: usize| adjoint.factor_by[k][(row, column)] / joint[k];
                    let tangent = |k: usize| (entry, i + n * (k - block.from + 1));
                    if row == column {
                        let [_, slope, curvature] = Activation::Softplus.at(values[(entry, i)]);
                        let bent: f64 = (block.from..N).map(|k| values[tangent(k)] * of_tangent(k)).sum();
                        inertia[(entry, i)] = slope * adjoint.factor[(row, row)] + curvature * bent;
                        (block.from..N).for_each(|k| inertia[tangent(k)] = slope * of_tangent(k));
                    } else {
                        inertia[(entry, i)] = adjoint.factor[(row, column)];
                        (block.from..N).for_each(|k| inertia[tangent(k)] = of_tangent(k));
                    }
                }
            }
            (0..N).for_each(|k| energy[i + n * (k + 1)] = adjoint.potential_by[k] * potential / joint[k]);
        }
        let mut place = 0;
        for ((block, pass), adjoint) in self.inertia.iter().zip(&passes.inertia).zip(inertia) {
            let own = place..place + block.network.len();
            place = own.end;
            block.network.backward(&self.weights[own.clone()], pass, adjoint, &mut gradient[own]);
        }
        self.potential.backward(&self.weights[place..begin], &passes.potential, energy, &mut gradient[place..begin]);
        error
    }

    /// Lagrangians at these positions, and the passes of all networks.
    fn forward(&self, positions: &[SVector<f64, N>]) -> (Vec<Lagrangian<N>>, Passes) {
        let n = positions.len();
        let (mut place, mut inertia) = (0, Vec::new());
        for block in &self.inertia {
            let own = place..place + block.network.len();
            place = own.end;
            let inputs = self.shape.inputs.with_tangents(positions, block.from);
            inertia.push(block.network.forward(&self.weights[own], n, inputs));
        }
        let inputs = self.shape.inputs.with_tangents(positions, 0);
        let potential = self.potential.forward(&self.weights[place..self.networks()], n, inputs);
        let Scales { joint, potential: energy, .. } = &self.scales;
        let lagrangian = |i: usize| {
            let mut factor = SMatrix::zeros();
            let mut factor_by = [SMatrix::zeros(); N];
            for (block, pass) in self.inertia.iter().zip(&inertia) {
                for (entry, &(row, column)) in block.entries.iter().enumerate() {
                    let [value, slope, _] = match pass.outputs[(entry, i)] {
                        raw if row == column => Activation::Softplus.at(raw),
                        raw => [raw, 1.0, 0.0],
                    };
                    factor[(row, column)] = value;
                    for k in block.from..N {
                        let tangent = pass.outputs[(entry, i + n * (k - block.from + 1))];
                        factor_by[k][(row, column)] = slope * tangent / joint[k];
                    }
                }
            }
            let potential_by = SVector::from_fn(|k, _| energy * potential.outputs[i + n * (k + 1)] / joint[k]);
            Lagrangian { factor, factor_by, potential_by }
        };
        ((0..n).map(lagrangian).collect(), Passes { inertia, potential })
    }
}

/// Passes of all networks.
struct Passes {
    inertia: Vec<Pass>,
    potential: Pass,
}

impl Inputs {
    /// Number of inputs for a number of positions.
    fn of(self, positions: usize) -> usize {
        match self {
            Self::Angles => positions,
            Self::SinesAndCosines => 2 * positions,
        }
    }

    /// Inputs by the positions from one on, and their tangents.
    fn with_tangents<const N: usize>(self, positions: &[SVector<f64, N>], from: usize) -> DMatrix<f64> {
        let (n, used) = (positions.len(), N - from);
        let mut inputs = DMatrix::zeros(self.of(used), n * (used + 1));
        for (i, q) in positions.iter().enumerate() {
            for j in 0..used {
                let tangent = i + n * (j + 1);
                match self {
                    Self::Angles => {
                        inputs[(j, i)] = q[from + j];
                        inputs[(j, tangent)] = 1.0;
                    }
                    Self::SinesAndCosines => {
                        let (sine, cosine) = q[from + j].sin_cos();
                        (inputs[(j, i)], inputs[(used + j, i)]) = (sine, cosine);
                        (inputs[(j, tangent)], inputs[(used + j, tangent)]) = (cosine, -sine);
                    }
                }
            }
        }
        inputs
    }
}
