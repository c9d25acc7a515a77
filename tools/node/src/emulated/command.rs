//! Command of somebody at the bench to an emulated board, as a line of text.

use std::str::FromStr;

/// A command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Command {
    /// List of the commands.
    Help,
    /// State of the board.
    Status,
    /// The next command comes after so much time of the board's, s.
    Wait(f64),
    /// Voltage of the supply, V.
    Supply(f64),
    /// Torque on the link from outside, Nm.
    Load(f64),
    /// Turns the link by hand, slowly, by an angle, rad.
    Turn(f64),
    /// Presses the button for a tenth of a second.
    Button,
    /// The encoder is disconnected, or connected again.
    EncoderOpen(bool),
    /// The bridge's thermistor is disconnected, or connected again.
    ThermistorOpen(bool),
    /// The gate driver has this fault and no other, or none any more.
    DriverFault(Option<DriverFault>),
    /// The power comes or goes.
    Power(bool),
}

/// Faults of a gate driver with registers and a fault line. All but [`Forgot`](Self::Forgot) last until another command
/// ends them; what the driver latches stays until it is cleared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DriverFault {
    /// Over-current of a transistor, by its voltage.
    OverCurrent,
    /// Its supply is below its lock-out.
    UnderVoltage,
    /// Over-temperature.
    OverTemperature,
    /// A gate does not follow.
    GateDrive,
    /// The fault line is pulled low from outside, and the driver knows of no fault.
    Line,
    /// Its data line is broken.
    Silent,
    /// Loss of its settings, once, without a fault.
    Forgot,
}

impl DriverFault {
    /// Each with its word.
    const ALL: [(&str, Self); 7] = [
        ("over-current", Self::OverCurrent),
        ("under-voltage", Self::UnderVoltage),
        ("over-temperature", Self::OverTemperature),
        ("gate-drive", Self::GateDrive),
        ("line", Self::Line),
        ("silent", Self::Silent),
        ("forgot", Self::Forgot),
    ];

    /// Its word in a command.
    pub fn word(self) -> &'static str {
        Self::ALL.iter().find(|(_, fault)| *fault == self).map_or("", |(word, _)| word)
    }
}

/// Lines of `help`, one for each command: the command, what follows it, what it does.
pub const HELP: [(&str, &str, &str); 11] = [
    ("help", "", "lists the commands"),
    ("status", "", "time, link, supply, bridge, LED"),
    ("wait", "S", "holds what follows for so long, 0 to 1e6 s of the board's time"),
    ("supply", "V", "voltage of the supply, 0 to 1000 V"),
    ("load", "NM", "torque on the link from outside, -1e5 to 1e5 Nm"),
    ("turn", "RAD", "turns the link by hand, at 0.25 rad/s, -100 to 100 rad"),
    ("button", "", "presses the button for 0.1 s"),
    ("encoder-open", "[on|off]", "disconnects the encoder"),
    ("thermistor-open", "[on|off]", "disconnects the bridge's thermistor"),
    (
        "driver-fault",
        "over-current|under-voltage|over-temperature|gate-drive|line|silent|forgot|off",
        "the gate driver has this fault and no other until the next, line pulls its fault line low, silent breaks its data line, forgot loses its settings once",
    ),
    ("power", "on|off", "the power comes or goes"),
];

/// Reason for which a line is no command.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CommandError {
    /// Unknown command.
    #[error("unknown command \"{0}\"; help lists them")]
    Unknown(String),
    /// Missing arguments of the command, or too many.
    #[error("{name} takes {takes}")]
    Arguments {
        /// The command.
        name: &'static str,
        /// Arguments that follow it.
        takes: &'static str,
    },
    /// A number that is none, or out of range.
    #[error("{name}: \"{value}\" is no number from {least} to {most} {unit}")]
    Number {
        /// The command.
        name: &'static str,
        /// Value that was given.
        value: String,
        /// Least value.
        least: f64,
        /// Largest value.
        most: f64,
        /// Unit.
        unit: &'static str,
    },
}

impl FromStr for Command {
    type Err = CommandError;

    fn from_str(line: &str) -> Result<Self, CommandError> {
        let mut words = line.split_whitespace();
        let (word, given, more) = (words.next().unwrap_or_default(), words.next(), words.next());
        let known = HELP.into_iter().find(|(name, ..)| *name == word);
        let (name, takes, _) = known.ok_or_else(|| CommandError::Unknown(word.to_owned()))?;
        let wrong = CommandError::Arguments { name, takes: if takes.is_empty() { "nothing" } else { takes } };
        if more.is_some() || takes.is_empty() && given.is_some() {
            return Err(wrong);
        }
        let number = |least: f64, most: f64, unit| {
            let value = given.ok_or_else(|| wrong.clone())?;
            let number = value.parse().ok().filter(|number| (least..=most).contains(number));
            number.ok_or_else(|| CommandError::Number { name, value: value.to_owned(), least, most, unit })
        };
        let switch = |absent: Option<bool>| match given {
            Some("on") => Ok(true),
            Some("off") => Ok(false),
            Some(_) => Err(wrong.clone()),
            None => absent.ok_or_else(|| wrong.clone()),
        };
        Ok(match name {
            "help" => Self::Help,
            "status" => Self::Status,
            "wait" => Self::Wait(number(0.0, 1e6, "s")?),
            "supply" => Self::Supply(number(0.0, 1e3, "V")?),
            "load" => Self::Load(number(-1e5, 1e5, "Nm")?),
            "turn" => Self::Turn(number(-100.0, 100.0, "rad")?),
            "button" => Self::Button,
            "encoder-open" => Self::EncoderOpen(switch(Some(true))?),
            "thermistor-open" => Self::ThermistorOpen(switch(Some(true))?),
            "driver-fault" => Self::DriverFault(match given {
                Some("off") => None,
                given => {
                    let known = DriverFault::ALL.into_iter().find(|(word, _)| Some(*word) == given);
                    Some(known.ok_or(wrong)?.1)
                }
            }),
            _ => Self::Power(switch(None)?),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_command_of_the_help_is_one() {
        let known = HELP.map(|(name, takes, _)| {
            let argument = match takes {
                "" => "",
                "[on|off]" | "on|off" => "on",
                of if of.contains('|') => "line",
                _ => "1.5",
            };
            format!("{name} {argument}").parse::<Command>().unwrap()
        });
        assert_eq!(known[4], Command::Load(1.5));
        assert_eq!(known[10], Command::Power(true));
        assert!((0..known.len()).all(|one| (0..one).all(|other| known[one] != known[other])));
        assert_eq!("encoder-open".parse(), Ok(Command::EncoderOpen(true)));
        assert_eq!(" driver-fault  off ".parse(), Ok(Command::DriverFault(None)));
    }

    #[test]
    fn the_help_names_every_fault_of_the_gate_driver() {
        let (_, takes, _) = HELP.into_iter().find(|(name, ..)| *name == "driver-fault").unwrap();
        let words: Vec<&str> = takes.split('|').collect();
        let faults = DriverFault::ALL.map(|(word, fault)| {
            assert_eq!(fault.word(), word);
            assert_eq!(format!("driver-fault {word}").parse(), Ok(Command::DriverFault(Some(fault))));
            word
        });
        assert_eq!(words, [&faults[..], &["off"]].concat());
    }

    #[test]
    fn what_is_wrong_with_a_line_is_said() {
        let said = |line: &str| line.parse::<Command>().unwrap_err().to_string();
        assert_eq!(said("suply 12"), "unknown command \"suply\"; help lists them");
        assert_eq!(said("supply"), "supply takes V");
        assert_eq!(said("supply 12 13"), "supply takes V");
        assert_eq!(said("supply twelve"), "supply: \"twelve\" is no number from 0 to 1000 V");
        assert_eq!(said("supply NaN"), "supply: \"NaN\" is no number from 0 to 1000 V");
        assert_eq!(said("button 3"), "button takes nothing");
        assert_eq!(said("power"), "power takes on|off");
        assert_eq!(said("encoder-open maybe"), "encoder-open takes [on|off]");
        for line in ["driver-fault", "driver-fault on", "driver-fault silent off"] {
            let faults = "over-current|under-voltage|over-temperature|gate-drive|line|silent|forgot|off";
            assert_eq!(said(line), format!("driver-fault takes {faults}"));
        }
    }

    #[test]
    fn numbers_have_limits() {
        for (good, bad) in [
            ("supply 1000", "supply 1000.1"),
            ("supply 0", "supply -0.1"),
            ("load -100000", "load -100001"),
            ("turn 100", "turn 100.1"),
            ("wait 1e6", "wait 1000001"),
            ("wait 0", "wait -1"),
        ] {
            assert!(good.parse::<Command>().is_ok() && bad.parse::<Command>().is_err(), "{good}, {bad}");
        }
    }
}
