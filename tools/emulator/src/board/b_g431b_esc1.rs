//! ST B-G431B-ESC1: pins to plant.
//!
//! Parts by docs/boards.md: shunts of 3 mOhm with 1.5 kOhm to the amplifier's input, 22 kOhm from there to 3.3 V and
//! 2.2 kOhm to ground; supply divided by 169 and 18 kOhm; the bridge's thermistor of 10 kOhm, beta 3425 K, with 4.7
//! kOhm to ground.

use super::amplifier::Amplifier;
use super::drivetrain::{CYCLE, Drivetrain};
use super::electrics::{Ntc, divided, node, parallel};
use super::{Encoder, Inputs, Wired};
use crate::chip::fdcan::line::{CanLine, Line};
use crate::chip::time::Instant;
use crate::chip::variant::{STM32G431CB, Variant};
use crate::chip::wiring::{Pin, Pwm, Quadrature, SpiFrame, TimerName, Wiring};
use crate::chip::{Chip, Deviation};
use crate::cpu::Cpu;
use crate::parts::drv8353::Drv8353;
use plant::ParameterError;
use std::cmp::Ordering;

/// Counts a turn of the usual encoder: 1,000 lines.
const COUNTS: u32 = 4_000;
/// Shunt, Ohm.
const SHUNT: f64 = 3e-3;
const VDD: f64 = 3.3;
/// Step response of gate driver and amplifier, *derived*: the L6387E takes 110 ns; the chip's operational amplifier has
/// a gain-bandwidth product of at least 7 MHz (13 MHz are typical; DS12589, "Operational amplifiers characteristics",
/// from memory) at a noise gain of 16. Its slew rate of at least 18 V/us passes the whole range in less than half of a
/// time constant. The pole is in the chip; here it acts on the shunt's voltage, which is the same for everything
/// linear.
pub(super) const STEP_RESPONSE: Amplifier = Amplifier::with_bandwidth(110e-9, 7e6, 16.0);
const BRIDGE_NTC: Ntc = Ntc { nominal: 10_000.0, beta: 3_425.0 };
/// The amplifiers' inputs by phase, and their negative inputs, which lie at the shunts' ground.
const CURRENTS: [Pin; 3] = [Pin::new('A', 1), Pin::new('A', 7), Pin::new('B', 0)];
const SUPPLY: Pin = Pin::new('A', 0);
const BRIDGE: Pin = Pin::new('B', 14);
const BUTTON: Pin = Pin::new('C', 10);
const LED: Pin = Pin::new('C', 6);
const BRAKE: Pin = Pin::new('B', 3);

/// The board.
#[derive(Clone, Debug)]
pub struct BG431BEsc1 {
    drivetrain: Drivetrain,
    inputs: Inputs,
    line: Line,
    led: bool,
    lines: Lines,
}

impl BG431BEsc1 {
    /// Board with a plant behind it, and an encoder of 1,000 lines with direction and zero of the plant's.
    pub fn new(drivetrain: Drivetrain) -> Self {
        Self {
            lines: Lines::of(Encoder { counts: COUNTS, ..drivetrain.encoder() }),
            drivetrain,
            inputs: Inputs::default(),
            line: Line::new(1_000_000),
            led: false,
        }
    }
}

impl Wired for BG431BEsc1 {
    const VARIANT: &'static Variant = &STM32G431CB;
    const NAME: &'static str = "b-g431b-esc1";
    const BUTTON: bool = true;
    // The bridge is switched off first of all, before TIM1 has a clock: without one it drives nothing.
    const DEVIATIONS: &'static [Deviation] = &[Deviation::WithoutClock { register: 0x4001_2c44 }];

    fn core(chip: Chip<Self>) -> Cpu<Chip<Self>> {
        Cpu::new(chip)
    }

    fn with_encoder(self, encoder: Encoder) -> Result<Self, ParameterError> {
        encoder.validate()?;
        Ok(Self { lines: Lines::of(encoder), ..self })
    }

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

    fn gate_driver(&mut self) -> Option<&mut Drv8353> {
        None
    }
}

impl Wiring for BG431BEsc1 {
    fn volts(&mut self, at: Instant, pin: Pin) -> f64 {
        if let Some(phase) = CURRENTS.iter().position(|current| *current == pin) {
            // The current flows from ground through shunt and low side into the motor.
            let shunt = -SHUNT * self.drivetrain.phase_current(at, phase, &STEP_RESPONSE);
            return node(&[(VDD, 22_000.0), (shunt, 1_500.0), (0.0, 2_200.0)]);
        }
        let sample = self.drivetrain.sample(at);
        match pin {
            SUPPLY => divided(sample.bus_voltage, 169_000.0, 18_000.0),
            BRIDGE if self.inputs.thermistor_open => 0.0,
            BRIDGE => BRIDGE_NTC.voltage(sample.bridge_temperature, VDD, 4_700.0),
            _ => 0.0,
        }
    }

    fn source_resistance(&mut self, at: Instant, pin: Pin) -> f64 {
        match pin {
            SUPPLY => parallel(169_000.0, 18_000.0),
            BRIDGE if self.inputs.thermistor_open => 4_700.0,
            BRIDGE => BRIDGE_NTC.source(self.drivetrain.sample(at).bridge_temperature, 4_700.0),
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
        match pin {
            LED => self.led = level == Some(true),
            BRAKE => self.drivetrain.set_brake(level == Some(true)),
            _ => {}
        }
    }

    fn quadrature(&mut self, at: Instant, timer: TimerName) -> Quadrature {
        if timer != TimerName::Tim4 {
            return Quadrature::default();
        }
        if self.inputs.encoder_line.is_some() {
            return self.lines.still();
        }
        let rotor = self.drivetrain.sample(at).encoder;
        self.lines.follow(rotor)
    }

    fn pwm(&mut self, at: Instant, pwm: &Pwm) {
        if pwm.timer == TimerName::Tim1 {
            // The gate drivers have no enable: the gates decide.
            self.drivetrain.enable(at, true);
            self.drivetrain.set_dead_time(pwm.dead_time as f64 * CYCLE * 1e-12);
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

/// The incremental encoder: edges of its lines, of an angle that is known within a turn.
#[derive(Clone, Debug)]
struct Lines {
    encoder: Encoder,
    /// Reading over all turns, 2^32 a turn; the index is where it is a multiple of that. Nothing before the first
    /// look.
    angle: Option<i64>,
    /// Counts at the last look.
    count: i64,
}

impl Lines {
    const fn of(encoder: Encoder) -> Self {
        Self { encoder, angle: None, count: 0 }
    }

    /// Unchanged reading, whatever the rotor does.
    const fn still(&self) -> Quadrature {
        Quadrature { count: self.count, index: None }
    }

    /// Follows the rotor to an angle of 2^32 a turn, by the shorter way.
    fn follow(&mut self, rotor: u32) -> Quadrature {
        let fraction = self.encoder.angle(rotor);
        let angle = match self.angle {
            Some(angle) => angle + i64::from(fraction.wrapping_sub(angle as u32) as i32),
            None => i64::from(fraction),
        };
        let counts = i64::from(self.encoder.counts);
        let count = (i128::from(angle) * i128::from(counts)).div_euclid(1 << 32) as i64;
        let before = if self.angle.is_some() { self.count } else { count };
        // The pulse rises where a multiple of the turn is reached, whichever way.
        let index = match count.cmp(&before) {
            Ordering::Greater => Some(count.div_euclid(counts) * counts).filter(|index| *index > before),
            Ordering::Less => Some((count + counts - 1).div_euclid(counts) * counts).filter(|index| *index < before),
            Ordering::Equal => None,
        };
        (self.angle, self.count) = (Some(angle), count);
        Quadrature { count, index }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const USUAL: Encoder = Encoder { counts: COUNTS, reversed: false, offset: 0.0 };

    /// Counts and indices at angles of the rotor, in turns.
    fn follow(encoder: Encoder, turns: &[f64]) -> Vec<(i64, Option<i64>)> {
        let mut lines = Lines::of(encoder);
        let read = turns.iter().map(|turn| lines.follow((turn.rem_euclid(1.0) * 4_294_967_296.0) as u32));
        read.map(|quadrature| (quadrature.count, quadrature.index)).collect()
    }

    #[test]
    fn the_index_is_where_the_turn_begins_and_nowhere_else() {
        let noise = [0.5, 0.515_625, 0.484_375, 0.5];
        assert_eq!(follow(USUAL, &noise), [(2_000, None), (2_062, None), (1_937, None), (2_000, None)]);
        assert_eq!(
            follow(USUAL, &[0.75, 1.0, 1.25, 0.75]),
            [(3_000, None), (4_000, Some(4_000)), (5_000, None), (3_000, Some(4_000))]
        );
        assert_eq!(follow(USUAL, &[0.25, -0.25, -0.5]), [(1_000, None), (-1_000, Some(0)), (-2_000, None)]);
    }

    #[test]
    fn another_encoder_has_its_own_counts_direction_and_place_of_the_index() {
        let encoder = Encoder { counts: 1_024, reversed: true, offset: 0.25 };
        // Its reading is zero at a quarter of a turn forward.
        assert_eq!(follow(encoder, &[0.0, 0.125, 0.375]), [(256, None), (128, None), (-128, Some(0))]);
    }
}
