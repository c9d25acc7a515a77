//! An SDO client, by CiA 301 from the other side.

use super::*;

pub type Answer<T> = Result<T, u32>;

fn request(command: u8, index: u16, sub_index: u8, data: [u8; 4]) -> [u8; 8] {
    let [low, high] = index.to_le_bytes();
    let [a, b, c, d] = data;
    [command, low, high, sub_index, a, b, c, d]
}

/// The single answer to a request; an abort is an error.
fn ask(node: &mut Node, message: [u8; 8]) -> Answer<[u8; 8]> {
    let answers = node.sdo(message);
    let [answer] = answers[..] else { panic!("{} answers to {message:02x?}", answers.len()) };
    refused(answer)
}

fn refused(answer: [u8; 8]) -> Answer<[u8; 8]> {
    match answer {
        [0x80, _, _, _, a, b, c, d] => Err(u32::from_le_bytes([a, b, c, d])),
        _ => Ok(answer),
    }
}

/// Expedited up to four bytes, segmented above, size indicated.
pub fn download(node: &mut Node, index: u16, sub_index: u8, data: &[u8]) -> Answer<()> {
    if !(1..=4).contains(&data.len()) {
        return segmented_download(node, index, sub_index, data, true);
    }
    let mut bytes = [0; 4];
    bytes[..data.len()].copy_from_slice(data);
    let answer = ask(node, request(0x23 | (4 - data.len() as u8) << 2, index, sub_index, bytes))?;
    assert_eq!(answer, request(0x60, index, sub_index, [0; 4]));
    Ok(())
}

pub fn segmented_download(node: &mut Node, index: u16, sub_index: u8, data: &[u8], size: bool) -> Answer<()> {
    let length = if size { data.len() as u32 } else { 0 };
    let answer = ask(node, request(0x20 | u8::from(size), index, sub_index, length.to_le_bytes()))?;
    assert_eq!(answer, request(0x60, index, sub_index, [0; 4]));
    let segments = data.chunks(7).collect::<Vec<_>>();
    let segments = if segments.is_empty() { vec![&[][..]] } else { segments };
    for (number, segment) in segments.iter().enumerate() {
        let toggle = (number as u8 & 1) << 4;
        let mut message = [0xEE; 8];
        message[0] = toggle | (7 - segment.len() as u8) << 1 | u8::from(number + 1 == segments.len());
        message[1..=segment.len()].copy_from_slice(segment);
        assert_eq!(ask(node, message)?, [0x20 | toggle, 0, 0, 0, 0, 0, 0, 0]);
    }
    Ok(())
}

/// Expedited or segmented, as the server chooses.
pub fn upload(node: &mut Node, index: u16, sub_index: u8) -> Answer<Vec<u8>> {
    let answer = ask(node, request(0x40, index, sub_index, [0; 4]))?;
    finish_upload(node, index, sub_index, answer)
}

fn finish_upload(node: &mut Node, index: u16, sub_index: u8, answer: [u8; 8]) -> Answer<Vec<u8>> {
    assert_eq!(answer[1..4], request(0, index, sub_index, [0; 4])[1..4]);
    if answer[0] & 2 != 0 {
        assert_eq!(answer[0] & 0xF3, 0x43);
        return Ok(answer[4..8 - usize::from(answer[0] >> 2 & 3)].to_vec());
    }
    assert_eq!(answer[0], 0x41);
    let length = u32::from_le_bytes(answer[4..].try_into().unwrap());
    let (mut data, mut toggle) = (Vec::new(), 0);
    loop {
        let answer = ask(node, [0x60 | toggle, 0, 0, 0, 0, 0, 0, 0])?;
        assert_eq!(answer[0] & 0xF0, toggle);
        data.extend(&answer[1..8 - usize::from(answer[0] >> 1 & 7)]);
        if answer[0] & 1 != 0 {
            assert_eq!(data.len() as u32, length);
            return Ok(data);
        }
        toggle ^= 0x10;
    }
}

/// CRC as a client knows it.
pub fn crc(data: &[u8]) -> u16 {
    data.iter().fold(0, |crc, byte| {
        (0..8).fold(crc ^ u16::from(*byte) << 8, |crc, _| crc << 1 ^ if crc & 0x8000 != 0 { 0x1021 } else { 0 })
    })
}

/// Outcome of a block download that a disturbed bus carried.
#[derive(Debug, PartialEq, Eq)]
pub enum Outcome {
    Done,
    Aborted(u32),
    /// No answer came; the client waits.
    Silence,
}

pub struct BlockDownload<'a> {
    pub data: &'a [u8],
    pub crc: bool,
    pub size: bool,
}

impl BlockDownload<'_> {
    /// `disturb` does to the segments of each block what the bus does to them.
    pub fn run(&self, node: &mut Node, mut disturb: impl FnMut(&mut Vec<[u8; 8]>)) -> Outcome {
        let data = self.data;
        let command = 0xC0 | u8::from(self.size) << 1 | u8::from(self.crc) << 2;
        let length = if self.size { data.len() as u32 } else { 0 };
        let mut block_size = match ask(node, request(command, 0x2010, 0, length.to_le_bytes())) {
            Ok(answer) => {
                assert_eq!(answer[0], 0xA4);
                answer[4]
            }
            Err(abort) => return Outcome::Aborted(abort),
        };
        let chunks = data.chunks(7).collect::<Vec<_>>();
        let chunks = if chunks.is_empty() { vec![&[][..]] } else { chunks };
        let mut done = 0;
        let mut fruitless = 0;
        while done < chunks.len() {
            let block = &chunks[done..chunks.len().min(done + usize::from(block_size))];
            let mut segments = Vec::new();
            for (number, chunk) in block.iter().enumerate() {
                let mut segment = [0; 8];
                let last = done + number + 1 == chunks.len();
                segment[0] = (number as u8 + 1) | if last { 0x80 } else { 0 };
                segment[1..=chunk.len()].copy_from_slice(chunk);
                segments.push(segment);
            }
            disturb(&mut segments);
            let mut answers = Vec::new();
            for segment in &segments {
                answers.extend(node.sdo(*segment));
            }
            // Of several answers the client takes the first, as it waits for one.
            let Some(answer) = answers.first() else { return Outcome::Silence };
            match refused(*answer) {
                Err(abort) => return Outcome::Aborted(abort),
                Ok([0xA2, acknowledged, size, ..]) => {
                    assert!(usize::from(acknowledged) <= block.len());
                    done += usize::from(acknowledged);
                    block_size = size;
                    fruitless = if acknowledged == 0 { fruitless + 1 } else { 0 };
                    assert!(fruitless < 100, "nothing arrives");
                }
                Ok(other) => panic!("{other:02x?}"),
            }
        }
        let unused = 7 - chunks.last().unwrap().len() as u8;
        let [low, high] = if self.crc { crc(data) } else { 0 }.to_le_bytes();
        match ask(node, [0xC1 | unused << 2, low, high, 0, 0, 0, 0, 0]) {
            Ok(answer) => {
                assert_eq!(answer, [0xA1, 0, 0, 0, 0, 0, 0, 0]);
                Outcome::Done
            }
            Err(abort) => Outcome::Aborted(abort),
        }
    }
}

pub struct BlockUpload {
    pub index: u16,
    pub sub_index: u8,
    pub crc: bool,
    pub block_size: u8,
    /// Bytes up to which the plain protocol will do.
    pub threshold: u8,
}

impl BlockUpload {
    /// `hear` does to the segments of each block what the bus does to them; the client acknowledges what came in order.
    pub fn run(&self, node: &mut Node, mut hear: impl FnMut(&mut Vec<[u8; 8]>)) -> Answer<Vec<u8>> {
        let command = 0xA0 | u8::from(self.crc) << 2;
        let answer = ask(node, request(command, self.index, self.sub_index, [self.block_size, self.threshold, 0, 0]))?;
        if answer[0] >> 5 == 2 {
            return finish_upload(node, self.index, self.sub_index, answer);
        }
        assert_eq!(answer[0], 0xC2 | u8::from(self.crc) << 2);
        let length = u32::from_le_bytes(answer[4..].try_into().unwrap());
        let mut data = Vec::new();
        let mut segments = node.sdo([0xA3, 0, 0, 0, 0, 0, 0, 0]);
        loop {
            if let [answer] = segments[..]
                && answer[0] == 0x80
            {
                return refused(answer).map(|_| unreachable!());
            }
            assert!(segments.len() <= usize::from(self.block_size));
            hear(&mut segments);
            let (mut acknowledged, mut last) = (0, false);
            for segment in &segments {
                if segment[0] & 0x7F == acknowledged + 1 {
                    acknowledged += 1;
                    last = segment[0] & 0x80 != 0;
                    data.extend(&segment[1..]);
                }
            }
            segments = node.sdo([0xA2, acknowledged, self.block_size, 0, 0, 0, 0, 0]);
            if last {
                break;
            }
        }
        let [[command, low, high, ..]] = segments[..] else { panic!("{} answers to the end", segments.len()) };
        assert_eq!(command & 0xE3, 0xC1);
        data.truncate(data.len() - usize::from(command >> 2 & 7));
        assert_eq!(data.len() as u32, length);
        assert_eq!(u16::from_le_bytes([low, high]), if self.crc { crc(&data) } else { 0 });
        assert_eq!(node.sdo([0xA1, 0, 0, 0, 0, 0, 0, 0]), [[0; 8]; 0]);
        Ok(data)
    }
}
