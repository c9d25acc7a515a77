//! `jointctl demo`: the whole round on a virtual joint that nobody has to own: excite, record, fit, and move with the
//! image.

use super::CommandError;
use super::fit::{Choices, FILES, print_summary, write};
use super::force::Force;
use super::terminal::Terminal;
use crate::simulation::page::{Shown, page};
use crate::simulation::recording::{DESCRIPTION, record};
use crate::simulation::table::{Line, json, table};
use crate::simulation::{self, Choices as RunChoices, Run, Scenario, SimulationError, judge};
use clap::Args;
use friction_compensation::compensation::Request;
use friction_compensation::friction::FrictionModel;
use identification::dataset::prepare;
use identification::fit::fit;
use identification::page::{ReportError, numbers};
use identification::progress::Progress;
use plant::ActuatorParameters;
use plant::virtual_joint::Setup;
use rayon::prelude::*;
use report::output::{OutputFile, write_directory};
use std::path::PathBuf;

/// Scenarios of the joint before and after.
const SCENARIOS: [Scenario; 2] = [Scenario::SlowReversal, Scenario::PayloadChange];

/// Arguments of `demo`.
#[derive(Debug, Args)]
pub struct Demo {
    /// Folder for the log, its description, image, reports and figures
    #[arg(long, value_name = "DIR", default_value = "demo")]
    out: PathBuf,
    /// Draw the joint at random, from this seed, instead of the reference joint
    #[arg(long, value_name = "N")]
    joint: Option<u64>,
    /// Permission to replace.
    #[command(flatten)]
    force: Force,
    /// Choices of the fit.
    #[command(flatten)]
    choices: Choices,
    /// Print the content of report.json, and the rows of the loop, as a JSON object
    #[arg(long)]
    json: bool,
}

impl Demo {
    /// Runs the command.
    pub fn run(&self) -> Result<(), CommandError> {
        let options = self.choices.options()?;
        self.force.permits_in(&self.out, &[&FILES[..], &["log.csv", "dataset.toml", "loop.html"]].concat())?;
        let progress = Terminal::new();
        progress.stage("excite the virtual joint and record it");
        let plant = self.joint.map_or_else(ActuatorParameters::reference, ActuatorParameters::randomised).aligned();
        let setup = Setup::of(&plant);
        let log = record(&plant, &setup, options.seed)?;
        write_directory(&self.out, &[OutputFile::new("log.csv", log), OutputFile::new("dataset.toml", DESCRIPTION)])?;
        progress.stage("load and clean");
        let mut prepared = prepare(&self.out.join("dataset.toml"))?;
        let mut fitted = fit(&mut prepared, &options, &progress)?;
        for parameter in &mut fitted.report.parameters {
            parameter.truth = truth(&plant, &parameter.symbol);
        }
        progress.stage("move without and with the image");
        let model = FrictionModel::new(&fitted.image.friction, setup.bridge.motion_rate());
        let moved = moved(&plant, &setup, &model, options.seed)?;
        let lines: Vec<Line> = moved.iter().map(|moved| moved.line.clone()).collect();
        progress.stage("write");
        write(&fitted, &self.out)?;
        let shown: Vec<Shown> = SCENARIOS.iter().map(|&scenario| shown(scenario, &moved)).collect();
        let page = page("The virtual joint without and with compensation", &lines, "", &shown)?;
        write_directory(&self.out, &[OutputFile::new("loop.html", page)])?;
        progress.finish();
        if self.json {
            let report: serde_json::Value =
                serde_json::from_str(&numbers(&fitted.report)?).map_err(ReportError::from)?;
            println!("{:#}", serde_json::json!({ "report": report, "in_the_loop": json(&lines) }));
            return Ok(());
        }
        print_summary(&prepared, &fitted, &self.out);
        println!("\nIn the loop, without and with the image:");
        print!("{}", table(&lines));
        println!("Written: {}", self.out.join("loop.html").display());
        Ok(())
    }
}

/// The true value of an identified parameter, where the plant has one that means the same: its dry friction at 25 °C,
/// without the gear's load and the ripple over position.
fn truth(plant: &ActuatorParameters, symbol: &str) -> Option<f64> {
    let joint = &plant.joint;
    let friction = &joint.friction;
    match symbol {
        "I" => Some(joint.inertia()),
        "g_s" => Some(joint.load.gravity_amplitude()),
        "F_c+" => Some(friction.coulomb.forward),
        "F_c-" => Some(friction.coulomb.backward),
        "F_brk+" => Some(friction.breakaway.forward),
        "F_brk-" => Some(friction.breakaway.backward),
        "1/v_st" => Some(1.0 / friction.stribeck_velocity),
        "f_v" => Some(0.5 * (friction.viscous.forward + friction.viscous.backward)),
        _ => None,
    }
}

/// A part of a scenario that was run.
struct Moved {
    scenario: Scenario,
    line: Line,
    run: Run,
}

/// Every part of every scenario, without and with the model.
fn moved(
    plant: &ActuatorParameters,
    setup: &Setup,
    model: &FrictionModel,
    seed: u64,
) -> Result<Vec<Moved>, SimulationError> {
    let standstill = f64::from(setup.configuration.compensation.standstill_velocity);
    let mut tasks = Vec::new();
    for scenario in SCENARIOS {
        let parts = scenario.parts(plant, seed, None)?;
        let several = parts.len() > 1;
        for part in parts {
            for (request, model) in [(Request::Off, None), (Request::PhysicalAndNetwork, Some(model))] {
                tasks.push((scenario, several, part.clone(), request, model));
            }
        }
    }
    let one = |(scenario, several, part, request, model): &(Scenario, bool, simulation::Part, _, Option<_>)| {
        let choices = RunChoices { seed, ..RunChoices::default() };
        let run = simulation::run(part, &setup.compensating(*request), *model, &choices)?;
        let line = Line {
            scenario: scenario.name(),
            part: several.then_some(part.name),
            compensated: model.is_some(),
            judgement: judge([(part.tracks, &run.log)], standstill)?,
            ending: run.ending,
        };
        Ok(Moved { scenario: *scenario, line, run })
    };
    tasks.par_iter().map(one).collect()
}

fn shown(scenario: Scenario, moved: &[Moved]) -> Shown<'_> {
    let logs = |compensated: bool| {
        let of_it = moved.iter().filter(|moved| moved.scenario == scenario && moved.line.compensated == compensated);
        of_it.map(|moved| &moved.run.log).collect()
    };
    Shown { name: scenario.name(), off: logs(false), on: logs(true) }
}
