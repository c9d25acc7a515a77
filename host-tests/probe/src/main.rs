//! A minimal program for a Cortex-M4F: decodes images, certifies them, compensates, and prints for each image a hash of
//! every torque, and how long certificate and golden vectors took, over semihosting.
//!
//! Its panic handler calls a function that does not exist: where friction, compensation or parameters could panic,
//! the program does not link.
#![no_std]
#![no_main]

#[path = "core.rs"]
mod core_support;
#[path = "sequence.rs"]
mod sequence;

use core_support::{COUNTER, exit, print};
use friction_compensation::friction::FrictionModel;
use friction_compensation::parameters::certificate::certify;
use friction_compensation::parameters::image::Image;

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

#[unsafe(no_mangle)]
extern "C" fn run() -> ! {
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

/// Verification by a joint before it uses an image: decode, certificate, golden vectors. None where it is refused.
fn verify(bytes: &[u8]) -> Option<u32> {
    let image = Image::decode(bytes).ok()?;
    let certificate = certify(&image.friction, &image.limits).ok()?;
    image.verify_golden(&FrictionModel::new(&image.friction, 20_000)).ok()?;
    Some(certificate.output)
}

fn ticks() -> u32 {
    // SAFETY: SYST_CVR, a read without side effect.
    unsafe { (0xe000_e018 as *const u32).read_volatile() }
}
