//! One joint on a bus: its objects, read and written by the table; host. Every call waits for the node.

use super::entry::Entry;
use super::error::RemoteError;
use super::present::{PATIENCE, present};
use super::session::Owner;
use super::value::Value;
use bus::client::sdo::Settings;
use bus::client::{ClientError, Network, Node, Object};
use joint_firmware::objects::field::Field;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Device profile 402, a servo drive: object 1000h of every joint.
pub const DEVICE_TYPE: u32 = 0x0002_0192;

/// A question that nobody answered is asked again after this time, as long as there is patience.
const QUESTION: Duration = Duration::from_secs(1);

/// A node that has been found to be a joint.
#[derive(Clone, Debug)]
pub struct RemoteJoint {
    node: Node,
    pub(super) owner: Option<Arc<Owner>>,
}

impl RemoteJoint {
    /// Opens a bus ([`bus::open`]) and finds the joint on it.
    pub fn open(bus: &str, node: u8) -> Result<Self, RemoteError> {
        Self::open_within(bus, node, Settings::default().timeout)
    }

    /// The same with `patience`: how long the node may take for each answer.
    pub fn open_within(bus: &str, node: u8, patience: Duration) -> Result<Self, RemoteError> {
        let network = Network::new(bus::open(bus)?).with_patience(patience);
        Self::on(&network, node).map_err(|error| match error {
            // A bus that was opened just now has heard nobody yet.
            RemoteError::Silent(ClientError::NoAnswer { object, timeout, .. }) => {
                let heard = present(&network, PATIENCE).map_or(Vec::new(), |nodes| nodes.into_iter().collect());
                RemoteError::Silent(ClientError::NoAnswer { object, timeout, heard })
            }
            error => error,
        })
    }

    /// Finds a joint on a bus that is open: several may share it.
    pub fn on(network: &Network, node: u8) -> Result<Self, RemoteError> {
        let joint = Self { node: network.node(node)?, owner: None };
        let patience = network.patience();
        let timeout = patience.min(QUESTION);
        let asked = joint.node.clone().with_settings(Settings { timeout, ..Settings::default() });
        let (began, mut again) = (Instant::now(), 1);
        let device_type = loop {
            match asked.number(0x1000, 0) {
                // A client that vanished within a block leaves the node waiting for the rest: it takes the first
                // request for data, and says so by an abort once its own time-out is over.
                Err(ClientError::NoAnswer { heard, .. }) if heard.contains(&node) && again > 0 => again -= 1,
                Err(ClientError::NoAnswer { .. }) if began.elapsed() < patience => {}
                Err(ClientError::NoAnswer { object, heard, .. }) => {
                    return Err(RemoteError::Silent(ClientError::NoAnswer { object, timeout: patience, heard }));
                }
                answer => break u32::from_le_bytes(answer?),
            }
        };
        if device_type == DEVICE_TYPE {
            Ok(joint)
        } else {
            Err(RemoteError::NoJoint { node, device_type, expected: DEVICE_TYPE })
        }
    }

    /// Node id.
    pub fn id(&self) -> u8 {
        self.node.id()
    }

    /// The node, for what has no entry in the table.
    pub fn node(&self) -> &Node {
        &self.node
    }

    /// The bus.
    pub fn network(&self) -> &Network {
        self.node.network()
    }

    /// Reads an object.
    pub fn read(&self, entry: Entry) -> Result<Value, RemoteError> {
        let (index, sub_index) = (entry.object.index, entry.object.sub_index);
        let bytes = self.node.upload(index, sub_index)?;
        entry.decode(&bytes).ok_or_else(|| {
            let object = Object { node: self.id(), index, sub_index };
            let problem = format!("{} bytes are no {}", bytes.len(), entry.object.data_type.name());
            ClientError::Protocol { object, problem }.into()
        })
    }

    /// Writes an object. What the table says cannot be is refused before anything is sent.
    pub fn write(&self, entry: Entry, value: &Value) -> Result<(), RemoteError> {
        let bytes = entry.encode(value)?;
        self.download(entry.object.index, entry.object.sub_index, &bytes)
    }

    /// Reads the number of a field, in the table's unit.
    pub fn number(&self, field: Field) -> Result<f64, RemoteError> {
        Ok(self.read(Entry::of(field))?.number().unwrap_or(f64::NAN))
    }

    /// Reads the whole number of a field, as it is on the bus.
    pub fn raw(&self, field: Field) -> Result<u64, RemoteError> {
        let Entry { object, .. } = Entry::of(field);
        let bytes = self.node.upload(object.index, object.sub_index)?;
        Ok(bytes.iter().take(8).rev().fold(0, |raw, byte| raw << 8 | u64::from(*byte)))
    }

    /// Writes the whole number of a field, as it is on the bus.
    pub fn write_raw(&self, field: Field, raw: u64) -> Result<(), RemoteError> {
        let Entry { object, .. } = Entry::of(field);
        let bytes = raw.to_le_bytes();
        let length = usize::from(object.data_type.bytes().unwrap_or(0)).min(bytes.len());
        self.download(object.index, object.sub_index, bytes.get(..length).unwrap_or(&bytes))
    }
}
