//! The microcontroller around the core: STM32G431CB and STM32G474CE, memories and the peripherals that the firmware
//! uses.
//!
//! Sections are those of the reference manual RM0440; what is neither there nor in the datasheets is said where it is
//! assumed. What is not modelled ends the run: any other register, any other mode, and whatever the manual forbids, for
//! then nobody knows what the chip does.
//!
//! Timers, converters and frames count the core's cycles; flash, watchdog and start-up times count time. The chip does
//! nothing between events: the earliest of all is computed when something changes, and counters are computed when
//! somebody looks.

pub mod adc;
pub mod crc;
pub mod fdcan;
pub mod flash;
pub mod gpio;
pub mod iwdg;
pub mod map;
pub mod memory;
pub mod opamp;
pub mod pwr;
pub mod rcc;
mod register;
pub mod rng;
pub mod spi;
pub mod syscfg;
pub mod time;
pub mod timer;
pub mod variant;
pub mod wiring;

mod access;
mod agenda;
mod events;
#[cfg(test)]
mod tests;

use crate::bus::Refusal;
use adc::{Common, Converter};
use agenda::Agenda;
use crc::Crc;
use fdcan::Fdcan;
use flash::{Flash, KeptError, Torn};
use gpio::{Driven, Gpio, PORTS};
use iwdg::Iwdg;
use map::Places;
use memory::Memory;
use opamp::Amplifiers;
use pwr::{Pwr, Range};
use rcc::{Cause, Rcc};
use rng::Rng;
use spi::Spi;
use syscfg::{Alarm, Syscfg};
use time::{Clock, Instant, Moment};
use timer::Timer;
use variant::Variant;
use wiring::{Pin, Wiring};

/// Deviation of a program from the manual with which it may go on all the same: each of them known, and named by
/// whoever runs the program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Deviation {
    /// A register of a peripheral without its clock is accessed: it reads 0 and ignores what is written.
    WithoutClock {
        /// Address of the register.
        register: u32,
    },
    /// The core runs beyond 150 MHz without the regulator's boost mode (6.1.5).
    WithoutBoost,
}

/// Bytes that one access to the flash brings: 64 bits, of the chip with one bank and of that with two (RM0440, 3.3.1
/// and 5.3.1).
const FLASH_WIDTH: u32 = 8;

/// Place in which the flash's wait states (ACR.LATENCY) are counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Waiting {
    /// Nowhere: as if all code and data lay in SRAM.
    Never,
    /// At the target of each taken branch and for each datum: the caches always miss, and the prefetch keeps up with
    /// code in sequence.
    #[default]
    Prefetched,
    /// For each line of code that is begun, in sequence too, and for each datum: caches and prefetch are of no use.
    /// Nothing can take longer.
    Always,
}

/// A chip, and the board that its pins are connected to.
#[derive(Clone, Debug)]
pub struct Chip<W> {
    variant: &'static Variant,
    wiring: W,
    clock: Clock,
    powered: bool,
    memory: Memory,
    flash: Flash,
    waiting: Waiting,
    rcc: Rcc,
    pwr: Pwr,
    syscfg: Syscfg,
    gpio: Gpio,
    driven: [Driven; PORTS as usize],
    timers: Vec<Timer>,
    converters: Vec<Converter>,
    common: [Common; 2],
    amplifiers: Amplifiers,
    spis: Vec<Spi>,
    iwdg: Iwdg,
    crc: Crc,
    rng: Rng,
    fdcan: Fdcan,
    deviations: Vec<Deviation>,
    places: Places,
    agenda: Agenda,
    /// Earliest event.
    next: u64,
    /// Earliest event of what counts time.
    next_slow: u64,
    lines: u128,
    /// Lines of what counts time.
    slow_lines: u128,
    reset: bool,
    /// `true` if there may be signals that the core has not been told.
    news: bool,
}

impl<W: Wiring> Chip<W> {
    /// Powered up at cycle 0, with erased flash.
    pub fn new(variant: &'static Variant, wiring: W) -> Self {
        let mut chip = Self {
            variant,
            wiring,
            clock: Clock::new(rcc::HSI),
            powered: true,
            memory: Memory::new(variant),
            flash: Flash::new(variant),
            waiting: Waiting::default(),
            rcc: Rcc::new(),
            pwr: Pwr::new(),
            syscfg: Syscfg::new(variant.identity),
            gpio: Gpio::new(),
            driven: Default::default(),
            timers: variant.timers.iter().map(Timer::new).collect(),
            converters: variant.converters.iter().map(Converter::new).collect(),
            common: [Common::new("ADC12_COMMON"), Common::new("ADC345_COMMON")],
            amplifiers: Amplifiers::new(),
            spis: variant.spis.iter().map(Spi::new).collect(),
            iwdg: Iwdg::new(),
            crc: Crc::new(),
            rng: Rng::new(),
            fdcan: Fdcan::new(),
            deviations: Vec::new(),
            places: Places::new(),
            agenda: Agenda::new(variant.timers.len() + variant.converters.len() + variant.spis.len()),
            news: true,
            next: u64::MAX,
            next_slow: u64::MAX,
            lines: 0,
            slow_lines: 0,
            reset: false,
        };
        assert!(chip.spi_place(variant.spis.len()) <= agenda::PLACES, "{} has too many peripherals", variant.name);
        chip.refresh_slow();
        chip
    }

    /// Variant of the chip.
    pub const fn variant(&self) -> &'static Variant {
        self.variant
    }

    /// The board.
    pub const fn wiring(&self) -> &W {
        &self.wiring
    }

    /// The board. After a change that the chip has to see before its own next event, call
    /// [`wiring_changed`](Self::wiring_changed).
    pub const fn wiring_mut(&mut self) -> &mut W {
        &mut self.wiring
    }

    /// The board has something new: a frame on the bus.
    pub fn wiring_changed(&mut self) {
        self.refresh_slow();
    }

    /// SRAM1, SRAM2 and CCM SRAM, side by side from 2000_0000h on.
    pub fn sram(&self) -> &[u8] {
        self.memory.bytes()
    }

    /// The flash, to look at.
    pub const fn flash(&self) -> &Flash {
        &self.flash
    }

    /// Chooses what the core waits for where it wants something from flash.
    pub const fn set_waiting(&mut self, waiting: Waiting) {
        self.waiting = waiting;
    }

    /// Chooses, by a seed, what is left to chance when the power goes.
    pub fn seed(&mut self, seed: u64) {
        self.flash.array.seed(seed);
    }

    /// Another chip of the kind.
    pub fn set_uid(&mut self, uid: [u8; 12]) {
        self.memory.set_uid(uid);
    }

    /// Writes flash as a programmer would, before the run. False where it does not fit.
    pub fn program(&mut self, address: u32, bytes: &[u8]) -> bool {
        address.checked_sub(access::FLASH).is_some_and(|offset| self.flash.array.flash(offset, bytes))
    }

    /// Pages of the flash in a range of addresses as a loss of power would leave them now, to be kept; none outside of
    /// the flash.
    pub fn kept(&self, addresses: std::ops::Range<u32>) -> Option<Vec<u8>> {
        Some(self.flash.kept(self.pages(addresses)?))
    }

    /// Puts pages back that were [kept](Self::kept), before the run.
    ///
    /// # Errors
    /// Bytes that are no such pages.
    pub fn restore(&mut self, addresses: std::ops::Range<u32>, bytes: &[u8]) -> Result<(), KeptError> {
        match self.pages(addresses) {
            Some(offsets) => self.flash.restore(offsets, bytes),
            None => Err(KeptError::Foreign),
        }
    }

    fn pages(&self, addresses: std::ops::Range<u32>) -> Option<std::ops::Range<u32>> {
        let offset = |address: u32| address.checked_sub(access::FLASH).filter(|offset| *offset <= self.variant.flash);
        Some(offset(addresses.start)?..offset(addresses.end)?)
    }

    /// Lets the program go on with something that the manual forbids.
    pub fn allow(&mut self, deviation: Deviation) {
        self.deviations.push(deviation);
    }

    /// The core's frequency now, Hz.
    pub const fn frequency(&self) -> u64 {
        self.clock.frequency()
    }

    /// Instant at which a cycle begins, by the frequency of now.
    pub fn instant(&self, cycle: u64) -> Instant {
        self.clock.instant(cycle)
    }

    const fn moment(&self, cycle: u64) -> Moment {
        Moment { cycle, clock: self.clock }
    }

    /// Returns `true` if there is power. Without it every access is refused.
    pub const fn is_powered(&self) -> bool {
        self.powered
    }

    /// Lets the power go in the middle of a flash operation: the `operation`th double word or page from now on, counted
    /// from 1.
    pub fn power_cut_at(&mut self, operation: u64, kind: Torn) {
        self.flash.cut_at(operation, kind);
    }

    /// The power goes: SRAM and registers are lost, an operation of the flash stays half done.
    pub fn power_down(&mut self, cycle: u64) {
        self.flash.power_down();
        self.powered = false;
        self.memory.power_down();
        self.reset_peripherals(cycle, Cause::Power);
        self.syscfg.power_up();
    }

    /// The power comes back; the core starts anew.
    pub fn power_up(&mut self, cycle: u64) {
        self.flash.power_up();
        self.memory.power_up();
        self.powered = true;
        self.reset_peripherals(cycle, Cause::Power);
    }

    /// Resets the chip: for the core's SYSRESETREQ and for the pin. SRAM stays.
    pub fn reset(&mut self, cycle: u64, cause: Cause) {
        self.flash.reset();
        self.reset_peripherals(cycle, cause);
    }

    /// The core has locked up: TIM1 breaks where SYSCFG connects it (10.2.10). Only a reset ends it.
    pub fn lockup(&mut self, cycle: u64) {
        self.alarm(cycle, Alarm::Lockup);
    }

    fn alarm(&mut self, cycle: u64, alarm: Alarm) {
        if self.syscfg.breaks(alarm) {
            for index in 0..self.timers.len() {
                self.agenda.touch(index);
                self.timers[index].advance(cycle);
                self.timers[index].alarm(alarm);
                self.tell(index, cycle);
            }
            self.refresh();
        }
    }

    fn reset_peripherals(&mut self, cycle: u64, cause: Cause) {
        let at = self.clock.instant(cycle);
        self.clock.change(cycle, rcc::HSI);
        self.rcc.reset(at, cause);
        self.pwr.reset();
        self.syscfg.reset();
        for port in 0..PORTS {
            self.gpio.reset(port);
        }
        self.connect();
        self.agenda.touch_all();
        self.timers.iter_mut().for_each(Timer::reset);
        self.converters.iter_mut().for_each(Converter::reset);
        self.common.iter_mut().for_each(Common::reset);
        self.amplifiers.reset();
        self.spis.iter_mut().for_each(Spi::reset);
        self.iwdg.reset();
        self.crc.reset();
        self.rng.reset();
        self.fdcan.reset();
        self.tell_line(at);
        for port in 0..PORTS {
            self.tell_driven(port, cycle);
        }
        for index in 0..self.timers.len() {
            self.tell(index, cycle);
        }
        self.reset = true;
        self.refresh_slow();
    }

    /// Tells the board which general-purpose outputs changed.
    fn tell_driven(&mut self, port: u8, cycle: u64) {
        let (before, now) = (self.driven[usize::from(port)], self.gpio.driven(port));
        if before == now {
            return;
        }
        self.driven[usize::from(port)] = now;
        let changed = (before.pins ^ now.pins) | (before.levels ^ now.levels);
        let at = self.clock.instant(cycle);
        for number in (0..16).filter(|number| changed >> number & 1 != 0) {
            let level = (now.pins >> number & 1 != 0).then_some(now.levels >> number & 1 != 0);
            self.wiring.driven(at, Pin { port, number }, level);
        }
    }

    /// Checks that the flash is read slowly enough for the core's frequency, and the regulator gives what it takes
    /// (3.3.3, 5.3.3, 6.1.5).
    fn check_speed(&self) -> Result<(), Refusal> {
        let allowed = self.deviations.contains(&Deviation::WithoutBoost);
        let range = match self.pwr.range() {
            Range::Normal if allowed => Range::Boost,
            range => range,
        };
        let states = self.flash.latency();
        let limits = range.frequencies();
        let limit = limits.get(states as usize).or(limits.last()).copied().unwrap_or(0);
        let frequency = self.clock.frequency();
        if frequency <= limit * 1_000_000 {
            return Ok(());
        }
        Err(Refusal::Unmodelled(format!(
            "{frequency} Hz with {states} wait states in range {range:?} of the regulator: the limit is {limit} MHz (RM0440, 6.1.5 and the \
             flash's \"read access latency\")"
        )))
    }
}
