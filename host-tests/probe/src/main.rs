//! A minimal program for a Cortex-M4F: decodes images, certifies them, compensates, and prints for each image a hash of every
//! torque, and how long certificate and golden vectors took, over semihosting.
//!
//! Its panic handler calls a function that does not exist: where friction, compensation or parameters could panic,
//! the program does not link.
#![no_std]
#![no_main]

#[path = "sequence.rs"]
mod sequence;

use core::arch::asm;
use joint_firmware::friction::FrictionModel;
use joint_firmware::parameters::certificate::certify;
use joint_firmware::parameters::image::Image;

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
    // SAFETY: switches the floating-point unit on (CPACR, ARM DDI 0403, B3.2.20) before any code could use it, and the
    // system timer (B3.3) at the processor's clock, without interrupt.
    unsafe {
        (0xe000_ed88 as *mut u32).write_volatile(0xf << 20);
        (0xe000_e014 as *mut u32).write_volatile(COUNTER);
        (0xe000_e010 as *mut u32).write_volatile(0b101);
    }
    let mut rest = IMAGES;
    while let Some((length, after)) = rest.split_first_chunk::<2>() {
        let Some((image, after)) = after.split_at_checked(u16::from_le_bytes(*length) as usize) else { break };
        print(sequence::run(core::hint::black_box(image)).unwrap_or(0));
        let start = ticks();
        let verified = verify(core::hint::black_box(image)).is_some();
        // The counter counts down.
        let taken = start.wrapping_sub(ticks()) & COUNTER;
        print(if verified { taken } else { 0 });
        rest = after;
    }
    exit()
}

/// What a joint does with an image before it uses it: decode, certificate, golden vectors. None where it is refused.
fn verify(bytes: &[u8]) -> Option<u32> {
    let image = Image::decode(bytes).ok()?;
    let certificate = certify(&image.friction, &image.limits).ok()?;
    image.verify_golden(&FrictionModel::new(&image.friction, 20_000)).ok()?;
    Some(certificate.output)
}

/// The system timer's 24 bits.
const COUNTER: u32 = 0xff_ffff;

fn ticks() -> u32 {
    // SAFETY: SYST_CVR, a read without side effect.
    unsafe { (0xe000_e018 as *const u32).read_volatile() }
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
