//! The robot, not only the joint: six joints of a UR10e identified from one recording, judged on a motion that was
//! used for no choice.
//!
//! The figures are published in docs/robot.md, which this program writes with `UPDATE_DOCS=1` and holds to them
//! otherwise. Without the recordings ([`host_tests::recordings`]) this is reported as ignored.

mod page;

use host_tests::recordings;
use identification::fit::Options as JointOptions;
use identification::progress::Silent;
use libtest_mimic::{Arguments, Failed, Trial};
use robot::{FittedRobot, Options, fit, record};
use std::path::Path;

/// Seconds of training; None: all of both recordings.
const TRAINING: [Option<f64>; 3] = [None, Some(16.0), Some(8.0)];

fn main() {
    let arguments = Arguments::from_args();
    let data = recordings::folder();
    let ignored = data.is_none();
    let name = "the_ur10e_is_predicted_as_published_on_a_motion_that_was_used_for_no_choice";
    let trials = vec![
        Trial::test(name, move || as_published(&data.unwrap_or_default())).with_ignored_flag(ignored),
        Trial::test("the_page_says_what_its_figures_say", page::is_whole),
        Trial::test("a_figure_beyond_its_margin_is_told", page::margins),
    ];
    libtest_mimic::run(&arguments, trials).exit();
}

fn as_published(data: &Path) -> Result<(), Failed> {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tools/jointctl/robots/ur10e_fourier.toml");
    let recording = record(&file, &recordings::environment(data)?)?;
    let mut rows = Vec::new();
    for seconds in TRAINING {
        let joint = JointOptions { trainer: None, reference: false, ..JointOptions::default() };
        let fitted = fit(&mut recording.clone(), &Options { joint, seconds }, &Silent)?;
        if !fitted.links.iter().all(|link| link.is_physical()) {
            return Err(format!("{seconds:?} s: a link is not physical").into());
        }
        rows.extend(of(&fitted, seconds));
    }
    println!("{}", page::table(&rows));
    if std::env::var_os("UPDATE_DOCS").is_some() {
        std::fs::write(page::PATH, page::document(&rows))?;
    }
    let differences = page::differences(&rows, &page::read(&std::fs::read_to_string(page::PATH)?)?);
    if differences.is_empty() { Ok(()) } else { Err(differences.join("\n").into()) }
}

/// The rows of one fit.
fn of(fitted: &FittedRobot, seconds: Option<f64>) -> [page::Row; 3] {
    let training = seconds.map_or("all".to_owned(), |seconds| format!("{seconds} s"));
    let column = |error: fn(&robot::fit::JointErrors) -> f64| fitted.errors.iter().map(error).collect();
    let [simplest, bodies, image] = fitted.mean_percent();
    let row =
        |model: &str, errors, mean| page::Row { training: training.clone(), model: model.to_owned(), errors, mean };
    [
        row("weighted least squares; viscous, Coulomb, offset", column(|joint| joint.simplest), simplest),
        row("physical links with their own friction", column(|joint| joint.bodies), bodies),
        row("images in fixed point on these links", column(|joint| joint.image), image),
    ]
}
