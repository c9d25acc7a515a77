//! The chip as the core's bus: memories first, as they are most of the traffic, then registers.

use super::map::{self, Device, Place};
use super::rcc;
use super::variant::ClockGate;
use super::wiring::Wiring;
use super::{Chip, Deviation, FLASH_WIDTH, Waiting, gpio, iwdg, variant};
use crate::bus::{Bus, Refusal, Signals, Width};
use std::ops::Range;

/// Address of the flash; it appears at address 0 as well, where the core looks for its vectors (2.6 "Boot
/// configuration").
pub const FLASH: u32 = 0x0800_0000;

impl<W: Wiring> Bus for Chip<W> {
    #[inline(always)]
    fn read(&mut self, now: u64, address: u32, width: Width) -> Result<u32, Refusal> {
        match self.memory.read(address, width) {
            Some(value) => Ok(value),
            None => self.read_flash_or_register(now, address, width),
        }
    }

    #[inline(always)]
    fn write(&mut self, now: u64, address: u32, width: Width, value: u32) -> Result<(), Refusal> {
        match self.memory.write(address, width, value) {
            Some(()) => Ok(()),
            None => self.write_flash_or_register(now, address, width, value),
        }
    }

    #[inline(always)]
    fn load(&self, address: u32, width: Width) -> Option<u32> {
        self.memory.read(address, width)
    }

    #[inline(always)]
    fn store(&mut self, address: u32, width: Width, value: u32) -> bool {
        self.memory.write(address, width, value).is_some()
    }

    #[inline(always)]
    fn block(&self, address: u32, bytes: u32) -> Option<&[u8]> {
        self.memory.block(address, bytes)
    }

    #[inline(always)]
    fn block_mut(&mut self, address: u32, bytes: u32) -> Option<&mut [u8]> {
        self.memory.block_mut(address, bytes)
    }

    #[inline(always)]
    fn memory(&mut self) -> &mut [u8] {
        self.memory.bytes_mut()
    }

    fn place(&self, address: u32) -> Option<usize> {
        self.memory.place_of(address)
    }

    fn constant(&self, address: u32) -> Option<u32> {
        self.flash.array.intact(self.flash_offset(address)?)
    }

    fn fetch(&mut self, now: u64, address: u32) -> Result<u16, Refusal> {
        self.read(now, address, Width::Half).map(|value| value as u16)
    }

    fn code(&self) -> Vec<Range<u32>> {
        self.code_ranges()
    }

    #[inline]
    fn wait_states(&self, address: u32) -> u32 {
        match self.flash_offset(address) {
            Some(_) if self.waiting != Waiting::Never => self.flash.latency(),
            _ => 0,
        }
    }

    fn line(&self) -> Option<u32> {
        (self.waiting == Waiting::Always).then_some(FLASH_WIDTH)
    }

    #[inline(always)]
    fn next_event(&self) -> u64 {
        self.next
    }

    fn advance(&mut self, now: u64) {
        self.run_events(now);
    }

    #[inline]
    fn has_news(&self) -> bool {
        self.news
    }

    fn signals(&mut self) -> Signals {
        self.tell_signals()
    }
}

impl<W: Wiring> Chip<W> {
    #[inline(always)]
    fn flash_offset(&self, address: u32) -> Option<u32> {
        if address < self.variant.flash {
            return Some(address);
        }
        let offset = address.wrapping_sub(FLASH);
        (offset < self.variant.flash).then_some(offset)
    }

    fn read_flash_or_register(&mut self, now: u64, address: u32, width: Width) -> Result<u32, Refusal> {
        self.check_power()?;
        if let Some(offset) = self.flash_offset(address) {
            let wrong = self.flash.nmi();
            let value = self.flash.load(offset, width).ok_or(Refusal::NoAnswer)?;
            if self.flash.nmi() != wrong {
                self.double_error(now);
            }
            return Ok(value);
        }
        if self.next <= now {
            self.run_events(now);
            self.check_power()?;
        }
        let Some(Place { device, offset, gate, .. }) = self.places.find(address, self.variant) else {
            if address & !0xfff == 0x1fff_7000 {
                return self.memory.read_signature(address, width);
            }
            return Err(Self::nothing_at(address));
        };
        if !self.is_clocked(gate, device, address)? {
            return Ok(0);
        }
        let word = offset & !3;
        let value = match device {
            Device::Spi(index) => {
                self.agenda.touch(self.spi_place(index));
                let value = self.spis[index].read(offset, width)?;
                self.refresh();
                return Ok(value);
            }
            _ => self.read_register(device, word, now)?,
        };
        let shifted = value >> (8 * (offset & 3));
        Ok(match width {
            Width::Word => value,
            Width::Half => shifted & 0xffff,
            Width::Byte => shifted & 0xff,
        })
    }

    fn read_register(&mut self, device: Device, offset: u32, now: u64) -> Result<u32, Refusal> {
        let at = self.moment(now);
        match device {
            Device::Timer(index) => {
                if self.timers[index].shows_count(offset) {
                    self.attend_timer(index, now);
                }
                let timer = &mut self.timers[index];
                if timer.changes_when_read(offset) {
                    self.agenda.touch(index);
                }
                timer.read(offset)
            }
            Device::Iwdg => self.iwdg.read(offset, at),
            Device::Pwr => self.pwr.read(offset),
            Device::Syscfg => self.syscfg.read(offset),
            Device::Amplifiers => self.amplifiers.read(offset),
            Device::Rcc => self.rcc.read(offset, at),
            Device::Flash => self.flash.read(offset),
            Device::Crc => self.crc.read(offset),
            Device::Rng => self.rng.read(offset, self.rcc.has_hsi48(at.instant())),
            Device::Gpio(port) => {
                let Self { gpio, wiring, clock, .. } = self;
                gpio.read(port, offset, |pin| wiring.level(clock.instant(now), pin))
            }
            Device::Converter(index) => self.converters[index].read(offset, at),
            Device::Common(group) => self.common[group].read(offset),
            Device::Debug => self.syscfg.read_debug(offset),
            Device::Spi(_) => Err(Refusal::NoAnswer),
            Device::Fdcan => self.fdcan.read(offset, at, self.fdcan_clock()),
            Device::MessageRam => Ok(self.fdcan.read_ram(offset)),
        }
    }

    fn write_flash_or_register(&mut self, now: u64, address: u32, width: Width, value: u32) -> Result<(), Refusal> {
        self.check_power()?;
        if self.next <= now {
            self.run_events(now);
            self.check_power()?;
        }
        if let Some(offset) = self.flash_offset(address) {
            self.flash.store(offset, width, value, self.moment(now))?;
            self.refresh_slow();
            return Ok(());
        }
        let Some(Place { device, offset, gate, .. }) = self.places.find(address, self.variant) else {
            return Err(Self::nothing_at(address));
        };
        if !self.is_clocked(gate, device, address)? {
            return Ok(());
        }
        if !Self::takes(device, offset, width) {
            let text = format!("a write of {} bytes to {device:?} at {offset:#05x} is not modelled", width.bytes());
            return Err(Refusal::Unmodelled(text));
        }
        if let (Device::Timer(index), Width::Word) = (device, width)
            && self.timers[index].prepare(offset, value)
        {
            return Ok(());
        }
        self.write_register(device, offset, width, value, now)?;
        match device {
            Device::Rcc | Device::Flash | Device::Iwdg | Device::Pwr | Device::Fdcan => self.refresh_slow(),
            _ => self.refresh(),
        }
        Ok(())
    }

    /// Returns `true` if a device takes a write of this width. A timer's prescaler is written as half a word by
    /// embassy; the bridge repeats it in the upper half, which is reserved.
    const fn takes(device: Device, offset: u32, width: Width) -> bool {
        match (device, width) {
            (_, Width::Word) => offset.is_multiple_of(4),
            (Device::Timer(_), Width::Half) => offset == 0x28,
            (Device::Spi(_), _) => true,
            (Device::Crc, _) => offset == 0,
            _ => false,
        }
    }

    fn write_register(
        &mut self,
        device: Device,
        offset: u32,
        width: Width,
        value: u32,
        now: u64,
    ) -> Result<(), Refusal> {
        let at = self.moment(now);
        match device {
            Device::Timer(index) => {
                self.agenda.touch(index);
                self.attend_timer(index, now);
                self.timers[index].write(offset, value, now)?;
                self.tell(index, now);
            }
            Device::Spi(index) => {
                self.agenda.touch(self.spi_place(index));
                self.spis[index].write(offset, width, value, now)?;
            }
            Device::Iwdg => {
                if self.iwdg.write(offset, value, at)? == iwdg::Effect::StartOscillator {
                    self.rcc.start_lsi(at.instant());
                }
            }
            Device::Pwr => {
                self.pwr.write(offset, value)?;
                self.check_speed()?;
            }
            Device::Syscfg => self.syscfg.write(offset, value)?,
            Device::Amplifiers => self.amplifiers.write(offset, value)?,
            Device::Rcc => {
                let effect = self.rcc.write(offset, value, at, self.pwr.backup_is_writable())?;
                self.apply(effect, now)?;
            }
            Device::Flash => {
                self.flash.write(offset, value, at)?;
                if self.flash.take_launch() {
                    self.reset(now, super::rcc::Cause::OptionBytes);
                    return Ok(());
                }
                self.check_speed()?;
            }
            Device::Crc => self.crc.write(offset, width, value)?,
            Device::Rng => self.rng.write(offset, value)?,
            Device::Gpio(port) => {
                self.gpio.write(port, offset, value)?;
                self.tell_driven(port, now);
                if gpio::changes_functions(offset) {
                    self.tell_outputs(now);
                }
            }
            Device::Converter(index) => self.write_converter(index, offset, value, now)?,
            Device::Common(group) => {
                let mut members = self.converters.iter().filter(|converter| converter.description().group == group);
                let off = members.all(|converter| converter.is_off(now));
                self.common[group].write(offset, value, off)?;
            }
            Device::Debug => self.syscfg.write_debug(offset, value)?,
            Device::Fdcan => {
                let clock = self.rcc.fdcan_clock()?;
                self.fdcan.write(offset, value, at, clock)?;
                self.tell_line(at.instant());
            }
            Device::MessageRam => self.fdcan.write_ram(offset, value),
        }
        Ok(())
    }

    fn write_converter(&mut self, index: usize, offset: u32, value: u32, now: u64) -> Result<(), Refusal> {
        let at = self.moment(now);
        self.agenda.touch(self.converter_place(index));
        let Self { converters, common, gpio, amplifiers, .. } = self;
        let divider = common[converters[index].description().group].divider();
        converters[index].write(offset, value, at, divider, |input| match input {
            variant::Input::Pin(pin) if gpio.mode(pin) != gpio::Mode::Analog => {
                Err(format!("{pin} is not in analog mode"))
            }
            variant::Input::Amplifier(number) if amplifiers.amplification(number).is_none() => {
                Err(format!("amplifier {number} is off"))
            }
            _ => Ok(()),
        })
    }

    /// Brings a timer up to a cycle. What others see of it is an event, of which none is due: the agenda stays as it
    /// is.
    fn attend_timer(&mut self, index: usize, now: u64) {
        let timer = &mut self.timers[index];
        if timer.follows_encoder() {
            let quadrature = self.wiring.quadrature(self.clock.instant(now), timer.name());
            timer.follow(quadrature);
        } else {
            timer.advance(now);
        }
    }

    fn apply(&mut self, effect: rcc::Effect, now: u64) -> Result<(), Refusal> {
        match effect {
            rcc::Effect::None => {}
            rcc::Effect::Frequency(frequency) => {
                self.clock.change(now, frequency);
                self.check_speed()?;
            }
            rcc::Effect::Reset { register, bits } => {
                for bit in (0..32u8).filter(|bit| bits >> bit & 1 != 0) {
                    self.reset_behind(ClockGate { register, bit }, now);
                }
            }
        }
        Ok(())
    }

    /// Resets what is behind a clock gate (7.1.1). The flash interface is reset in power-down only, where it never is.
    fn reset_behind(&mut self, gate: ClockGate, now: u64) {
        let variant = self.variant;
        self.agenda.touch_all();
        for (timer, description) in self.timers.iter_mut().zip(variant.timers) {
            if description.gate == gate {
                timer.reset();
            }
        }
        for (spi, description) in self.spis.iter_mut().zip(variant.spis) {
            if description.gate == gate {
                spi.reset();
            }
        }
        for (group, common) in self.common.iter_mut().enumerate() {
            if variant::CONVERTER_GATES[group] == gate {
                common.reset();
            }
        }
        for (converter, description) in self.converters.iter_mut().zip(variant.converters) {
            if variant::CONVERTER_GATES[description.group] == gate {
                converter.reset();
            }
        }
        if gate == variant::SYSCFG_GATE {
            self.syscfg.reset();
            self.amplifiers.reset();
        } else if gate == variant::PWR_GATE {
            self.pwr.reset();
        } else if gate == variant::CRC_GATE {
            self.crc.reset();
        } else if gate == variant::RNG_GATE {
            self.rng.reset();
        } else if gate == variant::FDCAN_GATE {
            self.fdcan.reset();
            self.tell_line(self.clock.instant(now));
        }
        for port in 0..gpio::PORTS {
            if variant::gpio_gate(port) == gate {
                self.gpio.reset(port);
                self.tell_driven(port, now);
            }
        }
        self.connect();
        for index in 0..self.timers.len() {
            self.tell(index, now);
        }
    }

    /// Returns `true` if a peripheral has its clock, without which it is not to be accessed (7.2.16 "Peripheral clock
    /// enable registers").
    #[inline]
    fn is_clocked(&self, gate: Option<ClockGate>, device: Device, address: u32) -> Result<bool, Refusal> {
        match gate {
            Some(gate) if !self.rcc.is_enabled(gate) => {
                let known = Deviation::WithoutClock { register: address & !3 };
                if self.deviations.contains(&known) {
                    return Ok(false);
                }
                let text = format!("{device:?} is accessed at {address:#010x} without its clock (RM0440, 7.2.16)");
                Err(Refusal::Unmodelled(text))
            }
            _ => Ok(true),
        }
    }

    fn check_power(&self) -> Result<(), Refusal> {
        if self.powered { Ok(()) } else { Err(Refusal::Unmodelled("the chip has no power".into())) }
    }

    fn nothing_at(address: u32) -> Refusal {
        match map::unmodelled(address) {
            Some((name, chapter)) => {
                Refusal::Unmodelled(format!("{name} at {address:#010x} (RM0440, {chapter}) is not modelled"))
            }
            None => Refusal::NoAnswer,
        }
    }
}
