//! The part of the server that a task runs below the receive interrupt: SDO, LSS, heartbeat, EMCY, boot-up, timers.

use super::access::Objects;
use super::communication::Communication;
use super::dictionary::{Event, Identity, ObjectDictionary};
use super::emergency::{Emergencies, Lasting, code};
use super::frame::Frame;
use super::heartbeat::{Change, Consumers, Producer};
use super::lss::Lss;
use super::nmt::{NmtState, Reset};
use super::parameters::{CommunicationParameters, PDOS, is_node_id};
use super::pdo::MappedObject;
use super::pdo::transmit::{Timers, assemble};
use super::sdo::{SdoServer, SdoSettings};
use super::shared::{Epoch, NO_NODE_ID, Shared};
use super::time::{MILLISECOND, elapsed};
use super::{COUNTER_AND_DATE, HEARTBEAT, LSS_MASTER, LSS_SLAVE, SDO_RECEIVE, SDO_TRANSMIT};

/// The task's part of a node.
#[derive(Debug)]
pub struct Server<'a> {
    shared: &'a Shared,
    identity: &'a Identity<'a>,
    /// The state that this side has acted upon.
    known: Epoch,
    /// The reset that was dealt with last: each has a count of transitions of its own, so that none is lost that comes
    /// while another one is being dealt with.
    initialised: Option<Epoch>,
    /// The boot-up message is yet to be sent, and ends this state.
    booting: Option<Epoch>,
    sdo: SdoServer,
    lss: Lss,
    emergencies: Emergencies,
    producer: Producer,
    consumers: Consumers,
    error_behaviour: u8,
    /// 1020h.
    verification: [u32; 2],
    timers: [Timers; PDOS],
}

impl<'a> Server<'a> {
    /// One for each [`Shared`], before its receive interrupt is enabled. `node_id` is 1 to 127; any other means that
    /// there is none, and the node waits for LSS.
    pub fn new(shared: &'a Shared, identity: &'a Identity<'a>, settings: SdoSettings, node_id: u8) -> Self {
        let node_id = if is_node_id(node_id) { node_id } else { NO_NODE_ID };
        shared.power_on();
        Self {
            shared,
            identity,
            known: shared.epoch(),
            initialised: None,
            booting: None,
            sdo: SdoServer::new(settings),
            lss: Lss::new(node_id),
            emergencies: Emergencies::default(),
            producer: Producer::default(),
            consumers: Consumers::default(),
            error_behaviour: 0,
            verification: [0; 2],
            timers: [Timers::default(); PDOS],
        }
    }

    /// Takes a frame that [`super::Receiver::receive`] routed here; its answer, if it has one, is to be sent before
    /// the next call. Others are ignored. `now` in microseconds, wrapping.
    pub fn receive(&mut self, frame: &Frame, now: u32, dictionary: &mut impl ObjectDictionary) -> Option<Frame> {
        self.follow(dictionary);
        let request = frame.eight()?;
        let node_id = self.shared.node_id();
        if frame.id() == LSS_MASTER {
            let outcome = self.lss.receive(request, node_id, self.identity, dictionary);
            if outcome.start {
                // Only LSS reaches a node without a node id, so it has been initialising since the task looked.
                self.initialise(self.known, dictionary);
            }
            return Some(Frame::full(LSS_SLAVE, outcome.answer?));
        }
        let requested = is_node_id(node_id) && frame.id() == SDO_RECEIVE | u16::from(node_id);
        if !requested || !self.shared.state().communicates() {
            return None;
        }
        let (sdo, mut objects) = self.objects(dictionary);
        let answer = sdo.receive(request, now, &mut objects)?;
        Some(Frame::full(SDO_TRANSMIT | u16::from(node_id), answer))
    }

    /// Next frame to be sent, one at a time, most urgent first; call it until there is none, or until the sender's
    /// queue is full. At least every millisecond for timers to be exact to a millisecond, and never less than every
    /// half hour.
    pub fn poll(&mut self, now: u32, dictionary: &mut impl ObjectDictionary) -> Option<Frame> {
        let epoch = self.shared.epoch();
        if epoch.state() == NmtState::Initialising && self.initialised != Some(epoch) {
            self.restart(epoch, dictionary);
        }
        self.follow(dictionary);
        let node_id = self.shared.node_id();
        if !is_node_id(node_id) {
            return None;
        }
        if let Some(frame) = self.boot(node_id, now, dictionary) {
            return Some(frame);
        }
        let state = self.shared.state();
        if state == NmtState::Initialising {
            return None;
        }
        self.supervise(now, dictionary);
        // Supervision may have changed the state.
        let state_byte = self.shared.state() as u8;
        if self.producer.is_due(now) {
            return Some(Frame::cut(HEARTBEAT | u16::from(node_id), [state_byte, 0, 0, 0, 0, 0, 0, 0], 1));
        }
        if !self.shared.state().communicates() {
            return None;
        }
        if let Some(frame) = self.emergencies.poll(now) {
            return Some(frame);
        }
        if let Some(frame) = self.transmit(now, dictionary) {
            return Some(frame);
        }
        let (sdo, mut objects) = self.objects(dictionary);
        let message = sdo.poll(now, &mut objects)?;
        Some(Frame::full(SDO_TRANSMIT | u16::from(node_id), message))
    }

    /// Reports an error, or with code 0 the end of one. `register` are all bits of the error register (object 1001h)
    /// that the application wants set from now on, `information` is the manufacturer's field.
    pub fn emergency(&mut self, code: u16, register: u8, information: [u8; 5]) {
        self.emergencies.report(code, register, information);
    }

    /// The controller is back from bus-off: EMCY 8140h, and object 1029h decides about the NMT state.
    pub fn bus_off_recovered(&mut self, dictionary: &mut impl ObjectDictionary) {
        self.emergencies.report_once(code::BUS_OFF, 0);
        self.communication_error(dictionary);
    }

    /// Takes the error-passive state of the controller: EMCY 8120h when it begins, and its end.
    pub fn error_passive(&mut self, passive: bool) {
        if passive {
            self.emergencies.begin(Lasting::ErrorPassive, code::ERROR_PASSIVE, 0);
        } else {
            self.emergencies.end(Lasting::ErrorPassive);
        }
    }

    /// EMCYs that were dropped because more than eight waited.
    pub fn dropped_emergencies(&self) -> u32 {
        self.emergencies.dropped()
    }

    /// All communication parameters as they are now.
    pub fn parameters(&mut self, dictionary: &mut impl ObjectDictionary) -> CommunicationParameters {
        self.objects(dictionary).1.communication.parameters()
    }

    #[cfg(test)]
    pub(super) fn sdo_is_idle(&self) -> bool {
        self.sdo.is_idle()
    }

    fn objects<'s, D: ObjectDictionary>(
        &'s mut self,
        dictionary: &'s mut D,
    ) -> (&'s mut SdoServer, Objects<'s, 'a, D>) {
        let Self { shared, identity, sdo, emergencies, producer, error_behaviour, verification, .. } = self;
        if COUNTER_AND_DATE && dictionary.has_changed() {
            *verification = [0; 2];
        }
        let communication = Communication { shared, identity, emergencies, producer, error_behaviour, verification };
        (sdo, Objects { communication, dictionary })
    }

    /// Acts upon what the interrupt did to the NMT state.
    fn follow(&mut self, dictionary: &mut impl ObjectDictionary) {
        let epoch = self.shared.epoch();
        if epoch == self.known {
            return;
        }
        self.known = epoch;
        if !epoch.state().communicates() {
            self.sdo.cancel(dictionary);
        }
        self.emergencies.end(Lasting::SyncLength);
        for (pdo, timers) in (0..).zip(&mut self.timers) {
            timers.stop();
            self.emergencies.end(Lasting::Deadline(pdo));
        }
        dictionary.event(Event::State(epoch.state()));
    }

    fn restart(&mut self, epoch: Epoch, dictionary: &mut impl ObjectDictionary) {
        self.initialised = Some(epoch);
        self.sdo.cancel(dictionary);
        if let Some(reset) = self.shared.reset() {
            dictionary.event(Event::Reset(reset));
        }
        self.initialise(epoch, dictionary);
    }

    /// Power-on values, in the state "initialising"; in it the interrupt uses none of them.
    fn initialise(&mut self, epoch: Epoch, dictionary: &mut impl ObjectDictionary) {
        self.lss.restart();
        self.consumers.restart();
        let node_id = self.lss.pending();
        self.shared.set_node_id(node_id);
        if !is_node_id(node_id) {
            return;
        }
        let parameters = dictionary.communication_parameters(node_id);
        self.shared.set_sync_cob_id((parameters.sync_cob_id & 0x7FF) as u16);
        if COUNTER_AND_DATE {
            self.shared.set_sync_overflow(parameters.sync_overflow);
            // The application goes on with what it has: it is as stored only where nothing has changed.
            let goes_on = self.shared.reset() == Some(Reset::Communication);
            let same = self.verification == parameters.verification;
            self.verification = if goes_on && !same { [0; 2] } else { parameters.verification };
        }
        for (registers, pdo) in self.shared.receive.iter().zip(&parameters.receive) {
            registers.load(pdo);
        }
        for (registers, pdo) in self.shared.transmit.iter().zip(&parameters.transmit) {
            registers.load(pdo);
        }
        for (registers, setting) in self.shared.consumers.iter().zip(parameters.consumers) {
            registers.set(setting);
        }
        self.emergencies.restart(parameters.emergency_cob_id, parameters.emergency_inhibit);
        self.producer.set_period(parameters.heartbeat);
        self.error_behaviour = parameters.error_behaviour;
        self.booting = Some(epoch);
    }

    /// The boot-up message, whose data byte is 0, and with it PRE-OPERATIONAL.
    fn boot(&mut self, node_id: u8, now: u32, dictionary: &mut impl ObjectDictionary) -> Option<Frame> {
        let epoch = self.booting.take()?;
        if !self.shared.leave(epoch, NmtState::PreOperational) {
            // Another reset came in between; the next poll deals with it.
            return None;
        }
        self.follow(dictionary);
        self.producer.booted(now);
        Some(Frame::cut(HEARTBEAT | u16::from(node_id), [NmtState::Initialising as u8; 8], 1))
    }

    /// Heartbeats and RPDOs that stay away, RPDOs of the wrong length.
    fn supervise(&mut self, now: u32, dictionary: &mut impl ObjectDictionary) {
        // Each call changes one of finitely many places, so this ends.
        for _ in 0..super::parameters::CONSUMERS {
            match self.consumers.poll(self.shared, now) {
                None => break,
                Some(Change::Lost { consumer, node }) => {
                    self.emergencies.begin(Lasting::Heartbeat(consumer), code::HEARTBEAT, node);
                    dictionary.event(Event::HeartbeatLost { node });
                    self.communication_error(dictionary);
                }
                Some(Change::Back { consumer, node }) => {
                    self.emergencies.end(Lasting::Heartbeat(consumer));
                    dictionary.event(Event::HeartbeatBack { node });
                }
                Some(Change::Dismissed { consumer }) => self.emergencies.end(Lasting::Heartbeat(consumer)),
            }
        }
        if self.shared.take_sync_length_error() {
            self.emergencies.begin(Lasting::SyncLength, code::SYNC_LENGTH, 0);
        }
        let (short, long) = self.shared.take_length_errors();
        let operational = self.shared.state() == NmtState::Operational;
        for (pdo, registers) in (0u8..).zip(&self.shared.receive) {
            let number = pdo.saturating_add(1);
            if short >> (pdo & 7) & 1 != 0 {
                self.emergencies.report_once(code::PDO_SHORT, number);
            }
            if long >> (pdo & 7) & 1 != 0 {
                self.emergencies.report_once(code::PDO_LONG, number);
            }
            let limit = u32::from(registers.event_timer()).saturating_mul(MILLISECOND);
            let Some(received) = registers.received().get().filter(|_| operational) else { continue };
            if limit == 0 || registers.id().is_none() || elapsed(now, received) <= limit {
                self.emergencies.end(Lasting::Deadline(pdo));
            } else {
                // Watched again from the next one on.
                registers.received().forget();
                self.emergencies.begin(Lasting::Deadline(pdo), code::PDO_DEADLINE, number);
                dictionary.event(Event::RpdoDeadline { pdo });
            }
        }
    }

    /// Object 1029h:1. An NMT command that comes at the same time wins.
    fn communication_error(&mut self, dictionary: &mut impl ObjectDictionary) {
        let epoch = self.shared.epoch();
        let state = match (self.error_behaviour, epoch.state()) {
            (0, NmtState::Operational) => NmtState::PreOperational,
            (2, NmtState::Operational | NmtState::PreOperational) => NmtState::Stopped,
            _ => return,
        };
        self.shared.leave(epoch, state);
        self.follow(dictionary);
    }

    /// The next TPDO that is sent on a change, by event or by its timer.
    fn transmit(&mut self, now: u32, dictionary: &mut impl ObjectDictionary) -> Option<Frame> {
        if self.shared.state() != NmtState::Operational {
            return None;
        }
        let shared = self.shared;
        for ((registers, timers), pdo) in shared.transmit.iter().zip(&mut self.timers).zip(0..) {
            let frame = || assemble(registers, |object| value(object, dictionary));
            if let Some(frame) = timers.next(shared, registers, pdo, now, frame) {
                return Some(frame);
            }
        }
        None
    }
}

/// The value of a mapped object; none where it cannot be read now.
fn value(object: MappedObject, dictionary: &mut impl ObjectDictionary) -> Option<u64> {
    let mut bytes = [0; 8];
    let out = bytes.get_mut(..(object.bits() / 8) as usize)?;
    dictionary.read(object.index(), object.sub_index(), 0, out).ok()?;
    Some(u64::from_le_bytes(bytes))
}
