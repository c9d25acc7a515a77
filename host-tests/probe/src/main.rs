//! A minimal program for a Cortex-M4F: decodes images, certifies them, compensates, and prints a hash of every torque over
//! semihosting.
//!
//! Its panic handler calls a function that does not exist: where friction, compensation or parameters could panic,
//! the program does not link.
#![no_std]
#![no_main]

#[path = "sequence.rs"]
mod sequence;

use core::arch::asm;

/// Images, each behind its length (two bytes, little-endian).
static IMAGES: &[u8] = include_bytes!(env!("PROBE_IMAGES"));

unsafe extern "C" {
    fn a_panic_can_be_reached() -> !;
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    // SAFETY: never linked; that is the test.
    unsafe { a_panic_can_be_reached() }
}

/// The vector table: initial stack pointer, then handlers (ARM DDI 0403, B1.5.3).
#[repr(C)]
struct Vectors {
    stack: u32,
    reset: extern "C" fn() -> !,
    faults: [extern "C" fn() -> !; 14],
}

#[unsafe(link_section = ".vectors")]
#[used]
static VECTORS: Vectors = Vectors { stack: 0x2001_0000, reset, faults: [fault; 14] };

#[unsafe(no_mangle)]
extern "C" fn reset() -> ! {
    // SAFETY: switches the floating-point unit on (CPACR, ARM DDI 0403, B3.2.20) before any code could use it.
    unsafe { (0xe000_ed88 as *mut u32).write_volatile(0xf << 20) };
    let mut rest = IMAGES;
    while let Some((length, after)) = rest.split_first_chunk::<2>() {
        let Some((image, after)) = after.split_at_checked(u16::from_le_bytes(*length) as usize) else { break };
        match sequence::run(core::hint::black_box(image)) {
            Some(sum) => print(sum),
            None => print(0),
        }
        rest = after;
    }
    exit()
}

extern "C" fn fault() -> ! {
    exit()
}

/// Prints eight hexadecimal digits and a line feed.
fn print(word: u32) {
    let mut text = [0; 10];
    for (i, place) in text.iter_mut().take(8).enumerate() {
        let digit = (word >> (28 - 4 * i)) as u8 & 0xf;
        *place = if digit < 10 { b'0' + digit } else { b'a' + digit - 10 };
    }
    text[8] = b'\n';
    semihosting(0x04, text.as_ptr() as usize);
}

fn exit() -> ! {
    loop {
        semihosting(0x18, 0x20026);
    }
}

/// A call to the debugger or emulator (ARM semihosting: SYS_WRITE0, SYS_EXIT).
fn semihosting(operation: usize, argument: usize) {
    // SAFETY: a breakpoint that the emulator takes as a call; it reads the text that the argument points to.
    unsafe { asm!("bkpt 0xab", inout("r0") operation => _, in("r1") argument, options(nostack)) }
}
