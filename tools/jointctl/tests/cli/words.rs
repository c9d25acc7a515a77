//! Words of the program about itself and its arguments: help, manual, completions, standard output, refusals.

use crate::{jointctl, stderr};
use std::process::Command;

#[test]
fn wrong_arguments_are_refused_with_their_limits() {
    let folder = tempfile::tempdir().unwrap();
    for (arguments, expected) in [
        (&["fit", "nowhere.toml"] as &[&str], "nowhere.toml"),
        (&["demo", "--equalise", "2"], "--equalise is 2, must be 0 to 1"),
        (&["demo", "--preset", "stribek"], "stribeck"),
        (&["image", "verify", "nowhere.img"], "cannot read nowhere.img"),
        (&["sim", "--config", "nowhere.toml"], "nowhere.toml: cannot be read"),
        (&["sim", "--plant", "nowhere.toml"], "cannot read nowhere.toml"),
        (&["sim", "--scenario", "dance"], "slow-reversal"),
        (&["sim", "--sample-period", "1"], "must lie in 0.0001 to 0.1 s"),
        (&["excite", "--velocity", "0"], "velocity is 0, must lie in 0.001 to 200 rad/s"),
        (&["excite", "--out", "motion.toml"], "--out is motion.toml"),
        (&["excite", "--check", "nowhere.csv"], "nowhere.csv: cannot be read"),
        (&["robot", "excite", "nowhere.toml", "--out", "motion"], "cannot read nowhere.toml"),
        (&["robot", "evaluate", "arm", "nowhere.toml"], "cannot read nowhere.toml"),
    ] {
        let output = jointctl(folder.path(), arguments);
        assert!(!output.status.success());
        assert!(stderr(&output).contains(expected), "{arguments:?}: {}", stderr(&output));
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "nothing is written on the way to an error");
}

#[test]
fn a_commissioning_that_nobody_can_agree_to_is_refused_before_the_bus_is_opened() {
    let folder = tempfile::tempdir().unwrap();
    let run = |more: &[&str]| {
        let asked = ["commission", "--bus", "socketcan:none", "--node", "5", "--current", "8"];
        jointctl(folder.path(), &[&asked, more].concat())
    };
    let refused = run(&[]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(stderr(&refused).contains("no terminal") && stderr(&refused).contains("--yes"), "{}", stderr(&refused));
    let refused = stderr(&run(&["--yes", "--counts", "15"]));
    assert!(refused.contains("--counts is 15") && refused.contains("16 to 65535"), "{refused}");
    let refused = stderr(&run(&["--yes"]));
    assert!(refused.contains("none"), "the bus comes after both: {refused}");
}

#[test]
fn completions_of_every_shell_name_the_commands_and_bash_completes_one() {
    let folder = tempfile::tempdir().unwrap();
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let output = jointctl(folder.path(), &["completions", shell]);
        assert!(output.status.success(), "{shell}: {}", stderr(&output));
        let script = String::from_utf8(output.stdout).unwrap();
        assert!(script.contains("bus-yml") && script.contains("completions"), "{shell}");
        std::fs::write(folder.path().join(shell), script).unwrap();
    }
    assert_eq!(jointctl(folder.path(), &["completions", "tcsh"]).status.code(), Some(2));
    let completed = "source ./bash; COMP_WORDS=(jointctl comm); COMP_CWORD=1; _jointctl jointctl comm jointctl; echo ${COMPREPLY[*]}";
    let output = Command::new("bash").current_dir(folder.path()).args(["-c", completed]).output().expect("bash starts");
    assert_eq!(String::from_utf8_lossy(&output.stdout), "commission\n", "{}", stderr(&output));
}

#[test]
fn every_command_has_a_manual_page_and_none_is_replaced_without_force() {
    let folder = tempfile::tempdir().unwrap();
    let output = jointctl(folder.path(), &["man", "man1"]);
    assert!(output.status.success(), "{}", stderr(&output));
    let page = |name: &str| std::fs::read_to_string(folder.path().join("man1").join(name)).unwrap();
    assert!(page("jointctl.1").contains("bus\\-yml") && page("jointctl-image-verify.1").contains("standard input"));
    let help = String::from_utf8(jointctl(folder.path(), &["--help"]).stdout).unwrap();
    let list = help.split("Commands:\n").nth(1).unwrap().split("\n\n").next().unwrap();
    // A description that is wrapped is indented by more.
    let lines = list.lines().filter_map(|line| line.strip_prefix("  ")).filter(|line| !line.starts_with(' '));
    let commands: Vec<&str> = lines.filter_map(|line| line.split_whitespace().next()).collect();
    assert!(commands.len() > 20, "{help}");
    commands.into_iter().filter(|name| *name != "help").for_each(|name| drop(page(&format!("jointctl-{name}.1"))));
    let again = jointctl(folder.path(), &["man", "man1"]);
    assert!(!again.status.success() && stderr(&again).contains("exists; --force replaces it"), "{}", stderr(&again));
    assert!(jointctl(folder.path(), &["man", "man1", "--force"]).status.success());
}

#[test]
fn a_dash_is_standard_output_for_what_is_one_file_and_refused_for_what_is_two() {
    let folder = tempfile::tempdir().unwrap();
    assert!(jointctl(folder.path(), &["eds", "joint.eds"]).status.success());
    let written = std::fs::read_to_string(folder.path().join("joint.eds")).unwrap();
    let printed = String::from_utf8(jointctl(folder.path(), &["eds", "-"]).stdout).unwrap();
    // They differ by the moment of their making.
    let kept = |text: &str| -> Vec<String> {
        text.lines().filter(|line| !line.contains("Time=") && !line.contains("Date=")).map(str::to_owned).collect()
    };
    assert_eq!(kept(&printed), kept(&written));
    let printed = jointctl(folder.path(), &["dbc", "-"]);
    assert!(printed.stdout.starts_with(b"VERSION"), "{}", stderr(&printed));
    let refused = jointctl(folder.path(), &["excite", "--out", "-"]);
    assert_eq!(refused.status.code(), Some(2), "{}", stderr(&refused));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn the_help_of_a_command_ends_with_examples() {
    let folder = tempfile::tempdir().unwrap();
    for arguments in [
        &["move", "--help"][..],
        &["image", "verify", "--help"],
        &["help", "retrain"],
        &["--help"],
        &["robot", "--help"],
        &["fleet", "--help"],
        &["image", "--help"],
        &["key", "--help"],
    ] {
        let output = jointctl(folder.path(), arguments);
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        let examples = text.split("\nExamples:\n").nth(1).unwrap_or_default();
        assert!(!examples.is_empty() && examples.lines().all(|line| line.starts_with("  jointctl ")), "{text}");
    }
}
