//! Euler-Lagrange equations of a kinetic energy 1/2 v^T M v and a potential energy U at one sample, and their
//! adjoint; host.
//!
//! M = L L^T + offset I with a triangular L (002 eq. 10). With w = L^T a + sum of v_k s_k, s_k = (dL/dq_k)^T v,
//! p = L^T v and D = sum of v_k dL/dq_k, 002 eq. 4 is tau = L w + D p - [p . s_k]_k + offset a + dU/dq: no
//! derivatives of M itself are needed.

use nalgebra::{SMatrix, SVector};

/// Part of the mass matrix that no network can take away, in the units of M.
pub const OFFSET: f64 = 1e-3;

/// Lagrangian at one sample; also the adjoint of one.
#[derive(Clone, Debug)]
pub struct Lagrangian<const N: usize> {
    /// Cholesky factor L of the mass matrix without the offset.
    pub factor: SMatrix<f64, N, N>,
    /// Derivatives of L by each position.
    pub factor_by: [SMatrix<f64, N, N>; N],
    /// Derivatives of the potential energy by each position.
    pub potential_by: SVector<f64, N>,
}

impl<const N: usize> Lagrangian<N> {
    /// Mass matrix.
    pub fn mass_matrix(&self) -> SMatrix<f64, N, N> {
        self.factor * self.factor.transpose() + SMatrix::identity() * OFFSET
    }

    /// Efforts at velocity v and acceleration a.
    pub fn efforts(&self, v: &SVector<f64, N>, a: &SVector<f64, N>) -> SVector<f64, N> {
        let Products { w, p, rate, s } = self.products(v, a);
        self.factor * w + rate * p - SVector::from_fn(|k, _| p.dot(&s[k])) + OFFSET * a + self.potential_by
    }

    /// Adjoint of the Lagrangian for an adjoint t of the efforts.
    pub fn adjoint(&self, v: &SVector<f64, N>, a: &SVector<f64, N>, t: &SVector<f64, N>) -> Self {
        let Products { w, p, rate, s } = self.products(v, a);
        let by_w = self.factor.transpose() * t;
        let mut by_p = rate.transpose() * t;
        s.iter().zip(t.iter()).for_each(|(s, t)| by_p -= s * *t);
        let by_rate = t * p.transpose();
        Self {
            factor: t * w.transpose() + a * by_w.transpose() + v * by_p.transpose(),
            factor_by: std::array::from_fn(|k| v * (by_w * v[k] - p * t[k]).transpose() + by_rate * v[k]),
            potential_by: *t,
        }
    }

    fn products(&self, v: &SVector<f64, N>, a: &SVector<f64, N>) -> Products<N> {
        let s = self.factor_by.each_ref().map(|by| by.transpose() * v);
        let (mut w, mut rate) = (self.factor.transpose() * a, SMatrix::zeros());
        for k in 0..N {
            w += s[k] * v[k];
            rate += self.factor_by[k] * v[k];
        }
        Products { w, p: self.factor.transpose() * v, rate, s }
    }
}

/// Products that efforts and adjoint share; see the module.
struct Products<const N: usize> {
    w: SVector<f64, N>,
    p: SVector<f64, N>,
    /// dL/dt.
    rate: SMatrix<f64, N, N>,
    s: [SVector<f64, N>; N],
}
