//! slcan, the text protocol of serial CAN adapters (Lawicel CAN232/CANUSB manual, chapter "Commands"); no I/O, host.
//!
//! `t` identifier (3 hex digits), length (1 digit), data (2 hex digits each), carriage return. An adapter answers
//! commands with a carriage return, or with BEL where it refuses. Some adapters append four digits of time stamp to a
//! frame, which are passed over.

use crate::Frame;
use std::collections::VecDeque;

/// Longest line that means anything here: an extended frame with time stamp is 1 + 8 + 1 + 16 + 4 characters.
const LONGEST: usize = 30;
/// "Refused".
pub(super) const BEL: u8 = 0x07;

/// Content of a line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Line {
    /// A data frame with an 11-bit identifier.
    Frame(Frame),
    /// A frame that this program has no use for: extended, remote, CAN FD.
    Other,
    /// The answer to a command: done.
    Accepted,
    /// The answer to a command: not done.
    Refused,
    /// Any other line: a command to an adapter, or an adapter's answer with content.
    Text(Vec<u8>),
    /// Begins like a frame and is none.
    Garbage,
}

/// A frame as a line.
pub(super) fn encode(frame: &Frame) -> Vec<u8> {
    let mut line = format!("t{:03X}{}", frame.id(), frame.data().len()).into_bytes();
    for byte in frame.data() {
        line.extend(format!("{byte:02X}").into_bytes());
    }
    line.push(b'\r');
    line
}

/// Bytes to lines; bytes may come in any pieces.
#[derive(Debug, Default)]
pub(super) struct Decoder {
    line: Vec<u8>,
    /// The line is longer than any; its rest is skipped.
    overlong: bool,
    ready: VecDeque<Line>,
}

impl Decoder {
    pub(super) fn push(&mut self, bytes: &[u8]) {
        for byte in bytes {
            match *byte {
                b'\r' => self.end(),
                BEL => {
                    self.line.clear();
                    self.overlong = false;
                    self.ready.push_back(Line::Refused);
                }
                // Some adapters end lines with both.
                b'\n' => {}
                _ if self.line.len() == LONGEST => self.overlong = true,
                byte => self.line.push(byte),
            }
        }
    }

    /// The next whole line.
    pub(super) fn next(&mut self) -> Option<Line> {
        self.ready.pop_front()
    }

    fn end(&mut self) {
        let line = std::mem::take(&mut self.line);
        let overlong = std::mem::take(&mut self.overlong);
        self.ready.push_back(match line.first() {
            None | Some(b'z' | b'Z') => Line::Accepted,
            // CAN FD lines are longer than this decoder keeps.
            Some(b'T' | b'r' | b'R' | b'd' | b'D' | b'b' | b'B') => Line::Other,
            _ if overlong => Line::Garbage,
            Some(b't') => parse(&line).map_or(Line::Garbage, Line::Frame),
            Some(_) => Line::Text(line),
        });
    }
}

fn parse(line: &[u8]) -> Option<Frame> {
    let (head, rest) = line.split_at_checked(5)?;
    let id = head.get(1..4)?.iter().try_fold(0, |id, digit| Some(id << 4 | u16::from(hex(*digit)?)))?;
    let length = hex(*head.get(4)?)?;
    let (data, stamp) = rest.split_at_checked(usize::from(length) * 2)?;
    if !matches!(stamp.len(), 0 | 4) || !stamp.iter().all(u8::is_ascii_hexdigit) {
        return None;
    }
    let data: Option<Vec<u8>> =
        data.chunks_exact(2).map(|pair| Some(hex(*pair.first()?)? << 4 | hex(*pair.last()?)?)).collect();
    Frame::new(id, &data?)
}

fn hex(digit: u8) -> Option<u8> {
    char::from(digit).to_digit(16).map(|value| value as u8)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn decode(bytes: &[u8]) -> Vec<Line> {
        let mut decoder = Decoder::default();
        decoder.push(bytes);
        std::iter::from_fn(|| decoder.next()).collect()
    }

    #[test]
    fn lines_of_the_manual_and_of_adapters_are_understood() {
        let frame = |id, data: &[u8]| Line::Frame(Frame::new(id, data).unwrap());
        assert_eq!(encode(&Frame::new(0x7A, &[1, 0xAB]).unwrap()), b"t07A201AB\r");
        assert_eq!(decode(b"t07A201AB\r"), [frame(0x7A, &[1, 0xAB])]);
        assert_eq!(decode(b"t07a201abF00D\r\n"), [frame(0x7A, &[1, 0xAB])]);
        assert_eq!(decode(b"t7FF0\r"), [frame(0x7FF, &[])]);
        assert_eq!(decode(b"\rz\rZ\r\x07"), [Line::Accepted, Line::Accepted, Line::Accepted, Line::Refused]);
        assert_eq!(decode(b"V1013\r"), [Line::Text(b"V1013".into())]);
        assert_eq!(decode(b"T0000012301AA\rr1232\rR000001232\r"), [Line::Other, Line::Other, Line::Other]);
        // A CAN FD frame is longer than what is kept.
        assert_eq!(decode(&[b"d123F".as_slice(), &[b'0'; 128], b"\rt0010\r"].concat()), [Line::Other, frame(1, &[])]);
    }

    #[test]
    fn what_only_looks_like_a_frame_is_garbage() {
        for line in [
            "t",
            "t07A",
            "t07A9",
            "t07A1",
            "t07A10",
            "t07A1GG",
            "t8000",
            "tXYZ0",
            "t07A101F",
            "t07A1+1",
            "t07A001234567",
        ] {
            assert_eq!(decode(format!("{line}\r").as_bytes()), [Line::Garbage], "{line}");
        }
        assert_eq!(decode(&[&[b't'; 99], b"\rt0010\r".as_slice()].concat())[0], Line::Garbage);
    }

    proptest! {
        #[test]
        fn any_frame_survives_in_any_pieces(frames in proptest::collection::vec((0u16..0x800, proptest::collection::vec(any::<u8>(), 0..9)), 0..8), piece in 1usize..40) {
            let frames: Vec<_> = frames.iter().map(|(id, data)| Frame::new(*id, data).unwrap()).collect();
            let text: Vec<u8> = frames.iter().flat_map(encode).collect();
            let mut decoder = Decoder::default();
            text.chunks(piece).for_each(|piece| decoder.push(piece));
            let lines: Vec<_> = std::iter::from_fn(|| decoder.next()).collect();
            prop_assert_eq!(lines, frames.into_iter().map(Line::Frame).collect::<Vec<_>>());
        }

        #[test]
        fn no_bytes_panic_and_a_decoder_recovers_at_the_next_line(bytes in proptest::collection::vec(prop_oneof![any::<u8>(), proptest::sample::select(b"tTrR0123456789AFaf\r\x07\n".as_slice())], 0..400)) {
            let mut decoder = Decoder::default();
            decoder.push(&bytes);
            decoder.push(b"\r");
            while decoder.next().is_some() {}
            decoder.push(b"t123155\r");
            prop_assert_eq!(decoder.next(), Some(Line::Frame(Frame::new(0x123, &[0x55]).unwrap())));
            prop_assert!(decoder.line.len() <= LONGEST);
        }
    }
}
