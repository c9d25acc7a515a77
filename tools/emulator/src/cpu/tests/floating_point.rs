//! The floating-point unit: known values, and the exact way against the host's.

use super::{complete, halves, machine, with_floating_point};
use crate::cpu::float::{self, Rounding, Status};
use proptest::prelude::*;

const INVALID: u32 = 1;
const BY_ZERO: u32 = 2;
const OVERFLOW: u32 = 4;
const UNDERFLOW: u32 = 8;
const INEXACT: u32 = 16;
const FLUSH: u32 = 1 << 24;
const DEFAULT_NAN: u32 = 1 << 25;

/// Result and exception flags of an operation with modes.
fn with(modes: u32, operation: impl Fn(&mut Status) -> u32) -> (u32, u32) {
    let mut status = Status::from_bits(modes);
    let result = operation(&mut status);
    (result, status.bits() & 0x9f)
}

fn bits(value: f32) -> u32 {
    value.to_bits()
}

#[test]
fn nans_are_quieted_and_the_first_signalling_one_wins() {
    let (quiet, signalling) = (0x7fc1_2345, 0xff81_2345);
    assert_eq!(with(0, |s| float::add(quiet, signalling, s)), (0xffc1_2345, INVALID));
    assert_eq!(with(0, |s| float::add(bits(1.0), quiet, s)), (quiet, 0));
    assert_eq!(with(0, |s| float::multiply(quiet, 0xffc0_0001, s)), (quiet, 0), "the first of two quiet ones");
    assert_eq!(with(DEFAULT_NAN, |s| float::add(bits(1.0), quiet, s)), (0x7fc0_0000, 0));
    assert_eq!(with(0, |s| float::subtract(bits(f32::INFINITY), bits(f32::INFINITY), s)), (0x7fc0_0000, INVALID));
    assert_eq!(with(0, |s| float::square_root(bits(-1.0), s)), (0x7fc0_0000, INVALID));
    // A quiet addend does not hide infinity times zero.
    assert_eq!(with(0, |s| float::multiply_add(quiet, bits(f32::INFINITY), 0, s)), (0x7fc0_0000, INVALID));
}

#[test]
fn exceptions_are_flagged() {
    let (least, most) = (bits(f32::MIN_POSITIVE), bits(f32::MAX));
    assert_eq!(with(0, |s| float::divide(bits(1.0), 0, s)), (bits(f32::INFINITY), BY_ZERO));
    assert_eq!(with(0, |s| float::multiply(most, most, s)), (bits(f32::INFINITY), OVERFLOW | INEXACT));
    assert_eq!(with(0, |s| float::divide(bits(1.0), bits(3.0), s)), (bits(1.0 / 3.0), INEXACT));
    assert_eq!(with(0, |s| float::add(bits(1.0), bits(2.0), s)), (bits(3.0), 0));
    // Half of the least normal number is exact; a third is not.
    assert_eq!(with(0, |s| float::multiply(least, bits(0.5), s)), (0x0040_0000, 0));
    assert_eq!(with(0, |s| float::divide(least, bits(3.0), s)).1, UNDERFLOW | INEXACT);
    assert_eq!(with(FLUSH, |s| float::divide(least, bits(3.0), s)), (0, UNDERFLOW));
    assert_eq!(with(FLUSH, |s| float::add(0x0000_0001, bits(1.0), s)), (bits(1.0), 1 << 7));
}

#[test]
fn results_follow_the_rounding_mode() {
    let third = |mode: u32| with(mode << 22, |s| float::divide(bits(1.0), bits(3.0), s)).0;
    assert_eq!([third(0), third(1), third(2), third(3)], [0x3eaa_aaab, 0x3eaa_aaab, 0x3eaa_aaaa, 0x3eaa_aaaa]);
    let huge = |mode: u32| with(mode << 22, |s| float::multiply(bits(f32::MAX), bits(-2.0), s)).0;
    assert_eq!([huge(0), huge(1), huge(2), huge(3)], [0xff80_0000, 0xff7f_ffff, 0xff80_0000, 0xff7f_ffff]);
    let nothing = |mode: u32| with(mode << 22, |s| float::subtract(bits(1.5), bits(1.5), s)).0;
    assert_eq!([nothing(0), nothing(1), nothing(2), nothing(3)], [0, 0, 0x8000_0000, 0]);
}

#[test]
fn integers_saturate_and_round_as_asked() {
    let to = |value: f32, unsigned, rounding| with(0, |s| float::to_fixed(bits(value), 32, 0, unsigned, rounding, s));
    assert_eq!(to(2.5, false, None), (2, INEXACT));
    assert_eq!(to(-2.5, false, Some(Rounding::Zero)), ((-2i32) as u32, INEXACT));
    assert_eq!(to(3.5, false, None), (4, INEXACT));
    assert_eq!(to(3e9, false, Some(Rounding::Zero)), (i32::MAX as u32, INVALID));
    assert_eq!(to(-3e9, false, Some(Rounding::Zero)), (i32::MIN as u32, INVALID));
    assert_eq!(to(-0.5, true, Some(Rounding::Zero)), (0, INEXACT));
    assert_eq!(to(-1.0, true, Some(Rounding::Zero)), (0, INVALID));
    assert_eq!(to(f32::NAN, false, None), (0, INVALID));
    assert_eq!(to(f32::INFINITY, true, None), (u32::MAX, INVALID));
    // Q16.16, and 16 bits with their sign.
    assert_eq!(with(0, |s| float::to_fixed(bits(-1.5), 32, 16, false, Some(Rounding::Zero), s)), (0xfffe_8000, 0));
    assert_eq!(with(0, |s| float::to_fixed(bits(-1.5), 16, 8, false, Some(Rounding::Zero), s)), (0xffff_fe80, 0));
    assert_eq!(with(0, |s| float::from_fixed(0xfffe_8000, 32, 16, false, None, s)), (bits(-1.5), 0));
    assert_eq!(with(0, |s| float::from_fixed(0xffff_8000, 16, 0, true, None, s)), (bits(32768.0), 0));
}

#[test]
fn half_precision_has_its_own_range() {
    let to = |value: f32| with(0, |s| float::to_half(bits(value), s));
    assert_eq!(to(1.0), (0x3c00, 0));
    assert_eq!(to(65504.0), (0x7bff, 0));
    assert_eq!(to(65520.0), (0x7c00, OVERFLOW | INEXACT));
    assert_eq!(to(5.960_464_5e-8), (0x0001, 0), "the least there is");
    assert_eq!(with(1 << 26, |s| float::to_half(bits(65536.0), s)), (0x7c00, 0), "the alternative format goes on");
    // Every half-precision number comes back.
    for half in (0..0x1_0000u32).filter(|half| half >> 10 & 31 != 31) {
        let mut status = Status::default();
        let single = float::from_half(half, &mut status);
        assert_eq!((float::to_half(single, &mut status), status.bits()), (half, 0));
    }
}

#[test]
fn comparisons_set_flags_that_reach_the_core() {
    // vcmp.f32 s0, s1; vmrs apsr_nzcv, fpscr
    let flags = |a: f32, b: f32| {
        let mut code = halves(0xeeb4_0a60).to_vec();
        code.extend(halves(0xeef1_fa10));
        let mut cpu = with_floating_point(machine(&code));
        cpu.set_float_register(0, bits(a));
        cpu.set_float_register(1, bits(b));
        complete(&mut cpu);
        cpu.xpsr() >> 28
    };
    assert_eq!([flags(1.0, 2.0), flags(2.0, 1.0), flags(1.0, 1.0), flags(1.0, f32::NAN)], [8, 2, 6, 3]);
    assert_eq!(flags(0.0, -0.0), 6);
}

#[test]
fn registers_move_between_core_memory_and_unit() {
    let mut code = halves(0xee00_1a10).to_vec(); // vmov s0, r1
    code.extend(halves(0xeef0_0a08)); // vmov.f32 s1, #3.0
    code.extend(halves(0xec53_2a10)); // vmov r2, r3, s0, s1
    code.extend(halves(0xed2d_0a02)); // vpush {s0, s1}
    code.extend(halves(0xecbd_1a02)); // vpop {s2, s3}
    code.extend(halves(0xed9f_2a01)); // vldr s4, [pc, #4]
    let mut cpu = with_floating_point(machine(&code));
    cpu.set_register(1, 0x1234_5678);
    complete(&mut cpu);
    assert_eq!((cpu.register(2), cpu.register(3)), (0x1234_5678, bits(3.0)));
    assert_eq!((cpu.float_register(2), cpu.float_register(3)), (0x1234_5678, bits(3.0)));
    assert_eq!(cpu.register(13), super::STACK);
}

#[test]
fn multiply_accumulate_takes_three_cycles_and_a_division_fourteen() {
    let cycles = |encoding| {
        let mut cpu = with_floating_point(machine(&halves(encoding)));
        complete(&mut cpu);
        cpu.now() - 1
    };
    // vadd, vmla, vfma, vdiv, vsqrt of s0, s1, s2
    assert_eq!(cycles(0xee30_0a81), 1);
    assert_eq!([cycles(0xee00_0a81), cycles(0xeea0_0a81)], [3, 3]);
    assert_eq!([cycles(0xee80_0a81), cycles(0xeeb1_0ae0)], [14, 14]);
}

fn float() -> impl Strategy<Value = u32> {
    let special = vec![
        0,
        1 << 31,
        1,
        0x7f_ffff,
        0x80_0000,
        0x80_0001,
        0x3f80_0000,
        0xbf80_0000,
        0x7f7f_ffff,
        0x7f80_0000,
        0xff80_0000,
    ];
    prop_oneof![4 => any::<u32>(), 2 => 0x3f00_0000u32..0x4100_0000, 1 => prop::sample::select(special)]
}

/// The host's result, a NaN being any.
fn same(bits: u32, host: f32) -> bool {
    bits == host.to_bits() || f32::from_bits(bits).is_nan() && host.is_nan()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(20_000))]

    #[test]
    fn the_exact_way_agrees_with_the_host(a in float(), b in float(), c in float()) {
        let [x, y, z] = [a, b, c].map(f32::from_bits);
        // Without the inexact flag everything takes the exact way.
        let exact = |operation: &dyn Fn(&mut Status) -> u32| operation(&mut Status::default());
        prop_assert!(same(exact(&|s| float::add(a, b, s)), x + y));
        prop_assert!(same(exact(&|s| float::subtract(a, b, s)), x - y));
        prop_assert!(same(exact(&|s| float::multiply(a, b, s)), x * y));
        prop_assert!(same(exact(&|s| float::divide(a, b, s)), x / y));
        prop_assert!(same(exact(&|s| float::square_root(a, s)), x.sqrt()));
        prop_assert!(same(exact(&|s| float::multiply_add(c, a, b, s)), x.mul_add(y, z)));
    }

    #[test]
    fn both_ways_give_the_same_result_and_flags(a in float(), b in float(), c in float()) {
        let both = |operation: &dyn Fn(&mut Status) -> u32| {
            let (exact, flags) = with(0, operation);
            (with(INEXACT, operation), (exact, flags | INEXACT))
        };
        let pairs = [
            both(&|s| float::add(a, b, s)),
            both(&|s| float::multiply(a, b, s)),
            both(&|s| float::divide(a, b, s)),
            both(&|s| float::multiply_add(c, a, b, s)),
        ];
        for (fast, exact) in pairs {
            prop_assert_eq!(fast, exact);
        }
    }

    #[test]
    fn both_ways_convert_to_the_same_result_and_flags(
        a in float(), i: u32, bits in prop::sample::select(vec![16u32, 32]), fraction in 0u32..=32, unsigned: bool
    ) {
        let both = |operation: &dyn Fn(&mut Status) -> u32| {
            let (exact, flags) = with(0, operation);
            (with(INEXACT, operation), (exact, flags | INEXACT))
        };
        for (fast, exact) in [
            both(&|s| float::to_fixed(a, bits, fraction.min(bits), unsigned, Some(Rounding::Zero), s)),
            both(&|s| float::from_fixed(i, bits, fraction.min(bits), unsigned, None, s)),
        ] {
            prop_assert_eq!(fast, exact);
        }
    }

    #[test]
    fn comparisons_are_the_hosts_and_only_a_nan_is_invalid(a in float(), b in float(), signals: bool) {
        let (x, y) = (f32::from_bits(a), f32::from_bits(b));
        let (flags, exceptions) = with(0, |s| {
            float::compare(a, b, signals, s);
            s.bits() >> 28
        });
        let (less, equal, unordered) = (x < y, x == y, x.is_nan() || y.is_nan());
        prop_assert_eq!([flags & 8 != 0, flags & 4 != 0, flags & 1 != 0], [less, equal, unordered]);
        prop_assert_eq!(flags & 2 != 0, !less);
        let signalling = [(x, a), (y, b)].iter().any(|(x, bits)| x.is_nan() && bits & 0x40_0000 == 0);
        prop_assert_eq!(exceptions & INVALID != 0, unordered && (signals || signalling));
    }

    #[test]
    fn directed_rounding_encloses_the_exact_product(a in 0x3000_0000u32..0x4f00_0000, b in 0x3000_0000u32..0x4f00_0000) {
        let exact = f64::from(f32::from_bits(a)) * f64::from(f32::from_bits(b));
        let rounded = |mode: u32| f64::from(f32::from_bits(with(mode << 22, |s| float::multiply(a, b, s)).0));
        let (up, down, zero) = (rounded(1), rounded(2), rounded(3));
        prop_assert!(down <= exact && exact <= up && zero == down);
        let (_, flags) = with(0, |s| float::multiply(a, b, s));
        prop_assert_eq!(flags & INEXACT != 0, f64::from(exact as f32) != exact);
        prop_assert_eq!(up == down, f64::from(exact as f32) == exact);
    }

    #[test]
    fn conversions_agree_with_the_host(a in float(), i: u32) {
        let x = f32::from_bits(a);
        let to = |unsigned| with(0, |s| float::to_fixed(a, 32, 0, unsigned, Some(Rounding::Zero), s)).0;
        prop_assert_eq!((to(false), to(true)), (x as i32 as u32, x as u32));
        let from = |unsigned| with(0, |s| float::from_fixed(i, 32, 0, unsigned, None, s)).0;
        prop_assert_eq!((from(false), from(true)), (bits(i as i32 as f32), bits(i as f32)));
    }
}
