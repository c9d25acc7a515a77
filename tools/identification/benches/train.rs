//! Cost of an epoch of training: one evaluation of the normal equations of the 5-5-5-5-1 network on one core.
//!
//! Run with `cargo bench -p identification --bench train`. The time must grow in proportion to the number of samples.

use divan::Bencher;
use divan::counter::ItemsCount;
use identification::levenberg_marquardt::LeastSquares;
use identification::network::{FIRMWARE_HIDDEN, INPUTS, InputBox, Shape};
use identification::train::TrainingSet;
use identification::train::batch::Batch;
use identification::train::normal_equations::NetworkFit;
use identification::train::weights::nguyen_widrow;
use nalgebra::DVector;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const SAMPLES: [usize; 3] = [2_000, 20_000, 200_000];

fn main() {
    divan::main();
}

fn on_one_core(bencher: Bencher, samples: usize, run: impl Fn(&NetworkFit, &DVector<f64>) + Sync) {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let inputs = (0..samples).map(|_| std::array::from_fn(|_| random.random_range(-1.0..1.0))).collect();
    let targets = (0..samples).map(|_| random.random_range(-1.0..1.0)).collect();
    let limits = InputBox::new([-1.0; INPUTS], [1.0; INPUTS], [true; INPUTS]).expect("a box of width 2");
    let batch = Batch::new(&TrainingSet::unweighted(inputs, targets), &limits, 1.0);
    let shape = Shape::new(INPUTS, &FIRMWARE_HIDDEN).expect("no layer is empty");
    let fit = NetworkFit::new(&shape, &batch, 1e-6);
    let x = DVector::from_vec(nguyen_widrow(&shape, &mut random));
    let one_core = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("one thread");
    bencher.counter(ItemsCount::new(samples)).bench_local(|| one_core.install(|| run(&fit, &x)));
}

#[divan::bench(args = SAMPLES)]
fn normal_equations(bencher: Bencher, samples: usize) {
    on_one_core(bencher, samples, |fit, x| drop(divan::black_box(fit.normal_equations(x))));
}

#[divan::bench(args = SAMPLES)]
fn cost(bencher: Bencher, samples: usize) {
    on_one_core(bencher, samples, |fit, x| {
        divan::black_box(fit.cost(x));
    });
}
