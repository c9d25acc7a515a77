//! `completions`: what a shell needs to complete commands and options.

use super::{CommandError, arguments};
use clap::Args;
use clap_complete::Shell;
use std::io::Write;

/// Arguments of `completions`.
#[derive(Clone, Copy, Debug, Args)]
pub struct Completions {
    /// The shell
    shell: Shell,
}

impl Completions {
    /// Runs the command.
    pub fn run(self) -> Result<(), CommandError> {
        let mut script = Vec::new();
        clap_complete::generate(self.shell, &mut arguments(), "jointctl", &mut script);
        // A reader that closes the pipe, as `head` does, has seen enough.
        let _ = std::io::stdout().write_all(&script);
        Ok(())
    }
}
