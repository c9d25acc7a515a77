//! The whole node, with frames and time passed in.
//!
//! Control steps run as simulated time passes. After each millisecond of them the task's work is done, as on a board that has time to spare.

use crate::flash::Flash;
use crate::images::{SlotImages, model};
use crate::program::VirtualProgram;
use bus::Frame;
use joint_firmware::canopen::{self, Identity, NO_NODE_ID, NmtState, Receiver, Route, SdoSettings, Server};
use joint_firmware::joint::shadow::Shadow;
use joint_firmware::joint::{Joint, Telemetry};
use joint_firmware::objects::{FrictionStatistics, Images, JointImage, Objects, Observed, Shared, Start, Stored};
use joint_firmware::parameters::authentication::STAGING;
use joint_firmware::parameters::certificate::Limits;
use joint_firmware::parameters::image::{Effort, Target};
use joint_firmware::parameters::life_cycle::{Action, LifeCycle, Mode, Requirements};
use joint_firmware::parameters::slots::SlotError;
use plant::virtual_joint::{Setup, VirtualJointError};
use plant::{ActuatorParameters, VirtualJoint};
use std::collections::VecDeque;

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

/// Which node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Options {
    /// 1 to 127, or 255: silent until LSS gives it one.
    pub node_id: u8,
    /// Serial number, 1018h:4.
    pub serial: u32,
    /// Seed of the sensors' noise.
    pub seed: u64,
}

/// Why there is no node.
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

/// A joint on the bus.
#[derive(Debug)]
pub struct VirtualNode {
    joint: VirtualJoint,
    rate: u32,
    bus: &'static canopen::Shared,
    receiver: Receiver<'static>,
    server: Server<'static>,
    image: JointImage<'static>,
    objects: Objects<'static, VirtualProgram>,
    observed: Observed,
    statistics: FrictionStatistics,
    shadow: Option<Shadow>,
    queue: VecDeque<Frame>,
    /// Frames for the bus, oldest first.
    sent: VecDeque<Frame>,
    dropped: u64,
    steps: u64,
}

fn text(parameters: &ActuatorParameters) -> String {
    format!("virtual joint, gear {:.1}", parameters.joint.motor.gear_ratio)
}

impl VirtualNode {
    /// A joint at rest, in PRE-OPERATIONAL once time passes. It stays in memory for as long as the program runs.
    ///
    /// # Errors
    /// What plant or firmware refuse.
    pub fn new(
        parameters: ActuatorParameters,
        setup: &Setup,
        options: &Options,
        mut images: SlotImages,
    ) -> Result<Self, NodeError> {
        if !matches!(options.node_id, 1..=127 | NO_NODE_ID) {
            return Err(NodeError::NodeId(options.node_id));
        }
        let mut joint = VirtualJoint::new(parameters, setup, parameters.joint.thermal.ambient, options.seed)?;
        let rate = setup.bridge.rate as u32;
        joint.set_friction(images.model(rate));

        // The firmware keeps these in statics.
        let bus: &canopen::Shared = Box::leak(Box::new(canopen::Shared::new()));
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
        let stored_images = images.stored();
        let floor = [stored_images.active, stored_images.previous].iter().flatten().map(|(s, _)| s.version).max();
        let requirements = Requirements {
            target: Target { product: PRODUCT, serial: options.serial },
            effort: Effort::NewtonMetre,
            // The image's own limits hold as well.
            limits: Limits {
                output: (setup.configuration.limits.torque * 65_536.0) as u32,
                torque_gain: 1 << 16,
                velocity_slope: u32::MAX,
            },
            rate,
        };
        let life = LifeCycle::new(requirements, floor.unwrap_or(0), 0, 0);
        let images_of_client = Images::new(Box::leak(Box::new([0; STAGING])), life, None, stored_images);
        let start = Start { configuration: setup.configuration, stored: Stored::NOTHING, single_bank: true };
        let program = VirtualProgram::new(setup.bridge, images);
        Ok(Self {
            joint,
            rate,
            bus,
            receiver: Receiver::new(bus),
            server: Server::new(bus, identity, SdoSettings::default(), options.node_id),
            image: JointImage::new(shared),
            objects: Objects::new(shared, program, images_of_client, &start),
            observed: Observed::default(),
            statistics: FrictionStatistics::default(),
            shadow: None,
            queue: VecDeque::new(),
            sent: VecDeque::new(),
            dropped: 0,
            steps: 0,
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

    /// What a loss of power leaves: the slots' flash.
    pub fn flash(&mut self) -> Flash {
        self.objects.program().images.flash().clone()
    }

    /// The joint behind the node.
    #[must_use]
    pub fn joint(&self) -> &VirtualJoint {
        &self.joint
    }

    /// Control steps so far.
    #[must_use]
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// Frames that found no room on the way to the task.
    #[must_use]
    pub fn dropped(&self) -> u64 {
        self.dropped
    }

    /// Control steps a second.
    #[must_use]
    pub fn rate(&self) -> u32 {
        self.rate
    }

    /// A frame from the bus: what acts in the receive interrupt acts now.
    pub fn receive(&mut self, frame: &Frame) {
        self.image.observe(&self.observed);
        let now = self.now();
        let sent = &mut self.sent;
        match self.receiver.receive(frame, now, &mut self.image, |frame| sent.push_back(frame)) {
            Route::Server if self.queue.len() < QUEUE => self.queue.push_back(*frame),
            Route::Server => self.dropped += 1,
            Route::Done => {}
        }
        self.image.follow(self.bus.state());
    }

    /// The task's work; at least once a millisecond of simulated time, and after frames that want an answer.
    pub fn work(&mut self) {
        let now = self.now();
        self.objects.poll(self.microseconds() / 1_000, &self.observed);
        self.act();
        loop {
            while let Some(emergency) = self.objects.take_emergency() {
                self.server.emergency(emergency.code, emergency.register, emergency.information);
            }
            let frame = match self.queue.pop_front() {
                Some(frame) => {
                    self.swap();
                    let answer = self.server.receive(&frame, now, &mut self.objects);
                    // One set-point at a time waits for the interrupt.
                    self.image.follow(self.bus.state());
                    self.act();
                    answer
                }
                None => match self.server.poll(now, &mut self.objects) {
                    Some(frame) => Some(frame),
                    None => break,
                },
            };
            self.sent.extend(frame);
        }
        self.swap();
        self.image.follow(self.bus.state());
    }

    /// Swaps a prepared configuration in: here is always between two control steps.
    fn swap(&mut self) {
        if let Some(active) = self.objects.program().next.take() {
            self.joint.set_active(active);
        }
    }

    /// The next frame for the bus.
    pub fn take_frame(&mut self) -> Option<Frame> {
        self.sent.pop_front()
    }

    /// Control steps, with the task's work after each millisecond.
    pub fn advance(&mut self, steps: u64) {
        let per_work = u64::from(self.rate / 1_000).max(1);
        for _ in 0..steps {
            let demand = self.image.demand();
            let telemetry = *self.joint.step(&demand, 0.0);
            self.steps += 1;
            if self.steps.is_multiple_of(per_work) {
                self.observe(&telemetry, demand.command.torque);
                self.work();
            }
        }
    }

    /// What the task knows of the joint.
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
        };
        let history = if latched.is_empty() { None } else { Some(*joint.history()) };
        self.objects.program().history = history;
    }

    /// Does what the life cycle asks for, until it asks for nothing.
    fn act(&mut self) {
        loop {
            let outcome = match self.objects.take_action() {
                Action::Nothing => return,
                Action::Run { mode, length } => self.run(mode, length),
                Action::Revert | Action::Activate => {
                    self.shadow = None;
                    let model = self.objects.program().images.model(self.rate);
                    self.joint.set_friction(model);
                    Ok(())
                }
                Action::Store { length } => {
                    let image = self.objects.staging()[..length].to_vec();
                    self.objects.program().images.store(&image)
                }
                Action::RollBack => {
                    let mut buffer = *self.objects.staging();
                    self.objects.program().images.roll_back(&mut buffer)
                }
            };
            let stored = self.objects.program().images.stored();
            self.objects.finished(outcome, stored);
        }
    }

    fn run(&mut self, mode: Mode, length: usize) -> Result<(), SlotError> {
        // It was verified a moment ago.
        let image = &self.objects.staging()[..length];
        match mode {
            Mode::Shadow => self.shadow = model(image, SHADOW_RATE).map(Shadow::new),
            Mode::Trial => {
                let model = model(image, self.rate);
                self.shadow = None;
                self.joint.set_friction(model);
            }
        }
        Ok(())
    }
}
