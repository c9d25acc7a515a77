//! `jointctl robot excite`: a motion of all joints at once that identifies a robot.

use crate::commands::CommandError;
use crate::commands::force::Force;
use crate::commands::terminal::Terminal;
use ::robot::excite::files::{COEFFICIENTS, files, summary, table};
use ::robot::excite::search::search;
use ::robot::excite::{Effort, Task};
use ::robot::read_robot;
use clap::Args;
use identification::progress::Progress;
use report::output::write_directory;
use std::path::PathBuf;

/// Arguments of `robot excite`.
#[derive(Debug, Args)]
pub struct RobotExcite {
    /// Description of the robot, which names its URDF (docs/robot.md)
    robot: PathBuf,
    /// Folder for the table of every joint, JOINT.csv, and for excitation.toml
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Permission to replace.
    #[command(flatten)]
    force: Force,
    /// Largest acceleration of joints without one in the robot's file, rad/s^2 (m/s^2)
    #[arg(long, value_name = "A")]
    acceleration: Option<f64>,
    /// Least height of all moving links' frames above the base's origin, m [default: `floor` of the robot's file]
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    floor: Option<f64>,
    /// Duration, s
    #[arg(long, value_name = "S", default_value_t = Effort::THOROUGH.duration)]
    duration: f64,
    /// Harmonics of each joint
    #[arg(long, value_name = "N", default_value_t = Effort::THOROUGH.harmonics)]
    harmonics: usize,
    /// Motions drawn at random; the best are improved
    #[arg(long, value_name = "N", default_value_t = Effort::THOROUGH.draws)]
    draws: usize,
    /// Rounds of changes over all coefficients
    #[arg(long, value_name = "N", default_value_t = Effort::THOROUGH.rounds)]
    rounds: usize,
    /// Seed of the search: the same seed gives the same motion
    #[arg(long, value_name = "N", default_value_t = Effort::THOROUGH.seed)]
    seed: u64,
    /// Print extremes and condition numbers as JSON
    #[arg(long)]
    json: bool,
}

impl RobotExcite {
    /// Runs the command.
    pub fn run(&self) -> Result<(), CommandError> {
        let progress = Terminal::new();
        let robot = read_robot(&self.robot, &|name| std::env::var(name).ok())?;
        let tables = robot.tree.joints.iter().map(|joint| self.out.join(format!("{}.csv", joint.name)));
        self.force.permits(tables.chain([self.out.join(COEFFICIENTS)]))?;
        let mut task = Task::of(&robot, &self.robot, self.acceleration)?;
        task.floor = self.floor.or(task.floor);
        let effort = Effort {
            duration: self.duration,
            harmonics: self.harmonics,
            draws: self.draws,
            restarts: Effort::THOROUGH.restarts.min(self.draws),
            rounds: self.rounds,
            seed: self.seed,
        };
        progress.stage("search");
        let found = search(&task, &effort)?;
        progress.finish();
        write_directory(&self.out, &files(&task, &effort, &found)?)?;
        match self.json {
            true => println!("{}", summary(&task, &found)),
            false => println!("{}\nwritten to {}", table(&task, &found), self.out.display()),
        }
        Ok(())
    }
}
