//! Writes docs/lagrangian-networks.md: Deep Lagrangian Networks (002) beside least squares on a UR10e.
//!
//! `cargo bench -p comparison --bench lagrangian > docs/lagrangian-networks.md`; minutes. `JOINT_DATA` names the
//! folder of the recordings.

mod page;

use comparison::lagrangian::train::{importance, mean_square};
use comparison::lagrangian::{
    Activation, Friction, Inputs, Learned, Model, Sample, Shape, Structure, Training, from_links,
};
use identification::fit::Options as JointOptions;
use identification::progress::Silent;
use identification::samples::Part;
use nalgebra::SVector;
use rayon::prelude::*;
use rigid_body::Robot;
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
/// Seeds of the models by which a candidate is taken.
pub const CHOICE_SEEDS: u64 = 2;

/// A shape of the networks, and how they learn from a recording.
pub struct Candidate {
    /// Inputs of all networks.
    pub inputs: Inputs,
    /// Hidden layers of the networks of inertia and potential energy.
    pub hidden: [Layers; 2],
    /// Knowledge of the links.
    pub known: Known,
    /// Weight decays that are tried, of inertia and potential energy, where a model learns from [`DECAYED`] samples.
    pub decays: &'static [[f64; 2]],
}

/// Samples that a candidate's weight decay is stated for. It is less in proportion where there are more of them: they
/// outweigh what was known before.
pub const DECAYED: f64 = 4_000.0;

/// Widths and nonlinearities of hidden layers.
type Layers = &'static [(usize, Activation)];

/// Knowledge of the robot before a model learns from a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Known {
    /// Drive gains alone: the paper's setting.
    Gains,
    /// That the joints are a chain, and the links of the URDF.
    Links,
}

/// Candidates. Of each knowledge the one is taken that is best where a model learns from one training motion and is
/// judged on the other.
pub static CANDIDATES: [Candidate; 8] = [
    alike(Inputs::Angles, SINE, &[[0.3, 0.3], [1.0, 0.1], [1.0, 0.3], [3.0, 0.3], [1.0, 1.0]]),
    alike(Inputs::Angles, SINES, &[[1.0, 0.3]]),
    alike(Inputs::SinesAndCosines, SOFTPLUS, &[[0.3, 0.3]]),
    alike(Inputs::SinesAndCosines, TANH, &[[1.0, 0.3]]),
    of_links(&[(8, Activation::Sine)]),
    of_links(&[(10, Activation::Sine)]),
    of_links(&[(12, Activation::Sine)]),
    of_links(&[(16, Activation::Sine)]),
];

/// Hidden layers of the candidates.
const SOFTPLUS: Layers = &[(32, Activation::Softplus), (32, Activation::Softplus)];
const TANH: Layers = &[(32, Activation::Tanh), (32, Activation::Tanh)];
const SINE: Layers = &[(64, Activation::Sine)];
const SINES: Layers = &[(32, Activation::Sine), (32, Activation::Sine)];
const OF_INERTIA: Layers = &[(24, Activation::Sine)];

const fn alike(inputs: Inputs, hidden: Layers, decays: &'static [[f64; 2]]) -> Candidate {
    Candidate { inputs, hidden: [hidden; 2], known: Known::Gains, decays }
}

const fn of_links(potential: Layers) -> Candidate {
    let decays = &[[100.0, 2.5], [100.0, 5.0], [100.0, 10.0]];
    Candidate { inputs: Inputs::Angles, hidden: [OF_INERTIA, potential], known: Known::Links, decays }
}

/// Samples of the links for training and validation.
pub const OF_LINKS: [usize; 2] = [20_000, 2_000];
/// Further that positions of these samples reach than those of the recording, rad.
pub const BEYOND: f64 = 0.2;

impl Candidate {
    /// A model before it learns from samples.
    fn begun(&self, train: &[Sample<JOINTS>], robot: &Robot, job: Job) -> Model<JOINTS> {
        let gain = SVector::from_fn(|j, _| robot.drives[j].gain);
        let shape = Shape {
            inputs: self.inputs,
            inertia: self.hidden[0].to_vec(),
            potential: self.hidden[1].to_vec(),
            friction: job.friction,
            structure: match self.known {
                Known::Gains => Structure::Any,
                Known::Links => Structure::Chain,
            },
        };
        let mut model = Model::new(&shape, train, gain, job.seed);
        if self.known == Known::Links {
            let [learn, check] = [0, 1].map(|part| {
                let seed = 2 * job.seed + part as u64;
                from_links::samples(&robot.tree, &gain, train, BEYOND, OF_LINKS[part], seed)
            });
            let training = Training { epochs: 60, seed: job.seed, ..RANDOM };
            training.run(&mut model, &learn, &check, &importance(train, 1.0));
        }
        model
    }

    /// Training of such a model from samples.
    fn learn(&self, model: &mut Model<JOINTS>, [train, validation]: &Parts, decay: [f64; 2], seed: u64) {
        let decay = decay.map(|decay| decay * DECAYED / train.len() as f64);
        let training = match self.known {
            Known::Gains => Training { decay, seed, ..RANDOM },
            Known::Links => {
                let epochs = STEPS * RANDOM.batch / train.len();
                Training { epochs, rate: 0.005, learned: Learned::Outputs, decay, seed, ..RANDOM }
            }
        };
        training.run(model, train, validation, &importance(train, 1.0));
    }

    /// Mean over joints of the mean square errors on other samples, for each decay; models learn from the links once.
    fn errors(&self, parts: &Parts, other: &[Sample<JOINTS>], robot: &Robot, seed: u64) -> Vec<f64> {
        let job = Job { at: 0, known: self.known, friction: Friction::Nonsymmetric, seed };
        let begun = self.begun(&parts[0], robot, job);
        let error = |decay: &[f64; 2]| {
            let mut model = begun.clone();
            self.learn(&mut model, parts, *decay, seed);
            mean_square(&model, other).mean()
        };
        self.decays.iter().map(error).collect()
    }
}

/// Steps of a training that begins from the links, whatever the samples: how far weights get, at most.
pub const STEPS: usize = 2_600;
/// Training from random weights, without decay.
const RANDOM: Training =
    Training { epochs: 80, batch: 128, rate: 0.02, learned: Learned::All, decay: [0.0; 2], every: 4, seed: 0 };

/// A candidate with one of its decays.
pub struct Tried {
    /// The candidate.
    pub candidate: &'static Candidate,
    /// Weight decay.
    pub decay: [f64; 2],
    /// Means over joints and seeds of the mean square errors, from each training motion to the other.
    pub errors: [f64; 2],
    /// Mean over joints of the mean square errors on the test motion after all of the training motions, one seed: of
    /// candidates that know the links, and used for no choice.
    pub in_hindsight: Option<f64>,
}

/// Samples for training and validation.
type Parts = [Vec<Sample<JOINTS>>; 2];

/// A training.
#[derive(Clone, Copy, PartialEq)]
struct Job {
    /// Place among the shares.
    at: usize,
    known: Known,
    friction: Friction,
    seed: u64,
}

/// Knowledge of the models with nonsymmetric Coulomb friction.
const NONSYMMETRIC: [Known; 2] = [Known::Gains, Known::Links];
/// Models of the table of errors.
const MODELS: [(&str, Known, Friction); 3] = [
    ("DeLaN", Known::Gains, Friction::Symmetric),
    ("DeLaN + NSCF", Known::Gains, Friction::Nonsymmetric),
    (FROM_LINKS, Known::Links, Friction::Nonsymmetric),
];
/// Name of the model that knows the links.
pub const FROM_LINKS: &str = "DeLaN + NSCF, begun from the URDF";

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
    /// Candidates and decays, each on the training motions.
    pub choice: Vec<Tried>,
    /// Places of those that were taken: with the gains known, and with the links.
    pub chosen: [usize; 2],
    /// Errors, share by share.
    pub rows: Vec<Row>,
    /// Means over joints of the errors of DeLaN + NSCF on all of the recordings, for each seed; by what is known.
    pub seeds: [Vec<f64>; 2],
    /// Errors of the mean of these models' efforts, by what is known.
    pub averaged: [SVector<f64, JOINTS>; 2],
    /// Coefficients of each joint by least squares; the flag: its rotor inertia is a base parameter by itself.
    pub least_squares: Vec<(Coefficients, bool)>,
    /// Coefficients of each joint by DeLaN + NSCF, by what is known.
    pub learned: [Vec<Coefficients>; 2],
    /// Samples of training, validation and test.
    pub samples: [usize; 3],
    /// Weights of DeLaN + NSCF, by what is known.
    pub weights: [usize; 2],
    /// Time of the candidates' trainings, s.
    pub choosing: f64,
    /// Time of all other trainings, s.
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

    let mut begin = Instant::now();
    let mut choice = choice(&whole);
    let choosing = begin.elapsed().as_secs_f64();
    let sum = |at: &usize| choice[*at].errors.iter().sum::<f64>();
    let chosen = [Known::Gains, Known::Links].map(|known| {
        let own = (0..choice.len()).filter(|&at| choice[at].candidate.known == known);
        own.min_by(|a, b| sum(a).total_cmp(&sum(b))).expect("candidates")
    });
    let job = |at, known, friction, seed| Job { at, known, friction, seed };
    let last = recordings.len() - 1;
    let mut jobs: Vec<Job> = (0..recordings.len())
        .flat_map(|at| MODELS.map(|(_, known, friction)| job(at, known, friction, 1)))
        .chain((2..=SEEDS).flat_map(|seed| NONSYMMETRIC.map(|known| job(last, known, Friction::Nonsymmetric, seed))))
        .collect();
    // The longest first: both cores are busy to the end.
    jobs.sort_by_key(|job| (job.known == Known::Gains, std::cmp::Reverse(job.at)));
    begin = Instant::now();
    let train = |job: &Job| {
        let parts = [Part::Train, Part::Validation].map(|part| samples(&recordings[job.at].1, part));
        let Tried { candidate, decay, .. } = choice[chosen[job.known as usize]];
        let mut model = candidate.begun(&parts[0], &whole.robot, *job);
        candidate.learn(&mut model, &parts, decay, job.seed);
        model
    };
    let models: Vec<Model<JOINTS>> = jobs.par_iter().with_max_len(1).map(train).collect();
    let seconds = begin.elapsed().as_secs_f64();

    let test = samples(&whole, Part::Test);
    let parts = [Part::Train, Part::Validation].map(|part| samples(&whole, part));
    let of_links: Vec<&Candidate> = CANDIDATES.iter().filter(|one| one.known == Known::Links).collect();
    let in_hindsight: Vec<Vec<f64>> =
        of_links.par_iter().with_max_len(1).map(|candidate| candidate.errors(&parts, &test, &whole.robot, 1)).collect();
    let tried = choice.iter_mut().filter(|tried| tried.candidate.known == Known::Links);
    tried.zip(in_hindsight.concat()).for_each(|(tried, error)| tried.in_hindsight = Some(error));
    let model = |at: usize, known, friction, seed| {
        let wanted = job(at, known, friction, seed);
        &models[jobs.iter().position(|job| *job == wanted).expect("a model of each job")]
    };
    let mut rows = Vec::new();
    for (at, (share, recording)) in recordings.iter().enumerate() {
        let mut row = |model, errors| rows.push(Row { share: *share, model, errors });
        row("IDIM-LS", least_squares(recording, Weighting::Ordinary).0);
        row("IDIM-LS, weighted", least_squares(recording, Weighting::ByJoint).0);
        for (name, known, friction) in MODELS {
            row(name, mean_square(model(at, known, friction, 1), &test));
        }
    }
    rows.push(Row { share: 100, model: "images of this project", errors: images(&whole) });
    let best = NONSYMMETRIC.map(|known| model(last, known, Friction::Nonsymmetric, 1));
    let coefficients = |model: &Model<JOINTS>, j: usize| {
        let [viscous, forward, backward, _] = model.linear(j);
        [viscous, forward, backward, model.rotor(j)]
    };
    let error = |known, seed| mean_square(model(last, known, Friction::Nonsymmetric, seed), &test).mean();
    let results = Results {
        choice,
        chosen,
        rows,
        averaged: NONSYMMETRIC.map(|known| {
            let of = |seed| model(last, known, Friction::Nonsymmetric, seed).efforts(&test);
            averaged(&(1..=SEEDS).map(of).collect::<Vec<_>>(), &test)
        }),
        seeds: NONSYMMETRIC.map(|known| (1..=SEEDS).map(|seed| error(known, seed)).collect()),
        least_squares: least_squares(&whole, Weighting::ByJoint).1,
        learned: best.map(|model| (0..JOINTS).map(|j| coefficients(model, j)).collect()),
        samples: [Part::Train, Part::Validation, Part::Test].map(|part| samples(&whole, part).len()),
        weights: best.map(|model| model.weights.len()),
        choosing,
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

/// Mean square errors of the mean of several models' efforts.
fn averaged(efforts: &[Vec<SVector<f64, JOINTS>>], test: &[Sample<JOINTS>]) -> SVector<f64, JOINTS> {
    let error = |(i, sample): (usize, &Sample<JOINTS>)| {
        let sum: SVector<f64, JOINTS> = efforts.iter().map(|of_model| of_model[i]).sum();
        (sum / efforts.len() as f64 - sample.effort).map(|error| error * error)
    };
    test.iter().enumerate().map(error).sum::<SVector<f64, JOINTS>>() / test.len() as f64
}

/// Candidates that learn from one training motion, and their errors on the other.
fn choice(recording: &Recording) -> Vec<Tried> {
    let of = |run: u32, parts: &[Part]| -> Vec<Sample<JOINTS>> {
        let own = |i: &usize| recording.joints[0].samples.run[*i] == run && parts.contains(&recording.part(*i));
        (0..recording.len()).filter(own).map(|i| sample(recording, i)).collect()
    };
    let jobs: Vec<(usize, u64, u32)> = (0..CANDIDATES.len())
        .flat_map(|at| (1..=CHOICE_SEEDS).flat_map(move |seed| [(at, seed, 0), (at, seed, 1)]))
        .collect();
    let errors = |&(at, seed, run): &(usize, u64, u32)| {
        let parts = [of(run, &[Part::Train]), of(run, &[Part::Validation])];
        let other = of(1 - run, &[Part::Train, Part::Validation]);
        CANDIDATES[at].errors(&parts, &other, &recording.robot, seed)
    };
    let errors: Vec<Vec<f64>> = jobs.par_iter().with_max_len(1).map(errors).collect();
    let mean = |at: usize, decay: usize, run: u32| {
        let own = jobs.iter().zip(&errors).filter(|((of, _, on), _)| (*of, *on) == (at, run));
        own.map(|(_, errors)| errors[decay]).sum::<f64>() / CHOICE_SEEDS as f64
    };
    let tried = |at: usize| {
        let candidate = &CANDIDATES[at];
        candidate.decays.iter().enumerate().map(move |(i, decay)| (at, candidate, i, *decay))
    };
    (0..CANDIDATES.len())
        .flat_map(tried)
        .map(|(at, candidate, i, decay)| {
            let errors = [0, 1].map(|run| mean(at, i, run));
            Tried { candidate, decay, errors, in_hindsight: None }
        })
        .collect()
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
