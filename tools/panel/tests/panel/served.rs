//! Virtual joints on a bus, and the panel's server before them.

use bus::client::Network;
use jointctl::remote::RemoteJoint;
use node::{Options, SlotImages, VirtualArm, VirtualNode, serve};
use panel::guard::Guard;
use panel::server::{Panel, Server};
use panel::skeleton::skeleton;
use plant::ActuatorParameters;
use plant::load::LoadParameters;
use plant::virtual_joint::Setup;
use rigid_body::Tree;
use robot::read_robot;
use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Longest time that anything may take: these joints run in real time, and the machine may have much else to do.
pub const PATIENCE: Duration = Duration::from_secs(60);
/// Node id of the first joint.
pub const NODE: u8 = 5;
/// Samples a second.
const RATE: f64 = 200.0;

/// A bus that nobody else has.
fn own_bus() -> String {
    static BUSES: AtomicU64 = AtomicU64::new(0);
    format!("virtual:panel-{}", BUSES.fetch_add(1, Ordering::Relaxed))
}

/// Joints that run until this is dropped.
pub struct Joints {
    pub bus: String,
    stop: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
}

impl Joints {
    /// A joint for each node id, on a bus that nobody else has.
    pub fn new(nodes: &[u8]) -> Self {
        Self::on(&own_bus(), nodes)
    }

    /// Joints of an arm, one on another.
    fn of_arm(tree: Tree, nodes: &[u8]) -> Self {
        let (bus, stop) = (own_bus(), Arc::new(AtomicBool::new(false)));
        let transport = bus::open(&bus).unwrap();
        let mut parameters = ActuatorParameters::reference().aligned();
        let mut setup = Setup::of(&parameters);
        setup.configuration.limits.command_deadline = 0.5;
        parameters.joint.load = LoadParameters { inertia: 0.0, mass: 0.0, length: 0.0 };
        let node = |(&node_id, serial): (&u8, u32)| {
            let options = Options { node_id, serial, seed: serial.into() };
            VirtualNode::new(parameters, &setup, &options, SlotImages::empty().unwrap()).unwrap()
        };
        let mut arm = VirtualArm::new(tree, nodes.iter().zip(12..).map(node).collect()).unwrap();
        arm.advance(4_000);
        let stopped = Arc::clone(&stop);
        let thread = std::thread::spawn(move || drop(serve(&mut arm, &*transport, &stopped)));
        Self { bus, stop, threads: vec![thread] }
    }

    pub fn on(bus: &str, nodes: &[u8]) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let threads = nodes.iter().zip(12..).map(|(&node_id, serial)| {
            let transport = bus::open(bus).unwrap();
            let stop = Arc::clone(&stop);
            let parameters = ActuatorParameters::reference().aligned().without_payload();
            // The machine is late for some of them at times.
            let mut setup = Setup::of(&parameters);
            setup.configuration.limits.command_deadline = 0.5;
            let options = Options { node_id, serial, seed: 1 };
            let mut joint = VirtualNode::new(parameters, &setup, &options, SlotImages::empty().unwrap()).unwrap();
            // The current sensors' offsets are measured before anybody asks.
            joint.advance(4_000);
            // A bus that is gone is what some tests are about.
            std::thread::spawn(move || drop(serve(&mut joint, &*transport, &stop)))
        });
        let threads = threads.collect();
        Self { bus: bus.into(), stop, threads }
    }

    /// A client of its own for the first joint.
    pub fn joint(&self) -> RemoteJoint {
        RemoteJoint::open_within(&self.bus, NODE, PATIENCE).unwrap()
    }
}

impl Drop for Joints {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            let _ = thread.join();
        }
    }
}

/// Joints with a server before them.
pub struct Served {
    // Dropped first: it says good-bye to the joints.
    server: Option<Server>,
    pub address: SocketAddr,
    pub joints: Joints,
}

impl Served {
    pub fn joints(nodes: &[u8]) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let guard = Guard::new(listener.local_addr().unwrap(), Instant::now()).unwrap();
        Self::guarded(nodes, listener, guard)
    }

    /// The arm of `tools/jointctl/robots`, with these nodes.
    pub fn arm(nodes: &[u8]) -> Self {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../jointctl/robots/arm/robot.toml");
        let robot = read_robot(path.as_ref(), &|_| None).unwrap();
        let told = skeleton(&robot, nodes).unwrap();
        let joints = Joints::of_arm(robot.tree, nodes);
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        let guard = Guard::new(address, Instant::now()).unwrap();
        let network = Network::new(bus::open(&joints.bus).unwrap()).with_patience(PATIENCE);
        let panel = Panel::new(&network, NODE, None, RATE, guard, |_| {}).with_robot(told);
        Self { server: Some(Server::begin(listener, panel).unwrap()), address, joints }
    }

    pub fn guarded(nodes: &[u8], listener: TcpListener, guard: Guard) -> Self {
        let joints = Joints::new(nodes);
        let address = listener.local_addr().unwrap();
        let network = Network::new(bus::open(&joints.bus).unwrap()).with_patience(PATIENCE);
        let panel = Panel::new(&network, NODE, None, RATE, guard, |_| {});
        Self { server: Some(Server::begin(listener, panel).unwrap()), address, joints }
    }

    /// Ends the server alone.
    pub fn end(&mut self) {
        self.server.take();
    }
}
