//! The LSS master's protocol on a bus; host.

use super::cob_id;
use super::error::ClientError;
use super::frame::frame;
use super::lss::{Address, Fastscan, IDENTIFIED, Step, request};
use super::network::{Network, Subscription};
use super::sdo::Message;
use std::time::{Duration, Instant};

/// Scans until an answer neither comes late nor is lost.
const ATTEMPTS: u32 = 3;

impl Network {
    /// Finds one node that has no id, of any number of them, and puts it into configuration state; none where there is
    /// none. `wait` is how long a node may take to answer, and how long each of 133 questions takes: 10 ms on a
    /// bus, more where nodes are programs.
    pub fn fastscan(&self, wait: Duration) -> Result<Option<Address>, ClientError> {
        let answers = self.subscribe(|frame| frame.id() == cob_id::LSS_SLAVE);
        for attempt in 1..=ATTEMPTS {
            // Nodes half way through another scan or configuration forget it.
            self.lss(&request::switch_global(false))?;
            let mut scan = Fastscan::new();
            loop {
                match scan.step() {
                    Step::Ask(question) => {
                        while answers.try_next()?.is_some() {}
                        self.lss(&question)?;
                        // All of it, also after an answer: the other nodes' come at other moments, and would be taken
                        // for answers to the next question.
                        let deadline = Instant::now() + wait * attempt;
                        let mut answered = false;
                        while let Some(received) = answers.next(deadline.saturating_duration_since(Instant::now()))? {
                            answered |= received.frame.data().first() == Some(&IDENTIFIED);
                        }
                        scan.answered(answered);
                    }
                    Step::Found(address) => return Ok(Some(address)),
                    Step::Nobody => return Ok(None),
                    Step::Confused => break,
                }
            }
        }
        Err(ClientError::Silence { what: "a consistent answer to the LSS fastscan".into(), timeout: wait * ATTEMPTS })
    }

    /// Returns `true` if some node without an id answers within `wait`; it stays as it is.
    pub fn somebody_has_no_id(&self, wait: Duration) -> Result<bool, ClientError> {
        let answers = self.subscribe(|frame| frame.id() == cob_id::LSS_SLAVE);
        let Step::Ask(question) = Fastscan::new().step() else { return Ok(false) };
        self.lss(&question)?;
        Ok(wait_for(&answers, IDENTIFIED, wait)?.is_some())
    }

    /// Puts the node with this address into configuration state, whether it has an id or not.
    pub fn select(&self, address: &Address) -> Result<(), ClientError> {
        let answers = self.subscribe(|frame| frame.id() == cob_id::LSS_SLAVE);
        self.lss(&request::switch_global(false))?;
        for message in request::switch_selective(address) {
            self.lss(&message)?;
        }
        let timeout = self.patience();
        let what = || format!("an LSS answer of the node with {address}");
        wait_for(&answers, 0x44, timeout)?.map(drop).ok_or_else(|| ClientError::Silence { what: what(), timeout })
    }

    /// Gives the node in configuration state an id, 1 to 127, keeps it in the node where `store`, and lets the node
    /// begin: it boots. Only after [`Network::fastscan`] or [`Network::select`]: every node in configuration state
    /// takes it.
    pub fn assign(&self, node: u8, store: bool) -> Result<(), ClientError> {
        if !matches!(node, 1..=127) {
            return Err(ClientError::NodeId(node));
        }
        self.configure("the node id", &request::configure_node_id(node))?;
        if store {
            self.configure("to store the node id", &request::store())?;
        }
        let heartbeats = self.heartbeats();
        self.lss(&request::switch_global(false))?;
        let timeout = self.patience();
        let deadline = Instant::now() + timeout;
        while let Some(received) = heartbeats.next(deadline.saturating_duration_since(Instant::now()))? {
            if received.frame.id() == cob_id::HEARTBEAT | u16::from(node) {
                return Ok(());
            }
        }
        // A node that had an id keeps it until its communication is reset.
        Err(ClientError::Silence { what: format!("the boot-up message of node {node}"), timeout })
    }

    /// Has the node with this address keep its id over a loss of power.
    pub fn store_node_id(&self, address: &Address) -> Result<(), ClientError> {
        self.select(address)?;
        let stored = self.configure("to store the node id", &request::store());
        self.lss(&request::switch_global(false))?;
        stored
    }

    /// Ends every configuration: a node that was given an id, and has not begun to use it, begins, and sends its
    /// boot-up message.
    pub fn end_configuration(&self) -> Result<(), ClientError> {
        self.lss(&request::switch_global(false))
    }

    fn configure(&self, what: &'static str, message: &Message) -> Result<(), ClientError> {
        let answers = self.subscribe(|frame| frame.id() == cob_id::LSS_SLAVE);
        self.lss(message)?;
        let &[command, ..] = message;
        let timeout = self.patience();
        match wait_for(&answers, command, timeout)? {
            None => Err(ClientError::Silence { what: format!("the answer to LSS: {what}"), timeout }),
            Some([_, 0, ..]) => Ok(()),
            Some([_, code, specific_code, ..]) => Err(ClientError::Lss { what, code, specific_code }),
        }
    }

    fn lss(&self, message: &Message) -> Result<(), ClientError> {
        self.send(&frame(cob_id::LSS_MASTER, message))
    }
}

/// The answer with this command.
fn wait_for(answers: &Subscription, command: u8, timeout: Duration) -> Result<Option<Message>, ClientError> {
    let deadline = Instant::now() + timeout;
    while let Some(received) = answers.next(deadline.saturating_duration_since(Instant::now()))? {
        if let Some(message @ [answer, ..]) = received.frame.eight()
            && *answer == command
        {
            return Ok(Some(*message));
        }
    }
    Ok(None)
}
