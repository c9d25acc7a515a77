//! Memory map: RM0440, 2.2 "Memory organization".

use super::variant::{
    self, CONVERTER_GATES, CRC_GATE, ClockGate, FDCAN_GATE, FLASH_GATE, PWR_GATE, RNG_GATE, SYSCFG_GATE, Variant,
};

/// A modelled peripheral.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Device {
    /// Index in the variant's list.
    Timer(usize),
    /// Index in the variant's list.
    Spi(usize),
    /// IWDG.
    Iwdg,
    /// PWR.
    Pwr,
    /// SYSCFG.
    Syscfg,
    /// The amplifiers.
    Amplifiers,
    /// RCC.
    Rcc,
    /// The flash interface.
    Flash,
    /// The CRC unit.
    Crc,
    /// The random number generator.
    Rng,
    /// A port, from 0 for A.
    Gpio(u8),
    /// Index in the variant's list.
    Converter(usize),
    /// Index of the group.
    Common(usize),
    /// FDCAN1's registers.
    Fdcan,
    /// FDCAN1's message RAM.
    MessageRam,
    /// DBGMCU.
    Debug,
}

/// Clock gate of a device; none where it always runs.
pub fn gate(device: Device, variant: &Variant) -> Option<ClockGate> {
    match device {
        Device::Timer(index) => Some(variant.timers[index].gate),
        Device::Spi(index) => Some(variant.spis[index].gate),
        Device::Pwr => Some(PWR_GATE),
        Device::Syscfg | Device::Amplifiers => Some(SYSCFG_GATE),
        Device::Flash => Some(FLASH_GATE),
        Device::Crc => Some(CRC_GATE),
        Device::Rng => Some(RNG_GATE),
        Device::Gpio(port) => Some(variant::gpio_gate(port)),
        Device::Converter(index) => Some(CONVERTER_GATES[variant.converters[index].group]),
        Device::Common(group) => Some(CONVERTER_GATES[group]),
        Device::Fdcan | Device::MessageRam => Some(FDCAN_GATE),
        Device::Iwdg | Device::Rcc | Device::Debug => None,
    }
}

/// A peripheral's register, found.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    address: u32,
    /// The peripheral.
    pub device: Device,
    /// Bytes from its first register.
    pub offset: u32,
    /// Its clock gate; none where it always runs.
    pub gate: Option<ClockGate>,
}

/// Places that were found lately, by the lower bits of their addresses: finding one takes longer than most accesses.
#[derive(Clone, Debug)]
pub struct Places([Option<Place>; 128]);

impl Places {
    /// None yet.
    pub(super) const fn new() -> Self {
        Self([None; 128])
    }

    /// Device or memory at an address; none where there is nothing that is modelled.
    pub fn find(&mut self, address: u32, variant: &Variant) -> Option<Place> {
        // Peripherals' pages differ from bit 10 on.
        let lately = &mut self.0[((address >> 2 ^ address >> 8) % 128) as usize];
        if let Some(place) = lately.filter(|place| place.address == address) {
            return Some(place);
        }
        let (device, offset) = locate(address, variant)?;
        *lately = Some(Place { address, device, offset, gate: gate(device, variant) });
        *lately
    }
}

/// The peripheral at an address, and the offset in it.
pub fn locate(address: u32, variant: &Variant) -> Option<(Device, u32)> {
    let page = address & !0x3ff;
    let inside = address & 0x3ff;
    let device = match page {
        0x4000_3000 => Device::Iwdg,
        0x4000_6400 => Device::Fdcan,
        0x4000_7000 => Device::Pwr,
        // 212 words of the message RAM are FDCAN1's.
        0x4000_a400 if inside < 4 * 212 => Device::MessageRam,
        0x4001_0000 if inside < 0x30 => Device::Syscfg,
        0x4001_0000 if inside >= 0x300 => return Some((Device::Amplifiers, inside - 0x300)),
        0x4002_1000 => Device::Rcc,
        0x4002_2000 => Device::Flash,
        0x4002_3000 => Device::Crc,
        0x5006_0800 => Device::Rng,
        0x4800_0000..=0x4800_1800 => Device::Gpio(((page - 0x4800_0000) >> 10) as u8),
        0x5000_0000 | 0x5000_0400 => return converter(address, variant),
        0xe004_2000 => Device::Debug,
        _ => {
            let timer = variant.timers.iter().position(|timer| timer.address == page).map(Device::Timer);
            timer.or_else(|| variant.spis.iter().position(|spi| spi.address == page).map(Device::Spi))?
        }
    };
    Some((device, inside))
}

fn converter(address: u32, variant: &Variant) -> Option<(Device, u32)> {
    if address & 0x300 == 0x300 {
        let group = usize::from(address >= 0x5000_0400);
        let exists = variant.converters.iter().any(|converter| converter.group == group);
        return exists.then_some((Device::Common(group), address & 0xff));
    }
    let index = variant.converters.iter().position(|converter| converter.address == address & !0xff)?;
    Some((Device::Converter(index), address & 0xff))
}

/// Peripherals that the chips have and this model has not: first address, name, chapter of RM0440.
const UNMODELLED: &[(u32, &str, &str)] = &[
    (0x4000_1000, "TIM6", "31"),
    (0x4000_1400, "TIM7", "31"),
    (0x4000_2000, "CRS", "8"),
    (0x4000_2400, "TAMP", "36"),
    (0x4000_2800, "RTC", "35"),
    (0x4000_2c00, "WWDG", "43"),
    (0x4000_4400, "USART2", "37"),
    (0x4000_4800, "USART3", "37"),
    (0x4000_4c00, "UART4", "37"),
    (0x4000_5000, "UART5", "37"),
    (0x4000_5400, "I2C1", "41"),
    (0x4000_5800, "I2C2", "41"),
    (0x4000_5c00, "USB", "45"),
    (0x4000_6000, "USB SRAM", "45"),
    (0x4000_6800, "FDCAN2", "44"),
    (0x4000_6c00, "FDCAN3", "44"),
    (0x4000_7800, "I2C3", "41"),
    (0x4000_7c00, "LPTIM1", "32"),
    (0x4000_8000, "LPUART1", "38"),
    (0x4000_8400, "I2C4", "41"),
    (0x4000_a000, "UCPD1", "46"),
    (0x4000_a400, "message RAM of FDCAN2 and FDCAN3", "44"),
    (0x4000_a800, "message RAM of FDCAN2 and FDCAN3", "44"),
    (0x4000_ac00, "message RAM of FDCAN2 and FDCAN3", "44"),
    (0x4001_0000, "VREFBUF or COMP", "23 and 24"),
    (0x4001_0400, "EXTI", "15"),
    (0x4001_3400, "TIM8", "28"),
    (0x4001_3800, "USART1", "37"),
    (0x4001_3c00, "SPI4", "39"),
    (0x4001_4400, "TIM16", "30"),
    (0x4001_4800, "TIM17", "30"),
    (0x4001_5000, "TIM20", "28"),
    (0x4001_5400, "SAI1", "40"),
    (0x4001_6800, "HRTIM", "27"),
    (0x4001_6c00, "HRTIM", "27"),
    (0x4001_7000, "HRTIM", "27"),
    (0x4002_0000, "DMA1", "12"),
    (0x4002_0400, "DMA2", "12"),
    (0x4002_0800, "DMAMUX", "13"),
    (0x4002_0c00, "CORDIC", "17"),
    (0x4002_1400, "FMAC", "18"),
    (0x5000_0800, "DAC1", "22"),
    (0x5000_0c00, "DAC2", "22"),
    (0x5000_1000, "DAC3", "22"),
    (0x5000_1400, "DAC4", "22"),
    (0x5006_0000, "AES", "34"),
];

/// Name and chapter of what the chip has at an address where nothing is modelled; none where it has nothing.
pub fn unmodelled(address: u32) -> Option<(&'static str, &'static str)> {
    match address {
        0x1fff_0000..=0x1fff_7fff => Some(("system memory", "2.2")),
        0x2200_0000..=0x23ff_ffff | 0x4200_0000..=0x43ff_ffff => Some(("bit-band alias", "2.2")),
        0x9000_0000..=0xa000_1fff => Some(("external memory", "19 and 20")),
        _ => {
            let found = UNMODELLED.iter().find(|(first, _, _)| *first == address & !0x3ff);
            found.map(|&(_, name, chapter)| (name, chapter))
        }
    }
}
