//! The timers' registers: RM0440, 28.6 (TIM1), 29.5 (TIM2 to TIM5), 30.8 (TIM15).

use super::super::register::{Block, Register, register};
use super::super::variant::TimerKind;
use crate::bus::Refusal;

pub const CR1: u32 = 0x00;
pub const CR2: u32 = 0x04;
pub const SMCR: u32 = 0x08;
pub const DIER: u32 = 0x0c;
pub const SR: u32 = 0x10;
pub const EGR: u32 = 0x14;
pub const CCMR1: u32 = 0x18;
pub const CCMR2: u32 = 0x1c;
pub const CCER: u32 = 0x20;
pub const CNT: u32 = 0x24;
pub const PSC: u32 = 0x28;
pub const ARR: u32 = 0x2c;
pub const RCR: u32 = 0x30;
pub const CCR1: u32 = 0x34;
pub const CCR3: u32 = 0x3c;
pub const CCR4: u32 = 0x40;
pub const BDTR: u32 = 0x44;
pub const AF1: u32 = 0x60;

pub const CEN: u32 = 1 << 0;
pub const UDIS: u32 = 1 << 1;
pub const URS: u32 = 1 << 2;
pub const DIR: u32 = 1 << 4;
pub const CMS: u32 = 3 << 5;
pub const ARPE: u32 = 1 << 7;
pub const CKD: u32 = 3 << 8;

/// SMS, without its upper bit, which is refused.
pub const SMS: u32 = 7;

pub const UIF: u32 = 1 << 0;
pub const CC3IF: u32 = 1 << 3;
pub const BIF: u32 = 1 << 7;
pub const CC3OF: u32 = 1 << 11;
pub const SBIF: u32 = 1 << 13;
pub const BIE: u32 = 1 << 7;
pub const BG: u32 = 1 << 7;

pub const BKE: u32 = 1 << 12;
pub const BKP: u32 = 1 << 13;
pub const MOE: u32 = 1 << 15;
pub const OSSI: u32 = 1 << 10;
pub const OSSR: u32 = 1 << 11;

pub const BKINE: u32 = 1 << 0;

/// Sources of TRGO and TRGO2: an update, OC4REF.
pub const MMS_UPDATE: u32 = 2;
pub const MMS_REFERENCE4: u32 = 7;

/// CR1: one-pulse mode, UIFREMAP and dithering are refused. CR2: preloaded control bits, TI1S. DIER: DMA, COM and
/// trigger interrupts, index. CCMR: the fourth mode bit, clearing by ETR, fast enable.
const ADVANCED: &[Register] = &[
    register(CR1, "CR1", 0, 0x0000_03f7, 0x0000_1808),
    register(CR2, "CR2", 0, 0x00f5_5f70, 0x0205_208d),
    register(SMCR, "SMCR", 0, 0x0000_0007, 0x03ff_fff8),
    register(DIER, "DIER", 0, 0x0000_009f, 0x00f0_7f60),
    register(SR, "SR", 0, 0, 0),
    register(EGR, "EGR", 0, 0, 0x0000_017e),
    register(CCMR1, "CCMR1", 0, 0x0000_fbfb, 0x0101_8484),
    register(CCMR2, "CCMR2", 0, 0x0000_fbfb, 0x0101_8484),
    register(CCER, "CCER", 0, 0x0000_bfff, 0x00f3_0000),
    register(CNT, "CNT", 0, 0x0000_ffff, 0),
    register(PSC, "PSC", 0, 0x0000_ffff, 0),
    register(ARR, "ARR", 0x0000_ffff, 0x0000_ffff, 0),
    register(RCR, "RCR", 0, 0x0000_ffff, 0),
    register(0x34, "CCR1", 0, 0x0000_ffff, 0),
    register(0x38, "CCR2", 0, 0x0000_ffff, 0),
    register(0x3c, "CCR3", 0, 0x0000_ffff, 0),
    register(0x40, "CCR4", 0, 0x0000_ffff, 0),
    // Locks, AOE, filters of the break, break 2.
    register(BDTR, "BDTR", 0, 0x0000_bcff, 0x3fff_4300),
    // Comparators as sources of the break.
    register(AF1, "AF1", 0x0000_0001, 0x0000_0201, 0x0003_fdfe),
    register(0x64, "AF2", 0x0000_0001, 0x0000_0201, 0x0007_fdfe),
];

/// TIM2 and TIM5.
const GENERAL_32: &[Register] = &[
    register(CR1, "CR1", 0, 0x0000_03f7, 0x0000_1808),
    register(CR2, "CR2", 0, 0x0000_0070, 0x0200_0088),
    register(SMCR, "SMCR", 0, 0x0000_0007, 0x03ff_fff8),
    register(DIER, "DIER", 0, 0x0000_001f, 0x00f0_5f40),
    register(SR, "SR", 0, 0, 0),
    register(EGR, "EGR", 0, 0, 0x0000_005e),
    register(CCMR1, "CCMR1", 0, 0x0000_fbfb, 0x0101_8484),
    register(CCMR2, "CCMR2", 0, 0x0000_fbfb, 0x0101_8484),
    register(CCER, "CCER", 0, 0x0000_bbbb, 0),
    register(CNT, "CNT", 0, u32::MAX, 0),
    register(PSC, "PSC", 0, 0x0000_ffff, 0),
    register(ARR, "ARR", u32::MAX, u32::MAX, 0),
    register(0x34, "CCR1", 0, u32::MAX, 0),
    register(0x38, "CCR2", 0, u32::MAX, 0),
    register(0x3c, "CCR3", 0, u32::MAX, 0),
    register(0x40, "CCR4", 0, u32::MAX, 0),
];

/// TIM3 and TIM4.
const GENERAL_16: &[Register] = &[
    register(CR1, "CR1", 0, 0x0000_03f7, 0x0000_1808),
    register(CR2, "CR2", 0, 0x0000_0070, 0x0200_0088),
    register(SMCR, "SMCR", 0, 0x0000_0007, 0x03ff_fff8),
    register(DIER, "DIER", 0, 0x0000_001f, 0x00f0_5f40),
    register(SR, "SR", 0, 0, 0),
    register(EGR, "EGR", 0, 0, 0x0000_005e),
    register(CCMR1, "CCMR1", 0, 0x0000_fbfb, 0x0101_8484),
    register(CCMR2, "CCMR2", 0, 0x0000_fbfb, 0x0101_8484),
    register(CCER, "CCER", 0, 0x0000_bbbb, 0),
    register(CNT, "CNT", 0, 0x0000_ffff, 0),
    register(PSC, "PSC", 0, 0x0000_ffff, 0),
    register(ARR, "ARR", 0x0000_ffff, 0x0000_ffff, 0),
    register(0x34, "CCR1", 0, 0x0000_ffff, 0),
    register(0x38, "CCR2", 0, 0x0000_ffff, 0),
    register(0x3c, "CCR3", 0, 0x0000_ffff, 0),
    register(0x40, "CCR4", 0, 0x0000_ffff, 0),
];

/// TIM15, as a time base: its channels compare, its outputs are refused.
const TWO_CHANNELS: &[Register] = &[
    register(CR1, "CR1", 0, 0x0000_0387, 0x0000_1808),
    register(CR2, "CR2", 0, 0, 0x0000_07fd),
    register(SMCR, "SMCR", 0, 0, 0x0013_00f7),
    register(DIER, "DIER", 0, 0x0000_0007, 0x0000_7fe0),
    register(SR, "SR", 0, 0, 0),
    register(EGR, "EGR", 0, 0, 0x0000_00e6),
    register(CCMR1, "CCMR1", 0, 0x0000_0808, 0x0101_f7f7),
    register(CCER, "CCER", 0, 0, 0x0000_00ff),
    register(CNT, "CNT", 0, 0x0000_ffff, 0),
    register(PSC, "PSC", 0, 0x0000_ffff, 0),
    register(ARR, "ARR", 0x0000_ffff, 0x0000_ffff, 0),
    register(RCR, "RCR", 0, 0x0000_00ff, 0),
    register(0x34, "CCR1", 0, 0x0000_ffff, 0),
    register(0x38, "CCR2", 0, 0x0000_ffff, 0),
];

/// Registers of a kind of timer, and the section that describes them.
pub fn of(kind: TimerKind) -> (&'static [Register], &'static str) {
    match kind {
        TimerKind::Advanced => (ADVANCED, "28.6"),
        TimerKind::General32 => (GENERAL_32, "29.5"),
        TimerKind::General16 => (GENERAL_16, "29.5"),
        TimerKind::TwoChannels => (TWO_CHANNELS, "30.8"),
    }
}

/// Returns `true` if channel 3 captures the rising edge of its own input: the index of an encoder.
pub fn captures_index(block: &Block) -> bool {
    block.get_or_zero(CCMR2) & 3 == 1 && block.get(CCER) >> 8 & 0xb == 1
}

/// Refuses a channel's mode that is not modelled: outputs other than frozen and PWM, captures of the other input.
pub fn check_modes(block: &Block, offset: u32) -> Result<(), Refusal> {
    let value = block.get(offset);
    for channel in 0..2 {
        let mode = value >> (8 * channel) & 0xff;
        let known = match mode & 3 {
            0 => matches!(mode >> 4 & 7, 0 | 6 | 7),
            1 => mode >> 2 & 3 == 0,
            _ => false,
        };
        if !known {
            return Err(block.refuse(offset, &format!("channel mode {mode:#04x}")));
        }
    }
    Ok(())
}
