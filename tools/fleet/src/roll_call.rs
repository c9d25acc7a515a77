//! Roll call: the registry beside what the joints on a bus say; host. No I/O.

use crate::registry::{Identity, Record, made, running};
use serde::Serialize;
use std::collections::BTreeMap;

/// Answer of a joint.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Answer {
    /// Node id.
    pub node: u8,
    /// Identity.
    pub identity: Identity,
    /// Version and SHA-256 of its image; none where it runs none.
    pub image: Option<(u32, String)>,
}

/// A joint's state beside the registry; worst last.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// The image of the registry.
    Same,
    /// Another image, or none.
    OtherImage,
    /// Not in the registry.
    UnknownJoint,
    /// In the registry, not on the bus.
    SilentJoint,
}

impl Verdict {
    /// Name in words.
    #[must_use]
    pub const fn words(self) -> &'static str {
        match self {
            Self::Same => "same",
            Self::OtherImage => "other image",
            Self::UnknownJoint => "unknown joint",
            Self::SilentJoint => "silent joint",
        }
    }
}

/// A joint of the registry, of the bus, or of both.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Line {
    /// Name in the registry.
    pub joint: Option<String>,
    /// Node id on the bus.
    pub node: Option<u8>,
    /// Identity.
    pub identity: Identity,
    /// State.
    pub verdict: Verdict,
    /// The same as a sentence.
    pub reason: String,
    /// Version of an image that was made for the joint since, and which it does not run yet.
    pub waiting: Option<u32>,
}

/// Compares; joints of the registry by name, then the unknown by node id.
#[must_use]
pub fn compare(records: &[Record], answers: &[Answer]) -> Vec<Line> {
    let registered = running(records);
    let answers: BTreeMap<Identity, &Answer> = answers.iter().map(|answer| (answer.identity, answer)).collect();
    let mut lines: Vec<Line> = registered
        .iter()
        .map(|(identity, record)| {
            let answer = answers.get(identity).copied();
            let (verdict, reason) = beside(record, answer, records);
            let node = answer.map(|answer| answer.node);
            let now = answer.and_then(|answer| answer.image.as_ref()).map_or(record.version, |(version, _)| *version);
            let waiting = waiting(records, &record.joint, now);
            Line { joint: Some(record.joint.clone()), node, identity: *identity, verdict, reason, waiting }
        })
        .collect();
    lines.sort_by(|one, other| (&one.joint, one.identity).cmp(&(&other.joint, other.identity)));
    let mut unknown: Vec<&Answer> =
        answers.into_values().filter(|answer| !registered.contains_key(&answer.identity)).collect();
    unknown.sort_by_key(|answer| answer.node);
    lines.extend(unknown.into_iter().map(|answer| Line {
        joint: None,
        node: Some(answer.node),
        identity: answer.identity,
        verdict: Verdict::UnknownJoint,
        reason: format!("runs {}; `jointctl fleet register` enters it", said(answer.image.as_ref(), records)),
        waiting: None,
    }));
    lines
}

fn beside(record: &Record, answer: Option<&Answer>, records: &[Record]) -> (Verdict, String) {
    let entered = match record.image.is_empty() {
        true => "no image".to_owned(),
        false => format!("version {}", record.version),
    };
    match answer {
        None => (Verdict::SilentJoint, format!("{entered} in the registry")),
        Some(answer) => {
            let digest = answer.image.as_ref().map_or("", |(_, digest)| digest);
            match digest == record.image {
                true => (Verdict::Same, entered),
                false => {
                    let said = said(answer.image.as_ref(), records);
                    (Verdict::OtherImage, format!("{entered} in the registry, the joint runs {said}"))
                }
            }
        }
    }
}

/// An image in words, with the joint that it was made for.
fn said(image: Option<&(u32, String)>, records: &[Record]) -> String {
    let Some((version, digest)) = image else { return "no image".into() };
    match made(records, digest) {
        Some(made) => format!("version {version}, made for {}", made.joint),
        None => format!("version {version}, SHA-256 {digest:.8}..., which is not in the registry"),
    }
}

/// Newest version that was made for a joint, where it is newer than the one that it runs.
fn waiting(records: &[Record], joint: &str, now: u32) -> Option<u32> {
    let made = records.iter().filter(|record| record.identity.is_none() && record.joint == joint);
    made.map(|record| record.version).max().filter(|version| *version > now)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registry::Event;

    fn record(joint: &str, serial: Option<u32>, version: u32) -> Record {
        Record {
            time_ms: 1,
            event: if serial.is_some() { Event::Runs } else { Event::Made },
            joint: joint.into(),
            identity: serial.map(|serial| Identity { product: 7, serial }),
            version,
            image: if version == 0 { String::new() } else { format!("{version}").repeat(64) },
            days: String::new(),
            data: String::new(),
            key: String::new(),
        }
    }

    fn answer(node: u8, serial: u32, version: u32) -> Answer {
        let image = (version > 0).then(|| (version, format!("{version}").repeat(64)));
        Answer { node, identity: Identity { product: 7, serial }, image }
    }

    #[test]
    fn each_joint_is_the_same_another_image_unknown_or_silent() {
        let records = [
            record("a", None, 2),
            record("b", None, 5),
            record("a", Some(1), 1),
            record("a", Some(1), 2),
            record("b", Some(2), 3),
            record("c", Some(3), 4),
            record("d", Some(4), 0),
        ];
        let answers = [answer(9, 8, 0), answer(1, 1, 2), answer(4, 4, 5), answer(2, 2, 6)];
        let lines = compare(&records, &answers);
        let of = |at: usize| (lines[at].joint.as_deref(), lines[at].node, lines[at].verdict, lines[at].waiting);
        assert_eq!(lines.len(), 5);
        assert_eq!(of(0), (Some("a"), Some(1), Verdict::Same, None));
        assert_eq!(of(1), (Some("b"), Some(2), Verdict::OtherImage, None));
        assert!(
            lines[1].reason.contains("version 3 in the registry, the joint runs version 6, SHA-256 66666666..., which")
        );
        assert_eq!(of(2), (Some("c"), None, Verdict::SilentJoint, None));
        assert_eq!(of(3), (Some("d"), Some(4), Verdict::OtherImage, None));
        assert!(lines[3].reason.contains("no image in the registry, the joint runs version 5, made for b"));
        assert_eq!(of(4), (None, Some(9), Verdict::UnknownJoint, None));
        // An image that was made waits until the joint runs it: from the version above the one that it runs.
        for (version, waits) in [(4, Some(5)), (5, None)] {
            assert_eq!(compare(&records, &[answer(2, 2, version)])[1].waiting, waits);
        }
    }

    #[test]
    fn joints_with_one_serial_number_and_two_products_are_two_joints() {
        let mut other = answer(2, 1, 1);
        other.identity.product = 8;
        let lines = compare(&[record("a", Some(1), 1)], &[other]);
        assert_eq!(
            lines.iter().map(|line| line.verdict).collect::<Vec<_>>(),
            [Verdict::SilentJoint, Verdict::UnknownJoint]
        );
    }
}
