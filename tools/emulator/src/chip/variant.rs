//! The two chips: sizes, which peripherals exist, where pins and interrupts go.
//!
//! Sources: RM0440, 2.2 "Memory organization" and 14.3 "Interrupt and exception vectors"; pins from the tables of
//! alternate functions of DS12589 (STM32G431) and DS12288 (STM32G474), as in the chip database that embassy is
//! generated from.

use super::wiring::{Pin, TimerName};

/// A clock gate in RCC: offset of the enable register and bit. The reset register lies 20h before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ClockGate {
    /// Offset of the enable register.
    pub register: u32,
    /// Bit in it, and in the reset register.
    pub bit: u8,
}

const fn gate(register: u32, bit: u8) -> ClockGate {
    ClockGate { register, bit }
}

/// RCC_AHB1ENR.
pub const AHB1: u32 = 0x48;
/// RCC_AHB2ENR.
pub const AHB2: u32 = 0x4c;
/// RCC_APB1ENR1.
pub const APB1: u32 = 0x58;
/// RCC_APB2ENR.
pub const APB2: u32 = 0x60;

/// Capabilities of a timer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TimerKind {
    /// TIM1: complementary outputs, break, repetition counter.
    Advanced,
    /// TIM2, TIM5: 32 bits.
    General32,
    /// TIM3, TIM4.
    General16,
    /// TIM15: two channels, counts up only.
    TwoChannels,
}

/// A timer.
#[derive(Clone, Copy, Debug)]
pub struct TimerDescription {
    /// Its name.
    pub name: TimerName,
    /// Name as in the reference manual.
    pub text: &'static str,
    /// Capabilities.
    pub kind: TimerKind,
    /// Its address.
    pub address: u32,
    /// Its clock.
    pub gate: ClockGate,
    /// Interrupts of update, capture and compare, break, and trigger.
    pub lines: [u8; 4],
}

const fn timer(
    name: TimerName,
    text: &'static str,
    kind: TimerKind,
    address: u32,
    gate: ClockGate,
    lines: [u8; 4],
) -> TimerDescription {
    TimerDescription { name, text, kind, address, gate, lines }
}

const TIM1: TimerDescription =
    timer(TimerName::Tim1, "TIM1", TimerKind::Advanced, 0x4001_2c00, gate(APB2, 11), [25, 27, 24, 26]);
const TIM2: TimerDescription =
    timer(TimerName::Tim2, "TIM2", TimerKind::General32, 0x4000_0000, gate(APB1, 0), [28; 4]);
const TIM3: TimerDescription =
    timer(TimerName::Tim3, "TIM3", TimerKind::General16, 0x4000_0400, gate(APB1, 1), [29; 4]);
const TIM4: TimerDescription =
    timer(TimerName::Tim4, "TIM4", TimerKind::General16, 0x4000_0800, gate(APB1, 2), [30; 4]);
const TIM5: TimerDescription =
    timer(TimerName::Tim5, "TIM5", TimerKind::General32, 0x4000_0c00, gate(APB1, 3), [50; 4]);
const TIM15: TimerDescription =
    timer(TimerName::Tim15, "TIM15", TimerKind::TwoChannels, 0x4001_4000, gate(APB2, 16), [24; 4]);

/// A timer's output at a pin.
#[derive(Clone, Copy, Debug)]
pub struct TimerOutput {
    /// The timer.
    pub timer: TimerName,
    /// Channel, from 1.
    pub channel: u8,
    /// The complementary output.
    pub complementary: bool,
    /// The pin.
    pub pin: Pin,
    /// Its alternate function.
    pub function: u8,
}

const fn output(timer: TimerName, channel: u8, complementary: bool, pin: Pin, function: u8) -> TimerOutput {
    TimerOutput { timer, channel, complementary, pin, function }
}

/// Outputs of the timers that make PWM here, the same on both chips.
pub const OUTPUTS: &[TimerOutput] = &[
    output(TimerName::Tim1, 1, false, Pin::new('A', 8), 6),
    output(TimerName::Tim1, 2, false, Pin::new('A', 9), 6),
    output(TimerName::Tim1, 3, false, Pin::new('A', 10), 6),
    output(TimerName::Tim1, 1, true, Pin::new('A', 7), 6),
    output(TimerName::Tim1, 1, true, Pin::new('A', 11), 6),
    output(TimerName::Tim1, 1, true, Pin::new('B', 13), 6),
    output(TimerName::Tim1, 1, true, Pin::new('C', 13), 4),
    output(TimerName::Tim1, 2, true, Pin::new('A', 12), 6),
    output(TimerName::Tim1, 2, true, Pin::new('B', 0), 6),
    output(TimerName::Tim1, 2, true, Pin::new('B', 14), 6),
    output(TimerName::Tim1, 3, true, Pin::new('B', 1), 6),
    output(TimerName::Tim1, 3, true, Pin::new('B', 15), 4),
    output(TimerName::Tim2, 1, false, Pin::new('A', 0), 1),
    output(TimerName::Tim2, 1, false, Pin::new('A', 5), 1),
    output(TimerName::Tim2, 1, false, Pin::new('A', 15), 1),
    output(TimerName::Tim2, 2, false, Pin::new('A', 1), 1),
    output(TimerName::Tim2, 2, false, Pin::new('B', 3), 1),
    output(TimerName::Tim2, 3, false, Pin::new('A', 2), 1),
    output(TimerName::Tim2, 3, false, Pin::new('A', 9), 10),
    output(TimerName::Tim2, 3, false, Pin::new('B', 10), 1),
];

/// Input that a converter's channel measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Input {
    /// A pin.
    Pin(Pin),
    /// The output of an operational amplifier, counted from 1, inside the chip.
    Amplifier(u8),
}

/// A converter.
#[derive(Clone, Copy, Debug)]
pub struct ConverterDescription {
    /// Name as in the reference manual.
    pub text: &'static str,
    /// Its address.
    pub address: u32,
    /// Its interrupt.
    pub line: u8,
    /// Group of converters with which it shares clock and common registers.
    pub group: usize,
    /// Number and input of its channels, single-ended.
    pub channels: &'static [(u8, Input)],
}

const fn at(port: char, number: u8) -> Input {
    Input::Pin(Pin::new(port, number))
}

const ADC1_INPUTS: &[(u8, Input)] = &[
    (1, at('A', 0)),
    (2, at('A', 1)),
    (3, at('A', 2)),
    (4, at('A', 3)),
    (5, at('B', 14)),
    (10, at('F', 0)),
    (11, at('B', 12)),
    (12, at('B', 1)),
    (13, Input::Amplifier(1)),
    (14, at('B', 11)),
    (15, at('B', 0)),
];
const ADC2_INPUTS: &[(u8, Input)] = &[
    (1, at('A', 0)),
    (2, at('A', 1)),
    (3, at('A', 6)),
    (4, at('A', 7)),
    (5, at('C', 4)),
    (10, at('F', 1)),
    (12, at('B', 2)),
    (13, at('A', 5)),
    (14, at('B', 11)),
    (15, at('B', 15)),
    (16, Input::Amplifier(2)),
    (17, at('A', 4)),
    (18, Input::Amplifier(3)),
];
const ADC3_INPUTS: &[(u8, Input)] = &[(1, at('B', 1)), (5, at('B', 13)), (12, at('B', 0)), (13, Input::Amplifier(3))];
const ADC4_INPUTS: &[(u8, Input)] = &[(3, at('B', 12)), (4, at('B', 14)), (5, at('B', 15))];
const ADC5_INPUTS: &[(u8, Input)] = &[(1, at('A', 8)), (2, at('A', 9))];

const fn converter(
    text: &'static str,
    address: u32,
    line: u8,
    group: usize,
    channels: &'static [(u8, Input)],
) -> ConverterDescription {
    ConverterDescription { text, address, line, group, channels }
}

const ADC1: ConverterDescription = converter("ADC1", 0x5000_0000, 18, 0, ADC1_INPUTS);
const ADC2: ConverterDescription = converter("ADC2", 0x5000_0100, 18, 0, ADC2_INPUTS);
const ADC3: ConverterDescription = converter("ADC3", 0x5000_0400, 47, 1, ADC3_INPUTS);
const ADC4: ConverterDescription = converter("ADC4", 0x5000_0500, 61, 1, ADC4_INPUTS);
const ADC5: ConverterDescription = converter("ADC5", 0x5000_0600, 62, 1, ADC5_INPUTS);

/// Clocks of the groups of converters.
pub const CONVERTER_GATES: [ClockGate; 2] = [gate(AHB2, 13), gate(AHB2, 14)];

/// An SPI peripheral.
#[derive(Clone, Copy, Debug)]
pub struct SpiDescription {
    /// Number, from 1.
    pub number: u8,
    /// Name as in the reference manual.
    pub text: &'static str,
    /// Its address.
    pub address: u32,
    /// Its clock.
    pub gate: ClockGate,
    /// Its interrupt.
    pub line: u8,
}

const SPIS: &[SpiDescription] = &[
    SpiDescription { number: 1, text: "SPI1", address: 0x4001_3000, gate: gate(APB2, 12), line: 35 },
    SpiDescription { number: 2, text: "SPI2", address: 0x4000_3800, gate: gate(APB1, 14), line: 36 },
    SpiDescription { number: 3, text: "SPI3", address: 0x4000_3c00, gate: gate(APB1, 15), line: 51 },
];

/// A chip.
#[derive(Clone, Copy, Debug)]
pub struct Variant {
    /// Its name.
    pub name: &'static str,
    /// Bytes of flash.
    pub flash: u32,
    /// `true` if the flash is two banks of half the size, of which one can be read while the other is erased or
    /// written.
    pub two_banks: bool,
    /// Bytes of SRAM1 and SRAM2 together.
    pub sram: u32,
    /// Bytes of CCM SRAM, which appears once more behind SRAM2.
    pub ccm: u32,
    /// DBGMCU_IDCODE.
    pub identity: u32,
    /// FLASH_OPTR as delivered.
    pub options: u32,
    /// Its timers.
    pub timers: &'static [TimerDescription],
    /// Its converters.
    pub converters: &'static [ConverterDescription],
    /// Its SPI peripherals.
    pub spis: &'static [SpiDescription],
}

/// STM32G431CB: category 2, 128 KiB of flash in one bank, 16 + 6 + 10 KiB of SRAM.
pub const STM32G431CB: Variant = Variant {
    name: "STM32G431CB",
    flash: 128 << 10,
    two_banks: false,
    sram: 22 << 10,
    ccm: 10 << 10,
    identity: 0x2000_6468,
    options: 0xffef_f8aa & !(1 << 20 | 1 << 22),
    timers: &[TIM1, TIM2, TIM3, TIM4, TIM15],
    converters: &[ADC1, ADC2],
    spis: SPIS,
};

/// STM32G474CE: category 3, 512 KiB of flash in two banks as delivered, 80 + 16 + 32 KiB of SRAM.
pub const STM32G474CE: Variant = Variant {
    name: "STM32G474CE",
    flash: 512 << 10,
    two_banks: true,
    sram: 96 << 10,
    ccm: 32 << 10,
    identity: 0x2036_6469,
    options: 0xffef_f8aa,
    timers: &[TIM1, TIM2, TIM3, TIM4, TIM5, TIM15],
    converters: &[ADC1, ADC2, ADC3, ADC4, ADC5],
    spis: SPIS,
};

/// Interrupt of the flash interface.
pub const FLASH_LINE: u8 = 4;
/// Interrupts of FDCAN1, lines 0 and 1.
pub const FDCAN_LINES: [u8; 2] = [21, 22];
/// Clock of the GPIO ports, from A.
pub const fn gpio_gate(port: u8) -> ClockGate {
    gate(AHB2, port)
}
/// Clock of SYSCFG, the amplifiers and comparators.
pub const SYSCFG_GATE: ClockGate = gate(APB2, 0);
/// Clock of PWR.
pub const PWR_GATE: ClockGate = gate(APB1, 28);
/// Clock of the flash interface's registers.
pub const FLASH_GATE: ClockGate = gate(AHB1, 8);
/// Clock of the CRC unit.
pub const CRC_GATE: ClockGate = gate(AHB1, 12);
/// The random number generator.
pub const RNG_GATE: ClockGate = gate(AHB2, 26);
/// Clock of FDCAN.
pub const FDCAN_GATE: ClockGate = gate(APB1, 25);
