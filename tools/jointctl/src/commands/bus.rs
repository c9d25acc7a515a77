//! `jointctl sim --bus` and `jointctl scan`: virtual joints on a CAN bus, and who is there.

use super::CommandError;
use super::arm::Arm;
use super::remote::Patience;
use crate::remote::present::{PATIENCE, present};
use bus::client::{ClientError, Node};
use canopen_node::NO_NODE_ID;
use clap::Args;
use friction_compensation::parameters::image::Image;
use node::{Options, Storage, VirtualArm, VirtualNode, serve};
use plant::ActuatorParameters;
use plant::virtual_joint::Setup;
use serde_json::json;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Serial number of the first joint that has no node id.
const WITHOUT_ID: u32 = 1_000;

/// Arguments of `sim` that put the joint on a bus.
#[derive(Debug, Args)]
pub struct OnBus {
    /// Be a node on this bus instead of running scenarios, until Ctrl-C: socketcan:can0, slcan:/dev/ttyACM0,
    /// slcan:tcp://host:port, slcan:listen://host:port, udp:239.74.163.2:43113
    #[arg(long, value_name = "BUS")]
    bus: Option<String>,
    /// Node id on the bus, 1 to 127, or 255 for one that LSS has to give; repeatable, a joint each [default: 1; with
    /// --robot 1, 2 and so on]
    #[arg(long, value_name = "N", requires = "bus")]
    node: Vec<u8>,
    /// Serial number of the first joint, the others count up [default: the node id; without one, 1000 and up]
    #[arg(long, value_name = "N", requires = "bus")]
    serial: Option<u32>,
    /// Keep what the joints store in this folder, one below it for each serial number, and what an emulated board's
    /// program stores in a file for the board; without it they forget everything when they leave
    #[arg(long, value_name = "DIR", requires = "bus")]
    storage: Option<PathBuf>,
    /// Leave the bus after this time, s
    #[arg(long, value_name = "S", requires = "bus")]
    duration: Option<f64>,
}

impl OnBus {
    /// The bus, where one is named.
    pub fn bus(&self) -> Option<&str> {
        self.bus.as_deref()
    }

    /// The folder of what is stored, where one is named.
    pub fn storage(&self) -> Option<&Path> {
        self.storage.as_deref()
    }

    fn duration(&self) -> Result<Option<Duration>, CommandError> {
        match self.duration {
            Some(seconds) if !(seconds > 0.0 && seconds < 1e6) => {
                Err(CommandError::Arguments(format!("--duration is {seconds} s, must lie in 0 to 1000000 s")))
            }
            seconds => Ok(seconds.map(Duration::from_secs_f64)),
        }
    }

    /// Does something on the bus until its time is over; `work` says what time the machine was too slow for, s.
    pub fn until_the_end(
        &self,
        work: impl FnOnce(&AtomicBool) -> Result<f64, CommandError> + Send,
    ) -> Result<(), CommandError> {
        let (duration, stop) = (self.duration()?, AtomicBool::new(false));
        let lost = std::thread::scope(|scope| {
            let working = scope.spawn(|| {
                let outcome = work(&stop);
                stop.store(true, Ordering::Relaxed);
                outcome
            });
            wait(duration, &stop);
            working.join().unwrap_or_else(|_| Err(CommandError::Bus("the node panicked".into())))
        })?;
        if lost > 0.0 {
            eprintln!("{lost:.1} s were lost, this machine is too slow for real time");
        }
        Ok(())
    }

    /// Runs a joint for every node id in real time.
    pub fn run(
        &self,
        name: &str,
        plant: &ActuatorParameters,
        setup: &Setup,
        image: Option<&Image>,
    ) -> Result<(), CommandError> {
        let duration = self.duration()?;
        let stop = AtomicBool::new(false);
        let failed = |error: &dyn std::fmt::Display| CommandError::Bus(error.to_string());
        std::thread::scope(|scope| {
            let mut joints = Vec::new();
            let nodes = if self.node.is_empty() { &[1][..] } else { &self.node };
            for (&id, place) in nodes.iter().zip(0..) {
                let transport = bus::open(name).map_err(|error| failed(&error))?;
                let options = self.options(id, place);
                let mut joint = self.joint(plant, setup, &options, image)?;
                eprintln!("{}", introduced(name, "virtual joint", &options));
                let stop = &stop;
                joints.push(scope.spawn(move || {
                    let left = serve(&mut joint, &*transport, stop);
                    stop.store(true, Ordering::Relaxed);
                    left
                }));
            }
            wait(duration, &stop);
            for (joint, id) in joints.into_iter().zip(nodes) {
                match joint.join() {
                    Ok(Ok(lost)) if lost > 0.0 => {
                        eprintln!("node {id}: {lost:.1} s were lost, this machine is too slow for real time");
                    }
                    Ok(Ok(_)) => {}
                    Ok(Err(error)) => return Err(failed(&error)),
                    Err(_) => return Err(CommandError::Bus(format!("node {id} panicked"))),
                }
            }
            Ok(())
        })
    }
}

impl OnBus {
    /// Runs the joints of an arm in real time, in the order of its tree's.
    pub fn run_arm(&self, name: &str, arm: Arm) -> Result<(), CommandError> {
        let nodes = match (self.node.len(), arm.joints.len()) {
            (0, joints) => (1..=joints as u8).collect(),
            (nodes, joints) if nodes == joints => self.node.clone(),
            (nodes, joints) => {
                let text = format!("the robot has {joints} joints, --node is given {nodes} times");
                return Err(CommandError::Arguments(text));
            }
        };
        let failed = |error: &dyn std::fmt::Display| CommandError::Bus(error.to_string());
        let transport = bus::open(name).map_err(|error| failed(&error))?;
        let mut joints = Vec::new();
        for ((joint, &id), place) in arm.joints.iter().zip(&nodes).zip(0..) {
            let options = self.options(id, place);
            joints.push(self.joint(&joint.plant, &joint.setup, &options, None)?);
            eprintln!("{}", introduced(name, &joint.name, &options));
        }
        let mut arm = VirtualArm::new(arm.tree, joints)
            .and_then(|made| made.with_pairs(arm.pairs))
            .map_err(|error| failed(&error))?;
        self.until_the_end(|stop| serve(&mut arm, &*transport, stop).map_err(|error| failed(&error)))
    }

    /// Options of the joint at a place.
    fn options(&self, node_id: u8, place: u32) -> Options {
        // Joints without node ids are told apart by their serial numbers alone.
        let serial = match self.serial {
            Some(first) => first.wrapping_add(place),
            None if node_id == NO_NODE_ID => WITHOUT_ID + place,
            None => node_id.into(),
        };
        Options { node_id, serial, seed: serial.into() }
    }

    /// A joint with what it has stored before. An image that is given comes first, as if it had been committed.
    fn joint(
        &self,
        plant: &ActuatorParameters,
        setup: &Setup,
        options: &Options,
        image: Option<&Image>,
    ) -> Result<VirtualNode, CommandError> {
        let failed = |error: &dyn std::fmt::Display| CommandError::Bus(error.to_string());
        let mut storage = match &self.storage {
            Some(folder) => {
                let folder = folder.join(format!("serial-{}", options.serial));
                Storage::open(&folder).map_err(|error| failed(&format_args!("{}: {error}", folder.display())))?
            }
            None => Storage::empty().map_err(|error| failed(&error))?,
        };
        if let Some(image) = image {
            let mut buffer = [0; friction_compensation::parameters::image::MAX_LENGTH];
            // It has been verified, which encodes it.
            let length = image.encode(&mut buffer).unwrap_or(0);
            storage.store_image(&buffer[..length]).map_err(|error| failed(&error))?;
        }
        VirtualNode::with_storage(*plant, setup, options, storage).map_err(|error| failed(&error))
    }
}

fn introduced(bus: &str, joint: &str, options: &Options) -> String {
    match options.node_id {
        NO_NODE_ID => format!("{bus}: {joint} without a node id, serial {}", options.serial),
        id => format!("node {id} on {bus}: {joint}, serial {}", options.serial),
    }
}

/// Waits until somebody stops, or a time is over, and stops then.
fn wait(duration: Option<Duration>, stop: &AtomicBool) {
    let start = Instant::now();
    while !stop.load(Ordering::Relaxed) && duration.is_none_or(|duration| start.elapsed() < duration) {
        std::thread::sleep(Duration::from_millis(20));
    }
    stop.store(true, Ordering::Relaxed);
}

/// Arguments of `scan`.
#[derive(Debug, Args)]
pub struct Scan {
    /// The bus, as of `sim --bus`
    #[arg(long, value_name = "BUS", env = "JOINTCTL_BUS")]
    bus: String,
    /// Print a JSON array, an object for each node
    #[arg(long)]
    json: bool,
    /// How long to listen for an answer, and for each further one, ms: longer for nodes on a busy machine
    #[arg(long, value_name = "MS", default_value_t = PATIENCE.as_millis() as u64)]
    wait: u64,
    /// How long each that is there may take.
    #[command(flatten)]
    patience: Patience,
}

impl Scan {
    /// Runs the command.
    pub fn run(&self) -> Result<(), CommandError> {
        let failed = |error: &dyn std::fmt::Display| CommandError::Bus(error.to_string());
        let network = self.patience.network(&self.bus)?;
        let wait = Duration::from_millis(self.wait.clamp(1, 60_000));
        let present = present(&network, wait).map_err(|error| failed(&error))?;
        let mut list = Vec::new();
        for &id in &present {
            match network.node(id).and_then(|node| Described::of(&node)) {
                Ok(described) if self.json => list.push(described.json(id)),
                Ok(described) => println!("node {id}: {described}"),
                Err(error @ ClientError::Bus(_)) => return Err(failed(&error)),
                Err(error) if self.json => list.push(json!({ "node": id, "error": error.to_string() })),
                Err(error) => println!("node {id}: {error}"),
            }
        }
        if self.json {
            println!("{:#}", serde_json::Value::Array(list));
        }
        if present.is_empty() {
            return Err(CommandError::Bus(format!("{}: no node answered", self.bus)));
        }
        Ok(())
    }
}

/// Description of a node, as it says itself.
struct Described {
    name: String,
    product: u32,
    serial: u32,
    statusword: u16,
    version: u32,
}

impl Described {
    fn of(node: &Node) -> Result<Self, ClientError> {
        let word = |index, sub_index| node.number::<4>(index, sub_index).map(u32::from_le_bytes);
        Ok(Self {
            product: word(0x1018, 2)?,
            serial: word(0x1018, 4)?,
            name: String::from_utf8_lossy(&node.upload(0x1008, 0)?).into_owned(),
            statusword: node.number::<2>(0x6041, 0).map(u16::from_le_bytes)?,
            version: word(0x2213, 1)?,
        })
    }

    fn json(&self, node: u8) -> serde_json::Value {
        let Self { name, product, serial, statusword, version } = self;
        json!({
            "node": node,
            "name": name,
            "product": product,
            "serial": serial,
            "statusword": statusword,
            "image_version": version
        })
    }
}

impl std::fmt::Display for Described {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { name, product, serial, statusword, version } = self;
        write!(f, "{name}; product {product:08x}, serial {serial}, statusword {statusword:04x}, ")?;
        match version {
            0 => f.write_str("no friction image"),
            version => write!(f, "friction image version {version}"),
        }
    }
}
