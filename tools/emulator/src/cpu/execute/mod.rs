//! Execution of instructions, by group. Operands were checked by `decode`; the names are the architecture's (ARM DDI
//! 0403, A7.7).

/// The function of a condition that only decoding knows; 14 and more always hold. What else it is generic over comes
/// before.
macro_rules! by_condition {
    ($function:ident $(<$($before:ident),+>)?, $condition:expr) => {
        match $condition {
            0 => $function::<B, $($($before,)+)? 0>,
            1 => $function::<B, $($($before,)+)? 1>,
            2 => $function::<B, $($($before,)+)? 2>,
            3 => $function::<B, $($($before,)+)? 3>,
            4 => $function::<B, $($($before,)+)? 4>,
            5 => $function::<B, $($($before,)+)? 5>,
            6 => $function::<B, $($($before,)+)? 6>,
            7 => $function::<B, $($($before,)+)? 7>,
            8 => $function::<B, $($($before,)+)? 8>,
            9 => $function::<B, $($($before,)+)? 9>,
            10 => $function::<B, $($($before,)+)? 10>,
            11 => $function::<B, $($($before,)+)? 11>,
            12 => $function::<B, $($($before,)+)? 12>,
            13 => $function::<B, $($($before,)+)? 13>,
            _ => $function::<B, $($($before,)+)? 14>,
        }
    };
}
pub(super) use by_condition;

pub(super) mod branch;
pub(super) mod data_processing;
pub(super) mod floating_point;
pub(super) mod load_store;
pub(super) mod multiply;
pub(super) mod pairs;
pub(super) mod simd;
pub(super) mod system;

use super::Cpu;
use crate::bus::Bus;

/// Bits that general registers keep of what is written.
const KEPT: [u32; 16] = {
    let mut kept = [u32::MAX; 16];
    kept[13] = !3;
    kept
};

impl<B: Bus> Cpu<B> {
    /// Value of a general register; never asked for the program counter.
    #[inline(always)]
    pub(super) fn get(&self, register: u8) -> u32 {
        self.r[usize::from(register & 15)]
    }

    /// Sets a general register that is not the stack pointer.
    #[inline(always)]
    pub(super) fn set(&mut self, register: u8, value: u32) {
        self.r[usize::from(register & 15)] = value;
    }

    /// Sets a general register that may be the stack pointer, whose lowest two bits are always 0.
    #[inline(always)]
    pub(super) fn set_any(&mut self, register: u8, value: u32) {
        let place = usize::from(register & 15);
        self.r[place] = value & KEPT[place];
    }

    #[inline(always)]
    pub(super) fn set_negative_zero(&mut self, value: u32) {
        (self.negative, self.zero) = ((value as i32) < 0, value == 0);
    }
}
