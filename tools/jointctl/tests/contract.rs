//! Contract with scripts, of every command that the program has: docs/commands.md, and its exit codes. `UPDATE_DOCS=1
//! cargo test -p jointctl --test contract` writes the page anew.

use clap::error::ErrorKind;
use jointctl::commands::arguments;
use std::fmt::Write;
use std::path::Path;
use std::process::Command;

/// Above the table.
const PREAMBLE: &str = "# The commands' contract

What scripts may rely on. Options, ranges and examples of a command: `jointctl help COMMAND`. This page is made from the program's own
arguments, and a test fails where it says anything else.

| exit code | |
|---|---|
| 0 | done |
| 1 | failed: one line on standard error says what, where, and the limit. Whatever was there before still is: files are replaced whole or not at all, settings are taken whole or not at all |
| 2 | the arguments are wrong: nothing was written, and no set-point or setting was sent |
| 3 | `retrain`, `fleet retrain`: done, and no new image is better than the one before, which stays; of a fleet, no joint's |

`move` that is interrupted failed (1), `enable` that is interrupted is done (0): it lasts until somebody ends it. Both disable the joint first.

No file that exists is replaced without `--force`. A file that exists, a folder in a file's place and a folder that cannot be written to are told before any
work, and before a joint moves.

Results go to standard output, progress, warnings and errors to standard error. `--json` prints the same result as JSON on standard output,
angles in rad and torques in Nm unless a unit stands beside the number; numbers that were not measured are `null`.

| environment | |
|---|---|
| `JOINTCTL_BUS`, `JOINTCTL_NODE` | stand for `--bus` and `--node` where the table says so |
| `JOINTCTL_KEY` | stands for `--key`: the file of the joint's key |
| `JOINTCTL_TIMEOUT` | stands for `--timeout`: how long a node may take for each answer, 10 to 600000 ms, 1000 without it |
| `SOURCE_DATE_EPOCH` | the time that `fit` and `demo` write into an image and its report, s since 1970 |

| command | what it does | bus | `--json` |
|---|---|---|---|
";

/// Name and arguments of each command without commands of its own.
fn leaves() -> Vec<(String, clap::Command)> {
    fn below(command: &clap::Command, above: &str, found: &mut Vec<(String, clap::Command)>) {
        for command in command.get_subcommands() {
            let name = format!("{above} {}", command.get_name()).trim().to_owned();
            match command.has_subcommands() {
                true => below(command, &name, found),
                false => found.push((name, command.clone())),
            }
        }
    }
    let mut found = Vec::new();
    below(&arguments(), "", &mut found);
    found
}

fn page() -> String {
    let mut page = PREAMBLE.to_owned();
    for (name, command) in leaves() {
        let long = |wanted: &str| command.get_arguments().find(|argument| argument.get_long() == Some(wanted));
        let bus = match long("bus") {
            None => "",
            Some(bus) if bus.get_env().is_some() => "by option or environment",
            Some(_) => "by option",
        };
        let json = if long("json").is_some() { "yes" } else { "" };
        let about = command.get_about().map_or(String::new(), ToString::to_string);
        writeln!(page, "| `{name}` | {about} | {bus} | {json} |").unwrap();
    }
    page
}

#[test]
fn the_page_is_what_the_program_has() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/commands.md");
    if std::env::var_os("UPDATE_DOCS").is_some() {
        std::fs::write(&path, page()).unwrap();
    }
    assert_eq!(std::fs::read_to_string(&path).unwrap(), page(), "UPDATE_DOCS=1 writes it anew");
}

#[test]
fn every_command_says_by_2_that_its_arguments_are_wrong_and_leaves_nothing_behind() {
    let folder = tempfile::tempdir().unwrap();
    for (name, command) in leaves() {
        let run = |more: &[&str]| {
            let mut command = Command::new(env!("CARGO_BIN_EXE_jointctl"));
            for variable in ["BUS", "NODE", "KEY", "TIMEOUT"] {
                command.env_remove(format!("JOINTCTL_{variable}"));
            }
            let output = command.current_dir(&folder).args(name.split(' ')).args(more).output().unwrap();
            (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
        };
        let (code, text) = run(&["--no-such-option"]);
        assert!(code == Some(2) && text.contains("--no-such-option"), "{name}: {code:?} {text}");
        if command.get_arguments().any(|argument| argument.get_long() == Some("timeout")) {
            for (value, is_refused) in [("9", true), ("10", false), ("600000", false), ("600001", true)] {
                let words = ["jointctl"].into_iter().chain(name.split(' ')).chain(["--timeout", value]);
                // Other missing arguments are told only once every value is valid.
                let error = arguments().try_get_matches_from(words).err();
                let refused = error.as_ref().is_some_and(|error| error.kind() == ErrorKind::ValueValidation);
                assert_eq!(refused, is_refused, "{name} --timeout {value}: {error:?}");
            }
        }
        if command.get_arguments().any(clap::Arg::is_required_set) {
            let (code, text) = run(&[]);
            assert!(code == Some(2) && text.contains("required"), "{name}: {code:?} {text}");
        }
    }
    assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 0);
}
