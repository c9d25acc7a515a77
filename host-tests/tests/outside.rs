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

/// What Cargo prints on standard output in a project.
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

fn main() {
    let arguments = Arguments::from_args();
    let missing = std::env::var_os("CI").is_none() && !target_installed();
    let trials = vec![
        Trial::test("a_node_of_another_project_answers_as_its_example_says", answers),
        Trial::test("a_node_of_another_project_is_built_for_the_board_s_core", built).with_ignored_flag(missing),
    ];
    libtest_mimic::run(&arguments, trials).exit();
}

fn answers() -> Result<(), Failed> {
    let printed = cargo(&project("canopen-node", "thermometer", "run"), &["run", "--quiet", "--offline"]);
    // Boot-up message, then 21.5 °C by SDO.
    let expected = "event: State(PreOperational)\n705 [00]\nevent: State(Operational)\n\
                    585 [4B, 00, 20, 00, D7, 00, 00, 00]\nOperational\n";
    if printed != expected {
        return Err(printed.into());
    }
    Ok(())
}

fn built() -> Result<(), Failed> {
    let project = project("canopen-node", "thermometer", "build");
    cargo(&project, &["check", "--quiet", "--offline", "-p", "canopen-node", "--target", TARGET]);
    Ok(())
}
