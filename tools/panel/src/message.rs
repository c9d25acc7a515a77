//! Messages of a page, as JSON: `{"id":7,"ask":{"held":{"hold":3}}}`. What is not one of these is an error.

use crate::motion::Motion;
use jointctl::commission::Plan;
use serde::Deserialize;

/// Longest message, bytes: an image of the longest kind as an array of numbers, and some more.
pub const LONGEST: usize = 256 << 10;

/// A question and its number, which the answer carries.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Message {
    /// Counted by the page.
    pub id: u64,
    /// Question.
    pub ask: Ask,
}

/// Use of an image, as [`jointctl::remote::image::Use`].
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Usage {
    /// Verified, not in use.
    Verify,
    /// Computed without effect for a time, s.
    Shadow(f64),
    /// Trial for a time, s.
    Trial(f64),
    /// Stored and in use.
    Commit,
}

/// A configuration that a joint's is compared with.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum With {
    /// Content of a joint.toml.
    File(String),
    /// A new board's, by its name.
    Board(String),
}

/// A round of learning.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Wanted {
    /// Duration of each of the two motions that are recorded, s.
    pub excitation: f64,
    /// Duration of the motion that images are judged by, s.
    pub validation: f64,
    /// Networks trained from different first weights; 0 trains none.
    pub restarts: usize,
    /// A fault whose cause is gone is acknowledged first.
    pub acknowledge: bool,
}

/// Request of a page.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Ask {
    /// The button of this hold is still pressed. No answer.
    Held {
        /// Number of the hold.
        hold: u64,
    },
    /// No button is pressed any more. No answer.
    Release,
    /// Stops the joint, whoever moves it.
    Stop,
    /// Moves the joint for as long as a hold lasts.
    Move {
        /// Number of the hold.
        hold: u64,
        /// Motion that is asked for.
        motion: Motion,
        /// A fault whose cause is gone is acknowledged first.
        #[serde(default)]
        reset: bool,
    },
    /// Joints on the bus.
    Scan,
    /// Gives joints without a node id the free ones from a number on.
    Address {
        /// Least of them, 1 to 127.
        first: u8,
    },
    /// Checklist of what the board still misses.
    Checklist,
    /// The control steps before the fault that is latched.
    History,
    /// Commissions the joint, or finds its encoder's index alone; the answer comes at its end.
    Commission {
        /// Known values of the joint, and how far to go.
        plan: Plan,
        /// Stops after the encoder's index.
        index_only: bool,
    },
    /// Lets the joint learn its friction anew; the answer comes at its end.
    Retrain {
        /// How.
        wanted: Wanted,
    },
    /// Answers the question that a commissioning or a round of learning has asked.
    Agree {
        /// Number of the question.
        question: u64,
        /// Hold that lasts until the next question; none to end it here.
        hold: Option<u64>,
    },
    /// Live values anew, after somebody else has put the joint out of OPERATIONAL.
    Look,
    /// Other live values from now on, for all pages.
    Draw {
        /// Friction by its parts in place of current, supply and external torque.
        by_part: bool,
    },
    /// The last minute of live values as CSV.
    Csv,
    /// All objects with their values.
    Objects,
    /// Objects by name, with what a person wrote as their values; settings together or not at all.
    Set {
        /// Names and values.
        values: Vec<(String, String)>,
    },
    /// Keeps what is in use over a loss of power.
    Store,
    /// Words on what is in use against what is stored.
    Stored,
    /// The configuration as joint.toml.
    Export,
    /// Names what differs in a configuration; nothing is set.
    Compare {
        /// The other one.
        with: With,
    },
    /// Sets what differs in a joint.toml.
    Import {
        /// The file's content.
        text: String,
    },
    /// Images and compensation.
    Images,
    /// An image file, as far as is asked for.
    Upload {
        /// The file's content.
        image: Vec<u8>,
        /// Use that is asked for.
        usage: Usage,
    },
    /// The image that this page uploaded, a step further.
    Use {
        /// Use that is asked for.
        usage: Usage,
    },
    /// The image before.
    RollBack,
    /// Ends a trial or shadow and forgets what is staged.
    Discard,
}

impl Ask {
    /// Returns `true` if it changes something: for one page at a time.
    pub const fn changes(&self) -> bool {
        match self {
            Self::Held { .. }
            | Self::Release
            | Self::Stop
            | Self::Scan
            | Self::Checklist
            | Self::History
            | Self::Look
            | Self::Draw { .. }
            | Self::Csv
            | Self::Objects
            | Self::Stored
            | Self::Export
            | Self::Compare { .. }
            | Self::Images => false,
            Self::Move { .. }
            | Self::Address { .. }
            | Self::Commission { .. }
            | Self::Retrain { .. }
            | Self::Agree { .. }
            | Self::Set { .. }
            | Self::Store
            | Self::Import { .. }
            | Self::Upload { .. }
            | Self::Use { .. }
            | Self::RollBack
            | Self::Discard => true,
        }
    }
}

/// Reads a message.
///
/// # Errors
/// Place and reason, in words.
pub fn parse(text: &str) -> Result<Message, String> {
    serde_json::from_str(text).map_err(|error| format!("this is no message of the page: {error}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_are_read_as_the_page_writes_them() {
        for (text, ask) in [
            (r#"{"id":1,"ask":"scan"}"#, Ask::Scan),
            (r#"{"id":1,"ask":{"held":{"hold":3}}}"#, Ask::Held { hold: 3 }),
            (
                r#"{"id":1,"ask":{"move":{"hold":3,"motion":{"jog":{"velocity":-0.5}}}}}"#,
                Ask::Move { hold: 3, motion: Motion::Jog { velocity: -0.5 }, reset: false },
            ),
            (
                r#"{"id":1,"ask":{"set":{"values":[["torque-limit","5"]]}}}"#,
                Ask::Set { values: vec![("torque-limit".into(), "5".into())] },
            ),
            (r#"{"id":1,"ask":{"use":{"usage":{"trial":60}}}}"#, Ask::Use { usage: Usage::Trial(60.0) }),
            (r#"{"id":1,"ask":"roll-back"}"#, Ask::RollBack),
            (r#"{"id":1,"ask":{"agree":{"question":2,"hold":7}}}"#, Ask::Agree { question: 2, hold: Some(7) }),
            (
                r#"{"id":1,"ask":{"commission":{"plan":{"current":8,"travel":1,"turn":true,"acknowledge":false,"pole-pairs":7},"index_only":false}}}"#,
                Ask::Commission { plan: Plan { pole_pairs: Some(7), ..Plan::new(8.0) }, index_only: false },
            ),
        ] {
            assert_eq!(parse(text).unwrap(), Message { id: 1, ask }, "{text}");
        }
    }

    #[test]
    fn everything_else_is_refused_in_words() {
        for text in [
            "",
            "{",
            "[]",
            r#"{"id":-1,"ask":"scan"}"#,
            r#"{"id":1,"ask":"explode"}"#,
            r#"{"id":1,"ask":"scan","more":1}"#,
            r#"{"id":1,"ask":{"held":{"hold":3,"more":1}}}"#,
            r#"{"id":1,"ask":{"move":{"hold":3,"motion":{"jog":{"velocity":1e999}}}}}"#,
            r#"{"id":1,"ask":{"move":{"hold":3,"motion":{"jog":{}}}}}"#,
            r#"{"id":1,"ask":{"upload":{"image":[256],"usage":"commit"}}}"#,
        ] {
            let error = parse(text).unwrap_err();
            assert!(error.starts_with("this is no message of the page: ") && error.len() > 40, "{text}: {error}");
        }
    }
}
