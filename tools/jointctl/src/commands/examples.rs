//! Examples at the end of every command's help.

use clap::Command;

/// Names of commands below `jointctl`, and lines as one types them. `JOINTCTL_BUS` and `JOINTCTL_NODE` stand for
/// `--bus` and `--node`.
const EXAMPLES: [(&str, &[&str]); 50] = [
    (
        "",
        &[
            "jointctl demo",
            "jointctl sim --bus udp:239.74.163.2:43113 --node 5",
            "jointctl info --bus udp:239.74.163.2:43113 --node 5",
        ],
    ),
    ("robot", &["jointctl robot fit recording.toml --out arm", "jointctl robot evaluate arm second.toml"]),
    ("fleet", &["jointctl fleet status /data/fleet", "jointctl fleet retrain /data/fleet --out new"]),
    ("image", &["jointctl image verify elbow/friction.img", "jointctl image convert elbow/friction.img friction.toml"]),
    ("key", &["jointctl key new joint.key", "jointctl key give joint.key --bus socketcan:can0 --node 5"]),
    ("demo", &["jointctl demo", "jointctl demo --seed 7 --out demo-7"]),
    ("fit", &["jointctl fit elbow.toml", "jointctl fit elbow.toml --all"]),
    ("evaluate", &["jointctl evaluate elbow/friction.img other.toml"]),
    (
        "robot fit",
        &["jointctl robot fit recording.toml", "jointctl robot fit recording.toml --network never --out arm"],
    ),
    (
        "robot excite",
        &[
            "jointctl robot excite robot.toml --out motion",
            "jointctl robot excite robot.toml --acceleration 5 --floor 0.1 --seed 3 --out motion",
        ],
    ),
    (
        "robot evaluate",
        &[
            "jointctl robot evaluate arm second.toml",
            "jointctl robot evaluate arm recording.toml --test",
            "jointctl robot evaluate arm pushed.toml --external torques.csv",
        ],
    ),
    (
        "robot move",
        &[
            "jointctl robot move robot.toml --motion motion --bus socketcan:can0 --node 5 --node 6 --out recorded",
            "jointctl robot move robot.toml --motion motion --bus socketcan:can0 --fitted arm --compare",
        ],
    ),
    (
        "fleet sums",
        &["jointctl fleet sums /data/fleet", "jointctl fleet sums /data/fleet --joint left-elbow --joint left-wrist"],
    ),
    (
        "fleet status",
        &[
            "jointctl fleet status /data/fleet",
            "jointctl fleet status /data/fleet --page fleet.html --json",
            "jointctl fleet status /data/fleet --stored --bus socketcan:can0",
        ],
    ),
    ("fleet retrain", &["jointctl fleet retrain /data/fleet --out new --images stored --key fleet.key"]),
    ("fleet register", &["jointctl fleet register /data/fleet --joint left-elbow --bus socketcan:can0 --node 5"]),
    ("fleet images", &["jointctl fleet images /data/fleet"]),
    ("image inspect", &["jointctl image inspect elbow/friction.img"]),
    ("image verify", &["jointctl image verify elbow/friction.signed --key joint.key"]),
    ("image convert", &["jointctl image convert elbow/friction.img friction.toml"]),
    ("key new", &["jointctl key new joint.key"]),
    ("key give", &["jointctl key give joint.key --bus socketcan:can0 --node 5"]),
    ("key rotate", &["jointctl key rotate next.key --key joint.key --bus socketcan:can0 --node 5"]),
    (
        "key forget",
        &[
            "jointctl key forget --key joint.key --bus socketcan:can0 --node 5",
            "jointctl key forget --bus socketcan:can0 --node 5",
        ],
    ),
    ("key number", &["jointctl key number joint.key"]),
    ("sign", &["jointctl sign elbow/friction.img --key joint.key --version 2 --serial 12"]),
    (
        "sim",
        &[
            "jointctl sim --image demo/friction.img",
            "jointctl sim --config joint.toml --plant plant.toml --scenario slow-reversal",
            "jointctl sim --bus udp:239.74.163.2:43113 --node 5 --node 6",
            "jointctl sim --robot robot.toml --bus udp:239.74.163.2:43113",
        ],
    ),
    ("scan", &["jointctl scan --bus socketcan:can0"]),
    ("address", &["jointctl address --bus socketcan:can0 --first 5 --wait 300"]),
    ("info", &["jointctl info --bus socketcan:can0 --node 5"]),
    (
        "get",
        &[
            "jointctl get torque-limit limits 6064 --bus socketcan:can0 --node 5",
            "jointctl get limits --json --bus socketcan:can0 --node 5",
        ],
    ),
    ("set", &["jointctl set requested-model 2 --bus socketcan:can0 --node 5"]),
    ("enable", &["jointctl enable --bus socketcan:can0 --node 5"]),
    ("disable", &["jointctl disable --bus socketcan:can0 --node 5"]),
    (
        "move",
        &[
            "jointctl move position 0.5 --duration 2 --bus socketcan:can0 --node 5",
            "jointctl move velocity -0.3 --duration 2 --bus socketcan:can0 --node 5",
        ],
    ),
    ("commission", &["jointctl commission --current 8 --current-limit 12 --bus socketcan:can0 --node 5"]),
    ("monitor", &["jointctl monitor --bus socketcan:can0 --node 5"]),
    ("record", &["jointctl record --out elbow.csv --duration 60 --bus socketcan:can0 --node 5"]),
    ("retrain", &["jointctl retrain --bus socketcan:can0 --node 5"]),
    (
        "upload",
        &[
            "jointctl upload elbow/friction.img --trial 60 --bus socketcan:can0 --node 5",
            "jointctl upload elbow/friction.img --commit --bus socketcan:can0 --node 5",
        ],
    ),
    ("rollback", &["jointctl rollback --bus socketcan:can0 --node 5"]),
    ("discard", &["jointctl discard --bus socketcan:can0 --node 5"]),
    ("store", &["jointctl store --bus socketcan:can0 --node 5"]),
    ("restore", &["jointctl restore --bus socketcan:can0 --node 5"]),
    ("eds", &["jointctl eds", "jointctl eds elbow.eds --bus socketcan:can0 --node 5"]),
    ("dbc", &["jointctl dbc arm.dbc --node 5 --node 6"]),
    ("bus-yml", &["jointctl bus-yml --node 5 --node 6 --out arm"]),
    ("excite", &["jointctl excite --config joint.toml", "jointctl excite --config joint.toml --check my-motion.csv"]),
    ("man", &["jointctl man ~/.local/share/man/man1"]),
    ("completions", &["jointctl completions bash > ~/.local/share/bash-completion/completions/jointctl"]),
];

/// The commands with their examples.
pub fn with_examples(command: Command) -> Command {
    EXAMPLES.iter().fold(command, |command, (path, lines)| {
        let help = lines.iter().fold("Examples:".to_owned(), |help, line| format!("{help}\n  {line}"));
        below(command, &path.split_whitespace().collect::<Vec<_>>(), help)
    })
}

fn below(command: Command, path: &[&str], help: String) -> Command {
    match path.split_first() {
        Some((name, rest)) => command.mut_subcommand(name, |command| below(command, rest, help)),
        None => command.after_help(help),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::arguments;
    use clap::ArgMatches;

    /// Names of the command that was asked for, below `jointctl`.
    fn path(matches: &ArgMatches) -> Vec<&str> {
        matches.subcommand().map_or_else(Vec::new, |(name, matches)| [&[name], &path(matches)[..]].concat())
    }

    /// Names of a command and all below it.
    fn all(command: &Command, name: &str, found: &mut Vec<String>) {
        let help = command.clone().render_help().to_string();
        assert!(help.contains("\nExamples:\n  jointctl "), "{name}: {help}");
        found.push(name.to_owned());
        for command in command.get_subcommands() {
            all(command, format!("{name} {}", command.get_name()).trim(), found);
        }
    }

    #[test]
    fn every_command_has_examples_and_they_are_valid() {
        let command = arguments();
        let mut names = Vec::new();
        all(&command, "", &mut names);
        let mut with: Vec<&str> = EXAMPLES.iter().map(|(path, _)| *path).collect();
        names.sort();
        with.sort_unstable();
        assert_eq!(names, with);
        for (name, lines) in EXAMPLES {
            for line in lines {
                let words = line.split(" > ").next().unwrap_or_default().split(' ');
                let matches =
                    command.clone().try_get_matches_from(words).unwrap_or_else(|error| panic!("{line}: {error}"));
                // Those of a command with commands of its own are of these.
                let found = path(&matches).join(" ");
                let (above, is_one) = (format!("{name} "), found == name);
                assert!(is_one || name.is_empty() || found.starts_with(&above), "{line} is no example of {name}");
            }
        }
    }
}
