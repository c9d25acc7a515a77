//! Well-formed transfers as frames, images of all kinds, and bytes read as a course of events: the parts that hostile
//! buses are made of.

use super::{HostileNode, NODE, Violation};
use crate::SampleImage;
use bus::Frame;
use friction_compensation::friction::regime::Selector;
use friction_compensation::parameters::authentication::Key;

/// Ways of a transfer longer than four bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Transfer {
    Segmented,
    Block,
}

/// Images that an attacker may have: any without a tag, signed ones that were heard on the bus (one of an old version),
/// one with the tag of another key, one with another image's tag, one for another joint, one that is cut off.
#[must_use]
pub fn images(key: &Key) -> Vec<Vec<u8>> {
    let constant = SampleImage::constant;
    let signed = |image: Vec<u8>, key: &Key| [image.clone(), key.sign(&image).to_vec()].concat();
    let other = Key::new(key.to_bytes().map(|byte| byte ^ 0x55)).unwrap_or_else(|_| key.clone());
    let network = SampleImage { version: 4, levels: &[0.3], selector: Selector::default(), network: true, golden: 8 };
    let mut elsewhere = constant(9, 0.4);
    // Serial number 7.
    elsewhere[16] = 7;
    seal(&mut elsewhere);
    let mut cut = constant(5, 0.1);
    cut.truncate(150);
    vec![
        constant(3, 0.25),
        constant(1, 0.25),
        network.bytes(),
        signed(constant(3, 0.5), key),
        signed(network.bytes(), key),
        signed(constant(1, 0.5), key),
        signed(constant(7, 0.5), &other),
        [constant(8, 0.5), key.sign(&constant(3, 0.5)).to_vec()].concat(),
        signed(elsewhere, key),
        cut,
    ]
}

/// Makes the checksum of an image right, where there is one.
pub(super) fn seal(upload: &mut [u8]) {
    let stated = match upload {
        [_, _, _, _, _, _, low, high, ..] => usize::from(u16::from_le_bytes([*low, *high])),
        _ => return,
    };
    let Some(content) = stated.checked_sub(4).filter(|_| stated <= upload.len()) else { return };
    let (content, rest) = upload.split_at_mut(content);
    let checksum = !content.iter().fold(u32::MAX, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| if crc & 1 == 1 { (crc >> 1) ^ 0xEDB8_8320 } else { crc >> 1 })
    });
    rest[..4].copy_from_slice(&checksum.to_le_bytes());
}

fn initiate(command: u8, index: u16, sub_index: u8, data: [u8; 4]) -> [u8; 8] {
    let ([low, high], [a, b, c, d]) = (index.to_le_bytes(), data);
    [command, low, high, sub_index, a, b, c, d]
}

/// Frames that a client sends to write `data`; up to four bytes go expedited, whatever the way.
pub(super) fn download(way: Transfer, index: u16, sub_index: u8, data: &[u8]) -> Vec<[u8; 8]> {
    let size = (data.len() as u32).to_le_bytes();
    let padded = |piece: &[u8], first: u8| {
        let mut message = [0; 8];
        message[0] = first;
        message[1..=piece.len()].copy_from_slice(piece);
        message
    };
    let pieces: Vec<&[u8]> = if data.is_empty() { vec![data] } else { data.chunks(7).collect() };
    let count = pieces.len();
    match (way, data.len()) {
        (_, 1..=4) => {
            let mut four = [0; 4];
            four[..data.len()].copy_from_slice(data);
            vec![initiate(0x23 | (4 - data.len() as u8) << 2, index, sub_index, four)]
        }
        (Transfer::Segmented, _) => {
            let mut messages = vec![initiate(0x21, index, sub_index, size)];
            for (number, piece) in pieces.into_iter().enumerate() {
                let unused = (7 - piece.len() as u8) << 1;
                messages.push(padded(piece, (number as u8 & 1) << 4 | unused | u8::from(number + 1 == count)));
            }
            messages
        }
        (Transfer::Block, _) => {
            let mut messages = vec![initiate(0xC6, index, sub_index, size)];
            for (number, piece) in pieces.into_iter().enumerate() {
                let last = if number + 1 == count { 0x80 } else { 0 };
                messages.push(padded(piece, ((number % 127) as u8 + 1) | last));
            }
            let [low, high] = crc(data).to_le_bytes();
            let unused = (count * 7 - data.len()) as u8;
            messages.push([0xC1 | unused << 2, low, high, 0, 0, 0, 0, 0]);
            messages
        }
    }
}

/// Frames that a client sends to read a short object.
pub(super) fn upload(way: Transfer, index: u16, sub_index: u8) -> Vec<[u8; 8]> {
    match way {
        Transfer::Segmented => {
            let mut messages = vec![initiate(0x40, index, sub_index, [0; 4])];
            messages.extend((0..40).map(|number| [0x60 | (number & 1) << 4, 0, 0, 0, 0, 0, 0, 0]));
            messages
        }
        Transfer::Block => {
            let start = [0xA3, 0, 0, 0, 0, 0, 0, 0];
            let [acknowledged, end] = [[0xA2, 40, 127, 0, 0, 0, 0, 0], [0xA1, 0, 0, 0, 0, 0, 0, 0]];
            vec![initiate(0xA4, index, sub_index, [127, 0, 0, 0]), start, acknowledged, end]
        }
    }
}

/// CRC-16/XMODEM, as CiA 301 section 7.2.4.3.16 has it.
fn crc(data: &[u8]) -> u16 {
    data.iter().fold(0, |crc: u16, byte| {
        let step = |crc: u16, _| if crc & 0x8000 != 0 { crc << 1 ^ 0x1021 } else { crc << 1 };
        (0..8).fold(crc ^ u16::from(*byte) << 8, step)
    })
}

/// Reads bytes as what happens to a node, so that a fuzzer can find its way: a control byte, then what belongs to it.
///
/// | control byte | then | |
/// |---|---|---|
/// | `0iii nnnn`, n up to 8 | n bytes (i = 7: two bytes of identifier before) | a frame: i = 0 SDO, 1 NMT, 2 SYNC, 3 to 6 RPDO 1 to 4; then the task |
/// | `0iii 1001` | | the same frame as the last one again |
/// | `1000 xxxx` | a byte b | time, b x 4^x us |
/// | `1001 xxxx` | | the joint is under current (odd x) or not |
/// | `101w xxxx` | | image x is written, segmented or by block |
/// | `1100 xxxx` | | image command x |
/// | `1101 xxxx` | | an object of four bytes is written: index (2), sub-index, value (4) |
/// | `111w xxxx` | | the object of two following bytes is read |
///
/// # Errors
/// Violations of the protocol.
pub fn interpret(bytes: &[u8], node: &mut HostileNode, images: &[Vec<u8>]) -> Result<(), Violation> {
    let mut rest = bytes.iter().copied();
    let mut byte = move || rest.next();
    let mut last = Frame::new(0x80, &[]);
    while let Some(control) = byte() {
        let id = 0x600 + u16::from(if node.id() > 127 { NODE } else { node.id() });
        let low = control & 0x0F;
        let way = if control & 0x10 == 0 { Transfer::Segmented } else { Transfer::Block };
        let messages = match control >> 4 {
            0..8 => {
                if low <= 8 {
                    let node = id - 0x600;
                    let pdo = |number: u8| 0x200 + 0x100 * u16::from(number) + node;
                    let id = match control >> 4 {
                        0 => id,
                        1 => 0,
                        2 => 0x80,
                        number @ 3..=6 => pdo(number - 3),
                        _ => u16::from_le_bytes([byte().unwrap_or(0), byte().unwrap_or(0) & 7]),
                    };
                    let data: Vec<u8> = (0..low).map_while(|_| byte()).collect();
                    last = Frame::new(id, &data);
                }
                if let Some(frame) = &last {
                    node.receive(frame)?;
                    node.work()?;
                }
                continue;
            }
            8 => {
                let time = u32::from(byte().unwrap_or(0)).saturating_mul(1 << (2 * low).min(22));
                node.wait(time);
                node.work()?;
                continue;
            }
            9 => {
                node.observe(low & 1 != 0, f32::from(low));
                node.work()?;
                continue;
            }
            0xA | 0xB => match images.get(usize::from(low)) {
                Some(image) => download(way, 0x2210, 0, image),
                None => continue,
            },
            0xC => download(way, 0x2212, 1, &[low]),
            0xD => {
                let [a, b, sub_index, value @ ..]: [u8; 7] = std::array::from_fn(|_| byte().unwrap_or(0));
                download(way, u16::from_le_bytes([a, b]), sub_index, &value)
            }
            _ => upload(way, u16::from_le_bytes([byte().unwrap_or(0), byte().unwrap_or(0)]), low),
        };
        for message in messages {
            if let Some(frame) = Frame::new(id, &message) {
                node.receive(&frame)?;
                node.work()?;
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hostile::{Noise, Statics};

    fn key() -> Key {
        Key::new(std::array::from_fn(|i| i as u8)).unwrap()
    }

    /// 1101: four bytes at an index and a sub-index.
    fn write(index: u16, sub_index: u8, value: u32) -> Vec<u8> {
        [&[0xD0][..], &index.to_le_bytes(), &[sub_index], &value.to_le_bytes()].concat()
    }

    #[test]
    fn a_script_can_do_what_an_owner_can_so_that_the_judge_has_something_to_judge() {
        let (key, mut statics) = (key(), Statics::new());
        let images = images(&key);
        let mut node = HostileNode::new(&mut statics, Some(&key)).unwrap();
        interpret(&write(0x2212, 7, 60_000), &mut node, &images).unwrap();
        // NMT start, image 3 (signed, version 3) by block, verify, trial, discard, commit, the newer one segmented,
        // roll back.
        let script = [0x12, 1, 5, 0xB3, 0xC1, 0xC2, 0xC5, 0xB3, 0xC1, 0xC3, 0xA4, 0xC1, 0xC3, 0xC4];
        interpret(&script, &mut node, &images).unwrap();
        let counts = *node.counts();
        // A roll back takes a session, as does a commit of what is not newer, and an open joint lets anybody do
        // both.
        assert_eq!((counts.run, counts.stored, counts.rolled_back), (1, 1, 0), "{counts:?}");
        let mut statics = Statics::new();
        let mut open = HostileNode::new(&mut statics, None).unwrap();
        interpret(&write(0x2212, 7, 60_000), &mut open, &images).unwrap();
        interpret(&script, &mut open, &images).unwrap();
        assert_eq!((open.counts().stored, open.counts().rolled_back), (2, 1), "{:?}", open.counts());
        // Without the key's tag nothing of it.
        let (mut statics, mut forged) = (Statics::new(), 0);
        let mut node = HostileNode::new(&mut statics, Some(&key)).unwrap();
        interpret(&write(0x2212, 7, 60_000), &mut node, &images).unwrap();
        for image in [0xB0, 0xB1, 0xB2, 0xB5, 0xB6, 0xB7, 0xB8, 0xB9] {
            interpret(&[image, 0xC1, 0xC2, 0xC6, 0xC3], &mut node, &images).unwrap();
            forged += 1;
        }
        assert_eq!((node.counts().run, node.counts().stored, forged), (0, 0, 8));
    }

    #[test]
    fn a_judge_that_is_told_of_another_key_sees_what_is_wrong() {
        let (key, mut statics) = (key(), Statics::new());
        let images = images(&key);
        let mut node = HostileNode::new(&mut statics, Some(&key)).unwrap();
        node.key = Key::new(key.to_bytes().map(|byte| byte ^ 1)).ok();
        interpret(&write(0x2212, 7, 60_000), &mut node, &images).unwrap();
        let violation = interpret(&[0xB3, 0xC1, 0xC2], &mut node, &images).unwrap_err();
        assert!(violation.to_string().contains("no tag"), "{violation}");
    }

    #[test]
    fn half_a_million_frames_of_a_hostile_bus_do_nothing_that_the_protocol_does_not_allow() {
        let key = key();
        for (seed, key_present) in [(1, true), (2, false)] {
            let (mut noise, mut statics) = (Noise::new(seed, &key), Statics::new());
            let mut node = HostileNode::new(&mut statics, key_present.then_some(&key)).unwrap();
            for number in 0..250_000 {
                noise
                    .attack(&mut node)
                    .unwrap_or_else(|violation| panic!("frame {number} of seed {seed}: {violation}"));
            }
            let counts = node.counts();
            assert!(counts.operational > 10_000 && counts.aborts > 1_000, "{counts:?}");
            assert!(counts.run + counts.stored > 0, "no image came in: {counts:?}");
        }
    }
}
