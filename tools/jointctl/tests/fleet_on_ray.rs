//! A night on Ray (`tools/python/fleet_on_ray`): two workers, four, and one process write the same bytes,
//! whichever worker or driver is killed meanwhile.
//!
//! Without Python, or where Ray cannot be installed, these are reported as ignored by name; with `CI` set they
//! run, and fail. Kills are chosen instants of a night, and want a machine that does nothing else: they run where
//! `FLEET_KILLS`, the number of instants at which a worker is killed (up to 20), is set.

#[path = "../../fleet/tests/fleet_of_joints/mod.rs"]
mod fleet_of_joints;

use fleet_of_joints::DAYS;
use libtest_mimic::{Arguments, Failed, Trial};
use python::{FLEET_ON_RAY, RAY};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

/// Healthy joints, joints with a bad day, and of those that changed three of which new images are better.
const JOINTS: [usize; 12] = [0, 1, 2, 3, 7, 8, 11, 17, 23, 29, 35, 37];

fn main() {
    let mut arguments = Arguments::from_args();
    // A Ray at a time.
    arguments.test_threads.get_or_insert(1);
    let must_run = std::env::var_os("CI").is_some();
    let python = if arguments.list { None } else { RAY.python(env!("CARGO_TARGET_TMPDIR")) };
    let ignored = !must_run && (python.is_none() || !cfg!(target_os = "linux"));
    let kills = std::env::var_os("FLEET_KILLS").is_some();
    let trial = |(name, file, test): (&str, &'static str, &'static str)| {
        let (python, asked_for) = (python.clone(), kills || test != "Cluster");
        Trial::test(name, move || pass(python.as_deref(), file, test)).with_ignored_flag(ignored || !asked_for)
    };
    let nights = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/fleet_on_ray.py");
    let trials = [
        ("arguments_files_and_steps_without_ray", concat!(env!("CARGO_MANIFEST_DIR"), "/../python/tests/night.py"), ""),
        (
            "two_and_four_workers_give_the_files_of_one_process",
            nights,
            "OnOneMachine.test_two_and_four_workers_give_the_files_of_one_process",
        ),
        (
            "ctrl_c_ends_a_night_without_a_half_and_it_goes_on_from_there",
            nights,
            "OnOneMachine.test_ctrl_c_ends_a_night_without_a_half_and_it_goes_on_from_there",
        ),
        ("a_worker_or_driver_that_is_killed_costs_nothing_but_its_task", nights, "Cluster"),
    ];
    libtest_mimic::run(&arguments, trials.map(trial).into()).exit();
}

fn pass(python: Option<&Path>, file: &str, test: &str) -> Result<(), Failed> {
    let python = RAY.required(python)?;
    let (fleet, expected) = expected();
    let mut command = Command::new(python);
    // Without a name all tests of a file.
    command.arg(file).arg("--verbose").args(Some(test).filter(|test| !test.is_empty()));
    command.env("PYTHONPATH", FLEET_ON_RAY).env("PYTHONDONTWRITEBYTECODE", "1");
    command.env("JOINTCTL", env!("CARGO_BIN_EXE_jointctl")).env("FLEET", fleet).env("EXPECTED", expected);
    let output = command.env_remove("RAY_ADDRESS").output()?;
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    // unittest succeeds where it finds no test.
    match output.status.success() && !text.contains("Ran 0 tests") {
        true => Ok(()),
        false => Err(text.into()),
    }
}

/// The fleet, and a folder with the files of one process, made once.
fn expected() -> &'static (PathBuf, PathBuf) {
    static EXPECTED: OnceLock<(PathBuf, PathBuf)> = OnceLock::new();
    EXPECTED.get_or_init(|| {
        let root = Path::new(env!("CARGO_TARGET_TMPDIR")).join("fleet-on-ray");
        let _ = std::fs::remove_dir_all(&root);
        let (fleet, expected) = (root.join("fleet"), root.join("expected"));
        fleet_of_joints::write_days(&fleet, &JOINTS, DAYS);
        fleet_of_joints::write_days(&expected.join("fleet"), &JOINTS, DAYS);
        let jointctl = |arguments: &[&str]| {
            let output =
                Command::new(env!("CARGO_BIN_EXE_jointctl")).current_dir(&expected).args(arguments).output().unwrap();
            assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
        };
        jointctl(&["key", "new", "fleet.key"]);
        jointctl(&["fleet", "sums", "fleet"]);
        jointctl(&["fleet", "status", "fleet", "--page", "fleet.html"]);
        let retrain =
            ["fleet", "retrain", "fleet", "--out", "new", "--key", "fleet.key", "--preset", "coulomb-viscous"];
        jointctl(&retrain);
        (fleet, expected)
    })
}
