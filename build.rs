//! Gives the linker the memory of the chosen board. Does nothing for the host, nor for the library alone.

use std::env;
use std::fs;
use std::path::PathBuf;

/// Cargo feature and file of each board.
const BOARDS: [(&str, &str); 2] =
    [("CARGO_FEATURE_B_G431B_ESC1", "b_g431b_esc1.x"), ("CARGO_FEATURE_MOTEUS_R4", "moteus_r4.x")];

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=src/board");
    if env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("none") {
        return;
    }
    let mut chosen = BOARDS.iter().filter(|(feature, _)| env::var_os(feature).is_some());
    // None is a build of the library; main.rs refuses it for the program.
    let Some((_, board)) = chosen.next() else { return };
    if chosen.next().is_some() {
        // main.rs says the same, but embassy's chip crate fails before that is compiled.
        eprintln!("two boards are chosen: for the moteus r4 build with `--no-default-features --features moteus-r4`");
        std::process::exit(1);
    }
    // In each of them the first match counts.
    let files: &[&str] = match (*board, env::var_os("CARGO_FEATURE_BUS")) {
        // With the bus the smaller chip's memory is divided in another way.
        ("b_g431b_esc1.x", Some(_)) => &["b_g431b_esc1_bus.x", "preparation.x", "sections.x"],
        (board, _) => &[board, "preparation.x", "seldom.x", "sections.x"],
    };
    let read = |name: &&str| fs::read_to_string(PathBuf::from("src/board").join(name)).expect(name);
    let memory: String = files.iter().map(read).collect();
    let folder = PathBuf::from(env::var_os("OUT_DIR").expect("OUT_DIR"));
    fs::write(folder.join("memory.x"), memory).expect("memory.x");
    println!("cargo:rustc-link-search={}", folder.display());
    // Here and not in .cargo/config.toml: other programs for this target have scripts of their own.
    for script in ["link.x", "defmt.x"] {
        println!("cargo:rustc-link-arg-bins=-T{script}");
    }
}
