//! Arithmetic, logic, shifts, bit fields, IT.

use super::{complete, finish, halves, machine};
use crate::cpu::arithmetic::{ARITHMETIC, EXTEND, LEFT, RIGHT, ROTATE, add_with_carry, expanded, shift};
use crate::cpu::{End, Refused};
use proptest::prelude::*;

/// Runs one wide instruction on r1, r2 and r0, with all flags clear or set; r0 and the program status register.
fn wide(encoding: u32, r1: u32, r2: u32, r0: u32, flags: u32) -> (u32, u32) {
    let mut cpu = machine(&halves(encoding));
    cpu.set_register(0, r0);
    cpu.set_register(1, r1);
    cpu.set_register(2, r2);
    cpu.set_xpsr(flags | 1 << 24);
    complete(&mut cpu);
    (cpu.register(0), cpu.xpsr() & 0xf800_0000)
}

const N: u32 = 1 << 31;
const Z: u32 = 1 << 30;
const C: u32 = 1 << 29;
const V: u32 = 1 << 28;

#[test]
fn sums_set_carry_and_overflow_as_the_pseudo_code_does() {
    // adds r0, r1, r2
    let adds = |a, b| wide(0xeb11_0002, a, b, 0, 0);
    assert_eq!(adds(1, 2), (3, 0));
    assert_eq!(adds(0xffff_ffff, 1), (0, Z | C));
    assert_eq!(adds(0x7fff_ffff, 1), (0x8000_0000, N | V));
    assert_eq!(adds(0x8000_0000, 0x8000_0000), (0, Z | C | V));
    // subs r0, r1, r2
    let subs = |a, b| wide(0xebb1_0002, a, b, 0, 0);
    assert_eq!(subs(5, 5), (0, Z | C));
    assert_eq!(subs(4, 5), (0xffff_ffff, N));
    assert_eq!(subs(0x8000_0000, 1), (0x7fff_ffff, C | V));
    // sbcs r0, r1, r2 without and with carry
    assert_eq!(wide(0xeb71_0002, 5, 5, 0, 0), (0xffff_ffff, N));
    assert_eq!(wide(0xeb71_0002, 5, 5, 0, C), (0, Z | C));
    // adcs r0, r1, r2 with carry
    assert_eq!(wide(0xeb51_0002, 0xffff_ffff, 0, 0, C), (0, Z | C));
    // rsbs r0, r1, r2
    assert_eq!(wide(0xebd1_0002, 3, 10, 0, 0), (7, C));
}

#[test]
fn a_rotated_constant_sets_the_carry_of_a_logical_operation() {
    // ands r0, r1, #0x80000000; ands r0, r1, #0x00ff00ff
    assert_eq!(wide(0xf011_4000, 0xffff_ffff, 0, 0, 0), (0x8000_0000, N | C));
    assert_eq!(wide(0xf011_10ff, 0xffff_ffff, 0, 0, C | V), (0x00ff_00ff, C | V), "kept");
    assert_eq!(expanded(0x0ab), Some((0xab, 0)));
    assert_eq!(expanded(0x1ab), Some((0x00ab_00ab, 0)));
    assert_eq!(expanded(0x2ab), Some((0xab00_ab00, 0)));
    assert_eq!(expanded(0x3ab), Some((0xabab_abab, 0)));
    assert_eq!(expanded(0x42b), Some((0xab00_0000, 2)));
    assert_eq!(expanded(0xfff), Some((0x1fe, 1)));
    assert_eq!((expanded(0x100), expanded(0x300)), (None, None), "unpredictable");
}

#[test]
fn shifts_by_more_than_a_word_are_defined() {
    let all = |kind, amount| shift(kind, 0x8000_0001, amount, false);
    assert_eq!(
        [all(LEFT, 0), all(LEFT, 1), all(LEFT, 32), all(LEFT, 33)],
        [(0x8000_0001, false), (2, true), (0, true), (0, false)]
    );
    assert_eq!([all(RIGHT, 1), all(RIGHT, 32), all(RIGHT, 255)], [(0x4000_0000, true), (0, true), (0, false)]);
    assert_eq!([all(ARITHMETIC, 1), all(ARITHMETIC, 40)], [(0xc000_0000, true), (0xffff_ffff, true)]);
    assert_eq!([all(ROTATE, 1), all(ROTATE, 32)], [(0xc000_0000, true), (0x8000_0001, true)]);
    assert_eq!(shift(EXTEND, 3, 1, true), (0x8000_0001, true));
}

#[test]
fn bit_fields_are_inserted_and_extracted() {
    // bfi r0, r1, #8, #12
    assert_eq!(wide(0xf361_2013, 0xabc, 0, 0xffff_ffff, 0).0, 0xfffa_bcff);
    // bfc r0, #8, #12
    assert_eq!(wide(0xf36f_2013, 0, 0, 0xffff_ffff, 0).0, 0xfff0_00ff);
    // ubfx r0, r1, #8, #12; sbfx r0, r1, #8, #12
    assert_eq!(wide(0xf3c1_200b, 0x000f_bc00, 0, 0, 0).0, 0xfbc);
    assert_eq!(wide(0xf341_200b, 0x000f_bc00, 0, 0, 0).0, 0xffff_ffbc);
    // ubfx r0, r1, #0, #32
    assert_eq!(wide(0xf3c1_001f, 0x1234_5678, 0, 0, 0).0, 0x1234_5678);
}

#[test]
fn bytes_and_bits_are_reversed_and_counted() {
    let value = 0x1234_5680;
    // rev, rev16, rbit, revsh, clz: r0 from r1
    assert_eq!(wide(0xfa91_f081, value, 0, 0, 0).0, 0x8056_3412);
    assert_eq!(wide(0xfa91_f091, value, 0, 0, 0).0, 0x3412_8056);
    assert_eq!(wide(0xfa91_f0a1, value, 0, 0, 0).0, value.reverse_bits());
    assert_eq!(wide(0xfa91_f0b1, value, 0, 0, 0).0, 0xffff_8056);
    assert_eq!(wide(0xfab1_f081, 0x0000_1000, 0, 0, 0).0, 19);
    assert_eq!(wide(0xfab1_f081, 0, 0, 0, 0).0, 32);
}

#[test]
fn extensions_rotate_first_and_add_afterwards() {
    // uxtab r0, r1, r2, ror #8; sxtah r0, r1, r2, ror #16; uxtb16 r0, r2; sxtab16 r0, r1, r2
    assert_eq!(wide(0xfa51_f092, 1000, 0x1234_5678, 0, 0).0, 1000 + 0x56);
    assert_eq!(wide(0xfa01_f0a2, 1000, 0xfffe_0000, 0, 0).0, 998);
    assert_eq!(wide(0xfa3f_f082, 0, 0x12f4_56f8, 0, 0).0, 0x00f4_00f8);
    assert_eq!(wide(0xfa21_f082, 0x0001_ffff, 0x00ff_0001, 0, 0).0, 0x0000_0000);
}

#[test]
fn divisions_round_towards_zero_and_give_zero_for_zero() {
    // sdiv r0, r1, r2; udiv r0, r1, r2
    let sdiv = |a: i32, b: i32| wide(0xfb91_f0f2, a as u32, b as u32, 9, 0).0 as i32;
    assert_eq!([sdiv(7, -2), sdiv(-7, 2), sdiv(i32::MIN, -1), sdiv(5, 0)], [-3, -3, i32::MIN, 0]);
    assert_eq!(wide(0xfbb1_f0f2, 0xffff_fffe, 3, 0, 0).0, 0x5555_5554);
}

#[test]
fn narrow_instructions_set_flags_only_outside_of_an_it_block() {
    // subs r0, r1, r1 before; itte eq; moveq r2, #1; addeq r3, r2, r2; movne r4, #1; cmp in a block does set flags
    let mut cpu = machine(&[0x1a48, 0xbf06, 0x2201, 0x1893, 0x2401]);
    cpu.set_register(1, 77);
    complete(&mut cpu);
    assert_eq!([2, 3, 4].map(|n| cpu.register(n)), [1, 2, 0]);
    assert_eq!(cpu.xpsr() & 0xf000_0000, Z | C, "those of the subtraction");
    // movs r0, #0; it eq; cmpeq r0, #1
    let mut cpu = machine(&[0x2000, 0xbf08, 0x2801]);
    complete(&mut cpu);
    assert_eq!(cpu.xpsr() & 0xf000_0000, N);
}

#[test]
fn what_is_skipped_takes_one_cycle() {
    // movs r0, #1; itt eq; ldreq r1, [r2]; moveq r3, r3: one for each
    let mut cpu = machine(&[0x2001, 0xbf04, 0x6811, 0x461b]);
    complete(&mut cpu);
    // The breakpoint counts for one.
    assert_eq!((cpu.now(), cpu.instructions()), (5, 5));
}

#[test]
fn what_the_architecture_leaves_open_ends_the_run_with_address_and_encoding() {
    let refused = |encoding: u32| finish(&mut machine(&halves(encoding)));
    let expected = |encoding, why| End::Refused { address: super::START, encoding, why };
    // add.w r13, r1, r2; ldr.w r1, [r1], #4; udiv r0, r1, r15; bfi with the width negative
    for encoding in [0xeb01_0d02, 0xf851_1b04, 0xfbb1_f0ff, 0xf361_2002] {
        assert_eq!(refused(encoding), expected(encoding, Refused::Unpredictable), "{encoding:#x}");
    }
    // vadd.f64; a coprocessor that there is not; smlaltt with a wrong number
    for encoding in [0xee31_0b02, 0xee01_0110, 0xfbc1_0272] {
        assert_eq!(refused(encoding), expected(encoding, Refused::Unknown), "{encoding:#x}");
    }
}

#[test]
fn nothing_of_a_refused_instruction_takes_effect() {
    let mut cpu = machine(&halves(0xf851_1b04));
    cpu.set_register(1, super::DATA);
    finish(&mut cpu);
    assert_eq!((cpu.register(1), cpu.register(15)), (super::DATA, super::START));
}

proptest! {
    #[test]
    fn sums_agree_with_wider_integers(a: u32, b: u32, carry: bool) {
        let (sum, carry_out, overflow) = add_with_carry(a, b, carry);
        let unsigned = u64::from(a) + u64::from(b) + u64::from(carry);
        let signed = i64::from(a as i32) + i64::from(b as i32) + i64::from(carry);
        prop_assert_eq!(sum, unsigned as u32);
        prop_assert_eq!(carry_out, unsigned > u64::from(u32::MAX));
        prop_assert_eq!(overflow, signed != i64::from(signed as i32));
    }

    #[test]
    fn shifts_agree_with_one_bit_at_a_time(value: u32, amount in 0u32..256, carry: bool, kind in 0u8..4) {
        let mut expected = (value, carry);
        for _ in 0..amount {
            let (value, _) = expected;
            expected = match kind {
                LEFT => (value << 1, value >> 31 != 0),
                RIGHT => (value >> 1, value & 1 != 0),
                ARITHMETIC => (((value as i32) >> 1) as u32, value & 1 != 0),
                _ => (value.rotate_right(1), value & 1 != 0),
            };
        }
        prop_assert_eq!(shift(kind, value, amount, carry), expected);
    }
}
