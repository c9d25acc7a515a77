//! Frames of a hostile bus from a seed: random ones, ones that might mean something, and whole transfers with faults in
//! them.

use super::script::{self, Transfer};
use super::{HostileNode, Violation};
use bus::Frame;
use friction_compensation::parameters::authentication::Key;
use joint_firmware::objects::table::{COMMUNICATION, OBJECTS};
use std::collections::VecDeque;

/// xorshift64*, so that a run can be repeated.
#[derive(Clone, Debug)]
pub struct Noise {
    state: u64,
    images: Vec<Vec<u8>>,
    /// A transfer that goes on between other frames.
    transfer: VecDeque<[u8; 8]>,
}

impl Noise {
    /// `seed` 0 counts as 1. `key` signs images that the attacker has heard on the bus.
    #[must_use]
    pub fn new(seed: u64, key: &Key) -> Self {
        Self { state: seed.max(1), images: script::images(key), transfer: VecDeque::new() }
    }

    fn next(&mut self) -> u64 {
        self.state ^= self.state >> 12;
        self.state ^= self.state << 25;
        self.state ^= self.state >> 27;
        self.state.wrapping_mul(0x2545_F491_4F6C_DD1D)
    }

    fn below(&mut self, bound: usize) -> usize {
        (self.next() >> 33) as usize % bound.max(1)
    }

    fn choose<T: Copy>(&mut self, from: &[T]) -> T {
        from[self.below(from.len())]
    }

    /// One frame, and what the node does about it.
    ///
    /// # Errors
    /// Violations of the protocol.
    pub fn attack(&mut self, node: &mut HostileNode) -> Result<(), Violation> {
        let frame = self.frame(node.id());
        node.receive(&frame)?;
        match self.below(4_096) {
            0 => {
                let armed = self.below(2) == 0;
                let value = f32::from_bits(self.next() as u32);
                node.observe(armed, value);
            }
            1 => node.wait(self.next() as u32),
            2..64 => {
                let time = self.below(600_000) as u32;
                node.wait(time);
            }
            _ => {
                let time = self.below(300) as u32;
                node.wait(time);
            }
        }
        // Sometimes the task is late.
        if self.below(4) != 0 { node.work() } else { Ok(()) }
    }

    fn frame(&mut self, node: u8) -> Frame {
        let id = u16::from(node & 0x7F);
        // A transfer goes on, with some of everything between: most of them come to their end.
        let kind = match (self.transfer.is_empty(), self.below(128)) {
            (false, 2) => 14,
            (false, 3) => 21,
            (false, 4..32) => 22 + self.below(10),
            (false, _) => 0,
            (true, _) => self.below(32),
        };
        let (id, data) = match kind {
            0..=13 => return self.transferred(id),
            14..=20 => (0x600 + id, self.request()),
            21 => {
                let command = self.choose(&[1, 1, 1, 1, 1, 1, 1, 1, 1, 2, 0x80, 0x81, 0x82, 0x55]);
                let [_, second, rest @ ..] = self.next().to_le_bytes();
                let whom = self.choose(&[0, node, node, 9, second]);
                let mut data = [command, whom, 0, 0, 0, 0, 0, 0];
                data[2..].copy_from_slice(&rest);
                (0, data)
            }
            22 => (0x80, self.next().to_le_bytes()),
            23..=26 => (0x200 + 0x100 * self.below(4) as u16 + id, self.next().to_le_bytes()),
            27 => {
                let mut data = self.next().to_le_bytes();
                data[0] = self.choose(&[0x04, 0x11, 0x13, 0x17, 0x51, 0x40, 0x46, 0x5E, 0x4C, 0x5A]);
                (0x7E5, data)
            }
            28 => (0x701 + self.below(127) as u16, self.next().to_le_bytes()),
            _ => (self.below(0x800) as u16, self.next().to_le_bytes()),
        };
        let length = if self.below(8) == 0 { self.below(9) } else { 8 };
        cut(id, &data[..length])
    }

    /// An SDO request that begins, continues or ends something at random.
    fn request(&mut self) -> [u8; 8] {
        const COMMANDS: [u8; 31] = [
            0x20, 0x21, 0x22, 0x23, 0x27, 0x2B, 0x2F, 0x40, 0x60, 0x70, 0x00, 0x10, 0x01, 0x11, 0x80, 0xA0, 0xA4, 0xA1,
            0xA2, 0xA3, 0xC0, 0xC2, 0xC4, 0xC6, 0xC1, 0xC5, 0xDD, 0x02, 0x03, 0x81, 0x82,
        ];
        let mut data = self.next().to_le_bytes();
        if self.below(8) != 0 {
            data[0] = self.choose(&COMMANDS);
        }
        if self.below(8) != 0 {
            let (index, sub_index) = self.object();
            [data[1], data[2]] = index.to_le_bytes();
            data[3] = sub_index;
        }
        if self.below(2) == 0 {
            // Small numbers mean more.
            data[4] &= 7;
            data[5..].fill(0);
        }
        data
    }

    fn object(&mut self) -> (u16, u8) {
        let table = if self.below(3) == 0 { &COMMUNICATION[..] } else { &OBJECTS[..] };
        let object = &table[self.below(table.len())];
        (object.index, object.sub_index)
    }

    /// The next frame of a transfer, at times with a fault.
    fn transferred(&mut self, id: u16) -> Frame {
        if self.transfer.is_empty() {
            let transfer = self.begin();
            self.transfer.extend(transfer);
        }
        let mut data = self.transfer.pop_front().unwrap_or_default();
        match self.below(400) {
            0 => {
                let bit = self.below(64);
                data[bit / 8] ^= 1 << (bit % 8);
            }
            1 => self.transfer.push_front(data),
            2 => {
                self.transfer.pop_front();
            }
            3 => self.transfer.clear(),
            _ => {}
        }
        cut(0x600 + id, &data)
    }

    fn begin(&mut self) -> Vec<[u8; 8]> {
        let way = self.choose(&[Transfer::Segmented, Transfer::Block]);
        match self.below(8) {
            0 | 1 => {
                let number = self.below(self.images.len());
                let mut image = self.images[number].clone();
                if self.below(2) == 0 {
                    let bit = self.below(image.len() * 8);
                    image[bit / 8] ^= 1 << (bit % 8);
                    script::seal(&mut image);
                }
                let mut messages = script::download(way, 0x2210, 0, &image);
                // Verified, and run or stored.
                for command in [1, self.choose(&[2, 3, 6])] {
                    messages.extend(script::download(way, 0x2212, 1, &[command]));
                }
                messages
            }
            2..=4 => {
                let command = 1 + self.below(6) as u8;
                script::download(Transfer::Segmented, 0x2212, 1, &[command])
            }
            5 => {
                let bytes: Vec<u8> = (0..self.below(80)).map(|_| self.next() as u8).collect();
                let object = self.choose(&[(0x2210, 0), (0x2215, 6), (0x2215, 7), (0x2215, 5), (0x2211, 0)]);
                script::download(way, object.0, object.1, &bytes)
            }
            6 => {
                let object = self.choose(&[0x2211, 0x2210, 0x2300, 0x1008]);
                script::upload(way, object, 0)
            }
            _ => {
                let objects: [(u16, u8, &[u8]); 6] = [
                    (0x1010, 1, b"save"),
                    (0x1010, 3, b"save"),
                    (0x1011, 1, b"load"),
                    (0x2100, 1, &[1]),
                    (0x2212, 7, &[0, 2, 0, 0]),
                    (0x2212, 7, &[1, 0, 0, 0]),
                ];
                let (index, sub_index, value) = self.choose(&objects);
                script::download(way, index, sub_index, value)
            }
        }
    }
}

/// A frame whose identifier and length are in range by construction.
fn cut(id: u16, data: &[u8]) -> Frame {
    Frame::new(id & 0x7FF, data).unwrap_or_else(|| unreachable!("at most eight bytes"))
}
