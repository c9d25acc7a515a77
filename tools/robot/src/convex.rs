//! Inertial parameters that every body can have: 000 eq. 2.4 with the entropic Bregman divergence, by a damped Newton
//! method; host.
//!
//! minimise 1/2 sum_j |efforts_j - model|^2 / s_j^2 + gamma sum_links [ tr(P0^-1 P) - log det P ], P the
//! pseudo-inertia of a link and P0 that of the prior (T. Lee, P. Wensing, F. Park, Geometric Robot Dynamic
//! Identification: A Convex Programming Approach, 2020). The logarithm keeps P positive definite. A rotor inertia J
//! has gamma (J / J0 - log J) likewise. Friction is free.
//!
//! Where a link lies within an ellipsoid ([`crate::bounds`]) its room r = tr(Q P) stays above 0: gamma (r / r0 - log r)
//! is added, r0 the room of the prior, a tenth of its mass at the least.
//!
//! A step is computed in coordinates of its own at every point: P = L (1 + T) L^T with L L^T = P of the point and T
//! symmetric, J times 1 + t. There the logarithm's Hessian is gamma times the identity however thin a link becomes. In
//! the parameters themselves it grows with the inverse square of P's smallest eigenvalue and hides the sum of squares
//! in rounding.

use super::equations::{Layout, Normal};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Matrix4};
use rigid_body::Robot;
use rigid_body::ellipsoid::Ellipsoid;
use rigid_body::inertia::{LinkInertia, PARAMETERS};
use rigid_body::mass_matrix::motion_subspace;

/// Spread that is added to the prior's mass in every direction, m: a link of points or rods becomes a body.
const SPREAD: f64 = 0.01;
/// A rotor's prior where none is stated, part of its link's inertia about the axis.
const ROTOR: f64 = 0.1;
/// Least room of a prior that is the measure of the room, part of its mass: one nearer to the ellipsoid would hold the
/// mass at the surface.
const ROOM: f64 = 0.1;
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
    rooms: Vec<Option<Room>>,
}

/// Room of a link in its ellipsoid.
#[derive(Clone, Debug)]
struct Room {
    /// Q of the ellipsoid.
    matrix: Matrix4<f64>,
    /// Measure of the room, kg.
    prior: f64,
}

impl Prior {
    /// The robot's URDF, and a part of each link's inertia for its rotor.
    pub fn of(robot: &Robot) -> Self {
        let widened = |link: &LinkInertia| {
            let mut pseudo = link.pseudo_inertia();
            (0..3).for_each(|i| pseudo[(i, i)] += link.mass * SPREAD * SPREAD);
            pseudo
        };
        let links = robot.tree.joints.iter().map(|joint| widened(&joint.link)).collect();
        let rotor = |(j, joint): (usize, &rigid_body::Joint)| {
            let axis = motion_subspace(joint);
            let own = axis.dot(&(joint.link.spatial() * axis)).max(1e-6) / robot.coupling[(j, j)].powi(2).max(1e-12);
            robot.drives[j].rotor_inertia.is_none().then_some(ROTOR * own)
        };
        let rotors = robot.tree.joints.iter().enumerate().map(rotor).collect();
        Self { links, rotors, rooms: vec![None; robot.tree.joints.len()] }
    }

    /// The same, with the mass of each link within its ellipsoid. A link whose own prior is not has no bound; its index
    /// is among those returned.
    pub fn within(mut self, ellipsoids: &[Option<Ellipsoid>]) -> (Self, Vec<usize>) {
        let mut outside = vec![];
        for (j, ellipsoid) in ellipsoids.iter().enumerate() {
            let Some(ellipsoid) = ellipsoid else { continue };
            let room = ellipsoid.room(&self.links[j]);
            if room <= 0.0 {
                outside.push(j);
                continue;
            }
            let mass = self.links[j][(3, 3)];
            self.rooms[j] = Some(Room { matrix: ellipsoid.matrix(), prior: room.max(ROOM * mass) });
        }
        (self, outside)
    }

    /// The prior's own parameters; friction is zero.
    fn unknowns(&self, layout: Layout) -> DVector<f64> {
        let mut x = DVector::zeros(layout.unknowns());
        for (j, link) in self.links.iter().enumerate() {
            let parameters = LinkInertia::from_pseudo_inertia(link).parameters();
            x.rows_mut(PARAMETERS * j, PARAMETERS).copy_from_slice(&parameters);
        }
        for (k, rotor) in self.rotors.iter().enumerate() {
            x[layout.inertial() + k] = rotor.unwrap_or(0.0);
        }
        x
    }
}

/// The minimum. `normal` is the sum over the joints, each divided by its noise squared. None where Newton's method
/// does not get there: the prior is not physical, or a number is not finite.
pub fn solve(normal: &Normal, layout: Layout, prior: &Prior, gamma: f64) -> Option<DVector<f64>> {
    let inverses = prior.links.iter().map(|link| Some(link.cholesky()?.inverse())).collect::<Option<_>>()?;
    let task = Task { normal, layout, prior, inverses, gamma };
    let mut x = prior.unknowns(layout);
    let mut cost = task.cost(&x)?;
    for _ in 0..STEPS {
        let coordinates = task.coordinates(&x)?;
        let (gradient, hessian) = task.derivatives(&x, &coordinates)?;
        let scale = hessian.diagonal().map(|d| 1.0 / d.max(1e-30).sqrt());
        let scaled = DMatrix::from_fn(scale.len(), scale.len(), |a, b| hessian[(a, b)] * scale[a] * scale[b]);
        let step = factor(&scaled)?.solve(&-gradient.component_mul(&scale)).component_mul(&scale);
        let decrement = -gradient.dot(&step);
        if decrement < DECREMENT * (1.0 + cost.abs()) {
            return Some(x);
        }
        let step = coordinates * step;
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

/// Factor of a scaled Hessian. More is added where rounding leaves it indefinite: the step is still one of descent.
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

/// Symmetric 4 x 4 matrices that are orthonormal: their combinations are all symmetric ones.
fn symmetric() -> [Matrix4<f64>; PARAMETERS] {
    let entries = (0..4).flat_map(|row| (row..4).map(move |column| (row, column)));
    let mut all = [Matrix4::zeros(); PARAMETERS];
    for (matrix, (row, column)) in all.iter_mut().zip(entries) {
        let value = if row == column { 1.0 } else { std::f64::consts::FRAC_1_SQRT_2 };
        matrix[(row, column)] = value;
        matrix[(column, row)] = value;
    }
    all
}

struct Task<'a> {
    normal: &'a Normal,
    layout: Layout,
    prior: &'a Prior,
    /// Inverse of each link's pseudo-inertia of the prior.
    inverses: Vec<Matrix4<f64>>,
    gamma: f64,
}

impl Task<'_> {
    /// The cost; None outside of what is physical.
    fn cost(&self, x: &DVector<f64>) -> Option<f64> {
        let mut cost = 0.5 * self.normal.residual(x);
        for ((link, inverse), room) in links(x, self.layout).iter().zip(&self.inverses).zip(&self.prior.rooms) {
            let pseudo = link.pseudo_inertia();
            let root = pseudo.cholesky()?;
            let log = 2.0 * (0..4).map(|i| root.l()[(i, i)].ln()).sum::<f64>();
            cost += self.gamma * ((inverse * pseudo).trace() - log);
            if let Some(Room { matrix, prior }) = room {
                let room = matrix.dot(&pseudo);
                if room <= 0.0 {
                    return None;
                }
                cost += self.gamma * (room / prior - room.ln());
            }
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

    /// Derivatives of the unknowns by the coordinates at a point: unknowns x coordinates.
    fn coordinates(&self, x: &DVector<f64>) -> Option<DMatrix<f64>> {
        let mut derivatives = DMatrix::identity(x.len(), x.len());
        for (j, link) in links(x, self.layout).iter().enumerate() {
            let root = link.pseudo_inertia().cholesky()?.l();
            for (k, direction) in symmetric().iter().enumerate() {
                let change = LinkInertia::from_pseudo_inertia(&(root * direction * root.transpose()));
                let mut column = derivatives.column_mut(PARAMETERS * j + k);
                column.rows_mut(PARAMETERS * j, PARAMETERS).copy_from_slice(&change.parameters());
            }
        }
        for (k, prior) in self.prior.rotors.iter().enumerate() {
            let at = self.layout.inertial() + k;
            derivatives[(at, at)] = if prior.is_some() { x[at] } else { 1.0 };
        }
        Some(derivatives)
    }

    /// Gradient and Hessian of the cost by the coordinates at a point.
    fn derivatives(&self, x: &DVector<f64>, coordinates: &DMatrix<f64>) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let mut gradient = coordinates.tr_mul(&(&self.normal.matrix * x - &self.normal.right));
        let mut hessian = coordinates.tr_mul(&(&self.normal.matrix * coordinates));
        for (j, (link, inverse)) in links(x, self.layout).iter().zip(&self.inverses).enumerate() {
            let root = link.pseudo_inertia().cholesky()?.l();
            let weighted = root.tr_mul(inverse) * root;
            let first = PARAMETERS * j;
            for (k, direction) in symmetric().iter().enumerate() {
                gradient[first + k] += self.gamma * (weighted.dot(direction) - direction.trace());
                hessian[(first + k, first + k)] += self.gamma;
            }
            if let Some(Room { matrix, prior }) = &self.prior.rooms[j] {
                let weighted = root.tr_mul(matrix) * root;
                let slope = DVector::from_iterator(PARAMETERS, symmetric().iter().map(|one| weighted.dot(one)));
                let room = weighted.trace();
                gradient.rows_mut(first, PARAMETERS).axpy(self.gamma * (1.0 / prior - 1.0 / room), &slope, 1.0);
                let curvature = &slope * slope.transpose() * (self.gamma / (room * room));
                let mut own = hessian.view_mut((first, first), (PARAMETERS, PARAMETERS));
                own += curvature;
            }
        }
        for (k, prior) in self.prior.rotors.iter().enumerate() {
            let at = self.layout.inertial() + k;
            match prior {
                Some(prior) => {
                    gradient[at] += self.gamma * (x[at] / prior - 1.0);
                    hessian[(at, at)] += self.gamma;
                }
                None => hessian[(at, at)] += 1.0,
            }
        }
        Some((gradient, hessian))
    }
}
