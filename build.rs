//! Gives the linker the memory of the chosen board. Does nothing for the host, nor for the library alone.

use std::env;
use std::fs;
use std::path::PathBuf;

/// Cargo feature and memory of each board.
const BOARDS: [(&str, &str); 2] =
    [("CARGO_FEATURE_B_G431B_ESC1", "src/board/b_g431b_esc1.x"), ("CARGO_FEATURE_MOTEUS_R4", "src/board/moteus_r4.x")];

/// Sections of every board; in each of them the first match counts.
const SECTIONS: [&str; 2] = ["src/board/preparation.x", "src/board/sections.x"];

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=memory.x");
    println!("cargo:rerun-if-changed=src/board");
    if env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("none") {
        return;
    }
    let mut chosen = BOARDS.iter().filter(|(feature, _)| env::var_os(feature).is_some());
    // None is a build of the library; main.rs refuses it for the program.
    let Some((_, memory)) = chosen.next() else { return };
    if chosen.next().is_some() {
        // main.rs says the same, but embassy's chip crate fails before that is compiled.
        eprintln!("two boards are chosen: for the moteus r4 build with `--no-default-features --features moteus-r4`");
        std::process::exit(1);
    }
    let read = |name: &&str| fs::read_to_string(name).expect(name);
    let memory: String = [*memory].iter().chain(&SECTIONS).map(read).collect();
    let folder = PathBuf::from(env::var_os("OUT_DIR").expect("OUT_DIR"));
    // memory.x includes it.
    fs::write(folder.join("board.x"), memory).expect("board.x");
    println!("cargo:rustc-link-search={}", folder.display());
    // Here and not in .cargo/config.toml: other programs for this target have scripts of their own.
    for script in ["link.x", "defmt.x"] {
        println!("cargo:rustc-link-arg-bins=-T{script}");
    }
}
