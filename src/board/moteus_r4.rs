//! mjbots moteus r4.11 (STM32G474CEU6): pins, timers, gains and limits.
//!
//! Sources: netlist of the controller r4.11 and the vendor's firmware (moteus_hw, moteus_controller, bldc_servo,
//! drv8323), read not copied. The pin functions agree with the chip database that embassy is generated from. **Nothing
//! here has run on a board.** Marked facts: *derived* from parts that a source names, *unconfirmed* by a second source.
//!
//! | function | pin, peripheral |
//! |---|---|
//! | PWM A, B, C | PA0, PA1, PA2: TIM2_CH1, 2, 3 to the DRV8353's INHA, B, C |
//! | gate driver | SPI1: SCK PA5, MISO PA6, MOSI PA7, select PC4; enable PA3; HIZ PB7 (INLA to INLC, high switches); nFAULT PB6 |
//! | current A, B, C | PB0 ADC3_IN12, PB1 ADC1_IN12, PB2 ADC2_IN12 |
//! | supply | PB12 ADC1_IN11 |
//! | bridge NTC, motor NTC | PA9 ADC5_IN2, PA8 ADC5_IN1 |
//! | rotor encoder | SPI2: SCK PB13, MISO PB14, MOSI PB15, select PB11 |
//! | CAN receive, transmit | PA11, PA12: FDCAN1 |
//! | holding brake, brake chopper | PC15, PC14: the pads DBG2, DBG1; high opens the brake, high conducts. For the input of a driver with a pull-down: they float until the program starts, and give no current |
//! | LEDs | PF0 debug, PF1 power (lit when low: unconfirmed) |
//!
//! The vendor drives the same pins with TIM5, which cannot trigger the converters; TIM2 can trigger all of them at
//! once. Neither has a break input: HIZ and enable switch off.

use super::adc::{self, FULL_SCALE, Sequence};
use super::drv8353::Drv8353;
use super::gate::{self, Gate};
pub use super::gate::{ask_reset, is_started};
use super::pwm::{self, TIMER_HZ};
use super::{Led, Parts, Peripherals, StartError};
use core::sync::atomic::{AtomicU8, Ordering};
use cortex_m::peripheral::DWT;
use embassy_stm32::Config;
use embassy_stm32::gpio::{Input, Level, Output, OutputType, Pin, Pull, Speed};
use embassy_stm32::pac;
use embassy_stm32::pac::adc::Adc;
use embassy_stm32::pac::adc::vals::SampleTime;
use embassy_stm32::pac::gpio::vals::Moder;
use embassy_stm32::pac::timer::vals::{Dir, Mms, Ocm};
use embassy_stm32::rcc;
use embassy_stm32::spi::{self, Spi};
use embassy_stm32::time::Hertz;
use embassy_stm32::timer::low_level::CountingMode;
use embassy_stm32::timer::simple_pwm::{PwmPin, SimplePwm};
use joint_firmware::default_configuration::{self, BoardConfiguration, MoteusR4Encoder};
use joint_firmware::hardware::moteus_revision::{Pins, SUPPORTED};
use joint_firmware::hardware::{Hardware, Setup};
use joint_firmware::joint::{Bridge, BridgeState, Measurements, Outputs};
use joint_firmware::sensors::rotor_encoder::{self, RotorEncoder};
use joint_firmware::sensors::thermistor::Thermistor;

/// Name of the board.
pub const NAME: &str = "moteus-r4";
/// Product number, object 1018h:2: "Mot4".
pub const PRODUCT: u32 = 0x4D6F_7434;
/// Code and parameters lie in one bank of flash.
pub const SINGLE_BANK: bool = false;
/// The board's part of a configuration, and the joint that it is until it is commissioned.
pub const CONFIGURATION: BoardConfiguration = default_configuration::MOTEUS_R4;
/// Frequency of the PWM and of the control step, Hz.
pub const CONTROL_HZ: u32 = CONFIGURATION.bridge.rate as u32;
/// Interrupt of the PWM timer's update.
pub const PWM_INTERRUPT: pac::Interrupt = pac::Interrupt::TIM2;
/// Converter whose end of sequence is the control interrupt.
pub const CONTROL_ADC: Adc = pac::ADC2;
/// Address of the flash.
pub const FLASH_START: u32 = 0x0800_0000;
/// Bytes of a bank.
pub const FLASH_BANK: u32 = 256 * 1024;

/// Top of TIM2's counter.
const TOP: u16 = pwm::top(CONTROL_HZ);
/// Greatest duty at which the amplifiers have settled when they are sampled, by the vendor's measurement.
const LARGEST_DUTY: f32 = CONFIGURATION.bridge.duty.1;

/// Thermistor of the bridge.
const BRIDGE_NTC: Thermistor = Thermistor { nominal: 47_000.0, beta: 4_050.0, divider: 10_000.0 };
/// Thermistor of the motor, which the user fits: one like the bridge's is assumed.
const WINDING_NTC: Thermistor = BRIDGE_NTC;

/// TIM2_TRGO as the trigger of injected conversions, the same number for all converters (RM0440, tables 166 and 167).
const TRIGGER: u8 = 2;
/// Polls of the encoder's answer before it counts as lost. A frame takes 3 µs at 5.3 MHz, 510 cycles; a poll takes more
/// than four.
const ENCODER_POLLS: u32 = 200;
/// Clock of the encoder's bus, Hz. A frame at a slower one than its polls wait for would be lost each time.
const ENCODER_CLOCK: u32 = {
    let clock = rotor_encoder::clock::<MoteusR4Encoder>(TIMER_HZ);
    assert!(16 * (TIMER_HZ / clock) <= 4 * ENCODER_POLLS, "a frame of the encoder takes longer than its polls");
    clock
};
/// SPI mode of the encoder.
const ENCODER_MODE: spi::Mode = [spi::MODE_0, spi::MODE_1, spi::MODE_2, spi::MODE_3][MoteusR4Encoder::MODE as usize];
/// Core cycles from the encoder's selection to its clock.
const SELECT_CYCLES: u32 = rotor_encoder::select_cycles::<MoteusR4Encoder>(TIMER_HZ / 1_000_000);

/// embassy's set-up, at 16 MHz.
pub fn chip_configuration() -> Config {
    Config::default()
}

/// 170 MHz from the internal oscillator: the crystal's pins drive LEDs. FDCAN gets the same 170 MHz from PLLQ.
pub fn start_clocks(peripherals: &mut Peripherals) {
    let mut config = rcc::Config::default();
    config.hsi48 = None;
    config.pll = Some(rcc::Pll {
        source: rcc::PllSource::HSI,
        prediv: rcc::PllPreDiv::DIV4,
        mul: rcc::PllMul::MUL85,
        divp: None,
        divq: Some(rcc::PllQDiv::DIV2),
        divr: Some(rcc::PllRDiv::DIV2),
    });
    config.sys = rcc::Sysclk::PLL1_R;
    config.boost = true;
    config.mux.fdcansel = rcc::mux::Fdcansel::PLL1_Q;
    rcc::reinit(config, &mut peripherals.RCC);
}

/// Family and revision, by the pins.
static REVISION: AtomicU8 = AtomicU8::new(0);

/// Sensors of the control interrupt.
pub struct Sensors {
    /// Codes of the currents, as they were when the amplifiers last had power.
    currents: [u16; 3],
    angle: u32,
    /// Answer of the encoder in the last frame.
    answer: Option<u16>,
}

/// Level of a pin with a pull; afterwards it is as after reset.
fn level(pin: embassy_stm32::Peri<'_, impl Pin>, pull: Pull) -> bool {
    let pin = Input::new(pin, pull);
    // A pull of 40 kOhm and whatever hangs at a pin: microseconds.
    cortex_m::asm::delay(100 * 170);
    pin.is_high()
}

/// Reads family and revision of the board; drives no pin.
fn identify(p: &mut Peripherals) -> u8 {
    let pins = Pins {
        pulled_up: [level(p.PB10.reborrow(), Pull::Up), level(p.PB11.reborrow(), Pull::Up)],
        pulled_down: [level(p.PB10.reborrow(), Pull::Down), level(p.PB11.reborrow(), Pull::Down)],
        revision: [
            level(p.PC6.reborrow(), Pull::Up),
            level(p.PA15.reborrow(), Pull::Up),
            level(p.PA10.reborrow(), Pull::Up),
        ],
    };
    pins.code()
}

/// Sets the peripherals up; everything but the PWM counter and the gate driver, which its task sets up, runs
/// afterwards. The bridge stays off. On a board that the program is not for nothing is driven but the CAN bus, which
/// says so.
#[inline(never)]
pub fn start(mut p: Peripherals) -> Result<Parts, StartError> {
    let revision = identify(&mut p);
    REVISION.store(revision, Ordering::Relaxed);
    let known = revision == SUPPORTED;
    let can = super::can::configure(p.FDCAN1, p.PA11, p.PA12);
    let converts = convert();
    let mut parts = Parts {
        sensors: None,
        gate: gate::Parts::Missing(if known { Setup::Converter } else { Setup::WrongBoard }, revision),
        led: Led { pin: known.then(|| Output::new(p.PF0, Level::High, Speed::Low)), lit_when_low: true },
        button: None,
        can,
        flash: p.FLASH,
        watchdog: p.IWDG,
    };
    if !known || converts.is_err() {
        return Ok(parts);
    }
    core::mem::forget(Output::new(p.PC14, Level::Low, Speed::Low));
    core::mem::forget(Output::new(p.PC15, Level::Low, Speed::Low));
    core::mem::forget(Output::new(p.PB7, Level::Low, Speed::Medium));
    core::mem::forget(Input::new(p.PB6, Pull::Up));
    let mut bus = spi::Config::default();
    bus.mode = spi::MODE_1;
    bus.frequency = Hertz(1_000_000);
    bus.miso_pull = Pull::Up;
    let driver = Drv8353 {
        spi: Spi::new_blocking(p.SPI1, p.PA5, p.PA7, p.PA6, bus),
        select: Output::new(p.PC4, Level::High, Speed::Medium),
    };
    parts.gate = gate::Parts::Gate(Gate { driver, enable: Output::new(p.PA3, Level::Low, Speed::Low) });

    // Set up by embassy, used by register in the control interrupt.
    let mut bus = spi::Config::default();
    bus.mode = ENCODER_MODE;
    bus.frequency = Hertz(ENCODER_CLOCK);
    let mut encoder = Spi::new_blocking(p.SPI2, p.PB13, p.PB15, p.PB14, bus);
    core::mem::forget(Output::new(p.PB11, Level::High, Speed::VeryHigh));
    // The first transfer leaves the bus enabled, with frames of 16 bits; its answer is thrown away. An encoder that
    // does not answer is the joint's to find.
    let _ = encoder.blocking_transfer_in_place(&mut [MoteusR4Encoder::READ]);
    core::mem::forget(encoder);
    pac::SPI2.cr1().modify(|w| w.set_spe(true));

    set_up_pwm(p.TIM2, p.PA0, p.PA1, p.PA2);
    parts.sensors = Some(Sensors { currents: [0; 3], angle: 0, answer: None });
    Ok(parts)
}

/// No state: there is no button.
pub const fn button() -> Option<bool> {
    None
}

/// Report of the board on its hardware.
pub fn hardware() -> Hardware {
    Hardware { driver: gate::report(), revision: REVISION.load(Ordering::Relaxed), options: super::options::found() }
}

/// Pins and time base; the conversions start one count before the top.
fn set_up_pwm(
    tim2: embassy_stm32::Peri<'static, embassy_stm32::peripherals::TIM2>,
    a: embassy_stm32::Peri<'static, embassy_stm32::peripherals::PA0>,
    b: embassy_stm32::Peri<'static, embassy_stm32::peripherals::PA1>,
    c: embassy_stm32::Peri<'static, embassy_stm32::peripherals::PA2>,
) {
    let mut driver = SimplePwm::new(
        tim2,
        Some(PwmPin::new(a, OutputType::PushPull)),
        Some(PwmPin::new(b, OutputType::PushPull)),
        Some(PwmPin::new(c, OutputType::PushPull)),
        None,
        Hertz(CONTROL_HZ),
        CountingMode::CenterAlignedUpInterrupts,
    );
    driver.ch1().enable();
    driver.ch2().enable();
    driver.ch3().enable();
    core::mem::forget(driver);
    let tim = pac::TIM2;
    tim.cr1().modify(|w| w.set_cen(false));
    // The driver's period is a count short of the exact one.
    tim.arr().write_value(TOP.into());
    tim.ccmr_output(1).modify(|w| w.set_ocm(1, Ocm::PWM_MODE2));
    tim.ccr(3).write_value((TOP - 1).into());
    for phase in 0..3 {
        tim.ccr(phase).write_value((TOP / 2).into());
    }
    tim.cr2().modify(|w| w.set_mms(Mms::COMPARE_OC4));
    tim.cnt().write_value(0);
    tim.egr().write(|w| w.set_ug(true));
}

/// The three currents at the same instant on three converters. The supply follows: the control interrupt comes at the
/// end of the currents and finds the supply's code of the period before. ADC5 begins with the others and samples until
/// their first conversions are over, so none of its steps disturbs them.
fn convert() -> Result<(), StartError> {
    pac::RCC.ahb2enr().modify(|w| {
        w.set_adc12en(true);
        w.set_adc345en(true);
    });
    for pin in [0, 1, 2, 12] {
        pac::GPIOB.moder().modify(|w| w.set_moder(pin, Moder::ANALOG));
    }
    for pin in [8, 9] {
        pac::GPIOA.moder().modify(|w| w.set_moder(pin, Moder::ANALOG));
    }
    adc::choose_clock(pac::ADC12_COMMON);
    adc::choose_clock(pac::ADC345_COMMON);
    // Dividers and thermistors have up to 10 kOhm: they are sampled for as long as the vendor does.
    let (current, divider) = (SampleTime::CYCLES12_5, SampleTime::CYCLES47_5);
    let arm =
        |adc, channels: &[(u8, SampleTime)], interrupt| Sequence { adc, channels, trigger: TRIGGER, interrupt }.arm();
    arm(pac::ADC1, &[(12, current), (11, divider)], false)?;
    arm(pac::ADC3, &[(12, current)], false)?;
    arm(pac::ADC5, &[(2, divider), (1, divider)], false)?;
    arm(pac::ADC2, &[(12, current)], true)
}

/// Starts the PWM counter, and with it the control interrupt.
pub fn start_pwm() {
    pac::TIM2.dier().modify(|w| w.set_uie(true));
    pac::TIM2.cr1().modify(|w| w.set_cen(true));
}

/// Selects the encoder; the core's cycle counter then.
#[inline(always)]
fn select() -> u32 {
    pac::GPIOB.bsrr().write(|w| w.set_br(11, true));
    DWT::cycle_count()
}

/// Begins a frame with the encoder, which has been selected: the first edge of the clock may come some time after that.
/// The measurements made meanwhile have mostly taken longer; the rest is waited for, a bounded number of times.
#[inline(always)]
fn begin_frame(selected: u32) {
    for _ in 0..SELECT_CYCLES {
        if DWT::cycle_count().wrapping_sub(selected) >= SELECT_CYCLES {
            break;
        }
    }
    pac::SPI2.dr16().write_value(MoteusR4Encoder::READ);
}

/// Ends the frame, which has long been over unless the step was very short; its wait is bounded. The answer, or none
/// where it takes too long.
#[inline(always)]
fn end_frame() -> Option<u16> {
    let spi = pac::SPI2;
    let mut answer = None;
    for _ in 0..ENCODER_POLLS {
        if spi.sr().read().rxne() {
            answer = Some(spi.dr16().read());
            break;
        }
    }
    pac::GPIOB.bsrr().write(|w| w.set_bs(11, true));
    answer
}

impl Sensors {
    /// Counterpart of boards that count an encoder.
    pub fn set_encoder_counts(&mut self, _counts: u32) {}

    /// Measurements known now; temperatures and overrun are filled in by the caller.
    ///
    /// The encoder's angle is the one that the frame of the period before brought, which runs while the control step
    /// does ([`rotor_encoder::age`]). Waiting for a frame of this period would take 600 of the period's 4,250 cycles.
    #[inline(always)]
    pub fn measure(&mut self) -> Measurements {
        let selected = select();
        let analog = &CONFIGURATION.analog;
        // The bridge is off while they have none.
        if gate::amplifies() {
            self.currents = [pac::ADC3, pac::ADC1, pac::ADC2].map(adc::code::<0>);
        }
        let angle = self.answer.take().and_then(MoteusR4Encoder::angle);
        // The last good angle stands in: a jump to zero would be worse for whoever looks at the angle only.
        self.angle = angle.unwrap_or(self.angle);
        let measurements = Measurements {
            phase_currents: analog.currents(self.currents),
            bus_voltage: analog.supply(adc::code::<1>(pac::ADC1)),
            encoder: self.angle,
            encoder_valid: angle.is_some(),
            encoder_referenced: true,
            winding_temperature: f32::NAN,
            bridge_temperature: f32::NAN,
            bridge_fault: gate::is_faulty(),
            overrun: false,
        };
        begin_frame(selected);
        measurements
    }

    /// Takes the encoder's answer at the end of a control interrupt.
    #[inline(always)]
    pub fn complete(&mut self) {
        self.answer = end_frame();
    }
}

/// Temperatures of bridge and winding, °C; NaN where there is no sensor.
pub fn temperatures() -> (f32, f32) {
    let fraction = |code: u16| f32::from(code) / FULL_SCALE;
    let bridge = BRIDGE_NTC.temperature(fraction(adc::code::<0>(pac::ADC5)));
    (bridge, WINDING_NTC.temperature(fraction(adc::code::<1>(pac::ADC5))))
}

/// Sets holding brake and brake chopper.
#[inline(always)]
pub fn set_outputs(outputs: Outputs) {
    // The chopper's pin is the lower one, as its bit is.
    let bits = u32::from(outputs.bits());
    pac::GPIOC.bsrr().write(|w| w.0 = bits << 14 | (bits ^ 0b11) << (14 + 16));
}

/// Sets the bridge: off at once, or switching with the duties held for the next period.
#[inline(always)]
pub fn apply(bridge: &Bridge) {
    pwm::hold(bridge.duties, TOP, LARGEST_DUTY);
    match bridge.state {
        BridgeState::Off => let_go(),
        BridgeState::Switching => pac::GPIOB.bsrr().write(|w| w.set_bs(7, true)),
    }
}

/// Bottom and top of TIM2's counter: writes the duties on the way up. See `pwm`.
#[unsafe(no_mangle)]
#[unsafe(link_section = ".ccm.control")]
extern "C" fn TIM2() {
    let tim = pac::TIM2;
    // Flags clear where a zero is written.
    tim.sr().write(|w| {
        w.0 = u32::MAX;
        w.set_uif(false);
    });
    if tim.cr1().read().dir() == Dir::DOWN {
        return;
    }
    let [a, b, c] = pwm::held();
    tim.cr1().modify(|w| w.set_udis(true));
    tim.ccr(0).write_value(a.into());
    tim.ccr(1).write_value(b.into());
    tim.ccr(2).write_value(c.into());
    tim.cr1().modify(|w| w.set_udis(false));
}

/// Switches all transistors off, now, until [`apply`] says otherwise.
#[inline(always)]
pub fn let_go() {
    // HIZ only: a disabled driver would forget its configuration.
    pac::GPIOB.bsrr().write(|w| w.set_br(7, true));
}

/// Switches all transistors off, now, and disables the gate driver. For fault handlers: needs nothing initialised,
/// takes no lock, cannot fail. The driver has lost its configuration afterwards.
#[inline(always)]
pub fn bridge_off() {
    // Without their clocks the ports ignore this, but then these pins have never been outputs.
    let_go();
    pac::GPIOA.bsrr().write(|w| w.set_br(3, true));
}
