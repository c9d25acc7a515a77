//! An SDO client: expedited and segmented.

use super::*;
use crate::joint::adaptation::{Factors, Learning, Report};

impl Node {
    fn ask(&mut self, request: [u8; 8]) -> Result<[u8; 8], u32> {
        let sent = self.receive(0x600 + u16::from(NODE), &request);
        let answers = sent.iter().filter(|frame| frame.id() == 0x580 + u16::from(NODE)).collect::<Vec<_>>();
        let [answer] = answers[..] else { panic!("{} answers to {request:02x?}", answers.len()) };
        match *answer.eight().unwrap() {
            [0x80, _, _, _, a, b, c, d] => Err(u32::from_le_bytes([a, b, c, d])),
            answer => Ok(answer),
        }
    }

    pub fn upload(&mut self, index: u16, sub_index: u8) -> Result<Vec<u8>, u32> {
        let [low, high] = index.to_le_bytes();
        let answer = self.ask([0x40, low, high, sub_index, 0, 0, 0, 0])?;
        if answer[0] & 2 != 0 {
            return Ok(answer[4..8 - usize::from(answer[0] >> 2 & 3)].to_vec());
        }
        let (mut data, mut toggle) = (Vec::new(), 0);
        loop {
            let answer = self.ask([0x60 | toggle, 0, 0, 0, 0, 0, 0, 0])?;
            data.extend(&answer[1..8 - usize::from(answer[0] >> 1 & 7)]);
            if answer[0] & 1 != 0 {
                return Ok(data);
            }
            toggle ^= 0x10;
        }
    }

    pub fn download(&mut self, index: u16, sub_index: u8, data: &[u8]) -> Result<(), u32> {
        let [low, high] = index.to_le_bytes();
        if (1..=4).contains(&data.len()) {
            let mut request = [0x23 | (4 - data.len() as u8) << 2, low, high, sub_index, 0, 0, 0, 0];
            request[4..4 + data.len()].copy_from_slice(data);
            return self.ask(request).map(|_| ());
        }
        let [a, b, c, d] = (data.len() as u32).to_le_bytes();
        self.ask([0x21, low, high, sub_index, a, b, c, d])?;
        let segments = data.chunks(7).collect::<Vec<_>>();
        for (number, segment) in segments.iter().enumerate() {
            let last = u8::from(number + 1 == segments.len());
            let mut request = [0; 8];
            request[0] = (number as u8 & 1) << 4 | (7 - segment.len() as u8) << 1 | last;
            request[1..=segment.len()].copy_from_slice(segment);
            self.ask(request)?;
        }
        Ok(())
    }

    /// A value of up to eight bytes, not sign-extended.
    pub fn number(&mut self, index: u16, sub_index: u8) -> u64 {
        let data = self.upload(index, sub_index).unwrap_or_else(|abort| panic!("{index:04x}:{sub_index} {abort:08x}"));
        let mut bytes = [0; 8];
        bytes[..data.len()].copy_from_slice(&data);
        u64::from_le_bytes(bytes)
    }

    pub fn real(&mut self, index: u16, sub_index: u8) -> f32 {
        f32::from_bits(self.number(index, sub_index) as u32)
    }

    pub fn set_real(&mut self, index: u16, sub_index: u8, value: f32) -> Result<(), u32> {
        self.download(index, sub_index, &value.to_le_bytes())
    }
}

#[test]
fn a_wanted_start_says_why_and_reports_nothing() {
    for reset in [LastReset::POWER_UP, LastReset::REQUESTED] {
        let mut node = Node::started(None, false, reset);
        assert_eq!((node.number(0x2301, 1), node.number(0x2301, 2)), (reset.causes.into(), 0));
        assert_eq!((node.number(0x2301, 5), node.upload(0x2301, 6)), (0, Ok(Vec::new())));
        assert_eq!(node.number(0x1003, 0), 0);
    }
}

#[test]
fn what_stopped_the_program_is_read_after_the_reset() {
    let record = Record::new(Cause::Panic, 0, 42).at("src/main.rs");
    let record = record.after(Some(&Record::new(Cause::HardFault, 0x0800_1234, 1)));
    let reset = LastReset { causes: LastReset::SOFTWARE, stop: Some(record) };
    let mut node = Node::started(None, false, reset);
    node.task();
    assert_eq!([1, 2, 3, 4, 5].map(|sub_index| node.number(0x2301, sub_index)), [8, 1, 0, 42, 2]);
    assert_eq!(node.upload(0x2301, 6), Ok(b"src/main.rs".to_vec()));
    assert_eq!(node.number(0x1003, 1) as u16, emergency::STOPPED);
    // It is over.
    assert_eq!(node.number(0x1001, 0), 0);
}

#[test]
fn a_watchdog_s_reset_is_an_emcy() {
    let reset = LastReset { causes: LastReset::WATCHDOG | 2, stop: None };
    let mut node = Node::started(None, false, reset);
    // Behind the boot-up message, and once: not with the next reset of communication.
    assert_eq!(node.task(), [Frame::new(0x85, &[0x10, 0x60, 0, 0x12, 0, 0, 0, 0]).unwrap()]);
    assert_eq!(node.number(0x1003, 1), u64::from(emergency::WATCHDOG) | 0x12 << 16);
    node.receive(0, &[0x82, NODE]);
    assert_eq!(node.task(), []);
    assert_eq!(node.number(0x1003, 0), 1);
    assert_eq!(node.number(0x2301, 1), 0x12);
}

#[test]
fn an_image_that_no_more_fits_is_told_once_and_shown() {
    let mut node = Node::operational();
    let mut tell = |factor: f32, deviation: f32| {
        node.observed.adaptation =
            Report { factors: Factors { factor, viscous: 0.125 }, deviation, learning: Learning::Learns };
        let sent = node.task();
        assert_eq!(node.real(0x2201, 3), factor);
        assert_eq!((node.real(0x2201, 4), node.real(0x2201, 5), node.number(0x2201, 2)), (deviation, 0.125, 0));
        sent.into_iter().filter(|frame| frame.id() == 0x85).collect::<Vec<_>>()
    };
    assert_eq!(tell(0.71, 0.05), [], "within a fifth and two deviations");
    let [low, high] = 690u16.to_le_bytes();
    assert_eq!(tell(0.69, 0.05), [Frame::new(0x85, &[3, 0xFF, 0, low, high, 50, 0, 0]).unwrap()]);
    // Around the limit it is told no more, nor before it may fit again.
    for (factor, deviation) in [(0.71, 0.05), (0.69, 0.05), (0.79, 0.05), (0.5, 0.05)] {
        assert_eq!(tell(factor, deviation), [], "{factor}");
    }
    assert_eq!(tell(0.81, 0.05), []);
    assert_eq!(tell(1.4, 0.05).len(), 1);
}
