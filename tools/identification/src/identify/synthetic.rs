//! Synthetic joints with known parameters, for the tests of the identification.

use super::nonlinear::{Problem, rigid_effort};
use super::observations::{Limits, decimated, rows};
use crate::friction_model::{Directional, FrictionModel, Ripple, Terms};
use crate::joint_model::{float_state, rigid_efforts};
use crate::pre_sliding;
use crate::rigid::{Given, Gravity, RigidModel, RigidParameters};
use crate::samples::{MotionState, Part, Partner, Samples};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, Normal};

/// Inertia, and gravity of unknown direction.
pub const RIGID: RigidModel =
    RigidModel { inertia: true, gravity: Gravity::SineAndCosine, mass_and_length: false, lags: 0, given: Given::None };

/// The rigid part that belongs to it.
pub fn rigid() -> RigidParameters {
    RigidParameters { inertia: 1.2, gravity_sine: 3.0, gravity_cosine: -1.5, ..RigidParameters::default() }
}

/// A friction whose parameters are all large enough to be found, with the given terms on.
pub fn friction(terms: Terms) -> FrictionModel {
    FrictionModel {
        terms,
        offset: 0.15,
        position_slope: -0.12,
        temperature_slope: 0.02,
        load_slope: 0.08,
        viscous: 0.9,
        viscous_temperature: -0.02,
        quadratic: 0.15,
        coulomb: Directional { positive: 1.1, negative: 0.8 },
        coulomb_temperature: -0.015,
        coulomb_load: 0.09,
        coulomb_slope: 40.0,
        breakaway: Directional { positive: 1.8, negative: 1.3 },
        stribeck_slope: 5.0,
        hysteresis: 0.5,
        hysteresis_velocity_slope: 3.0,
        hysteresis_width: 0.9,
        hysteresis_acceleration_slope: 2.0,
        harmonic_frequency: 3.3,
        harmonic_positive: [0.20, -0.12, 0.15, 0.10, -0.08],
        harmonic_negative: [0.14, 0.11, -0.09, 0.12, 0.10],
        rotor_inertia: 0.3,
        reference_temperature: 30.0,
        viscous_asymmetry: 0.1,
        weakening: Directional { positive: 0.6, negative: 0.4 },
        weakening_slope: 12.0,
        element_stiffness: [4.0, 20.0, 0.0, 0.0],
        element_level: [0.4, 0.3, 0.0, 0.0],
        ripples: [
            Ripple { frequency: 7.1, level_sine: 0.1, level_cosine: -0.2, torque_sine: 0.05, torque_cosine: 0.1 },
            Ripple { frequency: 17.0, level_sine: 0.2, level_cosine: 0.1, torque_sine: -0.1, torque_cosine: 0.1 },
        ],
        relief: 0.4,
    }
}

/// A motion of `count` samples at 100 Hz through all velocities, with many slow reversals, between 20 and 40 degrees;
/// of every ten seconds six train, two validate, two test. No effort yet.
pub fn motion(count: usize) -> Samples {
    let waves = [(1.1, 0.31, 0.2), (0.35, 1.37, 1.0), (0.10, 4.3, 2.0), (0.02, 11.0, 0.5)];
    let mut samples = Samples::default();
    for i in 0..count {
        let t = i as f64 * 0.01;
        let sum = |f: fn(f64, f64, f64) -> f64| waves.iter().map(|&(a, w, p)| f(a, w, w * t + p)).sum::<f64>();
        samples.time.push(t);
        samples.position.push(sum(|a, _, x| a * x.sin()));
        samples.velocity.push(sum(|a, w, x| a * w * x.cos()));
        samples.acceleration.push(sum(|a, w, x| -a * w * w * x.sin()));
        samples.temperature.push(30.0 + 10.0 * (0.11 * t).sin());
        samples.effort.push(0.0);
        samples.run.push(0);
        samples.state.push(MotionState::default());
        samples.part.push(match i / 200 % 5 {
            0 | 2 | 4 => Part::Train,
            1 => Part::Validation,
            _ => Part::Test,
        });
    }
    samples
}

/// The same motion of a joint that shares its drive.
pub fn shared(samples: Samples) -> Samples {
    let other = samples.time.iter().map(|t| 0.6 * (0.83 * t).sin()).collect();
    Samples { partner: Some(Partner::new(other, 0.05, &samples)), ..samples }
}

/// Gives the samples the effort of a joint, with noise; load-dependent friction sees the true rigid part.
pub fn drive(samples: &mut Samples, rigid: &RigidParameters, friction: &FrictionModel, noise: f64, seed: u64) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let normal = Normal::new(0.0, noise).unwrap();
    samples.load = rigid_efforts(rigid, samples);
    samples.bent = pre_sliding::bent(samples, &friction.element_stiffness);
    for i in 0..samples.len() {
        let lost = friction.friction(&float_state(samples, i));
        samples.effort[i] = samples.load[i] + lost + normal.sample(&mut random);
    }
    samples.load.clear();
}

/// The problem of identifying such a joint when its theoretical torque is known exactly.
pub fn problem(samples: &Samples, model: &RigidModel, theoretical: RigidParameters, truth: &FrictionModel) -> Problem {
    let mut train = rows(samples);
    train.iter_mut().for_each(|row| row.joint.load = rigid_effort(&theoretical, row));
    let limits = Limits {
        elements: 2,
        ripples: 2,
        ripple_torques: [true; 2],
        ..Limits::of(&train, truth.reference_temperature)
    };
    Problem {
        search: decimated(&train, 8_000),
        limits,
        train,
        folds: vec![],
        own_part_of_offset: 1.0,
        rigid: *model,
        theoretical,
        template: FrictionModel {
            coulomb_slope: truth.coulomb_slope,
            hysteresis_acceleration_slope: truth.hysteresis_acceleration_slope,
            element_stiffness: truth.element_stiffness,
            ripples: truth.ripples.map(|ripple| Ripple { frequency: ripple.frequency, ..Ripple::default() }),
            reference_temperature: truth.reference_temperature,
            ..FrictionModel::default()
        },
    }
}
