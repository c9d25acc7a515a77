//! mjbots moteus r4.11: pins to plant.
//!
//! Parts by docs/boards.md: shunts of 0.5 mOhm, amplified in the gate driver around half the reference; supply divided
//! by 100 and 4.7 kOhm; the bridge's thermistor of 47 kOhm, beta 4050 K, with 10 kOhm to ground; no thermistor in the
//! motor.

use super::amplifier::Amplifier;
use super::drivetrain::Drivetrain;
use super::electrics::{Ntc, divided, parallel};
use super::{Encoder, Inputs, Wired};
use crate::chip::fdcan::line::{CanLine, Line};
use crate::chip::time::Instant;
use crate::chip::variant::{STM32G474CE, Variant};
use crate::chip::wiring::{Pin, Pwm, Quadrature, SpiFrame, TimerName, Wiring};
use crate::chip::{Chip, Deviation};
use crate::cpu::Cpu;
use crate::parts::as5047p::As5047p;
use crate::parts::drv8353::Drv8353;
use crate::parts::rotor_encoder::RotorEncoder;
use plant::ParameterError;

/// Encoder that is fitted.
type Rotor = As5047p;
/// Shunt, Ohm.
const SHUNT: f64 = 0.5e-3;
const VDD: f64 = 3.3;
const BRIDGE_NTC: Ntc = Ntc { nominal: 47_000.0, beta: 4_050.0 };
const CURRENTS: [Pin; 3] = [Pin::new('B', 0), Pin::new('B', 1), Pin::new('B', 2)];
const SUPPLY: Pin = Pin::new('B', 12);
const BRIDGE: Pin = Pin::new('A', 9);
const ENABLE: Pin = Pin::new('A', 3);
const HIZ: Pin = Pin::new('B', 7);
const FAULT: Pin = Pin::new('B', 6);
const DRIVER_SELECT: Pin = Pin::new('C', 4);
const ENCODER_SELECT: Pin = Pin::new('B', 11);
const LED: Pin = Pin::new('F', 0);
const BRAKE: Pin = Pin::new('C', 15);
const CHOPPER: Pin = Pin::new('C', 14);
/// Pins that tell the family: floating on an r4.
const FAMILY: [Pin; 2] = [Pin::new('B', 10), Pin::new('B', 11)];
/// Pins that tell the revision: those of its code's ones are pulled low.
const REVISION: [Pin; 3] = [Pin::new('C', 6), Pin::new('A', 15), Pin::new('A', 10)];
/// Code of an r4.11.
const R4_11: u8 = 4;
/// Amplifier control of the gate driver: gain 5, 10, 20, 40 by its bits 7 and 6.
const AMPLIFIERS: usize = 6;
/// Step response at each gain: the settling time to 1 % of the driver's data sheet (SLVSDY6, "Electrical
/// characteristics") begins 500 ns after the edge. Together they are what the board's vendor has measured to be needed
/// at gain 20, and assumes at the others (docs/boards.md).
pub(super) const STEP_RESPONSE: [Amplifier; 4] = [
    Amplifier::settling(500e-9, 250e-9),
    Amplifier::settling(500e-9, 500e-9),
    Amplifier::settling(500e-9, 1_000e-9),
    Amplifier::settling(500e-9, 2_000e-9),
];

/// The board.
#[derive(Clone, Debug)]
pub struct MoteusR4 {
    drivetrain: Drivetrain,
    inputs: Inputs,
    line: Line,
    driver: Drv8353,
    encoder: Rotor,
    magnet: Encoder,
    /// INLA to INLC.
    switched_on: bool,
    led: bool,
    revision: u8,
    /// Levels to which the pins of the family are pulled.
    family: [Option<bool>; 2],
}

impl MoteusR4 {
    /// Board with a plant behind it, whose encoder's direction and zero are those of the magnet.
    pub fn new(drivetrain: Drivetrain) -> Self {
        Self {
            magnet: Encoder { counts: Rotor::COUNTS, ..drivetrain.encoder() },
            drivetrain,
            inputs: Inputs::default(),
            line: Line::new(1_000_000),
            driver: Drv8353::new(),
            encoder: Rotor::default(),
            switched_on: false,
            led: false,
            revision: R4_11,
            family: [None; 2],
        }
    }

    /// The gate driver: its faults, its data line.
    pub const fn driver(&mut self) -> &mut Drv8353 {
        &mut self.driver
    }

    /// Another revision, by the code of its pins, 0 to 7; to be set before the program starts.
    pub const fn set_revision(&mut self, code: u8) {
        self.revision = code;
    }

    /// Another family: what PB10 and PB11 are pulled to; to be set before the program starts.
    pub const fn set_family(&mut self, pulls: [Option<bool>; 2]) {
        self.family = pulls;
    }

    fn enable(&mut self, at: Instant) {
        let volts = self.drivetrain.actuator().state().bus_voltage;
        self.driver.supply(at, volts);
        let enabled = self.switched_on && self.driver.drives(at);
        self.drivetrain.enable(at, enabled);
    }
}

impl Wired for MoteusR4 {
    const VARIANT: &'static Variant = &STM32G474CE;
    const NAME: &'static str = "moteus-r4";
    const BUTTON: bool = false;
    // The bridge is switched off first of all, before the ports have clocks: without them the pins are no outputs.
    const DEVIATIONS: &'static [Deviation] =
        &[Deviation::WithoutClock { register: 0x4800_0418 }, Deviation::WithoutClock { register: 0x4800_0018 }];

    fn core(chip: Chip<Self>) -> Cpu<Chip<Self>> {
        Cpu::new(chip)
    }

    fn with_encoder(self, encoder: Encoder) -> Result<Self, ParameterError> {
        encoder.validate()?;
        encoder.counts_within((Rotor::COUNTS, Rotor::COUNTS))?;
        Ok(Self { magnet: encoder, ..self })
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
        Some(&mut self.driver)
    }
}

impl Wiring for MoteusR4 {
    fn volts(&mut self, at: Instant, pin: Pin) -> f64 {
        if let Some(phase) = CURRENTS.iter().position(|current| *current == pin) {
            if !self.driver.is_awake(at) {
                return 0.0;
            }
            let code = usize::from(self.driver.register(AMPLIFIERS).unwrap_or(0) >> 6 & 3);
            let gain = 5.0 * f64::from(1u32 << code);
            return 0.5 * VDD + gain * SHUNT * self.drivetrain.phase_current(at, phase, &STEP_RESPONSE[code]);
        }
        let sample = self.drivetrain.sample(at);
        match pin {
            SUPPLY => divided(sample.bus_voltage, 100_000.0, 4_700.0),
            BRIDGE if self.inputs.thermistor_open => 0.0,
            BRIDGE => BRIDGE_NTC.voltage(sample.bridge_temperature, VDD, 10_000.0),
            _ => 0.0,
        }
    }

    fn source_resistance(&mut self, at: Instant, pin: Pin) -> f64 {
        match pin {
            SUPPLY => parallel(100_000.0, 4_700.0),
            BRIDGE if self.inputs.thermistor_open => 10_000.0,
            BRIDGE => BRIDGE_NTC.source(self.drivetrain.sample(at).bridge_temperature, 10_000.0),
            _ => 0.0,
        }
    }

    fn level(&mut self, _: Instant, pin: Pin) -> Option<bool> {
        // Open drain: pulled low, or left to the pull-up.
        if pin == FAULT {
            return (self.driver.has_fault() || self.inputs.driver_fault).then_some(false);
        }
        if let Some(place) = FAMILY.iter().position(|of| *of == pin) {
            return self.family[place];
        }
        REVISION.iter().position(|of| *of == pin).filter(|bit| self.revision >> bit & 1 != 0).map(|_| false)
    }

    fn driven(&mut self, at: Instant, pin: Pin, level: Option<bool>) {
        match pin {
            ENABLE => self.driver.enable(at, level == Some(true)),
            HIZ => self.switched_on = level == Some(true),
            DRIVER_SELECT => self.driver.select(level == Some(false)),
            ENCODER_SELECT => {
                let (magnet, drivetrain) = (&self.magnet, &mut self.drivetrain);
                self.encoder.select(level == Some(false), || magnet.nearest(drivetrain.sample(at).encoder));
            }
            // Between the supply and the pin.
            LED => self.led = level == Some(false),
            BRAKE => return self.drivetrain.set_brake(level == Some(true)),
            CHOPPER => return self.drivetrain.set_chopper(level == Some(true)),
            _ => return,
        }
        self.enable(at);
    }

    fn quadrature(&mut self, _: Instant, _: TimerName) -> Quadrature {
        Quadrature::default()
    }

    fn pwm(&mut self, at: Instant, pwm: &Pwm) {
        if pwm.timer == TimerName::Tim2 {
            self.enable(at);
            self.drivetrain.set_dead_time(self.driver.dead_time());
            self.drivetrain.pwm(at, pwm);
        }
    }

    fn spi(&mut self, at: Instant, frame: &SpiFrame) -> u16 {
        let answer = match frame.bus {
            1 => {
                let answer = self.driver.exchange(at, frame);
                self.enable(at);
                answer
            }
            2 => {
                let angle = self.magnet.nearest(self.drivetrain.sample(at).encoder);
                let answer = self.encoder.exchange(frame, angle);
                self.inputs.encoder_line.map(|high| if high { u16::MAX } else { 0 }).or(answer)
            }
            _ => None,
        };
        // Pulled up where nobody drives the line.
        answer.unwrap_or(u16::MAX)
    }

    fn can(&mut self) -> Option<&mut dyn CanLine> {
        Some(&mut self.line)
    }
}
