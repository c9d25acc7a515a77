//! The control steps before a joint's last fault, as a page shows them; host.

use crate::live::rounded;
use jointctl::remote::history::SIGNALS;
use jointctl::remote::{RemoteError, RemoteJoint, condition};
use serde_json::{Value, json};

/// The steps, the last of them with number 0; none while no fault is latched.
///
/// # Errors
/// The bus, or no answer.
pub fn history(joint: &RemoteJoint) -> Result<Value, RemoteError> {
    let steps = joint.history()?;
    let last = steps.len();
    let row = |(at, step): (usize, &jointctl::remote::history::Step)| {
        let signals = step.signals.map(|signal| rounded(f64::from(signal)));
        let state = step.state.map_or("unknown", condition::name);
        json!({ "step": at as i64 + 1 - last as i64, "state": state, "faults": condition::list(&step.faults), "signals": signals })
    };
    let signals = SIGNALS.map(|(name, unit)| json!({ "name": name, "unit": unit }));
    Ok(json!({ "signals": signals, "steps": steps.iter().enumerate().map(row).collect::<Vec<_>>() }))
}
