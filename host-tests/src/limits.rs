//! Instructions that each part of a control step may take: one file a board below `.ci/instructions`, kept with the
//! code.
//!
//! Counts are exact and the same in every run, so a limit is what the code takes now, by the compiler that the file
//! names; by another one a twentieth more is permitted. Where more is intended, `JOINT_LIMITS=accept cargo test -p
//! host-tests --test on_the_core` writes the files anew; what has changed is then part of the commit.

use std::path::PathBuf;
use std::process::Command;

/// The variable that says that what is measured is intended.
const VARIABLE: &str = "JOINT_LIMITS";

/// A part and the most instructions that it took in a step.
pub type Most = (&'static str, u64);

/// Name of the compiler, as it calls itself.
fn compiler() -> Result<String, String> {
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let output = Command::new(rustc).arg("--version").output().map_err(|error| format!("rustc: {error}"))?;
    Ok(String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

fn path(board: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../.ci/instructions").join(board)
}

/// Holds what was measured against the board's file, or makes that its content where the variable says so.
///
/// # Errors
/// The parts that take more than they may, or that the file does not know, and how to accept that.
pub fn hold(board: &str, measured: &[Most]) -> Result<(), String> {
    let (path, compiler) = (path(board), compiler()?);
    if std::env::var_os(VARIABLE).is_some_and(|value| value == "accept") {
        let lines: String = measured.iter().map(|(name, most)| format!("{most:>5} {name}\n")).collect();
        return std::fs::write(&path, format!("{compiler}\n{lines}"))
            .map_err(|error| format!("{}: {error}", path.display()));
    }
    let text = std::fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))?;
    match &exceeded(&text, &compiler, measured)[..] {
        [] => Ok(()),
        exceeded => Err(format!(
            "{board}: {}. If that is intended, {VARIABLE}=accept writes .ci/instructions anew",
            exceeded.join(", ")
        )),
    }
}

/// Parts that take more than the lines of a file permit.
fn exceeded(text: &str, compiler: &str, measured: &[Most]) -> Vec<String> {
    let same = text.lines().next() == Some(compiler);
    let limit = |name: &str| {
        let line = text.lines().find_map(|line| line.trim().split_once(' ').filter(|(_, known)| *known == name));
        let most = line.and_then(|(most, _)| most.parse::<u64>().ok());
        most.map(|most| if same { most } else { most + most / 20 })
    };
    let judge = |(name, most): &Most| match limit(name) {
        Some(limit) if *most <= limit => None,
        Some(limit) => Some(format!("{name} takes {most} instructions, at most {limit} are permitted")),
        None => Some(format!("{name} takes {most} instructions and has no limit")),
    };
    measured.iter().filter_map(judge).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "rustc 1.96.0\n  230 network\n  400 physical model\n";

    #[test]
    fn one_instruction_more_is_told_and_one_less_is_not() {
        assert_eq!(exceeded(TEXT, "rustc 1.96.0", &[("network", 230), ("physical model", 399)]), [""; 0]);
        let told = exceeded(TEXT, "rustc 1.96.0", &[("network", 231), ("physical model", 400)]);
        assert_eq!(told, ["network takes 231 instructions, at most 230 are permitted"]);
    }

    #[test]
    fn another_compiler_may_take_a_twentieth_more() {
        assert_eq!(exceeded(TEXT, "rustc 1.97.0", &[("network", 241), ("physical model", 420)]), [""; 0]);
        let told = exceeded(TEXT, "rustc 1.97.0", &[("network", 242), ("physical model", 420)]);
        assert_eq!(told, ["network takes 242 instructions, at most 241 are permitted"]);
    }

    #[test]
    fn a_part_without_a_limit_is_told() {
        let told = exceeded(TEXT, "rustc 1.96.0", &[("observer", 1)]);
        assert_eq!(told, ["observer takes 1 instructions and has no limit"]);
    }
}
