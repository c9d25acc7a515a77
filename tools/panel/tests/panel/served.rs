//! Virtual joints on a bus, and the panel's server before them.

use bus::client::Network;
use jointctl::remote::RemoteJoint;
use node::{Options, SlotImages, VirtualNode, serve};
use panel::guard::Guard;
use panel::server::{Panel, Server};
use plant::ActuatorParameters;
use plant::virtual_joint::Setup;
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

/// Joints that run until this is dropped.
pub struct Joints {
    pub bus: String,
    stop: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
}

impl Joints {
    /// A joint for each node id, on a bus that nobody else has.
    pub fn new(nodes: &[u8]) -> Self {
        static BUSES: AtomicU64 = AtomicU64::new(0);
        Self::on(&format!("virtual:panel-{}", BUSES.fetch_add(1, Ordering::Relaxed)), nodes)
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
