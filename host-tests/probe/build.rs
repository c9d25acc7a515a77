//! Gives the linker the memory of the programs: here and not among the flags, so that what they link is compiled with
//! the same flags as for the boards.

fn main() {
    println!("cargo:rerun-if-changed=link.x");
    println!("cargo:rustc-link-arg-bins=-T{}/link.x", std::env::var("CARGO_MANIFEST_DIR").expect("CARGO_MANIFEST_DIR"));
}
