//! The DSP extension against independent arithmetic in wider integers.

use super::{complete, halves, machine};
use proptest::prelude::*;

/// Result of one instruction on r0 (d), r1 (n), r2 (m), r3 (a or the upper result): r0, r3, and whether Q was set.
fn run(encoding: u32, r: [u32; 4]) -> (u32, u32, bool) {
    let mut cpu = machine(&halves(encoding));
    for (register, value) in r.into_iter().enumerate() {
        cpu.set_register(register, value);
    }
    complete(&mut cpu);
    (cpu.register(0), cpu.register(3), cpu.xpsr() >> 27 & 1 != 0)
}

fn low(value: u32) -> i128 {
    i128::from(value as i16)
}

fn high(value: u32) -> i128 {
    i128::from((value >> 16) as i16)
}

fn signed(value: u32) -> i128 {
    i128::from(value as i32)
}

/// A sum that wraps and sets Q where it does.
fn wrapping(sum: i128) -> (u32, bool) {
    (sum as u32, sum != i128::from(sum as i32))
}

fn word() -> impl Strategy<Value = u32> {
    prop_oneof![
        4 => any::<u32>(),
        1 => prop::sample::select(vec![0, 1, 0x7fff, 0x8000, 0x8000_8000, 0x7fff_7fff, 0x8000_0000, 0x7fff_ffff, u32::MAX]),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn multiplications_of_half_words(n in word(), m in word(), a in word()) {
        let r = [9, n, m, a];
        let pick = |value, top| if top { high(value) } else { low(value) };
        for (bits, (x, y)) in [(false, false), (false, true), (true, false), (true, true)].into_iter().enumerate() {
            let product = pick(n, x) * pick(m, y);
            let field = (bits as u32) << 4;
            // smlaxy r0, r1, r2, r3; smulxy r0, r1, r2
            let (value, q) = wrapping(signed(a) + product);
            prop_assert_eq!(run(0xfb11_3002 | field, r), (value, a, q));
            prop_assert_eq!(run(0xfb11_f002 | field, r), (product as u32, a, false));
            // smlalxy r0, r3, r1, r2
            let sum = (i128::from(u64::from(a) << 32 | 9) + product) as u64;
            prop_assert_eq!(run(0xfbc1_0382 | field, r), (sum as u32, (sum >> 32) as u32, false));
        }
        for top in [false, true] {
            let field = u32::from(top) << 4;
            // smlawy r0, r1, r2, r3
            let (value, q) = wrapping(signed(a) + (signed(n) * pick(m, top)).div_euclid(1 << 16));
            prop_assert_eq!(run(0xfb31_3002 | field, r), (value, a, q));
            // smlad, smlsd, smuad, smusd, with m exchanged where `top`
            let (first, second) = (low(n) * pick(m, top), high(n) * pick(m, !top));
            let (value, q) = wrapping(signed(a) + first + second);
            prop_assert_eq!(run(0xfb21_3002 | field, r), (value, a, q));
            let (value, q) = wrapping(signed(a) + first - second);
            prop_assert_eq!(run(0xfb41_3002 | field, r), (value, a, q));
            let (value, q) = wrapping(first + second);
            prop_assert_eq!(run(0xfb21_f002 | field, r), (value, a, q));
            prop_assert_eq!(run(0xfb41_f002 | field, r), ((first - second) as u32, a, false));
            // smlald, smlsld r0, r3, r1, r2
            let accumulator = i128::from(u64::from(a) << 32 | 9);
            for (encoding, sum) in [(0xfbc1_03c2, first + second), (0xfbd1_03c2, first - second)] {
                let sum = (accumulator + sum) as u64;
                prop_assert_eq!(run(encoding | field, r), (sum as u32, (sum >> 32) as u32, false));
            }
        }
    }

    #[test]
    fn multiplications_of_words(d in word(), n in word(), m in word(), a in word()) {
        let r = [d, n, m, a];
        let product = signed(n) * signed(m);
        let wide = i128::from(n) * i128::from(m);
        for rounded in [0, 1] {
            // smmla, smmls, smmul, rounded or not
            let half = rounded << 31;
            let field = (rounded as u32) << 4;
            prop_assert_eq!(run(0xfb51_3002 | field, r).0, (((signed(a) << 32) + product + half) >> 32) as u32);
            prop_assert_eq!(run(0xfb61_3002 | field, r).0, (((signed(a) << 32) - product + half) >> 32) as u32);
            prop_assert_eq!(run(0xfb51_f002 | field, r).0, ((product + half) >> 32) as u32);
        }
        let two = |value: i128| (value as u32, (value >> 32) as u32, false);
        let accumulator = i128::from(u64::from(a) << 32 | u64::from(d));
        // smull, umull, smlal, umlal, umaal r0, r3, r1, r2
        prop_assert_eq!(run(0xfb81_0302, r), two(product));
        prop_assert_eq!(run(0xfba1_0302, r), two(wide));
        prop_assert_eq!(run(0xfbc1_0302, r), two(accumulator + product));
        prop_assert_eq!(run(0xfbe1_0302, r), two(accumulator + wide));
        prop_assert_eq!(run(0xfbe1_0362, r), two(wide + i128::from(d) + i128::from(a)));
        // mla, mls r0, r1, r2, r3
        prop_assert_eq!(run(0xfb01_3002, r).0, (i128::from(a) + wide) as u32);
        prop_assert_eq!(run(0xfb01_3012, r).0, (i128::from(a) - wide) as u32);
        // usada8 r0, r1, r2, r3
        let distance: u32 = (0..4).map(|i| (n >> (8 * i) & 0xff).abs_diff(m >> (8 * i) & 0xff)).sum();
        prop_assert_eq!(run(0xfb71_3002, r).0, a.wrapping_add(distance));
    }

    #[test]
    fn saturation(n in word(), m in word(), to in 0u32..32, shift in 1u32..32) {
        let r = [9, n, m, 9];
        let saturated = |value: i128| {
            let kept = value.clamp(i32::MIN.into(), i32::MAX.into());
            (kept as u32, kept != value)
        };
        let with_q = |(value, q): (u32, bool)| (value, 9, q);
        // qadd, qsub, qdadd, qdsub r0, r2, r1
        prop_assert_eq!(run(0xfa81_f082, r), with_q(saturated(signed(m) + signed(n))));
        prop_assert_eq!(run(0xfa81_f0a2, r), with_q(saturated(signed(m) - signed(n))));
        let (doubled, q) = saturated(2 * signed(n));
        let (sum, also) = saturated(signed(m) + signed(doubled));
        prop_assert_eq!(run(0xfa81_f092, r), (sum, 9, q | also));
        let (difference, also) = saturated(signed(m) - signed(doubled));
        prop_assert_eq!(run(0xfa81_f0b2, r), (difference, 9, q | also));
        // ssat r0, #to + 1, r1, asr #shift; usat r0, #to, r1, lsl #shift
        let amount = (shift >> 2) << 12 | (shift & 3) << 6;
        let value = signed(n) >> shift;
        let kept = value.clamp(-(1 << to), (1 << to) - 1);
        prop_assert_eq!(run(0xf321_0000 | amount | to, r), (kept as u32, 9, kept != value));
        let value = signed(n << shift);
        let kept = value.clamp(0, (1 << to) - 1);
        prop_assert_eq!(run(0xf381_0000 | amount | to, r), (kept as u32, 9, kept != value));
        // ssat16 r0, #to + 1, r1; usat16 r0, #to, r1
        let to = to & 15;
        let each = |least: i128, most: i128| {
            let (a, b) = (low(n).clamp(least, most), high(n).clamp(least, most));
            ((b as u32 & 0xffff) << 16 | a as u32 & 0xffff, 9, (a, b) != (low(n), high(n)))
        };
        prop_assert_eq!(run(0xf321_0000 | to, r), each(-(1 << to), (1 << to) - 1));
        prop_assert_eq!(run(0xf3a1_0000 | to, r), each(0, (1 << to) - 1));
    }

    #[test]
    fn lanes_in_parallel_and_the_flags_that_select(n in word(), m in word(), a in word()) {
        // Lane by lane: bits of a lane, and for each whether it subtracts and which lane of m it takes.
        type Lane = (bool, u32);
        let patterns: [(u32, u32, &[Lane]); 6] = [
            (0x90, 16, &[(false, 0), (false, 1)]),
            (0xa0, 16, &[(true, 1), (false, 0)]),
            (0xe0, 16, &[(false, 1), (true, 0)]),
            (0xd0, 16, &[(true, 0), (true, 1)]),
            (0x80, 8, &[(false, 0), (false, 1), (false, 2), (false, 3)]),
            (0xc0, 8, &[(true, 0), (true, 1), (true, 2), (true, 3)]),
        ];
        for (operation, bits, lanes) in patterns {
            for kind in 0..6 {
                let unsigned = kind >= 3;
                let field = |word: u32, lane: u32| {
                    let value = i128::from(word >> (lane * bits)) & ((1 << bits) - 1);
                    if unsigned || value >> (bits - 1) == 0 { value } else { value - (1 << bits) }
                };
                let (mut expected, mut flags) = (0, 0u32);
                for (lane, (subtracts, other)) in lanes.iter().enumerate() {
                    let lane = lane as u32;
                    let (first, second) = (field(n, lane), field(m, *other));
                    let exact = if *subtracts { first - second } else { first + second };
                    let (least, most) =
                        if unsigned { (0, (1 << bits) - 1) } else { (-(1 << (bits - 1)), (1 << (bits - 1)) - 1) };
                    let value = match kind % 3 {
                        0 => exact,
                        1 => exact.clamp(least, most),
                        _ => exact.div_euclid(2),
                    };
                    expected |= (value as u32 & ((1u64 << bits) - 1) as u32) << (lane * bits);
                    let set = if unsigned && !subtracts { exact > most } else { exact >= 0 };
                    if set {
                        flags |= ((1 << (bits / 8)) - 1) << (lane * bits / 8);
                    }
                }
                let suffix = [0x00, 0x10, 0x20, 0x40, 0x50, 0x60][kind as usize];
                let encoding = 0xfa01_f002 | operation << 16 | suffix;
                // The lanes, then sel r3, r1, r2.
                let mut code = halves(encoding).to_vec();
                code.extend(halves(0xfaa1_f382));
                let mut cpu = machine(&code);
                for (register, value) in [9, n, m, a].into_iter().enumerate() {
                    cpu.set_register(register, value);
                }
                complete(&mut cpu);
                prop_assert_eq!(cpu.register(0), expected, "{:#x}", encoding);
                if kind % 3 == 0 {
                    prop_assert_eq!(cpu.xpsr() >> 16 & 0xf, flags, "{:#x}", encoding);
                    let mask = (0..4).map(|i| if flags >> i & 1 == 1 { 0xff << (8 * i) } else { 0 }).sum::<u32>();
                    prop_assert_eq!(cpu.register(3), n & mask | m & !mask);
                }
            }
        }
    }

    #[test]
    fn half_words_are_packed(n in word(), m in word(), amount in 1u32..32) {
        let field = (amount >> 2) << 12 | (amount & 3) << 6;
        // pkhbt r0, r1, r2, lsl #amount; pkhtb r0, r1, r2, asr #amount
        let bottom = n & 0xffff | (m << amount) & 0xffff_0000;
        let top = n & 0xffff_0000 | (((m as i32) >> amount) as u32) & 0xffff;
        prop_assert_eq!(run(0xeac1_0002 | field, [9, n, m, 9]).0, bottom);
        prop_assert_eq!(run(0xeac1_0022 | field, [9, n, m, 9]).0, top);
    }
}
