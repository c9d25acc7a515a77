//! Stretches, and what is translated of them, against single steps: the same registers, flags, memory, cycles and
//! counts, wherever a run ends.

use super::{DATA, START, machine, steps_to, with_floating_point};
use crate::cpu::{Cpu, End};
use crate::memory::Memory;
use proptest::prelude::*;

/// Instructions that stretches are made of, and that end them; r7 is the address of the data.
const PIECES: &[&[u16]] = &[
    // movs r0, #1; adds r0, #1; adds r0, r0, r1; cmp r0, #2; cmp r0, r1; lsls r2, r0, #3
    &[0x2001],
    &[0x3001],
    &[0x1840],
    &[0x2802],
    &[0x4288],
    &[0x00c2],
    // ldr r0, [r7]; str r1, [r7, #4]; ldr r1, [r7, #4]; ldr.w r3, [r7, #1], which is not aligned; ldr r2, [pc, #4],
    // from flash
    &[0x6838],
    &[0x6079],
    &[0x6879],
    &[0xf8d7, 0x3001],
    &[0x4a01],
    // push {r0, r1}; pop {r1, r2}; bl to the next instruction
    &[0xb403],
    &[0xbc06],
    &[0xf000, 0xf800],
    // beq over a nop; it eq, moveq r1, #5; ite ne, ldrne r0, [r7], moveq r2, #2; it cs, cmpcs r1, #1
    &[0xd000, 0xbf00],
    &[0xbf08, 0x2105],
    &[0xbf14, 0x6838, 0x2202],
    &[0xbf28, 0x2901],
    // itt eq, streq.w r0, [r7, #3], which is not aligned, addeq r0, #1; mrs r3, apsr; cpsid i; cpsie i
    &[0xbf04, 0xf8c7, 0x0003, 0x3001],
    &[0xf3ef, 0x8300],
    &[0xb672],
    &[0xb662],
    // ldrd r1, r2, [r7]; strd r0, r1, [r7, #8]; itt ne, ldrne.w r1, [r7, #5], which is not aligned, ldrne r2, [r7]
    &[0xe9d7, 0x1200],
    &[0xe9c7, 0x0102],
    &[0xbf1c, 0xf8d7, 0x1005, 0x683a],
    // ldrd r1, r2, [pc, #8], from flash; movs r4, #0, msr control, r4: the floating-point unit has to be prepared
    // again
    &[0xe9df, 0x1202],
    &[0x2400, 0xf384, 0x8814],
    // vmov s0, r0; vldr s1, [r7]; vadd.f32 s0, s0, s1; vcmp.f32 s0, #0; vmrs apsr_nzcv, fpscr; vpush {s0, s1}; vpop
    // {s1, s2}; vstr s2, [r7, #12]
    &[0xee00, 0x0a10],
    &[0xedd7, 0x0a00],
    &[0xee30, 0x0a20],
    &[0xeeb5, 0x0a40],
    &[0xeef1, 0xfa10],
    &[0xed2d, 0x0a02],
    &[0xecfd, 0x0a02],
    &[0xed87, 0x1a03],
    // Pairs: movw r2, #0x1234, movt r2, #0x5678; ldr r0, [r7], ldr r1, [r7, #4]; ldr r0, [r7], ldr.w r1, [r7, #6],
    // which is not aligned; str r0, [r7], str r2, [r7, #12]; dmb, cbz r0 over a nop; cmp r0, #3, bhs over a nop;
    // subs r1, #1, bne over a nop
    &[0xf241, 0x2234, 0xf2c5, 0x6278],
    &[0x6838, 0x6879],
    &[0x6838, 0xf8d7, 0x1006],
    &[0x6038, 0x60fa],
    &[0xf3bf, 0x8f5f, 0xb100, 0xbf00],
    &[0x2803, 0xd200, 0xbf00],
    &[0x3901, 0xd100, 0xbf00],
    // vmov.f32 s0, s1, vmov.f32 s2, s0; vmul.f32 s0, s1, s2, vmul.f32 s1, s0, s0; vldr s0, [r7], vldr s1, [r7, #8];
    // vstr s0, [r7, #8], vstr s1, [r7]; vldr s0, [r7], vldr s1, [pc, #8], from flash; add.w r5, r7, #4, vldr s2, [r5];
    // the same of r8, which is where the code begins
    &[0xeeb0, 0x0a60, 0xeeb0, 0x1a40],
    &[0xee20, 0x0a81, 0xee60, 0x0a00],
    &[0xed97, 0x0a00, 0xedd7, 0x0a02],
    &[0xed87, 0x0a02, 0xedc7, 0x0a00],
    &[0xed97, 0x0a00, 0xeddf, 0x0a02],
    &[0xf107, 0x0504, 0xed95, 0x1a00],
    &[0xf108, 0x0504, 0xed95, 0x1a00],
    // push {r0, r1}, add r5, sp, #4, pop {r1, r2}; vmov.f32 s0, s1, vldr s2, [r7, #4]; vldr s0, [r7], vadd.f32 s1, s0,
    // s2; vldr s1, [r7, #4], vmul.f32 s0, s1, s1
    &[0xb403, 0xad01, 0xbc06],
    &[0xeeb0, 0x0a60, 0xed97, 0x1a01],
    &[0xed97, 0x0a00, 0xee70, 0x0a01],
    &[0xedd7, 0x0a01, 0xee20, 0x0aa0],
    // Moves behind what sets the flags: cmp r0, #2, ite ne, movne r1, #7, moveq r1, r2; cmp r0, r1, it lt, movlt r0,
    // r1; cmp r1, #0, it mi, vmovmi.f32 s0, s1; vcmp.f32 s0, s1, vmrs, it gt, movgt r0, #4; the same, it ls,
    // vmovls.f32 s1, s0; vmrs, itt hi, movhi r2, r0, addhi r2, #1
    &[0x2802, 0xbf14, 0x2107, 0x4611],
    &[0x4288, 0xbfb8, 0x4608],
    &[0x2900, 0xbf48, 0xeeb0, 0x0a60],
    &[0xeeb4, 0x0a60, 0xeef1, 0xfa10, 0xbfc8, 0x2004],
    &[0xeeb4, 0x0a60, 0xeef1, 0xfa10, 0xbf98, 0xeef0, 0x0a40],
    &[0xeef1, 0xfa10, 0xbf84, 0x4602, 0x3201],
    // itte eq, moveq r0, #1, moveq r1, r0, ldrne r2, [r7]
    &[0xbf06, 0x2001, 0x4601, 0x683a],
    // ite ge, vmovge.f32 s0, s1, vaddlt.f32 s1, s1, s0
    &[0xbfac, 0xeeb0, 0x0a60, 0xee70, 0x0a80],
];

/// All pieces five times around; a breakpoint follows. SRAM does not answer before cycle `stalled`.
fn looped(pieces: &[usize], wait_states: u32, stalled: u64) -> Cpu<Memory> {
    let mut code: Vec<u16> =
        pieces.iter().filter_map(|piece| PIECES.get(*piece)).flat_map(|piece| piece.to_vec()).collect();
    // subs r6, #1; bne to the beginning.
    code.push(0x3e01);
    let back = -(code.len() as i32) - 2;
    code.push(0xd100 | (back & 0xff) as u16);
    let mut cpu = with_floating_point(machine(&code));
    cpu.bus.wait_states = wait_states;
    cpu.bus.signals.stall = Some((DATA..DATA + 0x100, stalled));
    cpu.set_register(6, 5);
    cpu.set_register(7, DATA);
    cpu.set_register(8, START);
    cpu
}

fn state(cpu: &Cpu<Memory>) -> (Vec<u32>, u32, u64, u64, Vec<u8>) {
    let mut registers: Vec<u32> = (0..16).map(|number| cpu.register(number)).collect();
    registers.extend((0..3).map(|number| cpu.float_register(number)).chain([cpu.fpscr()]));
    let memory = cpu.bus.bytes(DATA, 16).expect("data").to_vec();
    (registers, cpu.xpsr(), cpu.now(), cpu.instructions(), memory)
}

proptest! {
    #[test]
    fn a_run_is_its_steps(
        pieces in prop::collection::vec(0..PIECES.len(), 1..20), wait_states in 0u32..5, stalled in 0u64..300, parts in prop::collection::vec(1u64..60, 1..40),
        translated in prop::option::of(0u32..3),
    ) {
        let (mut runs, mut steps) = (looped(&pieces, wait_states, stalled), looped(&pieces, wait_states, stalled));
        runs.set_translation(translated);
        for part in parts.iter().cycle() {
            let until = runs.now() + part;
            let (end, stepped) = (runs.run(until), steps_to(&mut steps, until));
            prop_assert_eq!(state(&runs), state(&steps));
            prop_assert_eq!(stepped, if end == End::Time { None } else { Some(end.clone()) });
            if end != End::Time {
                prop_assert!(matches!(end, End::Breakpoint { number: 0, .. }), "{}", end);
                break;
            }
        }
    }
}
