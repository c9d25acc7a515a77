//! The objects behind the real server: a client by SDO, a master by PDO, a hostile bus; the host.

mod attacks;
mod client;
mod documentation;
mod evidence;
mod fault_log;
mod friction_by_part;
mod hardware;
mod hostile;
mod images;
mod masters;
mod open_loop;
mod ownership;
mod process_data;
mod profile_values;
mod settings;
mod stores;
mod table;

use super::*;
use crate::default_configuration::{B_G431B_ESC1, BoardConfiguration};
use crate::hardware::Hardware;
use crate::joint::configuration::{BridgeConfiguration, Configuration};
use crate::joint::history::History;
use crate::motor::open_loop::Window;
use crate::reset_record::{Cause, LastReset, Record};
use canopen_node::{Event, Frame, Identity, NmtState, Receiver, Route, SdoSettings, Server};
use friction_compensation::parameters::authentication::{CHALLENGE, STAGING};
use friction_compensation::parameters::fault_log::LoggedFault;
use friction_compensation::parameters::guard::Guard;
use friction_compensation::parameters::image::{Effort, Target};
use friction_compensation::parameters::life_cycle::LifeCycle;
use friction_compensation::parameters::slots::SlotError;
use std::collections::VecDeque;

pub const NODE: u8 = 5;
const BOARD: BoardConfiguration = B_G431B_ESC1;
const IDENTITY: Identity<'static> = Identity {
    device_type: 0x0002_0192,
    device_name: "joint",
    hardware_version: "host",
    software_version: "0.1.0",
    vendor: 1,
    product: 2,
    revision: 3,
    serial: 4,
};

/// A program that keeps everything in memory and does what it is told.
pub struct Memory {
    pub configured: Vec<Configuration>,
    pub busy: bool,
    pub record: Option<Vec<u8>>,
    pub kept: Vec<Guard>,
    pub drawn: u8,
    /// `true` if there are random numbers.
    pub draws: bool,
    pub button: Option<bool>,
    pub image: Vec<u8>,
    pub history: Option<History>,
    pub window: Window,
    pub fails: Option<SlotError>,
    pub damaged: u8,
    pub reset: LastReset,
    pub hardware: Hardware,
    /// Number of times that the chip's options were set.
    pub options_set: u32,
    /// Number of records that may be written, as told last.
    pub stores_left: Option<u8>,
    /// Number of records that were.
    pub stores: u32,
    /// Log of faults, and whether the flash takes them.
    pub logged: Vec<LoggedFault>,
    pub logs: bool,
    /// Number of times that this power-up was counted.
    pub counted: u32,
}

impl Default for Memory {
    fn default() -> Self {
        Self {
            configured: Vec::new(),
            busy: false,
            record: None,
            kept: Vec::new(),
            drawn: 0,
            draws: true,
            button: None,
            image: Vec::new(),
            history: None,
            window: Window::NOTHING,
            fails: None,
            damaged: 0,
            reset: LastReset::POWER_UP,
            hardware: Hardware::default(),
            options_set: 0,
            stores_left: None,
            stores: 0,
            logged: Vec::new(),
            logs: true,
            counted: 0,
        }
    }
}

impl Program for Memory {
    fn configure(&mut self, configuration: &Configuration) -> Result<(), NotConfigured> {
        if self.busy {
            return Err(NotConfigured::Busy);
        }
        configuration.prepare(&BOARD.bridge).map_err(NotConfigured::Refused)?;
        self.configured.push(*configuration);
        Ok(())
    }

    fn window(&self) -> Window {
        self.window
    }

    fn bridge(&self) -> &BridgeConfiguration {
        &BOARD.bridge
    }

    fn record<R>(&self, read: impl FnOnce(Option<&[u8]>) -> R) -> R {
        read(self.record.as_deref())
    }

    fn store(&mut self, record: &[u8]) -> Result<(), SlotError> {
        self.fails.map_or(Ok(()), Err)?;
        self.record = Some(record.to_vec());
        self.stores += 1;
        Ok(())
    }

    fn note_stores_left(&mut self, left: u8) {
        self.stores_left = Some(left);
    }

    fn damaged(&self) -> u8 {
        self.damaged
    }

    fn keep(&mut self, guard: &Guard) -> Result<(), SlotError> {
        self.fails.map_or(Ok(()), Err)?;
        self.kept.push(guard.clone());
        Ok(())
    }

    fn random(&mut self) -> Option<[u8; CHALLENGE]> {
        self.drawn = self.drawn.wrapping_add(1);
        self.draws.then_some([self.drawn; CHALLENGE])
    }

    fn button(&self) -> Option<bool> {
        self.button
    }

    fn read_image(&mut self, offset: u32, out: &mut [u8]) -> bool {
        out.copy_from_slice(&self.image[offset as usize..][..out.len()]);
        true
    }

    fn history<R>(&self, read: impl FnOnce(&History) -> R) -> Option<R> {
        self.history.as_ref().map(read)
    }

    fn last_reset(&self) -> LastReset {
        self.reset
    }

    fn log_fault(&mut self, code: u16, fault: u8, time: u32) -> bool {
        if self.logs {
            self.logged.insert(0, LoggedFault { code, fault, power_up: 7, time });
        }
        self.logs
    }

    fn count_power_up(&mut self) {
        self.counted += 1;
    }

    fn logged_faults(&self) -> impl Iterator<Item = LoggedFault> {
        self.logged.iter().copied()
    }

    fn power_ups(&self) -> u32 {
        7
    }

    fn hardware(&self) -> Hardware {
        self.hardware
    }

    fn set_options(&mut self) -> bool {
        self.options_set += 1;
        true
    }

    fn event(&mut self, _event: Event) {}
}

/// A joint's node without the joint: what it observes is the test's to say.
pub struct Node {
    pub shared: &'static Shared,
    pub bus: &'static canopen_node::Shared,
    pub receiver: Receiver<'static>,
    pub server: Server<'static>,
    pub image: JointImage<'static>,
    pub objects: Objects<'static, Memory>,
    pub observed: Observed,
    queue: VecDeque<Frame>,
    pub now: u32,
    /// Frames that came over the bus, as whoever listens has them.
    pub heard: Vec<Frame>,
}

impl Node {
    /// Node in PRE-OPERATIONAL.
    pub fn new() -> Self {
        Self::with(None, false)
    }

    pub fn with(record: Option<Vec<u8>>, single_bank: bool) -> Self {
        Self::started(record, single_bank, LastReset::POWER_UP)
    }

    pub fn started(record: Option<Vec<u8>>, single_bank: bool, reset: LastReset) -> Self {
        Self::guarded(record, single_bank, reset, &Guard::default())
    }

    /// Node with what guards the joint.
    pub fn guarded(record: Option<Vec<u8>>, single_bank: bool, reset: LastReset, guard: &Guard) -> Self {
        let found = Start::new(record.as_deref(), false, &BOARD.joint, &BOARD.bridge);
        let start = Start { single_bank, stores_left: STORES, ..found };
        Self::starting(Memory { record, reset, ..Memory::default() }, &start, guard)
    }

    /// Node with a program that starts so.
    pub fn starting(program: Memory, start: &Start, guard: &Guard) -> Self {
        let bus: &canopen_node::Shared = Box::leak(Box::new(canopen_node::Shared::new()));
        let shared: &Shared = Box::leak(Box::new(Shared::new()));
        let target = Target { product: 2, serial: 4 };
        let staging = Box::leak(Box::new([0; STAGING]));
        let life = LifeCycle::new(target, guard.floor, guard.failures);
        let images = Images::new(staging, life, Ownership::new(guard), StoredImages::default());
        let mut node = Self {
            shared,
            bus,
            server: Server::new(bus, &IDENTITY, SdoSettings::default(), NODE),
            receiver: Receiver::new(bus),
            image: JointImage::new(shared),
            objects: Objects::new(shared, program, images, start),
            observed: Observed::default(),
            queue: VecDeque::new(),
            now: 0,
            heard: Vec::new(),
        };
        node.task();
        assert_eq!(node.bus.state(), NmtState::PreOperational);
        node
    }

    pub fn operational() -> Self {
        let mut node = Self::new();
        node.receive(0, &[1, NODE]);
        assert_eq!(node.bus.state(), NmtState::Operational);
        node
    }

    /// The receive interrupt: the frames that it sends.
    fn interrupt(&mut self, frame: &Frame) -> Vec<Frame> {
        let mut sent = Vec::new();
        self.image.at(self.now);
        self.image.observe(&self.observed);
        match self.receiver.receive(frame, self.now, &mut self.image, |frame| sent.push(frame)) {
            Route::Server => self.queue.push_back(*frame),
            Route::Done => {}
        }
        self.image.follow(self.bus.state());
        self.image.leave_copies();
        sent
    }

    /// The task, until it has nothing to do: the frames that it sends.
    pub fn task(&mut self) -> Vec<Frame> {
        self.objects.poll(u64::from(self.now / 1_000), &self.observed);
        while let Some(emergency) = self.objects.take_emergency() {
            self.server.emergency(emergency.code, emergency.register, emergency.information);
        }
        let mut sent = Vec::new();
        loop {
            if let Some(frame) = self.queue.pop_front() {
                sent.extend(self.server.receive(&frame, self.now, &mut self.objects));
                while let Some(emergency) = self.objects.take_emergency() {
                    self.server.emergency(emergency.code, emergency.register, emergency.information);
                }
            } else if let Some(frame) = self.server.poll(self.now, &mut self.objects) {
                sent.push(frame);
            } else {
                break;
            }
        }
        // Pended by the task: a written set-point, a transition.
        self.image.follow(self.bus.state());
        self.image.leave_copies();
        assert!(!self.shared.has_written());
        sent
    }

    /// A frame from the bus, and everything that comes of it.
    pub fn receive(&mut self, id: u16, data: &[u8]) -> Vec<Frame> {
        let frame = Frame::new(id, data).unwrap();
        self.heard.push(frame);
        let mut sent = self.interrupt(&frame);
        sent.extend(self.task());
        sent
    }
}
