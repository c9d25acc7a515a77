//! The `jointctl` program: reads its arguments, runs one command, reports an error in one line.

use clap::Parser;
use jointctl::commands::{Arguments, run};
use std::process::ExitCode;

fn main() -> ExitCode {
    match run(Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}
