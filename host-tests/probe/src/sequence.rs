// The same states and the same hash on the board's core and on the host: included by the probe and by the test.

/// States that are evaluated with every image.
pub const STATES: u32 = 5_000;

/// Marsaglia's xorshift, 32 bits.
pub struct Sequence(pub u32);

impl Sequence {
    /// The next number.
    pub fn next(&mut self) -> u32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 17;
        self.0 ^= self.0 << 5;
        self.0
    }
}

/// FNV-1a over words.
pub fn hash(hash: u32, word: u32) -> u32 {
    (hash ^ word).wrapping_mul(0x0100_0193)
}

/// Decodes, certifies and verifies an image, then compensates along the sequence; the hash of every torque. None where
/// the image is refused.
pub fn run(bytes: &[u8]) -> Option<u32> {
    use friction_compensation::compensation::{Compensation, Request, Settings};
    use friction_compensation::friction::FrictionModel;
    use friction_compensation::friction::state::{JointState, SIGNALS};
    use friction_compensation::parameters::certificate::certify;
    use friction_compensation::parameters::image::Image;
    use friction_compensation::quantity::Torque;

    let image = Image::decode(bytes).ok()?;
    let certificate = certify(&image.friction, &image.limits).ok()?;
    let model = FrictionModel::new(&image.friction, 20_000);
    image.verify_golden(&model).ok()?;
    let settings = Settings::new(
        Request::PhysicalAndNetwork,
        60_000,
        Torque::from_bits(40 << 16),
        Torque::from_bits(i32::MAX),
        20_000,
    )
    .ok()?;
    let mut compensation = Compensation::default();
    let mut sequence = Sequence(0x2545_f491);
    let mut sum = hash(0x811c_9dc5, certificate.output);
    sum = hash(sum, certificate.velocity_slope_high as u32);
    let ranges = image.friction.domain.ranges;
    for n in 0..STATES {
        let mut signals = [0; SIGNALS];
        for (signal, range) in signals.iter_mut().zip(ranges) {
            let wide = sequence.next() as i32;
            // Three states in four lie in and around the trained box, one anywhere.
            let width = (range.half_width() as i64 * 5 / 4).max(1);
            let near = (range.centre() as i64 + ((wide as i64 * width) >> 31)).clamp(i32::MIN as i64, i32::MAX as i64);
            *signal = if n % 4 == 3 { wide } else { near as i32 };
        }
        let state = JointState::from_signals(signals);
        let output = compensation.step(Some(&model), &settings, &state);
        sum = hash(sum, output.torque.to_bits() as u32);
        sum = hash(sum, output.shadow.to_bits() as u32);
        let estimate = model.evaluate(n as usize, &state);
        sum = hash(sum, estimate.physical.to_bits() as u32);
        sum = hash(sum, estimate.network.to_bits() as u32);
    }
    Some(sum)
}
