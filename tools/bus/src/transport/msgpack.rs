//! A frame as python-can's `udp_multicast` writes it: a msgpack map of `can.Message`'s attributes (python-can 4.6,
//! `can/interfaces/udp_multicast/utils.py`); no I/O, host.

use crate::Frame;
use serde::{Deserialize, Serialize};
use serde_bytes::Bytes;

/// Message in the order in which python-can packs it.
#[derive(Serialize)]
struct Outgoing<'a> {
    timestamp: f64,
    arbitration_id: u16,
    is_extended_id: bool,
    is_remote_frame: bool,
    is_error_frame: bool,
    channel: Option<&'a str>,
    dlc: usize,
    data: &'a Bytes,
    is_fd: bool,
    bitrate_switch: bool,
    error_state_indicator: bool,
}

/// Keys of a message that have to be known; any other key is passed over.
#[derive(Deserialize)]
struct Incoming<'a> {
    arbitration_id: u32,
    #[serde(default)]
    is_extended_id: bool,
    #[serde(default)]
    is_remote_frame: bool,
    #[serde(default)]
    is_error_frame: bool,
    #[serde(default)]
    is_fd: bool,
    #[serde(borrow)]
    data: &'a Bytes,
}

/// Content of a datagram.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Message {
    /// A data frame with an 11-bit identifier.
    Frame(Frame),
    /// A frame that this program has no use for: extended, remote, error, CAN FD.
    Other,
    /// None of python-can's.
    Garbage,
}

/// `timestamp` in seconds; receivers replace it by their own.
pub(super) fn encode(frame: &Frame, timestamp: f64) -> Vec<u8> {
    let message = Outgoing {
        timestamp,
        arbitration_id: frame.id(),
        is_extended_id: false,
        is_remote_frame: false,
        is_error_frame: false,
        channel: None,
        dlc: frame.data().len(),
        data: Bytes::new(frame.data()),
        is_fd: false,
        bitrate_switch: false,
        error_state_indicator: false,
    };
    // Fails only where the writer fails, and a vector does not.
    rmp_serde::to_vec_named(&message).unwrap_or_default()
}

/// Reads one datagram.
pub(super) fn decode(datagram: &[u8]) -> Message {
    let mut deserializer = rmp_serde::Deserializer::from_read_ref(datagram);
    // Maps in maps are not python-can's, and each costs stack.
    deserializer.set_max_depth(8);
    let Ok(message) = Incoming::deserialize(&mut deserializer) else { return Message::Garbage };
    if message.is_extended_id || message.is_remote_frame || message.is_error_frame || message.is_fd {
        return Message::Other;
    }
    let frame = u16::try_from(message.arbitration_id).ok().and_then(|id| Frame::new(id, message.data));
    frame.map_or(Message::Garbage, Message::Frame)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// `pack_message(can.Message(arbitration_id=0x601, is_extended_id=False, data=[1, 2, 3]))`, python-can 4.6.1,
    /// msgpack 1.2.4.
    const PACKED: &str = "8ba974696d657374616d70cb0000000000000000ae6172626974726174696f6e5f6964cd0601ae69735f657874656e6465645f6964c2\
af69735f72656d6f74655f6672616d65c2ae69735f6572726f725f6672616d65c2a76368616e6e656cc0a3646c6303a464617461c403010203\
a569735f6664c2ae626974726174655f737769746368c2b56572726f725f73746174655f696e64696361746f72c2";

    fn packed() -> Vec<u8> {
        let digits: Vec<_> = PACKED.chars().map(|digit| digit.to_digit(16).unwrap() as u8).collect();
        digits.chunks(2).map(|pair| pair[0] << 4 | pair[1]).collect()
    }

    #[test]
    fn the_bytes_are_those_of_python_can() {
        let frame = Frame::new(0x601, &[1, 2, 3]).unwrap();
        assert_eq!(encode(&frame, 0.0), packed());
        assert_eq!(decode(&packed()), Message::Frame(frame));
    }

    #[test]
    fn frames_that_are_not_ours_and_datagrams_that_are_not_frames_are_told_apart() {
        let with = |key: &str| {
            let mut bytes = packed();
            let end = bytes.windows(key.len()).position(|window| window == key.as_bytes()).unwrap() + key.len();
            assert_eq!(bytes[end], 0xC2);
            bytes[end] = 0xC3;
            decode(&bytes)
        };
        for key in ["is_extended_id", "is_remote_frame", "is_error_frame", "is_fd"] {
            assert_eq!(with(key), Message::Other, "{key}");
        }
        assert_eq!(decode(b""), Message::Garbage);
        assert_eq!(decode(b"hello"), Message::Garbage);
        // 12 bits without is_extended_id.
        let mut wide = packed();
        let at = wide.windows(2).position(|window| window == [0x06, 0x01]).unwrap();
        wide[at] = 0x08;
        assert_eq!(decode(&wide), Message::Garbage);
        // Ten thousand arrays in each other.
        assert_eq!(decode(&[&[0x81, 0xA1, b'x'][..], &[0x91; 10_000]].concat()), Message::Garbage);
    }

    proptest! {
        #[test]
        fn any_frame_survives(id in 0u16..0x800, data in proptest::collection::vec(any::<u8>(), 0..9), timestamp: f64) {
            let frame = Frame::new(id, &data).unwrap();
            prop_assert_eq!(decode(&encode(&frame, timestamp)), Message::Frame(frame));
        }

        #[test]
        fn no_bytes_panic(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
            decode(&bytes);
        }

        #[test]
        fn no_damaged_message_panics(changes in proptest::collection::vec((0usize..400, any::<u8>()), 1..6), length in 0usize..300) {
            let mut bytes = packed();
            for (at, value) in changes {
                let at = at % bytes.len();
                bytes[at] = value;
            }
            bytes.truncate(length);
            decode(&bytes);
        }
    }
}
