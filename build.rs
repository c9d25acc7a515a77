//! Gives the linker the memory of the chosen board. Does nothing for the host, nor for the library alone.

use std::env;
use std::fs;
use std::path::PathBuf;

/// A board's Cargo feature, as the build script sees it, its memory, and the level of optimisation that its program needs to fit there.
struct Board {
    feature: &'static str,
    name: &'static str,
    memory: &'static str,
    level: Option<&'static str>,
}

const BOARDS: [Board; 2] = [
    Board {
        feature: "CARGO_FEATURE_B_G431B_ESC1",
        name: "b-g431b-esc1",
        memory: "src/board/b_g431b_esc1.x",
        level: Some("opt-level=z"),
    },
    Board { feature: "CARGO_FEATURE_MOTEUS_R4", name: "moteus-r4", memory: "src/board/moteus_r4.x", level: None },
];

/// Sections of every board; in each of them the first match counts.
const SECTIONS: [&str; 2] = ["src/board/preparation.x", "src/board/sections.x"];

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=memory.x");
    println!("cargo:rerun-if-changed=src/board");
    if env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("none") {
        return;
    }
    let mut chosen = BOARDS.iter().filter(|board| env::var_os(board.feature).is_some());
    // None is a build of the library; main.rs refuses it for the program.
    let Some(board) = chosen.next() else { return };
    if chosen.next().is_some() {
        // main.rs says the same, but embassy's chip crate fails before that is compiled.
        eprintln!("two boards are chosen: for the moteus r4 build with `--no-default-features --features moteus-r4`");
        std::process::exit(1);
    }
    let flags = env::var("CARGO_ENCODED_RUSTFLAGS").unwrap_or_default();
    if board.level.is_some_and(|level| !flags.contains(level)) {
        // A check or a lint does without, so this is no error; the linker's would be "section will not fit in region".
        let name = board.name;
        println!(
            "cargo:warning=the program of the {name} fits its chip with its own flags only: cargo --config .cargo/{name}.toml ..."
        );
    }
    let read = |name: &&str| fs::read_to_string(name).expect(name);
    let memory: String = [board.memory].iter().chain(&SECTIONS).map(read).collect();
    let folder = PathBuf::from(env::var_os("OUT_DIR").expect("OUT_DIR"));
    // memory.x includes it.
    fs::write(folder.join("board.x"), memory).expect("board.x");
    println!("cargo:rustc-link-search={}", folder.display());
    // Here and not in .cargo/config.toml: other programs for this target have scripts of their own.
    for script in ["link.x", "defmt.x"] {
        println!("cargo:rustc-link-arg-bins=-T{script}");
    }
}
