//! `jointctl commission`: from a new board to a turning motor.

use super::CommandError;
use super::force::Force;
use super::remote::{Where, catch_interrupts, running};
use crate::commission::joint::Joint;
use crate::commission::{Failure, Guide, Plan, Stage, Stopped, commission, find_index, page};
use crate::remote::RemoteJoint;
use crate::remote::commission::RemoteObjects;
use clap::Args;
use joint_firmware::objects::field::Field;
use joint_firmware::objects::settings::Setting;
use report::output::write_directory;
use std::io::{IsTerminal, Write as _};
use std::path::PathBuf;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

/// Time between two looks at whether the user has asked to stop.
const LOOK: Duration = Duration::from_millis(50);

/// Arguments of `commission`.
#[derive(Debug, Args)]
pub struct Commission {
    /// Which joint.
    #[command(flatten)]
    on: Where,
    /// Current that the rotor is held and turned with, A: enough to overcome friction and load with ease
    #[arg(long, value_name = "A")]
    current: f64,
    /// Largest current of the motor, A, by its data sheet; at least 1.3 times --current [default: the joint's]
    #[arg(long, value_name = "A")]
    current_limit: Option<f64>,
    /// Pole pairs by the data sheet, to compare with what is counted
    #[arg(long, value_name = "P")]
    pole_pairs: Option<u32>,
    /// Counts a turn of an incremental encoder: four times its lines [default: the joint's]
    #[arg(long, value_name = "C")]
    counts: Option<u32>,
    /// Torque constant at the rotor, Nm/A of q current, by the data sheet [default: the joint's; a new one's by
    /// back-EMF]
    #[arg(long, value_name = "K")]
    torque_constant: Option<f64>,
    /// Rotor revolutions per revolution of the joint; negative where a positive rotor turns it backwards [default: the
    /// joint's]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    gear: Option<f64>,
    /// The joint's present position, rad [default: as before; 0 on a new joint]
    #[arg(long, value_name = "POSITION", allow_negative_numbers = true)]
    zero: Option<f64>,
    /// Turns of the rotor to each side that the joint is free to make, 0.05 to 1
    #[arg(long, value_name = "TURNS", default_value_t = 1.0)]
    travel: f64,
    /// At the end the joint holds a load of this torque, Nm, to check the torque constant by
    #[arg(long, value_name = "NM", allow_negative_numbers = true)]
    load: Option<f64>,
    /// At the end the joint swings this inertia, kg m^2 at the joint with the rotor's, to check the torque constant
    /// by; balanced, no load
    #[arg(long, value_name = "KG_M2")]
    inertia: Option<f64>,
    /// Do not turn the motor with the new configuration at the end
    #[arg(long)]
    no_turn: bool,
    /// Only find the index of an incremental encoder, with the constants that the joint has stored: after each
    /// power-up
    #[arg(long)]
    index_only: bool,
    /// Ask nothing: the joint is free to turn
    #[arg(long)]
    yes: bool,
    /// Acknowledge a fault whose cause is gone first
    #[arg(long)]
    reset: bool,
    /// Folder for commission.html and commission.toml; other files in it are left alone [default: commission-N]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Permission to replace.
    #[command(flatten)]
    force: Force,
    /// Print the settings that the joint took as a JSON object; what is done meanwhile goes to standard error
    #[arg(long)]
    json: bool,
}

impl Commission {
    /// Runs the command.
    pub fn run(&self) -> Result<(), CommandError> {
        let asks = !self.yes;
        if asks && !std::io::stdin().is_terminal() {
            return Err(CommandError::Arguments(
                "commission asks before the motor turns, and standard input is no terminal: run it in one, or with --yes where \
                 the joint is free to turn"
                    .into(),
            ));
        }
        let mut plan = Plan {
            current: self.current,
            current_limit: self.current_limit,
            pole_pairs: self.pole_pairs,
            counts: self.counts,
            torque_constant: self.torque_constant,
            gear: self.gear,
            zero: self.zero,
            travel: self.travel,
            load: self.load,
            inertia: self.inertia,
            turn: !self.no_turn,
            acknowledge: self.reset,
        };
        plan.check()?;
        let joint = self.on.joint()?;
        let node = joint.id();
        joint.require_configuration()?;
        catch_interrupts()?;
        let mut guide = Terminal { asks, aside: self.json };
        if asks && !self.index_only {
            guide.ask_for_what_is_missing(&joint, &mut plan)?;
        }
        let mut bench = Joint::new(RemoteObjects::new(joint, &running));
        if self.index_only {
            find_index(&mut bench, &plan, &mut guide)?;
            match self.json {
                true => println!("{:#}", serde_json::json!({ "node": node, "index_found": true })),
                false => println!("node {node}: the encoder knows its zero until its next loss of power"),
            }
            return Ok(());
        }
        let out = self.out.clone().unwrap_or_else(|| PathBuf::from(format!("commission-{node}")));
        self.force.permits_in(&out, &page::FILES)?;
        let found = commission(&mut bench, &plan, &mut guide)?;
        write_directory(&out, &page::files(&found, node)?)?;
        if self.json {
            let mut value = page::json(&found, node);
            value["report"] = serde_json::json!(out.join("commission.html"));
            println!("{value:#}");
            return Ok(());
        }
        println!("node {node}: commissioned. Written: {}", out.join("commission.html").display());
        if found.index.is_some() {
            println!("After each power-up: `jointctl commission --index-only --current {}`", self.current);
        }
        Ok(())
    }
}

/// Someone at a terminal.
struct Terminal {
    asks: bool,
    /// Standard output is for a result alone.
    aside: bool,
}

impl Terminal {
    /// Tells what is done.
    fn tell(&self, text: &str) {
        match self.aside {
            true => eprintln!("{text}"),
            false => println!("{text}"),
        }
    }

    /// Numbers of gear and motor that no measurement gives, where no option says them.
    fn ask_for_what_is_missing(&self, joint: &RemoteJoint, plan: &mut Plan) -> Result<(), CommandError> {
        for (what, setting, wanted) in [
            ("Gear ratio, rotor revolutions per revolution of the joint", Setting::GearRatio, &mut plan.gear),
            ("Torque constant by the data sheet, Nm/A", Setting::TorqueConstant, &mut plan.torque_constant),
        ] {
            if wanted.is_some() {
                continue;
            }
            // The joint's number has the digits of 32 bits.
            let kept = joint.number(Field::Setting(setting))? as f32;
            let rest = if setting == Setting::TorqueConstant {
                "; a new joint without one takes what it measures"
            } else {
                ""
            };
            *wanted = loop {
                let text = self.line(&format!("{what} [Enter keeps {kept}{rest}]: "))?;
                match text.trim() {
                    "" => break None,
                    number => match number.parse() {
                        Ok(number) => break Some(number),
                        Err(_) => self.tell(&format!("'{number}' is no number")),
                    },
                }
            };
        }
        Ok(plan.check()?)
    }

    /// A line of the user's; an interrupt while it is waited for ends the command.
    fn line(&self, question: &str) -> Result<String, Failure> {
        // A terminal that cannot be written to cannot be read either.
        let _ = match self.aside {
            true => write!(std::io::stderr(), "{question}"),
            false => write!(std::io::stdout(), "{question}").and_then(|()| std::io::stdout().flush()),
        };
        let (sender, receiver) = channel();
        std::thread::spawn(move || {
            let mut text = String::new();
            let read = std::io::stdin().read_line(&mut text);
            let _ = sender.send(read.ok().filter(|bytes| *bytes > 0).map(|_| text));
        });
        loop {
            match receiver.recv_timeout(LOOK) {
                Ok(Some(text)) => return Ok(text),
                Ok(None) | Err(RecvTimeoutError::Disconnected) => return Err(Failure::Declined),
                Err(RecvTimeoutError::Timeout) if !running() => {
                    self.tell("");
                    return Err(Stopped::Interrupted.into());
                }
                Err(RecvTimeoutError::Timeout) => {}
            }
        }
    }
}

impl Guide for Terminal {
    fn stage(&mut self, stage: Stage) {
        self.tell(&page::headline(stage));
    }

    fn found(&mut self, text: &str) {
        self.tell(&format!("    {text}"));
    }

    fn agrees(&mut self, question: &str) -> bool {
        if !self.asks {
            return true;
        }
        let answer = self.line(&format!("{question} [y/N] "));
        answer.is_ok_and(|answer| matches!(answer.trim(), "y" | "Y" | "yes"))
    }
}
