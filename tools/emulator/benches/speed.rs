//! Prints how fast the core is on this machine: `cargo bench -p emulator`. Instructions a second on three loops that
//! never sleep, on a bus of memory alone; the mix of each is in its comment.

use emulator::cpu::End;
use emulator::memory::Memory;
use std::time::Instant;

const CODE: u32 = 0x0800_0000;
const DATA: u32 = 0x2000_0000;
const INSTRUCTIONS: u64 = 100_000_000;

/// ldr r3, [r1]; adds r7, r7, r3; smlad r4, r3, r5, r4; str r4, [r2]; eors r6, r4; subs r0, #1; bne.
const INTEGERS: [u16; 8] = [0x680b, 0x18ff, 0xfb23, 0x4405, 0x6014, 0x4066, 0x3801, 0xd1f7];
/// vldr s0, [r1]; vmul s1, s0, s2; vfma s3, s1, s2; vadd s4, s3, s0; vstr s4, [r2]; subs r0, #1; bne.
const FLOATS: [u16; 12] =
    [0xed91, 0x0a00, 0xee60, 0x0a01, 0xeee0, 0x1a81, 0xee31, 0x2a80, 0xed82, 0x2a00, 0x3801, 0xd1f3];
/// b over the function: push {r4, lr}; adds r4, #1; pop {r4, pc}; then bl, subs r0, #1; bne.
const CALLS: [u16; 8] = [0xe002, 0xb510, 0x3401, 0xbd10, 0xf7ff, 0xfffb, 0x3801, 0xd1fb];

fn main() {
    for (name, code) in [("integers", &INTEGERS[..]), ("floats", &FLOATS), ("calls", &CALLS)] {
        let mut memory = Memory::new().with(DATA..DATA + 0x1000, false).with(CODE..CODE + 0x1000, true);
        let start = CODE + 0x100;
        let bytes: Vec<u8> = code.iter().flat_map(|half| half.to_le_bytes()).collect();
        let vectors = [DATA + 0x1000, start | 1].map(u32::to_le_bytes).concat();
        // The unit is switched on by an instruction of its own: str r1, [r0].
        assert!(memory.set(CODE, &vectors) && memory.set(start, &bytes) && memory.set(CODE + 0x80, &[1, 0x60]));
        let mut cpu = memory.core();
        cpu.reset(CODE).expect("vectors");
        cpu.set_register(15, CODE + 0x80);
        cpu.set_register(0, 0xe000_ed88);
        cpu.set_register(1, 0xf << 20);
        assert_eq!(cpu.step(), None);
        for (register, value) in [(0, u32::MAX), (1, DATA), (2, DATA + 4), (5, 0x0003_fffd), (15, start)] {
            cpu.set_register(register, value);
        }
        cpu.set_float_register(2, 0.5f32.to_bits());
        assert!(cpu.bus.set(DATA, &1e-3f32.to_le_bytes()));
        let begin = Instant::now();
        while cpu.instructions() < INSTRUCTIONS {
            let end = cpu.run(cpu.now() + 1_000_000);
            assert_eq!(end, End::Time, "{end}");
        }
        let seconds = begin.elapsed().as_secs_f64();
        let (instructions, cycles) = (cpu.instructions() as f64 / 1e6, cpu.now() as f64 / 1e6);
        println!(
            "{name}: {:.0} million instructions/s, {:.0} million cycles/s",
            instructions / seconds,
            cycles / seconds
        );
    }
}
