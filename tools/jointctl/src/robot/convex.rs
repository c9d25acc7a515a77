//! Inertial parameters that every body can have: 000 eq. 2.4 with the entropic Bregman divergence, by a damped Newton
//! method; host.
//!
//! minimise 1/2 sum_j |efforts_j - model|^2 / s_j^2 + gamma sum_links [ tr(P0^-1 P) - log det P ], P the
//! pseudo-inertia of a link and P0 that of the prior (T. Lee, P. Wensing, F. Park, Geometric Robot Dynamic
//! Identification: A Convex Programming Approach, 2020). The logarithm keeps P positive definite. A rotor inertia J
//! has gamma (J / J0 - log J) likewise. Friction is free.

use super::equations::{Layout, Normal};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Matrix4};
use rigid_body::Robot;
use rigid_body::inertia::{LinkInertia, PARAMETERS, pseudo_inertia_basis};
use rigid_body::mass_matrix::motion_subspace;

/// Spread that is added to the prior's mass in every direction, m: a link of points or rods becomes a body.
const SPREAD: f64 = 0.01;
/// A rotor's prior where none is stated, part of its link's inertia about the axis.
const ROTOR: f64 = 0.1;
/// Parts of its own curvature that are added in turn: friction columns may depend on each other.
const DAMPING: [f64; 4] = [1e-12, 1e-10, 1e-8, 1e-6];
/// Newton steps at the most.
const STEPS: usize = 80;
/// Decrement below which the minimum is reached.
const DECREMENT: f64 = 1e-9;

/// Prior of the inertial parameters.
#[derive(Clone, Debug)]
pub struct Prior {
    links: Vec<Matrix4<f64>>,
    rotors: Vec<Option<f64>>,
    parameters: Vec<f64>,
}

impl Prior {
    /// The robot's URDF, and a part of each link's inertia for its rotor.
    pub fn of(robot: &Robot) -> Self {
        let widened = |link: &LinkInertia| {
            let mut pseudo = link.pseudo_inertia();
            (0..3).for_each(|i| pseudo[(i, i)] += link.mass * SPREAD * SPREAD);
            pseudo
        };
        let links: Vec<Matrix4<f64>> = robot.tree.joints.iter().map(|joint| widened(&joint.link)).collect();
        let rotor = |(j, joint): (usize, &rigid_body::Joint)| {
            let axis = motion_subspace(joint);
            let own = axis.dot(&(joint.link.spatial() * axis)).max(1e-6) / robot.coupling[(j, j)].powi(2).max(1e-12);
            robot.drives[j].rotor_inertia.is_none().then_some(ROTOR * own)
        };
        let rotors = robot.tree.joints.iter().enumerate().map(rotor).collect();
        let basis = pseudo_inertia_basis();
        // The parameters whose pseudo-inertia is the widened one.
        let parameters = links.iter().flat_map(|pseudo| parameters(pseudo, &basis)).collect();
        Self { links, rotors, parameters }
    }
}

/// Parameters of a pseudo-inertia.
fn parameters(pseudo: &Matrix4<f64>, basis: &[Matrix4<f64>; PARAMETERS]) -> Vec<f64> {
    let gram = DMatrix::from_fn(PARAMETERS, PARAMETERS, |a, b| basis[a].dot(&basis[b]));
    let right = DVector::from_fn(PARAMETERS, |a, _| basis[a].dot(pseudo));
    gram.lu().solve(&right).map_or_else(|| vec![0.0; PARAMETERS], |x| x.iter().copied().collect())
}

/// The minimum. `normal` is the sum over the joints, each divided by its noise squared. None where Newton's method
/// does not get there.
pub fn solve(normal: &Normal, layout: Layout, prior: &Prior, gamma: f64) -> Option<DVector<f64>> {
    let task = Task { normal, layout, prior, gamma, basis: pseudo_inertia_basis() };
    let mut x = DVector::zeros(layout.unknowns());
    x.rows_mut(0, layout.inertial()).copy_from_slice(&prior.parameters);
    for (k, rotor) in prior.rotors.iter().enumerate() {
        x[layout.inertial() + k] = rotor.unwrap_or(0.0);
    }
    let mut cost = task.cost(&x)?;
    for _ in 0..STEPS {
        let (gradient, hessian) = task.derivatives(&x)?;
        let scale: Vec<f64> = hessian.diagonal().iter().map(|d| 1.0 / d.max(1e-30).sqrt()).collect();
        let n = scale.len();
        let scaled = DMatrix::from_fn(n, n, |a, b| hessian[(a, b)] * scale[a] * scale[b]);
        let right = DVector::from_fn(n, |i, _| -gradient[i] * scale[i]);
        let step = factor(&scaled)?.solve(&right);
        let step = DVector::from_fn(n, |i, _| step[i] * scale[i]);
        let decrement = -gradient.dot(&step);
        if decrement < DECREMENT * (1.0 + cost.abs()) {
            return Some(x);
        }
        let mut length = 1.0;
        loop {
            let next = &x + length * &step;
            match task.cost(&next) {
                Some(lower) if lower <= cost - 1e-4 * length * decrement => {
                    (x, cost) = (next, lower);
                    break;
                }
                _ if length < 1e-12 => return Some(x),
                _ => length *= 0.5,
            }
        }
    }
    Some(x)
}

/// Factor of a scaled Hessian. More is added where rounding hides the prior behind a large sum of squares: the step is
/// still one of descent.
fn factor(scaled: &DMatrix<f64>) -> Option<Cholesky<f64, Dyn>> {
    DAMPING.into_iter().find_map(|damping| {
        let mut damped = scaled.clone();
        (0..scaled.nrows()).for_each(|i| damped[(i, i)] += damping);
        damped.cholesky()
    })
}

/// The links that the unknowns stand for.
pub fn links(unknowns: &DVector<f64>, layout: Layout) -> Vec<LinkInertia> {
    (0..layout.joints)
        .map(|j| {
            let mut all = [0.0; PARAMETERS];
            all.iter_mut().zip(unknowns.iter().skip(PARAMETERS * j)).for_each(|(place, value)| *place = *value);
            LinkInertia::from_parameters(&all)
        })
        .collect()
}

struct Task<'a> {
    normal: &'a Normal,
    layout: Layout,
    prior: &'a Prior,
    gamma: f64,
    basis: [Matrix4<f64>; PARAMETERS],
}

impl Task<'_> {
    /// The cost; None outside of what is physical.
    fn cost(&self, x: &DVector<f64>) -> Option<f64> {
        let mut cost = 0.5 * self.normal.residual(x);
        for (link, prior) in links(x, self.layout).iter().zip(&self.prior.links) {
            let pseudo = link.pseudo_inertia();
            let root = pseudo.cholesky()?;
            let log = 2.0 * (0..4).map(|i| root.l()[(i, i)].ln()).sum::<f64>();
            cost += self.gamma * ((prior.try_inverse()? * pseudo).trace() - log);
        }
        for (k, prior) in self.prior.rotors.iter().enumerate() {
            let rotor = x[self.layout.inertial() + k];
            if let Some(prior) = prior {
                if rotor <= 0.0 {
                    return None;
                }
                cost += self.gamma * (rotor / prior - rotor.ln());
            }
        }
        Some(cost)
    }

    fn derivatives(&self, x: &DVector<f64>) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let mut gradient = &self.normal.matrix * x - &self.normal.right;
        let mut hessian = self.normal.matrix.clone();
        for (j, (link, prior)) in links(x, self.layout).iter().zip(&self.prior.links).enumerate() {
            let inverse = link.pseudo_inertia().try_inverse()?;
            let of_prior = prior.try_inverse()?;
            let by: Vec<Matrix4<f64>> = self.basis.iter().map(|basis| inverse * basis).collect();
            for a in 0..PARAMETERS {
                let at = PARAMETERS * j + a;
                gradient[at] += self.gamma * ((of_prior * self.basis[a]).trace() - by[a].trace());
                for b in 0..PARAMETERS {
                    hessian[(at, PARAMETERS * j + b)] += self.gamma * (by[a] * by[b]).trace();
                }
            }
        }
        for (k, prior) in self.prior.rotors.iter().enumerate() {
            let at = self.layout.inertial() + k;
            match prior {
                Some(prior) => {
                    gradient[at] += self.gamma * (1.0 / prior - 1.0 / x[at]);
                    hessian[(at, at)] += self.gamma / (x[at] * x[at]);
                }
                None => hessian[(at, at)] += 1.0,
            }
        }
        Some((gradient, hessian))
    }
}
