//! Simulated leg of five joints whose motors are coupled by belts, with rotors and with a friction that no model here
//! has; host.
//!
//! The motion is prescribed, and the motors' torques follow from it: inverse dynamics of links and rotors, plus
//! friction at each motor. Friction is Stribeck, viscous and load-dependent with an offset; it acts at the motor's
//! speed, which coupling makes that of several joints. 000 adds friction to computed torques in the same way (section
//! 4.1.1).
//!
//! Measured are position and torque, with white noise; both go through a zero-phase filter, and position is
//! differentiated, as with a recording.

use crate::motions::Motions;
use identification::differentiate::central_difference;
use identification::filter::LowPassFilter;
use nalgebra::{DMatrix, DVector, Matrix3, Matrix4, Unit, Vector3};
use plant::fourier::FourierSeries;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rigid_body::drives::Drive;
use rigid_body::inertia::LinkInertia;
use rigid_body::{Joint, JointKind, Limits, Placement, Robot, Tree};
use std::f64::consts::TAU;

/// Sampling before decimation, Hz.
const RATE: f64 = 500.0;
/// Filters: order and cut-off, Hz.
const FILTER: (usize, f64) = (4, 10.0);
/// One sample in so many is kept: 50 Hz.
const DECIMATION: usize = 10;
/// Duration of a motion, s, and what is cut off at both of its ends.
const DURATION: [f64; 2] = [30.0, 0.6];
/// Harmonics of a motion: up to 0.67 Hz.
const HARMONICS: usize = 20;
/// RMS of the position about its mean, rad.
const TRAVEL: f64 = 0.5;
/// Standard deviation of the prior's disturbance, as a part.
const DISTURBANCE: f64 = 0.1;
/// Speed over which friction changes its sign, rad/s.
const REVERSAL: f64 = 0.02;

/// Joint, axis, placement (m); mass (kg), centre (m) and edges (m) of its link, a box.
type Segment = (&'static str, [f64; 3], [f64; 3], f64, [f64; 3], [f64; 3]);

/// The leg, from the hip down: about the size of a small humanoid's.
const SEGMENTS: [Segment; 5] = [
    ("hip_yaw", [0.0, 0.0, 1.0], [0.0, 0.0, 0.0], 0.9, [0.01, 0.0, -0.03], [0.10, 0.09, 0.06]),
    ("hip_roll", [1.0, 0.0, 0.0], [0.0, 0.0, -0.06], 1.1, [0.01, 0.01, -0.02], [0.10, 0.08, 0.09]),
    ("hip_pitch", [0.0, 1.0, 0.0], [0.0, 0.03, -0.02], 3.2, [0.01, 0.02, -0.11], [0.10, 0.12, 0.28]),
    ("knee", [0.0, 1.0, 0.0], [0.0, 0.0, -0.27], 1.1, [0.01, 0.01, -0.10], [0.06, 0.05, 0.28]),
    ("ankle", [0.0, 1.0, 0.0], [0.0, 0.0, -0.27], 0.4, [0.03, 0.0, -0.03], [0.18, 0.05, 0.05]),
];
/// Turns of each motor per turn of its joint.
const RATIOS: [f64; 5] = [6.0, 6.0, 6.0, 12.0, 9.0];
/// Belts: turns of the motor (first) per turn of another joint (second) that its belt passes.
const BELTS: [(usize, usize, f64); 2] = [(3, 2, 6.0), (4, 3, 9.0)];

/// Friction at one motor, in Nm there over its speed on the joint's side of its gear.
#[derive(Clone, Copy, Debug, Default)]
pub struct MotorFriction {
    /// Coulomb torque, Nm.
    pub coulomb: f64,
    /// Breakaway torque above it, Nm.
    pub stribeck: f64,
    /// Stribeck velocity, rad/s; 0: none.
    pub stribeck_velocity: f64,
    /// Viscous coefficient, Nm s/rad.
    pub viscous: f64,
    /// Dry friction per torque that is transmitted.
    pub loss: f64,
    /// Offset, Nm.
    pub offset: f64,
}

impl MotorFriction {
    /// Torque at speed `w` (rad/s) while `load` (Nm) is transmitted.
    pub fn torque(&self, w: f64, load: f64) -> f64 {
        let ratio = if self.stribeck_velocity > 0.0 { w / self.stribeck_velocity } else { f64::INFINITY };
        let dry = self.coulomb + self.stribeck * (-ratio * ratio).exp() + self.loss * load.abs();
        dry * (w / REVERSAL).tanh() + self.viscous * w + self.offset
    }
}

/// White noise of what is measured.
#[derive(Clone, Copy, Debug)]
pub struct Measurement {
    /// Standard deviation of positions, rad.
    pub position: f64,
    /// Standard deviation of torques, part of each motor's RMS.
    pub torque: f64,
}

impl Measurement {
    /// No noise.
    pub const EXACT: Self = Self { position: 0.0, torque: 0.0 };
    /// An encoder of 16 bits a turn and a torque from current.
    pub const USUAL: Self = Self { position: TAU / 65536.0, torque: 0.01 };
}

/// The leg.
#[derive(Clone, Debug)]
pub struct Leg {
    /// As it is; rotor inertias are not stated.
    pub robot: Robot,
    /// With disturbed links, as from a drawing: physical, too.
    pub prior: Robot,
    /// Rotor inertias, kg m^2.
    pub rotors: Vec<f64>,
    /// Friction at each motor.
    pub friction: Vec<MotorFriction>,
}

impl Leg {
    /// A leg with rotors, friction and prior drawn from a seed.
    #[must_use]
    pub fn random(seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let joints: Vec<Joint> = SEGMENTS.iter().enumerate().map(|(i, segment)| joint(i, segment)).collect();
        let n = joints.len();
        let mut coupling = DMatrix::from_diagonal(&DVector::from_row_slice(&RATIOS));
        BELTS.iter().for_each(|&(motor, joint, turns)| coupling[(motor, joint)] = turns);
        let robot = Robot {
            name: "leg".into(),
            links: joints.iter().map(|joint| joint.name.clone()).collect(),
            shapes: vec![None; n],
            drives: vec![Drive::default(); n],
            coupling,
            limits: vec![Limits::default(); n],
            frames: vec![],
            pairs: vec![],
            floor: None,
            tree: Tree { joints, gravity: Vector3::new(0.0, 0.0, -9.81) },
        };
        let mut prior = robot.clone();
        for joint in &mut prior.tree.joints {
            joint.link = disturbed(&joint.link, &mut random);
        }
        let rotors = (0..n).map(|_| random.random_range(6e-5..1.2e-4)).collect();
        let mut friction = || {
            let coulomb = random.random_range(0.03..0.08);
            MotorFriction {
                coulomb,
                stribeck: coulomb * random.random_range(0.3..0.8),
                stribeck_velocity: random.random_range(0.1..0.3),
                viscous: random.random_range(0.01..0.03),
                loss: random.random_range(0.05..0.12),
                offset: random.random_range(-0.02..0.02),
            }
        };
        let friction = (0..n).map(|_| friction()).collect();
        Self { robot, prior, rotors, friction }
    }

    /// Torques of the motors in a state, friction included.
    pub fn efforts(&self, [q, v, a]: &[Vec<f64>; 3]) -> Vec<f64> {
        let efforts = self.robot.efforts(&self.robot.inverse_dynamics(q, v, a, &self.rotors));
        let speeds = &self.robot.coupling * DVector::from_row_slice(v);
        let with = |(m, effort): (usize, f64)| {
            effort + self.friction[m].torque(speeds[m] / self.robot.coupling[(m, m)], effort)
        };
        efforts.into_iter().enumerate().map(with).collect()
    }

    /// Motions drawn from `motions`' seeds, measured with noise drawn from `noise`.
    ///
    /// # Panics
    /// Never: the filter is a valid one, and motions are longer than it.
    pub fn measured(&self, motions: &[u64], measurement: &Measurement, noise: u64) -> Motions {
        let mut random = ChaCha8Rng::seed_from_u64(noise);
        let mut all = Motions::default();
        let filter = LowPassFilter::butterworth(FILTER.0, 2.0 * FILTER.1 / RATE).expect("a valid filter");
        let mut signal = |values: Vec<f64>, deviation: f64| -> Vec<f64> {
            let with_noise = |value: f64| {
                let normal: f64 = StandardNormal.sample(&mut random);
                value + deviation * normal
            };
            let noisy: Vec<f64> = values.into_iter().map(with_noise).collect();
            filter.zero_phase(&noisy).expect("a motion longer than its filter")
        };
        for (motion, seed) in motions.iter().enumerate() {
            let states = states(self.robot.tree.len(), *seed);
            let efforts: Vec<Vec<f64>> = states.iter().map(|state| self.efforts(state)).collect();
            let joint = |j: usize| {
                let q = signal(states.iter().map(|[q, _, _]| q[j]).collect(), measurement.position);
                let v = central_difference(&q, 1.0 / RATE);
                let a = central_difference(&v, 1.0 / RATE);
                let effort: Vec<f64> = efforts.iter().map(|efforts| efforts[j]).collect();
                let rms = (effort.iter().map(|x| x * x).sum::<f64>() / effort.len() as f64).sqrt();
                [q, v, a, signal(effort, measurement.torque * rms)]
            };
            let columns: Vec<[Vec<f64>; 4]> = (0..self.robot.tree.len()).map(joint).collect();
            let cut = (DURATION[1] * RATE) as usize;
            for i in (cut..states.len() - cut).step_by(DECIMATION) {
                let of = |kind: usize| columns.iter().map(|joint| joint[kind][i]).collect();
                all.states.push([of(0), of(1), of(2)]);
                all.efforts.push(of(3));
                all.motion.push(motion);
            }
        }
        all
    }
}

fn joint(index: usize, (name, axis, placement, mass, centre, edges): &Segment) -> Joint {
    let [x, y, z] = edges.map(|edge| edge * edge * mass / 12.0);
    let inertia = Matrix3::from_diagonal(&Vector3::new(y + z, x + z, x + y));
    Joint {
        name: (*name).to_owned(),
        parent: index.checked_sub(1),
        placement: Placement::from_xyz_rpy(*placement, [0.0; 3]),
        kind: JointKind::Revolute,
        axis: Unit::new_normalize(Vector3::from(*axis)),
        link: LinkInertia::from_centre(*mass, Vector3::from(*centre), inertia),
        armature: 0.0,
    }
}

/// Another body near this one: its pseudo-inertia P as T L L^T T^T with T near 1, in units in which P is 1.
fn disturbed(link: &LinkInertia, random: &mut ChaCha8Rng) -> LinkInertia {
    let pseudo = link.pseudo_inertia();
    let Some(root) = pseudo.cholesky() else { return *link };
    let near = Matrix4::from_fn(|row, column| {
        let normal: f64 = StandardNormal.sample(random);
        DISTURBANCE * normal + if row == column { 1.0 } else { 0.0 }
    });
    let moved = root.l() * near;
    LinkInertia::from_pseudo_inertia(&(moved * moved.transpose()))
}

/// States of all joints over one motion at [`RATE`]: a Fourier series of each, alike in position at all harmonics.
fn states(joints: usize, seed: u64) -> Vec<[Vec<f64>; 3]> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let fundamental = TAU / DURATION[0];
    let mut series = || {
        let mut draw = || -> Vec<f64> {
            let normal = |harmonic: usize, random: &mut ChaCha8Rng| -> f64 {
                let normal: f64 = StandardNormal.sample(random);
                harmonic as f64 * fundamental * TRAVEL * normal / (HARMONICS as f64).sqrt()
            };
            (1..=HARMONICS).map(|harmonic| normal(harmonic, &mut random)).collect()
        };
        FourierSeries { fundamental, cosine: draw(), sine: draw() }
    };
    let series: Vec<FourierSeries> = (0..joints).map(|_| series()).collect();
    let state = |i: usize| {
        let all: Vec<_> = series.iter().map(|series| series.at(i as f64 / RATE)).collect();
        [
            all.iter().map(|state| state.position).collect(),
            all.iter().map(|state| state.velocity).collect(),
            all.iter().map(|state| state.acceleration).collect(),
        ]
    };
    (0..(DURATION[0] * RATE) as usize).map(state).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn priors_are_physical_and_differ_from_the_leg_and_from_each_other() {
        let (one, two) = (Leg::random(1), Leg::random(2));
        for j in 0..5 {
            let of = |leg: &Leg| leg.prior.tree.joints[j].link;
            assert!(of(&one).is_physical() && one.robot.tree.joints[j].link.is_physical());
            assert!((of(&one).mass / one.robot.tree.joints[j].link.mass - 1.0).abs() > 1e-3);
            assert_ne!(of(&one), of(&two));
        }
    }

    #[test]
    fn a_belt_moves_the_motor_and_its_friction_with_the_joint_that_it_passes() {
        let leg = Leg::random(1);
        let efforts = |hip: f64| leg.efforts(&[vec![0.0; 5], vec![0.0, 0.0, hip, 0.0, 0.0], vec![0.0; 5]]);
        let (forward, backward) = (efforts(1.0), efforts(-1.0));
        // The knee stands still, its motor does not: both directions differ by twice its dry and viscous friction.
        let knee = &leg.friction[3];
        let speed = BELTS[0].2 / RATIOS[3];
        assert!(forward[3] - backward[3] > 2.0 * (knee.coulomb + knee.viscous * speed) - 1e-9);
        assert!((forward[4] - backward[4]).abs() < 1e-9, "the ankle's belt does not pass the hip");
    }

    #[test]
    fn friction_falls_from_breakaway_and_grows_with_speed_and_load() {
        let friction =
            MotorFriction { coulomb: 1.0, stribeck: 0.5, stribeck_velocity: 0.2, viscous: 0.1, loss: 0.1, offset: 0.0 };
        assert!(friction.torque(0.1, 0.0) > friction.torque(0.4, 0.0));
        assert!((friction.torque(3.0, 0.0) - 1.3).abs() < 1e-9);
        assert!((friction.torque(3.0, -2.0) - 1.5).abs() < 1e-9);
        assert_eq!(friction.torque(0.0, 5.0), 0.0);
    }

    #[test]
    fn measured_signals_are_the_motions_own_but_for_noise() {
        let leg = Leg::random(1);
        let exact = leg.measured(&[7, 8], &Measurement::EXACT, 1);
        let noisy = leg.measured(&[7, 8], &Measurement::USUAL, 1);
        assert_eq!(exact.of(0).len() + exact.of(1).len(), exact.states.len());
        assert_ne!(exact.states[0], exact.states[exact.of(1)[0]]);
        let difference = (noisy.effort() - exact.effort()).norm() / exact.effort().norm();
        assert!((1e-4..0.01).contains(&difference), "{difference}");
        // The filtered torque is that of the filtered state, away from reversals.
        let (state, effort) = (&exact.states[500], &exact.efforts[500]);
        let expected = leg.efforts(state);
        let error = effort.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(error < 0.05, "{error}");
    }
}
