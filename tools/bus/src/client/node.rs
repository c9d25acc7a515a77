//! One node's object dictionary; host. Every call waits for the node.

use super::error::{ClientError, Object};
use super::network::Network;
use super::sdo::{Method, Settings, Transfer};
use canopen_node::Abort;
use std::time::Duration;

/// Times that an object is read before another client that disturbs each time is an error.
const READS: u32 = 5;

/// Pause before the second read, in milliseconds; twice as long before each that follows.
const PAUSE_MS: u64 = 2;

impl Network {
    /// A node by its id, 1 to 127.
    pub fn node(&self, id: u8) -> Result<Node, ClientError> {
        if matches!(id, 1..=127) { Ok(Node::new(self.clone(), id)) } else { Err(ClientError::NodeId(id)) }
    }
}

/// A node, by its id.
#[derive(Clone, Debug)]
pub struct Node {
    network: Network,
    id: u8,
    settings: Settings,
}

impl Node {
    fn new(network: Network, id: u8) -> Self {
        let settings = Settings { timeout: network.patience(), ..Settings::default() };
        Self { network, id, settings }
    }

    /// Node with other patience, say for storing into flash.
    pub fn with_settings(self, settings: Settings) -> Self {
        Self { settings, ..self }
    }

    /// Node id, 1 to 127.
    pub fn id(&self) -> u8 {
        self.id
    }

    /// The network it is part of.
    pub fn network(&self) -> &Network {
        &self.network
    }

    fn object(&self, index: u16, sub_index: u8) -> Object {
        Object { node: self.id, index, sub_index }
    }

    /// Reads an object. Another client's request that comes in between ends the transfer, and it is read again, five
    /// times in all: reading changes nothing. Writing is not repeated.
    pub fn upload(&self, index: u16, sub_index: u8) -> Result<Vec<u8>, ClientError> {
        self.upload_by(index, sub_index, Method::Automatic)
    }

    /// Reads an object in a certain way.
    pub fn upload_by(&self, index: u16, sub_index: u8, method: Method) -> Result<Vec<u8>, ClientError> {
        let read = || {
            let transfer = Transfer::upload(self.object(index, sub_index), method, self.settings);
            self.network.run(transfer, self.settings.timeout)
        };
        let mut outcome = read();
        for again in 1..READS {
            if !matches!(outcome, Err(ClientError::OtherClient { .. })) {
                break;
            }
            std::thread::sleep(Duration::from_millis(PAUSE_MS << (again - 1)));
            outcome = match read() {
                // A slow node's answers to the transfer that was cut off fall into this one.
                Err(ClientError::Aborted { object, abort: Abort::COMMAND } | ClientError::Protocol { object, .. }) => {
                    Err(ClientError::OtherClient { object })
                }
                outcome => outcome,
            };
        }
        outcome
    }

    /// Writes an object.
    pub fn download(&self, index: u16, sub_index: u8, data: &[u8]) -> Result<(), ClientError> {
        self.download_by(index, sub_index, data, Method::Automatic)
    }

    /// Writes an object in a certain way.
    pub fn download_by(&self, index: u16, sub_index: u8, data: &[u8], method: Method) -> Result<(), ClientError> {
        let transfer = Transfer::download(self.object(index, sub_index), data, method, self.settings);
        self.network.run(transfer, self.settings.timeout).map(drop)
    }

    /// Reads a number of exactly `N` bytes, little endian: `u32::from_le_bytes(node.number(0x1000, 0)?)`.
    pub fn number<const N: usize>(&self, index: u16, sub_index: u8) -> Result<[u8; N], ClientError> {
        let data = self.upload(index, sub_index)?;
        <[u8; N]>::try_from(data.as_slice()).map_err(|_| ClientError::Protocol {
            object: self.object(index, sub_index),
            problem: format!("{} bytes, where {N} were expected", data.len()),
        })
    }
}
