//! The part of the server that acts in the receive interrupt: NMT, SYNC, RPDOs, and hearing the heartbeats of others.
//!
//! One call for each received frame, in the order of reception. The work is bounded by the number of PDOs and mapped
//! objects. Only what is addressed to this node's SDO server or to LSS is left for the task, so that the queue between
//! the two holds nothing that other nodes say to each other, and nothing that has to be quick ever is in a queue.

use super::frame::Frame;
use super::nmt::{Command, NmtState};
use super::parameters::{PDOS, is_node_id};
use super::pdo::ProcessImage;
use super::pdo::receive::{self, Waiting};
use super::pdo::transmit::{Synchronous, assemble};
use super::shared::{Epoch, Shared};
use super::{LSS_MASTER, NMT, SDO_RECEIVE};

/// A SYNC sooner after one that counted does not count, us: at 1 Mbit/s a SYNC and a single full TPDO take 160 to 190.
/// Without this a bus full of nothing but SYNC, 20,000 a second, leaves tasks no time.
pub const SHORTEST_SYNC: u32 = 180;

/// Remaining work on a frame.
#[must_use = "a frame for the server has to be given to it"]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Route {
    /// No further step: the frame was dealt with, or it is not for this node.
    Done,
    /// Queue it for [`super::Server::receive`].
    Server,
}

/// The interrupt's part of a node.
#[derive(Debug)]
pub struct Receiver<'a> {
    shared: &'a Shared,
    /// The state that the process image knows about.
    known: Epoch,
    waiting: [Option<Waiting>; PDOS],
    synchronous: [Synchronous; PDOS],
    /// Time of the last SYNC that counted.
    synchronised: Option<u32>,
}

impl<'a> Receiver<'a> {
    /// One for each [`Shared`].
    pub fn new(shared: &'a Shared) -> Self {
        Self {
            shared,
            known: shared.epoch(),
            waiting: [None; PDOS],
            synchronous: [Synchronous::default(); PDOS],
            synchronised: None,
        }
    }

    /// Takes one frame, received at `now` (microseconds, wrapping). `send` gets up to four TPDOs, after SYNC only.
    /// Frames that the node itself sends must not come back here.
    pub fn receive(
        &mut self,
        frame: &Frame,
        now: u32,
        image: &mut impl ProcessImage,
        send: impl FnMut(Frame),
    ) -> Route {
        self.follow(image);
        let node_id = self.shared.node_id();
        match frame.id() {
            LSS_MASTER => return Route::Server,
            _ if !is_node_id(node_id) => return Route::Done,
            NMT => self.command(frame.data(), node_id, image),
            id if id == SDO_RECEIVE | u16::from(node_id) => {
                return if self.shared.state().communicates() { Route::Server } else { Route::Done };
            }
            id if id == self.shared.sync_cob_id() => {
                if self.is_sync(frame, now) {
                    let counts = self.shared.sync_overflow() != 0;
                    if frame.data().len() != usize::from(counts) {
                        self.shared.note_sync_length_error();
                    }
                    let counter = if let [counter] = frame.data() { *counter } else { 0 };
                    self.synchronise(now, counter, image, send);
                }
            }
            id @ 0x701..=0x77F => self.hear((id & 0x7F) as u8, frame.data(), now),
            id => self.take(id, frame.data(), now, image),
        }
        Route::Done
    }

    /// Returns `true` if a frame received at `now` is a SYNC that counts, so that [`Receiver::receive`] asks for what
    /// TPDOs carry.
    pub fn is_sync(&self, frame: &Frame, now: u32) -> bool {
        // Time wraps: of the SYNCs that come after an hour, one in 20 million is taken for one that came too soon.
        let soon = |before| now.wrapping_sub(before) < SHORTEST_SYNC;
        frame.id() == self.shared.sync_cob_id()
            && self.shared.state() == NmtState::Operational
            && !self.synchronised.is_some_and(soon)
    }

    /// NMT, at once: whatever comes in the next frame meets the new state.
    fn command(&mut self, data: &[u8], node_id: u8, image: &mut impl ProcessImage) {
        match Command::parse(data, node_id) {
            // Before its boot-up message a node knows no command but reset.
            Some(Command::Enter(_)) if self.shared.state() == NmtState::Initialising => {}
            Some(Command::Enter(state)) => self.shared.enter(state),
            Some(Command::Reset(reset)) => self.shared.request_reset(reset),
            None => {}
        }
        self.follow(image);
    }

    /// Invalidates everything that belongs to the state before, also where it was the task that changed it.
    fn follow(&mut self, image: &mut impl ProcessImage) {
        let epoch = self.shared.epoch();
        if epoch == self.known {
            return;
        }
        self.known = epoch;
        self.waiting = [None; PDOS];
        self.synchronous = [Synchronous::default(); PDOS];
        self.synchronised = None;
        for registers in &self.shared.receive {
            registers.received().forget();
        }
        image.state_changed(epoch.state());
    }

    /// `counter`: SYNC's, 0 where it has none.
    fn synchronise(&mut self, now: u32, counter: u8, image: &mut impl ProcessImage, mut send: impl FnMut(Frame)) {
        self.synchronised = Some(now);
        image.sync();
        for ((registers, synchronous), pdo) in self.shared.transmit.iter().zip(&mut self.synchronous).zip(0..) {
            if registers.id().is_some() {
                let frame = || assemble(registers, |object| Some(image.transmit(object)));
                synchronous.next(self.shared, registers, pdo, counter, frame).into_iter().for_each(&mut send);
            }
        }
        for ((registers, waiting), pdo) in self.shared.receive.iter().zip(&mut self.waiting).zip(0..) {
            if let Some(waiting) = waiting.take() {
                receive::synchronise(registers, pdo, waiting, image);
            }
        }
    }

    fn take(&mut self, id: u16, data: &[u8], now: u32, image: &mut impl ProcessImage) {
        if self.shared.state() != NmtState::Operational {
            return;
        }
        for ((registers, waiting), pdo) in self.shared.receive.iter().zip(&mut self.waiting).zip(0..) {
            if registers.id() == Some(id)
                && let Some(taken) = receive::take(self.shared, registers, pdo, data, now, image)
            {
                *waiting = Some(taken);
            }
        }
    }

    fn hear(&self, node: u8, data: &[u8], now: u32) {
        if data.is_empty() {
            return;
        }
        for consumer in self.shared.consumers.iter().filter(|consumer| consumer.node() == Some(node)) {
            consumer.heard().note(now);
        }
    }
}
