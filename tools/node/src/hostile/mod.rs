//! Server and object table without the joint, on a hostile bus: after each frame a judgement whether anything happened
//! that the protocol does not allow. For `examples/hostile_bus.rs` and the fuzz target; host.
//!
//! Judgements:
//!
//! - the NMT state changes with an NMT command to this node, and as that command says, or by the server's own two ways
//!   (boot-up, object 1029h)
//! - outside OPERATIONAL the joint is asked for a quick stop and nothing else; SDO, LSS, heartbeats and NMT commands
//!   that change no state set no set-point in the receive interrupt; every number of a command is finite
//! - what is configured is always something that the joint can be
//! - with a key, nothing is run or stored without a tag of that key or older than what was stored before, and
//!   nothing is stored that is not newer; the previous image comes back by a roll back only; the key stays
//! - nothing is written to flash under current
//! - the node sends with its own identifiers only, or with one that PDOs and EMCY may have

mod noise;
mod script;
mod watched;

pub use noise::Noise;
pub use script::{images, interpret};

use crate::storage::Storage;
use bus::Frame;
use canopen_node::{Identity, NO_NODE_ID, NmtState, Receiver, Route, SdoSettings, Server};
use friction_compensation::parameters::Summary;
use friction_compensation::parameters::authentication::{Key, STAGING, TAG};
use friction_compensation::parameters::guard::Guard;
use friction_compensation::parameters::image::{Image, Target};
use friction_compensation::parameters::life_cycle::{Action, LifeCycle};
use friction_compensation::parameters::slots::SlotError;
use joint_firmware::default_configuration::B_G431B_ESC1;
use joint_firmware::joint::configuration::Configuration;
use joint_firmware::joint::state_machine::{Controlword, State};
use joint_firmware::joint::{Command, Demand};
use joint_firmware::objects::{Images, JointImage, Objects, Observed, Ownership, STORES, Shared, Start};
use std::collections::VecDeque;
use watched::Watched;

/// Node id at the start.
pub const NODE: u8 = 5;
/// Frames that wait for the task.
const QUEUE: usize = 160;
const IDENTITY: Identity<'static> = Identity {
    device_type: 0x0002_0192,
    device_name: "hostile bus",
    hardware_version: "host",
    software_version: "0",
    vendor: 1,
    product: 2,
    revision: 3,
    serial: 4,
};

/// Violation of the protocol, and what led to it.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct Violation(String);

/// Fails with the text unless the condition holds.
macro_rules! hold {
    ($condition:expr, $($text:tt)*) => {
        if !$condition {
            return Err(Violation(format!($($text)*)));
        }
    };
}

/// Counts of what has happened, so that a run can show that it went deep.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Frames that the node sent.
    pub sent: u64,
    /// Number of SDO aborts among them.
    pub aborts: u64,
    /// Trials and shadows.
    pub run: u64,
    /// Images stored.
    pub stored: u64,
    /// Roll backs.
    pub rolled_back: u64,
    /// Configurations taken.
    pub configured: u64,
    /// Wrong tags.
    pub forged: u64,
    /// Frames that met the node in OPERATIONAL.
    pub operational: u64,
}

impl Counts {
    /// Adds another node's.
    pub fn add(&mut self, other: &Self) {
        let pairs = [
            (&mut self.sent, other.sent),
            (&mut self.aborts, other.aborts),
            (&mut self.run, other.run),
            (&mut self.stored, other.stored),
            (&mut self.rolled_back, other.rolled_back),
            (&mut self.configured, other.configured),
            (&mut self.forged, other.forged),
            (&mut self.operational, other.operational),
        ];
        pairs.into_iter().for_each(|(sum, part)| *sum += part);
    }
}

/// State that the firmware keeps in statics.
#[derive(Debug)]
pub struct Statics {
    bus: canopen_node::Shared,
    shared: Shared,
    staging: [u8; STAGING],
}

impl Statics {
    /// State at power-on.
    #[allow(clippy::new_without_default, reason = "as its parts")]
    #[must_use]
    pub const fn new() -> Self {
        Self { bus: canopen_node::Shared::new(), shared: Shared::new(), staging: [0; STAGING] }
    }
}

/// A node under attack.
#[derive(Debug)]
pub struct HostileNode<'a> {
    bus: &'a canopen_node::Shared,
    receiver: Receiver<'a>,
    server: Server<'a>,
    image: JointImage<'a>,
    objects: Objects<'a, Watched>,
    observed: Observed,
    key: Option<Key>,
    queue: VecDeque<Frame>,
    /// us.
    now: u64,
    /// Highest version that was stored.
    floor: u32,
    state: NmtState,
    sent: Vec<Frame>,
    counts: Counts,
}

impl<'a> HostileNode<'a> {
    /// Booted, with images of versions 2 and 3 in its slots, and a key where one is given.
    ///
    /// # Errors
    /// None in practice: an erased flash can be written.
    pub fn new(statics: &'a mut Statics, key: Option<&Key>) -> Result<Self, SlotError> {
        let mut storage = Storage::empty()?;
        storage.images.store(&crate::SampleImage::constant(2, 0.1))?;
        storage.images.store(&crate::SampleImage::constant(3, 0.2))?;
        let stored_images = storage.images.stored();
        let board = B_G431B_ESC1;
        let target = Target { product: IDENTITY.product, serial: IDENTITY.serial };
        let Statics { bus, shared, staging } = statics;
        let (bus, shared) = (&*bus, &*shared);
        let guard = Guard { floor: 3, key: key.cloned(), ..Guard::default() };
        storage.store_guard(&guard)?;
        let images = Images::new(staging, LifeCycle::new(target, 3, 0), Ownership::new(&guard), stored_images);
        let mut start = Start { stores_left: STORES, ..Start::new(None, false, &board.joint, &board.bridge) };
        // Room for what the images command.
        start.configuration.limits.torque = 1.0;
        let mut node = Self {
            bus,
            receiver: Receiver::new(bus),
            server: Server::new(bus, &IDENTITY, SdoSettings::default(), NODE),
            image: JointImage::new(shared),
            objects: Objects::new(shared, Watched::new(board.bridge, storage), images, &start),
            observed: Observed::default(),
            key: key.cloned(),
            queue: VecDeque::new(),
            now: 0,
            floor: 3,
            state: NmtState::Initialising,
            sent: Vec::new(),
            counts: Counts::default(),
        };
        // It boots; nothing to judge yet.
        let _ = node.work();
        node.state = node.bus.state();
        Ok(node)
    }

    /// Node id in use; 255 once LSS has taken it away.
    #[must_use]
    pub fn id(&self) -> u8 {
        self.bus.node_id()
    }

    /// Counts of what has happened.
    #[must_use]
    pub fn counts(&self) -> &Counts {
        &self.counts
    }

    /// Time passes, us. No more than the half hour that the server needs.
    pub fn wait(&mut self, time: u32) {
        self.now += u64::from(time.min(1_700_000_000));
    }

    /// The joint is, or is not, under current, and measures `value` in everything.
    pub fn observe(&mut self, armed: bool, value: f32) {
        let telemetry = &mut self.observed.telemetry;
        telemetry.state = if armed { State::OperationEnabled } else { State::SwitchOnDisabled };
        telemetry.motion.position = value;
        telemetry.measured_torque = value;
        self.objects.program().armed = armed;
        self.objects.poll(self.now / 1_000, &self.observed);
    }

    /// The receive interrupt.
    ///
    /// # Errors
    /// Violations of the protocol.
    pub fn receive(&mut self, frame: &Frame) -> Result<(), Violation> {
        let (before, asked, id) = (self.bus.state(), self.image.demand(), self.bus.node_id());
        self.counts.operational += u64::from(before == NmtState::Operational);
        self.image.observe(&self.observed);
        let sent = &mut self.sent;
        match self.receiver.receive(frame, self.now as u32, &mut self.image, |frame| sent.push(frame)) {
            Route::Server if self.queue.len() < QUEUE => self.queue.push_back(*frame),
            // The protocol deals with what is lost.
            Route::Server | Route::Done => {}
        }
        let after = self.bus.state();
        hold!(after == allowed(frame, before, id), "{before:?} became {after:?} by {frame:02x?}");
        let demand = self.image.demand();
        let silent = matches!(frame.id(), 0 | 0x601..=0x67F | 0x701..=0x77F | 0x7E5) && after == before;
        hold!(!silent || frame.id() == 0 || demand == asked, "{frame:02x?} asked for {demand:?} after {asked:?}");
        self.image.follow(after);
        self.image.leave_copies();
        self.judge_demand()
    }

    /// The task's work.
    ///
    /// # Errors
    /// Violations of the protocol.
    pub fn work(&mut self) -> Result<(), Violation> {
        let now = self.now as u32;
        let mut before = self.bus.state();
        self.objects.poll(self.now / 1_000, &self.observed);
        self.act()?;
        loop {
            while let Some(emergency) = self.objects.take_emergency() {
                self.server.emergency(emergency.code, emergency.register, emergency.information);
            }
            let frame = match self.queue.pop_front() {
                Some(frame) => {
                    let answer = self.server.receive(&frame, now, &mut self.objects);
                    self.image.follow(self.bus.state());
                    self.image.leave_copies();
                    self.act()?;
                    answer
                }
                None => match self.server.poll(now, &mut self.objects) {
                    Some(frame) => Some(frame),
                    None => break,
                },
            };
            self.sent.extend(frame);
            let after = self.bus.state();
            let own = matches!(
                (before, after),
                (NmtState::Initialising, NmtState::PreOperational)
                    | (NmtState::Operational, NmtState::PreOperational | NmtState::Stopped)
                    | (NmtState::PreOperational, NmtState::Stopped)
            );
            hold!(before == after || own, "the task made {after:?} of {before:?}");
            before = after;
        }
        self.image.follow(self.bus.state());
        self.image.leave_copies();
        self.judge_demand()?;
        self.judge_sent()?;
        let program = self.objects.program();
        if let Some(problem) = program.problem.take() {
            return Err(Violation(problem.into()));
        }
        self.counts.forged += u64::from(std::mem::take(&mut program.forged));
        let configured = std::mem::take(&mut program.configured);
        if configured > 0 {
            self.counts.configured += u64::from(configured);
            let bridge = B_G431B_ESC1.bridge;
            let configuration = self.objects.configuration();
            hold!(configuration.prepare(&bridge).is_ok(), "configured: {configuration:?}");
            // Nobody here has a session: of an owned joint compensation alone can change, downwards.
            let Configuration { compensation, .. } = *configuration;
            let before = B_G431B_ESC1.joint;
            let lowered = compensation.gain <= before.compensation.gain
                && compensation.clamp <= before.compensation.clamp
                && compensation.slew <= before.compensation.slew
                && compensation.request as u8 <= before.compensation.request as u8;
            let node_id = configuration.node_id;
            let same = *configuration == Configuration { compensation, node_id, ..before };
            hold!(self.key.is_none() || lowered && same, "configured without its owner: {configuration:?}");
        }
        Ok(())
    }

    fn judge_demand(&self) -> Result<(), Violation> {
        let Demand { controlword, command, coupled, .. } = self.image.demand();
        let Command { position, velocity, torque, stiffness, damping, .. } = command;
        let numbers = [position, velocity, torque, stiffness, damping, coupled.velocity];
        hold!(numbers.iter().all(|number| number.is_finite()), "asked for {command:?}");
        let state = self.bus.state();
        let quiet = controlword == Controlword::QUICK_STOP && command == Command::default();
        hold!(state == NmtState::Operational || quiet, "in {state:?} the joint is asked for {command:?}");
        Ok(())
    }

    fn judge_sent(&mut self) -> Result<(), Violation> {
        let id = u16::from(self.bus.node_id() & 0x7F);
        for frame in self.sent.drain(..) {
            self.counts.sent += 1;
            let answer = frame.id() == 0x580 + id;
            self.counts.aborts += u64::from(answer && frame.data().first() == Some(&0x80));
            // CiA 301 table 40.
            let restricted = matches!(
                frame.id(),
                0..=0x07F | 0x101..=0x180 | 0x581..=0x5FF | 0x601..=0x67F | 0x6E0..=0x6FF | 0x701..=0x7FF
            );
            let own = answer || frame.id() == 0x700 + id || frame.id() == 0x7E4;
            hold!(own || !restricted, "node {id} sent {frame:02x?}");
        }
        Ok(())
    }

    /// Does what the life cycle asks for, where it may ask for it.
    fn act(&mut self) -> Result<(), Violation> {
        loop {
            let action = self.objects.take_action();
            let outcome = match action {
                Action::Nothing => return Ok(()),
                Action::Revert | Action::Activate => Ok(()),
                Action::Run { length, .. } => {
                    self.judge_image(length)?;
                    self.counts.run += 1;
                    Ok(())
                }
                Action::Store { length } => {
                    let summary = self.judge_image(length)?;
                    hold!(!self.objects.program().armed, "an image is stored under current");
                    let newer = self.key.is_none() || summary.version > self.floor;
                    hold!(newer, "version {} is stored without its owner, {} was", summary.version, self.floor);
                    self.floor = summary.version;
                    self.counts.stored += 1;
                    let image = self.objects.staging().get(..length).unwrap_or_default().to_vec();
                    self.objects.program().storage.images.store(&image)
                }
                Action::RollBack => {
                    hold!(!self.objects.program().armed, "a roll back under current");
                    hold!(self.key.is_none(), "a roll back without its owner");
                    self.counts.rolled_back += 1;
                    let mut buffer = *self.objects.staging();
                    self.objects.program().storage.images.roll_back(&mut buffer)
                }
            };
            let stored = self.objects.program().storage.images.stored();
            self.objects.finished(outcome, stored);
        }
    }

    /// Judges whether an image may be run or stored.
    fn judge_image(&mut self, length: usize) -> Result<Summary, Violation> {
        let (key, floor) = (self.key.clone(), self.floor);
        let staging = self.objects.staging();
        let image = staging.get(..length).unwrap_or_default();
        let Ok(summary) = Image::summary(image) else { return Err(Violation("what runs is no image".into())) };
        hold!(Image::decode(image).is_ok(), "what runs is no image");
        if let Some(key) = key {
            hold!(summary.version >= floor, "version {} runs, {floor} was stored", summary.version);
            let tag = staging.get(length..).and_then(|rest| rest.first_chunk::<TAG>());
            hold!(tag.is_some_and(|tag| key.verify(image, tag)), "what runs has no tag of the key");
        }
        Ok(summary)
    }
}

/// The state that a frame may lead to: CiA 301 section 7.3.2.
fn allowed(frame: &Frame, before: NmtState, id: u8) -> NmtState {
    match (frame.id(), frame.data()) {
        (0, &[command, node]) if id != NO_NODE_ID && (node == 0 || node == id) => match (command, before) {
            (0x81 | 0x82, _) => NmtState::Initialising,
            (_, NmtState::Initialising) => before,
            (0x01, _) => NmtState::Operational,
            (0x02, _) => NmtState::Stopped,
            (0x80, _) => NmtState::PreOperational,
            _ => before,
        },
        _ => before,
    }
}
