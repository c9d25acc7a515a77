//! Commands that README shows, as they stand there.

/// The text.
pub const README: &str = include_str!("../../../../README.md");

/// The text between two others that stand in it.
pub fn between(begin: &str, end: &str) -> &'static str {
    let (_, behind) = README.split_once(begin).unwrap_or_else(|| panic!("'{begin}' is not in README"));
    behind.split_once(end).unwrap_or_else(|| panic!("'{end}' does not follow '{begin}' in README")).0
}

/// Its commands, without what explains them.
pub fn lines(text: &str) -> Vec<String> {
    let mut lines = Vec::new();
    let mut inside = false;
    for line in text.lines() {
        match line.trim() {
            "```sh" => inside = true,
            "```" => inside = false,
            line if inside && !line.is_empty() => {
                lines.push(line.split_once("  #").map_or(line, |(command, _)| command).trim().to_owned());
            }
            _ => {}
        }
    }
    lines
}
