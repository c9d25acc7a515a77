//! Images of every kind drawn from a seed, with limits of their own, and whether the certificate passes them.

use crate::parameters::{extreme, image, tame};
use friction_compensation::parameters::certificate::{Limits, Refusal, certify, prove};
use friction_compensation::parameters::image::Image;
use rand::{Rng, RngExt};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

/// Random source for the image `seed`: 0 the image itself, any other number something that goes with it.
pub fn random(seed: u64, stream: u64) -> ChaCha8Rng {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(stream);
    random
}

/// The image of a seed: like a trained one, or, in every third, of any numbers that an image can hold. Its limits lie
/// around what can be proved of it.
///
/// # Errors
/// Refusal by the certificate.
pub fn drawn(seed: u64) -> Result<Image, Refusal> {
    let mut random = random(seed, 0);
    let friction = if seed % 3 == 2 { extreme(&mut random) } else { tame(&mut random) };
    let proved = prove(&friction)?;
    let slope = proved.velocity_slope_low.unsigned_abs().max(proved.velocity_slope_high.unsigned_abs());
    let limits = Limits {
        output: around(&mut random, proved.output.into()),
        torque_gain: around(&mut random, proved.torque_gain.into()),
        velocity_slope: around(&mut random, slope),
    };
    certify(&friction, &limits)?;
    // Four sets with networks leave room for four.
    let golden = random.random_range(1..=4);
    Ok(Image { limits, ..image(&mut random, friction, golden) })
}

/// Five sixths to double, or exactly that, or one less.
fn around(random: &mut impl Rng, proved: u64) -> u32 {
    let limit = match random.random_range(0..16) {
        0 => proved.saturating_sub(1),
        1 => proved,
        _ => (proved as f64 * random.random_range(0.83..2.0)) as u64,
    };
    limit.min(u32::MAX.into()) as u32
}
