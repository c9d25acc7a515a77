//! `jointctl sim`: the firmware's joint in closed loop with the simulated actuator, without and with compensation.

use super::CommandError;
use super::arm::ArmChoice;
use super::bus::OnBus;
use super::force::Force;
use super::image::read;
use super::joint::JointChoice;
use super::on_board::OnBoard;
use super::terminal::Terminal;
use crate::joint_text;
use crate::simulation::page::{Shown, page};
use crate::simulation::run::USUAL_SAMPLE_PERIOD;
use crate::simulation::table::{Line, json, table};
use crate::simulation::{Choices, Log, Part, Run, Scenario, SimulationError, judge, log, run};
use clap::Args;
use excitation::file;
use friction_compensation::compensation::Request;
use friction_compensation::friction::FrictionModel;
use identification::image_file::verify;
use identification::progress::Progress;
use plant::virtual_joint::Setup;
use rayon::prelude::*;
use report::output::{OutputFile, write_directory};
use std::path::PathBuf;
use std::time::Instant;

/// Arguments of `sim`.
#[derive(Debug, Args)]
pub struct Sim {
    /// The joint.
    #[command(flatten)]
    joint: JointChoice,
    /// Parameter image of its friction, binary or TOML; with one, every scenario is run with compensation too
    #[arg(long, value_name = "FILE")]
    image: Option<PathBuf>,
    /// What the joint is put through; repeatable [default: every scenario]
    #[arg(long, value_name = "NAME", value_enum)]
    scenario: Vec<Scenario>,
    /// Motion of the scenario "excitation", as `excite` writes it: a table, or with the ending .toml its coefficients
    #[arg(long, value_name = "FILE")]
    excitation: Option<PathBuf>,
    /// Seed of the sensors' noise
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Time between two rows of a log, s
    #[arg(long, value_name = "S", default_value_t = USUAL_SAMPLE_PERIOD)]
    sample_period: f64,
    /// The bus.
    #[command(flatten)]
    on_bus: OnBus,
    /// The arm.
    #[command(flatten)]
    arm: ArmChoice,
    /// The program of a board.
    #[command(flatten)]
    on_board: OnBoard,
    /// Folder for logs, page, and the files that describe joint and actuator
    #[arg(long, value_name = "DIR", default_value = "sim")]
    out: PathBuf,
    /// Permission to replace.
    #[command(flatten)]
    force: Force,
    /// Print the table as a JSON array, an object for each row
    #[arg(long, conflicts_with = "bus")]
    json: bool,
}

/// A part of a scenario that is run once.
struct Task {
    scenario: Scenario,
    compensated: bool,
    part: Part,
}

/// Result of the run, and the time that it took, s.
struct Done {
    run: Run,
    elapsed: f64,
}

impl Sim {
    /// Runs the command.
    pub fn run(&self) -> Result<(), CommandError> {
        let progress = Terminal::new();
        if !(1e-4..=0.1).contains(&self.sample_period) {
            let text = format!("--sample-period is {} s, must lie in 0.0001 to 0.1 s", self.sample_period);
            return Err(CommandError::Arguments(text));
        }
        if let (Some(bus), true) = (self.on_bus.bus(), self.on_board.is_named()) {
            let (behind, storage) = (self.joint.behind()?, self.on_bus.storage());
            return self.on_bus.until_the_end(|stop| self.on_board.run(bus, &behind, storage, stop));
        }
        if let (Some(bus), Some(arm)) = (self.on_bus.bus(), self.arm.read()?) {
            return self.on_bus.run_arm(bus, arm);
        }
        let (plant, setup) = self.joint.read()?;
        if let Some(bus) = self.on_bus.bus() {
            let image = self.image.as_deref().map(read).transpose()?;
            if let (Some(image), Some(path)) = (&image, &self.image) {
                verify(image, path)?;
            }
            return self.on_bus.run(bus, &plant, &setup, image.as_ref());
        }
        self.force.permits_in(&self.out, &["joint.toml", "plant.toml", "sim.html"])?;
        let friction = self.friction(&setup)?;
        let samples = self.excitation.as_deref().map(file::read).transpose()?;
        let mut scenarios = if self.scenario.is_empty() { Scenario::ALL.to_vec() } else { self.scenario.clone() };
        // A scenario that is named twice is run once.
        let mut seen = Vec::new();
        scenarios.retain(|scenario| {
            !seen.contains(scenario) && {
                seen.push(*scenario);
                true
            }
        });

        progress.stage("simulate");
        let mut tasks = Vec::new();
        for &scenario in &scenarios {
            for part in scenario.parts(&plant, self.seed, samples.as_ref())? {
                if friction.is_some() {
                    tasks.push(Task { scenario, compensated: false, part: part.clone() });
                }
                tasks.push(Task { scenario, compensated: friction.is_some(), part });
            }
        }
        let choices = Choices { seed: self.seed, sample_period: self.sample_period };
        let done = tasks
            .par_iter()
            .map(|task| {
                let request = match (task.compensated, setup.configuration.compensation.request) {
                    (false, _) => Request::Off,
                    (true, Request::Off) => Request::PhysicalAndNetwork,
                    (true, request) => request,
                };
                let start = Instant::now();
                let model = friction.as_ref().filter(|_| task.compensated);
                let run = run(&task.part, &setup.compensating(request), model, &choices)?;
                Ok(Done { run, elapsed: start.elapsed().as_secs_f64() })
            })
            .collect::<Result<Vec<Done>, SimulationError>>()?;

        progress.stage("judge");
        let standstill = f64::from(setup.configuration.compensation.standstill_velocity);
        let lines = lines(&tasks, &done, standstill)?;
        let simulated: f64 = done.iter().map(|done| done.run.simulated).sum();
        let elapsed: f64 = done.iter().map(|done| done.elapsed).sum();
        let speed = format!(
            "{simulated:.1} s simulated at {:.0} Hz, {:.0} times faster than real time on one core",
            setup.bridge.rate,
            simulated / elapsed.max(1e-9)
        );

        progress.stage("write");
        let joint = joint_text::to_text(&setup.configuration)?;
        let actuator = toml::to_string(&plant)?;
        let mut files = vec![OutputFile::new("joint.toml", joint), OutputFile::new("plant.toml", actuator)];
        let mut shown = Vec::new();
        for &scenario in &scenarios {
            let logs = |compensated| logs(scenario, compensated, &tasks, &done);
            for (compensated, name) in [(false, "off"), (true, "on")] {
                let logs = logs(compensated);
                if !logs.is_empty() {
                    let table = log::csv(logs.iter().copied());
                    files.push(OutputFile::new(format!("{}-{name}.csv", scenario.name()), table));
                }
            }
            let [off, on] =
                [false, true].map(|compensated| logs(compensated).into_iter().map(|(_, log)| log).collect());
            shown.push(Shown { name: scenario.name(), off, on });
        }
        let page = page("Simulated joint", &lines, &format!("{speed}."), &shown)?;
        files.push(OutputFile::new("sim.html", page));
        write_directory(&self.out, &files)?;
        progress.finish();
        if self.json {
            println!("{:#}", json(&lines));
            return Ok(());
        }
        print!("{}", table(&lines));
        if friction.is_none() {
            println!("Without --image there is no friction model: compensation stays off.");
        }
        println!("{speed}. Written: {}", self.out.join("sim.html").display());
        Ok(())
    }

    /// The friction model of the image, checked as a joint would.
    fn friction(&self, setup: &Setup) -> Result<Option<FrictionModel>, CommandError> {
        let Some(path) = &self.image else { return Ok(None) };
        let image = read(path)?;
        verify(&image, path)?;
        if image.effort.symbol() != "Nm" {
            let reason = format!("its effort is in {}, compensation needs Nm at the joint", image.effort.symbol());
            return Err(CommandError::Image { path: path.clone(), reason });
        }
        Ok(Some(FrictionModel::new(&image.friction, setup.bridge.motion_rate())))
    }
}

/// The logs of one scenario, with their parts' names.
fn logs<'a>(scenario: Scenario, compensated: bool, tasks: &[Task], done: &'a [Done]) -> Vec<(&'static str, &'a Log)> {
    let belongs = |task: &Task| task.scenario == scenario && task.compensated == compensated;
    let both = tasks.iter().zip(done).filter(|(task, _)| belongs(task));
    both.map(|(task, done)| (task.part.name, &done.run.log)).collect()
}

/// A row of the table for each part, without and with compensation.
fn lines(tasks: &[Task], done: &[Done], standstill: f64) -> Result<Vec<Line>, SimulationError> {
    let several = |scenario| {
        let parts = tasks.iter().filter(|task| task.scenario == scenario && !task.compensated);
        parts.count() > 1
    };
    let line = |(task, done): (&Task, &Done)| {
        let judgement = judge([(task.part.tracks, &done.run.log)], standstill)?;
        let part = several(task.scenario).then_some(task.part.name);
        let (scenario, ending) = (task.scenario.name(), done.run.ending);
        Ok(Line { scenario, part, compensated: task.compensated, judgement, ending })
    };
    tasks.iter().zip(done).map(line).collect()
}
