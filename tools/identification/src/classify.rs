//! The motion states of the mobile-robot paper (section 3.1): uniform or accelerating, low or high speed; host.
//!
//! The paper separates them by |a| and by |v| = 200 r/min at the motor. Both depend on the joint, so both can be given
//! in the description; otherwise they are taken from the samples that are not for judging.

use crate::dataset::treatment::Classify;
use crate::samples::{MotionState, Part, Samples};

/// Share of the 95th percentile of |acceleration| above which a joint is accelerating, when not given.
const ACCELERATION_SHARE: f64 = 0.1;

/// The boundaries between the motion states.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thresholds {
    /// |acceleration| above which the joint is accelerating, rad/s^2 or m/s^2.
    pub acceleration: f64,
    /// |velocity| above which the joint is fast, rad/s or m/s.
    pub speed: f64,
}

impl Thresholds {
    /// Thresholds of the description; where absent, a tenth of the 95th percentile of |acceleration| and the median
    /// of |velocity| over the samples for training and validation.
    pub fn of(samples: &Samples, description: &Classify) -> Thresholds {
        let magnitudes = |values: &[f64]| -> Vec<f64> {
            let known = |i: &usize| matches!(samples.part[*i], Part::Train | Part::Validation);
            let mut found: Vec<f64> = (0..samples.len()).filter(known).map(|i| values[i].abs()).collect();
            found.sort_unstable_by(f64::total_cmp);
            found
        };
        Thresholds {
            acceleration: description
                .acceleration
                .unwrap_or_else(|| ACCELERATION_SHARE * quantile(&magnitudes(&samples.acceleration), 0.95)),
            speed: description.speed.unwrap_or_else(|| quantile(&magnitudes(&samples.velocity), 0.5)),
        }
    }

    /// The state of one sample.
    pub fn state(&self, velocity: f64, acceleration: f64) -> MotionState {
        MotionState { accelerating: acceleration.abs() > self.acceleration, fast: velocity.abs() > self.speed }
    }
}

/// Writes the state of every sample.
pub fn classify(samples: &mut Samples, thresholds: Thresholds) {
    let motion = samples.velocity.iter().zip(&samples.acceleration);
    samples.state = motion.map(|(&v, &a)| thresholds.state(v, a)).collect();
}

/// The value below which the share `q` of the sorted values lies; 0 of none.
fn quantile(sorted: &[f64], q: f64) -> f64 {
    match sorted.len() {
        0 => 0.0,
        n => sorted[((n - 1) as f64 * q).round() as usize],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn samples(parts: [Part; 5]) -> Samples {
        Samples {
            time: vec![0.0; 5],
            velocity: vec![0.0, -1.0, 2.0, -3.0, 400.0],
            acceleration: vec![0.0, 0.5, -2.0, 10.0, 400.0],
            part: parts.to_vec(),
            ..Samples::default()
        }
    }

    #[test]
    fn a_state_is_two_independent_comparisons_of_magnitudes() {
        let mut s = samples([Part::Train; 5]);
        classify(&mut s, Thresholds { acceleration: 1.0, speed: 1.5 });
        let states: Vec<(bool, bool)> = s.state.iter().map(|s| (s.accelerating, s.fast)).collect();
        assert_eq!(states, [(false, false), (false, false), (true, true), (true, true), (true, true)]);
    }

    #[test]
    fn automatic_thresholds_do_not_look_at_test_samples() {
        let [train, test] = [Part::Train, Part::Test];
        let found = Thresholds::of(&samples([train, train, train, Part::Validation, test]), &Classify::default());
        assert_eq!(found, Thresholds { acceleration: 1.0, speed: 2.0 });
    }

    #[test]
    fn given_thresholds_win() {
        let given = Classify { acceleration: Some(7.0), speed: Some(0.0) };
        let found = Thresholds::of(&samples([Part::Train; 5]), &given);
        assert_eq!(found, Thresholds { acceleration: 7.0, speed: 0.0 });
    }
}
