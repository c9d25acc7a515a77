//! Tracking observer: position over many turns, velocity and acceleration from a wrapping encoder; control step.
//!
//! A predictor of third order (position, velocity, acceleration) that each encoder sample corrects by a part of the
//! innovation, the difference between the sample and its prediction. All three poles lie at the same place, theta =
//! exp(-w T), which makes it the critically damped fading-memory filter (Brookner, Tracking and Kalman Filtering Made
//! Easy, section 1.3; gains 1 - theta^3, 3/2 (1 - theta)^2 (1 + theta) and (1 - theta)^3). It follows a constant
//! acceleration without any lag.
//!
//! The acceleration that the motor is known to cause, torque over inertia, is fed forward. The state then only holds
//! what is left, friction, load and errors of the inertia, and the estimate of the total does not wait for the
//! bandwidth.
//!
//! Errors with a 14-bit encoder at 20 kHz while the rotor slowly runs up from 3 to 13 rad/s and from 0.1 to 1 rad/s,
//! and the time after a step of the acceleration without feedforward (tests assert these figures):
//!
//! | bandwidth | velocity, RMS | acceleration, RMS | slow: velocity | slow: acceleration | 90 % of an acceleration step |
//! |---|---|---|---|---|---|
//! | 30 Hz | 0.0025 rad/s | 0.15 rad/s² | 0.0017 rad/s | 0.11 rad/s² | 28 ms |
//! | 100 Hz | 0.015 rad/s | 3.2 rad/s² | 0.017 rad/s | 3.6 rad/s² | 8.5 ms |
//! | 300 Hz | 0.08 rad/s | 50 rad/s² | 0.12 rad/s | 77 rad/s² | 2.8 ms |
//!
//! Positions are whole numbers and wrap with the encoder, so nothing is lost over any number of turns; the innovation
//! is right as long as the prediction is less than half a turn off, that is at any speed below half a turn in a step.

use super::angle::{STEPS, TAU};
use super::number::{limited, or_zero};
use super::setting::{SettingError, in_range};

/// Settings of the observer's tracking.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObserverSettings {
    /// Frequency of the three poles, Hz; 1 Hz to a tenth of the rate.
    pub bandwidth: f32,
    /// Control steps a second, Hz; 1 kHz to 200 kHz.
    pub rate: f32,
    /// Age of an encoder sample at the instant for which the estimate is wanted, s; 0 to 10 ms.
    pub latency: f32,
    /// Velocity that the rotor cannot exceed, rad/s; 1 to half a turn a step (62,800 at 20 kHz). It is what brings the
    /// observer back after nonsense: without it, it could hold on to a speed that is whole turns a step off.
    pub highest_velocity: f32,
    /// Acceleration that the rotor cannot exceed, rad/s^2; 1 to 1e9.
    pub highest_acceleration: f32,
}

/// Settings of the observer, checked and prepared. May be swapped between two steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObserverGains {
    period: f32,
    latency: f32,
    /// Part of the innovation.
    position: f32,
    /// 1/s.
    velocity: f32,
    /// 1/s^2.
    acceleration: f32,
    highest_velocity: f32,
    highest_acceleration: f32,
}

impl ObserverGains {
    /// Checks settings and prepares them.
    pub fn new(settings: &ObserverSettings) -> Result<Self, SettingError> {
        let rate = in_range!("control rate", "Hz", settings.rate, 1e3, 200e3)?;
        let bandwidth = in_range!("observer's bandwidth", "Hz", settings.bandwidth, 1.0, 0.1 * rate)?;
        let latency = in_range!("encoder's latency", "s", settings.latency, 0.0, 0.01)?;
        // exp(-x) as its first Padé approximation: 2 % off at the highest bandwidth, 0.03 % off at a hundredth of the
        // rate.
        let half = 0.5 * TAU * bandwidth / rate;
        let theta = (1.0 - half) / (1.0 + half);
        let rest = 1.0 - theta;
        Ok(Self {
            period: 1.0 / rate,
            latency,
            position: 1.0 - theta * theta * theta,
            velocity: 1.5 * rest * rest * (1.0 + theta) * rate,
            acceleration: rest * rest * rest * rate * rate,
            highest_velocity: in_range!("highest velocity", "rad/s", settings.highest_velocity, 1.0, 0.5 * TAU * rate)?,
            highest_acceleration: in_range!("highest acceleration", "rad/s²", settings.highest_acceleration, 1.0, 1e9)?,
        })
    }
}

/// Motion of the rotor, in the encoder's direction.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motion {
    /// Position over all turns: 2^32 a turn. Its lower half is the encoder's angle.
    pub position: i64,
    /// rad/s.
    pub velocity: f32,
    /// rad/s², what was fed forward included.
    pub acceleration: f32,
}

impl Motion {
    /// Angle within the turn: 2^32 a turn.
    #[inline(always)]
    pub const fn angle(&self) -> u32 {
        self.position as u32
    }

    /// The motion a little later, s, at this acceleration; the way is held at half a turn.
    #[inline(always)]
    fn after(&self, time: f32) -> Self {
        let way = time * (self.velocity + 0.5 * time * self.acceleration);
        Self {
            position: self.position.wrapping_add((way * (STEPS / TAU)) as i32 as i64),
            velocity: self.velocity + time * self.acceleration,
            acceleration: self.acceleration,
        }
    }
}

/// Results of a step of the observer.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Observation {
    /// Motion now: the samples' age is made up for.
    pub motion: Motion,
    /// Sample less its prediction, rad; 0 in a step without a sample. Half a turn at most.
    ///
    /// At rest it is the encoder's noise. A jump of the encoder appears in full in the step in which it happens; an
    /// encoder that stands still while the rotor turns makes it grow by the way of each step.
    pub innovation: f32,
    /// Steps since the last sample; 0 in a step with one.
    pub held: u32,
}

/// The observer, from one control step to the next. The first sample starts it, at rest and within half a turn of zero.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Observer {
    /// Motion at the instant of the last sample. Its acceleration is without what is fed forward.
    motion: Motion,
    started: bool,
    held: u32,
}

impl Observer {
    /// One control step with the encoder's angle, 2^32 a turn, or none where it did not answer: then the prediction is
    /// held. With it the acceleration, rad/s², that the motor caused since the last step in the encoder's
    /// direction: torque over inertia, or 0. NaN counts as 0.
    #[inline(always)]
    pub fn step(&mut self, gains: &ObserverGains, sample: Option<u32>, caused: f32) -> Observation {
        if !self.started {
            let Some(sample) = sample else { return Observation::default() };
            self.motion = Motion { position: sample as i32 as i64, ..Motion::default() };
            self.started = true;
        }
        let caused = limited(caused, gains.highest_acceleration);
        let rest = self.motion.acceleration;
        let mut now = Motion { acceleration: rest + caused, ..self.motion }.after(gains.period);
        let mut innovation = 0.0;
        if let Some(sample) = sample {
            let difference = sample.wrapping_sub(now.angle()) as i32 as f32;
            innovation = difference * (TAU / STEPS);
            now.position = now.position.wrapping_add((difference * gains.position) as i32 as i64);
            now.velocity += gains.velocity * innovation;
            now.acceleration = rest + gains.acceleration * innovation;
            self.held = 0;
        } else {
            now.acceleration = rest;
            self.held = self.held.saturating_add(1);
        }
        now.velocity = limited(now.velocity, gains.highest_velocity);
        now.acceleration = limited(now.acceleration, gains.highest_acceleration);
        self.motion = now;

        let motion = Motion { acceleration: now.acceleration + caused, ..now }.after(gains.latency);
        Observation { motion, innovation: or_zero(innovation), held: self.held }
    }

    /// Forgets everything, the number of turns included.
    pub fn reset(&mut self) {
        *self = Self::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::TAU;
    use proptest::prelude::*;

    const RATE: f64 = 20_000.0;
    const SETTINGS: ObserverSettings = ObserverSettings {
        bandwidth: 100.0,
        rate: RATE as f32,
        latency: 0.0,
        highest_velocity: 2000.0,
        highest_acceleration: 1e6,
    };

    fn gains(bandwidth: f32) -> ObserverGains {
        ObserverGains::new(&ObserverSettings { bandwidth, ..SETTINGS }).unwrap()
    }

    /// An encoder of some bits at a position in radians.
    fn encoder(position: f64, bits: u32) -> u32 {
        let step = (position / TAU * 2f64.powi(bits as i32)).round() as i64 as u32;
        step.wrapping_shl(32 - bits)
    }

    fn radians(position: i64) -> f64 {
        position as f64 / 2f64.powi(32) * TAU
    }

    fn rms(values: &[f64]) -> f64 {
        (values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64).sqrt()
    }

    /// RMS errors of velocity and acceleration while a rotor runs up through the speeds from `slowest` to `fastest` in
    /// 20 s, at which the steps of a 14-bit encoder beat with the samples in all ways.
    fn noise(bandwidth: f32, slowest: f64, fastest: f64) -> (f64, f64) {
        let gains = gains(bandwidth);
        let mut observer = Observer::default();
        let (mut velocity, mut acceleration) = (vec![], vec![]);
        let rise = (fastest - slowest) / 20.0;
        for n in 0..400_000 {
            let time = n as f64 / RATE;
            let position = slowest * time + 0.5 * rise * time * time;
            let motion = observer.step(&gains, Some(encoder(position, 14)), 0.0).motion;
            if n > 20_000 {
                velocity.push(motion.velocity as f64 - slowest - rise * time);
                acceleration.push(motion.acceleration as f64 - rise);
            }
        }
        (rms(&velocity), rms(&acceleration))
    }

    #[test]
    fn noise_is_what_the_documentation_says() {
        for (bandwidth, fast, slow) in [
            (30.0, (0.0025, 0.15), (0.0017, 0.107)),
            (100.0, (0.015, 3.2), (0.017, 3.6)),
            (300.0, (0.08, 50.0), (0.122, 77.0)),
        ] {
            for (found, said) in [(noise(bandwidth, 3.0, 13.0), fast), (noise(bandwidth, 0.1, 1.0), slow)] {
                assert!((found.0 / said.0 - 1.0).abs() < 0.1, "{bandwidth} Hz: {found:?}");
                assert!((found.1 / said.1 - 1.0).abs() < 0.1, "{bandwidth} Hz: {found:?}");
            }
        }
    }

    /// Steps until the estimated acceleration has reached 90 % of a step of 1000 rad/s², and the largest error of
    /// velocity.
    fn acceleration_step(bandwidth: f32, caused: f32) -> (usize, f64) {
        let gains = gains(bandwidth);
        let mut observer = Observer::default();
        let (mut reached, mut worst) = (usize::MAX, 0f64);
        for n in 0..4_000 {
            let time = n as f64 / RATE;
            let fed = if n == 0 { 0.0 } else { caused };
            let motion = observer.step(&gains, Some(encoder(500.0 * time * time, 32)), fed).motion;
            worst = worst.max((motion.velocity as f64 - 1000.0 * time).abs());
            if motion.acceleration >= 900.0 {
                reached = reached.min(n);
            }
        }
        (reached, worst)
    }

    #[test]
    fn an_acceleration_step_is_followed_in_the_documented_time() {
        for (bandwidth, milliseconds) in [(30.0, 28.0), (100.0, 8.5), (300.0, 2.8)] {
            let (steps, _) = acceleration_step(bandwidth, 0.0);
            let found = steps as f64 / RATE * 1e3;
            assert!((found / milliseconds - 1.0).abs() < 0.05, "{bandwidth} Hz: {found} ms");
        }
    }

    #[test]
    fn an_acceleration_that_is_fed_forward_is_there_at_once() {
        let (steps, error) = acceleration_step(100.0, 1000.0);
        assert!(steps <= 1 && error < 0.01, "{steps} steps, {error} rad/s");
        let (_, error_without) = acceleration_step(100.0, 0.0);
        assert!(error_without > 1.0, "{error_without} rad/s");
        // An inertia that is wrong by 20 % leaves a fifth of the error.
        let (_, error_roughly) = acceleration_step(100.0, 800.0);
        assert!((error_roughly / error_without - 0.2).abs() < 0.02, "{error_roughly} of {error_without} rad/s");
    }

    #[test]
    fn a_constant_acceleration_is_followed_without_lag() {
        let gains = gains(100.0);
        let mut observer = Observer::default();
        for n in 0..8_000 {
            let time = n as f64 / RATE;
            let motion = observer.step(&gains, Some(encoder(400.0 * time * time, 32)), 0.0).motion;
            if n > 4_000 {
                assert!((motion.velocity as f64 - 800.0 * time).abs() < 0.01, "{motion:?}");
                assert!((motion.acceleration - 800.0).abs() < 5.0, "{motion:?}");
                assert!((radians(motion.position) - 400.0 * time * time).abs() < 1e-5, "{motion:?}");
            }
        }
    }

    #[test]
    fn the_age_of_the_samples_is_made_up_for() {
        let latency = 150e-6;
        let error = |known: f32| {
            let gains = ObserverGains::new(&ObserverSettings { latency: known, ..SETTINGS }).unwrap();
            let mut observer = Observer::default();
            let true_position = |time: f64| 100.0 * time + 250.0 * time * time;
            let mut worst = (0f64, 0f64);
            for n in 0..4_000 {
                let time = n as f64 / RATE;
                let motion = observer.step(&gains, Some(encoder(true_position(time - latency), 32)), 0.0).motion;
                if n > 2_000 {
                    worst.0 = worst.0.max((radians(motion.position) - true_position(time)).abs());
                    worst.1 = worst.1.max((motion.velocity as f64 - 100.0 - 500.0 * time).abs());
                }
            }
            worst
        };
        let (with, without) = (error(latency as f32), error(0.0));
        assert!(with.0 < 1e-5 && with.1 < 0.01, "{with:?}");
        assert!(without.0 > 0.015 && without.1 > 0.07, "{without:?}");
    }

    #[test]
    fn a_thousand_turns_are_counted_at_nearly_half_a_turn_a_step() {
        for direction in [1.0, -1.0] {
            let settings = ObserverSettings { highest_velocity: 62_800.0, highest_acceleration: 1e9, ..SETTINGS };
            let gains = ObserverGains::new(&settings).unwrap();
            let mut observer = Observer::default();
            let (mut turns, mut speed) = (0f64, 0f64);
            let mut found = Observation::default();
            for _ in 0..6_000 {
                speed = (speed + 0.001).min(0.49);
                turns += direction * speed;
                found = observer.step(&gains, Some(encoder(turns * TAU, 14)), 0.0);
            }
            assert!(turns.abs() > 2_500.0);
            assert!((found.motion.position as f64 / 2f64.powi(32) - turns).abs() < 1e-4, "{found:?} {turns}");
            let velocity = direction * 0.49 * TAU * RATE;
            assert!((found.motion.velocity as f64 / velocity - 1.0).abs() < 1e-4, "{found:?}");
        }
    }

    #[test]
    fn a_rotor_that_already_spins_is_caught() {
        let gains = gains(100.0);
        let mut observer = Observer::default();
        let mut found = Observation::default();
        for n in 0..1_000 {
            found = observer.step(&gains, Some(encoder(1.0 + 600.0 * n as f64 / RATE, 14)), 0.0);
        }
        assert!((found.motion.velocity - 600.0).abs() < 0.5 && found.innovation.abs() < 1e-3, "{found:?}");
        assert!(
            (radians(found.motion.position) - 1.0 - 600.0 * 999.0 / RATE).abs() < 1e-3,
            "the turns count: {found:?}"
        );
    }

    #[test]
    fn a_few_lost_samples_are_bridged_by_the_prediction() {
        let gains = gains(100.0);
        let mut observer = Observer::default();
        for n in 0..4_000 {
            let position = 200.0 * n as f64 / RATE;
            let lost = (3_000..3_010).contains(&n);
            let found = observer.step(&gains, (!lost).then(|| encoder(position, 14)), 0.0);
            if n > 2_000 {
                assert!((radians(found.motion.position) - position).abs() < 1e-3, "{n}: {found:?}");
                assert!((found.motion.velocity - 200.0).abs() < 0.5, "{n}: {found:?}");
            }
            assert_eq!(found.held, if lost { n - 2_999 } else { 0 });
        }
    }

    #[test]
    fn the_innovation_shows_a_jump_in_full_and_a_stuck_encoder_growing() {
        let gains = gains(100.0);
        let mut observer = Observer::default();
        let quiet = (0..4_000).map(|n| observer.step(&gains, Some(encoder(200.0 * n as f64 / RATE, 14)), 0.0));
        let quiet = quiet.skip(2_000).map(|found| found.innovation.abs()).fold(0.0, f32::max);
        assert!(quiet < 4e-4, "one step of the encoder: {quiet}");

        let mut jumped = observer;
        let found = jumped.step(&gains, Some(encoder(200.0 * 4_000.0 / RATE + 0.5, 14)), 0.0);
        assert!((found.innovation - 0.5).abs() < 1e-3, "{found:?}");

        let stuck = Some(encoder(200.0 * 3_999.0 / RATE, 14));
        let first = observer.step(&gains, stuck, 0.0).innovation;
        let second = observer.step(&gains, stuck, 0.0).innovation;
        assert!((first + 0.01).abs() < 5e-4 && second < 1.7 * first, "{first} {second}");
    }

    #[test]
    fn without_a_first_sample_there_is_no_motion() {
        let mut observer = Observer::default();
        assert_eq!(observer.step(&gains(100.0), None, 1e6), Observation::default());
        let first = observer.step(&gains(100.0), Some(7), 0.0);
        assert_eq!((first.motion.position, first.innovation), (7, 0.0));
    }

    #[test]
    fn settings_out_of_range_are_refused_by_name() {
        let settings = SETTINGS;
        let refused = |settings: ObserverSettings| ObserverGains::new(&settings).unwrap_err().name;
        assert_eq!(refused(ObserverSettings { bandwidth: 2100.0, ..settings }), "observer's bandwidth");
        assert_eq!(refused(ObserverSettings { highest_velocity: 63_000.0, ..settings }), "highest velocity");
        assert_eq!(refused(ObserverSettings { highest_acceleration: 0.0, ..settings }), "highest acceleration");
        assert_eq!(refused(ObserverSettings { rate: 0.0, ..settings }), "control rate");
        assert_eq!(refused(ObserverSettings { latency: f32::NAN, ..settings }), "encoder's latency");
    }

    proptest! {
        #[test]
        fn whatever_comes_the_motion_is_finite_and_bounded_and_the_observer_finds_back(
            samples in prop::collection::vec((any::<Option<u32>>(), any::<u32>()), 1..60), rest: u32,
        ) {
            let gains = gains(100.0);
            let mut observer = Observer::default();
            let mut found = Observation::default();
            for (sample, bits) in samples {
                found = observer.step(&gains, sample, f32::from_bits(bits));
                prop_assert!(found.motion.velocity.abs() <= gains.highest_velocity);
                prop_assert!(found.motion.acceleration.abs() <= 2.0 * gains.highest_acceleration);
                prop_assert!(found.innovation.abs() <= core::f32::consts::PI);
            }
            for _ in 0..20_000 {
                found = observer.step(&gains, Some(rest), 0.0);
            }
            prop_assert!(found.motion.velocity.abs() < 1.0, "{found:?}");
            prop_assert!((found.motion.angle().wrapping_sub(rest) as i32).abs() < 1 << 16, "{found:?}");
        }
    }
}
