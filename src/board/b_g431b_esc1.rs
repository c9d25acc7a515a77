//! ST B-G431B-ESC1 (MB1419, STM32G431CBU6): pins, timers, gains and limits.
//!
//! Sources: S = stm32duino variant and pin table; N = apache/nuttx board; F = SimpleFOC's current sense for this board;
//! O = oxifoc hardware notes; R = Recoil .ioc; K = FOC-Stim board package. The pin functions agree with the chip
//! database that embassy is generated from. **Nothing here has run on a board.** Marked facts:
//! - *derived*: computed from parts that a source names;
//! - *unconfirmed*: one source, or sources that contradict each other. Measure before relying on it.
//!
//! | function | pin, peripheral | source |
//! |---|---|---|
//! | U high, low | PA8 TIM1_CH1, PC13 TIM1_CH1N | S N O R |
//! | V high, low | PA9 TIM1_CH2, PA12 TIM1_CH2N | S N O R |
//! | W high, low | PA10 TIM1_CH3, PB15 TIM1_CH3N | S N O R |
//! | current U | OPAMP1: PA1, bias PA3, to ADC1_IN13 | S N F O |
//! | current V | OPAMP2: PA7, bias PA5, to ADC2_IN16 | S N F O |
//! | current W | OPAMP3: PB0, bias PB2, to ADC2_IN18 | S N F O |
//! | supply | PA0 ADC1_IN1 | N K R |
//! | bridge NTC | PB14 ADC1_IN5 (network unconfirmed) | K O |
//! | encoder A, B, index | PB6, PB7, PB8: TIM4_CH1, 2, 3 | S N R |
//! | CAN receive, transmit | PA11, PB9: FDCAN1 | S N O |
//! | CAN shutdown | PC11, low runs (O contradicts: unconfirmed) | S N |
//! | CAN termination | PC14, high is 120 Ohm on | S N O |
//! | button | PC10, low when pressed | S O R |
//! | holding brake | PB3 (on the programmer's part the receiver of its serial port); high opens it. For the input of a driver with a pull-down: it floats until the program starts | S N |
//! | LED | PC6, lit when high (polarity unconfirmed) | S O R |
//!
//! The board has no usable over-current comparator (the comparators see 1.71 mV/A), so over-current is the joint's
//! software check in every control step. TIM1's break input takes the chip's own alarms: core lock-up and SRAM parity.

use super::adc::{self, FULL_SCALE, Sequence};
use super::pwm::{self, TIMER_HZ};
use super::{Led, Parts, Peripherals, StartError};
use embassy_stm32::Config;
use embassy_stm32::gpio::{Input, Level, Output, OutputType, Pull, Speed};
use embassy_stm32::opamp::{OpAmp, OpAmpGain, OpAmpSpeed};
use embassy_stm32::pac;
use embassy_stm32::pac::adc::Adc;
use embassy_stm32::pac::adc::vals::SampleTime;
use embassy_stm32::pac::timer::vals::{Dir, FilterValue, Mms2, Ocm};
use embassy_stm32::rcc;
use embassy_stm32::time::Hertz;
use embassy_stm32::timer::Channel;
use embassy_stm32::timer::complementary_pwm::{BreakInputPolarity, ComplementaryPwm, ComplementaryPwmPin, Ossi, Ossr};
use embassy_stm32::timer::low_level::CountingMode;
use embassy_stm32::timer::qei;
use embassy_stm32::timer::simple_pwm::PwmPin;
use joint_firmware::default_configuration::{self, BoardConfiguration};
use joint_firmware::hardware::Hardware;
use joint_firmware::joint::{Bridge, BridgeState, Measurements, Outputs};
use joint_firmware::sensors::incremental::Incremental;
use joint_firmware::sensors::thermistor::Thermistor;

/// Name of the board.
pub const NAME: &str = "b-g431b-esc1";
/// Product number, object 1018h:2: "ESC1".
pub const PRODUCT: u32 = 0x4553_4331;
/// Code and parameters lie in one bank of flash.
pub const SINGLE_BANK: bool = true;
/// The board's part of a configuration, and the joint that it is until it is commissioned.
pub const CONFIGURATION: BoardConfiguration = default_configuration::B_G431B_ESC1;
/// Frequency of the PWM and of the control step, Hz.
pub const CONTROL_HZ: u32 = CONFIGURATION.bridge.rate as u32;
/// Interrupt of the PWM timer's update.
pub const PWM_INTERRUPT: pac::Interrupt = pac::Interrupt::TIM1_UP_TIM16;
/// Converter whose end of sequence is the control interrupt.
pub const CONTROL_ADC: Adc = pac::ADC2;
/// Address of the flash, and bytes of its only bank.
pub const FLASH_START: u32 = 0x0800_0000;
/// Bytes of a bank.
pub const FLASH_BANK: u32 = 128 * 1024;

/// Top of TIM1's counter.
const TOP: u16 = pwm::top(CONTROL_HZ);
/// Dead time, ns. Other firmware for this board uses 300 (K), 500 (N) and 800 to 847 (O, ST's kit). The longest is
/// taken: too long a dead time distorts the voltage, which the joint compensates; too short a one shorts the supply.
/// 1.6 % of a half period.
const DEAD_TIME_NS: u32 = (CONFIGURATION.bridge.dead_time * 1e9 + 0.5) as u32;
/// Greatest duty at which the amplifiers have settled when they are sampled; their settling time is derived.
const LARGEST_DUTY: f32 = CONFIGURATION.bridge.duty.1;

/// Thermistor of the bridge (K, O; the network is unconfirmed).
const BRIDGE_NTC: Thermistor = Thermistor { nominal: 10_000.0, beta: 3_425.0, divider: 4_700.0 };

/// TIM1_TRGO2 as the trigger of injected conversions of ADC1 and ADC2 (RM0440, table 166).
const TRIGGER: u8 = 8;

/// embassy's set-up, at 16 MHz.
pub fn chip_configuration() -> Config {
    let mut config = Config::default();
    // The bus' clock, whatever it is: embassy's driver reads it and uses it for nothing that is used here.
    config.rcc.mux.fdcansel = rcc::mux::Fdcansel::PCLK1;
    // USB-C's pull-downs would load the encoder's A line (PB6); this is the default, said because it matters here.
    config.enable_ucpd1_dead_battery = false;
    config
}

/// 170 MHz from the internal oscillator: whether a crystal is fitted, sources do not agree. All buses, the timers and
/// FDCAN get them.
///
/// Written here, because embassy's set-up of clocks, which is not a constant where it is called twice, takes 2 KB of
/// flash. **embassy goes on believing in 16 MHz.** Of this board's drivers three ask for a frequency: that of time,
/// whose prescaler is set anew here; that of the PWM, whose prescaler is none at either frequency and whose period this
/// file sets ([`set_up_bridge`]); that of FDCAN, which needs it for nothing but bit timings that it computes, and
/// ours is said (`can::BIT_TIMING`).
pub fn start_clocks(_peripherals: &mut Peripherals) {
    use pac::flash::vals::Latency;
    use pac::rcc::vals::{Hpre, Pllm, Plln, Pllr, Pllsrc, Sw};

    let (clocks, flash) = (pac::RCC, pac::FLASH);
    clocks.pllcfgr().write(|w| {
        w.set_pllsrc(Pllsrc::HSI);
        w.set_pllm(Pllm::DIV4);
        w.set_plln(Plln::MUL85);
        w.set_pllr(Pllr::DIV2);
        w.set_pllren(true);
    });
    clocks.cr().modify(|w| w.set_pllon(true));
    while !clocks.cr().read().pllrdy() {}
    flash.acr().modify(|w| w.set_latency(Latency::WS4));
    while flash.acr().read().latency() != Latency::WS4 {}
    // Half of it for at least a microsecond (6.1.5).
    clocks.cfgr().modify(|w| {
        w.set_hpre(Hpre::DIV2);
        w.set_sw(Sw::PLL1_R);
    });
    while clocks.cfgr().read().sws() != Sw::PLL1_R {}
    cortex_m::asm::delay(TIMER_HZ / 1_000_000);
    clocks.cfgr().modify(|w| w.set_hpre(Hpre::DIV1));

    let time = pac::TIM15;
    time.psc().write_value((TIMER_HZ / 1_000_000 - 1) as u16);
    // The update that takes it, and no more: it is no overflow.
    time.cr1().modify(|w| w.set_urs(pac::timer::vals::Urs::COUNTER_ONLY));
    time.egr().write(|w| w.set_ug(true));
    time.cr1().modify(|w| w.set_urs(pac::timer::vals::Urs::ANY_EVENT));
}

/// The encoder until a configuration says what it counts.
const ENCODER: Incremental = match Incremental::new(CONFIGURATION.joint.motor.encoder_counts as u16) {
    Some(encoder) => encoder,
    None => panic!("no incremental encoder has so few counts"),
};

/// Sensors of the control interrupt.
pub struct Sensors {
    encoder: Incremental,
    counts_kept: bool,
}

/// Sets the peripherals up; everything but the PWM counter runs afterwards. The bridge stays off.
#[inline(never)]
pub fn start(p: Peripherals) -> Result<Parts, StartError> {
    set_up_bridge(p.TIM1, (p.PA8, p.PC13), (p.PA9, p.PA12), (p.PA10, p.PB15));

    // The amplifiers stay on: dropping an output would switch its amplifier off.
    let (mut u, mut v, mut w) = (
        OpAmp::new(p.OPAMP1, OpAmpSpeed::HighSpeed),
        OpAmp::new(p.OPAMP2, OpAmpSpeed::HighSpeed),
        OpAmp::new(p.OPAMP3, OpAmpSpeed::HighSpeed),
    );
    core::mem::forget(u.pga_biased_int(p.PA1, p.PA3, OpAmpGain::Mul16));
    core::mem::forget(v.pga_biased_int(p.PA7, p.PA5, OpAmpGain::Mul16));
    core::mem::forget(w.pga_biased_int(p.PB0, p.PB2, OpAmpGain::Mul16));
    convert()?;

    let counter = qei::Config {
        ch1_pull: Pull::None,
        ch2_pull: Pull::None,
        mode: qei::QeiMode::Mode3,
        auto_reload: ENCODER.counts_per_turn() - 1,
    };
    core::mem::forget(qei::Qei::new(p.TIM4, p.PB6, p.PB7, counter));
    capture_index(p.PB8);

    // Termination stays as the person who wired the bus wants it: off until a configuration says otherwise.
    core::mem::forget(Output::new(p.PC14, Level::Low, Speed::Low));
    core::mem::forget(Output::new(p.PC11, Level::Low, Speed::Low));
    core::mem::forget(Output::new(p.PB3, Level::Low, Speed::Low));
    Ok(Parts {
        sensors: Some(Sensors { encoder: ENCODER, counts_kept: true }),
        led: Led { pin: Some(Output::new(p.PC6, Level::Low, Speed::Low)), lit_when_low: false },
        button: Some(Input::new(p.PC10, Pull::Up)),
        can: super::can::configure(p.FDCAN1, p.PA11, p.PB9),
        flash: p.FLASH,
        watchdog: p.IWDG,
    })
}

type Pair<'a, H, L> = (embassy_stm32::Peri<'a, H>, embassy_stm32::Peri<'a, L>);

/// Pins, time base, dead time and the instant of sampling. Outputs stay off: the driver enables them for an instant,
/// with every channel still disabled.
fn set_up_bridge(
    tim1: embassy_stm32::Peri<'static, embassy_stm32::peripherals::TIM1>,
    u: Pair<'static, embassy_stm32::peripherals::PA8, embassy_stm32::peripherals::PC13>,
    v: Pair<'static, embassy_stm32::peripherals::PA9, embassy_stm32::peripherals::PA12>,
    w: Pair<'static, embassy_stm32::peripherals::PA10, embassy_stm32::peripherals::PB15>,
) {
    let mut driver = ComplementaryPwm::new(
        tim1,
        Some(PwmPin::new(u.0, OutputType::PushPull)),
        Some(ComplementaryPwmPin::new(u.1, OutputType::PushPull)),
        Some(PwmPin::new(v.0, OutputType::PushPull)),
        Some(ComplementaryPwmPin::new(v.1, OutputType::PushPull)),
        Some(PwmPin::new(w.0, OutputType::PushPull)),
        Some(ComplementaryPwmPin::new(w.1, OutputType::PushPull)),
        None,
        None,
        Hertz(CONTROL_HZ),
        CountingMode::CenterAlignedUpInterrupts,
    );
    driver.set_master_output_enable(false);
    // With the outputs off the pins are driven low, which is off for the gate driver; not left floating.
    driver.set_off_state_selection_idle(Ossi::IDLE_LEVEL);
    driver.set_off_state_selection_run(Ossr::IDLE_LEVEL);
    driver.set_dead_time((u64::from(DEAD_TIME_NS) * TIMER_HZ as u64).div_ceil(1_000_000_000) as u16);
    // A break stays until the next switching on; nothing switches on by itself.
    driver.set_automatic_output_enable(false);
    // No pin breaks. The pin's input is enabled after reset and reads low, which the reset polarity takes for a break.
    driver.set_break_input_pin_enable(false);
    driver.set_break_polarity(BreakInputPolarity::ACTIVE_HIGH);
    driver.set_break_enable(true);
    pac::SYSCFG.cfgr2().modify(|w| {
        w.set_cll(true);
        w.set_spl(true);
    });
    driver.set_mms2(Mms2::COMPARE_OC4);
    for channel in [Channel::Ch1, Channel::Ch2, Channel::Ch3] {
        driver.enable(channel);
    }
    let tim = pac::TIM1;
    tim.cr1().modify(|w| w.set_cen(false));
    // A debugger that holds the core also stops the counter and, for this timer, switches the outputs off.
    pac::DBGMCU.apb2fzr().modify(|w| w.set_tim1(true));
    // The driver's period is a count short of the exact one.
    tim.arr().write(|w| w.set_arr(TOP));
    // Channel 4 has no pin: it rises one count before the top and starts the conversions.
    tim.ccmr_output(1).modify(|w| w.set_ocm(1, Ocm::PWM_MODE2));
    tim.ccr(3).write(|w| w.set_ccr(TOP - 1));
    for phase in 0..3 {
        tim.ccr(phase).write(|w| w.set_ccr(TOP / 2));
    }
    tim.cnt().write(|w| w.set_cnt(0));
    tim.egr().write(|w| w.set_ug(true));
    core::mem::forget(driver);
}

/// Currents U on ADC1, V and W on ADC2, at the same instant but for W, one conversion (0.6 µs) later. ADC1 goes on with
/// the supply and the thermistor; the control interrupt comes after W and so finds theirs of the period before.
fn convert() -> Result<(), StartError> {
    pac::RCC.ahb2enr().modify(|w| w.set_adc12en(true));
    pac::GPIOA.moder().modify(|w| w.set_moder(0, pac::gpio::vals::Moder::ANALOG));
    pac::GPIOB.moder().modify(|w| w.set_moder(14, pac::gpio::vals::Moder::ANALOG));
    adc::choose_clock(pac::ADC12_COMMON);
    // The dividers' resistances are high and what buffers them is unconfirmed: a longer sampling time.
    let (current, divider) = (SampleTime::CYCLES12_5, SampleTime::CYCLES47_5);
    Sequence {
        adc: pac::ADC1,
        channels: &[(13, current), (1, divider), (5, divider)],
        trigger: TRIGGER,
        interrupt: false,
    }
    .arm()?;
    Sequence { adc: pac::ADC2, channels: &[(16, current), (18, current)], trigger: TRIGGER, interrupt: true }.arm()
}

/// The index pulse captures TIM4's counter. embassy's counter driver knows A and B only.
fn capture_index(_pin: embassy_stm32::Peri<'static, embassy_stm32::peripherals::PB8>) {
    // Alternate function 2 is TIM4_CH3.
    let block = pac::GPIOB;
    block.afr(1).modify(|w| w.set_afr(0, 2));
    block.moder().modify(|w| w.set_moder(8, pac::gpio::vals::Moder::ALTERNATE));

    let tim = pac::TIM4;
    tim.ccmr_input(1).modify(|w| {
        w.set_ccs(0, pac::timer::vals::CcmrInputCcs::TI4);
        w.set_icf(0, FilterValue::FCK_INT_N8);
    });
    // A motor is near: eight equal samples, 47 ns, before an edge counts.
    tim.ccmr_input(0).modify(|w| {
        w.set_icf(0, FilterValue::FCK_INT_N8);
        w.set_icf(1, FilterValue::FCK_INT_N8);
    });
    tim.ccer().modify(|w| w.set_cce(2, true));
}

/// Starts the PWM counter, and with it the control interrupt.
pub fn start_pwm() {
    pac::TIM1.dier().modify(|w| w.set_uie(true));
    pac::TIM1.cr1().modify(|w| w.set_cen(true));
}

impl Sensors {
    /// Sets the counts a turn of the encoder, which a checked configuration has; before the control interrupt starts.
    pub fn set_encoder_counts(&mut self, counts: u32) {
        if let Some(encoder) = Incremental::new(counts as u16) {
            self.encoder = encoder;
            pac::TIM4.arr().write(|w| w.set_arr(encoder.counts_per_turn() - 1));
        }
    }

    /// Measurements known now; temperatures and overrun are filled in by the caller.
    #[inline(always)]
    pub fn measure(&mut self) -> Measurements {
        let tim = pac::TIM4;
        let count = tim.cnt().read().cnt();
        if tim.sr().read().ccif(2) {
            // Reading the captured count clears the flag.
            self.counts_kept = self.encoder.index(tim.ccr(2).read().ccr());
        }
        let analog = &CONFIGURATION.analog;
        Measurements {
            phase_currents: analog.currents([
                adc::code::<0>(pac::ADC1),
                adc::code::<0>(pac::ADC2),
                adc::code::<1>(pac::ADC2),
            ]),
            bus_voltage: analog.supply(adc::code::<1>(pac::ADC1)),
            encoder: self.encoder.angle(count),
            encoder_valid: self.counts_kept,
            encoder_referenced: self.encoder.is_referenced(),
            winding_temperature: f32::NAN,
            bridge_temperature: f32::NAN,
            // A break has switched the outputs off.
            bridge_fault: tim1_broke(),
            overrun: false,
        }
    }

    /// Ends a control interrupt: nothing of this board's sensors is under way.
    #[inline(always)]
    pub fn complete(&mut self) {}
}

/// Returns `true` if one of the chip's alarms has switched the outputs off.
#[inline(always)]
fn tim1_broke() -> bool {
    pac::TIM1.sr().read().sbif()
}

/// Temperatures of bridge and winding, °C; NaN where the board has no sensor.
pub fn temperatures() -> (f32, f32) {
    (BRIDGE_NTC.temperature(f32::from(adc::code::<2>(pac::ADC1)) / FULL_SCALE), f32::NAN)
}

/// Sets the holding brake; there is no chopper.
#[inline(always)]
pub fn set_outputs(outputs: Outputs) {
    pac::GPIOB.bsrr().write(|w| w.0 = if outputs.brake_open() { 1 << 3 } else { 1 << (3 + 16) });
}

/// Sets the bridge: off at once, or switching with the duties held for the next period.
#[inline(always)]
pub fn apply(bridge: &Bridge) {
    pwm::hold(bridge.duties, TOP, LARGEST_DUTY);
    let tim = pac::TIM1;
    match bridge.state {
        BridgeState::Off => bridge_off(),
        BridgeState::Switching if !tim.bdtr().read().moe() => tim.bdtr().modify(|w| w.set_moe(true)),
        BridgeState::Switching => {}
    }
}

/// Bottom and top of TIM1's counter: writes the duties on the way up. See `pwm`.
#[unsafe(no_mangle)]
#[unsafe(link_section = ".ccm.control")]
extern "C" fn TIM1_UP_TIM16() {
    let tim = pac::TIM1;
    // Flags clear where a zero is written.
    tim.sr().write(|w| {
        w.0 = u32::MAX;
        w.set_uif(false);
    });
    if tim.cr1().read().dir() == Dir::DOWN {
        return;
    }
    let [u, v, w] = pwm::held();
    tim.cr1().modify(|w| w.set_udis(true));
    tim.ccr(0).write(|register| register.set_ccr(u));
    tim.ccr(1).write(|register| register.set_ccr(v));
    tim.ccr(2).write(|register| register.set_ccr(w));
    tim.cr1().modify(|w| w.set_udis(false));
}

/// Returns `true` if the joint may start: nothing of this board has to get ready first.
#[inline(always)]
pub const fn is_started() -> bool {
    true
}

/// A fault reset waits for the gate driver: here there is none to be cleared.
#[inline(always)]
pub const fn ask_reset(_waits: bool) {}

/// State of the button, `true` while pressed, which says that somebody is at the joint; it stops the bridge, too.
pub fn button() -> Option<bool> {
    Some(pac::GPIOC.idr().read().idr(10) == pac::gpio::vals::Idr::LOW)
}

/// Report of the board on its hardware.
pub fn hardware() -> Hardware {
    Hardware { options: super::options::found(), ..Hardware::default() }
}

/// Switches all transistors off, now. For fault handlers too: needs nothing initialised, takes no lock, cannot fail.
#[inline(always)]
pub fn bridge_off() {
    // Without its clock the timer ignores this, but then its outputs have never been on.
    pac::TIM1.bdtr().modify(|w| w.set_moe(false));
}

/// Switches all transistors off, now, until [`apply`] says otherwise: here there is nothing that more would switch off.
#[inline(always)]
pub fn let_go() {
    bridge_off();
}
