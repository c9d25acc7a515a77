//! The motion as the joint's own observer sees it, from a recorded position or velocity; host.
//!
//! The firmware's observer runs over the recording, several steps a sample, along straight lines between the samples:
//! what it says at a sample depends on that sample and those before it. It differs from the joint in two ways: a sample
//! is as old as the recording's period, not the control step's, and its noise is the recording's.

use crate::samples::Track;
use joint_firmware::motor::observer::{Observer, ObserverGains, ObserverSettings};
use joint_firmware::motor::setting::SettingError;
use std::f64::consts::TAU;

/// Least rate at which the observer runs, Hz.
const LEAST_RATE: f64 = 4_000.0;
/// Time for which it runs along the first samples' line before them, s: a joint's observer has been running before.
const RUN_IN: f64 = 0.1;

/// Observes a position, `period` s between samples, with poles at `bandwidth`, Hz.
///
/// # Errors
/// A bandwidth beyond what the observer accepts at this rate.
pub fn observe(position: &[f64], period: f64, bandwidth: f64) -> Result<Track, SettingError> {
    let steps = ((LEAST_RATE * period).ceil().max(1.0) as usize).max((10.0 * bandwidth * period).ceil() as usize);
    let step = period / steps as f64;
    let rate = (1.0 / step) as f32;
    let gains = ObserverGains::new(&ObserverSettings {
        bandwidth: bandwidth as f32,
        rate,
        latency: 0.0,
        highest_velocity: (0.49 * TAU) as f32 * rate,
        highest_acceleration: 1e9,
    })?;
    let mut observed = Track::default();
    let Some(&first) = position.first() else { return Ok(observed) };
    let slope = position.get(1).map_or(0.0, |second| (second - first) / period);
    let mut observer = Observer::default();
    let run_in = (RUN_IN / step).ceil() as i64;
    // The observer counts turns from within half a turn of zero; `turns` brings its count to the recording's.
    let start = first - slope * step * run_in as f64;
    let turns = (start / TAU).round() * TAU;
    for n in 0..run_in {
        observer.step(&gains, Some(encoder(start + slope * step * n as f64)), 0.0);
    }
    let mut before = first;
    for (i, &now) in position.iter().enumerate() {
        let mut motion = Default::default();
        let from = if i == 0 { steps } else { 1 };
        for part in from..=steps {
            let along = before + (now - before) * part as f64 / steps as f64;
            motion = observer.step(&gains, Some(encoder(along)), 0.0).motion;
        }
        before = now;
        observed.position.push(motion.position as f64 / 2f64.powi(32) * TAU + turns);
        observed.velocity.push(f64::from(motion.velocity));
    }
    Ok(observed)
}

/// The angle as an encoder word: 2^32 a turn.
fn encoder(position: f64) -> u32 {
    (position.rem_euclid(TAU) / TAU * 2f64.powi(32)) as u64 as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sine(rate: f64, hertz: f64) -> (Vec<f64>, Vec<f64>) {
        let time = (0..(10.0 * rate) as usize).map(|i| i as f64 / rate);
        time.map(|t| (9.0 + 3.0 * (TAU * hertz * t).sin(), 3.0 * TAU * hertz * (TAU * hertz * t).cos())).unzip()
    }

    #[test]
    fn a_motion_of_one_hertz_is_seen_late_by_half_a_sample_and_no_more() {
        for (rate, limit) in [(100.0, 0.035), (1000.0, 0.004)] {
            let (position, velocity) = sine(rate, 1.0);
            let seen = observe(&position, 1.0 / rate, 100.0).unwrap();
            let worst = |a: &[f64], b: &[f64]| a.iter().zip(b).skip(3).fold(0.0, |w: f64, (a, b)| w.max((a - b).abs()));
            assert!(worst(&seen.position, &position) < 1e-2, "{}", worst(&seen.position, &position));
            let found = worst(&seen.velocity, &velocity) / (3.0 * TAU);
            assert!(found < limit, "{rate} Hz: {found}");
        }
    }

    #[test]
    fn nothing_of_the_future_is_known_and_turns_are_kept() {
        let (mut position, _) = sine(100.0, 0.5);
        let whole = observe(&position, 0.01, 100.0).unwrap();
        position.iter_mut().skip(500).for_each(|q| *q += 1.0);
        let changed = observe(&position, 0.01, 100.0).unwrap();
        assert_eq!(whole.velocity[..500], changed.velocity[..500]);
        assert!((whole.velocity[500] - changed.velocity[500]).abs() > 10.0);
        assert!(whole.position.iter().all(|q| (5.9..12.1).contains(q)));
    }

    #[test]
    fn a_bandwidth_of_nothing_is_refused_and_no_sample_is_no_motion() {
        assert!(observe(&[0.0, 1.0], 0.01, 0.5).is_err());
        assert!(observe(&[], 0.01, 100.0).unwrap().velocity.is_empty());
    }
}
