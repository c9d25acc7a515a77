//! `man`: the manual pages.

use super::force::Force;
use super::{CommandError, arguments};
use clap::{Args, Command};
use report::output::{OutputFile, write_directory};
use std::path::PathBuf;

/// Arguments of `man`.
#[derive(Debug, Args)]
pub struct Man {
    /// Folder to write to
    folder: PathBuf,
    /// Permission to replace.
    #[command(flatten)]
    force: Force,
}

impl Man {
    /// Runs the command.
    pub fn run(&self) -> Result<(), CommandError> {
        let mut program = arguments();
        // Every command then knows the whole of its name.
        program.build();
        let mut pages = Vec::new();
        collect(&program, "jointctl", &mut pages).map_err(|source| {
            // A page is rendered into memory.
            CommandError::Arguments(source.to_string())
        })?;
        self.force.permits(pages.iter().map(|page| self.folder.join(&page.path)).collect::<Vec<_>>())?;
        write_directory(&self.folder, &pages)?;
        println!("{} pages written: {}", pages.len(), self.folder.display());
        Ok(())
    }
}

/// The pages of a command and of all below it.
fn collect(command: &Command, name: &str, pages: &mut Vec<OutputFile>) -> std::io::Result<()> {
    let mut page = Vec::new();
    clap_mangen::Man::new(command.clone()).title(name.to_uppercase()).render(&mut page)?;
    pages.push(OutputFile::new(format!("{name}.1"), page));
    let below = command.get_subcommands().filter(|command| !command.is_hide_set() && command.get_name() != "help");
    below.into_iter().try_for_each(|below| collect(below, &format!("{name}-{}", below.get_name()), pages))
}
