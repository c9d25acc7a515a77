//! Joints on a bus, each on one line, and node ids for those without one; host.

use bus::client::{ClientError, Network};
use joint_firmware::objects::field::{Actual, Field};
use jointctl::remote::present::{PATIENCE, present};
use jointctl::remote::{RemoteError, RemoteJoint, address, condition, info};
use serde_json::{Value, json};
use std::time::Duration;

/// Time that a node may take to answer one of a fastscan's 133 questions.
const WAIT: Duration = Duration::from_millis(60);

/// Node id from which on the page offers some.
pub const OFFERED: u8 = 5;

/// Returns `true` if a joint without a node id answers.
///
/// # Errors
/// The bus.
pub fn waits(network: &Network) -> Result<bool, ClientError> {
    network.somebody_has_no_id(PATIENCE)
}

/// Everybody who answers; `over` ends the search.
///
/// # Errors
/// The bus; a node that does not answer twice is told in its line.
pub fn scan(network: &Network, over: &dyn Fn() -> bool) -> Result<Value, RemoteError> {
    let mut lines = Vec::new();
    for node in present(network, PATIENCE)? {
        if over() {
            break;
        }
        lines.push(match RemoteJoint::on(network, node).and_then(|joint| line(&joint)) {
            Ok(line) => line,
            Err(error) => json!({ "node": node, "error": error.to_string() }),
        });
    }
    Ok(lines.into())
}

/// Gives the joints without a node id the free ones from `first` on, which they keep.
///
/// # Errors
/// The bus, no free id, or a joint that refuses; those that have got one by then keep it.
pub fn address(network: &Network, first: u8) -> Result<Value, RemoteError> {
    let mut given = Vec::new();
    let mut tell = |done: &address::Addressed| {
        given.push(json!({ "node": done.node, "address": done.address.to_string() }));
    };
    address::assign(network, first, true, WAIT, &mut tell)?;
    Ok(given.into())
}

fn line(joint: &RemoteJoint) -> Result<Value, RemoteError> {
    let text = |index| joint.node().upload(index, 0).map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
    let shown = |actual| info::show(joint, Field::Actual(actual));
    let faults = joint.faults()?;
    Ok(json!({
        "node": joint.id(),
        "name": text(0x1008)?,
        "program": text(0x100A)?,
        "state": condition::name(joint.state()?),
        "faults": if faults.is_empty() { "none".to_owned() } else { condition::list(&faults) },
        "supply": shown(Actual::BusVoltage)?,
        "winding": shown(Actual::WindingTemperature)?,
        "bridge": shown(Actual::BridgeTemperature)?,
    }))
}
