//! Arguments of `jointctl sim --elf`: a board's program, as it is flashed, on an emulated board on a CAN bus.

use super::CommandError;
use super::bench::Behind;
use clap::Args;
use clap::builder::PossibleValuesParser;
use joint_firmware::default_configuration::BOARDS;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// Arguments of `sim` that put a board's program on the bus.
#[derive(Debug, Args)]
#[cfg_attr(not(feature = "emulator"), allow(dead_code, reason = "the emulator alone reads it"))]
pub struct OnBoard {
    /// Run this program of a board, as probe-rs would flash it, on an emulated board instead of a virtual joint; its
    /// log goes to the terminal. Without --storage what it stores is forgotten when it ends
    #[arg(long, value_name = "ELF", requires_all = ["bus", "board"], conflicts_with_all = ["node", "serial", "image", "config"])]
    elf: Option<PathBuf>,
    /// The board that the program is for
    #[arg(long, value_name = "BOARD", value_parser = PossibleValuesParser::new(BOARDS.map(|(name, _)| name)), requires = "elf")]
    board: Option<String>,
    /// What somebody does to the board, a command a line, from this file, or from the terminal with "-"; "help" lists
    /// the commands. Each is answered in one line
    #[arg(long, value_name = "FILE", requires = "elf")]
    commands: Option<PathBuf>,
}

impl OnBoard {
    /// Returns `true` if a program is named.
    pub const fn is_named(&self) -> bool {
        self.elf.is_some()
    }

    /// Runs the program on the bus until `stop`, with its parameters in a folder where one is named. Time that the
    /// machine was too slow for, s.
    ///
    /// # Errors
    /// The program, the commands, the storage or the bus cannot be read or opened; this `jointctl` has no emulator.
    #[cfg(feature = "emulator")]
    pub fn run(
        &self,
        bus: &str,
        behind: &Behind,
        storage: Option<&Path>,
        stop: &AtomicBool,
    ) -> Result<f64, CommandError> {
        let (Some(elf), Some(board)) = (&self.elf, &self.board) else { return Ok(0.0) };
        super::elf::run(
            elf,
            board,
            behind,
            super::elf::Bench { bus, storage, commands: self.commands.as_deref(), stop },
        )
    }

    /// Refuses, for want of the emulator.
    ///
    /// # Errors
    /// Always.
    #[cfg(not(feature = "emulator"))]
    pub fn run(&self, _: &str, _: &Behind, _: Option<&Path>, _: &AtomicBool) -> Result<f64, CommandError> {
        let remedy = "cargo run --release -p jointctl --features emulator -- sim --elf ...";
        Err(CommandError::Arguments(format!("--elf: this jointctl was compiled without the emulator; {remedy}")))
    }
}
