//! Nodes that answer on a bus; host.

use bus::Frame;
use bus::client::{ClientError, Network, cob_id};
use std::collections::BTreeSet;
use std::time::{Duration, Instant};

/// Patience of a scan: how long it listens for an answer, and for each further one.
pub const PATIENCE: Duration = Duration::from_millis(500);
/// Request of an SDO upload of object 1000h, which every node has (CiA 301, 7.2.4.3.5).
const ASK: [u8; 8] = [0x40, 0x00, 0x10, 0, 0, 0, 0, 0];

/// Nodes that answer. All are asked at once: a node on a busy machine may take its time without the others having to
/// wait for it.
pub fn present(network: &Network, patience: Duration) -> Result<BTreeSet<u8>, ClientError> {
    let answers = network.subscribe(|frame| matches!(frame.id(), 0x581..=0x5FF));
    for id in 1..=127u16 {
        if let Some(request) = Frame::new(cob_id::SDO_RECEIVE | id, &ASK) {
            network.send(&request)?;
        }
    }
    let mut present = BTreeSet::new();
    // Others may be talking as well: not for ever.
    let end = Instant::now() + 4 * patience;
    while let Some(answer) = answers.next(patience.min(end.saturating_duration_since(Instant::now())))? {
        present.insert((answer.frame.id() & 0x7F) as u8);
    }
    Ok(present)
}
