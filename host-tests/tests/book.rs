//! README and the book below `docs/`: every link leads somewhere, every page has a place in the book, and figures in
//! prose are those of their source.

use joint_firmware::default_configuration::BOARDS;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Most words of README.
const WORDS: usize = 600;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn read(path: impl AsRef<Path>) -> String {
    let path = root().join(path);
    std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Files below a folder of the repository with an extension, by their paths from its root.
fn files(folder: &str, extension: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut folders = vec![PathBuf::from(folder)];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(root().join(&folder)).unwrap() {
            let path = folder.join(entry.unwrap().file_name());
            match root().join(&path).is_dir() {
                true => folders.push(path),
                false if path.extension().is_some_and(|found| found == extension) => found.push(path),
                false => {}
            }
        }
    }
    found.sort();
    found
}

/// README, CONTRIBUTING, CHANGELOG, and all pages.
fn documents() -> Vec<PathBuf> {
    let alone = ["README.md", "CONTRIBUTING.md", "CHANGELOG.md", "fuzz/README.md"];
    alone.iter().map(PathBuf::from).chain(files("docs", "md")).collect()
}

/// A page without its blocks of code, whose brackets are no links.
fn prose(text: &str) -> String {
    let mut inside = false;
    let mut lines = Vec::new();
    for line in text.lines() {
        if line.trim_start().starts_with("```") {
            inside = !inside;
        } else if !inside {
            lines.push(line);
        }
    }
    lines.join("\n")
}

/// Targets of the links of a page.
fn links(text: &str) -> Vec<String> {
    let text = prose(text);
    let targets = text.split("](").skip(1).filter_map(|behind| behind.split_once(')'));
    targets.map(|(target, _)| target.split_whitespace().next().unwrap_or("").to_owned()).collect()
}

/// Anchors of a page: its headings as GitHub and mdBook name them, and those that are set by hand.
fn anchors(text: &str) -> BTreeSet<String> {
    let slug = |heading: &str| -> String {
        let kept = heading.chars().filter(|c| c.is_alphanumeric() || [' ', '-', '_'].contains(c));
        kept.collect::<String>().to_lowercase().replace(' ', "-")
    };
    let text = prose(text);
    let headings =
        text.lines().filter(|line| line.starts_with('#')).map(|line| slug(line.trim_start_matches('#').trim()));
    let set = text.split("<a id=\"").skip(1).filter_map(|behind| behind.split_once('"')).map(|(id, _)| id.to_owned());
    headings.chain(set).collect()
}

#[test]
fn every_link_leads_to_a_file_and_a_heading() {
    let mut broken = Vec::new();
    for document in documents() {
        let text = read(&document);
        for link in links(&text).iter().filter(|link| !link.contains("://")) {
            let (file, anchor) =
                link.split_once('#').map_or((link.as_str(), None), |(file, anchor)| (file, Some(anchor)));
            let target = match file {
                "" => document.clone(),
                file => document.parent().unwrap().join(file),
            };
            let is_there = root().join(&target).exists();
            let has_anchor =
                |anchor: &str| !file.ends_with(".md") && !file.is_empty() || anchors(&read(&target)).contains(anchor);
            if !is_there || !anchor.is_none_or(has_anchor) {
                broken.push(format!("{}: {link}", document.display()));
            }
        }
    }
    assert!(broken.is_empty(), "broken links:\n{}", broken.join("\n"));
}

#[test]
fn every_page_has_one_place_in_the_book_and_every_decision_a_date_and_a_status() {
    let summary = links(&read("docs/SUMMARY.md"));
    let index = links(&read("docs/decisions.md"));
    for page in files("docs", "md") {
        let name = page.strip_prefix("docs").unwrap().to_string_lossy().into_owned();
        if name == "SUMMARY.md" {
            continue;
        }
        assert_eq!(summary.iter().filter(|link| **link == name).count(), 1, "{name} in docs/SUMMARY.md");
        if !name.starts_with("decisions/") {
            continue;
        }
        assert!(index.contains(&name), "{name} is not in docs/decisions.md");
        let text = read(&page);
        let line = text.lines().nth(2).unwrap_or_default();
        let dated = line.get(..10).is_some_and(|date| date.chars().all(|c| c.is_ascii_digit() || c == '-'));
        let status =
            line.get(10..).is_some_and(|rest| rest.starts_with(", accepted") || rest.starts_with(", superseded"));
        assert!(dated && status, "{name} begins with no date and status: {line}");
    }
}

/// Numbers of a text, whole: 3.9 is not in 63.9.
fn numbers(text: &str) -> impl Iterator<Item = &str> {
    let words = text.split(|c: char| !"0123456789.,".contains(c));
    words.map(|word| word.trim_matches(['.', ','])).filter(|word| word.len() > 1)
}

#[test]
fn readme_is_short_and_its_results_are_those_of_the_pages() {
    let readme = read("README.md");
    let words = readme.split_whitespace().count();
    assert!(words <= WORDS, "README has {words} words, {WORDS} at most");
    let (_, results) = readme.split_once("\n## Results\n").expect("results");
    let rows: Vec<&str> = results.lines().filter(|line| line.starts_with("| ")).skip(1).take(5).collect();
    assert_eq!(rows.len(), 5);
    for row in rows {
        let cells: Vec<&str> = row.split('|').collect();
        let page = read(links(row).last().expect("a source"));
        let known: BTreeSet<&str> = numbers(&page).collect();
        for number in cells[1..cells.len() - 2].iter().flat_map(|cell| numbers(cell)) {
            assert!(known.contains(number), "{number} of {row} is not in its source");
        }
    }
}

#[test]
fn motions_that_were_left_out_are_counted_alike_on_every_page() {
    let joined = |page: &str| read(page).split_whitespace().collect::<Vec<_>>().join(" ");
    let source = read("docs/motions.md");
    let summary = source.lines().find(|line| line.starts_with("Of ")).expect("a summary");
    // Of all, those within 1 % of the best baseline (worst ratio), those within 2 % of the simplest model.
    let [all, best, _, simplest, ..] = numbers(summary).collect::<Vec<_>>()[..] else { panic!("{summary}") };
    let readme = joined("README.md");
    assert!(readme.contains(&format!("prediction of {all} motions")), "{all} motions");
    assert!(readme.contains(&format!("within 1 % of it or better on {best} |")), "{best} of {all}");
    let results = joined("docs/results-recordings.md");
    assert!(results.contains(&format!("best of three baselines on {best} of {all} motions")), "{best} of {all}");
    assert!(results.contains(&format!("its own simplest model on {simplest}:")), "{simplest} of {all}");
}

#[test]
fn names_in_diagrams_are_those_of_the_code() {
    let folders = ["src", "crates", "tools/identification/src", "tools/jointctl/src"];
    let code: String = folders.into_iter().flat_map(|at| files(at, "rs")).map(read).collect();
    let mut count = 0;
    for figure in files("docs/figures", "svg") {
        let text = read(&figure);
        for name in text.split("class=\"name\"").skip(1).filter_map(|behind| behind.split_once('>')?.1.split_once('<'))
        {
            assert!(code.contains(name.0), "{} of {} is not in the code", name.0, figure.display());
            count += 1;
        }
    }
    assert!(count > 30, "{count} names");
}

#[test]
fn the_terms_of_the_theory_are_those_of_the_code() {
    let (code, theory) = (read("crates/friction-compensation/src/friction/physical.rs"), read("docs/theory.md"));
    let rows: Vec<&str> = code.lines().filter_map(|line| line.strip_prefix("//! | ")).skip(1).collect();
    assert!(rows.len() >= 10);
    for row in rows {
        let formula = row.split(" | ").nth(1).unwrap().split(':').next().unwrap();
        assert!(theory.contains(&format!("| {formula} |")), "{formula} is not in docs/theory.md");
    }
}

/// An integer with commas between thousands.
fn grouped(number: u32) -> String {
    if number < 1000 { number.to_string() } else { format!("{},{:03}", number / 1000, number % 1000) }
}

#[test]
fn instructions_of_the_control_step_are_within_the_limits_that_the_tests_hold() {
    let cost = read("docs/cost.md");
    for (board, _) in BOARDS {
        let limits = read(format!(".ci/instructions/{board}"));
        for part in ["network", "network's inputs", "physical model", "longest step"] {
            let line =
                limits.lines().find(|line| line.trim_start().split_once(' ').is_some_and(|(_, name)| name == part));
            let limit: u32 = line.unwrap().trim_start().split_once(' ').unwrap().0.parse().unwrap();
            assert!(cost.contains(&grouped(limit)), "{board}: {part} takes {limit}, docs/cost.md says something else");
        }
    }
}
