//! Gives the linker the memory of the chosen board. Does nothing for the host, nor for the library alone.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};

/// Folder of the boards, with the memory of each in a file of its name.
const BOARDS: &str = "src/board";

/// Sections of every board; in each of them the first match counts.
const SECTIONS: [&str; 2] = ["src/board/preparation.x", "src/board/sections.x"];

/// Returns `true` if a file is the memory of a board whose feature is chosen.
fn is_chosen(file: &Path) -> bool {
    let name = file.file_stem().unwrap_or_default().to_string_lossy().to_uppercase();
    file.extension().is_some_and(|extension| extension == "x") && env::var_os(format!("CARGO_FEATURE_{name}")).is_some()
}

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=memory.x");
    println!("cargo:rerun-if-changed=src/board");
    if env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("none") {
        return;
    }
    let files = fs::read_dir(BOARDS).expect(BOARDS).map(|file| file.expect(BOARDS).path());
    let mut chosen = files.filter(|file| is_chosen(file));
    // None is a build of the library; main.rs refuses it for the program.
    let Some(memory) = chosen.next() else { return };
    if chosen.next().is_some() {
        eprintln!("two boards are chosen: for the moteus r4 build with `--no-default-features --features moteus-r4`");
        std::process::exit(1);
    }
    let sections = SECTIONS.iter().map(PathBuf::from);
    let read = |path: PathBuf| fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let memory: String = [memory].into_iter().chain(sections).map(read).collect();
    let folder = PathBuf::from(env::var_os("OUT_DIR").expect("OUT_DIR"));
    // memory.x includes it.
    fs::write(folder.join("board.x"), memory).expect("board.x");
    println!("cargo:rustc-link-search={}", folder.display());
    // Here and not in .cargo/config.toml: other programs for this target have scripts of their own.
    for script in ["link.x", "defmt.x"] {
        println!("cargo:rustc-link-arg-bins=-T{script}");
    }
}
