//! Random robots and their recordings: a Fourier motion of every joint, noise, filters.

use crate::equations::{GROUPS, Layout, Normal, Rows, rigid_columns};
use crate::friction_columns::Friction;
use identification::differentiate::central_difference;
use identification::filter::LowPassFilter;
use identification::samples::Samples;
use nalgebra::{DMatrix, DVector};
use plant::excitation::Reference;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rigid_body::drives::Drive;
use rigid_body::newton_euler::inverse_dynamics;
use rigid_body::random_tree::{Shape, tree};
use rigid_body::{JointKind, Limits, Robot};
use std::f64::consts::TAU;

/// Sampling before decimation, Hz.
pub const RATE: f64 = 500.0;
/// Cut-off of the filters of position and effort, Hz, and their order.
const CUTOFF: (usize, f64) = (4, 10.0);
/// One sample in so many is kept.
const DECIMATION: usize = 5;
/// Samples that are cut off at both ends, after decimation: 0.6 s.
const TRIM: usize = 60;
/// Slope of the Coulomb friction at standstill, s/rad: as in the friction's columns.
const SLOPE: f64 = 100.0;

/// A robot with everything that is to be found again.
pub struct Truth {
    pub robot: Robot,
    /// Rotor inertias, kg m^2 on the motor's side.
    pub rotors: Vec<f64>,
    /// Viscous and Coulomb friction and offset of each joint, in units of effort.
    pub friction: Vec<[f64; 3]>,
}

/// A random robot of 2 to 12 joints: branched where the seed is even, every third with a differential between its last
/// two joints, every fourth with rotor inertias that its file states.
pub fn robot(seed: u64) -> Truth {
    let joints = 2 + seed as usize % 11;
    let tree = tree(Shape { joints, branches: seed.is_multiple_of(2), prismatic: 0.2, armature: false }, seed);
    let mut random = ChaCha8Rng::seed_from_u64(1000 + seed);
    let ratio = |joint: &rigid_body::Joint| if joint.kind == JointKind::Prismatic { 200.0 } else { 20.0 };
    let mut coupling = DMatrix::from_diagonal(&DVector::from_iterator(joints, tree.joints.iter().map(ratio)));
    if seed.is_multiple_of(3) {
        coupling[(joints - 1, joints - 2)] = ratio(&tree.joints[joints - 2]);
    }
    let rotors: Vec<f64> = (0..joints).map(|_| random.random_range(0.5e-4..2e-4)).collect();
    let stated = |rotor: &f64| (seed % 4 == 1).then_some(*rotor);
    let drives = rotors.iter().map(|rotor| Drive { gain: 0.1, rotor_inertia: stated(rotor), ..Drive::default() });
    let robot = Robot {
        name: "random".into(),
        links: (0..joints).map(|j| format!("link_{j}")).collect(),
        limits: vec![Limits::default(); joints],
        frames: vec![],
        pairs: vec![],
        floor: None,
        shapes: vec![None; joints],
        drives: drives.collect(),
        tree,
        coupling,
    };
    let friction = (0..joints).map(|_| [0.1, 0.1, 0.05].map(|most| random.random_range(0.2 * most..most))).collect();
    Truth { robot, rotors, friction }
}

impl Truth {
    /// All unknowns with a simple friction; rotors that are known are no unknowns.
    pub fn unknowns(&self, friction: Friction) -> DVector<f64> {
        let n = self.robot.tree.len();
        let mut all = self.robot.tree.parameters();
        let unknown = |(rotor, drive): (&f64, &Drive)| if drive.rotor_inertia.is_some() { 0.0 } else { *rotor };
        all.extend(self.rotors.iter().zip(&self.robot.drives).map(unknown));
        if friction != Friction::None {
            all.extend(self.friction.iter().flatten());
        }
        assert_eq!(all.len(), 11 * n + n * friction.width(false));
        DVector::from_vec(all)
    }

    /// Efforts of all motors at a state. `friction` as part of what it is.
    pub fn efforts(&self, to_efforts: &DMatrix<f64>, [q, v, a]: &[Vec<f64>; 3], friction: f64) -> Vec<f64> {
        let links = inverse_dynamics(&self.robot.tree, q, v, a);
        let rotors = self.robot.rotor_matrix(&self.rotors) * DVector::from_row_slice(a);
        let efforts = to_efforts * (DVector::from_vec(links) + rotors);
        let lost = |j: usize| {
            let [viscous, coulomb, offset] = self.friction[j];
            friction * (viscous * v[j] + coulomb * (SLOPE * v[j]).tanh() + offset)
        };
        efforts.iter().enumerate().map(|(j, effort)| effort + lost(j)).collect()
    }
}

/// Fourier series of `harmonics` per joint over `seconds`, with an amplitude of some 0.7 rad (0.2 m), at [`RATE`].
pub fn fourier(robot: &Robot, seconds: f64, harmonics: usize, seed: u64) -> Vec<Vec<Reference>> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let count = (seconds * RATE) as usize;
    let of = |joint: &rigid_body::Joint| -> Vec<Reference> {
        let size = if joint.kind == JointKind::Prismatic { 0.2 } else { 0.7 };
        let mut normal = || -> Vec<f64> { (0..harmonics).map(|_| StandardNormal.sample(&mut random)).collect() };
        let (cosine, sine) = (normal(), normal());
        let series = plant::fourier::FourierSeries { fundamental: TAU / seconds, cosine, sine };
        let motion: Vec<Reference> = (0..count).map(|i| series.at(i as f64 / RATE)).collect();
        let part = size / rms(&motion.iter().map(|m| m.position).collect::<Vec<_>>());
        let scaled = |m: &Reference| Reference {
            position: part * m.position,
            velocity: part * m.velocity,
            acceleration: part * m.acceleration,
        };
        motion.iter().map(scaled).collect()
    };
    robot.tree.joints.iter().map(of).collect()
}

/// White noise of an effort.
#[derive(Clone)]
pub enum EffortNoise {
    /// Part of each joint's RMS.
    Part(f64),
    /// Size for each joint, in units of effort.
    Size(Vec<f64>),
}

/// Noise of a recording.
#[derive(Clone)]
pub struct Measured {
    /// Part of the friction that is there, 0 to 1.
    pub friction: f64,
    /// White noise of the effort.
    pub effort: EffortNoise,
    /// White noise of the position, rad or m.
    pub position: f64,
}

/// Root mean square.
pub fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|x| x * x).sum::<f64>() / values.len() as f64).sqrt()
}

/// The equations of a recorded motion: signals at [`RATE`] with noise, filtered, differentiated, decimated, trimmed.
pub fn rows(truth: &Truth, motion: &[Vec<Reference>], columns: Friction, measured: &Measured, seed: u64) -> Rows {
    let n = truth.robot.tree.len();
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut noise = |sigma: f64| -> f64 {
        let normal: f64 = StandardNormal.sample(&mut random);
        sigma * normal
    };
    let to_efforts = truth.robot.gains().try_inverse().unwrap();
    let count = motion[0].len();
    let state = |i: usize| -> [Vec<f64>; 3] {
        let of = |value: fn(&Reference) -> f64| motion.iter().map(|joint| value(&joint[i])).collect();
        [of(|m| m.position), of(|m| m.velocity), of(|m| m.acceleration)]
    };
    let clean: Vec<Vec<f64>> = (0..count).map(|i| truth.efforts(&to_efforts, &state(i), measured.friction)).collect();
    let filter = LowPassFilter::butterworth(CUTOFF.0, 2.0 * CUTOFF.1 / RATE).unwrap();
    let kept = |all: &[f64]| -> Vec<f64> {
        let decimated: Vec<f64> = all.iter().step_by(DECIMATION).copied().collect();
        decimated[TRIM..decimated.len() - TRIM].to_vec()
    };
    let samples: Vec<Samples> = (0..n)
        .map(|j| {
            let effort: Vec<f64> = clean.iter().map(|efforts| efforts[j]).collect();
            let sigma = match &measured.effort {
                EffortNoise::Part(part) => part * rms(&effort),
                EffortNoise::Size(sizes) => sizes[j],
            };
            let effort: Vec<f64> = effort.iter().map(|x| x + noise(sigma)).collect();
            let position: Vec<f64> = motion[j].iter().map(|m| m.position + noise(measured.position)).collect();
            let (position, effort) = (filter.zero_phase(&position).unwrap(), filter.zero_phase(&effort).unwrap());
            let velocity = central_difference(&position, 1.0 / RATE);
            let acceleration = central_difference(&velocity, 1.0 / RATE);
            Samples {
                position: kept(&position),
                velocity: kept(&velocity),
                acceleration: kept(&acceleration),
                effort: kept(&effort),
                ..Samples::default()
            }
        })
        .collect();
    let used = samples[0].position.len();
    let mut rigid: Vec<DMatrix<f64>> = (0..used)
        .map(|i| {
            let of = |column: fn(&Samples) -> &Vec<f64>| -> Vec<f64> { samples.iter().map(|s| column(s)[i]).collect() };
            rigid_columns(&truth.robot, &of(|s| &s.position), &of(|s| &s.velocity), &of(|s| &s.acceleration))
        })
        .collect();
    let layout = Layout { joints: n, friction: columns, shared: false };
    let mut effort: Vec<Vec<f64>> = samples.iter().map(|samples| samples.effort.clone()).collect();
    for (k, drive) in truth.robot.drives.iter().enumerate() {
        let Some(rotor) = drive.rotor_inertia else { continue };
        for (i, columns) in rigid.iter_mut().enumerate() {
            effort.iter_mut().enumerate().for_each(|(j, effort)| effort[i] -= rotor * columns[(j, 10 * n + k)]);
            columns.column_mut(10 * n + k).fill(0.0);
        }
    }
    let friction = samples.iter().map(|samples| columns.columns(samples, None, false)).collect();
    let group = (0..used).map(|i| Some(i * GROUPS / used)).collect();
    let still = vec![vec![false; used]; n];
    Rows { layout, rigid, friction, effort, group, run: vec![0; used], still }
}

/// The normal equations of all joints, each divided by its noise squared.
pub fn weighted(rows: &Rows, noise: &[f64]) -> Normal {
    let mut sum = Normal::zero(rows.layout.unknowns());
    for (j, noise) in noise.iter().enumerate() {
        rows.normal(j, |_| 1.0).iter().for_each(|group| sum.add(group, 1.0 / (noise * noise)));
    }
    sum
}
