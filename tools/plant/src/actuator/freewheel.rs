//! Currents that body diodes or an open lead decide: one backward Euler step as a small convex problem.
//!
//! A phase whose transistors are off presents a voltage of constant size against its current, V = bus/2 + diode drop
//! about the middle of the rails, and any voltage in between at zero current: the same law as dry friction. With the
//! implicit step M i = b of the windings, the current at the end of the step minimises
//!
//! ```text
//! J(i) = i' M i / 2 - b' i + sum_k w_k |c_k . i|         w_k = 2/3 V,   c_k: direction of phase k in dq
//! ```
//!
//! J is strictly convex and smooth but for three lines through the origin, so its minimum is one of: the origin (no
//! diode conducts), one point on each line (one phase floats), or one point for each combination of signs. All are
//! computed and the least is taken: no case can be missed and nothing chatters at zero.

use super::frame::dot;

/// One implicit step before its diodes are decided.
#[derive(Clone, Copy, Debug)]
pub struct ImplicitStep {
    /// Diagonal of M along d and q, L/h + R, ohm; above zero.
    pub impedance: [f64; 2],
    /// Right side b along d and q, V.
    pub voltage: [f64; 2],
    /// Directions c of the phases in dq.
    pub directions: [[f64; 2]; 3],
    /// Size w of the voltage against the current for each phase, V; zero for a driven phase.
    pub against: [f64; 3],
    /// `true` for each phase that cannot carry current.
    pub open: [bool; 3],
}

impl ImplicitStep {
    /// Returns `true` if no current starts to flow from none: the voltages stay within the rails.
    #[must_use]
    pub fn rests(&self) -> bool {
        match self.open.iter().filter(|open| **open).count() {
            0 => (0..3).all(|k| self.on_line(k).is_none()),
            1 => (0..3).all(|k| !self.open[k] || self.on_line(k).is_none()),
            _ => true,
        }
    }

    /// Currents along d and q at the end of the step, A.
    #[must_use]
    pub fn solve(&self) -> [f64; 2] {
        match self.open.iter().filter(|open| **open).count() {
            0 => self.solve_connected(),
            1 => (0..3).find(|k| self.open[*k]).and_then(|k| self.on_line(k)).unwrap_or([0.0; 2]),
            _ => [0.0; 2],
        }
    }

    fn solve_connected(&self) -> [f64; 2] {
        let mut best = [0.0; 2];
        let mut least = 0.0;
        let mut consider = |candidate: [f64; 2]| {
            let cost = self.cost(candidate);
            if cost < least {
                (best, least) = (candidate, cost);
            }
        };
        (0..3).filter_map(|k| self.on_line(k)).for_each(&mut consider);
        for signs in 0..8_u8 {
            let mut voltage = self.voltage;
            for k in 0..3 {
                let against = if signs >> k & 1 == 0 { self.against[k] } else { -self.against[k] };
                voltage[0] -= against * self.directions[k][0];
                voltage[1] -= against * self.directions[k][1];
            }
            consider([voltage[0] / self.impedance[0], voltage[1] / self.impedance[1]]);
        }
        best
    }

    /// The best current while phase `k` carries none; nothing where that is no current at all.
    fn on_line(&self, k: usize) -> Option<[f64; 2]> {
        let normal = [-self.directions[k][1], self.directions[k][0]];
        let against: f64 = (0..3).map(|j| self.against[j] * dot(self.directions[j], normal).abs()).sum();
        let driving = dot(self.voltage, normal);
        let left = driving.abs() - against;
        if left <= 0.0 {
            return None;
        }
        let impedance = self.impedance[0] * normal[0] * normal[0] + self.impedance[1] * normal[1] * normal[1];
        let size = left.copysign(driving) / impedance;
        Some([size * normal[0], size * normal[1]])
    }

    fn cost(&self, current: [f64; 2]) -> f64 {
        let magnetic = self.impedance[0] * current[0] * current[0] + self.impedance[1] * current[1] * current[1];
        let diodes: f64 = (0..3).map(|k| self.against[k] * dot(self.directions[k], current).abs()).sum();
        0.5 * magnetic - dot(self.voltage, current) + diodes
    }
}
