//! The `jointctl` program: reads its arguments, runs one command, reports an error in one line. It ends with 0 where that is done, with 1 where it failed, with 2 where
//! the arguments are wrong, and with 3 where it is done and nothing better came of it.

use clap::Parser;
use jointctl::commands::{Arguments, run};
use std::process::ExitCode;

fn main() -> ExitCode {
    match run(Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(error.exit_code())
        }
    }
}
