//! Tests that a page names as what shows something: a page that names one that is not there fails.

use std::path::Path;

/// A test: its file, from the repository's root, and its name.
pub type Evidence = (&'static str, &'static str);

/// Links to tests, for a table of a page in `docs/`.
pub fn links(tests: &[Evidence]) -> String {
    let links = tests.iter().map(|(file, name)| {
        assert!(is_a_test(file, name), "{file} has no test {name}");
        format!("[{name}](../{file})")
    });
    links.collect::<Vec<_>>().join(", ")
}

fn text_of(file: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(file);
    std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{file}: {error}"))
}

/// Returns `true` if a file has a test that runs: a function behind `#[test]`, or a name that a harness of its own
/// runs.
fn is_a_test(file: &str, name: &str) -> bool {
    let text = text_of(file);
    if let Some((before, _)) = text.split_once(&format!("fn {name}(")) {
        let attributes = before.rsplit_once("\n\n").map_or(before, |(_, attributes)| attributes);
        if attributes.contains("#[test]") {
            return !attributes.contains("#[ignore");
        }
        // Listed by the program whose module the file is.
        let main = Path::new(file).with_file_name("main.rs");
        let module = Path::new(file).file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
        let list = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(main)).unwrap_or_default();
        let listed = list.split_once(&format!(" {module} {{")).and_then(|(_, rest)| rest.split_once('}'));
        return listed.is_some_and(|(names, _)| names.lines().any(|line| line.trim().ends_with(&format!("{name},"))));
    }
    text.contains("Trial::test(") && text.contains(&format!("\"{name}\""))
}

#[test]
fn a_test_is_found_where_it_is_and_nowhere_else() {
    let here = "src/objects/tests/evidence.rs";
    assert!(is_a_test(here, "a_test_is_found_where_it_is_and_nowhere_else"));
    assert!(!is_a_test("src/objects/tests/documentation.rs", "a_test_that_nobody_wrote"));
    // A function that is none, and one of a harness that is not listed.
    assert!(!is_a_test("src/objects/tests/client.rs", "upload"));
    let owner = "tools/jointctl/tests/remote/owner.rs";
    assert!(is_a_test(owner, "a_key_is_replaced_and_taken_back_by_who_has_it"));
    assert!(!is_a_test(owner, "session"));
    assert!(is_a_test("host-tests/tests/emulated/ownership.rs", "moteus_r4_belongs_to_who_has_its_key"));
    assert!(!is_a_test("host-tests/tests/emulated/ownership.rs", "moteus_r4_belongs_to_nobody"));
}
