//! The keys that govern how a model is chosen, as a description of a data set has them; host.

use crate::choice::{Decision, TermRule};
use serde::Deserialize;

/// Grouping of the motions, and decisions of the choice that are overruled.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Choice {
    /// Columns of the recordings or of the table of runs whose values tell motions apart; `run` and `file` are known
    /// without a column. Absent: found in the recordings.
    #[serde(default)]
    pub group_by: Vec<String>,
    /// The network is kept, never trained, or chosen.
    #[serde(default)]
    pub network: Decision,
    /// Lagged accelerations in the rigid part, likewise.
    #[serde(default, rename = "lagged_accelerations")]
    pub lags: Decision,
    /// Terms that are forced (`+Stribeck`) or forbidden (`-Hysteresis`).
    #[serde(default)]
    pub terms: Vec<TermRule>,
}
