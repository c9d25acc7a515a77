//! A virtual joint on a bus in real time, and a foreign client that runs beside it.

use libtest_mimic::Failed;
use node::{Options, SlotImages, VirtualNode, serve};
use plant::ActuatorParameters;
use plant::virtual_joint::Setup;
use std::path::Path;
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Its node id.
pub const NODE: u8 = 5;

/// Bytes of the longest transfer.
const LONGEST: usize = 2048;
/// Joints, each with a client of its own, that share every length: most of a transfer is waiting.
const SHARES: usize = 8;

/// The joint and its bus.
pub struct Joint {
    node: VirtualNode,
    bus: Arc<dyn bus::Transport>,
}

impl Joint {
    pub fn new(bus: &str) -> Result<Self, Failed> {
        let parameters = ActuatorParameters::reference().aligned().without_payload();
        let options = Options { node_id: NODE, serial: 12, seed: 1 };
        let mut setup = Setup::of(&parameters);
        // A client on a busy machine sends nothing for longer than the 0.1 s after which the joint would brake.
        setup.configuration.limits.command_deadline = 0.5;
        let node = VirtualNode::new(parameters, &setup, &options, SlotImages::empty()?)?;
        Ok(Self { node, bus: bus::open(bus)? })
    }

    /// Runs `command` with paths of `images` and what `more` says behind its arguments, while the joint is on the bus;
    /// what it printed.
    pub fn run(
        &mut self,
        mut command: Command,
        folder: &Path,
        images: &[Vec<u8>],
        more: &[&str],
    ) -> Result<String, Failed> {
        for (number, image) in images.iter().enumerate() {
            let path = folder.join(format!("{number}.img"));
            std::fs::write(&path, image)?;
            command.arg(path);
        }
        command.args(more);
        let (node, bus, stop) = (&mut self.node, &*self.bus, AtomicBool::new(false));
        let output = std::thread::scope(|scope| {
            scope.spawn(|| serve(node, bus, &stop));
            let output = command.output();
            stop.store(true, Ordering::Relaxed);
            output
        })?;
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        match output.status.success() {
            true => Ok(text),
            false => Err(format!("{text}{}", String::from_utf8_lossy(&output.stderr)).into()),
        }
    }
}

/// Has clients with joints of their own transfer every length, a share each: `client` runs one that begins with a
/// length and goes on in steps, and says how many lengths there were.
pub fn every_length(client: impl Fn(&str, &str) -> Result<String, Failed> + Sync) -> Result<(), Failed> {
    let share = |first: usize| -> Result<usize, String> {
        let text = client(&first.to_string(), &SHARES.to_string());
        let text = text.map_err(|error| error.message().unwrap_or("failed").to_owned())?;
        text.trim().parse().map_err(|_| text)
    };
    let done = std::thread::scope(|scope| {
        let shares: Vec<_> = (1..=SHARES).map(|first| scope.spawn(move || share(first))).collect();
        shares
            .into_iter()
            .map(|share| share.join().unwrap_or_else(|_| Err("panicked".into())))
            .collect::<Result<Vec<_>, _>>()
    })?;
    match done.iter().sum::<usize>() {
        LONGEST => Ok(()),
        count => Err(format!("{count} lengths instead of {LONGEST}").into()),
    }
}
