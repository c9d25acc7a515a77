//! Heartbeats and boot-up messages: CiA 301 sections 7.2.8.3.2.2 and 7.2.8.3.3; no I/O, time passed in, host.

use super::{NmtState, cob_id};
use crate::Frame;
use std::collections::BTreeMap;
use std::time::Duration;

/// The node and its state; [`NmtState::Initialising`] is the boot-up message. None where the frame is no heartbeat, or
/// names no state of CiA 301.
pub fn parse(frame: &Frame) -> Option<(u8, NmtState)> {
    let node = frame.id().checked_sub(cob_id::HEARTBEAT).filter(|node| matches!(node, 1..=127))? as u8;
    let &[byte] = frame.data() else { return None };
    let state = NmtState::from_byte(byte);
    (state as u8 == byte & 0x7F).then_some((node, state))
}

/// Change of a node's state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// A node booted: it is new, or it was reset, and has forgotten what it was told.
    BootUp {
        /// Node id.
        node: u8,
    },
    /// A node is heard for the first time, in another state than before, or again.
    State {
        /// Node id.
        node: u8,
        /// Its state.
        state: NmtState,
    },
    /// A node has been silent for too long.
    Lost {
        /// Node id.
        node: u8,
    },
}

#[derive(Clone, Copy, Debug)]
struct Seen {
    state: NmtState,
    at: Duration,
    lost: bool,
}

/// Watches all nodes. A node that never sent a heartbeat is not missed; one that only booted may have none configured,
/// and is not missed either.
#[derive(Clone, Debug)]
pub struct Watch {
    timeout: Duration,
    nodes: BTreeMap<u8, Seen>,
}

impl Watch {
    /// `timeout` of silence is a loss: two to three times the heartbeats' period.
    pub fn new(timeout: Duration) -> Self {
        Self { timeout, nodes: BTreeMap::new() }
    }

    /// Takes any frame.
    pub fn receive(&mut self, frame: &Frame, now: Duration) -> Option<Change> {
        let (node, state) = parse(frame)?;
        let before = self.nodes.insert(node, Seen { state, at: now, lost: false });
        if state == NmtState::Initialising {
            return Some(Change::BootUp { node });
        }
        let known = before.is_some_and(|before| before.state == state && !before.lost);
        (!known).then_some(Change::State { node, state })
    }

    /// The next node that is silent for too long. Call it until there is none.
    pub fn poll(&mut self, now: Duration) -> Option<Change> {
        let timeout = self.timeout;
        let silent =
            |seen: &Seen| !seen.lost && seen.state != NmtState::Initialising && now.saturating_sub(seen.at) > timeout;
        let (node, seen) = self.nodes.iter_mut().find(|(_, seen)| silent(seen))?;
        seen.lost = true;
        Some(Change::Lost { node: *node })
    }

    /// States of the nodes that are heard.
    pub fn states(&self) -> impl Iterator<Item = (u8, NmtState)> {
        self.nodes.iter().filter(|(_, seen)| !seen.lost).map(|(node, seen)| (*node, seen.state))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Duration = Duration::from_millis(1);

    fn beat(node: u16, state: u8) -> Frame {
        Frame::new(0x700 + node, &[state]).unwrap()
    }

    #[test]
    fn boot_up_states_loss_and_return_are_told_once() {
        let mut watch = Watch::new(100 * MS);
        let state = |node, state| Some(Change::State { node, state });
        assert_eq!(watch.receive(&beat(5, 0), MS), Some(Change::BootUp { node: 5 }));
        assert_eq!(watch.receive(&beat(5, 0x7F), 2 * MS), state(5, NmtState::PreOperational));
        assert_eq!(watch.receive(&beat(5, 0x7F), 3 * MS), None);
        assert_eq!(watch.receive(&beat(6, 0x05), 4 * MS), state(6, NmtState::Operational));
        assert_eq!(watch.poll(103 * MS), None);
        assert_eq!(watch.poll(104 * MS), Some(Change::Lost { node: 5 }));
        assert_eq!(watch.poll(104 * MS), None);
        assert_eq!(watch.states().collect::<Vec<_>>(), [(6, NmtState::Operational)]);
        assert_eq!(watch.receive(&beat(5, 0x7F), 200 * MS), state(5, NmtState::PreOperational));
    }

    #[test]
    fn a_node_that_only_booted_is_not_missed() {
        let mut watch = Watch::new(100 * MS);
        watch.receive(&beat(5, 0), MS);
        assert_eq!(watch.poll(1000 * MS), None);
    }

    #[test]
    fn other_frames_and_other_bytes_are_no_heartbeats() {
        for frame in [beat(0, 5), Frame::new(0x705, &[]).unwrap(), Frame::new(0x705, &[5, 0]).unwrap(), beat(5, 3)] {
            assert_eq!(parse(&frame), None, "{frame:?}");
        }
        assert_eq!(parse(&beat(0x7F, 0x05)), Some((127, NmtState::Operational)));
    }
}
