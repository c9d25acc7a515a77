//! Steps from one structure to another; host.

use crate::friction_model::Term;
use std::fmt;

/// Part that a structure can lose or gain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Freedom {
    /// A term.
    Term(Term),
    /// A Coulomb friction for each direction.
    AsymmetricCoulomb,
    /// A height of the Stribeck peak for each direction.
    AsymmetricBreakaway,
}

impl fmt::Display for Freedom {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Term(term) => write!(f, "{term:?}"),
            Self::AsymmetricCoulomb => f.write_str("asymmetry of the Coulomb friction"),
            Self::AsymmetricBreakaway => f.write_str("asymmetry of the breakaway friction"),
        }
    }
}
