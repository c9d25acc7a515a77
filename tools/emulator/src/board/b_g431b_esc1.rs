//! ST B-G431B-ESC1: pins to plant.
//!
//! Parts by docs/boards.md: shunts of 3 mOhm with 1.5 kOhm to the amplifier's input, 22 kOhm from there to 3.3 V and 2.2 kOhm to ground; supply
//! divided by 169 and 18 kOhm; the bridge's thermistor of 10 kOhm, beta 3425 K, with 4.7 kOhm to ground.

use super::drivetrain::Drivetrain;
use super::electrics::{Ntc, divided, node};
use super::{Inputs, Wired};
use crate::chip::Deviation;
use crate::chip::fdcan::line::{CanLine, Line};
use crate::chip::time::Instant;
use crate::chip::variant::{STM32G431CB, Variant};
use crate::chip::wiring::{Pin, Pwm, Quadrature, SpiFrame, TimerName, Wiring};

/// Counts a turn: 1,000 lines.
const COUNTS: i64 = 4_000;
/// Shunt, Ohm.
const SHUNT: f64 = 3e-3;
const VDD: f64 = 3.3;
const BRIDGE_NTC: Ntc = Ntc { nominal: 10_000.0, beta: 3_425.0 };
/// The amplifiers' inputs by phase, and their negative inputs, which lie at the shunts' ground.
const CURRENTS: [Pin; 3] = [Pin::new('A', 1), Pin::new('A', 7), Pin::new('B', 0)];
const SUPPLY: Pin = Pin::new('A', 0);
const BRIDGE: Pin = Pin::new('B', 14);
const BUTTON: Pin = Pin::new('C', 10);
const LED: Pin = Pin::new('C', 6);

/// The board.
#[derive(Clone, Debug)]
pub struct BG431BEsc1 {
    drivetrain: Drivetrain,
    inputs: Inputs,
    line: Line,
    led: bool,
    /// Counts of the encoder so far, and those at the last call.
    count: i64,
    last_fraction: Option<u32>,
    told: i64,
}

impl BG431BEsc1 {
    /// With a plant behind it.
    pub fn new(drivetrain: Drivetrain) -> Self {
        Self {
            drivetrain,
            inputs: Inputs::default(),
            line: Line::new(1_000_000),
            led: false,
            count: 0,
            last_fraction: None,
            told: 0,
        }
    }

    fn follow_encoder(&mut self, at: Instant) {
        let fraction = self.drivetrain.sample(at).encoder;
        let before = *self.last_fraction.get_or_insert(fraction);
        // Over all turns, 2^32 each; the encoder's own zero is the index.
        let turned = i64::from(fraction.wrapping_sub(before) as i32);
        self.last_fraction = Some(fraction);
        self.count += turned;
    }

    /// The count with the index at its multiples of [`COUNTS`].
    fn quarters(&self) -> i64 {
        let origin = i64::from(self.last_fraction.unwrap_or(0)) - self.count.rem_euclid(1 << 32);
        (i128::from(self.count + origin) * i128::from(COUNTS)).div_euclid(1 << 32) as i64
    }
}

impl Wired for BG431BEsc1 {
    const VARIANT: &'static Variant = &STM32G431CB;
    const NAME: &'static str = "b-g431b-esc1";
    // The bridge is switched off first of all, before TIM1 has a clock: without one it drives nothing.
    const DEVIATIONS: &'static [Deviation] = &[Deviation::WithoutClock { register: 0x4001_2c44 }];

    fn drivetrain(&mut self) -> &mut Drivetrain {
        &mut self.drivetrain
    }

    fn inputs(&mut self) -> &mut Inputs {
        &mut self.inputs
    }

    fn line(&mut self) -> &mut Line {
        &mut self.line
    }

    fn led(&self) -> bool {
        self.led
    }
}

impl Wiring for BG431BEsc1 {
    fn volts(&mut self, at: Instant, pin: Pin) -> f64 {
        let sample = *self.drivetrain.sample(at);
        if let Some(phase) = CURRENTS.iter().position(|current| *current == pin) {
            // The current flows from ground through shunt and low side into the motor.
            let shunt = -SHUNT * sample.phase_currents[phase];
            return node(&[(VDD, 22_000.0), (shunt, 1_500.0), (0.0, 2_200.0)]);
        }
        match pin {
            SUPPLY => divided(sample.bus_voltage, 169_000.0, 18_000.0),
            BRIDGE => BRIDGE_NTC.voltage(sample.bridge_temperature, VDD, 4_700.0),
            _ => 0.0,
        }
    }

    fn level(&mut self, _: Instant, pin: Pin) -> Option<bool> {
        match pin {
            BUTTON => Some(!self.inputs.button),
            _ => None,
        }
    }

    fn driven(&mut self, _: Instant, pin: Pin, level: Option<bool>) {
        if pin == LED {
            self.led = level == Some(true);
        }
    }

    fn quadrature(&mut self, at: Instant, timer: TimerName) -> Quadrature {
        if timer != TimerName::Tim4 {
            return Quadrature::default();
        }
        self.follow_encoder(at);
        let (before, count) = (self.told, self.quarters());
        self.told = count;
        // The pulse rises where a multiple of the turn is reached, whichever way.
        let index = match count.cmp(&before) {
            std::cmp::Ordering::Greater => Some(count.div_euclid(COUNTS) * COUNTS).filter(|index| *index > before),
            std::cmp::Ordering::Less => {
                Some((count + COUNTS - 1).div_euclid(COUNTS) * COUNTS).filter(|index| *index < before)
            }
            std::cmp::Ordering::Equal => None,
        };
        Quadrature { count, index }
    }

    fn pwm(&mut self, at: Instant, pwm: &Pwm) {
        if pwm.timer == TimerName::Tim1 {
            // The gate drivers have no enable: the gates decide.
            self.drivetrain.enable(at, true);
            self.drivetrain.pwm(at, pwm);
        }
    }

    fn spi(&mut self, _: Instant, _: &SpiFrame) -> u16 {
        u16::MAX
    }

    fn can(&mut self) -> Option<&mut dyn CanLine> {
        Some(&mut self.line)
    }
}
