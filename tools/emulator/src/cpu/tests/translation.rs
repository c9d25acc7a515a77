//! Translated code against single steps, with random instructions of those that are translated: registers, flags,
//! memory, cycles and counts.

use super::{DATA, START, machine, steps_to, with_floating_point};
use crate::cpu::{Cpu, End};
use crate::memory::Memory;
use proptest::prelude::*;

/// Encodings by their fixed bits: mask and bits of an instruction's half-words; of the others, random ones are filled
/// in. r7 is the address of data that is a multiple of 4, and is not changed.
const KINDS: &[(&str, u32, u32)] = &[
    ("shift by a constant, narrow", 0xffff_e000, 0x0000),
    ("shift by a constant, narrow", 0xffff_e000, 0x0000),
    ("add and subtract, narrow", 0xffff_f800, 0x1800),
    ("with a byte, r0", 0xffff_e700, 0x2000),
    ("with a byte, r3", 0xffff_e700, 0x2300),
    ("data processing, narrow", 0xffff_fc00, 0x4000),
    ("add, high registers", 0xffff_ff80, 0x4400),
    ("mov, high registers", 0xffff_ff80, 0x4600),
    ("extend, narrow", 0xffff_ff00, 0xb200),
    ("shifted register", 0xfe00_8000, 0xea00_0000),
    ("shifted register", 0xfe00_8000, 0xea00_0000),
    ("constant", 0xfa00_8000, 0xf000_0000),
    ("constant", 0xfa00_8000, 0xf000_0000),
    ("plain constant", 0xfa00_8000, 0xf200_0000),
    ("bfi", 0xfff0_8020, 0xf360_0000),
    ("ubfx", 0xfff0_8020, 0xf3c0_0000),
    ("sbfx", 0xfff0_8020, 0xf340_0000),
    ("shift by a register, extend", 0xff00_f040, 0xfa00_f000),
    ("extend", 0xff80_f0c0, 0xfa00_f080),
    ("clz", 0xfff0_f0f0, 0xfab0_f080),
    ("mla, mls", 0xfff0_00e0, 0xfb00_0000),
    ("smmla", 0xfff0_00e0, 0xfb50_0000),
    ("smull", 0xfff0_00f0, 0xfb80_0000),
    ("umull", 0xfff0_00f0, 0xfba0_0000),
    ("smlal", 0xfff0_00f0, 0xfbc0_0000),
    ("umlal", 0xfff0_00f0, 0xfbe0_0000),
    ("sdiv, udiv", 0xffd0_f0f0, 0xfb90_f0f0),
    ("str, ldr of r7, narrow", 0xffff_e638, 0x6038),
    ("strh, ldrh of r7, narrow", 0xffff_f638, 0x8038),
    ("loads and stores of r7, 12 bits", 0xfe8f_0fc0, 0xf887_0000),
    ("ldrsb, ldrsh of r7", 0xff9f_0fc0, 0xf997_0000),
    ("ldr, str of r7, below or indexed", 0xffef_0fc0, 0xf847_0000),
    ("ldr, str of r7, 8 bits", 0xffef_0fc0, 0xf847_0c00),
    ("ldr of the program counter", 0xffff_fff0, 0x4800),
    ("ldrd, strd of r7", 0xffef_00f0, 0xe9c7_0000),
    ("ldrex", 0xffff_0ff0, 0xe857_0f00),
    ("strex", 0xffff_00f0, 0xe847_0000),
    ("push", 0xffff_ff80, 0xb400),
    ("pop", 0xffff_ff80, 0xbc00),
    ("stm of r7", 0xffff_ff80, 0xe887_0000),
    ("ldm of r7", 0xffff_ff80, 0xe897_0000),
    ("it", 0xffff_ff00, 0xbf00),
    ("it", 0xffff_ff00, 0xbf00),
    ("branch over one", 0xffff_f0ff, 0xd000),
    ("cbz over one", 0xffff_f7f8, 0xb100),
    ("vadd, vmul and their like", 0xff00_0f10, 0xee00_0a00),
    ("vadd, vmul and their like", 0xff00_0f10, 0xee00_0a00),
    ("vadd, vsub", 0xffb0_0f10, 0xee30_0a00),
    ("vmla, vmls", 0xffb0_0f10, 0xee00_0a00),
    ("vcmp and moves", 0xffb8_0f50, 0xeeb0_0a40),
    ("conversions", 0xffb8_0f50, 0xeeb8_0a40),
    ("vcmp", 0xffbe_0f50, 0xeeb4_0a40),
    ("vmrs", 0xffff_ffff, 0xeef1_fa10),
    ("vmov of a constant", 0xffb0_0ff0, 0xeeb0_0a00),
    ("vmov to and from", 0xffe0_0f7f, 0xee00_0a10),
    ("vldr, vstr of r7", 0xffaf_0ff0, 0xed87_0a00),
    ("vldr of the program counter", 0xffbf_0ff0, 0xed9f_0a00),
    ("vldm, vstm of r7", 0xffaf_0ffc, 0xec87_0a00),
];

/// An instruction: its kind, and random bits for what is not fixed.
fn instruction((kind, random): (usize, u32)) -> Vec<u16> {
    let Some((name, mask, bits)) = KINDS.get(kind % KINDS.len()) else { return Vec::new() };
    let word = bits | random & !mask;
    match (mask >> 16 == 0xffff && bits >> 16 == 0, name.starts_with("branch") || name.starts_with("cbz")) {
        (true, true) => vec![word as u16, 0xbf00],
        (true, false) => vec![word as u16],
        _ => vec![(word >> 16) as u16, word as u16],
    }
}

/// All of them many times around; a breakpoint follows. What changes r7 or the stack pointer is left out, as is what is
/// not defined.
fn looped(instructions: &[(usize, u32)], registers: &[u32; 7], floats: &[u32; 8], usual: bool) -> Cpu<Memory> {
    let mut code = Vec::new();
    for halves in instructions.iter().map(|chosen| instruction(*chosen)) {
        let alone = executes(&halves);
        if alone {
            code.extend(halves);
        }
    }
    // nop, nop, nop, nop for the last IT block; ldr of a counter on the stack's end, subs, str, bne.w to the beginning.
    code.extend([0xbf00; 4]);
    code.extend([0xf8dd, 0xc040, 0xf1bc, 0x0c01, 0xf8cd, 0xc040]);
    code.extend(branch_if_not_equal(-(2 * code.len() as i32) - 4));
    let mut cpu = with_floating_point(machine(&code));
    prepare(&mut cpu, registers, floats, usual);
    cpu
}

/// BNE.W, so many bytes from behind it.
fn branch_if_not_equal(offset: i32) -> [u16; 2] {
    let bits = |low: u32, count: u32, to: u32| (offset as u32 >> low & ((1 << count) - 1)) << to;
    let first = 0xf040 | bits(20, 1, 10) | bits(12, 6, 0);
    let second = 0x8000 | bits(18, 1, 13) | bits(19, 1, 11) | bits(1, 11, 0);
    [first as u16, second as u16]
}

fn prepare(cpu: &mut Cpu<Memory>, registers: &[u32; 7], floats: &[u32; 8], usual: bool) {
    cpu.bus.wait_states = 3;
    cpu.set_register(13, DATA + 0x400);
    cpu.bus.set(DATA + 0x440, &6u32.to_le_bytes());
    for (number, value) in registers.iter().enumerate() {
        cpu.set_register(number, *value);
    }
    cpu.set_register(7, DATA + 0x40);
    for number in 0..32 {
        cpu.set_float_register(number, floats[number % 8]);
    }
    cpu.set_fpscr(if usual { 0x10 } else { 0 });
}

/// Returns `true` if an instruction is defined and leaves r7 and the stack pointer as they are: tried by itself.
fn executes(halves: &[u16]) -> bool {
    // IT, and branches over one instruction.
    let first = halves.first().copied().unwrap_or(0);
    if first >> 8 == 0xbf && first & 0xf != 0 && first & 0xe0 != 0xe0 {
        return true;
    }
    if halves.get(1) == Some(&0xbf00) {
        return first >> 8 < 0xde;
    }
    // Hints would sleep.
    if first & 0xff0f == 0xbf00 {
        return false;
    }
    let mut cpu = with_floating_point(machine(halves));
    prepare(&mut cpu, &[1; 7], &[0; 8], true);
    let end = cpu.step();
    let moved = cpu.register(13).wrapping_sub(DATA + 0x380) < 0x100;
    end.is_none() && cpu.register(7) == DATA + 0x40 && moved && cpu.exception() == 0
}

fn state(cpu: &Cpu<Memory>) -> (Vec<u32>, u32, u64, u64, Vec<u8>) {
    let mut registers: Vec<u32> = (0..16).map(|number| cpu.register(number)).collect();
    registers.extend((0..32).map(|number| cpu.float_register(number)).chain([cpu.fpscr()]));
    let memory = cpu.bus.bytes(DATA, 0x800).expect("data").to_vec();
    (registers, cpu.xpsr(), cpu.now(), cpu.instructions(), memory)
}

/// The code's half-words.
fn listing(cpu: &Cpu<Memory>) -> String {
    let bytes = cpu.bus.bytes(START, 0x200).unwrap_or_default();
    let halves = bytes.chunks_exact(2).map(|half| u16::from_le_bytes([half[0], half[1]]));
    halves.take_while(|half| *half != 0xbe00).map(|half| format!("{half:04x} ")).collect()
}

/// Numbers that floating-point code has: ordinary ones, zeros, and everything else.
fn float() -> impl Strategy<Value = u32> {
    prop_oneof![4 => (-1e3f32..1e3).prop_map(f32::to_bits), 1 => Just(0), 1 => Just(0x8000_0000), 1 => any::<u32>()]
}

/// Code that goes round and round, translated as soon as it does.
fn endless(code: &[u16]) -> Cpu<Memory> {
    let mut code = code.to_vec();
    // b to the beginning.
    code.push(0xe000 | (-(code.len() as i32) - 2) as u16 & 0x7ff);
    let mut cpu = machine(&code);
    cpu.set_translation(Some(1));
    cpu
}

fn run(cpu: &mut Cpu<Memory>, cycles: u64) {
    assert_eq!(cpu.run(cpu.now() + cycles), End::Time);
}

#[test]
fn code_that_has_changed_is_not_what_was_translated() {
    // adds r0, #1, further behind the beginning than a stretch is long.
    let mut code = [0xbf00; 101];
    code[100] = 0x3001;
    let mut cpu = endless(&code);
    run(&mut cpu, 2000);
    let counted = cpu.register(0);
    assert!(counted > 15);
    // subs r0, #1
    assert!(cpu.bus.set(START + 200, &0x3801u16.to_le_bytes()));
    run(&mut cpu, 4000);
    assert!((cpu.register(0) as i32) < counted as i32 - 20, "{}", cpu.register(0) as i32);
}

#[test]
fn a_translation_waits_for_the_rest_behind_the_one_before_and_changes_nothing() {
    let mut counted = None;
    for (rest, one) in [(None, false), (Some(0), false), (Some(u32::MAX), true)] {
        // adds r0, #1, further behind the beginning than a stretch is long.
        let mut code = [0xbf00; 101];
        code[100] = 0x3001;
        let mut cpu = endless(&code);
        if let Some(times) = rest {
            cpu.set_rest_between_translations(times);
        }
        run(&mut cpu, 20_000);
        // subs r0, #1: what was translated is to be translated anew.
        assert!(cpu.bus.set(START + 200, &0x3801u16.to_le_bytes()));
        run(&mut cpu, 60_000);
        assert_eq!(cpu.code.translations.functions.len() == 1, one, "{rest:?}");
        assert_eq!(*counted.get_or_insert(cpu.register(0)), cpu.register(0), "{rest:?}");
    }
}

#[test]
fn a_word_of_code_that_has_changed_is_loaded_as_it_is() {
    // ldr r0, [pc, #508]; adds r1, r1, r0
    let mut cpu = endless(&[0x487f, 0x1809]);
    let word = START + 4 + 508;
    assert!(cpu.bus.set(word, &7u32.to_le_bytes()));
    run(&mut cpu, 1000);
    assert_eq!(cpu.register(0), 7);
    assert!(cpu.bus.set(word, &8u32.to_le_bytes()));
    let mut stepped = cpu.clone();
    run(&mut cpu, 1000);
    assert_eq!(steps_to(&mut stepped, cpu.now()), None);
    assert_eq!(state(&cpu), state(&stepped));
}

#[test]
fn wait_states_that_have_changed_count() {
    let mut cpu = endless(&[0x3001]);
    run(&mut cpu, 1000);
    cpu.bus.wait_states = 4;
    let mut stepped = cpu.clone();
    run(&mut cpu, 1000);
    assert_eq!(steps_to(&mut stepped, cpu.now()), None);
    assert_eq!(state(&cpu), state(&stepped));
}

#[test]
fn behind_the_last_byte_of_memory_nothing_is_accessed() {
    let end = 0x2000_9000;
    // ldr r0, [r7]; ldrh; ldrb; str; strh; strb; ldm r7, {r0, r1}; stm.w; vldr s0, [r7] and what it takes of memory.
    let accesses: [(&[u16], u32); 9] = [
        (&[0x6838], 4),
        (&[0x8838], 2),
        (&[0x7838], 1),
        (&[0x6038], 4),
        (&[0x8038], 2),
        (&[0x7038], 1),
        (&[0xe897, 0x0003], 8),
        (&[0xe887, 0x0003], 8),
        (&[0xed97, 0x0a00], 4),
    ];
    for (access, bytes) in accesses {
        let mut cpu = with_floating_point(endless(access));
        cpu.set_register(7, end - bytes);
        run(&mut cpu, 1000);
        assert_eq!(cpu.fault_status(), (0, 0), "{access:x?}");
        cpu.set_register(7, end);
        run(&mut cpu, 20);
        assert_ne!(cpu.fault_status(), (0, 0), "{access:x?}");
    }
}

#[test]
fn memory_that_is_gone_is_not_accessed() {
    // str r0, [r7]
    let mut cpu = endless(&[0x6038]);
    cpu.set_register(7, DATA);
    run(&mut cpu, 1000);
    let mut other = Memory::new().with(0x0800_0000..0x0800_3800, true);
    std::mem::swap(&mut cpu.bus, &mut other);
    let end = cpu.run(cpu.now() + 1000);
    assert!(matches!(end, End::Lockup(_)) || cpu.exception() != 0, "{end}");
}

proptest! {
    #[test]
    fn translated_code_does_what_its_instructions_do(
        instructions in prop::collection::vec((0..KINDS.len(), any::<u32>()), 1..40),
        registers in prop::array::uniform7(prop_oneof![any::<u32>(), 0u32..40, Just(u32::MAX), Just(0x8000_0000)]),
        floats in prop::array::uniform8(float()),
        usual in prop::bool::weighted(0.9),
        parts in prop::collection::vec(1u64..400, 1..20),
    ) {
        let mut runs = looped(&instructions, &registers, &floats, usual);
        let mut steps = runs.clone();
        runs.set_translation(Some(1));
        for part in parts.iter().cycle() {
            let until = runs.now() + part;
            let (end, stepped) = (runs.run(until), steps_to(&mut steps, until));
            // A step goes on to the first instruction of a fault's handler.
            if runs.exception() != 0 || steps.exception() != 0 {
                break;
            }
            prop_assert_eq!(state(&runs), state(&steps), "{}", listing(&runs));
            prop_assert_eq!(stepped, if end == End::Time { None } else { Some(end.clone()) });
            if end != End::Time || runs.now() > 20_000 {
                break;
            }
        }
    }
}
