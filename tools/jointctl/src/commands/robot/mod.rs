//! `jointctl robot`: all joints of a robot, a file for each command.

pub mod evaluate;
pub mod excite;
pub mod fit;
pub mod motion;

use super::CommandError;
use clap::Subcommand;

/// Commands for all joints of a robot.
#[derive(Debug, Subcommand)]
pub enum RobotCommand {
    /// Identify rigid bodies and the friction image of every joint from one recording
    Fit(Box<fit::RobotFit>),
    /// Write a motion of all joints at once that identifies a robot within its limits
    Excite(excite::RobotExcite),
    /// Judge a fitted robot, links and images, on another recording
    Evaluate(evaluate::RobotEvaluate),
    /// Move all joints at once by computed torque, over a bus, and record them
    Move(Box<motion::RobotMove>),
}

impl RobotCommand {
    /// Runs the command.
    pub fn run(&self) -> Result<(), CommandError> {
        match self {
            Self::Fit(fit) => fit.run(),
            Self::Excite(excite) => excite.run(),
            Self::Evaluate(evaluate) => evaluate.run(),
            Self::Move(motion) => motion.run(),
        }
    }
}
