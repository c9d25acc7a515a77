//! The commands of `jointctl`, one file each: arguments in, files and a few lines of text out; host.

mod arm;
mod bench;
pub mod bus;
pub mod bus_yml;
pub mod commission;
pub mod completions;
pub mod demo;
pub mod describe;
pub mod drive;
#[cfg(feature = "emulator")]
mod elf;
pub mod evaluate;
mod examples;
pub mod excite;
pub mod fit;
pub mod fleet;
mod force;
pub mod image;
pub mod joint;
pub mod keep;
pub mod key;
pub mod man;
pub mod monitor;
pub mod objects;
mod on_board;
pub mod record;
pub mod remote;
pub mod retrain;
pub mod robot;
pub mod sim;
mod stream;
mod terminal;
pub mod upload;

use clap::{CommandFactory, Parser, Subcommand};
use std::path::PathBuf;

/// Identify, train, certify and judge the friction model of a robot joint.
#[derive(Debug, Parser)]
#[command(name = "jointctl", version, max_term_width = 110)]
pub struct Arguments {
    /// Command of the program.
    #[command(subcommand)]
    pub command: Command,
}

/// Declares the commands: how each is called, its arguments, and what runs it where that is not `run`.
macro_rules! commands {
    ($($(#[$text:meta])* $name:ident($arguments:ty) $(=> $run:ident)?,)+) => {
        /// Command of the program.
        #[derive(Debug, Subcommand)]
        pub enum Command {
            $($(#[$text])* $name($arguments),)+
        }

        /// Runs a command.
        pub fn run(arguments: Arguments) -> Result<(), CommandError> {
            match arguments.command {
                $(Command::$name(command) => commands!(@run command $($run)?),)+
            }
        }
    };
    (@run $command:ident) => { $command.run() };
    (@run $command:ident $run:ident) => { $command.$run() };
}

commands! {
    /// The whole pipeline on a virtual joint: needs no file, writes ./demo
    Demo(demo::Demo),
    /// Identify, train, certify and judge the friction of a recorded joint
    Fit(fit::Fit),
    /// Judge an image on a recorded joint
    Evaluate(evaluate::Evaluate),
    /// All joints of a robot: excite, identify from one recording, judge on another
    #[command(subcommand)]
    Robot(robot::RobotCommand),
    /// Many joints over many days: sums, and which of them have changed
    #[command(subcommand)]
    Fleet(fleet::FleetCommand),
    /// Inspect, verify or convert a parameter image
    #[command(subcommand)]
    Image(image::ImageCommand),
    /// Make a key, or print its number
    #[command(subcommand)]
    Key(key::KeyCommand),
    /// Put a tag behind an image, so that joints with that key take it
    Sign(key::Sign),
    /// Run the firmware's joint against a simulated actuator, without and with compensation
    Sim(sim::Sim),
    /// Find the joints on a CAN bus
    Scan(bus::Scan),
    /// Give node ids to the new joints on a CAN bus
    Address(keep::Address),
    /// A joint on one page
    Info(objects::Info),
    /// Read objects of a joint by name or index
    Get(objects::Get),
    /// Write objects of a joint by name or index
    Set(objects::Set),
    /// Enable a joint without torque until Ctrl-C, then disable it
    Enable(drive::Enable),
    /// Brake a joint and switch it off, whoever commands it
    Disable(drive::Disable),
    /// Enable a joint, move it for a time, disable it
    Move(drive::Move),
    /// From a new board to a turning motor: measure motor and encoder of a joint, set and store them; the joint turns
    Commission(commission::Commission),
    /// Watch a joint in the terminal: curves, state, faults
    Monitor(monitor::Monitor),
    /// Record what a joint does, as a data set for `fit`
    Record(record::Record),
    /// Learn the friction of a joint anew: excite, record, fit, compare, commit where it is better
    Retrain(retrain::Retrain),
    /// Bring a parameter image into a joint: verified, in shadow, on trial or for good
    Upload(upload::Upload),
    /// Go back to the image that a joint had before
    Rollback(upload::RollBack),
    /// Forget the image that is staged in a joint; ends its trial or shadow
    Discard(upload::Discard),
    /// Have a joint keep its configuration over a loss of power
    Store(keep::Keep) => store,
    /// Have a joint forget its configuration: defaults after the next reset
    Restore(keep::Keep) => restore,
    /// Write the electronic data sheet of a joint, for CANopen masters
    Eds(describe::Eds),
    /// Write the frames of joints as a DBC file, for what shows CAN traffic
    Dbc(describe::Dbc),
    /// Write the configuration of ros2_canopen for the joints on a bus: bus.yml, and the EDS beside it
    BusYml(bus_yml::BusYml),
    /// Write a motion that identifies a joint, or check one
    Excite(excite::Excite),
    /// Write the completions of a shell to standard output
    Completions(completions::Completions),
    /// Write the manual pages, one a command, into a folder
    Man(man::Man),
}

/// The program's arguments, with examples at the end of every command's help.
#[must_use]
pub fn arguments() -> clap::Command {
    examples::with_examples(Arguments::command())
}

/// Error that ends a command.
#[derive(Debug, thiserror::Error)]
pub enum CommandError {
    /// The data set.
    #[error(transparent)]
    Dataset(#[from] identification::dataset::DatasetError),
    /// The fit.
    #[error(transparent)]
    Fit(#[from] identification::fit::FitError),
    /// A robot.
    #[error(transparent)]
    Robot(#[from] ::robot::RobotFitError),
    /// The search for a robot's excitation.
    #[error(transparent)]
    RobotExcite(#[from] ::robot::excite::RobotExciteError),
    /// A fitted robot that cannot be used.
    #[error(transparent)]
    RobotEvaluate(#[from] ::robot::evaluate::RobotEvaluateError),
    /// Writing of a fitted robot.
    #[error(transparent)]
    RobotWrite(#[from] ::robot::files::RobotWriteError),
    /// Writing of results.
    #[error(transparent)]
    Output(#[from] report::output::OutputError),
    /// The report.
    #[error(transparent)]
    Report(#[from] identification::page::ReportError),
    /// The virtual joint.
    #[error("virtual joint: {0}")]
    Plant(#[from] plant::ParameterError),
    /// The parameters of a virtual actuator that cannot be used.
    #[error("{}: {reason}", path.display())]
    PlantFile {
        /// The file.
        path: PathBuf,
        /// Reason.
        reason: String,
    },
    /// The configuration of a joint.
    #[error(transparent)]
    Joint(#[from] crate::joint_text::JointTextError),
    /// The simulation.
    #[error("virtual joint: {0}")]
    Simulation(#[from] crate::simulation::SimulationError),
    /// A figure.
    #[error(transparent)]
    Figure(#[from] report::figures::FigureError),
    /// A number that TOML cannot hold.
    #[error("cannot write parameters as TOML: {0}")]
    Toml(#[from] toml::ser::Error),
    /// The search for an excitation.
    #[error("excitation: {0}")]
    Excite(#[from] excitation::ExciteError),
    /// A file with an excitation.
    #[error(transparent)]
    ExcitationFile(#[from] excitation::file::ExcitationFileError),
    /// An excitation that must not be run.
    #[error("{}: {defects}", path.display())]
    Excitation {
        /// The file.
        path: PathBuf,
        /// Defects of it.
        defects: String,
    },
    /// A file that cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Cause.
        source: std::io::Error,
    },
    /// An image that cannot be used.
    #[error("{}: {reason}", path.display())]
    Image {
        /// The file.
        path: PathBuf,
        /// Reason.
        reason: String,
    },
    /// A file that is no image that can be used.
    #[error(transparent)]
    ImageFile(#[from] identification::image_file::ImageFileError),
    /// A key.
    #[error(transparent)]
    Key(#[from] crate::key_file::KeyFileError),
    /// The CAN bus, or a node on it.
    #[error("{0}")]
    Bus(String),
    /// A joint over a bus.
    #[error(transparent)]
    Remote(#[from] crate::remote::RemoteError),
    /// A commissioning.
    #[error(transparent)]
    Commission(#[from] crate::commission::Failure),
    /// A round of learning on a joint.
    #[error(transparent)]
    Retrain(#[from] crate::remote::retrain::RetrainError),
    /// Sums of a fleet.
    #[cfg(feature = "logs")]
    #[error(transparent)]
    Fleet(#[from] ::fleet::night::NightError),
    /// Registry of a fleet.
    #[cfg(feature = "logs")]
    #[error("cannot read or write {}: {source}", path.display())]
    Registry {
        /// Its folder.
        path: PathBuf,
        /// The system's answer.
        source: std::io::Error,
    },
    /// Learning of a fleet's joints after which each keeps the image that it has.
    #[cfg(feature = "logs")]
    #[error("no new image is kept: {changed} joints have changed")]
    NoneKept {
        /// Number of joints that have changed.
        changed: usize,
    },
    /// End by the user of what was under way.
    #[error("{0}")]
    Interrupted(String),
    /// Arguments that contradict each other.
    #[error("{0}")]
    Arguments(String),
}

impl CommandError {
    /// Exit code of the program: 1 failed, 2 wrong arguments (as clap's own), 3 done, and nothing better came of it.
    #[must_use]
    pub const fn exit_code(&self) -> u8 {
        match self {
            Self::Retrain(crate::remote::retrain::RetrainError::NotBetter { .. }) => 3,
            #[cfg(feature = "logs")]
            Self::NoneKept { .. } => 3,
            Self::Arguments(_) => 2,
            Self::Remote(error) if error.is_usage() => 2,
            #[cfg(feature = "logs")]
            Self::Fleet(::fleet::night::NightError::NoJoint { .. }) => 2,
            _ => 1,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::CommandError;
    use crate::remote::RemoteError;
    use crate::remote::retrain::{RetrainError, Shown};

    #[test]
    fn exit_codes_tell_failed_from_wrong_arguments_and_from_nothing_better() {
        let shown = Shown { residual: 1.0, tracking: 0.0, shadow: 0.0 };
        let not_better = RetrainError::NotBetter { node: 5, before: shown, after: shown, load: Vec::new() };
        let unknown = RemoteError::UnknownName { name: "x".into(), near: Vec::new() };
        let cases: [(CommandError, u8); 4] = [
            (CommandError::Bus("gone".into()), 1),
            (CommandError::Interrupted("stopped".into()), 1),
            (unknown.into(), 2),
            (not_better.into(), 3),
        ];
        for (error, expected) in cases {
            assert_eq!(error.exit_code(), expected, "{error}");
        }
    }
}
