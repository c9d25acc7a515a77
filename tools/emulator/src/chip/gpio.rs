//! GPIO: RM0440, chapter 9. Modes, output types, pulls, alternate functions; the lock register is not modelled.
//!
//! A pin that is an input, and which nothing drives or pulls, reads low.

use super::register::{Block, Register, register};
use super::wiring::Pin;
use crate::bus::Refusal;

const MODER: u32 = 0x00;
const OTYPER: u32 = 0x04;
const PUPDR: u32 = 0x0c;
const IDR: u32 = 0x10;
const ODR: u32 = 0x14;
const BSRR: u32 = 0x18;
const AFRL: u32 = 0x20;
const BRR: u32 = 0x28;

const fn table(modes: u32, speeds: u32, pulls: u32) -> [Register; 11] {
    [
        register(MODER, "MODER", modes, u32::MAX, 0),
        register(OTYPER, "OTYPER", 0, 0x0000_ffff, 0),
        register(0x08, "OSPEEDR", speeds, u32::MAX, 0),
        register(PUPDR, "PUPDR", pulls, u32::MAX, 0),
        register(IDR, "IDR", 0, 0, 0),
        register(ODR, "ODR", 0, 0x0000_ffff, 0),
        register(BSRR, "BSRR", 0, 0, 0),
        register(0x1c, "LCKR", 0, 0, u32::MAX),
        register(AFRL, "AFRL", 0, u32::MAX, 0),
        register(0x24, "AFRH", 0, u32::MAX, 0),
        register(BRR, "BRR", 0, 0, 0),
    ]
}

// Ports A and B begin with the debugger's pins (9.4.1 to 9.4.4).
static PORT_A: [Register; 11] = table(0xabff_ffff, 0x0c00_0000, 0x6400_0000);
static PORT_B: [Register; 11] = table(0xffff_febf, 0x0000_00c0, 0x0000_0100);
static OTHERS: [Register; 11] = table(u32::MAX, 0, 0);

/// Ports that the chips have, A to G.
pub const PORTS: u8 = 7;
const NAMES: [&str; PORTS as usize] = ["GPIOA", "GPIOB", "GPIOC", "GPIOD", "GPIOE", "GPIOF", "GPIOG"];

/// Returns `true` if a register decides which peripheral a pin belongs to.
pub const fn changes_functions(offset: u32) -> bool {
    matches!(offset, MODER | AFRL | 0x24)
}

/// Mode of a pin (MODER).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Read by the program.
    Input,
    /// Set by the program.
    Output,
    /// A peripheral's.
    Alternate(u8),
    /// Neither: after reset, and for converters.
    Analog,
}

/// General-purpose outputs that a port drives, and their levels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Driven {
    /// Bits of the pins that are driven.
    pub pins: u32,
    /// Their levels.
    pub levels: u32,
}

/// The ports.
#[derive(Clone, Debug)]
pub struct Gpio {
    ports: Vec<Block>,
}

impl Gpio {
    /// State after reset.
    pub fn new() -> Self {
        let block = |(port, name): (usize, &'static str)| {
            let table: &'static [Register] = match port {
                0 => &PORT_A,
                1 => &PORT_B,
                _ => &OTHERS,
            };
            Block::new(name, "9.4", table)
        };
        Self { ports: NAMES.into_iter().enumerate().map(block).collect() }
    }

    /// A port back to reset.
    pub fn reset(&mut self, port: u8) {
        self.ports[usize::from(port)].reset();
    }

    /// Mode of a pin.
    pub fn mode(&self, pin: Pin) -> Mode {
        let port = &self.ports[usize::from(pin.port)];
        match port.get(MODER) >> (2 * pin.number) & 3 {
            0 => Mode::Input,
            1 => Mode::Output,
            2 => {
                let functions = port.get(AFRL + 4 * u32::from(pin.number / 8));
                Mode::Alternate((functions >> (4 * (pin.number % 8)) & 0xf) as u8)
            }
            _ => Mode::Analog,
        }
    }

    /// Levels that a port's general-purpose outputs drive: open drains drive low only (9.3.10).
    pub fn driven(&self, port: u8) -> Driven {
        let block = &self.ports[usize::from(port)];
        let (modes, levels) = (block.get(MODER), block.get(ODR));
        let outputs = (0..16).filter(|pin| modes >> (2 * pin) & 3 == 1).fold(0, |pins, pin| pins | 1 << pin);
        let pins = outputs & !(block.get(OTYPER) & levels);
        Driven { pins, levels: levels & pins }
    }

    /// Levels of a port's pins; `outside` tells what the board drives.
    fn levels(&self, port: u8, mut outside: impl FnMut(Pin) -> Option<bool>) -> u32 {
        let driven = self.driven(port);
        let pulls = self.ports[usize::from(port)].get(PUPDR);
        let mut level = |number: u8| {
            let pin = Pin { port, number };
            if driven.pins >> number & 1 != 0 {
                return driven.levels >> number & 1 != 0;
            }
            // An analog pin's input is off and reads low (9.3.12).
            self.mode(pin) != Mode::Analog && outside(pin).unwrap_or(pulls >> (2 * number) & 3 == 1)
        };
        (0..16).map(|number| u32::from(level(number)) << number).sum()
    }

    /// A load by the core.
    pub fn read(&self, port: u8, offset: u32, outside: impl FnMut(Pin) -> Option<bool>) -> Result<u32, Refusal> {
        match offset {
            IDR => Ok(self.levels(port, outside)),
            _ => self.ports[usize::from(port)].read(offset),
        }
    }

    /// A store by the core.
    pub fn write(&mut self, port: u8, offset: u32, value: u32) -> Result<(), Refusal> {
        let block = &mut self.ports[usize::from(port)];
        match offset {
            // If both are asked for, setting wins (9.4.7).
            BSRR => block.set(ODR, block.get(ODR) & !(value >> 16) | value & 0xffff),
            BRR => block.set(ODR, block.get(ODR) & !(value & 0xffff)),
            _ => {
                block.write(offset, value)?;
            }
        }
        Ok(())
    }
}

impl Default for Gpio {
    fn default() -> Self {
        Self::new()
    }
}
