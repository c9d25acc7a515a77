//! The whole node, with frames and time passed in.
//!
//! Control steps run as simulated time passes. After each millisecond of them the task's work is done, as on a board
//! that has time to spare.

use crate::flash::Flash;
use crate::images::{SlotImages, model};
use crate::program::VirtualProgram;
use crate::storage::Storage;
use bus::Frame;
use canopen_node::{
    self, Buffers, Identity, NO_NODE_ID, NmtState, PDOS, Receiver, Route, SdoSettings, Server, TransmitQueue,
};
use friction_compensation::parameters::authentication::STAGING;
use friction_compensation::parameters::image::Target;
use friction_compensation::parameters::life_cycle::{Action, LifeCycle, Mode};
use friction_compensation::parameters::slots::SlotError;
use joint_firmware::joint::configuration::Configuration;
use joint_firmware::joint::shadow::Shadow;
use joint_firmware::joint::state_machine::State;
use joint_firmware::joint::{Demand, Joint, Telemetry};
use joint_firmware::objects::{
    FrictionStatistics, Images, JointImage, Objects, Observed, Ownership, Shared, StoredImages,
};
use joint_firmware::reset_record::LastReset;
use plant::actuator::Accessories;
use plant::virtual_joint::{Setup, VirtualJointError};
use plant::{ActuatorParameters, VirtualJoint};
use std::collections::VecDeque;
use std::time::Duration;

/// Device profile 402, a servo drive.
const DEVICE_TYPE: u32 = 0x0002_0192;
/// Vendor of a node that belongs to nobody.
const VENDOR: u32 = 0;
/// Product of the virtual joint: "VJnt".
pub const PRODUCT: u32 = 0x564A_6E74;
/// Evaluations of a model in shadow a second: after each millisecond of control steps.
const SHADOW_RATE: u32 = 1_000;
/// Frames that wait for the task; an SDO block and some more.
const QUEUE: usize = 160;
/// Frames that wait for the controller.
const TRANSMIT: usize = 16;
/// Places that the task leaves to what the receive interrupt sends: the TPDOs.
const RESERVED: usize = PDOS;

/// Options of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Options {
    /// 1 to 127, or 255: silent until LSS gives it one. One that LSS has stored comes first.
    pub node_id: u8,
    /// Serial number, 1018h:4.
    pub serial: u32,
    /// Seed of the sensors' noise.
    pub seed: u64,
}

/// Reason for which there is no node.
#[derive(Debug, thiserror::Error)]
pub enum NodeError {
    /// Plant or firmware refuse.
    #[error("virtual joint: {0}")]
    Joint(#[from] VirtualJointError),
    /// The slots.
    #[error("slots: {0}")]
    Slots(SlotError),
    /// No node id.
    #[error("node id {0} is outside 1 to 127, and not 255 for none")]
    NodeId(u8),
}

/// Begin of a control step.
pub(crate) struct Before {
    /// Demand from the bus.
    pub demand: Demand,
    /// Torque that is asked for with the feedforward of the load, Nm.
    feedforward_torque: f32,
    /// Collisions so far.
    collisions: u16,
}

/// A joint on the bus.
#[derive(Debug)]
pub struct VirtualNode {
    pub(crate) joint: VirtualJoint,
    setup: Setup,
    target: Target,
    rate: u32,
    /// Rounds of the motion loop a second, Hz.
    motion_rate: u32,
    bus: &'static canopen_node::Shared,
    receiver: Receiver<'static>,
    server: Server<'static>,
    image: JointImage<'static>,
    objects: Objects<'static, VirtualProgram>,
    observed: Observed,
    statistics: FrictionStatistics,
    shadow: Option<Shadow>,
    queue: VecDeque<Frame>,
    /// Frames for the bus.
    sent: TransmitQueue<TRANSMIT>,
    /// The task has more to send than there was room for.
    unfinished: bool,
    dropped: u64,
    steps: u64,
    /// Control step until which the task has no time.
    busy_until: u64,
    /// External torque on the link, Nm.
    pub(crate) external_torque: f64,
}

fn text(parameters: &ActuatorParameters) -> String {
    format!("virtual joint, gear {:.1}", parameters.joint.motor.gear_ratio)
}

impl VirtualNode {
    /// A joint at rest, in PRE-OPERATIONAL once time passes, with nothing but images stored. It stays in memory for as
    /// long as the program runs.
    ///
    /// # Errors
    /// Refusals of plant or firmware.
    pub fn new(
        parameters: ActuatorParameters,
        setup: &Setup,
        options: &Options,
        images: SlotImages,
    ) -> Result<Self, NodeError> {
        Self::with_storage(parameters, setup, options, Storage::with(images).map_err(NodeError::Slots)?)
    }

    /// The same joint with everything that it has stored, as after a loss of power. Where a configuration is stored it
    /// acts instead of `setup`'s.
    ///
    /// # Errors
    /// Refusals of plant or firmware.
    pub fn with_storage(
        parameters: ActuatorParameters,
        setup: &Setup,
        options: &Options,
        storage: Storage,
    ) -> Result<Self, NodeError> {
        if !matches!(options.node_id, 1..=127 | NO_NODE_ID) {
            return Err(NodeError::NodeId(options.node_id));
        }
        let (rate, motion_rate) = (setup.bridge.rate as u32, setup.bridge.motion_rate());
        let mut program = VirtualProgram::new(setup.bridge, storage);
        let start = program.power_on(&setup.configuration);
        let started = Setup { configuration: start.configuration, ..*setup };
        let mut joint = VirtualJoint::new(parameters, &started, parameters.joint.thermal.ambient, options.seed)?;
        joint.set_friction(program.storage.images.model(motion_rate));

        // The firmware keeps these in statics.
        let bus: &canopen_node::Shared = Box::leak(Box::new(canopen_node::Shared::new()));
        let shared: &Shared = Box::leak(Box::new(Shared::new()));
        let identity = Box::leak(Box::new(Identity {
            device_type: DEVICE_TYPE,
            device_name: Box::leak(text(&parameters).into_boxed_str()),
            hardware_version: "simulated",
            software_version: env!("CARGO_PKG_VERSION"),
            vendor: VENDOR,
            product: PRODUCT,
            revision: 1,
            serial: options.serial,
        }));
        let target = Target { product: PRODUCT, serial: options.serial };
        let (life, stored_images) = life(target, &mut program.storage);
        let owner = Ownership::new(&program.storage.guard());
        let images = Images::new(Box::leak(Box::new([0; STAGING])), life, owner, stored_images);
        let stored = start.configuration.node_id;
        let node_id = if stored == NO_NODE_ID { options.node_id } else { stored };
        Ok(Self {
            joint,
            setup: *setup,
            target,
            rate,
            motion_rate,
            bus,
            receiver: Receiver::new(bus),
            server: Server::new(bus, identity, SdoSettings::default(), node_id),
            image: JointImage::new(shared),
            objects: Objects::new(shared, program, images, &start),
            observed: Observed::default(),
            statistics: FrictionStatistics::default(),
            shadow: None,
            queue: VecDeque::new(),
            sent: TransmitQueue::new(),
            unfinished: false,
            dropped: 0,
            steps: 0,
            busy_until: 0,
            external_torque: 0.0,
        })
    }

    /// Simulated time since the start, µs; wraps.
    fn now(&self) -> u32 {
        self.microseconds() as u32
    }

    fn microseconds(&self) -> u64 {
        self.steps * 1_000_000 / u64::from(self.rate)
    }

    /// NMT state.
    #[must_use]
    pub fn state(&self) -> NmtState {
        self.bus.state()
    }

    /// Flash of the slots, which is what a loss of power leaves of the images.
    pub fn flash(&mut self) -> Flash {
        self.objects.program().storage.images.flash().clone()
    }

    /// Storage that a loss of power leaves.
    pub fn storage(&mut self) -> Storage {
        self.objects.program().storage.clone()
    }

    /// Configuration that the joint runs with.
    #[must_use]
    pub fn configuration(&self) -> &Configuration {
        self.objects.configuration()
    }

    /// External torque on the link from now on, Nm.
    pub fn push(&mut self, torque: f64) {
        self.external_torque = torque;
    }

    /// Fits what hangs at the board's outputs, in place of what was there.
    pub fn fit(&mut self, accessories: Accessories) {
        self.joint.actuator_mut().fit(accessories);
    }

    /// The joint behind the node.
    #[must_use]
    pub fn joint(&self) -> &VirtualJoint {
        &self.joint
    }

    /// Frames that found no room on the way to the task.
    #[must_use]
    pub fn dropped(&self) -> u64 {
        self.dropped
    }

    /// TPDOs and heartbeats that were overwritten by newer ones because the bus had no room for them.
    #[must_use]
    pub fn overwritten(&self) -> u32 {
        self.sent.overwritten()
    }

    /// Frames of this node that found no room on the way to the controller.
    #[must_use]
    pub fn unsent(&self) -> u32 {
        self.sent.dropped()
    }

    /// Requests that wait for the task, [`VirtualNode::work`].
    #[must_use]
    pub fn requests(&self) -> usize {
        self.queue.len()
    }

    /// Control steps a second.
    #[must_use]
    pub fn rate(&self) -> u32 {
        self.rate
    }

    /// Control steps so far.
    #[must_use]
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// A frame from the bus: what acts in the receive interrupt acts now.
    pub fn receive(&mut self, frame: &Frame) {
        // TPDOs tell of the last control step, not of what the task last looked at.
        self.observed.telemetry = self.joint.joint().telemetry();
        self.image.observe(&self.observed);
        let now = self.now();
        self.image.at(now);
        let sent = &mut self.sent;
        let send = |frame| {
            // Counted where there is no room.
            let _ = sent.push(frame, true, now);
        };
        match self.receiver.receive(frame, now, &mut self.image, send) {
            Route::Server if self.queue.len() < QUEUE => self.queue.push_back(*frame),
            Route::Server => self.dropped += 1,
            Route::Done => {}
        }
        self.image.follow(self.bus.state());
        self.image.leave_copies();
    }

    /// The task is busy for `time` from now on: what it does in no simulated time, as verifying an image, takes it time
    /// on a board. Control steps and the receive interrupt go on.
    pub fn occupy(&mut self, time: Duration) {
        self.busy_until = self.steps + (time.as_secs_f64() * f64::from(self.rate)) as u64;
    }

    /// The task's work; at least once a millisecond of simulated time, and after frames that want an answer.
    pub fn work(&mut self) {
        self.image.at(self.now());
        if self.steps < self.busy_until {
            return;
        }
        self.objects.poll(self.microseconds() / 1_000, &self.observed);
        self.act();
        self.answer();
        self.restart();
        self.swap();
        self.image.follow(self.bus.state());
        self.image.leave_copies();
    }

    /// Requests and what the server sends by itself, for as long as there is room for it.
    fn answer(&mut self) {
        let now = self.now();
        self.unfinished = false;
        loop {
            while let Some(emergency) = self.objects.take_emergency() {
                self.server.emergency(emergency.code, emergency.register, emergency.information);
            }
            if self.sent.room() <= RESERVED {
                self.unfinished = true;
                return;
            }
            let frame = match self.queue.pop_front() {
                Some(frame) => {
                    self.swap();
                    let answer = self.server.receive(&frame, now, &mut self.objects);
                    // One set-point at a time waits for the interrupt.
                    self.image.follow(self.bus.state());
                    self.image.leave_copies();
                    self.act();
                    answer
                }
                None => match self.server.poll(now, &mut self.objects) {
                    Some(frame) => Some(frame),
                    None => return,
                },
            };
            if let Some(frame) = frame {
                // There is room.
                let _ = self.sent.push(frame, self.bus.is_renewable(&frame), now);
            }
        }
    }

    /// A reset of the node reaches the application as soon as nothing is under current: the stored configuration and
    /// image act.
    fn restart(&mut self) {
        let state = self.joint.joint().telemetry().state;
        let off = matches!(state, State::NotReadyToSwitchOn | State::SwitchOnDisabled | State::Fault);
        if !off || !std::mem::take(&mut self.objects.program().reset) {
            return;
        }
        let defaults = self.setup.configuration;
        let program = self.objects.program();
        program.last_reset = LastReset::REQUESTED;
        let start = program.power_on(&defaults);
        let (life, stored_images) = life(self.target, &mut program.storage);
        let model = program.storage.images.model(self.motion_rate);
        // Refused only where even the defaults are, with which the joint began.
        program.next = start.configuration.prepare(&self.setup.bridge).ok();
        self.objects.restart(life, stored_images, &start);
        self.joint.set_friction(model);
        self.shadow = None;
        self.statistics = FrictionStatistics::default();
    }

    /// Swaps a prepared configuration in: here is always between two control steps.
    fn swap(&mut self) {
        if let Some(active) = self.objects.program().next.take() {
            self.joint.set_active(active);
        }
    }

    /// The next frame for the bus.
    pub fn take_frame(&mut self) -> Option<Frame> {
        self.take_frame_for(Buffers { all: usize::MAX, occupied: 0 })
    }

    /// The next frame for a controller with these transmit buffers.
    pub fn take_frame_for(&mut self, buffers: Buffers) -> Option<Frame> {
        let frame = self.sent.pop(self.now(), buffers);
        if self.unfinished && self.sent.room() > RESERVED {
            self.answer();
        }
        frame
    }

    /// Control steps, with the task's work after each millisecond.
    pub fn advance(&mut self, steps: u64) {
        for _ in 0..steps {
            let before = self.before();
            let telemetry = self.joint.step(&before.demand, self.external_torque);
            self.after(&before, &telemetry);
        }
    }

    /// Demand of the next control step, which the joint makes next.
    pub(crate) fn before(&self) -> Before {
        let demand = self.image.demand();
        let feedforward_torque = self.joint.bearing(&demand).command.torque;
        Before { demand, feedforward_torque, collisions: self.joint.external_torque().collisions }
    }

    /// Takes what that control step told, and does the task's work once a millisecond.
    pub(crate) fn after(&mut self, before: &Before, telemetry: &Telemetry) {
        let found = self.joint.external_torque();
        if found.collisions != before.collisions {
            self.image.collide(found.reaction);
        }
        self.steps += 1;
        let per_work = u64::from(self.rate / 1_000).max(1);
        if self.steps.is_multiple_of(per_work) {
            self.observe(telemetry, before.feedforward_torque);
            self.work();
        }
    }

    /// Takes what the task knows of the joint.
    fn observe(&mut self, telemetry: &Telemetry, feedforward_torque: f32) {
        let mut seen = *telemetry;
        if let Some(shadow) = &mut self.shadow {
            seen.compensated.output.shadow = shadow.torque(telemetry);
        }
        self.statistics.note(&seen);
        let joint: &Joint = self.joint.joint();
        let latched = joint.latched_faults();
        let measured = self.joint.measured();
        self.observed = Observed {
            telemetry: *telemetry,
            latched,
            feedforward_torque,
            winding_temperature: measured.winding_temperature,
            bridge_temperature: measured.bridge_temperature,
            friction: self.statistics,
            adaptation: self.joint.adaptation(),
            external: [*self.joint.external_torque()],
        };
        let history = if latched.is_empty() { None } else { Some(*joint.history()) };
        let window = *joint.window();
        let program = self.objects.program();
        program.history = history;
        program.window = window;
    }

    /// Does what the life cycle asks for, until it asks for nothing.
    fn act(&mut self) {
        loop {
            let outcome = match self.objects.take_action() {
                Action::Nothing => return,
                Action::Run { mode, length } => self.run(mode, length),
                Action::Revert | Action::Activate => {
                    self.shadow = None;
                    let model = self.objects.program().storage.images.model(self.motion_rate);
                    self.joint.set_friction(model);
                    Ok(())
                }
                Action::Store { length } => {
                    let image = self.objects.staging()[..length].to_vec();
                    self.objects.program().storage.images.store(&image)
                }
                Action::RollBack => {
                    let mut buffer = *self.objects.staging();
                    self.objects.program().storage.images.roll_back(&mut buffer)
                }
            };
            let stored = self.objects.program().storage.images.stored();
            self.objects.finished(outcome, stored);
        }
    }

    fn run(&mut self, mode: Mode, length: usize) -> Result<(), SlotError> {
        // It was verified a moment ago.
        let image = &self.objects.staging()[..length];
        match mode {
            Mode::Shadow => {
                self.shadow = model(image, SHADOW_RATE).map(Shadow::new);
                // A trial may have been before: the stored model acts again.
                let stored = self.objects.program().storage.images.model(self.motion_rate);
                self.joint.set_friction(stored);
            }
            Mode::Trial => {
                let model = model(image, self.motion_rate);
                self.shadow = None;
                self.joint.set_friction(model);
            }
        }
        Ok(())
    }
}

/// The life cycle of a joint that starts, and what its slots hold.
fn life(target: Target, storage: &mut Storage) -> (LifeCycle, StoredImages) {
    let stored = storage.images.stored();
    let guard = storage.guard();
    (LifeCycle::new(target, guard.floor, guard.failures), stored)
}
