//! Tests of the report as files: what is on the page, in the numbers and in the figures.

use super::*;
use std::fs;

fn text<'a>(files: &'a [OutputFile], path: &str) -> &'a str {
    let file = files.iter().find(|file| file.path == Path::new(path)).expect("the file is there");
    std::str::from_utf8(&file.contents).unwrap()
}

/// Every element is closed in order, attributes are quoted, and no bare `<` or `&` is left.
fn assert_well_formed(xml: &str, what: &str) {
    let mut open = Vec::new();
    for part in xml.split('<').skip(1) {
        let (tag, after) = part.split_once('>').unwrap_or_else(|| panic!("{what}: unclosed <{part}"));
        for entity in after.split('&').skip(1) {
            assert!(entity.split_once(';').is_some_and(|(name, _)| name.len() <= 5), "{what}: bare & in {after}");
        }
        assert_eq!(tag.matches('"').count() % 2, 0, "{what}: {tag}");
        if let Some(name) = tag.strip_prefix('/') {
            assert_eq!(open.pop(), Some(name), "{what}");
        } else if !tag.ends_with('/') && !tag.starts_with(['?', '!']) {
            open.push(tag.split_whitespace().next().unwrap());
        }
    }
    assert!(open.is_empty(), "{what}: {open:?} not closed");
}

#[test]
fn the_page_loads_nothing_from_anywhere() {
    let files = render(&example::report(500)).unwrap();
    let page = text(&files, "report.html");
    for reference in [" src=", "<link", "<script", "@import", "url(", "href=\"http", "<image", "<iframe"] {
        assert!(!page.contains(reference), "{reference}");
    }
    let without_namespace = page.replace("xmlns=\"http://www.w3.org/2000/svg\"", "");
    assert!(!without_namespace.contains("http://") && !without_namespace.contains("https://"));
}

#[test]
fn every_link_of_the_contents_leads_to_a_section() {
    let files = render(&example::report(50)).unwrap();
    let page = text(&files, "report.html");
    let anchors: Vec<&str> = page.split("href=\"#").skip(1).map(|rest| rest.split('"').next().unwrap()).collect();
    assert!(anchors.len() >= 8);
    for anchor in anchors {
        assert_eq!(page.matches(&format!("id=\"{anchor}\"")).count(), 1, "{anchor}");
    }
}

#[test]
fn hostile_text_stays_text() {
    let mut report = example::report(50);
    let hostile = "<script>alert(1)</script>\"&'";
    report.title = hostile.into();
    report.data_set = hostile.into();
    report.units.effort = hostile.into();
    report.candidates[0].model = hostile.into();
    report.errors[0].rows[0].model = hostile.into();
    report.provenance.options[0].1 = hostile.into();
    report.stages[0].note = hostile.into();
    report.parameters[0].symbol = hostile.into();
    report.network = NetworkOutcome::Rejected { reason: hostile.into() };
    for file in render(&report).unwrap() {
        if file.path != Path::new("report.json") {
            let contents = String::from_utf8(file.contents).unwrap();
            assert!(!contents.contains("<script"), "{:?}", file.path);
        }
    }
    for figure in figures(&report).unwrap() {
        assert_well_formed(&figure.standalone(), figure.name);
    }
}

#[test]
fn every_figure_is_a_well_formed_file_and_on_the_page() {
    let report = example::report(2000);
    let files = render(&report).unwrap();
    let page = text(&files, "report.html");
    let drawn = figures(&report).unwrap();
    assert_eq!(drawn.len(), 10);
    for figure in drawn {
        let file = text(&files, &format!("figures/{}.svg", figure.name));
        assert!(file.starts_with("<?xml") && file.contains("<style>"), "{}", figure.name);
        assert_well_formed(file, figure.name);
        assert!(page.contains(&format!("id=\"figure-{}\"", figure.name)) && page.contains(&figure.svg));
    }
}

#[test]
fn large_data_make_a_page_that_can_be_mailed() {
    let files = render(&example::report(200_000)).unwrap();
    assert!(text(&files, "report.html").len() < 1_500_000);
}

#[test]
fn the_numbers_file_holds_the_numbers_and_no_samples() {
    let report = example::report(1000);
    let files = render(&report).unwrap();
    let json: serde_json::Value = serde_json::from_str(text(&files, "report.json")).unwrap();
    let expected = report.errors[0].rows[5].errors.fast.as_ref().unwrap().rmse;
    assert_eq!(json["errors"][0]["rows"][5]["errors"]["fast"]["rmse"], expected);
    assert_eq!(json["errors"][0]["rows"][5]["role"], "fixed_point");
    assert_eq!(json["parameters"][5]["standard_error"], serde_json::Value::Null);
    assert_eq!(json["training"][3]["best_epoch"], report.training[3].best_epoch);
    assert_eq!(json["network"], "kept");
    assert_eq!(json["verdict"]["good"], true);
    assert!(json.get("test").is_none());
}

#[test]
fn equal_reports_give_equal_bytes() {
    assert_eq!(render(&example::report(3000)).unwrap(), render(&example::report(3000)).unwrap());
}

#[test]
fn a_report_is_written_as_a_directory() {
    let place = tempfile::tempdir().unwrap();
    write(&example::report(100), place.path()).unwrap();
    assert!(fs::read_to_string(place.path().join("report.html")).unwrap().starts_with("<!DOCTYPE html>"));
    assert_eq!(fs::read_dir(place.path().join("figures")).unwrap().count(), 10);
}

/// Asserts that what is shown is made of numbers; JSON has no word for what is none.
fn assert_no_nan(report: &Report) {
    for file in render(report).unwrap() {
        let contents = String::from_utf8(file.contents).unwrap();
        for word in ["NaN", ">inf", "-inf", " inf"] {
            assert!(!contents.contains(word), "{word} in {:?}", file.path);
        }
    }
}

#[test]
fn reports_that_lack_something_are_still_reports() {
    assert_no_nan(&Report::default());
    for samples in [0, 1, 2] {
        assert_no_nan(&example::report(samples));
    }
    let mut bare = example::report(300);
    bare.test.network = None;
    bare.test.temperature = None;
    bare.network = NetworkOutcome::NotTrained;
    bare.training.clear();
    bare.fixed_point = None;
    assert_no_nan(&bare);
    let names: Vec<&str> = figures(&bare).unwrap().iter().map(|figure| figure.name).collect();
    assert!(!names.contains(&"error-temperature") && !names.contains(&"training"), "{names:?}");
    assert_eq!(names.len(), 8);
}

#[test]
fn numbers_that_are_none_are_shown_as_a_dash() {
    let mut report = example::report(100);
    report.parameters[0].standard_error = Some(f64::INFINITY);
    report.candidates[2].unseen_rmse = f64::NAN;
    report.training[0].validation[5] = f64::NAN;
    report.training[1].train[5] = 0.0;
    report.certificate[0].value = f64::INFINITY;
    assert_no_nan(&report);
}

#[test]
fn samples_that_stand_still_can_be_drawn() {
    let mut report = example::report(100);
    for column in [&mut report.test.velocity, &mut report.test.position, &mut report.test.effort] {
        column.fill(0.0);
    }
    report.test.rigid.fill(0.0);
    report.test.physical.fill(0.0);
    report.test.network = None;
    assert_no_nan(&report);
}

#[test]
fn a_huge_spike_is_drawn_beyond_the_axes_without_overflow() {
    let mut report = example::report(400);
    report.test.effort[7] = 1e300;
    report.test.velocity[8] = -1e300;
    assert_no_nan(&report);
    let files = render(&report).unwrap();
    assert!(text(&files, "figures/friction-velocity.svg").contains("1 of 400 samples lie beyond the axes"));
}

#[test]
fn bad_test_columns_are_refused_with_their_name() {
    let mut short = example::report(10);
    short.test.rigid.pop();
    assert!(matches!(render(&short), Err(ReportError::Length { column: "rigid", length: 9, expected: 10 })));
    let mut infinite = example::report(10);
    infinite.test.network.as_mut().unwrap()[3] = f64::NAN;
    assert!(matches!(render(&infinite), Err(ReportError::NotFinite { column: "network", index: 3, .. })));
}

#[test]
fn the_verdict_says_what_compensation_removes_or_why_it_does_not() {
    let mut report = example::report(1000);
    let kept = verdict(&report);
    assert!(kept.good && kept.sentence.starts_with("Compensation removes 9"), "{kept:?}");
    report.network = NetworkOutcome::Rejected { reason: "it raises the validation error by 2 %".into() };
    assert!(verdict(&report).sentence.contains("the network was rejected: it raises"), "{:?}", verdict(&report));
    report.certificate[0].passed = false;
    assert!(!verdict(&report).good && verdict(&report).sentence.contains("1 of 4 proofs failed"));
    report.errors[0].rows.swap(0, 5);
    report.errors[0].rows[0].role = Role::Nothing;
    report.errors[0].rows[5].role = Role::FixedPoint;
    assert!(verdict(&report).sentence.starts_with("Compensation does not help"), "{:?}", verdict(&report));
    report.errors.clear();
    assert!(verdict(&report).sentence.starts_with("Nothing was judged"));
}

fn overall(report: &mut Report, set: usize, row: usize) -> &mut crate::metrics::Metrics {
    report.errors[set].rows[row].errors.overall.as_mut().unwrap()
}

#[test]
fn a_simpler_model_of_the_same_table_that_is_better_takes_the_green_away() {
    let with = |ratio: f64| {
        let mut report = example::report(1000);
        let image = overall(&mut report, 0, 5).rmse;
        // The chosen physical model is out of the way: the row judged is that of Coulomb and viscous friction.
        overall(&mut report, 0, 3).rmse = 2.0 * image;
        overall(&mut report, 0, 2).rmse = image / ratio;
        verdict(&report)
    };
    assert!(with(1.019).good, "{:?}", with(1.019));
    let worse = with(1.021);
    assert!(!worse.good && worse.sentence.contains("coulomb-viscous"), "{worse:?}");
    assert!(with(2.0).sentence.contains("2.00 times as much"), "{:?}", with(2.0));
}

#[test]
fn the_headline_is_of_all_test_sets_and_a_bad_one_is_named() {
    let mut report = example::report(1000);
    let one = verdict(&report);
    let mut other = report.errors[0].clone();
    other.test_set = "other motion".into();
    report.errors.push(other);
    assert_eq!(verdict(&report), one, "the same errors twice are the same errors");
    let before = overall(&mut report, 1, 0).rmse;
    let bad = overall(&mut report, 1, 5);
    (bad.rmse, bad.mse) = (1.5 * before, 2.25 * before * before);
    report.errors[1].rows[5].torque_error = Some(150.0);
    let found = verdict(&report);
    assert!(!found.good && found.sentence.contains("does not help on test set \"other motion\""), "{found:?}");
    assert_ne!(found.sentence, one.sentence);
    let files = render(&report).unwrap();
    let page = text(&files, "report.html");
    assert!(
        page.contains("torque error, worst test set") && page.contains("150.0 %"),
        "the worst test set is on a card"
    );
}

#[test]
fn warnings_and_true_values_are_on_the_page() {
    let mut report = example::report(100);
    let plain = render(&report).unwrap();
    assert!(!text(&plain, "report.html").contains("id=\"warnings\"") && !text(&plain, "report.html").contains("truth"));
    report.warnings.push(Warning {
        check: "clipping",
        column: "effort (\"u\")".into(),
        rows: "12 of 100 rows".into(),
        finding: "its extreme stands still".into(),
        remedy: "leave them out".into(),
    });
    report.parameters[0].truth = Some(1.234);
    let files = render(&report).unwrap();
    let page = text(&files, "report.html");
    assert!(page.contains("id=\"warnings\"") && page.contains("its extreme stands still") && page.contains("1.234"));
    let json: serde_json::Value = serde_json::from_str(text(&files, "report.json")).unwrap();
    assert_eq!((&json["warnings"][0]["check"], &json["parameters"][0]["truth"]), (&"clipping".into(), &1.234.into()));
}
