//! The library on the board's core: it links no panic and no floating-point library, and gives the host's bits.

#[path = "../../probe/src/sequence.rs"]
mod sequence;

use crate::Missing;
use emulator::cpu::End;
use emulator::memory::Memory;
use emulator::program::Program;
use friction_compensation::parameters::certificate::{Limits, prove};
use host_tests::bare_metal::TARGET;
use host_tests::image_bytes::encoded;
use host_tests::parameters::{image, tame};
use libtest_mimic::{Failed, Trial};
use object::{Object, ObjectSection, ObjectSymbol};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

/// Images that the probe evaluates.
const IMAGES: usize = 12;
/// Flash that friction, compensation, parameters and their tables may take, bytes.
const LARGEST_PROGRAM: u64 = 48 * 1024;

pub fn trials(missing: &Missing) -> Vec<Trial> {
    vec![
        Trial::test("friction_compensation_and_parameters_link_no_panic_and_no_float_library", links_little)
            .with_ignored_flag(missing.target),
        Trial::test("the_emulated_core_gives_the_same_bits_as_the_host", same_bits).with_ignored_flag(missing.qemu),
        Trial::test("the_project_s_own_core_gives_the_same_bits_as_the_host", own_core_same_bits)
            .with_ignored_flag(missing.target),
        Trial::test("an_image_is_verified_within_its_instruction_budget_on_the_emulated_core", verification_cost)
            .with_ignored_flag(missing.qemu),
    ]
}

/// Images like trained ones, that certify within their own limits.
fn images() -> Vec<Vec<u8>> {
    let mut random = ChaCha8Rng::seed_from_u64(7);
    let mut images = Vec::new();
    while images.len() < IMAGES {
        let parameters = tame(&mut random);
        if prove(&parameters).is_ok() {
            let limits = Limits { output: u32::MAX, torque_gain: u32::MAX, velocity_slope: u32::MAX };
            let mut image = image(&mut random, parameters, 4);
            image.limits = limits;
            images.push(encoded(&image));
        }
    }
    images
}

/// Builds the probe around the images, once; the program's path, or what the compiler said.
fn build() -> Result<PathBuf, Failed> {
    static BUILT: OnceLock<Result<PathBuf, String>> = OnceLock::new();
    BUILT.get_or_init(|| build_probe().map_err(|error| format!("{error:?}"))).clone().map_err(Failed::from)
}

fn build_probe() -> Result<PathBuf, Failed> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("probe");
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).join("probe");
    std::fs::create_dir_all(&target)?;
    let mut bytes = Vec::new();
    for image in images() {
        bytes.extend_from_slice(&(image.len() as u16).to_le_bytes());
        bytes.extend_from_slice(&image);
    }
    let images = target.join("images.bin");
    std::fs::write(&images, bytes)?;
    let output = Command::new(env!("CARGO"))
        .args(["build", "--profile", "smallest", "--bin", "probe", "--target", TARGET])
        .current_dir(&folder)
        .env("CARGO_TARGET_DIR", &target)
        .env("PROBE_IMAGES", &images)
        .env("RUSTFLAGS", "-C linker=rust-lld -C link-arg=--nmagic -C target-cpu=cortex-m4")
        .output()?;
    match output.status.success() {
        true => Ok(target.join(TARGET).join("smallest/probe")),
        false => Err(String::from_utf8_lossy(&output.stderr).into_owned().into()),
    }
}

fn links_little() -> Result<(), Failed> {
    // A program that links at all shows that no panic can be reached: see the probe's panic handler.
    let bytes = std::fs::read(build()?)?;
    let program = object::File::parse(&*bytes)?;
    let names: Vec<String> = program.symbols().filter_map(|symbol| symbol.name().ok().map(str::to_owned)).collect();
    let floating = |name: &str| name.starts_with("__aeabi_f") || name.starts_with("__aeabi_d") && !name.contains("div");
    let unwanted: Vec<&String> = names
        .iter()
        .filter(|name| name.contains("panic") || name.contains("unwrap_failed") || floating(name))
        .collect();
    if !unwanted.is_empty() || names.is_empty() {
        return Err(format!("linked: {unwanted:?} of {} symbols", names.len()).into());
    }
    let size = |name: &str| program.section_by_name(name).map_or(0, |section| section.size());
    let (code, constants) = (size(".text"), size(".rodata"));
    let images: u64 = images().iter().map(|image| image.len() as u64 + 2).sum();
    println!("code {code} B, tables and constants {} B, without the images of the test", constants - images);
    match code + constants - images <= LARGEST_PROGRAM {
        true => Ok(()),
        false => Err(format!("{} B, at most {LARGEST_PROGRAM} B", code + constants - images).into()),
    }
}

/// Output of the probe when it runs: for each image the hash, and the ticks of its verification.
fn printed() -> Result<Vec<(u32, u32)>, Failed> {
    static PRINTED: OnceLock<Result<Vec<(u32, u32)>, String>> = OnceLock::new();
    PRINTED.get_or_init(|| run_probe().map_err(|error| format!("{error:?}"))).clone().map_err(Failed::from)
}

fn run_probe() -> Result<Vec<(u32, u32)>, Failed> {
    let output = Command::new("qemu-system-arm")
        .args(["-M", "mps2-an386", "-nographic", "-monitor", "none", "-serial", "none"])
        // One instruction takes 1 ns of emulated time, whatever the machine.
        .args(["-icount", "shift=0"])
        .args(["-semihosting-config", "enable=on,target=native", "-kernel"])
        .arg(build()?)
        .output()?;
    let text = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    let words: Vec<u32> = text.lines().filter_map(|line| u32::from_str_radix(line.trim(), 16).ok()).collect();
    match words.len() == 2 * IMAGES {
        true => Ok(words.chunks(2).map(|pair| (pair[0], pair[1])).collect()),
        false => Err(format!("the probe printed {text:?}").into()),
    }
}

fn same_bits() -> Result<(), Failed> {
    let emulated: Vec<u32> = printed()?.into_iter().map(|(hash, _)| hash).collect();
    let host: Vec<u32> = images().iter().map(|image| sequence::run(image).unwrap_or(0)).collect();
    println!("{} images x {} states", host.len(), sequence::STATES);
    match emulated == host && host.iter().all(|sum| *sum != 0) {
        true => Ok(()),
        false => Err(format!("core {emulated:08x?}, host {host:08x?}").into()),
    }
}

/// The same program on the core of `tools/emulator`.
fn own_core_same_bits() -> Result<(), Failed> {
    let program = Program::parse(std::fs::read(build()?)?)?;
    let mut memory = Memory::usual();
    if !program.segments().all(|(address, bytes)| memory.set(address, bytes)) {
        return Err("the program does not fit into the memory".into());
    }
    let mut cpu = memory.core();
    cpu.reset(0).map_err(|refusal| format!("{refusal:?}"))?;
    let mut hashes = Vec::new();
    loop {
        match cpu.run(u64::MAX) {
            // Semihosting: a line of eight digits to print, first a hash, then ticks; anything else ends the program.
            End::Breakpoint { number: 0xab, .. } if cpu.register(0) == 0x04 => {
                let digits = cpu.bus.bytes(cpu.register(1), 8).unwrap_or_default();
                hashes.push(u32::from_str_radix(std::str::from_utf8(digits)?, 16)?);
                cpu.skip();
            }
            End::Breakpoint { number: 0xab, .. } => break,
            end => return Err(format!("{end}").into()),
        }
    }
    let emulated: Vec<u32> = hashes.chunks(2).map(|pair| pair[0]).collect();
    let host: Vec<u32> = images().iter().map(|image| sequence::run(image).unwrap_or(0)).collect();
    println!("{} instructions, {} modelled cycles", cpu.instructions(), cpu.now());
    match emulated == host && host.iter().all(|sum| *sum != 0) {
        true => Ok(()),
        false => Err(format!("core {emulated:08x?}, host {host:08x?}").into()),
    }
}

/// Emulated time of one tick of the system timer, ns: this machine's processor clock is 25 MHz.
const TICK: u64 = 40;
/// Most instructions that decoding, certificate and golden vectors of an image of four regimes may take.
const VERIFICATION_BUDGET: u64 = 21_000_000;

fn verification_cost() -> Result<(), Failed> {
    let mut instructions: Vec<u64> = printed()?.into_iter().map(|(_, ticks)| TICK * u64::from(ticks)).collect();
    instructions.sort_unstable();
    let (least, median, most) = (instructions[0], instructions[IMAGES / 2], instructions[IMAGES - 1]);
    println!("instructions to verify an image: {least} least, {median} median, {most} most of {IMAGES}");
    match least > 0 && most <= VERIFICATION_BUDGET {
        true => Ok(()),
        false => Err(format!("{least} to {most} instructions, budget {VERIFICATION_BUDGET}").into()),
    }
}
