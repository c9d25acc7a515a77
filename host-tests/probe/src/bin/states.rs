//! Friction on a Cortex-M4F: takes images and batches of states from whoever emulates the core, and leaves every
//! evaluation in memory.
//!
//! Exchanged data lie at the symbols below; a breakpoint hands over. `bkpt 1`: an image is wanted. `bkpt 2`: a
//! batch is wanted; r0 is 1 if the image was decoded and its golden vectors hold. `bkpt 3`: as 2, and the last batch
//! has been evaluated.
#![no_std]
#![no_main]

#[path = "../../../../src/board/copy.rs"]
mod copy;
#[path = "../core.rs"]
#[allow(dead_code, reason = "each program uses its part")]
mod core_support;
#[path = "../evaluation.rs"]
mod evaluation;
#[path = "../exchanged.rs"]
mod exchanged;

use evaluation::{BATCH, Evaluator, INPUTS, OUTPUTS, RATE, SETTINGS, settings};
use exchanged::{Exchanged, hand_over};
use friction_compensation::friction::FrictionModel;
use friction_compensation::parameters::image::{Image, MAX_LENGTH};

#[unsafe(no_mangle)]
static IMAGE: Exchanged<[u8; MAX_LENGTH]> = Exchanged::new([0; MAX_LENGTH]);
#[unsafe(no_mangle)]
static LENGTH: Exchanged<usize> = Exchanged::new(0);
#[unsafe(no_mangle)]
static SET_UP: Exchanged<[i32; SETTINGS]> = Exchanged::new([0; SETTINGS]);
/// States of the batch; none: another image is wanted.
#[unsafe(no_mangle)]
static COUNT: Exchanged<usize> = Exchanged::new(0);
#[unsafe(no_mangle)]
static STATES: [Exchanged<[i32; INPUTS]>; BATCH] = [const { Exchanged::new([0; INPUTS]) }; BATCH];
#[unsafe(no_mangle)]
static EVALUATIONS: [Exchanged<[i32; OUTPUTS]>; BATCH] = [const { Exchanged::new([0; OUTPUTS]) }; BATCH];

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    core_support::exit()
}

#[unsafe(no_mangle)]
extern "C" fn run() -> ! {
    loop {
        hand_over::<1>(0);
        evaluate_image();
    }
}

/// One image with all its batches.
#[inline(never)]
fn evaluate_image() {
    let image = IMAGE.get().get(..*LENGTH.get()).and_then(|bytes| Image::decode(bytes).ok());
    let Some(image) = image else { return hand_over::<2>(0) };
    let model = FrictionModel::new(&image.friction, RATE);
    hand_over::<2>(u32::from(image.verify_golden(&model).is_ok()));
    let mut evaluator = Evaluator::default();
    while *COUNT.get() > 0 {
        let Ok(settings) = settings(SET_UP.get()) else { return hand_over::<2>(0) };
        let has_model = SET_UP.get()[SETTINGS - 1] != 0;
        for (state, evaluation) in STATES.iter().zip(&EVALUATIONS).take(*COUNT.get()) {
            evaluation.put(evaluator.step(&image.friction, &model, &settings, has_model, state.get()));
        }
        hand_over::<3>(1);
    }
}
