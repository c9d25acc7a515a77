//! The unit tests of the baselines, on joints with known parameters.
//!
//! Without Python, or where NumPy and SciPy cannot be installed, these are reported as ignored by name; with `CI` set
//! they run, and fail.

use libtest_mimic::{Arguments, Failed, Trial};
use python::baselines::{PACKAGES, command};
use std::path::Path;

fn main() {
    let arguments = Arguments::from_args();
    let must_run = std::env::var_os("CI").is_some();
    let python = if arguments.list { None } else { PACKAGES.python(env!("CARGO_TARGET_TMPDIR")) };
    let ignored = !must_run && python.is_none();
    let trial = |(name, file): (&str, &'static str)| {
        let python = python.clone();
        Trial::test(name, move || pass(python.as_deref(), file)).with_ignored_flag(ignored)
    };
    let files = [
        ("baselines_a_and_b_find_the_parameters_of_joints_that_have_exactly_these", "physical.py"),
        ("the_network_of_baseline_c_learns_and_never_sees_a_test_sample", "network.py"),
        ("the_exported_table_is_read_as_it_was_written", "table.py"),
    ];
    libtest_mimic::run(&arguments, files.map(trial).into()).exit();
}

fn pass(python: Option<&Path>, file: &str) -> Result<(), Failed> {
    let python = PACKAGES.required(python)?;
    let output = command(python).arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests").join(file)).output()?;
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    // unittest succeeds where it finds no test.
    match output.status.success() && !text.contains("Ran 0 tests") {
        true => Ok(()),
        false => Err(text.into()),
    }
}
