//! The server as a program of its own.

use crate::served::PATIENCE;
use std::io::{BufRead, BufReader};
use std::net::SocketAddr;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

/// A server before a bus; killed with this.
pub struct Program {
    pub child: Child,
    pub address: SocketAddr,
}

impl Program {
    /// The page of node 5.
    pub fn begin(bus: &str) -> Self {
        Self::with(bus, &[])
    }

    pub fn with(bus: &str, arguments: &[&str]) -> Self {
        Self::within(PATIENCE, bus, &[&["--node", "5"], arguments].concat())
    }

    /// The page of whoever is there, who may take so long for an answer.
    pub fn within(patience: Duration, bus: &str, arguments: &[&str]) -> Self {
        let patience = patience.as_millis().to_string();
        let mut child = Command::new(env!("CARGO_BIN_EXE_panel"))
            .args(["--bus", bus, "--port", "0", "--timeout", &patience])
            .args(arguments)
            .env_remove("JOINTCTL_NODE")
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
        let address = line.trim().strip_prefix("http://").unwrap().trim_end_matches('/').parse().unwrap();
        Self { child, address }
    }

    /// SIGKILL, for those who ask for it.
    #[allow(dead_code, reason = "not every program of tests kills it")]
    pub fn kill(&mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        // It may have ended already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
