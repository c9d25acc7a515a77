//! State that the receive interrupt and the task share: NMT state, PDO parameters, what was heard; atomics, any
//! context.
//!
//! Nobody waits for anybody here, and nothing needs a lock:
//!
//!  - The interrupt is never interrupted by the task, so what it reads cannot change while it runs, and its NMT
//!    commands are final. The task changes the NMT state by compare-and-exchange, and a command that came in between
//!    wins.
//!  - The task alone writes parameters. A PDO's mapping, inhibit time and identifier change only while the PDO does not
//!    exist (bit 31 of its COB-ID), which is CiA 301's own procedure; the COB-ID is written last (release) and read
//!    first (acquire).

use super::frame::Frame;
use super::nmt::{NmtState, Reset};
use super::parameters::{CONSUMERS, INVALID, MAPPED, PDOS, PdoParameters};
use super::pdo::MappedObject;
use super::{COUNTER_AND_DATE, HEARTBEAT};
use core::sync::atomic::{AtomicBool, AtomicU8, AtomicU16, AtomicU32, Ordering};

/// "Not configured": the node is silent but for LSS.
pub const NO_NODE_ID: u8 = 0xFF;

const NO_RESET: u8 = 0;
const RESET_COMMUNICATION: u8 = 1;
const RESET_NODE: u8 = 2;

/// The shared part of one node. Belongs into a static; [`super::Receiver`] and [`super::Server`] borrow it, one of
/// each.
#[derive(Debug)]
pub struct Shared {
    node_id: AtomicU8,
    /// NMT state in bits 0 to 7; above them a count of transitions, so that leaving a state and coming back is seen.
    state: AtomicU32,
    /// Newest reset; that there was one, the count of transitions says.
    reset: AtomicU8,
    sync_cob_id: AtomicU16,
    sync_overflow: AtomicU8,
    pub(super) receive: [PdoRegisters; PDOS],
    pub(super) transmit: [PdoRegisters; PDOS],
    pub(super) consumers: [ConsumerRegisters; CONSUMERS],
    /// A bit for every TPDO whose application event has not been sent yet.
    events: AtomicU8,
    /// RPDOs that came too short (bits 0 to 3) or too long (bits 4 to 7).
    length_errors: AtomicU8,
    /// A SYNC was not as long as it should be.
    sync_length_error: AtomicBool,
}

/// An NMT state and how many transitions came before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Epoch(u32);

impl Epoch {
    pub(super) const fn state(self) -> NmtState {
        NmtState::from_byte(self.0 as u8)
    }

    const fn next(self, state: NmtState) -> Self {
        Self((self.0 & !0xFF).wrapping_add(0x100) | state as u32)
    }
}

impl Shared {
    /// State without a node id, initialising.
    #[allow(clippy::new_without_default, reason = "it belongs into a static")]
    pub const fn new() -> Self {
        Self {
            node_id: AtomicU8::new(NO_NODE_ID),
            state: AtomicU32::new(NmtState::Initialising as u32),
            reset: AtomicU8::new(NO_RESET),
            sync_cob_id: AtomicU16::new(0x80),
            sync_overflow: AtomicU8::new(0),
            receive: [const { PdoRegisters::new() }; PDOS],
            transmit: [const { PdoRegisters::new() }; PDOS],
            consumers: [const { ConsumerRegisters::new() }; CONSUMERS],
            events: AtomicU8::new(0),
            length_errors: AtomicU8::new(0),
            sync_length_error: AtomicBool::new(false),
        }
    }

    /// NMT state. Set-points that came by PDO count only while this is OPERATIONAL.
    pub fn state(&self) -> NmtState {
        self.epoch().state()
    }

    /// Node id in use, 1 to 127; [`NO_NODE_ID`] where there is none.
    pub fn node_id(&self) -> u8 {
        self.node_id.load(Ordering::Relaxed)
    }

    /// The application's event of TPDO `pdo`, 0 to 3: it is sent as soon as its inhibit time (types 254 and 255) or
    /// the next SYNC (type 0) allows. Any context.
    pub fn trigger(&self, pdo: u8) {
        self.events.fetch_or(bit(pdo), Ordering::Relaxed);
    }

    /// Returns `true` if a frame of this node makes the one before it with the same identifier worthless: TPDOs, and
    /// heartbeats but for the boot-up message. Any context.
    pub fn is_renewable(&self, frame: &Frame) -> bool {
        let heartbeat = HEARTBEAT | u16::from(self.node_id());
        match frame.id() {
            id if id == heartbeat => frame.data() != [NmtState::Initialising as u8],
            id => self.transmit.iter().any(|registers| registers.id() == Some(id)),
        }
    }

    pub(super) fn epoch(&self) -> Epoch {
        Epoch(self.state.load(Ordering::Acquire))
    }

    /// The interrupt's transition; only there, as the task must not come between.
    pub(super) fn enter(&self, state: NmtState) {
        let epoch = self.epoch();
        if epoch.state() == state {
            return;
        }
        self.announce(state);
        self.state.store(epoch.next(state).0, Ordering::Release);
    }

    /// The task's transition out of `from`; false where an NMT command was faster.
    pub(super) fn leave(&self, from: Epoch, state: NmtState) -> bool {
        self.announce(state);
        self.state.compare_exchange(from.0, from.next(state).0, Ordering::AcqRel, Ordering::Acquire).is_ok()
    }

    /// Every TPDO is sent once when the node becomes operational.
    fn announce(&self, state: NmtState) {
        if state == NmtState::Operational {
            self.events.store(u8::MAX, Ordering::Relaxed);
        }
    }

    /// Initialising from here on; the task does the rest. Interrupt.
    pub(super) fn request_reset(&self, reset: Reset) {
        self.reset.store(
            match reset {
                Reset::Communication => RESET_COMMUNICATION,
                Reset::Node => RESET_NODE,
            },
            Ordering::Relaxed,
        );
        self.state.store(self.epoch().next(NmtState::Initialising).0, Ordering::Release);
    }

    /// Power-on: initialising, although nobody asked for it. Before the interrupt is enabled.
    pub(super) fn power_on(&self) {
        self.set_node_id(NO_NODE_ID);
        self.reset.store(NO_RESET, Ordering::Relaxed);
        self.state.store(self.epoch().next(NmtState::Initialising).0, Ordering::Release);
    }

    /// The newest reset; none at power-on.
    pub(super) fn reset(&self) -> Option<Reset> {
        match self.reset.load(Ordering::Relaxed) {
            RESET_COMMUNICATION => Some(Reset::Communication),
            RESET_NODE => Some(Reset::Node),
            _ => None,
        }
    }

    pub(super) fn set_node_id(&self, node_id: u8) {
        self.node_id.store(node_id, Ordering::Relaxed);
    }

    pub(super) fn sync_cob_id(&self) -> u16 {
        self.sync_cob_id.load(Ordering::Relaxed)
    }

    pub(super) fn set_sync_cob_id(&self, cob_id: u16) {
        self.sync_cob_id.store(cob_id, Ordering::Relaxed);
    }

    /// 1019h; 0 where SYNC has no counter.
    pub(super) fn sync_overflow(&self) -> u8 {
        if COUNTER_AND_DATE { self.sync_overflow.load(Ordering::Relaxed) } else { 0 }
    }

    pub(super) fn set_sync_overflow(&self, overflow: u8) {
        self.sync_overflow.store(overflow, Ordering::Relaxed);
    }

    /// Returns `true` if TPDO `pdo` has an event to send; forgets it.
    pub(super) fn take_event(&self, pdo: u8) -> bool {
        self.events.fetch_and(!bit(pdo), Ordering::Relaxed) & bit(pdo) != 0
    }

    pub(super) fn has_event(&self, pdo: u8) -> bool {
        self.events.load(Ordering::Relaxed) & bit(pdo) != 0
    }

    pub(super) fn note_length_error(&self, pdo: u8, long: bool) {
        let noted = if long { bit(pdo) << 4 } else { bit(pdo) & 0xF };
        self.length_errors.fetch_or(noted, Ordering::Relaxed);
    }

    pub(super) fn note_sync_length_error(&self) {
        self.sync_length_error.store(true, Ordering::Relaxed);
    }

    /// True where a SYNC was not as long as it should be since the last time.
    pub(super) fn take_sync_length_error(&self) -> bool {
        let had = self.sync_length_error.load(Ordering::Relaxed);
        self.sync_length_error.store(false, Ordering::Relaxed);
        had
    }

    /// RPDOs that came too short and too long since the last time, a bit for each.
    pub(super) fn take_length_errors(&self) -> (u8, u8) {
        if self.length_errors.load(Ordering::Relaxed) == 0 {
            return (0, 0);
        }
        let noted = self.length_errors.swap(0, Ordering::Relaxed);
        (noted & 0xF, noted >> 4)
    }
}

/// The bit of PDO 0 to 7.
const fn bit(pdo: u8) -> u8 {
    1 << (pdo & 7)
}

/// Parameters of one PDO, and when an RPDO came last.
#[derive(Debug)]
pub(super) struct PdoRegisters {
    cob_id: AtomicU32,
    transmission: AtomicU8,
    inhibit: AtomicU16,
    event_timer: AtomicU16,
    sync_start: AtomicU8,
    count: AtomicU8,
    mapping: [AtomicU32; MAPPED],
    /// Changes whenever the PDO comes into being: data that waits for SYNC belongs to the mapping it came with.
    generation: AtomicU8,
    received: Instant,
}

impl PdoRegisters {
    const fn new() -> Self {
        Self {
            cob_id: AtomicU32::new(INVALID),
            transmission: AtomicU8::new(255),
            inhibit: AtomicU16::new(0),
            event_timer: AtomicU16::new(0),
            sync_start: AtomicU8::new(0),
            count: AtomicU8::new(0),
            mapping: [const { AtomicU32::new(0) }; MAPPED],
            generation: AtomicU8::new(0),
            received: Instant::new(),
        }
    }

    /// Sub-index 1 of the communication parameter; read it before anything else that counts.
    pub(super) fn cob_id(&self) -> u32 {
        self.cob_id.load(Ordering::Acquire)
    }

    /// Identifier; none while the PDO does not exist.
    pub(super) fn id(&self) -> Option<u16> {
        let cob_id = self.cob_id();
        (cob_id & INVALID == 0).then_some((cob_id & 0x7FF) as u16)
    }

    pub(super) fn transmission(&self) -> u8 {
        self.transmission.load(Ordering::Relaxed)
    }

    pub(super) fn inhibit(&self) -> u16 {
        self.inhibit.load(Ordering::Relaxed)
    }

    pub(super) fn event_timer(&self) -> u16 {
        self.event_timer.load(Ordering::Relaxed)
    }

    pub(super) fn sync_start(&self) -> u8 {
        self.sync_start.load(Ordering::Relaxed)
    }

    pub(super) fn count(&self) -> u8 {
        self.count.load(Ordering::Relaxed)
    }

    pub(super) fn generation(&self) -> u8 {
        self.generation.load(Ordering::Relaxed)
    }

    /// Mapping entry 0 to 7.
    pub(super) fn mapped(&self, entry: u8) -> Option<MappedObject> {
        self.mapping.get(usize::from(entry)).map(|object| MappedObject(object.load(Ordering::Relaxed)))
    }

    /// The objects that the PDO carries now.
    pub(super) fn mapping(&self) -> impl Iterator<Item = MappedObject> {
        self.mapping.iter().take(self.count().into()).map(|object| MappedObject(object.load(Ordering::Relaxed)))
    }

    pub(super) fn set_cob_id(&self, cob_id: u32) {
        if cob_id & INVALID == 0 && self.cob_id() & INVALID != 0 {
            self.generation.store(self.generation().wrapping_add(1), Ordering::Relaxed);
            self.received.forget();
        }
        self.cob_id.store(cob_id, Ordering::Release);
    }

    pub(super) fn set_transmission(&self, transmission: u8) {
        self.transmission.store(transmission, Ordering::Relaxed);
    }

    pub(super) fn set_inhibit(&self, inhibit: u16) {
        self.inhibit.store(inhibit, Ordering::Relaxed);
    }

    pub(super) fn set_event_timer(&self, event_timer: u16) {
        self.event_timer.store(event_timer, Ordering::Relaxed);
    }

    pub(super) fn set_sync_start(&self, counter: u8) {
        self.sync_start.store(counter, Ordering::Relaxed);
    }

    pub(super) fn set_count(&self, count: u8) {
        self.count.store(count, Ordering::Relaxed);
    }

    pub(super) fn set_mapped(&self, entry: u8, object: MappedObject) {
        if let Some(place) = self.mapping.get(usize::from(entry)) {
            place.store(object.0, Ordering::Relaxed);
        }
    }

    /// Time at which the PDO came last.
    pub(super) fn received(&self) -> &Instant {
        &self.received
    }

    pub(super) fn load(&self, parameters: &PdoParameters) {
        self.set_cob_id(INVALID);
        self.set_transmission(parameters.transmission);
        self.set_inhibit(parameters.inhibit);
        self.set_event_timer(parameters.event_timer);
        if COUNTER_AND_DATE {
            self.set_sync_start(parameters.sync_start);
        }
        self.set_count(parameters.count);
        for (place, object) in self.mapping.iter().zip(parameters.mapping) {
            place.store(object.0, Ordering::Relaxed);
        }
        self.set_cob_id(parameters.cob_id);
    }

    pub(super) fn parameters(&self) -> PdoParameters {
        let mut mapping = [MappedObject(0); MAPPED];
        for (object, place) in mapping.iter_mut().zip(&self.mapping) {
            object.0 = place.load(Ordering::Relaxed);
        }
        PdoParameters {
            cob_id: self.cob_id(),
            transmission: self.transmission(),
            inhibit: self.inhibit(),
            event_timer: self.event_timer(),
            sync_start: if COUNTER_AND_DATE { self.sync_start() } else { 0 },
            count: self.count(),
            mapping,
        }
    }
}

/// An instant that the interrupt notes and the task looks at, microseconds.
#[derive(Debug)]
pub(super) struct Instant {
    at: AtomicU32,
    noted: AtomicBool,
}

impl Instant {
    const fn new() -> Self {
        Self { at: AtomicU32::new(0), noted: AtomicBool::new(false) }
    }

    pub(super) fn note(&self, now: u32) {
        self.at.store(now, Ordering::Relaxed);
        self.noted.store(true, Ordering::Release);
    }

    /// None where nothing was noted since it was forgotten. An instant that is replaced meanwhile is as good as the
    /// new one.
    pub(super) fn get(&self) -> Option<u32> {
        self.noted.load(Ordering::Acquire).then(|| self.at.load(Ordering::Relaxed))
    }

    pub(super) fn forget(&self) {
        self.noted.store(false, Ordering::Relaxed);
    }
}

/// One sub-index of object 1016h, and when that node was heard last.
#[derive(Debug)]
pub(super) struct ConsumerRegisters {
    setting: AtomicU32,
    heard: Instant,
}

impl ConsumerRegisters {
    const fn new() -> Self {
        Self { setting: AtomicU32::new(0), heard: Instant::new() }
    }

    /// Value in the format of object 1016h.
    pub(super) fn setting(&self) -> u32 {
        self.setting.load(Ordering::Relaxed)
    }

    /// Monitoring starts anew with the next heartbeat.
    pub(super) fn set(&self, setting: u32) {
        self.heard.forget();
        self.setting.store(setting, Ordering::Relaxed);
    }

    /// Monitored node; none where nothing is monitored.
    pub(super) fn node(&self) -> Option<u8> {
        let setting = self.setting();
        (setting & 0xFFFF != 0).then_some((setting >> 16 & 0x7F) as u8).filter(|node| *node != 0)
    }

    /// Time after which the node counts as lost, ms.
    pub(super) fn limit(&self) -> u16 {
        self.setting() as u16
    }

    pub(super) fn heard(&self) -> &Instant {
        &self.heard
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_between_the_tasks_look_and_its_transition_wins() {
        let shared = Shared::new();
        let seen = shared.epoch();
        shared.enter(NmtState::Operational);
        shared.enter(NmtState::Stopped);
        assert!(!shared.leave(seen, NmtState::PreOperational));
        assert_eq!(shared.state(), NmtState::Stopped);
    }

    #[test]
    fn leaving_a_state_and_coming_back_is_seen() {
        let shared = Shared::new();
        shared.enter(NmtState::Operational);
        let before = shared.epoch();
        shared.enter(NmtState::Operational);
        assert_eq!(shared.epoch(), before);
        shared.enter(NmtState::Stopped);
        shared.enter(NmtState::Operational);
        assert_ne!(shared.epoch(), before);
        assert_eq!(shared.epoch().state(), NmtState::Operational);
    }

    #[test]
    fn an_event_is_taken_once() {
        let shared = Shared::new();
        shared.trigger(2);
        assert!(!shared.take_event(1) && shared.has_event(2) && shared.take_event(2) && !shared.take_event(2));
    }
}
