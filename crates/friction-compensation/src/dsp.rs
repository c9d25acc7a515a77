//! The few DSP operations the control path is made of, each with the same result on every machine; any context.
//!
//! Names are those of the ARMv7E-M instructions (ARM DDI 0403, A4.4.3): on the microcontroller each function is that
//! one instruction, elsewhere it is a portable twin. The compiler finds most of them in the portable form by itself
//! (checked in the disassembly). Written in assembly are those that it does not find, or finds only with more around
//! them. This is the only file of the arithmetic that contains `unsafe`.

/// `accumulator + a[low] b[low] + a[high] b[high]` over two signed 16-bit halves; wraps.
///
/// Callers must have proved that the sum fits: the instruction wraps (and sets the Q flag), it does not saturate.
#[cfg(target_arch = "arm")]
#[inline(always)]
pub fn smlad(a: u32, b: u32, accumulator: i32) -> i32 {
    let sum;
    // SAFETY: a pure register-to-register instruction of every ARMv7E-M core; it touches neither memory nor stack.
    unsafe {
        core::arch::asm!(
            "smlad {sum}, {a}, {b}, {accumulator}",
            sum = lateout(reg) sum,
            a = in(reg) a,
            b = in(reg) b,
            accumulator = in(reg) accumulator,
            options(pure, nomem, nostack, preserves_flags)
        );
    }
    sum
}

/// `accumulator + a[low] b[low] + a[high] b[high]` over two signed 16-bit halves; wraps.
///
/// Callers must have proved that the sum fits: the instruction wraps (and sets the Q flag), it does not saturate.
#[cfg(not(target_arch = "arm"))]
#[inline(always)]
pub fn smlad(a: u32, b: u32, accumulator: i32) -> i32 {
    let low = (a as i16 as i32) * (b as i16 as i32);
    let high = ((a as i32) >> 16) * ((b as i32) >> 16);
    accumulator.wrapping_add(low).wrapping_add(high)
}

/// `a[low] b[low] + a[high] b[high]` over two signed 16-bit halves; wraps, as [`smlad`] does.
#[cfg(target_arch = "arm")]
#[inline(always)]
pub fn smuad(a: u32, b: u32) -> i32 {
    let sum;
    // SAFETY: as for `smlad`.
    unsafe {
        core::arch::asm!(
            "smuad {sum}, {a}, {b}",
            sum = lateout(reg) sum,
            a = in(reg) a,
            b = in(reg) b,
            options(pure, nomem, nostack, preserves_flags)
        );
    }
    sum
}

/// `a[low] b[low] + a[high] b[high]` over two signed 16-bit halves; wraps, as [`smlad`] does.
#[cfg(not(target_arch = "arm"))]
#[inline(always)]
pub fn smuad(a: u32, b: u32) -> i32 {
    smlad(a, b, 0)
}

/// `value` shifted right by the lowest byte of `distance` with its sign; 32 and more leave nothing but the sign.
#[cfg(target_arch = "arm")]
#[inline(always)]
pub fn asr(value: i32, distance: u32) -> i32 {
    let shifted;
    // SAFETY: as for `smlad`; the instruction looks at the lowest byte of the distance's register.
    unsafe {
        core::arch::asm!(
            "asr.w {shifted}, {value}, {distance}",
            shifted = lateout(reg) shifted,
            value = in(reg) value,
            distance = in(reg) distance,
            options(pure, nomem, nostack, preserves_flags)
        );
    }
    shifted
}

/// `value` shifted right by the lowest byte of `distance` with its sign; 32 and more leave nothing but the sign.
#[cfg(not(target_arch = "arm"))]
#[inline(always)]
pub fn asr(value: i32, distance: u32) -> i32 {
    value >> (distance & 0xff).min(31)
}

/// `accumulator + floor(a b / 2^32)`; wraps.
#[inline(always)]
pub fn smmla(a: i32, b: i32, accumulator: i32) -> i32 {
    accumulator.wrapping_add(smmul(a, b))
}

/// `floor(a b / 2^32)`.
#[inline(always)]
pub fn smmul(a: i32, b: i32) -> i32 {
    ((a as i64 * b as i64) >> 32) as i32
}

/// `a b / 2^32`, rounded half up.
#[inline(always)]
pub fn smmulr(a: i32, b: i32) -> i32 {
    ((a as i64 * b as i64 + (1 << 31)) >> 32) as i32
}

/// The upper halves of two words, packed: `second` above `first`.
#[inline(always)]
pub fn pkhtb(first: i32, second: i32) -> u32 {
    (second as u32 & 0xffff_0000) | (first as u32 >> 16)
}

/// The lower half of a word with `HIGH` as its upper one.
///
/// The portable form is two instructions: the compiler keeps the constant in a register, or has to make it.
#[cfg(target_arch = "arm")]
#[inline(always)]
pub fn movt<const HIGH: u16>(word: u32) -> u32 {
    let mut packed = word;
    // SAFETY: as for `smlad`.
    unsafe {
        core::arch::asm!(
            "movt {packed}, #{high}",
            packed = inout(reg) packed,
            high = const HIGH,
            options(pure, nomem, nostack, preserves_flags)
        );
    }
    packed
}

/// The lower half of a word with `HIGH` as its upper one.
#[cfg(not(target_arch = "arm"))]
#[inline(always)]
pub fn movt<const HIGH: u16>(word: u32) -> u32 {
    word & 0xffff | u32::from(HIGH) << 16
}

/// Five values, all of them computed before anything that is written behind: no instruction, a barrier for the
/// compiler.
///
/// Optimised for nothing but size, the compiler has no scheduler that would keep few values waiting: it would finish
/// one sum after another, with every factor of all of them on the stack until then.
#[cfg(target_arch = "arm")]
#[inline(always)]
pub fn in_turn([a, b, c, d, e]: [i32; 5]) -> [i32; 5] {
    let (mut a, mut b, mut c, mut d, mut e) = (a, b, c, d, e);
    // SAFETY: no instruction at all.
    unsafe {
        core::arch::asm!(
            "/* {a} {b} {c} {d} {e} */",
            a = inout(reg) a, b = inout(reg) b, c = inout(reg) c, d = inout(reg) d, e = inout(reg) e,
            options(pure, nomem, nostack, preserves_flags)
        );
    }
    [a, b, c, d, e]
}

/// Five values, all of them computed before anything that is written behind: no instruction, a barrier for the
/// compiler.
#[cfg(not(target_arch = "arm"))]
#[inline(always)]
pub fn in_turn(values: [i32; 5]) -> [i32; 5] {
    values
}

/// The word of a table at `step` from its middle, held at the table's ends.
///
/// Addressed from the middle: the compiler would add half the table's length to every step.
#[cfg(target_arch = "arm")]
#[inline(always)]
fn at_step(table: &[i32; TABLE_LEN], step: i32) -> i32 {
    let middle = table.as_ptr().wrapping_add(TABLE_LEN / 2);
    let word;
    // SAFETY: a load from the table: the step is held in -256..=255, and the middle is its 256th word.
    unsafe {
        core::arch::asm!(
            "ldr {word}, [{middle}, {step}, lsl #2]",
            word = lateout(reg) word,
            middle = in(reg) middle,
            step = in(reg) step.clamp(-256, 255),
            options(pure, readonly, nostack, preserves_flags)
        );
    }
    word
}

/// The word of a table at `step` from its middle, held at the table's ends.
#[cfg(not(target_arch = "arm"))]
#[inline(always)]
fn at_step(table: &[i32; TABLE_LEN], step: i32) -> i32 {
    table[(step.clamp(-256, 255) + 256) as usize & (TABLE_LEN - 1)]
}

/// Words in an interpolation table.
pub const TABLE_LEN: usize = 512;

/// Looks `x` up in a table that covers 512 steps of 2^20 around zero; result in Q31.
///
/// A word holds the value at its step's left end (upper half, Q15) and the slope over the step (lower half), so that
/// one load and one SMLABB interpolate: `word + slope * fraction`, with a fraction of 12 bits. Beyond the ends the
/// first or last word is used, whose slope must be zero. Reads no memory outside the table for any `x`.
#[inline(always)]
pub fn interpolate(table: &[i32; TABLE_LEN], x: i32) -> i32 {
    let word = at_step(table, x >> 20);
    let fraction = (x >> 8) & 0xfff;
    word.wrapping_add((word as i16 as i32) * fraction)
}

/// Knots of half a table, of an odd function: both ends of 256 steps.
pub const HALF_TABLE_LEN: usize = TABLE_LEN / 2 + 1;

/// [`interpolate`] between the knots (Q15) of an odd function right of zero; the same bits as in a whole table of
/// words. It takes a load and an addition more than a word that holds its slope, and a quarter of the memory.
#[inline(always)]
pub fn interpolate_odd(knots: &[i16; HALF_TABLE_LEN], x: i32) -> i32 {
    let sign = x >> 31;
    // Left of zero the complement: its step and fraction count from the step's right end, which is the mirrored one's
    // left.
    let magnitude = (x ^ sign) as u32;
    between_knots(knots, magnitude >> 20, (magnitude >> 8 & 0xfff) as i32, sign)
}

/// Value of [`interpolate_odd`] at a step (held at the last) and a fraction of it right of zero, with the function's
/// sign: 0, or -1 left of zero.
#[inline(always)]
fn between_knots(knots: &[i16; HALF_TABLE_LEN], step: u32, fraction: i32, sign: i32) -> i32 {
    let step = step.min(HALF_TABLE_LEN as u32 - 2) as usize;
    let (here, next) = (knots[step] as i32, knots[step + 1] as i32);
    let slope = (next - here) << 4;
    // A word of a whole table has its slope in its lower half, which counts as one step of the fraction, but not on the
    // way back.
    let value = (here << 16).wrapping_add(slope * (fraction + 1 + sign));
    (value ^ sign).wrapping_sub(sign)
}

/// [`interpolate`] at a product shifted right by `SHIFT` (12 to 24) and held in 32 bits, without doing either.
#[inline(always)]
pub fn interpolate_product<const SHIFT: u32>(table: &[i32; TABLE_LEN], product: i64) -> i32 {
    let step = (product >> 32) as i32 >> (SHIFT - 12);
    let fraction = (product >> (SHIFT + 8)) as i32 & 0xfff;
    // If holding would have changed something, the ends' slopes are zero, and any fraction will do.
    let word = at_step(table, step);
    word.wrapping_add((word as i16 as i32) * fraction)
}

/// [`interpolate_odd`] at a product, as [`interpolate_product`] is [`interpolate`].
#[inline(always)]
pub fn interpolate_odd_product<const SHIFT: u32>(knots: &[i16; HALF_TABLE_LEN], product: i64) -> i32 {
    let high = (product >> 32) as i32;
    let sign = high >> 31;
    let step = (high ^ sign) as u32 >> (SHIFT - 12);
    between_knots(knots, step, ((product >> (SHIFT + 8)) as i32 ^ sign) & 0xfff, sign)
}

/// Rounds a product sum with 47 fractional bits to Q16.16, half up; saturates.
#[inline(always)]
pub fn narrow(sum: i64) -> i32 {
    saturate((sum >> 31).wrapping_add((sum >> 30) & 1))
}

/// [`narrow`] of one product, in half the instructions: of all products only one is too large, by one.
#[inline(always)]
pub fn narrow_product(a: i32, b: i32) -> i32 {
    let rounded = smlal(1 << 30, a, b);
    let high = (rounded >> 32) as i32;
    // Twice the upper word, and the lower one's highest bit. Only the largest product saturates, and then upwards,
    // where all bits are set.
    high.saturating_add(high) | (rounded as u32 >> 31) as i32
}

/// `accumulator + a b`; wraps.
///
/// The portable form is one instruction, too, but the compiler makes three of it where it knows a sign.
#[cfg(target_arch = "arm")]
#[inline(always)]
pub fn smlal(accumulator: i64, a: i32, b: i32) -> i64 {
    let (mut low, mut high) = (accumulator as u32, (accumulator >> 32) as u32);
    // SAFETY: as for `smlad`.
    unsafe {
        core::arch::asm!(
            "smlal {low}, {high}, {a}, {b}",
            low = inout(reg) low,
            high = inout(reg) high,
            a = in(reg) a,
            b = in(reg) b,
            options(pure, nomem, nostack, preserves_flags)
        );
    }
    ((high as u64) << 32 | low as u64) as i64
}

/// `accumulator + a b`; wraps.
#[cfg(not(target_arch = "arm"))]
#[inline(always)]
pub fn smlal(accumulator: i64, a: i32, b: i32) -> i64 {
    accumulator.wrapping_add(a as i64 * b as i64)
}

/// `a b`.
#[cfg(target_arch = "arm")]
#[inline(always)]
pub fn smull(a: i32, b: i32) -> i64 {
    let (low, high): (u32, u32);
    // SAFETY: as for `smlad`.
    unsafe {
        core::arch::asm!(
            "smull {low}, {high}, {a}, {b}",
            low = out(reg) low,
            high = out(reg) high,
            a = in(reg) a,
            b = in(reg) b,
            options(pure, nomem, nostack, preserves_flags)
        );
    }
    ((high as u64) << 32 | low as u64) as i64
}

/// `a b`.
#[cfg(not(target_arch = "arm"))]
#[inline(always)]
pub fn smull(a: i32, b: i32) -> i64 {
    a as i64 * b as i64
}

/// The nearest 32-bit value.
#[inline(always)]
pub fn saturate(value: i64) -> i32 {
    // Three instructions where `clamp` takes ten: the upper word must be the lower one's sign.
    let low = value as i32;
    if value == low as i64 { low } else { (value >> 63) as i32 ^ i32::MAX }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn smlad_is_two_signed_products_and_wraps(a: (i16, i16), b: (i16, i16), accumulator: i32) {
            let pack = |(low, high): (i16, i16)| (low as u16 as u32) | ((high as u16 as u32) << 16);
            let exact = accumulator as i64 + a.0 as i64 * b.0 as i64 + a.1 as i64 * b.1 as i64;
            prop_assert_eq!(smlad(pack(a), pack(b), accumulator), exact as i32);
        }

        #[test]
        fn a_shift_is_a_division_rounded_down(value: i32, distance: u32) {
            let exact = value as i64 >> (distance & 0xff).min(63);
            prop_assert_eq!(asr(value, distance) as i64, exact);
        }

        #[test]
        fn narrow_rounds_to_nearest_and_saturates(sum: i64) {
            let exact = (sum as i128 + (1 << 30)) >> 31;
            prop_assert_eq!(narrow(sum) as i128, exact.clamp(i32::MIN as i128, i32::MAX as i128));
        }

        #[test]
        fn pkhtb_keeps_the_upper_halves(first: i32, second: i32) {
            let word = pkhtb(first, second);
            prop_assert_eq!(word as i16 as i32, first >> 16);
            prop_assert_eq!((word as i32) >> 16, second >> 16);
            prop_assert_eq!(movt::<0x7fff>(word), word & 0xffff | 0x7fff_0000);
        }
    }

    proptest! {
        #[test]
        fn one_product_is_narrowed_as_a_sum_is(
            a in prop_oneof![any::<i32>(), Just(i32::MIN), Just(i32::MAX)],
            b in prop_oneof![any::<i32>(), Just(i32::MIN), Just(i32::MAX), -3..3i32],
            accumulator: i64,
        ) {
            prop_assert_eq!(narrow_product(a, b), narrow(a as i64 * b as i64));
            prop_assert_eq!(smlal(accumulator, a, b), accumulator.wrapping_add(smull(a, b)));
            prop_assert_eq!(smull(a, b), a as i64 * b as i64);
        }
    }

    #[test]
    fn the_two_halves_of_smlad_can_overflow_and_then_wrap() {
        let minimum = 0x8000_8000; // -32768 in both halves: the one pair of products whose sum is 2^31
        assert_eq!(smlad(minimum, minimum, 0), i32::MIN);
    }

    #[test]
    fn interpolation_never_leaves_the_table() {
        let mut table = [0; TABLE_LEN];
        (table[0], table[TABLE_LEN - 1]) = (-(7 << 16), 9 << 16);
        assert_eq!(interpolate(&table, i32::MIN), -(7 << 16));
        assert_eq!(interpolate(&table, i32::MAX), 9 << 16);
    }
}
