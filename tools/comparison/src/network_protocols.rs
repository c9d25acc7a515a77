//! Residual network of 000 under both protocols: samples that a random split held back, and a motion that was never
//! seen; host.
//!
//! One fit serves both. Bodies are fitted to the training and validation samples, the network is trained on what they
//! leave, and it is judged twice: on the split's own test samples, whose neighbours it was trained on, and on another
//! motion.

use crate::model_detail::{Bodies, fit, without_linear_friction};
use crate::motions::{Motions, rms};
use crate::residual_network::{EmptyPart, Network, Split};
use nalgebra::DMatrix;
use rigid_body::Robot;
use robot::friction_columns::Friction;

/// Treatment of what the bodies leave.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// None: the bodies alone.
    Bodies,
    /// Viscous, Coulomb and offset on the residual.
    LinearFriction,
    /// Viscous, Coulomb and offset fitted together with the bodies (Lee et al.).
    FrictionWithBodies,
    /// The paper's network: positions, velocities and measured efforts as inputs.
    Network,
    /// The same network without measured efforts.
    WithoutEffort,
    /// The paper's inputs; trained on the first motion and stopped by the second.
    StoppedByMotion,
}

impl Method {
    /// All methods, in the tables' order.
    pub const ALL: [Self; 6] = [
        Self::Bodies,
        Self::LinearFriction,
        Self::FrictionWithBodies,
        Self::Network,
        Self::WithoutEffort,
        Self::StoppedByMotion,
    ];

    /// Name in tables.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Bodies => "no network",
            Self::LinearFriction => "linear friction instead",
            Self::FrictionWithBodies => "linear friction, fitted with the bodies",
            Self::Network => "network: q, v, torque (000)",
            Self::WithoutEffort => "network: q, v",
            Self::StoppedByMotion => "network: q, v, torque; stopped by a motion",
        }
    }

    /// False where the random split's test samples were trained on.
    pub const fn has_random_split(self) -> bool {
        !matches!(self, Self::StoppedByMotion)
    }
}

/// RMS errors of one method, joint by joint, in units of effort.
#[derive(Clone, Debug, PartialEq)]
pub struct Errors {
    /// Over the random split's test samples; empty where there are none.
    pub random: Vec<f64>,
    /// Over the motion that was never seen.
    pub unseen: Vec<f64>,
}

/// Outcome of one split.
#[derive(Debug)]
pub struct Outcome {
    /// Errors of [`Method::ALL`].
    pub errors: Vec<Errors>,
    /// RMS of the effort over the same samples.
    pub effort: Errors,
    /// Bodies without friction beside them.
    pub bodies: Bodies,
    /// Epochs of the paper's network.
    pub epochs: usize,
}

impl Outcome {
    /// Means over the joints of the errors in % of the effort's RMS: random split (None without one), unseen motion.
    pub fn percent(&self, method: Method) -> (Option<f64>, f64) {
        let errors = &self.errors[Method::ALL.iter().position(|&other| other == method).unwrap_or(0)];
        let mean = |errors: &[f64], effort: &[f64]| {
            let parts = errors.iter().zip(effort).map(|(error, effort)| 100.0 * error / effort);
            parts.sum::<f64>() / errors.len().max(1) as f64
        };
        let random = (!errors.random.is_empty()).then(|| mean(&errors.random, &self.effort.random));
        (random, mean(&errors.unseen, &self.effort.unseen))
    }
}

/// Reason for which there is no outcome.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoOutcome {
    /// A part without samples.
    #[error(transparent)]
    Split(#[from] EmptyPart),
    /// The convex fit finds no minimum.
    #[error("the convex fit finds no minimum")]
    Bodies,
}

/// Both protocols with one random split of the motions 0 and 1; motion 2 is the unseen one.
///
/// # Errors
/// [`NoOutcome`].
pub fn compare(robot: &Robot, motions: &Motions, seed: u64) -> Result<Outcome, NoOutcome> {
    let [first, second, unseen] = [0, 1, 2].map(|motion| motions.of(motion));
    let split = Split::random(&[&first[..], &second].concat(), seed)?;
    let used = [&split.training[..], &split.validation].concat();
    let bodies = fit(robot, motions, &used, Friction::None).ok_or(NoOutcome::Bodies)?;
    let with_friction = fit(robot, motions, &used, Friction::Simple).ok_or(NoOutcome::Bodies)?;
    let mut epochs = 0;
    let mut left = |method: Method| -> Result<DMatrix<f64>, NoOutcome> {
        let mut network = |with_effort: bool, training: &[usize], validation: &[usize]| -> Result<_, NoOutcome> {
            let inputs = motions.network_inputs(with_effort);
            let network = Network::train(&inputs, &bodies.residual, training, validation, seed)?;
            if method == Method::Network {
                epochs = network.validation.len() - 1;
            }
            Ok(&bodies.residual - network.predict(&inputs))
        };
        match method {
            Method::Bodies => Ok(bodies.residual.clone()),
            Method::LinearFriction => Ok(without_linear_friction(robot, motions, &bodies.residual, &used)),
            Method::FrictionWithBodies => Ok(with_friction.residual.clone()),
            Method::Network => network(true, &split.training, &split.validation),
            Method::WithoutEffort => network(false, &split.training, &split.validation),
            Method::StoppedByMotion => network(true, &first, &second),
        }
    };
    let mut errors = Vec::new();
    for method in Method::ALL {
        let left = left(method)?;
        let random = if method.has_random_split() { rms(&left, &split.test) } else { vec![] };
        errors.push(Errors { random, unseen: rms(&left, &unseen) });
    }
    let effort = motions.effort();
    let effort = Errors { random: rms(&effort, &split.test), unseen: rms(&effort, &unseen) };
    Ok(Outcome { errors, effort, bodies, epochs })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulated_leg::{Leg, Measurement};

    /// Motions of a leg, thinned out.
    fn motions(leg: &Leg) -> Motions {
        let all = leg.measured(&[11, 12, 13], &Measurement::USUAL, 14);
        let kept = (0..all.states.len()).step_by(5);
        Motions {
            states: kept.clone().map(|i| all.states[i].clone()).collect(),
            efforts: kept.clone().map(|i| all.efforts[i].clone()).collect(),
            motion: kept.map(|i| all.motion[i]).collect(),
        }
    }

    #[test]
    fn every_method_is_judged_on_samples_that_it_was_not_fitted_to() {
        let leg = Leg::random(10);
        let motions = motions(&leg);
        let outcome = compare(&leg.prior, &motions, 15).unwrap();
        assert!(outcome.epochs > 1);
        let before = outcome.percent(Method::Bodies);
        let friction = outcome.percent(Method::FrictionWithBodies);
        assert!(friction.0 < before.0.map(|error| 0.7 * error) && friction.1 < 0.7 * before.1, "{friction:?}");
        let (random, unseen) = outcome.percent(Method::Network);
        assert!(random.unwrap() < before.0.unwrap() && unseen > random.unwrap(), "{random:?} {unseen}");
        assert_eq!(outcome.percent(Method::StoppedByMotion).0, None);
        // Efforts of the unseen motion are inputs of nothing but predictions: other ones change no other error.
        let mut other = motions.clone();
        for i in other.of(2) {
            other.efforts[i].iter_mut().for_each(|effort| *effort *= 1.5);
        }
        let again = compare(&leg.prior, &other, 15).unwrap();
        for (errors, again) in outcome.errors.iter().zip(&again.errors) {
            assert_eq!(errors.random, again.random);
            assert_ne!(errors.unseen, again.unseen);
        }
    }

    #[test]
    fn too_few_samples_are_refused() {
        let leg = Leg::random(10);
        let none = Motions { states: vec![], efforts: vec![], motion: vec![] };
        assert_eq!(compare(&leg.prior, &none, 1).err(), Some(NoOutcome::Split(EmptyPart("training"))));
    }
}
