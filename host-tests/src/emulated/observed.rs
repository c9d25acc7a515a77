//! Variables that a [`Twin`](super::Twin) reads on each board, and how.

use emulator::board::{BG431BEsc1, MoteusR4, Wired};
use emulator::bus::{Bus as _, Width};
use emulator::chip::Chip;
use emulator::variables::Variable;
use joint_firmware::default_configuration::{B_G431B_ESC1, BoardConfiguration, MOTEUS_R4, MoteusR4Encoder};
use joint_firmware::objects::Operation;
use joint_firmware::sensors::rotor_encoder::RotorEncoder;
use libtest_mimic::Failed;

/// Variables that the twin reads on a board.
pub trait Observed: Wired + Sized {
    /// The board's part of the configuration.
    const CONFIGURATION: BoardConfiguration;
    /// Injected data registers of the phases a, b, c and of the supply.
    const CODES: [u32; 4];
    /// `true` if there is a sensor on the motor's winding; where there is none, its temperature is not a number.
    const WINDING_SENSOR: bool;
    /// The program adapts friction in service.
    const ADAPTS: bool;
    /// `true` if the encoder has to meet its index before the joint can be enabled.
    const INDEX: bool;
    /// Variable that tells whether the gate driver is ready, 1, or has not been since the start, 0; none where there is
    /// nothing to get ready.
    const GATE: Option<&'static str>;
    /// Modes that the program has, as in 6502h.
    const MODES: u32;
    /// Most cycles of the receive interrupt with one RPDO of three objects, entry and return included.
    const RECEIVE_CYCLES: u64;
    /// Variables of the control interrupt that [`Observed::encoder`] and [`Observed::encoder_taken`] read.
    const ENCODER: &'static [&'static str];

    /// Returns `true` if the bridge has switched itself off.
    ///
    /// # Errors
    /// Refusals of the chip.
    fn bridge_fault(memory: &mut Memory<'_, Self>) -> Result<bool, Failed>;

    /// The encoder before a control step.
    ///
    /// # Errors
    /// Refusals of the chip.
    fn encoder(memory: &mut Memory<'_, Self>, variables: &[Variable<'_>]) -> Result<Reading, Failed>;

    /// Reading that the step took of it, seen after the step; `before` is what it was then.
    ///
    /// # Errors
    /// It took something else.
    fn encoder_taken(
        _memory: &mut Memory<'_, Self>,
        _variables: &[Variable<'_>],
        before: Reading,
    ) -> Result<Reading, Failed> {
        Ok(before)
    }
}

/// Reading of an encoder.
#[derive(Clone, Copy, Debug)]
pub struct Reading {
    /// 2^32 a turn; none where it does not answer, or is known to be wrong.
    pub angle: Option<u32>,
    /// `true` if its zero is known.
    pub referenced: bool,
}

impl Observed for MoteusR4 {
    const CONFIGURATION: BoardConfiguration = MOTEUS_R4;
    // ADC3, ADC1 and ADC2 rank 1, ADC1 rank 2 (RM0440, 21.7.22).
    const CODES: [u32; 4] = [0x5000_0480, 0x5000_0080, 0x5000_0180, 0x5000_0084];
    const WINDING_SENSOR: bool = true;
    const ADAPTS: bool = true;
    const INDEX: bool = false;
    const GATE: Option<&'static str> = Some("gate::STATE");
    const MODES: u32 = Operation::SUPPORTED;
    const RECEIVE_CYCLES: u64 = 3_300;
    const ENCODER: &'static [&'static str] = &["sensors.answer"];

    fn bridge_fault(memory: &mut Memory<'_, Self>) -> Result<bool, Failed> {
        // GPIOB's input 6, the driver's nFAULT.
        Ok(memory.word(0x4800_0410)? >> 6 & 1 == 0)
    }

    fn encoder(memory: &mut Memory<'_, Self>, variables: &[Variable<'_>]) -> Result<Reading, Failed> {
        let [answer] = variables else { return Err("other variables".into()) };
        let answer = match memory.variant(answer)? {
            ("Some", Some(content)) => Some(memory.bits(&content)? as u16),
            _ => None,
        };
        Ok(Reading { angle: answer.and_then(MoteusR4Encoder::angle), referenced: true })
    }
}

impl Observed for BG431BEsc1 {
    const CONFIGURATION: BoardConfiguration = B_G431B_ESC1;
    // ADC1 rank 1, ADC2 rank 1 and 2, ADC1 rank 2 (RM0440, 21.7.22).
    const CODES: [u32; 4] = [0x5000_0080, 0x5000_0180, 0x5000_0184, 0x5000_0084];
    const WINDING_SENSOR: bool = false;
    const ADAPTS: bool = false;
    const INDEX: bool = true;
    const GATE: Option<&'static str> = None;
    // No profile modes: CSP, CSV, CST, impedance, open loop.
    const MODES: u32 = 0x0003_0380;
    const RECEIVE_CYCLES: u64 = 4_700;
    const ENCODER: &'static [&'static str] = &[
        "joint.encoder",
        "sensors.counts_kept",
        "sensors.encoder.index",
        "sensors.encoder.scale",
        "sensors.encoder.zero",
    ];

    fn bridge_fault(memory: &mut Memory<'_, Self>) -> Result<bool, Failed> {
        // TIM1's status, a system break.
        Ok(memory.word(0x4001_2c10)? >> 13 & 1 == 1)
    }

    /// The count of TIM4, which goes on.
    fn encoder(memory: &mut Memory<'_, Self>, _: &[Variable<'_>]) -> Result<Reading, Failed> {
        Ok(Reading { angle: Some(memory.word(0x4000_0824)?), referenced: false })
    }

    /// The step reads the timer some cycles later, and which edge of the index came first only it knows. Its count may
    /// be one of its neighbours in time.
    fn encoder_taken(
        memory: &mut Memory<'_, Self>,
        variables: &[Variable<'_>],
        before: Reading,
    ) -> Result<Reading, Failed> {
        let [angle, kept, index, scale, zero] = variables else { return Err("other variables".into()) };
        let [angle, scale, zero] =
            [memory.bits(angle)?, memory.bits(scale)?, memory.bits(zero)?].map(|bits| bits as u32);
        let referenced = memory.variant(index)?.0 == "Some";
        if memory.bits(kept)? == 0 {
            return Ok(Reading { angle: None, referenced });
        }
        let expected = before.angle.unwrap_or_default().wrapping_mul(scale).wrapping_sub(zero);
        let apart = (angle.wrapping_sub(expected) as i32).unsigned_abs();
        match apart <= NEIGHBOURS * scale {
            true => Ok(Reading { angle: Some(angle), referenced }),
            false => {
                Err(format!("the step took {angle:#x} for the encoder's angle, the timer says {expected:#x}").into())
            }
        }
    }
}

/// Counts by which a step's reading of the incremental encoder may differ from one some cycles before it: its lines are
/// noisy.
const NEIGHBOURS: u32 = 8;

/// The chip's memory, to look at.
pub struct Memory<'c, W> {
    bus: &'c mut Chip<W>,
    now: u64,
}

impl<'c, W: Observed> Memory<'c, W> {
    /// Memory at a time, in cycles.
    pub const fn new(bus: &'c mut Chip<W>, now: u64) -> Self {
        Self { bus, now }
    }

    /// A word, as the core would read it.
    ///
    /// # Errors
    /// Refusals of the chip.
    pub fn word(&mut self, address: u32) -> Result<u32, Failed> {
        Ok(self.bus.read(self.now, address, Width::Word).map_err(|refusal| format!("{address:#x}: {refusal:?}"))?)
    }

    /// A number's bits.
    ///
    /// # Errors
    /// It is none.
    pub fn bits(&mut self, variable: &Variable<'_>) -> Result<u64, Failed> {
        Ok(variable.bits(self.bus, self.now)?)
    }

    /// An `f32`.
    ///
    /// # Errors
    /// It is none.
    pub fn real(&mut self, variable: &Variable<'_>) -> Result<f32, Failed> {
        Ok(variable.real(self.bus, self.now)?)
    }

    /// Name and content of an enum's variant.
    ///
    /// # Errors
    /// It is none.
    pub fn variant<'v>(&mut self, variable: &Variable<'v>) -> Result<(&'v str, Option<Variable<'v>>), Failed> {
        Ok(variable.variant(self.bus, self.now)?)
    }
}
