//! Crates of `crates/` in a project outside the workspace: its example is the project's program, on the host, and the
//! crate alone is built for the board's core. Without the target the second is reported as ignored; with `CI` set it
//! fails.

use host_tests::bare_metal::{TARGET, target_installed};
use libtest_mimic::{Arguments, Failed, Trial};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A project that depends on `crate_name` by its path alone, with the crate's example as its program and the versions
/// of the workspace; `purpose` tells its folder from those of other tests.
fn project(crate_name: &str, example: &str, purpose: &str) -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").canonicalize().unwrap();
    let source = root.join("crates").join(crate_name);
    let project = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("outside-{crate_name}-{purpose}"));
    fs::create_dir_all(project.join("src")).unwrap();
    let manifest = format!(
        "[workspace]\n[package]\nname = \"outside\"\nversion = \"0.0.0\"\nedition = \"2024\"\n\
         [dependencies]\n{crate_name} = {{ path = {source:?} }}\n"
    );
    fs::write(project.join("Cargo.toml"), manifest).unwrap();
    fs::copy(root.join("Cargo.lock"), project.join("Cargo.lock")).unwrap();
    fs::copy(source.join("examples").join(example).with_extension("rs"), project.join("src/main.rs")).unwrap();
    project
}

/// Standard output of Cargo in a project.
fn cargo(project: &Path, arguments: &[&str]) -> String {
    let output = Command::new(env!("CARGO"))
        .args(arguments)
        .current_dir(project)
        .env("CARGO_TARGET_DIR", project.join("target"))
        .env_remove("CARGO_BUILD_TARGET")
        .output()
        .unwrap();
    assert!(output.status.success(), "cargo {arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// Crate, its example, and what that prints.
const EXAMPLES: [(&str, &str, &str); 2] = [
    // Boot-up message, then 21.5 °C by SDO.
    (
        "canopen-node",
        "thermometer",
        "event: State(PreOperational)\n705 [00]\nevent: State(Operational)\n585 [4B, 00, 20, 00, D7, 00, 00, 00]\n\
         Operational\n",
    ),
    (
        "friction-compensation",
        "compensate",
        "friction is at most 6.30 Nm\n+1.0 rad/s: +2.30 Nm (NoNetwork)\n-1.0 rad/s: -2.00 Nm (NoNetwork)\n\
         +3.0 rad/s: +3.90 Nm (NoNetwork)\n+8.0 rad/s: +0.00 Nm (FarOutsideTrainedBox(Velocity))\n",
    ),
];

fn main() {
    let arguments = Arguments::from_args();
    let missing = std::env::var_os("CI").is_none() && !target_installed();
    let trials = EXAMPLES.into_iter().flat_map(|(name, example, printed)| {
        let runs = Trial::test(format!("{name}_prints_in_another_project_what_its_example_does"), move || {
            runs(name, example, printed)
        });
        let built = Trial::test(format!("{name}_of_another_project_is_built_for_the_board_s_core"), move || {
            built(name, example)
        });
        [runs, built.with_ignored_flag(missing)]
    });
    libtest_mimic::run(&arguments, trials.collect()).exit();
}

fn runs(name: &str, example: &str, expected: &str) -> Result<(), Failed> {
    let printed = cargo(&project(name, example, "run"), &["run", "--quiet", "--offline"]);
    if printed != expected { Err(printed.into()) } else { Ok(()) }
}

fn built(name: &str, example: &str) -> Result<(), Failed> {
    let project = project(name, example, "build");
    cargo(&project, &["check", "--quiet", "--offline", "-p", name, "--target", TARGET]);
    Ok(())
}
