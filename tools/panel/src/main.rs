//! The `panel` program: opens a bus, serves the page of a joint on this machine until Ctrl-C, and says where it is.

use bus::client::Network;
use clap::Parser;
use friction_compensation::parameters::authentication::Key;
use jointctl::key_file;
use jointctl::remote::RemoteError;
use jointctl::remote::present::{PATIENCE, present};
use panel::guard::Guard;
use panel::scan;
use panel::server::{Panel, Server};
use panel::skeleton::skeleton;
use robot::read_robot;
use serde_json::Value;
use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// Lines as one types them.
const EXAMPLES: &str = "Examples:
  panel --bus socketcan:can0 --node 5
  panel --bus udp:239.74.163.2:43113 --key joint.key --port 0
  panel --bus socketcan:can0 --robot robot.toml --joints 5,6,7
  panel --bus socketcan:can0 --listen 192.168.1.20:8402";

/// SYNCs a second: least and most.
const RATES: [f64; 2] = [1.0, 1_000.0];

fn rate(text: &str) -> Result<f64, String> {
    let [low, high] = RATES;
    let wanted = text.parse::<f64>().ok().filter(|rate| (low..=high).contains(rate));
    wanted.ok_or_else(|| format!("must lie in {low} to {high} Hz"))
}

/// A live page for a joint on a bus
#[derive(Debug, Parser)]
#[command(version, after_help = EXAMPLES)]
struct Arguments {
    /// The bus: socketcan:can0, slcan:/dev/ttyACM0, slcan:tcp://host:port, udp:239.74.163.2:43113
    #[arg(long, value_name = "BUS", env = "JOINTCTL_BUS")]
    bus: String,
    /// Node id of the joint that the page begins with, 1 to 127 [default: the lowest that answers]
    #[arg(long, value_name = "N", env = "JOINTCTL_NODE", value_parser = clap::value_parser!(u8).range(1..=127))]
    node: Option<u8>,
    /// Robot that the joints belong to (docs/robot.md): drawn as it moves, and all of its joints beside the page's own
    #[arg(long, value_name = "TOML")]
    robot: Option<PathBuf>,
    /// Node ids of the robot's joints, in the URDF's order [default: 1, 2 and so on]
    #[arg(long, value_name = "N,N...", value_delimiter = ',', requires = "robot",
        value_parser = clap::value_parser!(u8).range(1..=127))]
    joints: Vec<u8>,
    /// The joint's key, where it has one
    #[arg(long, value_name = "FILE", env = "JOINTCTL_KEY")]
    key: Option<PathBuf>,
    /// How long a node may take to answer, ms
    #[arg(long, value_name = "MS", default_value_t = 1_000, env = "JOINTCTL_TIMEOUT",
        value_parser = clap::value_parser!(u64).range(10..=600_000))]
    timeout: u64,
    /// Samples a second, 1 to 1000
    #[arg(long, value_name = "HZ", default_value_t = 200.0, value_parser = rate)]
    rate: f64,
    /// Port on this machine; 0 takes one that is free
    #[arg(long, value_name = "PORT", default_value_t = 8402, conflicts_with = "listen")]
    port: u16,
    /// Another address of this machine, with its port, for browsers elsewhere. The page then wants a token that can be
    /// used once. Without encryption: for networks that you trust
    #[arg(long, value_name = "ADDRESS:PORT")]
    listen: Option<SocketAddr>,
}

fn read_key(arguments: &Arguments) -> Result<Option<Key>, String> {
    arguments.key.as_deref().map(key_file::read).transpose().map_err(|error| error.to_string())
}

fn announce(address: &str) {
    println!("{address}");
}

/// Reason for which the program ends, with the exit codes of `jointctl`.
#[derive(Debug)]
enum Ended {
    /// Wrong arguments.
    Usage(String),
    Failed(String),
}

impl From<String> for Ended {
    fn from(reason: String) -> Self {
        Self::Failed(reason)
    }
}

impl From<RemoteError> for Ended {
    fn from(error: RemoteError) -> Self {
        if error.is_usage() { Self::Usage(error.to_string()) } else { Self::Failed(error.to_string()) }
    }
}

/// The robot, where one is named.
fn robot(arguments: &Arguments) -> Result<Option<Value>, Ended> {
    let Some(path) = &arguments.robot else { return Ok(None) };
    let robot = read_robot(path, &|name| std::env::var(name).ok()).map_err(|error| error.to_string())?;
    let nodes = match arguments.joints.as_slice() {
        [] => (1..=robot.tree.len().min(127) as u8).collect(),
        named => named.to_vec(),
    };
    skeleton(&robot, &nodes).map(Some).map_err(Ended::Usage)
}

/// The lowest node that answers; where none does and a joint waits for its node id, the one that the page offers it.
fn first(network: &Network, bus: &str) -> Result<u8, Ended> {
    if let Some(node) = present(network, PATIENCE).map_err(RemoteError::from)?.first() {
        return Ok(*node);
    }
    if scan::waits(network).map_err(RemoteError::from)? {
        eprintln!("no node answers on {bus}, but a joint without a node id does: Board, Give node ids");
        return Ok(scan::OFFERED);
    }
    Err(Ended::Failed(format!("no node answers on {bus}")))
}

fn begin(arguments: &Arguments) -> Result<Server, Ended> {
    let key = read_key(arguments)?;
    let robot = robot(arguments)?;
    let transport = bus::open(&arguments.bus).map_err(RemoteError::from)?;
    let network = Network::new(transport).with_patience(Duration::from_millis(arguments.timeout));
    let node = match arguments.node {
        Some(node) => node,
        None => first(&network, &arguments.bus)?,
    };
    let wanted = arguments.listen.unwrap_or_else(|| (Ipv4Addr::LOCALHOST, arguments.port).into());
    let listener = TcpListener::bind(wanted).map_err(|error| format!("{wanted}: {error}"))?;
    let address = listener.local_addr().map_err(|error| format!("{wanted}: {error}"))?;
    let guard = Guard::new(address, Instant::now()).map_err(|error| error.to_string())?;
    announce(&guard.address());
    let panel = Panel::new(&network, node, key, arguments.rate, guard, announce);
    let panel = match robot {
        Some(robot) => panel.with_robot(robot),
        None => panel,
    };
    Server::begin(listener, panel).map_err(|error| Ended::Failed(error.to_string()))
}

/// Waits for Ctrl-C or termination.
fn wait() -> Result<(), String> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    let waited = runtime.and_then(|runtime| {
        runtime.block_on(async {
            #[cfg(unix)]
            {
                let mut terminated = tokio::signal::unix::signal(tokio::signal::unix::SignalKind::terminate())?;
                tokio::select! {
                    interrupted = tokio::signal::ctrl_c() => interrupted,
                    _ = terminated.recv() => Ok(()),
                }
            }
            #[cfg(not(unix))]
            tokio::signal::ctrl_c().await
        })
    });
    waited.map_err(|error| format!("Ctrl-C cannot be caught: {error}"))
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    // Dropped at the end: pages are disconnected, and the joint is stopped.
    let ended = begin(&arguments).and_then(|_server| Ok(wait()?));
    let (reason, code) = match ended {
        Ok(()) => return ExitCode::SUCCESS,
        Err(Ended::Failed(reason)) => (reason, 1),
        Err(Ended::Usage(reason)) => (reason, 2),
    };
    eprintln!("error: {reason}");
    ExitCode::from(code)
}

#[cfg(test)]
mod tests {
    use super::{Arguments, EXAMPLES, rate};
    use clap::{CommandFactory, Parser};

    #[test]
    fn the_help_ends_with_examples_that_are_valid() {
        let help = Arguments::command().render_help().to_string();
        assert!(help.trim_end().ends_with(EXAMPLES), "{help}");
        let lines: Vec<&str> = EXAMPLES.lines().skip(1).collect();
        assert!(!lines.is_empty());
        for line in lines {
            let words = line.split_whitespace();
            Arguments::try_parse_from(words).unwrap_or_else(|error| panic!("{line}: {error}"));
        }
    }

    #[test]
    fn rates_end_where_they_say() {
        assert_eq!((rate("1"), rate("1000")), (Ok(1.0), Ok(1_000.0)));
        for text in ["0.999", "1000.1", "nan", "fast", ""] {
            assert_eq!(rate(text), Err("must lie in 1 to 1000 Hz".into()), "{text}");
        }
    }
}
