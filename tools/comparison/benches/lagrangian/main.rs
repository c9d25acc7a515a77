//! Writes docs/lagrangian-networks.md: Deep Lagrangian Networks (002) beside least squares on a UR10e.
//!
//! `cargo bench -p comparison --bench lagrangian > docs/lagrangian-networks.md`; minutes. `JOINT_DATA` names the
//! folder of the recordings.

mod page;

use comparison::lagrangian::train::mean_square;
use comparison::lagrangian::{Activation, Friction, Inputs, Model, Sample, Shape, Training};
use identification::fit::Options as JointOptions;
use identification::progress::Silent;
use identification::samples::Part;
use nalgebra::SVector;
use rayon::prelude::*;
use robot::equations::Rows;
use robot::friction_columns::Friction as Columns;
use robot::least_squares::{Weighting, base, solve};
use robot::{Options, Recording, fit, record};
use std::path::Path;
use std::time::Instant;

/// Joints of the robot.
const JOINTS: usize = 6;
/// Parts of the training recordings, %.
const SHARES: [usize; 5] = [20, 40, 60, 80, 100];
/// Seeds of the models on all of the training recordings.
const SEEDS: u64 = 3;

/// A shape of the networks and the weight decay with it.
pub struct Candidate {
    /// Inputs of both networks.
    pub inputs: Inputs,
    /// Hidden layers of both networks.
    pub hidden: &'static [(usize, Activation)],
    /// Weight decay, of inertia and potential energy.
    pub decay: [f64; 2],
}

/// Candidates, of which the one is taken that is best where a model learns from one training motion and is judged on
/// the other.
pub const CANDIDATES: [Candidate; 8] = [
    Candidate { inputs: Inputs::Angles, hidden: SINE, decay: [0.3, 0.3] },
    Candidate { inputs: Inputs::Angles, hidden: SINE, decay: [1.0, 0.1] },
    Candidate { inputs: Inputs::Angles, hidden: SINE, decay: [1.0, 0.3] },
    Candidate { inputs: Inputs::Angles, hidden: SINE, decay: [3.0, 0.3] },
    Candidate { inputs: Inputs::Angles, hidden: SINE, decay: [1.0, 1.0] },
    Candidate { inputs: Inputs::Angles, hidden: SINES, decay: [1.0, 0.3] },
    Candidate { inputs: Inputs::SinesAndCosines, hidden: SOFTPLUS, decay: [0.3, 0.3] },
    Candidate { inputs: Inputs::SinesAndCosines, hidden: TANH, decay: [1.0, 0.3] },
];

/// Hidden layers of the candidates.
const SOFTPLUS: &[(usize, Activation)] = &[(32, Activation::Softplus), (32, Activation::Softplus)];
const TANH: &[(usize, Activation)] = &[(32, Activation::Tanh), (32, Activation::Tanh)];
const SINE: &[(usize, Activation)] = &[(64, Activation::Sine)];
const SINES: &[(usize, Activation)] = &[(32, Activation::Sine), (32, Activation::Sine)];

impl Candidate {
    /// A trained model.
    fn trained(&self, [train, validation]: &[Vec<Sample<JOINTS>>; 2], gain: &Gain, job: Job) -> Model<JOINTS> {
        let shape = Shape { inputs: self.inputs, hidden: self.hidden.to_vec(), friction: job.friction, upper: false };
        let mut model = Model::new(&shape, train, *gain, job.seed);
        let training =
            Training { epochs: 80, batch: 128, rate: 0.02, decay: self.decay, every: 4, power: 1.0, seed: job.seed };
        training.run(&mut model, train, validation);
        model
    }
}

/// Torque per unit of effort.
type Gain = SVector<f64, JOINTS>;

/// A training.
#[derive(Clone, Copy, PartialEq)]
struct Job {
    /// Place among the shares.
    at: usize,
    friction: Friction,
    seed: u64,
}

/// Mean square errors of one model on the test motion.
pub struct Row {
    /// Part of the training recordings, %.
    pub share: usize,
    /// The model.
    pub model: &'static str,
    /// Mean square error of each joint, A^2.
    pub errors: SVector<f64, JOINTS>,
}

/// Coefficients of a joint: viscous, Coulomb forward and backward, rotor inertia.
pub type Coefficients = [f64; 4];

/// Everything that the page tells.
pub struct Results {
    /// Means over joints of each candidate's mean square errors, from each training motion to the other.
    pub choice: Vec<[f64; 2]>,
    /// Place of the candidate that was taken.
    pub chosen: usize,
    /// Errors, share by share.
    pub rows: Vec<Row>,
    /// Means over joints of the errors of DeLaN + NSCF on all of the recordings, for each seed.
    pub seeds: Vec<f64>,
    /// Coefficients of each joint by least squares; the flag: its rotor inertia is a base parameter by itself.
    pub least_squares: Vec<(Coefficients, bool)>,
    /// Coefficients of each joint by DeLaN + NSCF.
    pub learned: Vec<Coefficients>,
    /// Samples of training, validation and test.
    pub samples: [usize; 3],
    /// Weights of DeLaN + NSCF.
    pub weights: usize,
    /// Time of all trainings, s.
    pub seconds: f64,
}

fn main() {
    if !std::env::args().any(|argument| argument == "--bench") {
        return;
    }
    let data = std::env::var("JOINT_DATA").expect("JOINT_DATA names the folder of the recordings");
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../jointctl/robots/ur10e_fourier.toml");
    let whole = record(&file, &|name: &str| (name == "JOINT_DATA").then(|| data.clone())).expect("the recordings");
    let used = (0..whole.len()).filter(|&i| matches!(whole.part(i), Part::Train | Part::Validation)).count();
    let period = whole.joints[0].samples.period();
    let part = |share: usize| {
        let mut recording = whole.clone();
        recording.keep_first(used as f64 * period * share as f64 / 100.0);
        recording
    };
    let recordings: Vec<(usize, Recording)> = SHARES.iter().map(|&share| (share, part(share))).collect();

    let gain = SVector::from_fn(|j, _| whole.robot.drives[j].gain);
    let begin = Instant::now();
    let choice = choice(&whole, &gain);
    let mean = |at: &usize| choice[*at].iter().sum::<f64>();
    let chosen = (0..CANDIDATES.len()).min_by(|a, b| mean(a).total_cmp(&mean(b))).expect("candidates");
    let job = |at, friction, seed| Job { at, friction, seed };
    let last = recordings.len() - 1;
    let mut jobs: Vec<Job> = (0..recordings.len())
        .flat_map(|at| [Friction::Symmetric, Friction::Nonsymmetric].map(|friction| job(at, friction, 1)))
        .chain((2..=SEEDS).map(|seed| job(last, Friction::Nonsymmetric, seed)))
        .collect();
    // The longest first: both cores are busy to the end.
    jobs.reverse();
    let train = |job: &Job| {
        let parts = [Part::Train, Part::Validation].map(|part| samples(&recordings[job.at].1, part));
        CANDIDATES[chosen].trained(&parts, &gain, *job)
    };
    let models: Vec<Model<JOINTS>> = jobs.par_iter().with_max_len(1).map(train).collect();
    let seconds = begin.elapsed().as_secs_f64();

    let test = samples(&whole, Part::Test);
    let model = |at: usize, friction, seed| {
        let wanted = job(at, friction, seed);
        &models[jobs.iter().position(|job| *job == wanted).expect("a model of each job")]
    };
    let mut rows = Vec::new();
    for (at, (share, recording)) in recordings.iter().enumerate() {
        let mut row = |model, errors| rows.push(Row { share: *share, model, errors });
        row("IDIM-LS", least_squares(recording, Weighting::Ordinary).0);
        row("IDIM-LS, weighted", least_squares(recording, Weighting::ByJoint).0);
        row("DeLaN", mean_square(model(at, Friction::Symmetric, 1), &test));
        row("DeLaN + NSCF", mean_square(model(at, Friction::Nonsymmetric, 1), &test));
    }
    rows.push(Row { share: 100, model: "images of this project", errors: images(&whole) });
    let best = model(last, Friction::Nonsymmetric, 1);
    let coefficients = |j: usize| {
        let [viscous, forward, backward, _] = best.linear(j);
        [viscous, forward, backward, best.rotor(j)]
    };
    let seeds = (1..=SEEDS).map(|seed| mean_square(model(last, Friction::Nonsymmetric, seed), &test).mean());
    let results = Results {
        choice,
        chosen,
        rows,
        seeds: seeds.collect(),
        least_squares: least_squares(&whole, Weighting::ByJoint).1,
        learned: (0..JOINTS).map(coefficients).collect(),
        samples: [Part::Train, Part::Validation, Part::Test].map(|part| samples(&whole, part).len()),
        weights: best.weights.len(),
        seconds,
    };
    page::write(&results);
    page::check(&results);
}

fn sample(recording: &Recording, i: usize) -> Sample<JOINTS> {
    let [q, v, a] = recording.state(i).map(|x| SVector::from_column_slice(&x));
    Sample { q, v, a, effort: SVector::from_fn(|j, _| recording.joints[j].samples.effort[i]) }
}

/// Samples of one use.
fn samples(recording: &Recording, part: Part) -> Vec<Sample<JOINTS>> {
    (0..recording.len()).filter(|&i| recording.part(i) == part).map(|i| sample(recording, i)).collect()
}

/// Mean square errors of each candidate that learns from one training motion, on the other: mean over the joints.
fn choice(recording: &Recording, gain: &Gain) -> Vec<[f64; 2]> {
    let of = |run: u32, parts: &[Part]| -> Vec<Sample<JOINTS>> {
        let own = |i: &usize| recording.joints[0].samples.run[*i] == run && parts.contains(&recording.part(*i));
        (0..recording.len()).filter(own).map(|i| sample(recording, i)).collect()
    };
    let jobs: Vec<(&Candidate, u32)> = CANDIDATES.iter().flat_map(|one| [(one, 0), (one, 1)]).collect();
    let error = |(candidate, run): &(&Candidate, u32)| {
        let parts = [of(*run, &[Part::Train]), of(*run, &[Part::Validation])];
        let job = Job { at: 0, friction: Friction::Nonsymmetric, seed: 1 };
        let model = candidate.trained(&parts, gain, job);
        mean_square(&model, &of(1 - run, &[Part::Train, Part::Validation])).mean()
    };
    let errors: Vec<f64> = jobs.par_iter().with_max_len(1).map(error).collect();
    errors.chunks_exact(2).map(|pair| [pair[0], pair[1]]).collect()
}

/// Mean square errors of least squares on the test samples, and its coefficients of each joint.
fn least_squares(recording: &Recording, weighting: Weighting) -> (SVector<f64, JOINTS>, Vec<(Coefficients, bool)>) {
    let rows = Rows::of(recording, Columns::Simple, None);
    let base = base(&recording.robot, 1);
    let unknowns = solve(&rows, &base, weighting).unknowns;
    let test: Vec<usize> = (0..recording.len()).filter(|&i| recording.part(i) == Part::Test).collect();
    let error = |j: usize| test.iter().map(|&i| rows.residual(&unknowns, j, i).powi(2)).sum::<f64>();
    let errors = SVector::from_fn(|j, _| error(j) / test.len() as f64);
    let coefficients = |j: usize| {
        let own = rows.layout.rigid() + Columns::Simple.width(false) * j;
        let (viscous, coulomb, offset) = (unknowns[own], unknowns[own + 1], unknowns[own + 2]);
        let rotor = rows.layout.inertial() + j;
        let alone = base.independent.iter().position(|&column| column == rotor);
        let alone = alone.is_some_and(|row| base.combination.row(row).iter().all(|entry| *entry == 0.0));
        ([viscous, coulomb + offset, coulomb - offset, unknowns[rotor]], alone)
    };
    (errors, (0..JOINTS).map(coefficients).collect())
}

/// Mean square errors of this project's images on the test samples (docs/robot.md).
fn images(recording: &Recording) -> SVector<f64, JOINTS> {
    let joint = JointOptions { trainer: None, reference: false, ..JointOptions::default() };
    let fitted = fit(&mut recording.clone(), &Options { joint, seconds: None }, &Silent).expect("images");
    SVector::from_fn(|j, _| fitted.errors[j].image.powi(2))
}
