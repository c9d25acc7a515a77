//! A board's program on an emulated board on a CAN bus.

use super::CommandError;
use super::bench::Behind;
use emulator::board::{Drivetrain, Wired, WithBoard, with_board};
use emulator::chip::time::Instant;
use emulator::emulation::Emulation;
use emulator::program::Program;
use emulator::rtt::Messages;
use node::{EmulatedNode, FlashFile, Workbench, serve};
use plant::ActuatorParameters;
use std::fs::File;
use std::io::{BufRead, BufReader, stdin};
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::sync::mpsc::{Receiver, channel};

/// Supply of an actuator that nobody described, V: within what both boards permit until they are commissioned.
const SUPPLY: f64 = 18.0;
/// Temperature of the surroundings, °C.
const AMBIENT: f64 = 25.0;
/// Rest behind a translation of the program for this machine, as a multiple of what it took: clients wait for an answer
/// for a second.
const REST: u32 = 3;

/// Surroundings of a board.
pub struct Bench<'a> {
    /// The bus, as `--bus` names it.
    pub bus: &'a str,
    /// Folder of what the board stores.
    pub storage: Option<&'a Path>,
    /// File with a command a line, "-" for the terminal.
    pub commands: Option<&'a Path>,
    /// Ends it.
    pub stop: &'a AtomicBool,
}

/// Session of a board on a bus.
struct Session<'a> {
    elf: &'a Path,
    bus: &'a str,
    storage: Option<&'a Path>,
    lines: Option<Receiver<String>>,
    stop: &'a AtomicBool,
}

/// Runs the program `elf` of a board until it is stopped. Time that the machine was too slow for, s.
pub fn run(elf: &Path, board: &str, behind: &Behind, bench: Bench) -> Result<f64, CommandError> {
    let Bench { bus, storage, commands, stop } = bench;
    let lines = commands.map(lines).transpose()?;
    let session = Session { elf, bus, storage, lines, stop };
    with_board(board, Served { session, behind })
        .unwrap_or_else(|| Err(CommandError::Arguments(format!("--board: the emulator has no {board}"))))
}

/// A session with what is behind the board.
struct Served<'a> {
    session: Session<'a>,
    behind: &'a Behind,
}

impl WithBoard for Served<'_> {
    type Outcome = Result<f64, CommandError>;

    fn run<W: Wired>(self, new: fn(Drivetrain) -> W) -> Self::Outcome {
        self.session.run(wired(self.behind, new)?)
    }
}

/// Lines of a file or of the terminal as they come.
fn lines(path: &Path) -> Result<Receiver<String>, CommandError> {
    let reader: Box<dyn BufRead + Send> = match path.to_str() {
        Some("-") => Box::new(BufReader::new(stdin())),
        _ => Box::new(BufReader::new(
            File::open(path).map_err(|source| CommandError::Read { path: path.to_owned(), source })?,
        )),
    };
    let (sender, receiver) = channel();
    // It ends with its input, or with the program.
    std::thread::spawn(move || reader.lines().map_while(Result::ok).try_for_each(|line| sender.send(line)));
    Ok(receiver)
}

/// A board with what is behind it.
fn wired<W: Wired>(behind: &Behind, board: fn(Drivetrain) -> W) -> Result<W, CommandError> {
    let parameters = match behind {
        Behind::Actuator(parameters) | Behind::Described(parameters) => **parameters,
        Behind::Reference => {
            let mut parameters = ActuatorParameters::reference().aligned();
            parameters.bus.source_voltage = SUPPLY;
            parameters
        }
    };
    let drivetrain = Drivetrain::new(parameters, AMBIENT, 1)?;
    let encoder = drivetrain.encoder();
    let board = board(drivetrain);
    match behind {
        Behind::Described(_) => {
            let refused = |error| CommandError::Arguments(format!("--plant: the {}'s encoder: {error}", W::NAME));
            board.with_encoder(encoder).map_err(refused)
        }
        _ => Ok(board),
    }
}

impl Session<'_> {
    fn run<W: Wired>(self, board: W) -> Result<f64, CommandError> {
        let path = self.elf;
        let failed = |error: String| CommandError::Bus(format!("{}: {error}", path.display()));
        let elf = std::fs::read(path).map_err(|source| CommandError::Read { path: path.to_owned(), source })?;
        let program = Program::parse(elf).map_err(|error| failed(error.to_string()))?;
        self.serve(board, &program).map_err(failed)
    }

    fn serve<W: Wired>(self, board: W, program: &Program) -> Result<f64, String> {
        let Self { bus, storage, lines, stop, .. } = self;
        let mut emulation = Emulation::new(board, program).map_err(|error| error.to_string())?;
        let kept = storage.map(|folder| FlashFile::open(folder, &mut emulation, program)).transpose();
        let mut kept = kept.map_err(|error| error.to_string())?;
        emulation.cpu.set_rest_between_translations(REST);
        let transport = bus::open(bus).map_err(|error| error.to_string())?;
        let messages = Messages::of(program)?;
        let mut decoder = messages.as_ref().map(Messages::decoder);
        let mut workbench = Workbench::new();
        eprintln!("{} on {bus}, emulated", W::NAME);
        let mut node = EmulatedNode::new(emulation, |emulation: &mut Emulation<W>, until: Instant| {
            lines.iter().flat_map(Receiver::try_iter).for_each(|line| workbench.tell(&line));
            let ended = workbench.run_until(emulation, until);
            workbench.take_answers().iter().for_each(|answer| println!("{answer}"));
            if let Some(kept) = &mut kept {
                kept.keep(emulation).map_err(|error| error.to_string())?;
            }
            let log = emulation.log();
            if let Some(decoder) = &mut decoder {
                for message in decoder.decode(&log) {
                    eprintln!("{:9.3} s  {}", emulation.now().seconds(), message.text);
                }
            }
            ended.map_or(Ok(()), |end| Err(format!("after {:.6} s: {end}", emulation.now().seconds())))
        });
        serve(&mut node, &*transport, stop).map_err(|error| error.to_string())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use joint_firmware::default_configuration::BOARDS;

    struct Name;

    impl WithBoard for Name {
        type Outcome = &'static str;

        fn run<W: Wired>(self, _: fn(Drivetrain) -> W) -> &'static str {
            W::NAME
        }
    }

    #[test]
    fn every_board_of_the_firmware_is_emulated_under_its_name() {
        for (name, _) in BOARDS {
            assert_eq!(with_board(name, Name), Some(name));
        }
        assert_eq!(with_board("moteus-r5", Name), None);
    }
}
