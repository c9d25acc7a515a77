//! The boards' programs, built as they are flashed, and whether that is possible on this machine.

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

/// Builds a program as it is flashed, below a test's temporary folder; its path. It is called as its board, with `-bus` behind it where that is a
/// choice.
///
/// # Errors
/// What the compiler says.
pub fn build(program: &str, temporary: &str) -> Result<PathBuf, String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let target = Path::new(temporary).join("boards").join(program);
    let own = format!(".cargo/{program}.toml");
    let own = root.join(&own).exists().then_some(["--config".to_owned(), own]);
    let features = program.strip_suffix("-bus").map_or(program.to_owned(), |board| format!("{board},bus"));
    let output = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
        .args(own.into_iter().flatten())
        .args(["build", "--release", "-p", "joint-firmware", "--target", TARGET])
        .args(["--no-default-features", "--features", &features])
        .current_dir(root)
        .env("CARGO_TARGET_DIR", &target)
        .output();
    let output = output.map_err(|error| error.to_string())?;
    if !output.status.success() {
        return Err(String::from_utf8_lossy(&output.stderr).into_owned());
    }
    Ok(target.join(TARGET).join("release/joint-firmware"))
}
