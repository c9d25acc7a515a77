//! More training samples from the same recording, by what the joint's friction should not care about; host.
//!
//! Inputs are rows of position, velocity, theoretical torque, measured torque and temperature, in SI units, as the
//! network takes them; the target is the friction torque that the row belongs to. Only training samples may be
//! augmented.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal, Uniform};

/// Inputs of one sample: position, velocity, theoretical torque, measured torque, temperature.
pub type Inputs = [f64; 5];

/// Place of the position.
const POSITION: usize = 0;
/// Inputs that change their sign when the joint moves the other way; the temperature does not.
const ODD_INPUTS: usize = 4;

/// Mirrored and noisy copies of samples that are added. The default adds nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Augment {
    /// Add every sample in the opposite direction: for joints whose friction and load are symmetric.
    pub mirror: bool,
    /// Copies that are shifted and made noisy.
    pub copies: usize,
    /// Largest shift of the position, rad or m; each copy is shifted as a whole. For friction that does not depend on
    /// position.
    pub shift: f64,
    /// Standard deviation of the noise on each input, in the input's unit.
    pub noise: Inputs,
    /// Seed of shifts and noise.
    pub seed: u64,
}

/// The samples, then their mirror images, then shifted and noisy copies of both. `inputs` and `target` are of equal
/// length.
pub fn augment(inputs: &[Inputs], target: &[f64], options: &Augment) -> (Vec<Inputs>, Vec<f64>) {
    let (mut all_inputs, mut all_targets) = (inputs.to_vec(), target.to_vec());
    if options.mirror {
        all_inputs.extend(inputs.iter().map(mirrored));
        all_targets.extend(target.iter().map(|torque| -torque));
    }
    let count = all_inputs.len();
    let mut random = ChaCha8Rng::seed_from_u64(options.seed);
    // A shift that is not a finite positive number shifts nothing.
    let shifts = Uniform::new_inclusive(-options.shift, options.shift).ok();
    for _ in 0..options.copies {
        let shift = shifts.map_or(0.0, |shifts| shifts.sample(&mut random));
        for i in 0..count {
            let mut row = all_inputs[i];
            row[POSITION] += shift;
            for (value, deviation) in row.iter_mut().zip(options.noise) {
                let normal: f64 = StandardNormal.sample(&mut random);
                *value += deviation * normal;
            }
            all_inputs.push(row);
            all_targets.push(all_targets[i]);
        }
    }
    (all_inputs, all_targets)
}

fn mirrored(inputs: &Inputs) -> Inputs {
    std::array::from_fn(|i| if i < ODD_INPUTS { -inputs[i] } else { inputs[i] })
}

#[cfg(test)]
mod tests {
    use super::*;

    const INPUTS: [Inputs; 2] = [[1.0, 2.0, 3.0, 4.0, 30.0], [-1.0, 0.5, 0.0, 1.0, 31.0]];
    const TARGET: [f64; 2] = [0.7, -0.2];

    #[test]
    fn by_default_nothing_is_added() {
        assert_eq!(augment(&INPUTS, &TARGET, &Augment::default()), (INPUTS.to_vec(), TARGET.to_vec()));
    }

    #[test]
    fn a_mirror_image_changes_every_sign_but_that_of_the_temperature() {
        let (inputs, target) = augment(&INPUTS, &TARGET, &Augment { mirror: true, ..Augment::default() });
        assert_eq!(inputs[2], [-1.0, -2.0, -3.0, -4.0, 30.0]);
        assert_eq!(target, [0.7, -0.2, -0.7, 0.2]);
    }

    #[test]
    fn a_copy_is_shifted_as_a_whole_within_the_limit() {
        let options = Augment { copies: 3, shift: 0.1, ..Augment::default() };
        let (inputs, target) = augment(&INPUTS, &TARGET, &options);
        assert_eq!((inputs.len(), target.len()), (8, 8));
        for copy in 1..4 {
            let shift = inputs[2 * copy][0] - 1.0;
            assert!(shift != 0.0 && shift.abs() <= 0.1);
            assert!((inputs[2 * copy + 1][0] + 1.0 - shift).abs() < 1e-12);
            assert_eq!(inputs[2 * copy][1..], INPUTS[0][1..]);
            assert_eq!(target[2 * copy..2 * copy + 2], TARGET);
        }
    }

    #[test]
    fn noise_has_the_asked_deviation_and_is_the_same_for_the_same_seed() {
        let options = Augment { copies: 2000, noise: [0.0, 0.01, 0.0, 0.0, 2.0], seed: 5, ..Augment::default() };
        let (inputs, _) = augment(&INPUTS[..1], &TARGET[..1], &options);
        let deviation = |k: usize| {
            let sum: f64 = inputs[1..].iter().map(|row| (row[k] - INPUTS[0][k]).powi(2)).sum();
            (sum / 2000.0).sqrt()
        };
        assert_eq!(deviation(0), 0.0);
        assert!((deviation(1) - 0.01).abs() < 5e-4 && (deviation(4) - 2.0).abs() < 0.1);
        assert_eq!(inputs, augment(&INPUTS[..1], &TARGET[..1], &options).0);
    }
}
