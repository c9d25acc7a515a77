//! J^T J, J^T r and cost of a network over many samples: the hot loop of training; host.
//!
//! The Jacobian exists for one block of samples at a time, in panels of four parameters, so that a 4 x 4 tile of J^T J
//! is accumulated in registers while two panels stream past. The errors are one more column of the Jacobian: the last
//! row of the product is then J^T r and its last entry the cost. Only tiles on and below the diagonal are formed. Its
//! time: `cargo bench -p identification --bench train`.

use super::batch::{BLOCK, Batch, Block, Column, PIECE, Pass};
use super::wide_vectors::{Loop, on_wide_vectors};
use crate::levenberg_marquardt::{LeastSquares, NormalEquations};
use crate::network::Shape;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Columns in a panel of the Jacobian: sixteen sums and their operands fill the sixteen registers of the baseline.
const PANEL: usize = 4;

type Tile = [[f64; PANEL]; PANEL];

/// A network's weighted mean squared error plus a penalty on large weights, as a function of its parameters.
///
/// cost = sum_i w_i ((y_i - t_i) / scale)^2 / sum_i w_i + decay |parameters|^2
#[derive(Clone, Debug)]
pub struct NetworkFit<'a> {
    shape: &'a Shape,
    samples: &'a Batch,
    decay: f64,
}

impl<'a> NetworkFit<'a> {
    /// The fit of a network of `shape` (whose inputs are the batch's active inputs) to `samples`; `decay` >= 0.
    pub fn new(shape: &'a Shape, samples: &'a Batch, decay: f64) -> Self {
        Self { shape, samples, decay }
    }

    /// The part of the cost that `decay` adds.
    pub fn penalty(&self, parameters: &[f64]) -> f64 {
        self.decay * parameters.iter().map(|p| p * p).sum::<f64>()
    }
}

impl LeastSquares for NetworkFit<'_> {
    fn cost(&self, x: &DVector<f64>) -> f64 {
        self.samples.mean_squared_error(self.shape, x.as_slice()) + self.penalty(x.as_slice())
    }

    fn normal_equations(&self, x: &DVector<f64>) -> NormalEquations {
        let panels = panels(self.shape.parameter_count());
        let pieces: Vec<Vec<Tile>> = self
            .samples
            .blocks
            .par_chunks(PIECE)
            .map(|piece| on_wide_vectors(Products { shape: self.shape, parameters: x.as_slice(), piece }))
            .collect();
        let mut total = vec![Tile::default(); panels * (panels + 1) / 2];
        for piece in &pieces {
            for (sum, part) in total.iter_mut().flatten().flatten().zip(piece.iter().flatten().flatten()) {
                *sum += part;
            }
        }
        self.unpack(&total, x)
    }
}

/// The products of all columns of the Jacobian and the errors over a piece of work.
struct Products<'a> {
    shape: &'a Shape,
    parameters: &'a [f64],
    piece: &'a [Block],
}

impl Loop for Products<'_> {
    type Output = Vec<Tile>;

    #[inline(always)]
    fn run(self) -> Vec<Tile> {
        let Self { shape, parameters, piece } = self;
        let count = shape.parameter_count();
        let panels = panels(count);
        let mut pass = Pass::new(shape);
        let mut jacobian = vec![[[0.0; PANEL]; BLOCK]; panels];
        let mut tiles = vec![Tile::default(); panels * (panels + 1) / 2];
        for block in piece {
            pass.forward(parameters, block);
            store_column(&mut jacobian, count, &pass.weighted_errors(block), None);
            pass.backward(parameters, block, |p, slope, value| store_column(&mut jacobian, p, slope, value));
            accumulate(&mut tiles, &jacobian);
        }
        tiles
    }
}

/// Panels of the columns of `parameters` parameters and of the errors.
fn panels(parameters: usize) -> usize {
    (parameters + 1).div_ceil(PANEL)
}

impl NetworkFit<'_> {
    /// Matrix, gradient and cost out of the tiles, with the penalty on the weights.
    fn unpack(&self, tiles: &[Tile], x: &DVector<f64>) -> NormalEquations {
        let count = x.len();
        let at = |row: usize, column: usize| {
            let (i, j) = (row / PANEL, column / PANEL);
            tiles[i * (i + 1) / 2 + j][row % PANEL][column % PANEL]
        };
        let mut hessian = DMatrix::from_fn(count, count, |i, j| at(i.max(j), i.min(j)));
        for i in 0..count {
            hessian[(i, i)] += self.decay;
        }
        let gradient = DVector::from_fn(count, |i, _| at(count, i) + self.decay * x[i]);
        NormalEquations { cost: at(count, count) + self.penalty(x.as_slice()), gradient, hessian }
    }
}

#[inline(always)]
fn store_column(jacobian: &mut [[[f64; PANEL]; BLOCK]], parameter: usize, slope: &Column, value: Option<&Column>) {
    let panel = &mut jacobian[parameter / PANEL];
    let lane = parameter % PANEL;
    match value {
        Some(value) => {
            for s in 0..BLOCK {
                panel[s][lane] = slope[s] * value[s];
            }
        }
        None => {
            for s in 0..BLOCK {
                panel[s][lane] = slope[s];
            }
        }
    }
}

/// Adds the products of all pairs of panels of a block.
#[inline(always)]
fn accumulate(tiles: &mut [Tile], jacobian: &[[[f64; PANEL]; BLOCK]]) {
    let mut tiles = tiles.iter_mut();
    for (i, rows) in jacobian.iter().enumerate() {
        for (columns, tile) in jacobian[..=i].iter().zip(&mut tiles) {
            let mut sum = *tile;
            for (row, column) in rows.iter().zip(columns) {
                for a in 0..PANEL {
                    for b in 0..PANEL {
                        sum[a][b] += row[a] * column[b];
                    }
                }
            }
            *tile = sum;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::{FIRMWARE_HIDDEN, INPUTS, InputBox, Network};
    use crate::train::TrainingSet;
    use crate::train::weights::nguyen_widrow;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    const DECAY: f64 = 0.01;

    /// 150 weighted samples (two full blocks and a part of one), the third input unused.
    fn problem() -> (TrainingSet, InputBox, Shape, DVector<f64>) {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let inputs: Vec<[f64; INPUTS]> =
            (0..150).map(|_| std::array::from_fn(|_| random.random_range(-1.0..1.0))).collect();
        let targets = (0..150).map(|_| random.random_range(-3.0..3.0)).collect();
        let weights = (0..150).map(|_| random.random_range(0.1..2.0)).collect();
        let limits = InputBox::new([-0.9; INPUTS], [0.8; INPUTS], [true, true, false, true, true]).unwrap();
        let shape = Shape::new(4, &FIRMWARE_HIDDEN).unwrap();
        let x = DVector::from_vec(nguyen_widrow(&shape, &mut random));
        (TrainingSet { inputs, targets, weights }, limits, shape, x)
    }

    /// Weighted errors straight from the network's own definition.
    fn errors(set: &TrainingSet, limits: InputBox, x: &DVector<f64>) -> DVector<f64> {
        let network = Network::from_active(&FIRMWARE_HIDDEN, limits, 1.0, x.as_slice()).unwrap();
        let total: f64 = set.weights.iter().sum();
        DVector::from_fn(set.targets.len(), |i, _| {
            (network.evaluate(&set.inputs[i]) - set.targets[i]) * (set.weights[i] / total).sqrt()
        })
    }

    #[test]
    fn the_derivative_by_every_weight_agrees_with_finite_differences() {
        let (set, limits, shape, x) = problem();
        let h = 1e-5;
        let columns: Vec<DVector<f64>> = (0..x.len())
            .map(|p| {
                let [up, down] = [h, -h].map(|h| {
                    let mut moved = x.clone();
                    moved[p] += h;
                    errors(&set, limits, &moved)
                });
                (up - down) / (2.0 * h)
            })
            .collect();
        let jacobian = DMatrix::from_columns(&columns);
        let r = errors(&set, limits, &x);
        let cost = r.norm_squared() + DECAY * x.norm_squared();
        let gradient = jacobian.transpose() * &r + DECAY * &x;
        let hessian = jacobian.transpose() * &jacobian + DMatrix::identity(x.len(), x.len()) * DECAY;

        let batch = Batch::new(&set, &limits, 1.0);
        let found = NetworkFit::new(&shape, &batch, DECAY).normal_equations(&x);
        assert!((found.cost - cost).abs() < 1e-12);
        for p in 0..x.len() {
            assert!(
                (found.gradient[p] - gradient[p]).abs() < 1e-8,
                "weight {p}: {} {}",
                found.gradient[p],
                gradient[p]
            );
        }
        assert!((found.hessian - hessian).amax() < 1e-8);
    }

    #[test]
    fn the_cost_alone_is_the_cost_of_the_normal_equations() {
        let (set, limits, shape, x) = problem();
        let batch = Batch::new(&set, &limits, 2.0);
        let fit = NetworkFit::new(&shape, &batch, DECAY);
        let (alone, whole) = (fit.cost(&x), fit.normal_equations(&x).cost);
        assert!((alone - whole).abs() < 1e-12 * whole, "{alone} {whole}");
    }

    #[test]
    fn the_kind_of_vectors_changes_no_bit() {
        let (set, limits, shape, x) = problem();
        let batch = Batch::new(&set, &limits, 1.0);
        let products = || Products { shape: &shape, parameters: x.as_slice(), piece: &batch.blocks };
        let bits = |tiles: Vec<Tile>| -> Vec<u64> { tiles.into_iter().flatten().flatten().map(f64::to_bits).collect() };
        assert_eq!(bits(on_wide_vectors(products())), bits(products().run()));
    }

    #[test]
    fn samples_of_weight_zero_change_no_bit() {
        let (mut set, limits, shape, x) = problem();
        let without = NetworkFit::new(&shape, &Batch::new(&set, &limits, 1.0), DECAY).normal_equations(&x);
        set.inputs.insert(70, [0.3; INPUTS]);
        set.targets.insert(70, 1e9);
        set.weights.insert(70, 0.0);
        let with = NetworkFit::new(&shape, &Batch::new(&set, &limits, 1.0), DECAY).normal_equations(&x);
        assert_eq!((with.cost, with.gradient, with.hessian), (without.cost, without.gradient, without.hessian));
    }

    #[test]
    fn a_weight_of_two_is_the_sample_twice() {
        let (mut set, limits, shape, x) = problem();
        set.weights.fill(1.0);
        let mut twice = set.clone();
        set.weights[17] = 2.0;
        twice.inputs.push(set.inputs[17]);
        twice.targets.push(set.targets[17]);
        twice.weights.push(1.0);
        let [one, two] =
            [set, twice].map(|set| NetworkFit::new(&shape, &Batch::new(&set, &limits, 1.0), 0.0).normal_equations(&x));
        assert!((one.cost - two.cost).abs() < 1e-13 && (one.hessian - two.hessian).amax() < 1e-13);
    }
}
