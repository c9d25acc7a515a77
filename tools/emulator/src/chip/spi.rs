//! SPI as a master: RM0440, chapter 39. Frames of 8 and 16 bits, both FIFOs, the busy flag, overrun.
//!
//! The slave is selected by a general-purpose output, so slave management is by software. Not modelled, and refused:
//! slave mode, DMA, CRC, one data line, other sizes, the least significant bit first, I2S. A frame arrives when its
//! last bit ends; both lines have no delay.

use super::register::{Block, Register, register};
use super::variant::SpiDescription;
use super::wiring::SpiFrame;
use crate::bus::{Refusal, Width};
use std::collections::VecDeque;

const CR1: u32 = 0x00;
const CR2: u32 = 0x04;
const SR: u32 = 0x08;
const DR: u32 = 0x0c;

const MSTR: u32 = 1 << 2;
const SPE: u32 = 1 << 6;
const SOFTWARE_SELECT: u32 = 3 << 8;

const RXNE: u32 = 1 << 0;
const TXE: u32 = 1 << 1;
const MODF: u32 = 1 << 5;
const OVR: u32 = 1 << 6;
const BSY: u32 = 1 << 7;

const REGISTERS: &[Register] = &[
    register(CR1, "CR1", 0, 0x0000_037f, 0x0000_fc80),
    register(CR2, "CR2", 0x0000_0700, 0x0000_1ffc, 0x0000_6013),
    register(SR, "SR", 0, 0, 0),
    register(DR, "DR", 0, 0, 0),
];

/// Bytes in each FIFO (39.4.9).
const FIFO: usize = 4;

/// A frame under way.
#[derive(Clone, Copy, Debug)]
struct Frame {
    sent: u16,
    began: u64,
    ends: u64,
}

/// An SPI peripheral.
#[derive(Clone, Debug)]
pub struct Spi {
    description: &'static SpiDescription,
    block: Block,
    transmit: VecDeque<u8>,
    receive: VecDeque<u8>,
    frame: Option<Frame>,
    flags: u32,
    /// DR was read after an overrun: the next read of SR clears it (39.4.11).
    clears_overrun: bool,
}

impl Spi {
    /// State after reset.
    pub fn new(description: &'static SpiDescription) -> Self {
        Self {
            description,
            block: Block::new(description.text, "39.6", REGISTERS),
            transmit: VecDeque::with_capacity(FIFO),
            receive: VecDeque::with_capacity(FIFO),
            frame: None,
            flags: 0,
            clears_overrun: false,
        }
    }

    /// Back to reset.
    pub fn reset(&mut self) {
        *self = Self::new(self.description);
    }

    /// Its description.
    pub const fn description(&self) -> &'static SpiDescription {
        self.description
    }

    /// Cycle at which a frame ends.
    #[inline]
    pub fn next(&self) -> u64 {
        self.frame.map_or(u64::MAX, |frame| frame.ends)
    }

    /// Bytes of a frame: CR2.DS.
    fn bytes(&self) -> usize {
        if self.block.get(CR2) >> 8 & 0xf == 0xf { 2 } else { 1 }
    }

    /// A frame that ends at a cycle: what it was, and the cycle at which it began. The slave's answer goes to
    /// [`answer`](Self::answer).
    pub fn ended(&mut self, cycle: u64, clock: u64) -> Option<(SpiFrame, u64)> {
        let frame = self.frame.filter(|frame| frame.ends <= cycle)?;
        self.frame = None;
        let control = self.block.get(CR1);
        let described = SpiFrame {
            bus: self.description.number,
            mode: (control & 3) as u8,
            bits: 8 * self.bytes() as u8,
            sent: frame.sent,
            frequency: clock >> ((control >> 3 & 7) + 1),
            began: super::time::Instant(0),
        };
        Some((described, frame.began))
    }

    /// Takes what came back; the next frame begins where one waits.
    pub fn answer(&mut self, received: u16, cycle: u64) {
        if self.receive.len() + self.bytes() > FIFO {
            self.flags |= OVR;
        } else {
            // The FIFO keeps a 16-bit frame as it is read: the low byte first.
            self.receive.extend(&received.to_le_bytes()[..self.bytes()]);
        }
        self.start(cycle);
    }

    /// Begins a frame where one waits and none is under way.
    fn start(&mut self, cycle: u64) {
        let bytes = self.bytes();
        if self.frame.is_some() || self.block.get(CR1) & SPE == 0 || self.transmit.len() < bytes {
            return;
        }
        let low = self.transmit.pop_front().unwrap_or(0);
        let high = if bytes == 2 { self.transmit.pop_front().unwrap_or(0) } else { 0 };
        let clock = 2 << (self.block.get(CR1) >> 3 & 7);
        let ends = cycle + 8 * bytes as u64 * clock;
        self.frame = Some(Frame { sent: u16::from_le_bytes([low, high]), began: cycle, ends });
    }

    fn status(&self) -> u32 {
        // CR2.FRXTH: a byte is enough, or two are wanted.
        let wanted = if self.block.get(CR2) >> 12 & 1 != 0 { 1 } else { 2 };
        let level = |bytes: usize| bytes.min(3) as u32;
        let mut status = self.flags | level(self.receive.len()) << 9 | level(self.transmit.len()) << 11;
        status |= if self.receive.len() >= wanted { RXNE } else { 0 };
        status |= if self.transmit.len() <= FIFO / 2 { TXE } else { 0 };
        status
            | if self.frame.is_some() || !self.transmit.is_empty() && self.block.get(CR1) & SPE != 0 { BSY } else { 0 }
    }

    /// Level of the interrupt: CR2.ERRIE, RXNEIE and TXEIE.
    #[inline]
    pub fn interrupts(&self) -> bool {
        let (status, enabled) = (self.status(), self.block.get(CR2));
        status & TXE != 0 && enabled >> 7 & 1 != 0
            || status & RXNE != 0 && enabled >> 6 & 1 != 0
            || status & (OVR | MODF) != 0 && enabled >> 5 & 1 != 0
    }

    /// A load by the core. DR gives as many bytes as are asked for (39.4.9, "Data packing").
    pub fn read(&mut self, offset: u32, width: Width) -> Result<u32, Refusal> {
        match offset {
            DR if width == Width::Word => Err(self.block.refuse(DR, "an access of a word")),
            DR => {
                let low = self.receive.pop_front().unwrap_or(0);
                let high = if width == Width::Half { self.receive.pop_front().unwrap_or(0) } else { 0 };
                self.clears_overrun = self.flags & OVR != 0;
                Ok(u32::from(u16::from_le_bytes([low, high])))
            }
            SR => {
                let status = self.status();
                if std::mem::take(&mut self.clears_overrun) {
                    self.flags &= !OVR;
                }
                Ok(status)
            }
            _ => self.block.read(offset),
        }
    }

    /// A store by the core.
    pub fn write(&mut self, offset: u32, width: Width, value: u32, cycle: u64) -> Result<(), Refusal> {
        match offset {
            DR => {
                if width == Width::Word || self.bytes() == 2 && width == Width::Byte {
                    return Err(self.block.refuse(DR, "an access of this width"));
                }
                let bytes = width.bytes() as usize;
                if self.transmit.len() + bytes > FIFO {
                    return Err(self.block.forbid(DR, "a write to a full FIFO"));
                }
                self.transmit.extend(&value.to_le_bytes()[..bytes]);
                self.start(cycle);
            }
            _ if width != Width::Word => return Err(self.block.refuse(offset, "an access of less than a word")),
            _ => {
                let under_way = self.frame.is_some();
                let before = self.block.write(offset, value)?;
                if under_way && before != self.block.get(offset) && offset == CR1 {
                    return Err(self.block.forbid(CR1, "it is changed while a frame is under way"));
                }
                match offset {
                    CR1 => self.control(cycle)?,
                    CR2 if !matches!(self.block.get(CR2) >> 8 & 0xf, 0x7 | 0xf) => {
                        return Err(self.block.refuse(CR2, "a size other than 8 and 16 bits"));
                    }
                    _ => {}
                }
            }
        }
        Ok(())
    }

    /// SPE with slave management in hardware would need the pin NSS; with it in software, SSI low is a mode fault
    /// (39.4.10).
    fn control(&mut self, cycle: u64) -> Result<(), Refusal> {
        let control = self.block.get(CR1);
        if control & SPE == 0 {
            // Disabling empties what was not sent.
            self.transmit.clear();
            return Ok(());
        }
        if control & MSTR == 0 || control & SOFTWARE_SELECT != SOFTWARE_SELECT {
            return Err(self.block.refuse(CR1, "slave mode, or slave management in hardware"));
        }
        self.start(cycle);
        Ok(())
    }
}
