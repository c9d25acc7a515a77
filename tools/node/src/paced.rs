//! Several nodes on one modelled wire, in simulated time: bits, arbitration and control steps to the nanosecond, as
//! fast as the machine can.
//!
//! Assumptions about the board, because no board has been measured: the receive interrupt has done its work
//! [`REACTION`] after a frame's last bit, the task gets to a request [`TASK`] later, and the controller has three
//! transmit buffers that it empties by identifier (the STM32G4's FDCAN).

use crate::virtual_node::VirtualNode;
use bus::Frame;
use bus::pacing::{Delivery, Order, PacedBus, Station};
use canopen_node::Buffers;
use std::collections::VecDeque;
use std::time::Duration;

/// Time from the last bit of a frame until the receive interrupt is over; it waits for a control step at most.
pub const REACTION: Duration = Duration::from_micros(20);
/// Time from there until the task has answered a request.
pub const TASK: Duration = Duration::from_micros(50);
/// Transmit buffers of a controller.
const BUFFERS: usize = 3;

/// Event that has just happened.
#[derive(Clone, Debug)]
pub enum PacedEvent {
    /// A frame was received by all but its senders; the nodes see it after [`REACTION`].
    Delivered(Delivery),
    /// A node has done a control step.
    Stepped(usize),
}

#[derive(Debug)]
struct Member {
    node: VirtualNode,
    station: Station,
    next_step: Duration,
    period: Duration,
    /// Received, with the instant at which the interrupt has dealt with it.
    received: VecDeque<(Duration, Frame)>,
    task: Option<Duration>,
}

impl Member {
    fn next(&self) -> Duration {
        let interrupt = self.received.front().map(|(at, _)| *at);
        [interrupt, self.task].into_iter().flatten().fold(self.next_step, Duration::min)
    }
}

/// Nodes and their bus.
#[derive(Debug)]
pub struct PacedNodes {
    wire: PacedBus,
    members: Vec<Member>,
    now: Duration,
}

impl PacedNodes {
    /// An empty bus of `bitrate` bit/s.
    #[must_use]
    pub fn new(bitrate: u32) -> Self {
        Self { wire: PacedBus::new(bitrate), members: Vec::new(), now: Duration::ZERO }
    }

    /// A station that is no joint: a master, somebody else's traffic. Its frames go by identifier.
    pub fn add_station(&mut self) -> Station {
        self.wire.add_station(Order::Identifier)
    }

    /// A joint, whose first control step is `phase` from now; its number, from 0.
    pub fn add(&mut self, node: VirtualNode, phase: Duration) -> usize {
        let period = Duration::from_secs(1) / node.rate();
        let station = self.wire.add_station(Order::Identifier);
        let (next_step, received) = (self.now + phase, VecDeque::new());
        self.members.push(Member { node, station, next_step, period, received, task: None });
        self.members.len() - 1
    }

    /// Time since the bus began.
    #[must_use]
    pub fn now(&self) -> Duration {
        self.now
    }

    /// The wire, for its statistics.
    #[must_use]
    pub fn wire(&self) -> &PacedBus {
        &self.wire
    }

    /// Counts load and latencies from now on.
    pub fn reset_statistics(&mut self) {
        self.wire.reset_statistics(self.now);
    }

    /// Joints on the bus.
    #[must_use]
    pub fn len(&self) -> usize {
        self.members.len()
    }

    /// Returns `true` if there is no joint.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.members.is_empty()
    }

    /// Joint `number`, from 0; none where there is no such joint.
    #[must_use]
    pub fn node(&self, number: usize) -> Option<&VirtualNode> {
        self.members.get(number).map(|member| &member.node)
    }

    /// The same, to be changed.
    pub fn node_mut(&mut self, number: usize) -> Option<&mut VirtualNode> {
        self.members.get_mut(number).map(|member| &mut member.node)
    }

    /// A station hands a frame to its controller now.
    pub fn send(&mut self, station: Station, frame: Frame) {
        self.wire.send(station, frame, self.now);
    }

    /// The next event up to `until`; none where there is none any more, and then it is `until`.
    pub fn next(&mut self, until: Duration) -> Option<PacedEvent> {
        loop {
            self.feed();
            let wire = self.wire.next_change();
            let member = self.members.iter().map(Member::next).enumerate().min_by_key(|(_, at)| *at);
            match (wire, member) {
                (Some(at), other) if at <= until && other.is_none_or(|(_, other)| at <= other) => {
                    self.now = self.now.max(at);
                    if let Some(delivery) = self.wire.advance(at) {
                        self.deliver(&delivery);
                        return Some(PacedEvent::Delivered(delivery));
                    }
                }
                (_, Some((number, at))) if at <= until => {
                    self.now = self.now.max(at);
                    if self.run(number) {
                        return Some(PacedEvent::Stepped(number));
                    }
                }
                _ => {
                    self.now = self.now.max(until);
                    return None;
                }
            }
        }
    }

    /// Lets time pass.
    pub fn wait(&mut self, time: Duration) {
        let until = self.now + time;
        while self.next(until).is_some() {}
    }

    fn feed(&mut self) {
        for member in &mut self.members {
            loop {
                let buffers = Buffers { all: BUFFERS, occupied: self.wire.waiting(member.station) };
                let Some(frame) = member.node.take_frame_for(buffers) else { break };
                self.wire.send(member.station, frame, self.now);
            }
        }
    }

    fn deliver(&mut self, delivery: &Delivery) {
        for member in self.members.iter_mut().filter(|member| !delivery.senders.contains(&member.station)) {
            member.received.push_back((delivery.ended + REACTION, delivery.frame));
        }
    }

    /// Runs what is due at a node now; returns whether it was a control step.
    fn run(&mut self, number: usize) -> bool {
        let now = self.now;
        let Some(member) = self.members.get_mut(number) else { return false };
        if let Some((_, frame)) = member.received.pop_front_if(|(at, _)| *at <= now) {
            member.node.receive(&frame);
            if member.node.requests() > 0 {
                member.task.get_or_insert(now + TASK);
            }
            return false;
        }
        if member.task.take_if(|at| *at <= now).is_some() {
            member.node.work();
            return false;
        }
        member.node.advance(1);
        member.next_step += member.period;
        true
    }
}
