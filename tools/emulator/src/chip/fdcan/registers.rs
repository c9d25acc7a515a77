//! The controller's registers: RM0440, 44.4.

use super::super::register::{Register, register};

pub const DBTP: u32 = 0x0c;
pub const RWD: u32 = 0x14;
pub const CCCR: u32 = 0x18;
pub const NBTP: u32 = 0x1c;
pub const TSCC: u32 = 0x20;
pub const TSCV: u32 = 0x24;
pub const TOCC: u32 = 0x28;
pub const ECR: u32 = 0x40;
pub const PSR: u32 = 0x44;
pub const TDCR: u32 = 0x48;
pub const IR: u32 = 0x50;
pub const IE: u32 = 0x54;
pub const ILS: u32 = 0x58;
pub const ILE: u32 = 0x5c;
pub const RXGFC: u32 = 0x80;
pub const XIDAM: u32 = 0x84;
pub const RXF0S: u32 = 0x90;
pub const RXF0A: u32 = 0x94;
pub const RXF1S: u32 = 0x98;
pub const RXF1A: u32 = 0x9c;
pub const TXBC: u32 = 0xc0;
pub const TXFQS: u32 = 0xc4;
pub const TXBRP: u32 = 0xc8;
pub const TXBAR: u32 = 0xcc;
pub const TXBCR: u32 = 0xd0;
pub const TXBTO: u32 = 0xd4;
pub const TXBCF: u32 = 0xd8;
pub const TXBTIE: u32 = 0xdc;
pub const TXBCIE: u32 = 0xe0;

pub const INIT: u32 = 1 << 0;
pub const CCE: u32 = 1 << 1;
pub const CSR: u32 = 1 << 4;

pub const TFQM: u32 = 1 << 24;

pub const RF0N: u32 = 1 << 0;
pub const RF0F: u32 = 1 << 1;
pub const RF0L: u32 = 1 << 2;
pub const TC: u32 = 1 << 7;
pub const TCF: u32 = 1 << 8;
pub const TFE: u32 = 1 << 9;
pub const EP: u32 = 1 << 17;
pub const EW: u32 = 1 << 18;
pub const BO: u32 = 1 << 19;
pub const PEA: u32 = 1 << 21;

/// Flags of IR by the group that ILS gives a line: both FIFOs, successful messages, transmit FIFO, miscellaneous, line
/// errors, protocol errors.
pub const GROUPS: [u32; 7] = [0x7, 0x38, 0x1c0, 0x1e00, 0xe000, 0x3_0000, 0xfc_0000];

pub const PSR_EP: u32 = 1 << 5;
pub const PSR_EW: u32 = 1 << 6;
pub const PSR_BO: u32 = 1 << 7;
/// DLEC: no change, as there are no fast bits.
pub const PSR_FIXED: u32 = 7 << 8;

/// Limits of the error counters.
pub const WARNING: u32 = 96;
pub const PASSIVE: u32 = 128;

/// PSR.LEC.
pub const FORM_ERROR: u32 = 2;
pub const ACKNOWLEDGE_ERROR: u32 = 3;
pub const BIT_ERROR: u32 = 5;
pub const NO_CHANGE: u32 = 7;

pub const REGISTERS: &[Register] = &[
    register(0x00, "CREL", 0x3214_1218, 0, 0),
    register(0x04, "ENDN", 0x8765_4321, 0, 0),
    register(DBTP, "DBTP", 0x0000_0a33, 0x009f_1fff, 0),
    register(0x10, "TEST", 0, 0, 0x0000_0070),
    // The watchdog of the message RAM.
    register(RWD, "RWD", 0, 0, u32::MAX),
    // ASM, CSR, MON, DAR, TEST, FDOE, BRSE, EFBI, TXP. PXHD and NISO make no difference to classic frames.
    register(CCCR, "CCCR", INIT, 0x0000_9003, 0x0000_63f4),
    register(NBTP, "NBTP", 0x0600_0a03, 0xffff_ff7f, 0),
    register(TSCC, "TSCC", 0, 0x000f_0003, 0x0000_0002),
    register(TSCV, "TSCV", 0, 0, 0),
    register(TOCC, "TOCC", 0xffff_0000, 0xffff_0007, 0x0000_0001),
    register(0x2c, "TOCV", 0x0000_ffff, 0, 0),
    register(ECR, "ECR", 0, 0, 0),
    register(PSR, "PSR", 0, 0, 0),
    register(TDCR, "TDCR", 0, 0x0000_7f7f, 0),
    register(IR, "IR", 0, 0, 0),
    register(IE, "IE", 0, 0x00ff_ffff, 0),
    register(ILS, "ILS", 0, 0x0000_007f, 0),
    register(ILE, "ILE", 0, 0x0000_0003, 0),
    register(RXGFC, "RXGFC", 0, 0x0f1f_033f, 0),
    register(XIDAM, "XIDAM", 0x1fff_ffff, 0x1fff_ffff, 0),
    register(0x88, "HPMS", 0, 0, 0),
    register(RXF0S, "RXF0S", 0, 0, 0),
    register(RXF0A, "RXF0A", 0, 0x0000_0007, 0),
    register(RXF1S, "RXF1S", 0, 0, 0),
    register(RXF1A, "RXF1A", 0, 0x0000_0007, 0),
    register(TXBC, "TXBC", 0, TFQM, 0),
    register(TXFQS, "TXFQS", 0, 0, 0),
    register(TXBRP, "TXBRP", 0, 0, 0),
    register(TXBAR, "TXBAR", 0, 0, 0),
    register(TXBCR, "TXBCR", 0, 0, 0),
    register(TXBTO, "TXBTO", 0, 0, 0),
    register(TXBCF, "TXBCF", 0, 0, 0),
    register(TXBTIE, "TXBTIE", 0, 0x0000_0007, 0),
    register(TXBCIE, "TXBCIE", 0, 0x0000_0007, 0),
    register(0xe4, "TXEFS", 0, 0, 0),
    register(0xe8, "TXEFA", 0, 0, 0),
    // A divided clock.
    register(0x100, "CKDIV", 0, 0, 0x0000_000f),
];
