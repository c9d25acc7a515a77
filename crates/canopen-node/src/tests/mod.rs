//! The whole server against a client, a master and a hostile bus, on the host.

mod block;
mod client;
mod communication;
mod hostile;
mod lss;
mod network;
mod other_stacks;
mod process_data;
mod sdo;

use super::emergency::code;
use super::*;
use std::collections::{BTreeMap, VecDeque};

/// Node id of the node under test.
pub const NODE: u8 = 5;

pub const IDENTITY: Identity<'static> = Identity {
    device_type: 0x0002_0192,
    device_name: "joint actuator",
    hardware_version: "B",
    software_version: "0.1.0",
    vendor: 0x0000_1234,
    product: 0xDEAD_BEEF,
    revision: 0x0001_0002,
    serial: 0x8000_0001,
};

/// Objects of an application: numbers of 1, 2, 4 and 8 bytes at 2000h:1 to 4, one read only at 2001h, one write only
/// at 2002h, a DOMAIN that is replaced as a whole at 2010h, an empty one at 2011h.
#[derive(Default)]
pub struct Dictionary {
    pub values: BTreeMap<(u16, u8), Vec<u8>>,
    pub domain: Vec<u8>,
    pub staging: Option<Vec<u8>>,
    /// Refusal that `finish` returns.
    pub refusal: Option<Abort>,
    pub writes: Vec<(u16, u8, Vec<u8>)>,
    pub opened: u32,
    pub closed: u32,
    pub events: Vec<Event>,
    pub stored: Option<(Group, CommunicationParameters)>,
    pub restored: Option<Group>,
    pub stored_node_id: Option<u8>,
    /// Abort with which a node id is not stored.
    pub refuses_node_id: Option<Abort>,
    pub keeps_node_id: bool,
    pub parameters: Option<CommunicationParameters>,
    /// An object that is stored has another value.
    pub changed: bool,
    /// The interrupt takes another reset while the task tells of one.
    pub interrupted: Option<&'static Shared>,
}

/// Most bytes of 2010h.
pub const DOMAIN_SIZE: u32 = 2048;

impl Dictionary {
    fn new() -> Self {
        let mut values = BTreeMap::new();
        for (sub, bytes) in [(1, 1), (2, 2), (3, 4), (4, 8)] {
            values.insert((0x2000, sub), vec![0; bytes]);
        }
        values.insert((0x2001, 0), vec![1, 2, 3, 4]);
        values.insert((0x2002, 0), vec![0; 4]);
        Self { values, ..Self::default() }
    }
}

impl ObjectDictionary for Dictionary {
    fn entry(&self, index: u16, sub_index: u8) -> Result<Entry, Abort> {
        let stream = |readable, writable, access| Entry {
            length: Length::Stream { readable, writable },
            access,
            mappable: Mappable::default(),
        };
        match index {
            0x2010 if sub_index == 0 => return Ok(stream(self.domain.len() as u32, DOMAIN_SIZE, Access::ReadWrite)),
            0x2011 if sub_index == 0 => return Ok(stream(0, 0, Access::ReadOnly)),
            0x2000..=0x2002 => {}
            _ => return Err(Abort::NO_OBJECT),
        }
        let value = self.values.get(&(index, sub_index)).ok_or(Abort::NO_SUB_INDEX)?;
        let access = match index {
            0x2001 => Access::ReadOnly,
            0x2002 => Access::WriteOnly,
            _ => Access::ReadWrite,
        };
        let mappable = Mappable { receive: index == 0x2000, transmit: index <= 0x2001 };
        Ok(Entry { length: Length::Value(value.len() as u8), access, mappable })
    }

    fn read(&mut self, index: u16, sub_index: u8, offset: u32, out: &mut [u8]) -> Result<(), Abort> {
        let all = if index == 0x2010 { &self.domain } else { &self.values[&(index, sub_index)] };
        // The server never asks for more than there is.
        out.copy_from_slice(&all[offset as usize..][..out.len()]);
        Ok(())
    }

    fn write(&mut self, index: u16, sub_index: u8, value: &[u8]) -> Result<(), Abort> {
        let place = self.values.get_mut(&(index, sub_index)).unwrap();
        assert_eq!(place.len(), value.len(), "a value is written whole");
        *place = value.to_vec();
        self.writes.push((index, sub_index, value.to_vec()));
        Ok(())
    }

    fn open(&mut self, index: u16, _sub_index: u8, length: Option<u32>) -> Result<(), Abort> {
        assert!(index == 0x2010 && self.staging.is_none() && length.is_none_or(|length| length <= DOMAIN_SIZE));
        self.opened += 1;
        self.staging = Some(Vec::new());
        Ok(())
    }

    fn append(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Abort> {
        let staging = self.staging.as_mut().unwrap();
        assert_eq!(staging.len() as u32, offset);
        staging.extend(bytes);
        assert!(staging.len() as u32 <= DOMAIN_SIZE);
        Ok(())
    }

    fn finish(&mut self) -> Result<(), Abort> {
        if let Some(abort) = self.refusal {
            return Err(abort);
        }
        self.domain = self.staging.take().unwrap();
        self.closed += 1;
        Ok(())
    }

    fn abandon(&mut self) {
        self.staging.take().unwrap();
        self.closed += 1;
    }

    fn store(&mut self, group: Group, communication: &CommunicationParameters) -> Result<(), Abort> {
        self.stored = Some((group, *communication));
        Ok(())
    }

    fn has_changed(&mut self) -> bool {
        std::mem::take(&mut self.changed)
    }

    fn may_change_node_id(&self) -> bool {
        !self.keeps_node_id
    }

    fn restore(&mut self, group: Group) -> Result<(), Abort> {
        self.restored = Some(group);
        Ok(())
    }

    fn store_node_id(&mut self, node_id: u8) -> Result<(), Abort> {
        self.refuses_node_id.map_or(Ok(()), Err)?;
        self.stored_node_id = Some(node_id);
        Ok(())
    }

    fn communication_parameters(&self, node_id: u8) -> CommunicationParameters {
        self.parameters.unwrap_or_else(|| {
            let mut parameters = CommunicationParameters::predefined(node_id);
            let id = u16::from(node_id);
            parameters.receive[0] = PdoParameters::new(0x200 + id, &[U16, U32]);
            parameters.receive[1] = PdoParameters { transmission: 0, ..PdoParameters::new(0x300 + id, &[U64]) };
            parameters.transmit[0] = PdoParameters { transmission: 1, ..PdoParameters::new(0x180 + id, &[U16, U32]) };
            parameters
        })
    }

    fn event(&mut self, event: Event) {
        self.events.push(event);
        if let (Event::Reset(_), Some(shared)) = (event, self.interrupted.take()) {
            shared.request_reset(Reset::Node);
        }
    }
}

pub const U8: MappedObject = MappedObject::new(0x2000, 1, 8);
pub const U16: MappedObject = MappedObject::new(0x2000, 2, 16);
pub const U32: MappedObject = MappedObject::new(0x2000, 3, 32);
pub const U64: MappedObject = MappedObject::new(0x2000, 4, 64);

/// Set-points by object, valid only since the last change of state.
#[derive(Default)]
pub struct Image {
    pub set_points: BTreeMap<u32, u64>,
    pub received: Vec<u8>,
    pub states: Vec<NmtState>,
    pub syncs: u32,
    /// Added to every actual value.
    pub actual: u64,
}

impl ProcessImage for Image {
    fn receive(&mut self, object: MappedObject, value: u64) {
        self.set_points.insert(object.0, value);
    }

    fn received(&mut self, pdo: u8) {
        self.received.push(pdo);
    }

    fn transmit(&mut self, object: MappedObject) -> u64 {
        // More bits than any object has.
        (0xA5A5_A5A5_0000_0000 | u64::from(object.0)).wrapping_add(self.actual)
    }

    fn sync(&mut self) {
        self.syncs += 1;
    }

    fn state_changed(&mut self, state: NmtState) {
        self.set_points.clear();
        self.states.push(state);
    }
}

/// A node with both of its contexts and the queue between them.
pub struct Node {
    pub shared: &'static Shared,
    pub receiver: Receiver<'static>,
    pub server: Server<'static>,
    pub dictionary: Dictionary,
    pub image: Image,
    pub queue: VecDeque<Frame>,
    pub now: u32,
}

impl Node {
    /// Powered on, nothing polled yet.
    pub fn powered(node_id: u8) -> Self {
        let shared: &Shared = Box::leak(Box::new(Shared::new()));
        let server = Server::new(shared, &IDENTITY, SdoSettings::default(), node_id);
        Self {
            shared,
            receiver: Receiver::new(shared),
            server,
            dictionary: Dictionary::new(),
            image: Image::default(),
            queue: VecDeque::new(),
            // The clock wraps around within every test that takes a second.
            now: u32::MAX - 500_000,
        }
    }

    /// Node in PRE-OPERATIONAL, boot-up message sent.
    pub fn booted() -> Self {
        let mut node = Self::powered(NODE);
        assert_eq!(node.task(), [frame(0x700 + u16::from(NODE), &[0])]);
        node
    }

    pub fn operational() -> Self {
        let mut node = Self::booted();
        node.bus(0, &[1, NODE]);
        assert_eq!(node.task(), []);
        node
    }

    /// The receive interrupt alone: the frames that it sends.
    pub fn interrupt(&mut self, frame: &Frame) -> Vec<Frame> {
        let mut sent = Vec::new();
        match self.receiver.receive(frame, self.now, &mut self.image, |frame| sent.push(frame)) {
            Route::Server => self.queue.push_back(*frame),
            Route::Done => {}
        }
        sent
    }

    /// SYNC, as soon after the one before as it counts: the frames that the interrupt sends.
    pub fn sync(&mut self) -> Vec<Frame> {
        self.now = self.now.wrapping_add(SHORTEST_SYNC);
        self.interrupt(&frame(0x80, &[]))
    }

    /// The task, until it has nothing to do: the frames that it sends.
    pub fn task(&mut self) -> Vec<Frame> {
        let mut sent = Vec::new();
        loop {
            if let Some(frame) = self.queue.pop_front() {
                sent.extend(self.server.receive(&frame, self.now, &mut self.dictionary));
            } else if let Some(frame) = self.server.poll(self.now, &mut self.dictionary) {
                sent.push(frame);
            } else {
                return sent;
            }
        }
    }

    /// A frame from the bus, and everything that comes of it.
    pub fn bus(&mut self, id: u16, data: &[u8]) -> Vec<Frame> {
        let mut sent = self.interrupt(&frame(id, data));
        sent.extend(self.task());
        sent
    }

    /// Frames that the task sends within so many milliseconds, polled each of them.
    pub fn run(&mut self, milliseconds: u32) -> Vec<Frame> {
        let mut sent = Vec::new();
        for _ in 0..milliseconds {
            self.now = self.now.wrapping_add(1_000);
            sent.extend(self.task());
        }
        sent
    }

    /// One SDO request and its answers.
    pub fn sdo(&mut self, request: [u8; 8]) -> Vec<[u8; 8]> {
        let answers = self.bus(SDO_RECEIVE + u16::from(NODE), &request);
        answers
            .iter()
            .filter(|frame| frame.id() == SDO_TRANSMIT + u16::from(NODE))
            .map(|frame| *frame.eight().unwrap())
            .collect()
    }

    /// Expedited write; the abort code on refusal.
    pub fn write(&mut self, index: u16, sub_index: u8, value: &[u8]) -> Result<(), u32> {
        client::download(self, index, sub_index, value)
    }

    /// A number, however it is transferred.
    pub fn read(&mut self, index: u16, sub_index: u8) -> Result<u64, u32> {
        let value = client::upload(self, index, sub_index)?;
        let mut bytes = [0; 8];
        bytes[..value.len()].copy_from_slice(&value);
        Ok(u64::from_le_bytes(bytes))
    }
}

pub fn frame(id: u16, data: &[u8]) -> Frame {
    Frame::new(id, data).unwrap()
}

/// `length` bytes in which neighbours differ, and the seventh of them, too.
pub fn pattern(length: usize) -> Vec<u8> {
    (0..length as u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 13) as u8).collect()
}
