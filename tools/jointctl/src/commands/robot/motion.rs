//! `jointctl robot move`: a motion of all joints at once, by computed torque, over a bus.

use crate::commands::CommandError;
use crate::commands::arm::each_turns_alone;
use crate::commands::force::Force;
use crate::commands::remote::{Patience, catch_interrupts, running};
use crate::commands::terminal::Terminal;
use crate::key_file;
use crate::remote::configuration::set;
use crate::remote::robot_motion::{RobotMotion, RobotMoved, Tracked, description};
use crate::remote::{Entry, RemoteError, RemoteJoint, Value};
use ::robot::{Controller, read_robot};
use clap::Args;
use excitation::file::{SAMPLE_PERIOD, read};
use identification::progress::Progress;
use joint_firmware::objects::field::Field;
use joint_firmware::objects::settings::Setting;
use plant::excitation::Reference;
use report::output::{OutputFile, write_directory};
use rigid_body::Robot;
use serde_json::json;
use std::path::PathBuf;

/// Files of `--out`.
const TABLE: &str = "log.csv";
const DESCRIPTION: &str = "recording.toml";
/// Requests of object 2200h:1: nothing, physical model and network.
const REQUESTS: [u64; 2] = [0, 2];

/// Arguments of `robot move`.
#[derive(Debug, Args)]
pub struct RobotMove {
    /// Description of the robot, which names its URDF (docs/robot.md)
    robot: PathBuf,
    /// Folder with the motion, a table JOINT.csv for each joint, as `robot excite` writes it
    #[arg(long, value_name = "DIR")]
    motion: PathBuf,
    /// Folder that `robot fit` wrote: move by its links and rotors, not by the URDF's
    #[arg(long, value_name = "DIR")]
    fitted: Option<PathBuf>,
    /// The bus: socketcan:can0, slcan:/dev/ttyACM0, slcan:tcp://host:port, udp:239.74.163.2:43113
    #[arg(long, value_name = "BUS", env = "JOINTCTL_BUS")]
    bus: String,
    /// Node id of each joint, in the URDF's order; repeatable [default: 1, 2 and so on]
    #[arg(long, value_name = "N")]
    node: Vec<u8>,
    /// The joints' key, where they have one
    #[arg(long, value_name = "FILE", env = "JOINTCTL_KEY")]
    key: Option<PathBuf>,
    /// Longest time for an answer.
    #[command(flatten)]
    patience: Patience,
    /// Bandwidth of the joints' controllers around the model's torque, rad/s: low shows what the model lacks
    #[arg(long, value_name = "RAD/S", default_value_t = 20.0)]
    bandwidth: f64,
    /// Set-points and samples a second
    #[arg(long, value_name = "HZ", default_value_t = 250.0)]
    rate: f64,
    /// Move twice, without compensation and with it, and put back what was requested before
    #[arg(long)]
    compare: bool,
    /// Acknowledge faults whose cause is gone first
    #[arg(long)]
    reset: bool,
    /// Folder for what was recorded: log.csv and recording.toml, which `robot fit` reads; with --compare of the motion
    /// without compensation
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Permission to replace.
    #[command(flatten)]
    force: Force,
    /// Print the figures as JSON
    #[arg(long)]
    json: bool,
}

impl RobotMove {
    /// Runs the command.
    pub fn run(&self) -> Result<(), CommandError> {
        let refused = |text: String| CommandError::Arguments(text);
        if !(1.0..=100.0).contains(&self.bandwidth) {
            return Err(refused(format!("--bandwidth is {} rad/s, must lie in 1 to 100 rad/s", self.bandwidth)));
        }
        if let Some(out) = &self.out {
            self.force.permits_in(out, &[TABLE, DESCRIPTION])?;
        }
        let robot = read_robot(&self.robot, &|name| std::env::var(name).ok())?;
        let names: Vec<String> = robot.tree.joints.iter().map(|joint| joint.name.clone()).collect();
        let nodes = self.nodes(&robot)?;
        let references = self.references(&names)?;
        let controller = match &self.fitted {
            Some(folder) => Controller::of_fitted(robot, &self.robot, folder, self.bandwidth)?,
            None => Controller::of_urdf(robot, self.bandwidth),
        };
        let network = self.patience.network(&self.bus)?;
        let key = self.key.as_deref().map(key_file::read).transpose()?;
        let joint = |node: &u8| {
            let joint = RemoteJoint::on(&network, *node)?;
            Ok(match &key {
                Some(key) => joint.owned_by(key.clone()),
                None => joint,
            })
        };
        let joints = nodes.iter().map(joint).collect::<Result<Vec<RemoteJoint>, RemoteError>>()?;
        catch_interrupts()?;
        let progress = Terminal::new();
        let moves = |reset: bool, stage: &str| {
            progress.stage(stage);
            let motion = RobotMotion {
                controller: &controller,
                references: references.clone(),
                rate: self.rate,
                acknowledge: reset,
            };
            let moved = motion.run(&joints, &running)?;
            moved.ok_or_else(|| CommandError::Interrupted("the motion was interrupted; all joints are disabled".into()))
        };
        let moved = if self.compare {
            let requested = Requested::of(&joints)?;
            requested.set(REQUESTS[0])?;
            let off = moves(self.reset, "move without compensation")?;
            requested.set(REQUESTS[1])?;
            vec![off, moves(false, "move with compensation")?]
        } else {
            vec![moves(self.reset, "move")?]
        };
        progress.finish();
        if let (Some(out), Some(first)) = (&self.out, moved.first()) {
            let robot = std::path::absolute(&self.robot).unwrap_or_else(|_| self.robot.clone());
            let described = description(&robot.to_string_lossy(), TABLE, &names);
            write_directory(
                out,
                &[OutputFile::new(TABLE, first.table(&names)), OutputFile::new(DESCRIPTION, described)],
            )?;
        }
        self.print(&names, &nodes, &moved);
        Ok(())
    }

    fn nodes(&self, robot: &Robot) -> Result<Vec<u8>, CommandError> {
        let joints = robot.tree.len();
        let refused = |reason: String| CommandError::Arguments(format!("{}: {reason}", self.robot.display()));
        each_turns_alone(robot, &self.robot)?;
        if let Some(twice) = self.node.iter().enumerate().find(|(i, node)| self.node[..*i].contains(node)) {
            return Err(refused(format!("--node {} is given for two joints", twice.1)));
        }
        match self.node.len() {
            0 => Ok((1..=joints as u8).collect()),
            given if given == joints => Ok(self.node.clone()),
            given => Err(refused(format!("it has {joints} joints, --node is given {given} times"))),
        }
    }

    /// The motion of each joint, as many samples for each.
    fn references(&self, names: &[String]) -> Result<Vec<Vec<Reference>>, CommandError> {
        let mut references: Vec<Vec<Reference>> = Vec::new();
        for name in names {
            let file = self.motion.join(format!("{name}.csv"));
            let refused = |reason: String| CommandError::Arguments(format!("{}: {reason}", file.display()));
            let samples = read(&file)?;
            let apart = samples.time.windows(2).map(|pair| pair[1] - pair[0]);
            if let Some(apart) = apart.into_iter().find(|apart| (apart - SAMPLE_PERIOD).abs() > 0.1 * SAMPLE_PERIOD) {
                return Err(refused(format!("samples are {apart} s apart, expected {SAMPLE_PERIOD} s")));
            }
            if let Some(first) = references.first().filter(|first| first.len() != samples.motion.len()) {
                let (found, expected) = (samples.motion.len(), first.len());
                return Err(refused(format!("{found} samples, those of joint {} are {expected}", names[0])));
            }
            references.push(samples.motion);
        }
        Ok(references)
    }

    fn print(&self, names: &[String], nodes: &[u8], moved: &[RobotMoved]) {
        let tracked: Vec<Vec<Tracked>> = moved.iter().map(RobotMoved::tracked).collect();
        let titles: &[&str] = if self.compare { &["without", "with"] } else { &["moved"] };
        if self.json {
            let of = |joint: usize| {
                let mut value = json!({ "joint": names[joint], "node": nodes[joint] });
                for (title, tracked) in titles.iter().zip(&tracked) {
                    let Some(Tracked { rms, largest, torque }) = tracked.get(joint) else { continue };
                    value[*title] = json!({ "rms_rad": rms, "largest_rad": largest, "torque_rms_Nm": torque });
                }
                value
            };
            let all: Vec<_> = (0..names.len()).map(of).collect();
            println!("{:#}", serde_json::Value::Array(all));
            return;
        }
        for ((title, tracked), moved) in titles.iter().zip(&tracked).zip(moved) {
            println!("{:<24}{:>6}{:>14}{:>14}{:>14}", title, "node", "RMS, mrad", "largest, mrad", "torque, Nm");
            for ((name, node), of) in names.iter().zip(nodes).zip(tracked) {
                let Tracked { rms, largest, torque } = of;
                println!("{name:<24}{node:>6}{:>14.2}{:>14.2}{torque:>14.3}", 1e3 * rms, 1e3 * largest);
            }
            println!("{} samples of all joints, {} SYNCs without one", moved.rows.len(), moved.unanswered);
        }
        if let [off, on] = tracked.as_slice() {
            let all = |tracked: &[Tracked]| tracked.iter().map(|of| of.rms * of.rms).sum::<f64>().sqrt();
            println!("compensation: position error {:.1} times smaller", all(off) / all(on));
        }
        if let Some(out) = &self.out {
            println!("Written: {}, {}", out.join(TABLE).display(), out.join(DESCRIPTION).display());
        }
    }
}

/// Requests of the compensation as they were before; put back when this is dropped.
struct Requested<'j> {
    joints: &'j [RemoteJoint],
    before: Vec<u64>,
}

impl<'j> Requested<'j> {
    fn of(joints: &'j [RemoteJoint]) -> Result<Self, RemoteError> {
        let raw = |joint: &RemoteJoint| joint.raw(Field::AtOnce(Setting::Request));
        Ok(Self { joints, before: joints.iter().map(raw).collect::<Result<_, _>>()? })
    }

    fn set(&self, request: u64) -> Result<(), RemoteError> {
        self.joints.iter().try_for_each(|joint| requested(joint, request))
    }
}

impl Drop for Requested<'_> {
    fn drop(&mut self) {
        for (joint, before) in self.joints.iter().zip(&self.before) {
            // The error that brought us here is what is reported.
            let _ = requested(joint, *before);
        }
    }
}

fn requested(joint: &RemoteJoint, request: u64) -> Result<(), RemoteError> {
    let entry = Entry::of(Field::AtOnce(Setting::Request));
    set(joint, &[(entry, Value::Integer(request.into()))])
}
