//! A small CANopen node: the project's server with a dictionary of a few objects.

use bus::{Frame, Transport};
use canopen_node::{
    Abort, Access, CommunicationParameters, Entry, Event, Group, Identity, Length, Mappable, MappedObject, NmtState,
    ObjectDictionary, PdoParameters, ProcessImage, Receiver, Route, SdoSettings, Server, Shared,
};
use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Most bytes of the DOMAIN.
pub const DOMAIN: u32 = 2048;
/// 2000h:0, a number of 4 bytes.
pub const NUMBER: MappedObject = MappedObject::new(0x2000, 0, 32);

/// 2000h:0 a number of 4 bytes, 2001h:0 a DOMAIN that can be read and written, 2002h:0 a number that always says no.
#[derive(Default)]
pub struct Dictionary {
    pub number: [u8; 4],
    pub domain: Vec<u8>,
    staging: Vec<u8>,
    pub stored_node_id: Option<u8>,
    pub heartbeat: u16,
}

impl ObjectDictionary for Dictionary {
    fn entry(&self, index: u16, sub_index: u8) -> Result<Entry, Abort> {
        let length = match (index, sub_index) {
            (0x2000 | 0x2002, 0) => Length::Value(4),
            (0x2001, 0) => Length::Stream { readable: self.domain.len() as u32, writable: DOMAIN },
            (0x2000..=0x2002, _) => return Err(Abort::NO_SUB_INDEX),
            _ => return Err(Abort::NO_OBJECT),
        };
        let number = index == 0x2000;
        Ok(Entry { length, access: Access::ReadWrite, mappable: Mappable { receive: number, transmit: number } })
    }

    fn read(&mut self, index: u16, _sub_index: u8, offset: u32, out: &mut [u8]) -> Result<(), Abort> {
        let all = if index == 0x2001 { &self.domain[..] } else { &self.number[..] };
        out.copy_from_slice(&all[offset as usize..][..out.len()]);
        Ok(())
    }

    fn write(&mut self, index: u16, _sub_index: u8, value: &[u8]) -> Result<(), Abort> {
        if index == 0x2002 {
            return Err(Abort::DEVICE_STATE);
        }
        self.number = value.try_into().unwrap();
        Ok(())
    }

    fn open(&mut self, _index: u16, _sub_index: u8, _length: Option<u32>) -> Result<(), Abort> {
        self.staging.clear();
        Ok(())
    }

    fn append(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Abort> {
        assert_eq!(offset as usize, self.staging.len());
        self.staging.extend(bytes);
        Ok(())
    }

    fn finish(&mut self) -> Result<(), Abort> {
        self.domain = std::mem::take(&mut self.staging);
        Ok(())
    }

    fn abandon(&mut self) {
        self.staging.clear();
    }

    fn store(&mut self, _group: Group, _communication: &CommunicationParameters) -> Result<(), Abort> {
        Ok(())
    }

    fn restore(&mut self, _group: Group) -> Result<(), Abort> {
        Ok(())
    }

    fn store_node_id(&mut self, node_id: u8) -> Result<(), Abort> {
        self.stored_node_id = Some(node_id);
        Ok(())
    }

    fn communication_parameters(&self, node_id: u8) -> CommunicationParameters {
        let id = u16::from(node_id);
        let mut parameters = CommunicationParameters::predefined(node_id);
        parameters.heartbeat = self.heartbeat;
        parameters.receive[0] = PdoParameters::new(0x200 + id, &[NUMBER]);
        parameters.transmit[0] = PdoParameters { transmission: 1, ..PdoParameters::new(0x180 + id, &[NUMBER]) };
        parameters
    }

    fn event(&mut self, _event: Event) {}
}

/// Value that the last RPDO set; the TPDO tells it again.
#[derive(Default)]
struct Image(u64);

impl ProcessImage for Image {
    fn receive(&mut self, _object: MappedObject, value: u64) {
        self.0 = value;
    }

    fn received(&mut self, _pdo: u8) {}

    fn transmit(&mut self, _object: MappedObject) -> u64 {
        self.0
    }

    fn state_changed(&mut self, _state: NmtState) {
        self.0 = 0;
    }
}

/// Identity of the nodes; the serial number varies.
pub fn identity(serial: u32) -> Identity<'static> {
    Identity {
        device_type: 0x0002_0192,
        device_name: "test node",
        hardware_version: "-",
        software_version: "0",
        vendor: 0x0000_1234,
        product: 0xDEAD_BEEF,
        revision: 0x0001_0002,
        serial,
    }
}

/// Both contexts of a node.
pub struct Node {
    receiver: Receiver<'static>,
    server: Server<'static>,
    pub dictionary: Dictionary,
    image: Image,
}

impl Node {
    /// `id` 255: none yet.
    pub fn new(id: u8, serial: u32, heartbeat: u16) -> Self {
        let shared: &Shared = Box::leak(Box::new(Shared::new()));
        let identity = Box::leak(Box::new(identity(serial)));
        let server = Server::new(shared, identity, SdoSettings::default(), id);
        let dictionary = Dictionary { heartbeat, ..Dictionary::default() };
        Self { receiver: Receiver::new(shared), server, dictionary, image: Image::default() }
    }

    /// Frames that a frame makes the node send at once.
    pub fn receive(&mut self, frame: &Frame, now: Duration) -> Vec<Frame> {
        let now = now.as_micros() as u32;
        let mut sent = Vec::new();
        let route = self.receiver.receive(frame, now, &mut self.image, |frame| sent.push(frame));
        if route == Route::Server {
            sent.extend(self.server.receive(frame, now, &mut self.dictionary));
        }
        sent
    }

    /// The next frame that the node sends by itself.
    pub fn poll(&mut self, now: Duration) -> Option<Frame> {
        self.server.poll(now.as_micros() as u32, &mut self.dictionary)
    }

    /// Reports an error.
    pub fn emergency(&mut self, code: u16) {
        self.server.emergency(code, 1, [1, 2, 3, 4, 5]);
    }
}

/// A node that runs on a bus until it is dropped.
pub struct Running {
    over: Arc<AtomicBool>,
    emergency: Arc<AtomicBool>,
    thread: Option<JoinHandle<Node>>,
}

impl Running {
    pub fn new(bus: Arc<dyn Transport>, mut node: Node) -> Self {
        let [over, emergency] = [(); 2].map(|()| Arc::new(AtomicBool::new(false)));
        let (end, error) = (Arc::clone(&over), Arc::clone(&emergency));
        let thread = std::thread::spawn(move || {
            let began = Instant::now();
            let mut waiting = VecDeque::new();
            while !end.load(Ordering::Relaxed) {
                if error.swap(false, Ordering::Relaxed) {
                    node.emergency(0x5530);
                }
                while let Some(frame) = node.poll(began.elapsed()) {
                    bus.send(&frame).unwrap();
                }
                // A bus that is gone ends the node, too.
                let Ok(frame) = bus.receive(Duration::from_millis(1)) else { break };
                waiting.extend(frame.map(|frame| node.receive(&frame, began.elapsed())).unwrap_or_default());
                for frame in waiting.drain(..) {
                    bus.send(&frame).unwrap();
                }
            }
            node
        });
        Self { over, emergency, thread: Some(thread) }
    }

    /// The node reports an error.
    pub fn emergency(&self) {
        self.emergency.store(true, Ordering::Relaxed);
    }

    /// Ends the node, and gives it back.
    pub fn stop(mut self) -> Node {
        self.over.store(true, Ordering::Relaxed);
        self.thread.take().unwrap().join().unwrap()
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// `length` bytes in which neighbours differ, and the seventh of them, too.
pub fn pattern(length: usize) -> Vec<u8> {
    (0..length as u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 13) as u8).collect()
}
