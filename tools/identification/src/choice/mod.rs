//! Choice of a model by its error on motions that it was not fitted to; host. `docs/model-choice.md` has figures.
//!
//! - [`grouping`] finds the motions of a recording and which folds leave them out;
//! - [`folds`] is the result: up to eight folds, each of which leaves out whole motions;
//! - [`mod@compare`] is the rule: the simpler model unless a richer one wins beyond the spread of the folds;
//! - [`overrule`] holds decisions that a person makes instead.
//!
//! The physical terms (`identify::selection`), the physical models and the network with its inputs (`fit`) are chosen
//! by the same rule over the same folds.

pub mod compare;
pub mod folds;
pub mod grouping;
pub mod overrule;

pub use compare::{Comparison, LEAST_WORTH, WORST_FOLD, compare, rank};
pub use folds::{Folds, MOST_FOLDS};
pub use overrule::{Decision, TermRule};
