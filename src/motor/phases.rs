//! One value for each of the three motor phases; any context.

/// A quantity of the phases A, B and C (U, V and W), in the unit that the field carrying it states.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Phases {
    /// Phase A, or U.
    pub a: f32,
    /// Phase B, or V.
    pub b: f32,
    /// Phase C, or W.
    pub c: f32,
}

impl Phases {
    /// The same value in every phase.
    pub const fn uniform(value: f32) -> Self {
        Self { a: value, b: value, c: value }
    }
}
