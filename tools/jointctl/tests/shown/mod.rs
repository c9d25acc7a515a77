//! Commands that the documentation shows, as they stand there.

/// Page on the joint on a bus.
pub const ON_THE_BUS: &str = include_str!("../../../../docs/on-the-bus.md");

/// Page on the owner of a joint.
#[allow(dead_code, reason = "of two tests one runs it")]
pub const OWNERSHIP: &str = include_str!("../../../../docs/ownership.md");

/// Commands of a page, without what explains them.
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
