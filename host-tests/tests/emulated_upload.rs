//! Another friction image for a joint in service: python-canopen uploads it by block into the moteus r4's program, as
//! it is flashed, while the joint turns to and fro with compensation, has it verified and commits it. No control step
//! is missed meanwhile, and the torque does not jump.
//!
//! Needs the target, and Python with python-canopen; where something is missing the test is reported as ignored, by
//! name; with `CI` set it runs and fails.

use emulator::board::{Drivetrain, MoteusR4, Wired};
use emulator::chip::time::Instant;
use emulator::emulation::Emulation;
use friction_compensation::compensation::Request;
use friction_compensation::friction::regime::MOST_SETS;
use friction_compensation::parameters::image::Image;
use host_tests::bare_metal::target_installed;
use host_tests::control_steps::friction;
use host_tests::emulated::Bench;
use host_tests::emulated::bench::{actuator, program};
use host_tests::emulated::kept::{Kept, configuration};
use host_tests::emulated::master::{Heard, heard, send};
use host_tests::emulated::observed::Observed;
use host_tests::image_bytes::encoded;
use host_tests::parameters;
use libtest_mimic::{Arguments, Failed, Trial};
use node::{Served, serve};
use python::Packages;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::collections::VecDeque;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

const GROUP: &str = "239.74.163.2";
const NODE: u8 = 5;
/// python-canopen with its bus.
const PACKAGES: Packages = Packages {
    folder: "python-canopen",
    install: &["canopen==2.4.1", "python-can==4.6.1", "msgpack==1.2.4"],
    import: "canopen, can, msgpack",
};
/// Longest delay of a control step's begin beyond a period after the one before, ps: 1 us.
const LATEST: f64 = 1e6;
/// Words of the script where a part of its run begins.
const PARTS: [&str; 3] = ["moving", "uploading", "uploaded"];

fn main() {
    let arguments = Arguments::from_args();
    let must_run = std::env::var_os("CI").is_some();
    let python = if arguments.list { None } else { PACKAGES.python(env!("CARGO_TARGET_TMPDIR")) };
    let ignored = !must_run && (python.is_none() || !target_installed());
    let name = "python_canopen_gives_a_moving_joint_another_image_and_no_control_step_is_missed";
    let trial = Trial::test(name, move || upload(python.as_deref())).with_ignored_flag(ignored);
    libtest_mimic::run(&arguments, vec![trial]).exit();
}

/// An image like the reference joint's friction, weaker or stronger in its Coulomb term.
fn image(version: u32, part: f64) -> Image {
    let mut friction = friction(MOST_SETS);
    for set in &mut friction.sets {
        let coefficients = &mut set.physical.coefficients;
        for torque in [&mut coefficients.coulomb_positive, &mut coefficients.coulomb_negative] {
            *torque = (f64::from(*torque) * part) as i32;
        }
    }
    Image { version, ..parameters::image(&mut ChaCha8Rng::seed_from_u64(6), friction, 4) }
}

/// Summary of the control steps of a part.
#[derive(Clone, Copy, Debug, Default)]
struct Seen {
    steps: u64,
    /// Longest time from one to the next, ps.
    gap: u64,
    /// Largest change of the motor's torque from one to the next, Nm.
    change: f64,
    /// Largest torque, Nm.
    torque: f64,
}

/// A board on the bench, on the bus, watched.
struct Watched<'b> {
    bench: &'b mut Bench<MoteusR4>,
    part: &'b AtomicUsize,
    /// Observations before each of the parts, in them, and behind them.
    seen: [Seen; PARTS.len() + 1],
    before: Option<(Instant, f64)>,
    sent: VecDeque<Heard>,
}

impl Served for Watched<'_> {
    fn now(&self) -> Duration {
        Duration::from_nanos(self.bench.emulation.now().0 / 1_000)
    }

    fn live_until(&mut self, instant: Duration) -> Result<(), String> {
        let Self { bench, part, seen, before, .. } = self;
        let seen = &mut seen[part.load(Ordering::Relaxed)];
        let mut look = |emulation: &mut Emulation<MoteusR4>| {
            let now = emulation.now();
            let actuator = emulation.cpu.bus.wiring_mut().drivetrain().actuator();
            let torque = actuator.state().joint.motor_torque;
            if let Some((then, last)) = before.replace((now, torque)) {
                seen.steps += 1;
                seen.gap = seen.gap.max(now.0 - then.0);
                seen.change = seen.change.max((torque - last).abs());
                seen.torque = seen.torque.max(torque.abs());
            }
            Ok(())
        };
        let until = Instant(instant.as_nanos() as u64 * 1_000);
        bench.run_until(until, &mut look).map_err(|error| error.message().unwrap_or("failed").to_owned())
    }

    fn receive(&mut self, frame: &bus::Frame) {
        // A frame of the bus is one of CAN's.
        let _ = send(&mut self.bench.emulation, frame.id(), frame.data());
    }

    fn take_frame(&mut self) -> Option<bus::Frame> {
        if self.sent.is_empty() {
            self.sent.extend(heard(&mut self.bench.emulation));
        }
        let (id, data) = self.sent.pop_front()?;
        bus::Frame::new(id, &data)
    }
}

fn upload(python: Option<&Path>) -> Result<(), Failed> {
    let python = PACKAGES.required(python)?;
    let program = program(MoteusR4::NAME, env!("CARGO_TARGET_TMPDIR"))?;
    let configuration = configuration::<MoteusR4>(&actuator(), NODE, Request::PhysicalAndNetwork);
    let mut bench = Bench::with(|drivetrain: Drivetrain| MoteusR4::new(drivetrain), &actuator(), &program)?;
    Kept { configuration: &configuration, image: &encoded(&image(1, 1.0)) }.write(&mut bench.emulation, &program)?;
    bench.stop_at_control_steps(&program)?;

    let folder = tempfile::tempdir()?;
    let path: PathBuf = folder.path().join("second.img");
    std::fs::write(&path, encoded(&image(2, 0.8)))?;
    let port = bus::free_port().ok_or("no port is free")?;
    let bus = bus::open(&format!("udp:{GROUP}:{port}"))?;
    let (stop, part) = (AtomicBool::new(false), AtomicUsize::new(0));
    let mut script = Command::new(python)
        .arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/upload_in_motion.py"))
        .args([GROUP, &port.to_string(), &NODE.to_string()])
        .arg(&path)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()?;
    let output = script.stdout.take().ok_or("no output")?;
    let mut watched =
        Watched { bench: &mut bench, part: &part, seen: Default::default(), before: None, sent: VecDeque::new() };
    let (served, said) = std::thread::scope(|scope| {
        let listening = scope.spawn(|| {
            let mut said = Vec::new();
            for line in BufReader::new(output).lines().map_while(Result::ok) {
                if let Some(place) = PARTS.iter().position(|part| *part == line) {
                    part.store(place + 1, Ordering::Relaxed);
                }
                said.push(line);
            }
            stop.store(true, Ordering::Relaxed);
            said
        });
        let served = serve(&mut watched, &*bus, &stop);
        (served, listening.join().unwrap_or_default())
    });
    let seen = watched.seen;
    let mut errors = String::new();
    script.stderr.take().ok_or("no errors")?.read_to_string(&mut errors)?;
    if !script.wait()?.success() || said != ["version 1", "moving", "uploading", "uploaded", "version 2"] {
        return Err(format!("{said:?}\n{errors}{}", bench.log()).into());
    }
    let lost = served?;
    let [_, before, during, _] = seen;
    let rate = f64::from(MoteusR4::CONFIGURATION.bridge.rate);
    for (name, seen) in [("before", before), ("during", during)] {
        println!(
            "{name} the upload: {} control steps, at most {:.2} us apart; torque up to {:.2} Nm, changes by up to {:.3} Nm a step",
            seen.steps,
            seen.gap as f64 * 1e-6,
            seen.torque,
            seen.change
        );
    }
    println!("{lost:.1} s given up, this machine was too slow for real time");
    bench.expect("overruns: 0")?;
    if bench.log().lines().filter(|line| line.contains("overruns: ")).any(|line| !line.contains("overruns: 0,")) {
        return Err(bench.log().into());
    }
    for seen in [before, during] {
        if seen.steps < 10_000 || seen.gap as f64 > 1e12 / rate + LATEST {
            return Err(format!("a control step is late or missing: {seen:?}").into());
        }
    }
    // The change of the models is one of the compensation's slew limit, once a round of the motion loop.
    let slew = f64::from(configuration.compensation.slew) / f64::from(MoteusR4::CONFIGURATION.bridge.motion_rate());
    match during.change <= before.change + slew {
        true => Ok(()),
        false => Err(format!("the torque jumps by {} Nm", during.change).into()),
    }
}
