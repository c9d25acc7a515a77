//! The joint's objects for other people's tools, from the one table: an EDS for CANopen masters, the configuration of
//! ros2_canopen, a DBC for what shows frames; host.

pub mod bus_yml;
pub mod dbc;
pub mod eds;

/// Plain ASCII, as both formats want it, without the characters that separate things in them.
fn plain(text: &str) -> String {
    let mut plain = String::new();
    for character in text.chars() {
        match character {
            '°' => plain.push_str("deg"),
            'Ω' => plain.push_str("Ohm"),
            '²' => plain.push_str("^2"),
            'µ' => plain.push('u'),
            ';' => plain.push(','),
            '"' => plain.push('\''),
            character if character.is_ascii() && !character.is_control() => plain.push(character),
            _ => plain.push('?'),
        }
    }
    plain
}

#[cfg(test)]
mod tests {
    use super::plain;
    use crate::remote::Entry;

    #[test]
    fn every_text_of_the_table_is_told_in_plain_characters() {
        assert_eq!(plain("10 °C; \"save\", rad/s², Ω"), "10 degC, 'save', rad/s^2, Ohm");
        for entry in Entry::all() {
            for text in [entry.text.object, entry.text.name, entry.text.unit, entry.text.description] {
                assert!(!plain(text).contains('?'), "{text}");
            }
        }
    }
}
