//! `completions`: what a shell needs to complete commands and options.

use super::{CommandError, arguments};
use clap::Args;
use clap_complete::Shell;

/// Write the completions of a shell to standard output.
#[derive(Clone, Copy, Debug, Args)]
pub struct Completions {
    /// The shell
    shell: Shell,
}

impl Completions {
    pub(super) fn run(self) -> Result<(), CommandError> {
        let mut script = Vec::new();
        clap_complete::generate(self.shell, &mut arguments(), "jointctl", &mut script);
        crate::output::print(&script)
    }
}
