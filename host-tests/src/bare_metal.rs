//! The boards' programs, built as they are flashed, those of the probe, built in the same way, and whether that is possible on this machine.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Target of both boards.
pub const TARGET: &str = "thumbv7em-none-eabihf";

/// Whether the board's target is installed.
pub fn target_installed() -> bool {
    let output = Command::new("rustc").args(["--print", "target-libdir", "--target", TARGET]).output();
    output.is_ok_and(|output| {
        let folder = String::from_utf8_lossy(&output.stdout).trim().to_owned();
        Path::new(&folder).read_dir().is_ok_and(|mut files| files.next().is_some())
    })
}

/// How a board's program is compiled.
pub struct Board {
    /// Its feature.
    pub name: &'static str,
    /// Optimisation, as in `.cargo/config.toml` and the board's own file beside it.
    pub level: &'static str,
}

/// The boards.
pub const BOARDS: [Board; 2] = [Board { name: "b-g431b-esc1", level: "s" }, Board { name: "moteus-r4", level: "2" }];

impl Board {
    /// Builds a program of `probe/src/bin` as this board's is, below a test's temporary folder; its path. `input` is a variable of the program's
    /// build, and the file that it names; `features` are the
    /// probe's.
    ///
    /// # Errors
    /// What the compiler says.
    pub fn probe(
        &self,
        program: &str,
        input: Option<(&str, &[u8])>,
        features: &[&str],
        temporary: &str,
    ) -> Result<PathBuf, String> {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("probe");
        let own = Path::new(temporary).join("probe-as").join(self.name);
        std::fs::create_dir_all(&own).map_err(|error| error.to_string())?;
        let flags =
            "-C linker=rust-lld -C link-arg=--nmagic -C target-cpu=cortex-m4 -C linker-plugin-lto -C codegen-units=1";
        let flags = format!("{flags} -C opt-level={} -C link-arg=-T{}", self.level, folder.join("link.x").display());
        let mut command = cargo();
        command.args(["build", "--profile", "board", "--bin", program, "--target", TARGET]);
        command.args(["--features", &features.join(",")]);
        command.current_dir(&folder).env("RUSTFLAGS", flags);
        if let Some((variable, bytes)) = input {
            let file = own.join(format!("{program}.bin"));
            std::fs::write(&file, bytes).map_err(|error| error.to_string())?;
            command.env(variable, file);
        }
        built(command, &format!("board/{program}"), temporary, own.join(program))
    }
}

fn cargo() -> Command {
    Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
}

/// Has cargo build a program in the folder that all programs share, so that none compiles what another has, and keeps it at `place`. One at a time: programs of
/// one name replace each other.
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
        let program = std::fs::read(shared.join(TARGET).join(program))?;
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

/// Builds a program as it is flashed, below a test's temporary folder; its path. It is called as its board, with `-bus` behind it where that is a
/// choice.
///
/// # Errors
/// What the compiler says.
pub fn build(program: &str, temporary: &str) -> Result<PathBuf, String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let folder = Path::new(temporary).join("flashed");
    std::fs::create_dir_all(&folder).map_err(|error| error.to_string())?;
    let own = format!(".cargo/{program}.toml");
    let own = root.join(&own).exists().then_some(["--config".to_owned(), own]);
    let features = program.strip_suffix("-bus").map_or(program.to_owned(), |board| format!("{board},bus"));
    let mut command = cargo();
    command.args(own.into_iter().flatten());
    command.args(["build", "--release", "-p", "joint-firmware", "--target", TARGET]);
    command.args(["--no-default-features", "--features", &features]);
    command.current_dir(root);
    // The cargo that runs the tests has set these as for the default program, and what is set cargo leaves.
    command.env_remove("DEFMT_LOG").env_remove("DEFMT_RTT_BUFFER_SIZE");
    built(command, "release/joint-firmware", temporary, folder.join(program))
}
