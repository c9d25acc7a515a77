//! DRV8353S, a gate driver for three half bridges: its registers, its enable, its supply and its fault output.
//!
//! Source: TI SLVSDY6, "SPI" and "Register maps": frames of 16 bits, mode 1: bit 15 reads, bits 14 to 11 are the
//! register, bits 10 to 0 the data; the register's content comes back in the same frame. From memory of that document,
//! unconfirmed: values after reset (the firmware writes every register), both voltages of the supply, and that the
//! registers are lost at the lower one.
//!
//! Faults are latched: they stay, and keep the outputs off, until they are cleared or the enable was low. One whose
//! cause is still [present](Drv8353::set_present) comes back at once.

use crate::chip::time::Instant;
use crate::chip::wiring::SpiFrame;

/// Time from the enable, or the supply, to the first frame, ns.
pub const WAKE_NS: u64 = 1_000_000;
/// Supply below which the outputs are off, V (VM under-voltage lock-out).
pub const LOCK_OUT: f64 = 8.0;
/// Supply below which everything is lost, V.
pub const LOST: f64 = 5.0;

const REGISTERS: usize = 8;
const RESET: [u16; REGISTERS] = [0, 0, 0x000, 0x3ff, 0x7ff, 0x159, 0x283, 0x000];
const DATA: u16 = 0x7ff;

/// Driver control: clear faults, coast.
const CLEAR: u16 = 1 << 0;
const COAST: u16 = 1 << 2;
/// High-side gates: the lock.
const LOCK: u16 = 0b111 << 8;
const LOCKED: u16 = 0b110 << 8;
/// Fault status 1: any fault.
const FAULT: u16 = 1 << 10;

/// Faults to inject, as both status words name them.
pub mod fault {
    /// Over-current of the low-side transistor of phase B, by its voltage.
    pub const OVER_CURRENT: [u16; 2] = [1 << 9 | 1 << 2, 0];
    /// Supply below the lock-out.
    pub const UNDER_VOLTAGE: [u16; 2] = [1 << 7, 0];
    /// The driver is too hot.
    pub const OVER_TEMPERATURE: [u16; 2] = [1 << 6, 0];
    /// The gate of the high-side transistor of phase C does not follow.
    pub const GATE_DRIVE: [u16; 2] = [1 << 8, 1 << 1];
}

/// The driver.
#[derive(Clone, Debug)]
pub struct Drv8353 {
    registers: [u16; REGISTERS],
    selected: bool,
    /// Level of its enable.
    enabled: bool,
    /// Instant since which it has both enable and supply; none while it sleeps.
    awake: Option<Instant>,
    supplied: bool,
    /// Causes of faults that are still there.
    present: [u16; 2],
    /// Its data line is broken.
    silent: bool,
    clears: u32,
}

impl Drv8353 {
    /// Asleep, with a supply.
    pub const fn new() -> Self {
        Self {
            registers: RESET,
            selected: false,
            enabled: false,
            awake: None,
            supplied: true,
            present: [0; 2],
            silent: false,
            clears: 0,
        }
    }

    /// The enable pin. Without it the registers are lost.
    pub fn enable(&mut self, at: Instant, enabled: bool) {
        self.enabled = enabled;
        self.wake(at);
    }

    /// Its supply, V.
    pub fn supply(&mut self, at: Instant, volts: f64) {
        if self.supplied != (volts >= LOST) {
            self.supplied = volts >= LOST;
            self.wake(at);
        }
        if volts < LOCK_OUT && self.is_awake(at) {
            self.fail(fault::UNDER_VOLTAGE);
        }
    }

    fn wake(&mut self, at: Instant) {
        match (self.enabled && self.supplied, self.awake) {
            (true, None) => self.awake = Some(at),
            (false, Some(_)) => (self.awake, self.registers) = (None, RESET),
            _ => {}
        }
    }

    /// Returns `true` if it has woken up.
    pub fn is_awake(&self, at: Instant) -> bool {
        self.awake.is_some_and(|since| at >= since.after_ns(WAKE_NS))
    }

    /// The select line, low or not.
    pub fn select(&mut self, selected: bool) {
        self.selected = selected;
    }

    /// A register's content.
    pub fn register(&self, number: usize) -> Option<u16> {
        self.registers.get(number).copied()
    }

    /// Number of times that faults were cleared by a frame.
    pub const fn clears(&self) -> u32 {
        self.clears
    }

    /// Forgets what was written, as a disturbance may: without a fault.
    pub fn forget(&mut self) {
        self.registers = RESET;
    }

    /// Its data line breaks, or is whole again: nobody drives it then.
    pub fn set_silent(&mut self, silent: bool) {
        self.silent = silent;
    }

    /// Returns `true` if its outputs follow its inputs: awake, no fault, not told to coast.
    pub fn drives(&self, at: Instant) -> bool {
        self.is_awake(at) && !self.has_fault() && self.registers[2] & COAST == 0
    }

    /// Dead time between the switches of a half bridge, s: bits 9 and 8 of the over-current control.
    pub fn dead_time(&self) -> f64 {
        [50e-9, 100e-9, 200e-9, 400e-9][usize::from(self.registers[5] >> 8 & 0b11)]
    }

    /// Takes that something went wrong in the bridge, and is over: bits of both fault status words. They stay until
    /// they are cleared, and pull nFAULT low.
    pub fn fail(&mut self, status: [u16; 2]) {
        if status != [0; 2] {
            self.registers[0] |= status[0] & DATA | FAULT;
            self.registers[1] |= status[1] & DATA;
        }
    }

    /// Takes that something is wrong from now on: clearing it has no effect until this is called with zeros.
    pub fn set_present(&mut self, status: [u16; 2]) {
        self.present = status;
        self.fail(status);
    }

    /// Returns `true` if nFAULT is pulled low.
    pub const fn has_fault(&self) -> bool {
        self.registers[0] & FAULT != 0
    }

    /// A frame that ended. None where it is asleep, silent or not selected: it leaves the line alone.
    pub fn exchange(&mut self, at: Instant, frame: &SpiFrame) -> Option<u16> {
        if !self.selected || self.silent || !self.is_awake(at) {
            return None;
        }
        self.fail(self.present);
        let number = usize::from(frame.sent >> 11 & 0xf);
        // A wrong mode or size is no command; what is read then is nothing.
        let valid = frame.bits == 16 && frame.mode == 1;
        let Some(before) = self.registers.get(number).copied().filter(|_| valid) else { return Some(0) };
        if frame.sent >> 15 == 0 {
            self.write(number, frame.sent & DATA);
        }
        Some(before)
    }

    fn write(&mut self, number: usize, data: u16) {
        let locked = self.registers[3] & LOCK == LOCKED;
        match number {
            // Status cannot be written.
            0 | 1 => {}
            2 => {
                // Locked, the control of the outputs alone can be written: bits 0 to 2.
                let writable = if locked { 0b111 } else { DATA };
                self.registers[2] = self.registers[2] & !writable | data & writable & !CLEAR;
                if data & CLEAR != 0 {
                    self.clears += 1;
                    (self.registers[0], self.registers[1]) = (0, 0);
                    self.fail(self.present);
                }
            }
            3 => {
                let lock = data & LOCK;
                // 110b locks, 011b unlocks, anything else leaves the lock as it is.
                let lock = if lock == LOCKED || lock == 0b011 << 8 { lock } else { self.registers[3] & LOCK };
                let rest = if locked { self.registers[3] } else { data } & !LOCK;
                self.registers[3] = lock | rest;
            }
            _ if locked => {}
            _ => self.registers[number] = data,
        }
    }
}

impl Default for Drv8353 {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LATER: Instant = Instant(2_000_000_000);

    fn frame(sent: u16) -> SpiFrame {
        SpiFrame { bus: 1, mode: 1, bits: 16, sent, frequency: 664_062, began: Instant(0) }
    }

    fn awake() -> Drv8353 {
        let mut driver = Drv8353::new();
        driver.enable(Instant(0), true);
        driver.select(true);
        driver
    }

    #[test]
    fn it_wakes_up_a_millisecond_after_its_enable() {
        let mut driver = awake();
        assert_eq!(driver.exchange(Instant(999_999_999), &frame(1 << 15)), None);
        assert_eq!(driver.exchange(Instant(1_000_000_000), &frame(1 << 15)), Some(0));
        driver.select(false);
        assert_eq!(driver.exchange(LATER, &frame(1 << 15)), None);
    }

    #[test]
    fn a_register_reads_what_was_written_and_a_write_answers_what_was_there() {
        let mut driver = awake();
        assert_eq!(driver.exchange(LATER, &frame(6 << 11 | 0x281)), Some(0x283));
        assert_eq!(driver.exchange(LATER, &frame(1 << 15 | 6 << 11)), Some(0x281));
        driver.enable(LATER, false);
        driver.enable(LATER, true);
        assert_eq!(driver.register(6), Some(0x283), "the enable loses it");
    }

    #[test]
    fn a_locked_driver_takes_nothing_but_the_control_of_the_outputs() {
        let mut driver = awake();
        driver.exchange(LATER, &frame(3 << 11 | LOCKED));
        driver.exchange(LATER, &frame(6 << 11));
        assert_eq!(driver.register(6), Some(0x283));
        driver.exchange(LATER, &frame(2 << 11 | 0x7fe));
        assert_eq!(driver.register(2), Some(0b110));
        driver.exchange(LATER, &frame(3 << 11 | 0b011 << 8));
        driver.exchange(LATER, &frame(6 << 11 | 5));
        assert_eq!(driver.register(6), Some(5));
    }

    #[test]
    fn a_fault_switches_off_until_it_is_cleared() {
        let mut driver = awake();
        assert!(driver.drives(LATER));
        driver.fail([1 << 9, 0]);
        assert!(driver.has_fault() && !driver.drives(LATER));
        assert_eq!(driver.exchange(LATER, &frame(1 << 15)), Some(1 << 10 | 1 << 9));
        driver.exchange(LATER, &frame(2 << 11 | 1));
        assert!(!driver.has_fault() && driver.drives(LATER));
        assert_eq!(driver.register(2), Some(0), "the request clears itself");
    }

    #[test]
    fn a_fault_that_is_still_there_comes_back_and_one_of_the_past_does_not() {
        let mut driver = awake();
        driver.set_present(fault::OVER_TEMPERATURE);
        driver.exchange(LATER, &frame(2 << 11 | 1));
        assert_eq!(driver.exchange(LATER, &frame(1 << 15)), Some(1 << 10 | 1 << 6));
        driver.set_present([0; 2]);
        assert!(driver.has_fault(), "latched");
        driver.exchange(LATER, &frame(2 << 11 | 1));
        assert!(!driver.has_fault());
        assert_eq!(driver.clears(), 2);
        driver.fail(fault::GATE_DRIVE);
        assert_eq!(driver.exchange(LATER, &frame(1 << 15 | 1 << 11)), Some(1 << 1), "the second word");
        driver.enable(LATER, false);
        driver.enable(LATER, true);
        assert!(!driver.has_fault(), "the enable clears, too");
    }

    #[test]
    fn a_supply_that_sags_locks_out_and_one_that_is_lost_takes_the_registers_with_it() {
        let mut driver = awake();
        driver.exchange(LATER, &frame(6 << 11 | 5));
        driver.supply(LATER, LOCK_OUT);
        assert!(!driver.has_fault());
        driver.supply(LATER, LOCK_OUT - 0.01);
        assert_eq!(driver.exchange(LATER, &frame(1 << 15)), Some(1 << 10 | 1 << 7));
        assert_eq!(driver.register(6), Some(5));
        driver.supply(LATER, LOST - 0.01);
        assert!(!driver.is_awake(LATER) && !driver.has_fault());
        driver.supply(LATER, 18.0);
        assert!(!driver.is_awake(LATER));
        assert!(driver.is_awake(LATER.after_ns(WAKE_NS)));
        assert_eq!(driver.register(6), Some(0x283));
    }

    #[test]
    fn a_silent_one_leaves_the_line_alone_and_takes_nothing() {
        let mut driver = awake();
        driver.set_silent(true);
        assert_eq!(driver.exchange(LATER, &frame(6 << 11 | 5)), None);
        driver.set_silent(false);
        assert_eq!(driver.exchange(LATER, &frame(1 << 15 | 6 << 11)), Some(0x283));
    }

    #[test]
    fn the_dead_time_is_that_of_its_register() {
        let mut driver = awake();
        assert!((driver.dead_time() - 100e-9).abs() < 1e-15);
        driver.exchange(LATER, &frame(5 << 11 | 0b10 << 8));
        assert!((driver.dead_time() - 200e-9).abs() < 1e-15);
    }

    #[test]
    fn another_mode_is_no_command() {
        let mut driver = awake();
        driver.exchange(LATER, &SpiFrame { mode: 0, ..frame(6 << 11) });
        assert_eq!(driver.register(6), Some(0x283));
    }
}
