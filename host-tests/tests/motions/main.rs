//! Leave one motion out: the image judged on motions that it was not made with, beside its own simplest model and three
//! SciPy baselines that are computed on the same samples.
//!
//! The figures are published in docs/motions.md, which this program writes with `UPDATE_DOCS=1` and holds to them
//! otherwise. The recordings are others' ([`host_tests::recordings`]): without them, or without Python, what needs them
//! is reported as ignored by name; with `CI` set a missing Python fails. `MOTIONS=xl330` judges, or writes, only the
//! recordings whose name begins with that. Every fourth motion is judged where neither of them is set, and all with
//! `JOINT_SAMPLES=all`.

mod judge;
mod list;
mod page;

use host_tests::recordings;
use host_tests::samples::every;
use judge::judge;
use libtest_mimic::{Arguments, Failed, Trial};
use page::Row;
use python::baselines::PACKAGES;
use rayon::iter::{IndexedParallelIterator, IntoParallelRefIterator, ParallelIterator};
use std::path::Path;

/// Share of the motions, one of so many, that is judged in the test command.
const PART: usize = 4;

fn main() {
    let arguments = Arguments::from_args();
    let must_run = std::env::var_os("CI").is_some();
    let data = recordings::folder();
    let python = if arguments.list || data.is_none() { None } else { PACKAGES.python(env!("CARGO_TARGET_TMPDIR")) };
    let ignored = data.is_none() || !must_run && python.is_none();
    let name = "motions_that_are_left_out_are_predicted_as_published_beside_three_baselines";
    let mut trials = vec![
        Trial::test(name, move || as_published(&data.unwrap_or_default(), python.as_deref()))
            .with_ignored_flag(ignored),
        Trial::test("the_page_has_every_motion_once_and_says_what_its_figures_say", page_is_whole),
    ];
    trials.extend(page::trials());
    libtest_mimic::run(&arguments, trials).exit();
}

fn as_published(data: &Path, python: Option<&Path>) -> Result<(), Failed> {
    let python = PACKAGES.required(python)?;
    let wanted = std::env::var("MOTIONS");
    let updates = std::env::var_os("UPDATE_DOCS").is_some();
    let step = if every() || updates || wanted.is_ok() { 1 } else { PART };
    let named = wanted.unwrap_or_default();
    let chosen = list::all().into_iter().filter(|motion| motion.data_set.starts_with(&named));
    let motions: Vec<_> = chosen.skip(step - 1).step_by(step).collect();
    let judged = motions.par_iter().with_max_len(1).map(|motion| judge(motion, data, python));
    let rows = judged.collect::<Result<Vec<Row>, Failed>>()?;
    println!("{}{}", page::table(&rows), page::summary(&rows));
    if updates {
        update(&rows)?;
    }
    let published = page::read(&std::fs::read_to_string(page::PATH)?)?;
    let differences: Vec<String> = rows.iter().flat_map(|row| page::differences(row, &published)).collect();
    if differences.is_empty() { Ok(()) } else { Err(differences.join("\n").into()) }
}

/// Writes the page with these rows in place of those that it has of the same motions.
fn update(rows: &[Row]) -> Result<(), Failed> {
    let before = page::read(&std::fs::read_to_string(page::PATH).unwrap_or_default())?;
    let row = |motion: &list::Motion| {
        let same = |row: &&Row| row.data_set == motion.data_set && row.left_out == motion.name;
        rows.iter().find(same).or_else(|| before.iter().find(same)).cloned()
    };
    Ok(std::fs::write(page::PATH, page::document(&list::all().iter().filter_map(row).collect::<Vec<_>>()))?)
}

fn page_is_whole() -> Result<(), Failed> {
    let text = std::fs::read_to_string(page::PATH)?;
    let rows = page::read(&text)?;
    let expected: Vec<_> = list::all().into_iter().map(|motion| (motion.data_set.to_owned(), motion.name)).collect();
    let found: Vec<_> = rows.iter().map(|row| (row.data_set.clone(), row.left_out.clone())).collect();
    if expected != found {
        return Err(format!("motions of the page: {found:?}, expected {expected:?}").into());
    }
    match page::document(&rows) == text {
        true => Ok(()),
        false => Err("docs/motions.md says something else than its figures; UPDATE_DOCS=1 writes it anew".into()),
    }
}
