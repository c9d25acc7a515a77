//! Node ids for new joints: LSS fastscan finds those that have none, identical or not, one after another; host.

use super::error::RemoteError;
use bus::client::lss::Address;
use bus::client::sdo::Settings;
use bus::client::{ClientError, Network, NmtState};
use std::time::{Duration, Instant};

/// Time in which a node that has an id has to say so.
const PROBE: Duration = Duration::from_millis(50);
/// Number of questions for a node without an id.
const QUESTIONS: u32 = 5;

/// A joint that got its node id.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Addressed {
    /// Its node id now.
    pub node: u8,
    /// Address that tells it from every other.
    pub address: Address,
}

/// Returns `true` if some node has this id.
fn is_taken(network: &Network, id: u8) -> Result<bool, RemoteError> {
    let node = network.node(id)?.with_settings(Settings { timeout: PROBE, ..Settings::default() });
    match node.upload(0x1000, 0) {
        Ok(_) => Ok(true),
        Err(ClientError::NoAnswer { .. }) => Ok(false),
        Err(error @ ClientError::Bus(_)) => Err(error.into()),
        // A node that refuses is there.
        Err(_) => Ok(true),
    }
}

/// Joints that somebody gave an id to and left there, before they began to use it: they begin now. They answer neither
/// a scan nor a fastscan before. A joint whose power comes on in these moments sends the same message, and is told with
/// the id that it has.
fn begun(network: &Network, wait: Duration) -> Result<Vec<Addressed>, RemoteError> {
    let heartbeats = network.heartbeats();
    network.end_configuration()?;
    let (mut begun, end) = (Vec::new(), Instant::now() + QUESTIONS * wait);
    while let Some(received) = heartbeats.next(end.saturating_duration_since(Instant::now()))? {
        if let Some((id, NmtState::Initialising)) = bus::client::heartbeat::parse(&received.frame) {
            let node = network.node(id)?;
            let number = |sub_index| node.number(0x1018, sub_index).map(u32::from_le_bytes);
            let address = Address { vendor: number(1)?, product: number(2)?, revision: number(3)?, serial: number(4)? };
            begun.push(Addressed { node: id, address });
        }
    }
    Ok(begun)
}

/// The next node without an id. That there is none is believed after several questions: one answer comes late easily.
fn find(network: &Network, wait: Duration) -> Result<Option<Address>, RemoteError> {
    for _ in 0..QUESTIONS {
        if let Some(address) = network.fastscan(wait)? {
            return Ok(Some(address));
        }
    }
    Ok(None)
}

/// Gives every joint without a node id the next free one from `first` on, and has it keep it where `store`; those that
/// were given one and left before they used it begin with that. `wait` is how long a node may take to answer each of a
/// scan's 133 questions. Tells each as soon as it is done: where a later one fails, the earlier stay.
pub fn assign(
    network: &Network,
    first: u8,
    store: bool,
    wait: Duration,
    tell: &mut dyn FnMut(&Addressed),
) -> Result<usize, RemoteError> {
    if !matches!(first, 1..=127) {
        return Err(ClientError::NodeId(first).into());
    }
    let (mut next, mut count) = (first, 0);
    for addressed in begun(network, wait)? {
        if store {
            network.store_node_id(&addressed.address)?;
        }
        tell(&addressed);
        count += 1;
    }
    while let Some(address) = find(network, wait)? {
        while next <= 127 && is_taken(network, next)? {
            next += 1;
        }
        if next > 127 {
            return Err(RemoteError::NoFreeId { first, address: address.to_string() });
        }
        network.assign(next, store)?;
        tell(&Addressed { node: next, address });
        next += 1;
        count += 1;
    }
    Ok(count)
}
