//! The boards' programs, built as they are flashed, those of the probe, built in the same way, and whether that is
//! possible on this machine.

use joint_firmware::default_configuration;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Target of the boards.
pub const TARGET: &str = "thumbv7em-none-eabihf";

/// Returns `true` if the board's target is installed.
pub fn target_installed() -> bool {
    let output = Command::new("rustc").args(["--print", "target-libdir", "--target", TARGET]).output();
    output.is_ok_and(|output| {
        let folder = String::from_utf8_lossy(&output.stdout).trim().to_owned();
        Path::new(&folder).read_dir().is_ok_and(|mut files| files.next().is_some())
    })
}

/// A board, and how its program is compiled: as `.cargo/config.toml` says, and the board's own file beside it where it
/// has one.
#[derive(Clone, Copy)]
pub struct Board {
    /// Its feature.
    pub name: &'static str,
    /// Parameter sets that its program has room for.
    pub parameter_sets: usize,
}

/// The boards.
pub const BOARDS: [Board; default_configuration::BOARDS.len()] = {
    let mut boards = [Board { name: "", parameter_sets: 0 }; default_configuration::BOARDS.len()];
    let mut number = 0;
    while number < boards.len() {
        let (name, board) = &default_configuration::BOARDS[number];
        boards[number] = Board { name, parameter_sets: board.parameter_sets };
        number += 1;
    }
    boards
};

impl Board {
    /// Features of the probe with which it has the room that the board's program has.
    pub fn room(&self) -> &'static [&'static str] {
        if self.parameter_sets == 1 { &["little-room"] } else { &[] }
    }

    /// Builds a program of `probe/src/bin` as this board's is, below a test's temporary folder; its path. `input` is a
    /// variable of the program's build, and the file that it names; `features` are the
    /// probe's.
    ///
    /// # Errors
    /// Messages of the compiler.
    pub fn probe(
        &self,
        program: &str,
        input: Option<(&str, &[u8])>,
        features: &[&str],
        temporary: &str,
    ) -> Result<PathBuf, String> {
        let own = Path::new(temporary).join("probe-as").join(self.name);
        std::fs::create_dir_all(&own).map_err(|error| error.to_string())?;
        let mut command = cargo(self.name);
        command.args(["build", "--release", "--bin", program, "--target", TARGET]);
        command.args(["--features", &features.join(",")]);
        command.current_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("probe"));
        if let Some((variable, bytes)) = input {
            let file = own.join(format!("{program}.bin"));
            std::fs::write(&file, bytes).map_err(|error| error.to_string())?;
            command.env(variable, file);
        }
        built(command, program, temporary, own.join(program))
    }
}

/// The checkout.
fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Cargo as it compiles a program: with its own settings beside those of all, where it has any.
fn cargo(program: &str) -> Command {
    let mut command = plain();
    let own = root().join(format!(".cargo/{program}.toml"));
    if own.exists() {
        command.arg("--config").arg(own);
    }
    command
}

/// Cargo as somebody calls it in a terminal.
fn plain() -> Command {
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    // The cargo that runs the tests has set some of these as for the default program, and what is set cargo leaves;
    // flags for the host would take the place of the target's.
    for variable in ["DEFMT_LOG", "DEFMT_RTT_BUFFER_SIZE", "RUSTFLAGS", "CARGO_ENCODED_RUSTFLAGS"] {
        command.env_remove(variable);
    }
    command
}

/// Has cargo build a program in the folder that all programs share, so that none compiles what another has, and keeps
/// it at `place`. One at a time: programs of one name replace each other.
fn built(mut command: Command, program: &str, temporary: &str, place: PathBuf) -> Result<PathBuf, String> {
    let shared = Path::new(temporary).join("programs");
    let mut build = || -> std::io::Result<Result<(), String>> {
        std::fs::create_dir_all(&shared)?;
        let turn = File::create(shared.join("turn"))?;
        turn.lock()?;
        let output = command.env("CARGO_TARGET_DIR", &shared).output()?;
        if !output.status.success() {
            return Ok(Err(String::from_utf8_lossy(&output.stderr).into_owned()));
        }
        let program = std::fs::read(shared.join(TARGET).join("release").join(program))?;
        // Somebody may be reading it.
        if std::fs::read(&place).ok().as_ref() != Some(&program) {
            let new = place.with_extension("new");
            std::fs::write(&new, program)?;
            std::fs::rename(new, &place)?;
        }
        Ok(Ok(()))
    };
    build().map_err(|error| error.to_string())??;
    Ok(place)
}

/// Builds a board's program as it is flashed, below a test's temporary folder; its path.
///
/// # Errors
/// Messages of the compiler.
pub fn build(board: &str, temporary: &str) -> Result<PathBuf, String> {
    let folder = Path::new(temporary).join("flashed");
    std::fs::create_dir_all(&folder).map_err(|error| error.to_string())?;
    let mut command = cargo(board);
    command.args(["build", "--release", "-p", "joint-firmware", "--target", TARGET]);
    command.args(["--no-default-features", "--features", board]);
    command.current_dir(root());
    built(command, "joint-firmware", temporary, folder.join(board))
}

/// Builds a board's program by a line of docs/on-the-bus.md, below a test's temporary folder; its path.
///
/// # Errors
/// A line that does not call cargo, or what the compiler says.
pub fn build_by(line: &str, board: &str, temporary: &str) -> Result<PathBuf, String> {
    let arguments = line.strip_prefix("cargo ").ok_or_else(|| format!("{line}: it does not call cargo"))?;
    let folder = Path::new(temporary).join("shown");
    std::fs::create_dir_all(&folder).map_err(|error| error.to_string())?;
    let mut command = plain();
    command.args(arguments.split_whitespace()).current_dir(root());
    built(command, "joint-firmware", temporary, folder.join(board))
}
