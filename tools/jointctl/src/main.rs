//! The `jointctl` program: reads its arguments, runs one command, reports an error in one line. It ends with 0 where
//! that is done, with 1 where it failed, with 2 where the arguments are wrong, and with 3 where it is done and nothing
//! better came of it.

use clap::FromArgMatches;
use jointctl::commands::{Arguments, arguments, run};
use std::process::ExitCode;

fn main() -> ExitCode {
    let parsed = Arguments::from_arg_matches(&arguments().get_matches()).unwrap_or_else(|error| error.exit());
    match run(parsed) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(error.exit_code())
        }
    }
}
