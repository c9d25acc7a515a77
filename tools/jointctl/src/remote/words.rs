//! Numbers of a joint's objects that stand for words; host.

use super::refusal::image_state;
use joint_firmware::objects::field::{Actual, Field};
use joint_firmware::objects::settings::Setting;

/// Signals by the number that a reason has for them, object 2200h:8.
const SIGNALS: [&str; 6] =
    ["position", "velocity", "theoretical torque", "measured torque", "temperature", "acceleration"];

/// Reasons for which a joint does not learn, by the number of object 2201h:2.
const LEARNING: [&str; 9] = [
    "learns",
    "off",
    "no image acts",
    "operation is not enabled",
    "outside the trained range",
    "the joint stands",
    "its command does not move it",
    "torque or compensation at a limit",
    "something touches the joint",
];

/// Words for the number in this object; none where numbers of it are numbers.
pub fn words(field: Field, number: u64) -> Option<String> {
    match field {
        Field::AtOnce(Setting::Request) | Field::Actual(Actual::ActingModel) => Some(model(number).into()),
        Field::Actual(Actual::Reason) => Some(reason(number)),
        Field::Actual(Actual::Learning) => Some(learning(number).into()),
        Field::Actual(Actual::ImageState) => {
            image_state(u8::try_from(number).ok()?).map(|state| format!("{state:?}").to_lowercase())
        }
        _ => None,
    }
}

/// Objects 2200h:1 and 2200h:2 in words.
pub fn model(number: u64) -> &'static str {
    match number {
        0 => "nothing",
        1 => "the physical model",
        2 => "the physical model and the network",
        3 => "the physical model, the network in shadow",
        _ => "a model that this program does not know",
    }
}

/// Object 2200h:8 in words.
pub fn reason(number: u64) -> String {
    let signal = |at: u64| SIGNALS.get(at as usize).copied().unwrap_or("a signal");
    match number {
        0 => "as requested".into(),
        1 => "switched off".into(),
        2 => "there is no image".into(),
        3 => "the image has no network here".into(),
        16..=31 => format!("{} is outside the trained range", signal(number - 16)),
        32..=47 => format!("{} is far outside the trained range", signal(number - 32)),
        _ => format!("reason {number}"),
    }
}

/// Object 2201h:2 in words.
pub fn learning(number: u64) -> &'static str {
    LEARNING.get(number as usize).copied().unwrap_or("unknown")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::remote::Entry;

    /// Numbers that an object's own documentation lists, each with its text up to the next comma or semicolon.
    fn documented(field: Field) -> Vec<u64> {
        let text = Entry::of(field).text.description;
        text.split([',', ';', ':']).filter_map(|part| part.split_whitespace().next()?.parse().ok()).collect()
    }

    #[test]
    fn every_number_that_an_object_documents_has_words_of_its_own_and_the_next_has_none() {
        for (field, count) in [
            (Field::AtOnce(Setting::Request), 4),
            (Field::Actual(Actual::ActingModel), 3),
            (Field::Actual(Actual::Learning), LEARNING.len()),
        ] {
            let numbers = documented(field);
            assert_eq!(numbers, (0..count as u64).collect::<Vec<_>>(), "{field:?}");
            let told: std::collections::BTreeSet<_> = numbers.iter().map(|n| words(field, *n)).collect();
            assert_eq!(told.len(), count, "{field:?}: {told:?}");
        }
        assert_eq!([model(3), model(4)].map(|text| text.contains("does not know")), [false, true]);
        assert_eq!([8, 9].map(|n| learning(n) == "unknown"), [false, true]);
    }

    #[test]
    fn a_reason_names_its_signal_up_to_the_last() {
        let last = SIGNALS.len() as u64 - 1;
        for (first, how) in [(16, "outside"), (32, "far outside")] {
            assert_eq!(reason(first), format!("position is {how} the trained range"));
            assert_eq!(reason(first + last), format!("acceleration is {how} the trained range"));
            assert_eq!(reason(first + last + 1), format!("a signal is {how} the trained range"));
        }
        assert_eq!([3, 4].map(reason), ["the image has no network here", "reason 4"]);
        assert_eq!(words(Field::Actual(Actual::Violations), 0), None);
    }
}
