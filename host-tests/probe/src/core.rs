// Surroundings of a program for the emulated Cortex-M4F: start, output and end. Included by both programs.

use core::arch::asm;

unsafe extern "C" {
    /// The program's work.
    fn run() -> !;
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
        run()
    }
}

/// The system timer's 24 bits.
pub const COUNTER: u32 = 0xff_ffff;

extern "C" fn fault() -> ! {
    exit()
}

/// Prints eight hexadecimal digits and a line feed.
pub fn print(word: u32) {
    let mut text = [0; 10];
    for (i, place) in text.iter_mut().take(8).enumerate() {
        let digit = (word >> (28 - 4 * i)) as u8 & 0xf;
        *place = if digit < 10 { b'0' + digit } else { b'a' + digit - 10 };
    }
    text[8] = b'\n';
    semihosting(0x04, text.as_ptr() as usize);
}

/// Ends the program.
pub fn exit() -> ! {
    loop {
        semihosting(0x18, 0x20026);
    }
}

/// A call to the debugger or emulator (ARM semihosting: SYS_WRITE0, SYS_EXIT).
fn semihosting(operation: usize, argument: usize) {
    // SAFETY: a breakpoint that the emulator takes as a call; it reads the text that the argument points to.
    unsafe { asm!("bkpt 0xab", inout("r0") operation => _, in("r1") argument, options(nostack)) }
}
