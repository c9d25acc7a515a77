//! ADC: RM0440, chapter 21. Power, calibration, and injected sequences that a timer starts.
//!
//! Not modelled, and refused: regular conversions, the asynchronous clock, the queue of contexts, differential inputs,
//! oversampling, offsets, watchdogs, dual modes, resolutions below 12 bits, injected sequences started by software.
//!
//! Times: the regulator needs 20 µs, a calibration 116 clocks (DS12288, "ADC characteristics"), a conversion the
//! sampling time and 12.5 clocks (21.4.16). From the trigger to the beginning of the sampling pass 3, 3.25 or 3.125
//! clocks at a clock divided by 1, 2 or 4 (DS12288, trigger conversion latency of injected channels; from memory,
//! unconfirmed), here rounded up to a cycle of the core. While it samples, a converter's capacitor of 5 pF charges from
//! what it held before through a switch of 1 kOhm and the source's resistance (DS12288, "ADC characteristics", from
//! memory); otherwise the converters are ideal but for their 12 bits.

use super::register::{Block, Register, register};
use super::time::{Instant, Moment};
use super::variant::{ConverterDescription, Input};
use crate::bus::Refusal;

const ISR: u32 = 0x00;
const IER: u32 = 0x04;
const CR: u32 = 0x08;
const CFGR: u32 = 0x0c;
const SMPR1: u32 = 0x14;
const SMPR2: u32 = 0x18;
const JSQR: u32 = 0x4c;
const JDR1: u32 = 0x80;
/// Common control, in the group's own registers.
const CCR: u32 = 0x08;

const ADRDY: u32 = 1 << 0;
const JEOC: u32 = 1 << 5;
const JEOS: u32 = 1 << 6;

const ADEN: u32 = 1 << 0;
const ADDIS: u32 = 1 << 1;
const JADSTART: u32 = 1 << 3;
const JADSTP: u32 = 1 << 5;
const ADVREGEN: u32 = 1 << 28;
const DEEPPWD: u32 = 1 << 29;
const ADCAL: u32 = 1 << 31;

const JQDIS: u32 = 1 << 31;

/// CR: regular conversions, and calibration of differential inputs. CFGR: everything but the queue's switch. DIFSEL:
/// differential inputs.
const REGISTERS: &[Register] = &[
    register(ISR, "ISR", 0, 0, 0),
    register(IER, "IER", 0, 0x0000_07ff, 0x0000_079e),
    register(CR, "CR", DEEPPWD, ADVREGEN | DEEPPWD, 0x4000_0014),
    register(CFGR, "CFGR", JQDIS, JQDIS, 0x7fff_ffff),
    register(0x10, "CFGR2", 0, 0, u32::MAX),
    register(SMPR1, "SMPR1", 0, 0x3fff_ffff, 0x8000_0000),
    register(SMPR2, "SMPR2", 0, 0x07ff_ffff, 0),
    register(JSQR, "JSQR", 0, 0xfbef_bfff, 0),
    register(JDR1, "JDR1", 0, 0, 0),
    register(0x84, "JDR2", 0, 0, 0),
    register(0x88, "JDR3", 0, 0, 0),
    register(0x8c, "JDR4", 0, 0, 0),
    register(0xb0, "DIFSEL", 0, 0, u32::MAX),
];
/// CCR: dual modes, DMA, internal sources. CSR is not modelled.
const COMMON: &[Register] = &[register(CCR, "CCR", 0, 0x003f_0000, 0x01c0_ef1f)];

const REGULATOR_NS: u64 = 20_000;
const CALIBRATION_CLOCKS: u64 = 116;
/// ADEN may follow a calibration after four clocks (21.4.8).
const AFTER_CALIBRATION_CLOCKS: u64 = 4;
/// Twice the sampling times, in clocks (21.6.5).
const TWICE_SAMPLING: [u64; 8] = [5, 13, 25, 49, 95, 185, 495, 1281];

/// Sampling capacitor, F, and its switch, Ohm.
const CAPACITOR: f64 = 5e-12;
const SWITCH: f64 = 1e3;

/// Source that a converter samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Source {
    /// Its voltage without load, V.
    pub volts: f64,
    /// Its resistance, Ohm.
    pub resistance: f64,
}

/// Triggers of injected sequences that are modelled: number in JEXTSEL, the same for all converters (tables 166 and
/// 167).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trigger {
    /// TIM1_TRGO.
    Tim1 = 0,
    /// TIM2_TRGO.
    Tim2 = 2,
    /// TIM1_TRGO2.
    Tim1Second = 8,
}

/// Work that is due in a converter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Due {
    /// The sample of this channel is held: tell the converter with [`Converter::hold`].
    Sample(Input),
    /// A conversion ended.
    End,
}

#[derive(Clone, Copy, Debug)]
struct Conversion {
    rank: u32,
    /// Cycle at which its sample is held; none once it is.
    sample: Option<u64>,
    /// Time for which it is sampled, in cycles of the core.
    sampling: u64,
    end: u64,
    code: u32,
}

/// A converter.
#[derive(Clone, Debug)]
pub struct Converter {
    description: &'static ConverterDescription,
    block: Block,
    regulator: Instant,
    calibrated: u64,
    /// Cycle at which ADRDY is set; none where it will not be.
    ready: Option<u64>,
    conversion: Option<Conversion>,
    /// Voltage of the sampling capacitor.
    held: f64,
}

impl Converter {
    /// State after reset.
    pub fn new(description: &'static ConverterDescription) -> Self {
        let block = Block::new(description.text, "21.6", REGISTERS);
        Self { description, block, regulator: Instant::NEVER, calibrated: 0, ready: None, conversion: None, held: 0.0 }
    }

    /// Back to reset.
    pub fn reset(&mut self) {
        *self = Self::new(self.description);
    }

    /// Its description.
    pub const fn description(&self) -> &'static ConverterDescription {
        self.description
    }

    /// Cycle at which something next happens.
    #[inline]
    pub fn next(&self) -> u64 {
        let conversion = self.conversion.map_or(u64::MAX, |conversion| conversion.sample.unwrap_or(conversion.end));
        self.ready.unwrap_or(u64::MAX).min(conversion)
    }

    /// Work that is due at a cycle, once; none where nothing is.
    pub fn advance(&mut self, cycle: u64, divider: u64) -> Option<Due> {
        if self.ready.is_some_and(|ready| ready <= cycle) {
            self.ready = None;
            self.flag(ADRDY);
        }
        let conversion = self.conversion?;
        if let Some(sample) = conversion.sample {
            return (sample <= cycle).then(|| Due::Sample(self.input(conversion.rank)));
        }
        if conversion.end > cycle {
            return None;
        }
        self.block.set(JDR1 + 4 * conversion.rank, conversion.code);
        let last = conversion.rank == self.block.get(JSQR) & 3;
        self.flag(if last { JEOC | JEOS } else { JEOC });
        self.conversion = if last { None } else { Some(self.begin(conversion.rank + 1, conversion.end, divider)) };
        Some(Due::End)
    }

    /// The value of the sample, of 4096 for the reference; `frequency` is that of the core, Hz.
    pub fn hold(&mut self, source: Source, reference: f64, frequency: u64) {
        if let Some(conversion) = &mut self.conversion {
            conversion.sample = None;
            let constants = conversion.sampling as f64 / frequency as f64 / ((source.resistance + SWITCH) * CAPACITOR);
            self.held = source.volts + (self.held - source.volts) * (-constants).exp();
            conversion.code = (self.held / reference * 4096.0).clamp(0.0, 4095.0) as u32;
        }
    }

    fn flag(&mut self, flags: u32) {
        self.block.set(ISR, self.block.get(ISR) | flags);
    }

    fn channel(&self, rank: u32) -> u32 {
        self.block.get(JSQR) >> (9 + 6 * rank) & 0x1f
    }

    /// Input that a rank measures. `start` has refused channels that are not there.
    fn input(&self, rank: u32) -> Input {
        let channel = self.channel(rank);
        let found = self.description.channels.iter().find(|(number, _)| u32::from(*number) == channel);
        found.map_or(Input::Amplifier(0), |(_, input)| *input)
    }

    fn begin(&self, rank: u32, start: u64, divider: u64) -> Conversion {
        let channel = self.channel(rank);
        let (register, place) = if channel < 10 { (SMPR1, channel) } else { (SMPR2, channel - 10) };
        let twice = TWICE_SAMPLING[(self.block.get(register) >> (3 * place) & 7) as usize];
        let sampling = (twice * divider).div_ceil(2);
        let end = start + (twice + 25) / 2 * divider;
        Conversion { rank, sample: Some(start + sampling), sampling, end, code: 0 }
    }

    /// A trigger's edge: starts an armed sequence, unless one is under way (21.4.19).
    pub fn trigger(&mut self, trigger: Trigger, cycle: u64, divider: u64) {
        let armed = self.block.get(CR) & JADSTART != 0 && self.block.get(JSQR) >> 2 & 0x1f == trigger as u32;
        // JEXTEN: the rising edge, or both.
        if armed && self.block.get(JSQR) >> 7 & 1 != 0 && self.conversion.is_none() {
            let latency = match divider {
                1 => 3,
                2 => 7,
                _ => 13,
            };
            self.conversion = Some(self.begin(0, cycle + latency, divider));
        }
    }

    /// Level of the interrupt.
    #[inline]
    pub fn interrupts(&self) -> bool {
        self.block.get(ISR) & self.block.get(IER) != 0
    }

    /// Returns `true` if the common clock may change: everything is off (21.7.2).
    pub fn is_off(&self, cycle: u64) -> bool {
        self.block.get(CR) & ADEN == 0 && cycle >= self.calibrated
    }

    /// A load by the core.
    pub fn read(&self, offset: u32, at: Moment) -> Result<u32, Refusal> {
        let value = self.block.read(offset)?;
        Ok(if offset == CR && at.cycle < self.calibrated { value | ADCAL } else { value })
    }

    /// A store by the core. `inputs` tells of a channel's input whether it can be measured, or why not.
    pub fn write(
        &mut self,
        offset: u32,
        value: u32,
        at: Moment,
        divider: Option<u64>,
        inputs: impl Fn(Input) -> Result<(), String>,
    ) -> Result<(), Refusal> {
        match offset {
            ISR => self.block.set(ISR, self.block.get(ISR) & !value),
            CR => return self.control(value, at, divider, inputs),
            JSQR | SMPR1 | SMPR2 | CFGR if self.block.get(CR) & JADSTART != 0 => {
                return Err(self.block.forbid(offset, "it is written while a sequence is armed"));
            }
            _ => {
                self.block.write(offset, value)?;
            }
        }
        Ok(())
    }

    /// CR: what is set stays set until the converter clears it (21.6.3).
    fn control(
        &mut self,
        value: u32,
        at: Moment,
        divider: Option<u64>,
        inputs: impl Fn(Input) -> Result<(), String>,
    ) -> Result<(), Refusal> {
        let before = self.block.get(CR);
        let asked = value & !before;
        let forbid = |what: &str| Err(self.block.forbid(CR, what));
        let powered = before & (ADVREGEN | DEEPPWD) == ADVREGEN && at.instant() >= self.regulator;
        let calibrating = at.cycle < self.calibrated;
        let Some(clocks) = divider else {
            return Err(self.block.refuse(CR, "a converter on the asynchronous clock"));
        };
        if value & ADCAL != 0 && !calibrating && (!powered || before & ADEN != 0) {
            return forbid("a calibration without the regulator for 20 µs, or of an enabled converter (21.4.8)");
        }
        if asked & ADEN != 0 {
            let early = at.cycle < self.calibrated + AFTER_CALIBRATION_CLOCKS * clocks;
            if !powered || early {
                return forbid(
                    "an enable without the regulator for 20 µs, or less than four clocks after a calibration",
                );
            }
        }
        if asked & JADSTART != 0 {
            if before & ADEN == 0 || self.block.get(ISR) & ADRDY == 0 && self.ready.is_some() {
                return forbid("a sequence is armed before the converter is ready");
            }
            self.check_sequence(inputs)?;
        }
        if value & ADDIS != 0 && before & (ADEN | JADSTART) != ADEN {
            return forbid("a converter is disabled that is not enabled, or converts");
        }
        self.block.write(CR, value & !(ADCAL | ADEN | ADDIS | JADSTART | JADSTP))?;
        let mut now = self.block.get(CR) | before & (ADEN | JADSTART) | value & (ADEN | JADSTART);
        if value & ADVREGEN != 0 && before & ADVREGEN == 0 {
            self.regulator = at.instant().after_ns(REGULATOR_NS);
        }
        if value & ADCAL != 0 && !calibrating {
            self.calibrated = at.cycle + CALIBRATION_CLOCKS * clocks;
        }
        if asked & ADEN != 0 {
            // The power-up time is that of a conversion at the shortest sampling time.
            self.ready = Some(at.cycle + 15 * clocks);
        }
        if value & JADSTP != 0 {
            (now, self.conversion) = (now & !JADSTART, None);
        }
        if value & ADDIS != 0 {
            (now, self.ready) = (now & !ADEN, None);
        }
        self.block.set(CR, now);
        Ok(())
    }

    fn check_sequence(&self, inputs: impl Fn(Input) -> Result<(), String>) -> Result<(), Refusal> {
        let sequence = self.block.get(JSQR);
        if self.block.get(CFGR) & JQDIS == 0 {
            return Err(self.block.refuse(CFGR, "the queue of contexts"));
        }
        if sequence >> 7 & 1 == 0 || ![0, 2, 8].contains(&(sequence >> 2 & 0x1f)) {
            return Err(self
                .block
                .refuse(JSQR, "a trigger other than a rising edge of TIM1_TRGO, TIM1_TRGO2 or TIM2_TRGO"));
        }
        for rank in 0..=sequence & 3 {
            let channel = self.channel(rank);
            if !self.description.channels.iter().any(|(number, _)| u32::from(*number) == channel) {
                return Err(self.block.refuse(JSQR, &format!("channel {channel}")));
            }
            inputs(self.input(rank)).map_err(|what| self.block.forbid(JSQR, &format!("channel {channel}: {what}")))?;
        }
        Ok(())
    }
}

/// State that a group of converters shares.
#[derive(Clone, Debug)]
pub struct Common {
    block: Block,
}

impl Common {
    /// State after reset.
    pub fn new(name: &'static str) -> Self {
        Self { block: Block::new(name, "21.7", COMMON) }
    }

    /// Back to reset.
    pub fn reset(&mut self) {
        self.block.reset();
    }

    /// The core's cycles in a clock of the converters; none for the asynchronous clock (CKMODE, 21.4.3).
    #[inline]
    pub fn divider(&self) -> Option<u64> {
        match self.block.get(CCR) >> 16 & 3 {
            0 => None,
            mode => Some(1 << (mode - 1)),
        }
    }

    /// A load by the core.
    pub fn read(&self, offset: u32) -> Result<u32, Refusal> {
        self.block.read(offset)
    }

    /// A store by the core; `off` says whether all converters of the group are.
    pub fn write(&mut self, offset: u32, value: u32, off: bool) -> Result<(), Refusal> {
        let before = self.block.write(offset, value)?;
        if !off && before != self.block.get(offset) {
            return Err(self.block.forbid(offset, "it is changed while a converter is on"));
        }
        Ok(())
    }
}
