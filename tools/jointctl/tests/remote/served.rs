//! Virtual joints on a bus within this process.

use friction_compensation::friction::common::CommonTerms;
use friction_compensation::friction::domain::{Domain, Range};
use friction_compensation::friction::physical::{Coefficients, PhysicalParameters, Terms};
use friction_compensation::friction::regime::Selector;
use friction_compensation::friction::state::{JointState, SIGNALS};
use friction_compensation::friction::{FrictionModel, FrictionParameters, ParameterSet};
use friction_compensation::parameters::certificate::Limits;
use friction_compensation::parameters::image::{Effort, GoldenVector, Image, MAX_LENGTH, Target};
use jointctl::remote::RemoteJoint;
use node::{Options, SlotImages, Storage, VirtualArm, VirtualNode, serve};
use plant::ActuatorParameters;
use plant::load::LoadParameters;
use plant::virtual_joint::Setup;
use std::process::{Child, Command};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

/// Longest time for an answer of a joint: these joints run in real time, and the machine may have much else to do.
const PATIENCE: Duration = Duration::from_secs(60);

/// Command deadline of these joints, s: they run in real time, and the machine may be late with set-points. Tests
/// about the deadline set their own, or wait for the fault.
pub const DEADLINE: f32 = 5.0;

/// The program, with that patience.
pub fn program() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_jointctl"));
    command.env("JOINTCTL_TIMEOUT", PATIENCE.as_millis().to_string());
    command
}

/// A program that ends with its test.
pub struct Running(pub Child);

impl Drop for Running {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Node id of the first joint.
pub const NODE: u8 = 5;

/// Joints that run until this is dropped.
pub struct Served {
    bus: String,
    stop: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
}

impl Served {
    /// A joint for each node id, on a bus that nobody else has.
    pub fn joints(nodes: &[u8]) -> Self {
        static BUSES: AtomicU64 = AtomicU64::new(0);
        let bus = format!("virtual:remote-{}", BUSES.fetch_add(1, Ordering::Relaxed));
        Self::on(&bus, nodes)
    }

    /// The same on a bus that is named.
    pub fn on(bus: &str, nodes: &[u8]) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let threads = nodes.iter().zip(12..).map(|(&node_id, serial)| {
            let transport = bus::open(bus).unwrap();
            let stop = Arc::clone(&stop);
            let parameters = ActuatorParameters::reference().aligned().without_payload();
            let options = Options { node_id, serial, seed: 1 };
            let images = SlotImages::empty().unwrap();
            let mut setup = Setup::of(&parameters);
            setup.configuration.limits.command_deadline = DEADLINE;
            let mut joint = VirtualNode::new(parameters, &setup, &options, images).unwrap();
            // The current sensors' offsets are measured before anybody asks.
            joint.advance(4_000);
            // A bus that is gone is what some tests are about.
            std::thread::spawn(move || drop(serve(&mut joint, &*transport, &stop)))
        });
        let threads = threads.collect();
        Self { bus: bus.into(), stop, threads }
    }

    /// A joint behind an adapter at an address of its own, for a program.
    pub fn joints_on_slcan() -> Self {
        let port = bus::free_port().unwrap();
        let mut served = Self::on(&format!("slcan:listen://127.0.0.1:{port}"), &[NODE]);
        served.bus = format!("slcan:tcp://127.0.0.1:{port}");
        served
    }

    /// A joint that lives this many times slower than the clock: what it must hear within a time of its own has so much
    /// longer on a machine that is busy. Who waits for it waits longer, too.
    pub fn slowed(factor: u32) -> Self {
        // One test alone has such a joint.
        let bus = "virtual:remote-slowed".to_owned();
        let transport = bus::open(&bus).unwrap();
        let stop = Arc::new(AtomicBool::new(false));
        let parameters = ActuatorParameters::reference().aligned().without_payload();
        let options = Options { node_id: NODE, serial: 12, seed: 1 };
        let images = SlotImages::empty().unwrap();
        let mut node = VirtualNode::new(parameters, &Setup::of(&parameters), &options, images).unwrap();
        node.advance(4_000);
        let stopped = Arc::clone(&stop);
        let thread = std::thread::spawn(move || drop(serve(&mut Slowed { node, factor }, &*transport, &stopped)));
        Self { bus, stop, threads: vec![thread] }
    }

    /// Joints 1, 2 and so on of the arm that a file describes.
    pub fn arm(robot: &std::path::Path) -> Self {
        static BUSES: AtomicU64 = AtomicU64::new(0);
        let bus = format!("virtual:remote-arm-{}", BUSES.fetch_add(1, Ordering::Relaxed));
        let transport = bus::open(&bus).unwrap();
        let stop = Arc::new(AtomicBool::new(false));
        let robot = robot::read_robot(robot, &|_| None).unwrap();
        let mut parameters = ActuatorParameters::reference().aligned();
        let mut setup = Setup::of(&parameters);
        setup.configuration.limits.command_deadline = DEADLINE;
        parameters.joint.load = LoadParameters { inertia: 0.0, mass: 0.0, length: 0.0 };
        let node = |node_id: u8| {
            let options = Options { node_id, serial: node_id.into(), seed: node_id.into() };
            VirtualNode::new(parameters, &setup, &options, SlotImages::empty().unwrap()).unwrap()
        };
        let nodes = (1..=robot.tree.len() as u8).map(node).collect();
        let mut arm = VirtualArm::new(robot.tree, nodes).unwrap();
        arm.advance(4_000);
        let stopped = Arc::clone(&stop);
        let thread = std::thread::spawn(move || drop(serve(&mut arm, &*transport, &stopped)));
        Self { bus, stop, threads: vec![thread] }
    }

    /// A joint that has this stored.
    pub fn stored(folder: &std::path::Path) -> Self {
        // One test alone has such a joint.
        let bus = "virtual:remote-stored".to_owned();
        let transport = bus::open(&bus).unwrap();
        let stop = Arc::new(AtomicBool::new(false));
        let parameters = ActuatorParameters::reference().aligned().without_payload();
        let options = Options { node_id: NODE, serial: 12, seed: 1 };
        let storage = Storage::open(folder).unwrap();
        let mut joint = VirtualNode::with_storage(parameters, &Setup::of(&parameters), &options, storage).unwrap();
        joint.advance(4_000);
        let stopped = Arc::clone(&stop);
        let thread = std::thread::spawn(move || drop(serve(&mut joint, &*transport, &stopped)));
        Self { bus, stop, threads: vec![thread] }
    }

    /// Inertia of such a joint, kg m².
    pub fn inertia(&self) -> f64 {
        ActuatorParameters::reference().aligned().without_payload().joint.inertia()
    }

    pub fn bus(&self) -> &str {
        &self.bus
    }

    /// A client of its own for the first joint.
    pub fn joint(&self) -> RemoteJoint {
        self.joint_at(NODE)
    }

    /// The same for another node.
    pub fn joint_at(&self, node: u8) -> RemoteJoint {
        RemoteJoint::open_within(&self.bus, node, PATIENCE).unwrap()
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            let _ = thread.join();
        }
    }
}

/// See [`Served::slowed`].
struct Slowed {
    node: VirtualNode,
    factor: u32,
}

impl node::Served for Slowed {
    fn now(&self) -> Duration {
        self.node.now() * self.factor
    }

    fn live_until(&mut self, instant: Duration) -> Result<(), String> {
        self.node.live_until(instant / self.factor)
    }

    fn receive(&mut self, frame: &bus::Frame) {
        node::Served::receive(&mut self.node, frame);
    }

    fn take_frame(&mut self) -> Option<bus::Frame> {
        node::Served::take_frame(&mut self.node)
    }
}

/// An image with a constant friction of `level` Nm, for the joint with `serial`, 0 for any.
pub fn image(version: u32, level: f64, serial: u32) -> Vec<u8> {
    // Full scale of a constant: see the image's layout.
    let coefficients =
        Coefficients::from_array(std::array::from_fn(|i| if i == 0 { (level * 65_536.0) as i32 } else { 0 }));
    let set = ParameterSet { physical: PhysicalParameters { terms: Terms::ALL, coefficients }, network: None };
    let range = Range { low: -(100 << 16), high: 100 << 16 };
    let friction = FrictionParameters {
        domain: Domain { ranges: [range; SIGNALS], margin: 0, reference_temperature: 0 },
        selector: Selector::default(),
        common: CommonTerms::NONE,
        sets: [set, ParameterSet::default(), ParameterSet::default(), ParameterSet::default()],
    };
    let signals = [7; SIGNALS];
    let expected = FrictionModel::new(&friction, 20_000).evaluate(0, &JointState::from_signals(signals));
    let image = Image {
        version,
        target: Target { product: 0, serial },
        created: 0,
        effort: Effort::NewtonMetre,
        data_hash: [0; 16],
        friction,
        limits: Limits { output: 2 << 16, torque_gain: 1 << 15, velocity_slope: 1 << 24 },
        golden: [GoldenVector { set: 0, signals, expected }].into_iter().collect(),
    };
    let mut buffer = [0; MAX_LENGTH];
    let length = image.encode(&mut buffer).unwrap();
    buffer[..length].to_vec()
}
