//! Rigid bodies in three levels of detail, fitted as 000 does it (section 3.1.2, eq. 2.4); host.
//!
//! The levels are the paper's Hardware, Robot Software and Isaac Gym models. Fit: squared errors over the noise of an
//! unregularised fit, plus gamma times the entropic Bregman divergence from the prior, by [`robot::convex`]. Friction
//! is no part of it, as the paper prefers, or viscous and Coulomb with an offset, as Lee et al. have it.

use crate::motions::Motions;
use nalgebra::{DMatrix, DVector, Matrix4};
use rigid_body::Robot;
use rigid_body::inertia::LinkInertia;
use robot::convex::{self, Prior};
use robot::equations::{GROUPS, Layout, Normal, Rows, rigid_columns};
use robot::friction_columns::Friction;
use robot::least_squares::{Weighting, base, solve, total};

/// Weight of the divergence (000, section 3.1.2).
pub const GAMMA: f64 = 1e-3;

/// Level of detail of a robot's model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Detail {
    /// Links, rotors, coupled motors: the paper's Hardware model.
    Coupled,
    /// Links and rotors; each motor drives its joint alone: the Robot Software model.
    Rotors,
    /// Links alone: the Isaac Gym model.
    Links,
}

impl Detail {
    /// All levels, most detailed first.
    pub const ALL: [Self; 3] = [Self::Coupled, Self::Rotors, Self::Links];

    /// Name in tables.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Coupled => "links, rotors, coupling",
            Self::Rotors => "links, rotors",
            Self::Links => "links",
        }
    }

    /// The robot as this model has it.
    #[must_use]
    pub fn of(self, robot: &Robot) -> Robot {
        let mut robot = robot.clone();
        if self != Self::Coupled {
            robot.coupling = DMatrix::from_diagonal(&robot.coupling.diagonal());
        }
        if self == Self::Links {
            robot.drives.iter_mut().for_each(|drive| drive.rotor_inertia = Some(0.0));
        }
        robot
    }
}

/// Bodies that were fitted.
#[derive(Debug)]
pub struct Bodies {
    /// Links.
    pub links: Vec<LinkInertia>,
    /// Pseudo-inertias of the prior, without what the fit adds so that each is positive definite.
    pub prior: Vec<Matrix4<f64>>,
    /// Rotor inertias, kg m^2 on the motors' side; 0 where the model has none.
    pub rotors: Vec<f64>,
    /// Measured less predicted efforts of all samples, samples x joints.
    pub residual: DMatrix<f64>,
}

/// Fits the bodies of `robot` to the samples `used`; its tree is the prior. None where there is no minimum.
pub fn fit(robot: &Robot, motions: &Motions, used: &[usize], friction: Friction) -> Option<Bodies> {
    let joints = robot.tree.len();
    let layout = Layout { joints, friction, shared: false };
    let mut rows = Rows {
        layout,
        rigid: motions.states.iter().map(|[q, v, a]| rigid_columns(robot, q, v, a)).collect(),
        friction: if friction == Friction::None { vec![vec![]; joints] } else { motions.friction(robot) },
        effort: (0..joints).map(|j| motions.efforts.iter().map(|efforts| efforts[j]).collect()).collect(),
        group: vec![None; motions.states.len()],
        run: motions.motion.iter().map(|&motion| motion as u32).collect(),
        still: vec![vec![false; motions.states.len()]; joints],
    };
    assert!(matches!(friction, Friction::None | Friction::Simple), "other friction has no columns here");
    used.iter().for_each(|&i| rows.group[i] = Some(i % GROUPS));
    for (k, drive) in robot.drives.iter().enumerate() {
        let column = layout.inertial() + k;
        let Some(known) = drive.rotor_inertia else { continue };
        for (i, columns) in rows.rigid.iter_mut().enumerate() {
            (0..joints).for_each(|j| rows.effort[j][i] -= known * columns[(j, column)]);
            columns.column_mut(column).fill(0.0);
        }
    }
    let noise = solve(&rows, &base(robot, 1), Weighting::ByJoint).noise;
    let mut sum = Normal::zero(layout.unknowns());
    for (j, noise) in noise.iter().enumerate() {
        sum.add(&total(&rows.normal(j, |_| 1.0)), 1.0 / (noise * noise));
    }
    let prior = Prior::of(robot);
    let unknowns = convex::solve(&sum, layout, &prior, GAMMA)?;
    let residual = DMatrix::from_fn(motions.states.len(), joints, |i, j| rows.residual(&unknowns, j, i));
    Some(Bodies {
        links: convex::links(&unknowns, layout),
        prior: pseudo_inertias(robot.tree.joints.iter().map(|joint| joint.link)),
        rotors: (0..joints).map(|k| robot.drives[k].rotor_inertia.unwrap_or(unknowns[layout.inertial() + k])).collect(),
        residual,
    })
}

/// Linear friction in place of a network: viscous, Coulomb and offset of each motor by least squares on the residual of
/// the samples `used`. What it leaves of all samples.
pub fn without_linear_friction(
    robot: &Robot,
    motions: &Motions,
    residual: &DMatrix<f64>,
    used: &[usize],
) -> DMatrix<f64> {
    let mut left = residual.clone();
    for (j, columns) in motions.friction(robot).iter().enumerate() {
        let all = DMatrix::from_row_slice(columns.len() / 3, 3, columns);
        let (own, target) = (all.select_rows(used), residual.column(j).select_rows(used));
        let Some(factor) = (own.transpose() * &own).cholesky() else { continue };
        let coefficients: DVector<f64> = factor.solve(&(own.transpose() * target));
        let mut column = left.column_mut(j);
        column -= all * coefficients;
    }
    left
}

/// Entropic Bregman divergence of pseudo-inertias, tr(P0^-1 P) - log det(P0^-1 P) - 4, summed over the links: 0 where
/// both are equal. NaN where one of them is not physical.
pub fn divergence(links: &[Matrix4<f64>], from: &[Matrix4<f64>]) -> f64 {
    let one = |(link, from): (&Matrix4<f64>, &Matrix4<f64>)| {
        let (link, from) = (link.cholesky()?, from.cholesky()?);
        let log = |root: &Matrix4<f64>| 2.0 * root.diagonal().map(f64::ln).sum();
        let full = link.l() * link.l().transpose();
        Some((from.inverse() * full).trace() - log(&link.l()) + log(&from.l()) - 4.0)
    };
    links.iter().zip(from).map(|pair| one(pair).unwrap_or(f64::NAN)).sum()
}

/// Pseudo-inertias of links.
pub fn pseudo_inertias(links: impl IntoIterator<Item = LinkInertia>) -> Vec<Matrix4<f64>> {
    links.into_iter().map(|link| link.pseudo_inertia()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motions::rms;
    use crate::simulated_leg::{Leg, Measurement};

    /// A leg and a motion of it without friction and noise.
    fn ideal() -> (Leg, Motions) {
        let mut leg = Leg::random(3);
        leg.friction.iter_mut().for_each(|friction| *friction = Default::default());
        let motions = leg.measured(&[4, 5], &Measurement::EXACT, 6);
        (leg, motions)
    }

    #[test]
    fn only_the_model_with_coupling_explains_a_leg_with_belts() {
        let (leg, motions) = ideal();
        let used = motions.of(0);
        let left = Detail::ALL.map(|detail| {
            let bodies = fit(&detail.of(&leg.prior), &motions, &used, Friction::None).unwrap();
            assert!(bodies.links.iter().all(LinkInertia::is_physical));
            assert_eq!(bodies.rotors.iter().all(|rotor| *rotor == 0.0), detail == Detail::Links);
            let (left, all) = (rms(&bodies.residual, &motions.of(1)), rms(&motions.effort(), &motions.of(1)));
            left.iter().zip(&all).map(|(left, all)| left / all).fold(0.0, f64::max)
        });
        assert!(left[0] < 0.01, "{left:?}");
        assert!(left[1] > 0.1 && left[2] > 0.1, "{left:?}");
    }

    #[test]
    fn linear_friction_is_taken_off_by_the_motors_own_speed() {
        let (leg, mut motions) = ideal();
        let columns = motions.friction(&leg.robot);
        let clean = motions.effort();
        for (i, efforts) in motions.efforts.iter_mut().enumerate() {
            efforts.iter_mut().enumerate().for_each(|(j, effort)| {
                let [viscous, coulomb, one] = [0, 1, 2].map(|k| columns[j][3 * i + k]);
                *effort += 0.02 * viscous + 0.05 * coulomb - 0.01 * one;
            });
        }
        let lost = motions.effort() - clean;
        let left = without_linear_friction(&leg.robot, &motions, &lost, &motions.of(0));
        assert!(left.amax() < 1e-10 && lost.amax() > 0.05);
        // By the joints' speeds it is not linear friction.
        let uncoupled = Detail::Rotors.of(&leg.robot);
        let left = without_linear_friction(&uncoupled, &motions, &lost, &motions.of(0));
        assert!(left.column(3).amax() > 0.01);
        // Together with the links.
        let bodies = fit(&leg.prior, &motions, &motions.of(0), Friction::Simple).unwrap();
        assert!(bodies.residual.amax() < 0.02 * lost.amax(), "{}", bodies.residual.amax());
    }

    #[test]
    fn divergence_is_that_of_scaled_masses_and_zero_between_equals() {
        let leg = Leg::random(1);
        let links = pseudo_inertias(leg.robot.tree.joints.iter().map(|joint| joint.link));
        assert!(divergence(&links, &links).abs() < 1e-9);
        let doubled: Vec<_> = links.iter().map(|link| 2.0 * link).collect();
        let expected = 5.0 * 4.0 * (1.0 - 2f64.ln());
        assert!((divergence(&doubled, &links) - expected).abs() < 1e-9);
        assert!(divergence(&[-links[0]], &links[..1]).is_nan());
    }
}
