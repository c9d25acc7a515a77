//! What a control step costs on the board's core, part by part, and that it gives the host's bits: recorded runs of the whole joint, replayed
//! on an emulated Cortex-M4F, of which every instruction is counted.
//!
//! The code is built as each board's program is. Instructions are exact; the board's own part of the interrupt (converters, timer, report) is not
//! among them. Cycles are a model: the published timings (Cortex-M4 Technical Reference
//! Manual, 3.3 and 7.2) without wait states, see `thumb::cycles`; nothing here has run on hardware. What belongs to which part is told by
//! the compiler's line tables: an instruction counts for the innermost of the functions below that it was inlined into, and what
//! they call out of line counts for the caller.
//!
//! Needs the target and `qemu-system-arm`. Where they are missing the tests are reported as ignored, by name; with `CI` set they run
//! and fail.

#[path = "../probe/src/replay.rs"]
mod replay;
#[allow(dead_code, reason = "each test uses its part")]
mod thumb;

use host_tests::bare_metal::{TARGET, target_installed};
use host_tests::image_bytes::encoded;
use host_tests::parameters::{coefficients, image, q16, range, tame_network};
use joint_firmware::friction::domain::Domain;
use joint_firmware::friction::physical::{Coefficients, PhysicalParameters, Terms};
use joint_firmware::friction::regime::{Criterion, Measure, Selector};
use joint_firmware::friction::{FrictionModel, FrictionParameters, ParameterSet};
use joint_firmware::joint::state_machine::State;
use joint_firmware::joint::{Demand, Joint};
use joint_firmware::parameters::certificate::prove;
use libtest_mimic::{Arguments, Failed, Trial};
use plant::VirtualJoint;
use plant::actuator::ActuatorParameters;
use plant::virtual_joint::Setup;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use replay::{SCENARIOS, SEED, START, STEPS, Scenario, WORDS};
use std::collections::HashMap;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// A board's way of being compiled, and what a control step may cost with it.
struct Board {
    name: &'static str,
    /// As in `.cargo/config.toml` and the board's own file beside it.
    level: &'static str,
    /// Most instructions of any control step: the longest way through it.
    step: u64,
    /// Most instructions of the network in a step, its inputs' scaling included.
    network: u64,
}

const BOARDS: [Board; 2] = [
    Board { name: "b_g431b_esc1", level: "s", step: 2900, network: 300 },
    Board { name: "moteus_r4", level: "2", step: 2650, network: 320 },
];

/// Parts of a control step, and how their functions' names begin behind `joint_firmware::`.
const PARTS: [(&str, &[&str]); 16] = [
    ("network", &["friction::network::"]),
    ("physical model", &["friction::physical::"]),
    ("regimes", &["friction::regime::", "friction::FrictionModel::"]),
    ("compensation", &["compensation::", "friction::domain::"]),
    ("feedforward and guard", &["joint::friction_feedforward::"]),
    ("observer", &["motor::observer::", "joint::active::Scales::joint"]),
    ("transforms", &["motor::angle::", "motor::transform::"]),
    ("current control", &["motor::current::", "motor::field_oriented::"]),
    ("modulation", &["motor::modulation::"]),
    ("monitors", &["joint::monitor::", "joint::Joint::watch", "joint::Joint::count_stale_steps"]),
    ("state machine", &["joint::state_machine::", "joint::Joint::decide", "joint::Joint::has_stopped"]),
    ("motion law", &["joint::motion_law::"]),
    ("offsets, encoder", &["joint::offsets::", "joint::Joint::without_offsets", "joint::Joint::encoder_sample"]),
    ("history", &["joint::history::", "joint::Joint::note"]),
    ("mean square", &["motor::thermal::"]),
    ("step itself", &["joint::Joint::step", "joint::Joint::control_step", "joint::Joint::coupled"]),
];

fn main() {
    let arguments = Arguments::from_args();
    let required = std::env::var_os("CI").is_some();
    let emulator = required || Command::new("qemu-system-arm").arg("--version").output().is_ok() && target_installed();
    let trial = |board: &'static Board| {
        let name = format!("a_control_step_of_{}_costs_what_it_may_and_gives_the_host_s_bits", board.name);
        Trial::test(name, move || replayed(board)).with_ignored_flag(!emulator)
    };
    libtest_mimic::run(&arguments, BOARDS.iter().map(trial).collect()).exit();
}

/// Every term, a network in every set, and two criteria that the runs cross; friction like the reference joint's.
fn friction() -> FrictionParameters {
    let domain = Domain {
        ranges: [
            range(-2.5, 2.5),
            range(-6.0, 6.0),
            range(-90.0, 90.0),
            range(-90.0, 90.0),
            range(0.0, 80.0),
            range(-500.0, 500.0),
        ],
        margin: q16(0.2) as u32,
        reference_temperature: q16(25.0),
    };
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let mut set = |coulomb: f64| {
        let si = Coefficients::NAMES.map(|name| match name {
            "constant" | "position" | "quadratic" => 0.05,
            "temperature" | "viscous_temperature" | "coulomb_temperature" | "load" => -0.002,
            "viscous" => 1.1,
            "coulomb_positive" | "coulomb_negative" => coulomb,
            "coulomb_load" => 0.01,
            "coulomb_slope" => 30.0,
            "breakaway_positive" | "breakaway_negative" => 1.3 * coulomb,
            "stribeck_slope" => 20.0,
            "hysteresis" => 0.1,
            "hysteresis_velocity_slope" => 10.0,
            "hysteresis_width" => 0.5,
            "hysteresis_acceleration_slope" => 0.1,
            "harmonic_frequency" => 4.0,
            "rotor_inertia" => 1e-3,
            _ => 0.05,
        });
        let physical = PhysicalParameters { terms: Terms::ALL, coefficients: coefficients(&domain, &si) };
        let mut network = tame_network(&mut random);
        network.scale = q16(0.05);
        ParameterSet { physical, network: Some(network) }
    };
    let criterion = |measure, enter: f64| Some(Criterion { measure, enter: q16(enter), leave: q16(0.8 * enter) });
    FrictionParameters {
        domain,
        selector: Selector {
            criteria: [criterion(Measure::Speed, 0.05), criterion(Measure::Coupled, 0.1)],
            fade_time: q16(0.002) as u32,
        },
        sets: [set(2.5), set(2.4), set(2.3), set(2.2)],
    }
}

/// The model as bytes.
fn image_bytes() -> Vec<u8> {
    let friction = friction();
    prove(&friction).unwrap_or_else(|error| panic!("{error:?}"));
    encoded(&image(&mut ChaCha8Rng::seed_from_u64(6), friction, 1))
}

/// The start and all runs in closed loop with the virtual joint: what the control step was told.
fn record() -> Result<Vec<[u32; WORDS]>, Failed> {
    let parameters = ActuatorParameters::reference().aligned();
    let (configuration, bridge) = replay::configuration(&SCENARIOS[0]);
    let mut started = VirtualJoint::new(parameters, &Setup { configuration, bridge }, 25.0, 3)?;
    let mut steps = Vec::new();
    let mut step = |joint: &mut VirtualJoint, demand: &Demand| {
        let slow = *joint.slow();
        let state = joint.step(demand, 0.0).state;
        steps.push(replay::words(joint.measured(), &slow));
        state
    };
    for n in 0..START {
        step(&mut started, &replay::starting(n));
    }
    for scenario in &SCENARIOS {
        let mut joint = started.clone();
        let (configuration, bridge) = replay::configuration(scenario);
        joint.set_active(configuration.prepare(&bridge)?);
        joint.set_friction(Some(FrictionModel::new(&friction(), 20_000)));
        for n in 0..STEPS {
            let state = step(&mut joint, &replay::demand(scenario, n));
            if state != State::OperationEnabled {
                return Err(format!("{state:?} in step {n}: {:?}", joint.joint().latched_faults()).into());
            }
        }
    }
    Ok(steps)
}

/// The hashes of all runs on this machine.
fn replayed_here(image: &[u8], steps: &[[u32; WORDS]]) -> Option<Vec<u32>> {
    let mut steps = steps.iter().map(replay::measured);
    let active = replay::prepare(&SCENARIOS[0], image)?;
    let mut started = Joint::new();
    for n in 0..START {
        let (measured, slow) = steps.next()?;
        started.control_step(&active, &replay::starting(n), &slow, &measured);
    }
    let run = |scenario: &Scenario| {
        let active = replay::prepare(scenario, image)?;
        let mut joint = started.clone();
        (0..STEPS).try_fold(SEED, |sum, n| {
            let (measured, slow) = steps.next()?;
            let bridge = joint.control_step(&active, &replay::demand(scenario, n), &slow, &measured);
            Some(replay::hash(sum, &joint, &bridge))
        })
    };
    SCENARIOS.iter().map(run).collect()
}

/// Builds the program around the runs.
fn build(board: &Board, runs: &[u8]) -> Result<PathBuf, Failed> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("probe");
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).join("step").join(board.name);
    std::fs::create_dir_all(&target)?;
    let file = target.join("runs.bin");
    std::fs::write(&file, runs)?;
    let flags =
        "-C linker=rust-lld -C link-arg=--nmagic -C target-cpu=cortex-m4 -C linker-plugin-lto -C codegen-units=1";
    let flags = format!("{flags} -C opt-level={} -C link-arg=-T{}", board.level, folder.join("link.x").display());
    let output = Command::new(env!("CARGO"))
        .args(["build", "--profile", "board", "--bin", "step", "--target", TARGET])
        .current_dir(&folder)
        .env("CARGO_TARGET_DIR", &target)
        .env("PROBE_RUNS", &file)
        .env("RUSTFLAGS", flags)
        .output()?;
    match output.status.success() {
        true => Ok(target.join(TARGET).join("board/step")),
        false => Err(String::from_utf8_lossy(&output.stderr).into_owned().into()),
    }
}

/// Instructions and cycles.
#[derive(Clone, Copy, Default)]
struct Cost {
    instructions: u64,
    cycles: u64,
}

/// What the steps of one run cost.
#[derive(Clone, Default)]
struct Profile {
    steps: u64,
    sum: Cost,
    longest: Cost,
    parts: [Cost; PARTS.len()],
    most: [Cost; PARTS.len()],
}

impl Cost {
    fn add(&mut self, other: &Self) {
        self.instructions += other.instructions;
        self.cycles += other.cycles;
    }

    fn at_least(&mut self, other: &Self) {
        self.instructions = self.instructions.max(other.instructions);
        self.cycles = self.cycles.max(other.cycles);
    }
}

impl Profile {
    /// Adds one step.
    fn add(&mut self, step: &Self) {
        self.steps += 1;
        self.sum.add(&step.sum);
        self.longest.at_least(&step.sum);
        for ((sum, most), part) in self.parts.iter_mut().zip(&mut self.most).zip(&step.parts) {
            sum.add(part);
            most.at_least(part);
        }
    }

    /// Mean instructions and cycles of a step.
    fn mean(&self, cost: &Cost) -> String {
        let steps = self.steps.max(1);
        format!("{} ({})", cost.instructions / steps, cost.cycles / steps)
    }
}

/// The part that an address belongs to; none for what is called out of line.
fn part(loader: &addr2line::Loader, address: u32) -> Option<usize> {
    let mut frames = loader.find_frames(address.into()).ok()?;
    while let Ok(Some(frame)) = frames.next() {
        let Some(name) = frame.function.as_ref().and_then(|function| function.demangle().ok()) else { continue };
        let Some((_, path)) = name.split_once("joint_firmware::") else { continue };
        let found = PARTS.iter().position(|(_, names)| names.iter().any(|begin| path.starts_with(begin)));
        if found.is_some() {
            return found;
        }
    }
    None
}

/// Runs the program; the hashes that it prints, and what the steps of each run cost.
fn traced(path: &Path) -> Result<(Vec<u32>, Vec<Profile>), Failed> {
    let program = thumb::Program::parse(&std::fs::read(path)?)?;
    let loader = addr2line::Loader::new(path).map_err(|error| error.to_string())?;
    let begin = program.address("counted_step").ok_or("no counted_step")?;
    let caller = program.function("run").ok_or("no run")?;
    let mut emulator = Command::new("qemu-system-arm")
        .args(["-M", "mps2-an386", "-nographic", "-monitor", "none", "-serial", "none"])
        // Every instruction by itself, and each of them told.
        .args(["-singlestep", "-d", "exec,nochain"])
        .args(["-semihosting-config", "enable=on,target=native", "-kernel"])
        .arg(path)
        .stderr(Stdio::piped())
        .stdout(Stdio::null())
        .spawn()?;
    let mut hashes = Vec::new();
    let mut profiles = vec![Profile::default(); SCENARIOS.len()];
    let mut parts: HashMap<u32, Option<usize>> = HashMap::new();
    let (mut step, mut inside, mut now) = (0, false, Profile::default());
    let (mut last, mut current) = (None, 0);
    for line in BufReader::new(emulator.stderr.take().ok_or("no output")?).split(b'\n') {
        let line = line?;
        let Some(rest) = line.strip_prefix(b"Trace ") else {
            hashes.extend(u32::from_str_radix(String::from_utf8_lossy(&line).trim(), 16));
            continue;
        };
        // "Trace 0: 0x7f... [00000000/000012a4/00000110/ff000000] counted_step"
        let address = rest.split(|byte| *byte == b'/').nth(1).and_then(|word| std::str::from_utf8(word).ok());
        let address = address.and_then(|word| u32::from_str_radix(word, 16).ok());
        let address = address.ok_or_else(|| format!("who knows what {} says", String::from_utf8_lossy(&line)))?;
        if address == begin {
            (inside, last, current, now) = (true, None, PARTS.len() - 1, Profile::default());
        } else if inside && caller.contains(&address) {
            inside = false;
            if let Some(profile) = u32::checked_sub(step, START).and_then(|n| profiles.get_mut((n / STEPS) as usize)) {
                profile.add(&now);
            }
            step += 1;
        }
        if inside {
            let cycles = program.cycles(last, address);
            current = parts.entry(address).or_insert_with(|| part(&loader, address)).unwrap_or(current);
            for cost in [&mut now.sum, &mut now.parts[current]] {
                cost.instructions += 1;
                cost.cycles += cycles;
            }
            last = Some(address);
        }
    }
    emulator.wait()?;
    Ok((hashes, profiles))
}

fn replayed(board: &Board) -> Result<(), Failed> {
    let image = image_bytes();
    let mut runs = (image.len() as u16).to_le_bytes().to_vec();
    runs.extend_from_slice(&image);
    let steps = record()?;
    let expected = replayed_here(&image, &steps).ok_or("the image is refused")?;
    runs.extend(steps.iter().flatten().flat_map(|word| word.to_le_bytes()));
    let (hashes, profiles) = traced(&build(board, &runs)?)?;
    let column = |text: String| format!("{text:>14}");
    let heads = ["off", "physical", "full", "torque, guard", "longest way"].map(|head| column(head.to_owned()));
    println!("{}, optimised for \"{}\"", board.name, board.level);
    println!("{:24}{}", "instructions (cycles)", heads.concat());
    let row = |name: &str, of: &dyn Fn(&Profile) -> String| {
        println!("{name:24}{}", profiles.iter().map(|profile| column(of(profile))).collect::<String>());
    };
    for (i, (name, _)) in PARTS.iter().enumerate() {
        row(name, &|profile| profile.mean(&profile.parts[i]));
    }
    row("mean", &|profile| profile.mean(&profile.sum));
    row("longest", &|profile| format!("{} ({})", profile.longest.instructions, profile.longest.cycles));
    if hashes != expected {
        return Err(format!("core {hashes:08x?}, host {expected:08x?}").into());
    }
    let longest = profiles.iter().map(|profile| profile.longest.instructions).max().unwrap_or(0);
    let network = profiles.iter().map(|profile| profile.most[0].instructions).max().unwrap_or(0);
    if profiles.iter().any(|profile| profile.steps == 0) || network == 0 {
        return Err("nothing was counted".into());
    }
    match longest <= board.step && network <= board.network {
        true => Ok(()),
        false => {
            Err(format!("{longest} instructions, at most {}; network {network}, {}", board.step, board.network).into())
        }
    }
}
