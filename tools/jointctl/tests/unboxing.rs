//! The way of docs/on-a-board.md from unboxing to a turning motor, as somebody goes it who has no board: from step 5
//! on, with the programs as they are flashed on emulated boards, and with the commands as they stand there, but for bus
//! and folders. Between steps 6 and 7 the power is off.
//!
//! Needs the boards' target; where it is missing the tests are reported as ignored, by name; with `CI` set they run and
//! fail. Real time counts here, as it does for the user: one board at a time, and where a command says that the machine
//! was too slow, it is repeated as the page says.

mod shown;

use host_tests::bare_metal::{BOARDS, build_by, target_installed};
use libtest_mimic::{Arguments, Failed, Trial};
use plant::ActuatorParameters;
use shown::{ON_THE_BUS, lines};
use std::fs::File;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Page with the steps.
const ON_A_BOARD: &str = include_str!("../../../docs/on-a-board.md");
/// Bus of step 5; here each board has a port of its own.
const BUS: &str = "socketcan:can0";
/// Place in which the line of docs/on-the-bus.md builds a program; tests keep theirs elsewhere.
const PROGRAM: &str = "target/thumbv7em-none-eabihf/release/joint-firmware";
/// Words of commands for which the machine was too slow.
const LATE: [&str; 4] = ["(8100h)", "command deadline missed", "no answer within", "LSS fastscan did not come within"];
/// Times that a command is tried on such a machine.
const ATTEMPTS: usize = 5;
/// Longest time to a program's first line a second.
const START: Duration = Duration::from_secs(120);
/// Joint's way on command that cannot be backlash or noise, rad.
const MOVED: f64 = 0.05;

fn main() {
    let mut arguments = Arguments::from_args();
    arguments.test_threads.get_or_insert(1);
    let ignored = std::env::var_os("CI").is_none() && !target_installed();
    let trials = BOARDS.iter().map(|board| {
        let name = format!("{}_gets_from_unboxing_to_a_turning_motor", board.name.replace('-', "_"));
        Trial::test(name, || from_unboxing(board.name)).with_ignored_flag(ignored)
    });
    libtest_mimic::run(&arguments, trials.collect()).exit();
}

fn holds(is: bool, otherwise: impl FnOnce() -> String) -> Result<(), Failed> {
    if is { Ok(()) } else { Err(otherwise().into()) }
}

/// Desk of somebody with a terminal, a folder, and a board on the bus.
struct Desk {
    folder: TempDir,
    /// Arguments of `jointctl` that put the board on the bus.
    board: String,
    power: Option<Child>,
}

impl Drop for Desk {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.power_off();
    }
}

impl Desk {
    fn command(&self, line: &str) -> Result<Command, Failed> {
        let arguments = line.strip_prefix("jointctl ").ok_or_else(|| format!("{line}: nobody runs it"))?;
        let mut command = Command::new(env!("CARGO_BIN_EXE_jointctl"));
        command.current_dir(&self.folder).args(arguments.split_whitespace()).stdin(Stdio::null());
        // The board runs in real time, and the machine may have much else to do.
        command.env("JOINTCTL_TIMEOUT", "60000");
        Ok(command)
    }

    /// Log of the board's program since the power is on.
    fn log(&self) -> String {
        let bytes = std::fs::read(self.folder.path().join("log")).unwrap_or_default();
        String::from_utf8_lossy(&bytes).into_owned()
    }

    /// Power on, until the program writes its line a second.
    fn power_on(&mut self) -> Result<(), Failed> {
        let log = File::create(self.folder.path().join("log"))?;
        let mut command = self.command(&self.board)?;
        self.power = Some(command.stdout(Stdio::null()).stderr(log).spawn()?);
        let begun = Instant::now();
        while !self.log().contains("  joint: ") {
            holds(begun.elapsed() < START, || format!("the program does not start:\n{}", self.log()))?;
            std::thread::sleep(Duration::from_millis(100));
        }
        Ok(())
    }

    /// Power off as Ctrl-C does it: at once, whatever the program does.
    fn power_off(&mut self) -> Result<(), Failed> {
        if let Some(mut child) = self.power.take() {
            child.kill()?;
            child.wait()?;
        }
        Ok(())
    }

    /// Output of a command, which is repeated where it says that this machine is too slow.
    fn run(&self, line: &str) -> Result<String, Failed> {
        let moves = ["jointctl commission", "jointctl move"].iter().any(|begin| line.starts_with(begin));
        let mut attempt = 1;
        loop {
            let reset = if moves && attempt > 1 { " --reset" } else { "" };
            let begun = Instant::now();
            let output = self.command(&format!("{line}{reset}"))?.output()?;
            let [told, errors] = [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes));
            println!("{:5.1} s  {line}{reset}\n{told}{errors}", begun.elapsed().as_secs_f64());
            if output.status.success() {
                return Ok(told.into_owned());
            }
            let late = LATE.iter().any(|late| errors.contains(late));
            let log = || format!("{line}: {}\n{told}{errors}{}", output.status, self.log());
            holds(late && attempt < ATTEMPTS, log)?;
            attempt += 1;
        }
    }

    /// A line of a command's that begins with a word.
    fn told(&self, line: &str, begin: &str) -> Result<String, Failed> {
        let page = self.run(line)?;
        let found = page.lines().find(|line| line.starts_with(begin));
        Ok(found.ok_or_else(|| format!("{line}: no line begins with {begin}:\n{page}"))?.to_owned())
    }
}

/// The text between two others that stand in a page.
fn between<'a>(page: &'a str, begin: &str, end: &str) -> &'a str {
    let (_, behind) = page.split_once(begin).unwrap_or_else(|| panic!("'{begin}' is not in the page"));
    behind.split_once(end).unwrap_or_else(|| panic!("'{end}' does not follow '{begin}' in the page")).0
}

/// A number of the page's, between two texts of it.
fn number(text: &str, before: &str, behind: &str) -> Result<f64, Failed> {
    let found = text.split_once(before).and_then(|(_, rest)| rest.split_once(behind));
    Ok(found.ok_or_else(|| format!("the page does not say '{before}...{behind}'"))?.0.parse()?)
}

/// The board on a bus of its own, and that bus.
fn desk(board: &str) -> Result<(Desk, String), Failed> {
    let port = bus::free_port().ok_or("no port is free")?;
    let bus = format!("udp:239.74.163.2:{port}");
    let shown = lines(between(ON_THE_BUS, "byte for byte what probe-rs would flash", "Its log comes to the terminal."));
    let [named, build, sim, address] = &shown[..] else { return Err(format!("{shown:?} are other lines").into()) };
    holds(named == "BOARD=moteus-r4", || format!("{named} names no board"))?;
    holds(address == "jointctl address --bus $B --first 5 --wait 300", || format!("{address} is not that of step 5"))?;
    let [build, sim] = [build, sim].map(|line| line.replace("$BOARD", board).replace("$B", &bus));
    let program = build_by(&build, board, env!("CARGO_TARGET_TMPDIR"))?;
    holds(sim.contains(PROGRAM), || format!("{sim} runs another program"))?;
    let board = sim.replace(PROGRAM, &program.to_string_lossy());
    Ok((Desk { folder: tempfile::tempdir()?, board, power: None }, bus))
}

fn from_unboxing(board: &str) -> Result<(), Failed> {
    let text = between(ON_A_BOARD, "Try steps 5 to 7 first without a board", "1. No motor connected");
    let gear = number(text, "the gear ratio is ", " and the torque constant ")?;
    let constant = number(text, " and the torque constant ", " Nm/A")?;
    let actual = ActuatorParameters::reference();
    let motor = (actual.joint.motor.gear_ratio, actual.joint.motor.torque_constant);
    holds((gear, constant) == motor, || format!("the page says {gear} and {constant} of a motor with {motor:?}"))?;
    holds(text.contains("`address` wants `--wait 300`"), || "the page does not say how patient to be".into())?;

    let steps = lines(between(ON_A_BOARD, "5. Connect the bus.", "A new joint's gains are low"));
    let (mut desk, bus) = desk(board)?;
    let [set, steps @ ..] = &steps[..] else { return Err("there are no steps".into()) };
    holds(set == &format!("B={BUS}"), || format!("{set} is another bus"))?;
    let steps: Vec<String> = steps.iter().map(|step| step.replace("$B", &bus)).collect();
    let [address, info, commission, index, motion] = &steps[..] else {
        return Err(format!("{steps:?} are other steps").into());
    };

    // Step 5.
    desk.power_on()?;
    let given = desk.run(&format!("{address} --wait 300"))?;
    holds(given.starts_with("node 5: "), || given.clone())?;
    let page = desk.run(info)?;
    holds(page.contains(&format!("node            5: {board}\n")), || page.clone())?;

    // Step 6: what is asked is said beforehand.
    let found = desk.run(&format!("{commission} --gear {gear} --torque-constant {constant} --yes"))?;
    holds(found.contains(" rad/s there and ") && found.contains("node 5: commissioned."), || found.clone())?;
    holds(desk.folder.path().join("commission-5/commission.html").exists(), || "there is no page".into())?;
    let settings = format!("jointctl get motor gear limits gains --json --bus {bus} --node 5");
    let stored = desk.run(&settings)?;
    let values: serde_json::Value = serde_json::from_str(&stored)?;
    let limit = number(&format!("{commission} "), "--current-limit ", " ")?;
    let pole_pairs = actual.windings.pole_pairs as f64;
    for (name, wanted) in [
        ("gear.gear-ratio", gear),
        ("motor.torque-constant", constant),
        ("motor.current-limit", limit),
        ("motor.pole-pairs", pole_pairs),
    ] {
        let value = values[name]["value"].as_f64().unwrap_or(f64::NAN);
        holds((value / wanted - 1.0).abs() < 1e-6, || format!("{name} is {value} instead of {wanted}"))?;
    }

    // Off and on: it has what it had.
    desk.power_off()?;
    holds(Path::new(desk.folder.path()).join("kept").exists(), || "nothing was kept".into())?;
    desk.power_on()?;
    let kept = desk.run(&settings)?;
    holds(kept == stored, || format!("{kept} was kept of {stored}"))?;

    // Step 7.
    let ready = |state: &str| state.contains("disabled");
    let before = desk.told(info, "state ")?;
    holds(ready(&before) == (board != "b-g431b-esc1"), || before.clone())?;
    desk.run(&format!("{index} --yes"))?;
    let behind = desk.told(info, "state ")?;
    holds(ready(&behind), || behind.clone())?;
    let position =
        |desk: &Desk| -> Result<f64, Failed> { number(&desk.told(info, "position ")?, "position        ", " rad") };
    let from = position(&desk)?;
    desk.run(motion)?;
    let moved = position(&desk)? - from;
    println!("moved by {moved:.3} rad");
    holds(moved > MOVED, || format!("it moved by {moved} rad"))
}
