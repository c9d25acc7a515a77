//! The friction network and the same one in other libraries on a Cortex-M4F: each evaluates the same inputs, one call
//! of a function of its own for each.
//!
//! `bkpt 1`: networks and inputs are wanted. `bkpt 2`, `3`, `4`, `5`: this project's, plain, embedded-nn's and
//! microflow's outputs are there.
#![no_std]
#![no_main]

#[path = "../../../../src/board/copy.rs"]
mod copy;
#[path = "../core.rs"]
#[allow(dead_code, reason = "each program uses its part")]
mod core_support;
#[path = "../exchanged.rs"]
mod exchanged;
#[path = "../peers.rs"]
mod peers;

use core::hint::black_box;
use exchanged::{Exchanged, hand_over};
use friction_compensation::friction::network::Network;
use friction_compensation::friction::state::SIGNALS;
use friction_compensation::parameters::image::{Image, MAX_LENGTH};
use peers::{ByteLayer, Bytes, FloatLayer, Floats, WIDTH};

/// Inputs that each network evaluates.
const COUNT: usize = 200;

#[unsafe(no_mangle)]
static IMAGE: Exchanged<[u8; MAX_LENGTH]> = Exchanged::new([0; MAX_LENGTH]);
#[unsafe(no_mangle)]
static LENGTH: Exchanged<usize> = Exchanged::new(0);
#[unsafe(no_mangle)]
static SIGNAL_ROWS: [Exchanged<[i32; SIGNALS]>; COUNT] = [const { Exchanged::new([0; SIGNALS]) }; COUNT];
#[unsafe(no_mangle)]
static FLOAT_ROWS: [Exchanged<[f32; WIDTH]>; COUNT] = [const { Exchanged::new([0.0; WIDTH]) }; COUNT];
#[unsafe(no_mangle)]
static BYTE_ROWS: [Exchanged<[i8; WIDTH]>; COUNT] = [const { Exchanged::new([0; WIDTH]) }; COUNT];
#[unsafe(no_mangle)]
static FLOATS: Exchanged<Floats> = Exchanged::new(Floats {
    hidden: [FloatLayer { weights: [[0.0; WIDTH]; WIDTH], biases: [0.0; WIDTH] }; 3],
    output: FloatLayer { weights: [[0.0; WIDTH]], biases: [0.0] },
});
#[unsafe(no_mangle)]
static BYTES: Exchanged<Bytes> = Exchanged::new(Bytes {
    hidden: [ByteLayer { weights: [[0; WIDTH]; WIDTH], factor: 0.0, biases: [0.0; WIDTH] }; 3],
    tanh: [[0; 256]; 3],
    output: ByteLayer { weights: [[0; WIDTH]], factor: 0.0, biases: [0.0] },
});
#[unsafe(no_mangle)]
static OUTPUTS: [Exchanged<u32>; COUNT] = [const { Exchanged::new(0) }; COUNT];

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    core_support::exit()
}

#[unsafe(no_mangle)]
#[inline(never)]
fn counted_own(network: &Network, signals: &[i32; SIGNALS]) -> i32 {
    network.evaluate(signals).to_bits()
}

#[unsafe(no_mangle)]
#[inline(never)]
fn counted_plain(network: &Floats, x: &[f32; WIDTH]) -> f32 {
    peers::plain(network, x)
}

#[unsafe(no_mangle)]
#[inline(never)]
fn counted_embedded_nn(network: &Floats, x: &[f32; WIDTH]) -> f32 {
    peers::embedded_nn_f32(network, x)
}

#[unsafe(no_mangle)]
#[inline(never)]
fn counted_microflow(network: &Bytes, x: &[i8; WIDTH]) -> i8 {
    peers::microflow_i8(network, x)
}

fn each<X>(rows: &[Exchanged<X>; COUNT], evaluate: impl Fn(&X) -> u32) {
    rows.iter().zip(&OUTPUTS).for_each(|(row, output)| output.put(evaluate(black_box(row.get()))));
}

#[unsafe(no_mangle)]
extern "C" fn run() -> ! {
    hand_over::<1>(0);
    let image = IMAGE.get().get(..*LENGTH.get()).and_then(|bytes| Image::decode(bytes).ok());
    let Some(image) = image else { core_support::exit() };
    let Some(parameters) = &image.friction.sets[0].network else { core_support::exit() };
    let own = black_box(Network::new(parameters, &image.friction.domain));
    each(&SIGNAL_ROWS, |signals| counted_own(&own, signals) as u32);
    hand_over::<2>(0);
    each(&FLOAT_ROWS, |x| counted_plain(black_box(FLOATS.get()), x).to_bits());
    hand_over::<3>(0);
    each(&FLOAT_ROWS, |x| counted_embedded_nn(black_box(FLOATS.get()), x).to_bits());
    hand_over::<4>(0);
    each(&BYTE_ROWS, |x| i32::from(counted_microflow(black_box(BYTES.get()), x)) as u32);
    hand_over::<5>(0);
    core_support::exit()
}
