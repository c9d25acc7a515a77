//! A node with one object, a temperature, read over SDO: `cargo run -p canopen-node --example thermometer`.
//!
//! On a board [`Receiver::receive`] is called by the CAN receive interrupt and [`Server`] by a task. Here both are
//! called in a row, and the master's frames are written down.

use canopen_node::{
    Abort, Access, CommunicationParameters, Entry, Event, Frame, Group, Identity, Length, Mappable, MappedObject,
    NmtState, ObjectDictionary, ProcessImage, Receiver, Route, SdoSettings, Server, Shared,
};

const IDENTITY: Identity<'static> = Identity {
    device_type: 0,
    device_name: "thermometer",
    hardware_version: "1",
    software_version: "0.1.0",
    vendor: 0,
    product: 1,
    revision: 1,
    serial: 1,
};
const NODE_ID: u8 = 5;
/// Tenths of a degree Celsius, at 2000h:0.
const TEMPERATURE: u16 = 0x2000;

struct Objects {
    temperature: i16,
}

impl ObjectDictionary for Objects {
    fn entry(&self, index: u16, sub_index: u8) -> Result<Entry, Abort> {
        match (index, sub_index) {
            (TEMPERATURE, 0) => {
                let mappable = Mappable { receive: false, transmit: true };
                Ok(Entry { length: Length::Value(2), access: Access::ReadOnly, mappable })
            }
            (TEMPERATURE, _) => Err(Abort::NO_SUB_INDEX),
            _ => Err(Abort::NO_OBJECT),
        }
    }

    fn read(&mut self, _index: u16, _sub_index: u8, _offset: u32, out: &mut [u8]) -> Result<(), Abort> {
        out.iter_mut().zip(self.temperature.to_le_bytes()).for_each(|(place, byte)| *place = byte);
        Ok(())
    }

    fn write(&mut self, _index: u16, _sub_index: u8, _value: &[u8]) -> Result<(), Abort> {
        Err(Abort::READ_ONLY)
    }

    fn open(&mut self, _index: u16, _sub_index: u8, _length: Option<u32>) -> Result<(), Abort> {
        Err(Abort::NO_OBJECT)
    }

    fn append(&mut self, _offset: u32, _bytes: &[u8]) -> Result<(), Abort> {
        Err(Abort::NO_OBJECT)
    }

    fn finish(&mut self) -> Result<(), Abort> {
        Err(Abort::NO_OBJECT)
    }

    fn abandon(&mut self) {}

    fn store(&mut self, _group: Group, _communication: &CommunicationParameters) -> Result<(), Abort> {
        Err(Abort::NO_OBJECT)
    }

    fn restore(&mut self, _group: Group) -> Result<(), Abort> {
        Err(Abort::NO_OBJECT)
    }

    fn store_node_id(&mut self, _node_id: u8) -> Result<(), Abort> {
        Err(Abort::NO_OBJECT)
    }

    fn communication_parameters(&self, node_id: u8) -> CommunicationParameters {
        CommunicationParameters::predefined(node_id)
    }

    fn event(&mut self, event: Event) {
        println!("event: {event:?}");
    }
}

impl ProcessImage for Objects {
    fn receive(&mut self, _object: MappedObject, _value: u64) {}

    fn received(&mut self, _pdo: u8) {}

    fn transmit(&mut self, _object: MappedObject) -> u64 {
        u64::from(self.temperature as u16)
    }

    fn state_changed(&mut self, _state: NmtState) {}
}

fn main() {
    let shared = Shared::new();
    let mut objects = Objects { temperature: 215 };
    let mut image = Objects { temperature: 215 };
    let mut receiver = Receiver::new(&shared);
    let mut server = Server::new(&shared, &IDENTITY, SdoSettings::default(), NODE_ID);

    // In a task, until there is nothing to send: the boot-up message.
    while let Some(frame) = server.poll(0, &mut objects) {
        println!("{:03X} {:02X?}", frame.id(), frame.data());
    }

    // In the receive interrupt: NMT "start", then an SDO read of 2000h:0.
    let start = Frame::new(0x000, &[1, NODE_ID]);
    let read = Frame::new(0x600 + u16::from(NODE_ID), &[0x40, 0x00, 0x20, 0, 0, 0, 0, 0]);
    for (now, frame) in (1_000..).step_by(1_000).zip([start, read].into_iter().flatten()) {
        let route = receiver.receive(&frame, now, &mut image, |tpdo| println!("{:03X}", tpdo.id()));
        if route == Route::Server
            && let Some(answer) = server.receive(&frame, now, &mut objects)
        {
            println!("{:03X} {:02X?}", answer.id(), answer.data());
        }
        while server.poll(now, &mut objects).is_some() {}
    }
    println!("{:?}", shared.state());
}
