//! A master with one virtual joint on its bus, in simulated time; what each test does not use, another does.
#![allow(dead_code, reason = "shared by test programs")]

use bus::Frame;
use bus::client::sdo::{Failure, Method, Settings, Transfer};
use bus::client::{Command, Emergency, Object, Target};
use joint_firmware::joint::state_machine::State;
use node::{Options, SlotImages, Storage, VirtualNode};
use plant::ActuatorParameters;
use plant::virtual_joint::Setup;
use std::time::Duration;

pub const ID: u8 = 5;
/// Control steps in a millisecond.
pub const MILLISECOND: u64 = 20;

/// A master with one node on its bus.
pub struct Master {
    pub node: VirtualNode,
    /// Frames that the node sent beside SDO answers.
    pub heard: Vec<Frame>,
}

impl Master {
    pub fn new() -> Self {
        Self::with(SlotImages::empty().unwrap())
    }

    pub fn with(images: SlotImages) -> Self {
        Self::powered(Storage::with(images).unwrap())
    }

    /// Master after a loss of power that left this.
    pub fn powered(storage: Storage) -> Self {
        Self::built(ActuatorParameters::reference().aligned().without_payload(), storage)
    }

    /// Master of another actuator, with nothing stored.
    pub fn of(parameters: ActuatorParameters) -> Self {
        Self::built(parameters, Storage::with(SlotImages::empty().unwrap()).unwrap())
    }

    fn built(parameters: ActuatorParameters, storage: Storage) -> Self {
        let setup = Setup::of(&parameters);
        let options = Options { node_id: ID, serial: 12, seed: 1 };
        let node = VirtualNode::with_storage(parameters, &setup, &options, storage).unwrap();
        let mut master = Self { node, heard: vec![] };
        // The joint measures its current sensors' offsets.
        master.wait(200);
        master
    }

    pub fn listen(&mut self) {
        while let Some(frame) = self.node.take_frame() {
            self.heard.push(frame);
        }
    }

    pub fn wait(&mut self, milliseconds: u64) {
        self.node.advance(milliseconds * MILLISECOND);
        self.listen();
    }

    pub fn send(&mut self, id: u16, data: &[u8]) {
        self.node.receive(&Frame::new(id, data).unwrap());
        self.node.work();
        self.listen();
    }

    pub fn command(&mut self, command: Command) {
        self.node.receive(&command.frame(Target::Node(ID)));
        self.node.work();
        self.listen();
    }

    pub fn transfer(&mut self, mut transfer: Transfer) -> Result<Vec<u8>, Failure> {
        loop {
            let now = Duration::from_secs_f64(self.node.steps() as f64 / f64::from(self.node.rate()));
            while let Some(message) = transfer.poll(now) {
                self.node.receive(&Frame::new(0x600 + u16::from(ID), &message).unwrap());
            }
            self.node.work();
            self.listen();
            let (answers, rest) = self.heard.drain(..).partition(|frame| frame.id() == 0x580 + u16::from(ID));
            self.heard = rest;
            let answers: Vec<Frame> = answers;
            answers.iter().for_each(|frame| transfer.receive(frame.data(), now));
            if let Some(outcome) = transfer.outcome() {
                return outcome.clone();
            }
            if answers.is_empty() {
                self.wait(1);
            }
        }
    }

    pub fn upload(&mut self, index: u16, sub_index: u8) -> Vec<u8> {
        let object = Object { node: ID, index, sub_index };
        self.transfer(Transfer::upload(object, Method::Automatic, Settings::default())).unwrap()
    }

    pub fn number(&mut self, index: u16, sub_index: u8) -> i64 {
        let bytes = self.upload(index, sub_index);
        let mut eight = [0; 8];
        eight[..bytes.len()].copy_from_slice(&bytes);
        i64::from_le_bytes(eight)
    }

    pub fn download(&mut self, index: u16, sub_index: u8, data: &[u8]) -> Result<(), Failure> {
        let object = Object { node: ID, index, sub_index };
        self.transfer(Transfer::download(object, data, Method::Automatic, Settings::default())).map(|_| ())
    }

    pub fn image(&mut self, command: u8) -> Result<(), Failure> {
        self.download(0x2212, 1, &[command])
    }

    /// RPDO 2 every 10 ms: controlword, velocity mode, velocity in mrad/s.
    pub fn drive(&mut self, controlword: u16, velocity: i32, milliseconds: u64) {
        for _ in 0..milliseconds / 10 {
            self.velocity(controlword, velocity);
            self.wait(10);
        }
    }

    /// RPDO 2 once.
    pub fn velocity(&mut self, controlword: u16, velocity: i32) {
        let mut data = controlword.to_le_bytes().to_vec();
        data.push(9);
        data.extend(velocity.to_le_bytes());
        self.send(0x300 + u16::from(ID), &data);
    }

    pub fn enabled(&mut self) {
        self.command(Command::Start);
        for controlword in [6, 7, 15] {
            self.drive(controlword, 0, 10);
        }
        assert_eq!(self.state(), State::OperationEnabled);
    }

    pub fn state(&self) -> State {
        self.node.joint().joint().telemetry().state
    }

    pub fn emergencies(&self) -> Vec<u16> {
        self.heard.iter().filter_map(Emergency::decode).map(|emergency| emergency.code).collect()
    }
}
