//! Joints on a modelled wire and a master that drives them: SDO, NMT, set-points.

use bus::Frame;
use bus::client::sdo::{Failure, Method, Settings, Transfer};
use bus::client::{Emergency, Object};
use bus::pacing::{Delivery, Station};
use joint_firmware::joint::Telemetry;
use joint_firmware::joint::state_machine::State;
use node::{Options, PacedEvent, PacedNodes, SlotImages, VirtualNode};
use plant::ActuatorParameters;
use plant::virtual_joint::Setup;
use std::time::Duration;

pub const MILLISECOND: Duration = Duration::from_millis(1);
pub const US: Duration = Duration::from_micros(1);

/// Node id of the first joint; the others follow.
pub const FIRST: u8 = 1;

/// A bus at 1 Mbit/s.
pub struct Line {
    pub nodes: PacedNodes,
    pub master: Station,
    /// Frames that went over the wire, oldest first.
    pub heard: Vec<Delivery>,
    /// The master's set-points: controlword and velocity, mrad/s, of each joint.
    pub driven: Vec<Option<(u16, i32)>>,
    tick: Duration,
}

impl Line {
    /// `joints` joints with node ids from [`FIRST`] on, that have measured their current sensors' offsets.
    pub fn new(joints: u8) -> Self {
        let mut nodes = PacedNodes::new(1_000_000);
        let master = nodes.add_station();
        for number in 0..joints {
            let parameters = ActuatorParameters::reference().aligned().without_payload();
            let (id, number) = (FIRST + number, u32::from(number));
            let options = Options { node_id: id, serial: id.into(), seed: id.into() };
            let images = SlotImages::empty().unwrap();
            let node = VirtualNode::new(parameters, &Setup::of(&parameters), &options, images).unwrap();
            // Their clocks do not know each other.
            nodes.add(node, number * 50 * US / u32::from(joints));
        }
        let driven = vec![None; joints.into()];
        let mut line = Self { nodes, master, heard: vec![], driven, tick: Duration::ZERO };
        line.wait(200 * MILLISECOND);
        line
    }

    pub fn send(&mut self, id: u16, data: &[u8]) {
        self.nodes.send(self.master, Frame::new(id, data).unwrap());
    }

    /// Lets time pass; every 10 ms the joints that are driven get RPDO 2, and all of them a SYNC.
    pub fn wait(&mut self, time: Duration) {
        self.wait_for(time, |_, _| false);
    }

    /// The same until something has happened; whether it has.
    pub fn wait_for(&mut self, time: Duration, mut until: impl FnMut(&PacedNodes, &PacedEvent) -> bool) -> bool {
        let end = self.nodes.now() + time;
        while self.nodes.now() < end {
            while let Some(event) = self.nodes.next(self.tick.min(end)) {
                let over = until(&self.nodes, &event);
                if let PacedEvent::Delivered(delivery) = event {
                    self.heard.push(delivery);
                }
                if over {
                    return true;
                }
            }
            if self.nodes.now() >= self.tick {
                self.tick += 10 * MILLISECOND;
                self.drive();
            }
        }
        false
    }

    fn drive(&mut self) {
        for (id, driven) in (0x300 + u16::from(FIRST)..).zip(self.driven.clone()) {
            let Some((controlword, velocity)) = driven else { continue };
            let mut data = controlword.to_le_bytes().to_vec();
            data.push(9);
            data.extend(velocity.to_le_bytes());
            self.send(id, &data);
        }
        if self.driven.iter().any(Option::is_some) {
            self.send(0x080, &[]);
        }
    }

    /// Brings all joints to "operation enabled", in velocity mode at rest.
    pub fn enable(&mut self) {
        self.send(0, &[1, 0]);
        for controlword in [6, 7, 15] {
            self.driven.fill(Some((controlword, 0)));
            self.wait(30 * MILLISECOND);
        }
        for joint in 0..self.driven.len() {
            assert_eq!(self.telemetry(joint).state, State::OperationEnabled, "joint {joint}");
        }
    }

    pub fn telemetry(&self, joint: usize) -> Telemetry {
        self.nodes.node(joint).unwrap().joint().joint().telemetry()
    }

    /// Codes of the EMCYs that went over the wire.
    pub fn emergencies(&self) -> Vec<u16> {
        self.heard.iter().filter_map(|heard| Emergency::decode(&heard.frame)).map(|emergency| emergency.code).collect()
    }

    /// Runs a transfer; what came of it, and from its first bit to its last how long it took.
    pub fn transfer(&mut self, node: u8, mut transfer: Transfer) -> (Result<Vec<u8>, Failure>, Duration) {
        let (began, answer) = (self.nodes.now(), 0x580 + u16::from(node));
        loop {
            // A controller with room for three frames.
            while self.nodes.wire().waiting(self.master) < 3
                && let Some(message) = transfer.poll(self.nodes.now())
            {
                self.send(0x600 + u16::from(node), &message);
            }
            if let Some(outcome) = transfer.outcome() {
                return (outcome.clone(), self.nodes.now() - began);
            }
            let delivered = |_: &PacedNodes, event: &PacedEvent| matches!(event, PacedEvent::Delivered(_));
            if self.wait_for(MILLISECOND, delivered)
                && let Some(delivery) = self.heard.last().filter(|delivery| delivery.frame.id() == answer)
            {
                transfer.receive(delivery.frame.data(), delivery.ended);
            }
        }
    }

    pub fn write(&mut self, node: u8, index: u16, sub_index: u8, data: &[u8]) -> Duration {
        let object = Object { node, index, sub_index };
        let (outcome, time) =
            self.transfer(node, Transfer::download(object, data, Method::Automatic, Settings::default()));
        outcome.unwrap();
        time
    }

    pub fn number(&mut self, node: u8, index: u16, sub_index: u8) -> u64 {
        let object = Object { node, index, sub_index };
        let (outcome, _) = self.transfer(node, Transfer::upload(object, Method::Automatic, Settings::default()));
        let mut eight = [0; 8];
        let bytes = outcome.unwrap();
        eight[..bytes.len()].copy_from_slice(&bytes);
        u64::from_le_bytes(eight)
    }
}
