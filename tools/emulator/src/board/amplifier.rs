//! Response of a current amplifier to the current through the shunt of a low side that begins to conduct: a dead time,
//! then one pole.
//!
//! While its low side does not conduct, no current flows through a shunt, and the amplifier shows that. What is sampled
//! before it has settled is too small.

/// A current amplifier's step response.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Amplifier {
    /// Delay from the edge at the gate driver's input until the output begins to follow, s.
    pub delay: f64,
    /// Time constant of what follows, s.
    pub time_constant: f64,
}

/// Time constants until a step has settled to within 1 %: ln 100.
const TO_A_PERCENT: f64 = 4.605_170_185_988_091;

impl Amplifier {
    /// Settled to within 1 % a time `settling` (s) after the delay.
    pub const fn settling(delay: f64, settling: f64) -> Self {
        Self { delay, time_constant: settling / TO_A_PERCENT }
    }

    /// An operational amplifier with a gain-bandwidth product (Hz) at a noise gain.
    pub const fn with_bandwidth(delay: f64, product: f64, gain: f64) -> Self {
        Self { delay, time_constant: gain / (std::f64::consts::TAU * product) }
    }

    /// Part of a step that the output has followed so long (s) after the low side began to conduct, 0 to 1.
    pub fn followed(&self, conducting: f64) -> f64 {
        1.0 - (-(conducting - self.delay).max(0.0) / self.time_constant).exp()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_output_stays_for_the_delay_and_has_settled_to_a_percent_after_its_time() {
        let amplifier = Amplifier::settling(0.5e-6, 1e-6);
        assert_eq!(amplifier.followed(0.0), 0.0);
        assert_eq!(amplifier.followed(0.5e-6), 0.0);
        assert!(amplifier.followed(1.49e-6) < 0.99 && amplifier.followed(1.51e-6) > 0.99);
        assert_eq!(amplifier.followed(f64::INFINITY), 1.0);
    }

    #[test]
    fn the_bandwidth_at_a_gain_is_the_product_over_it() {
        let amplifier = Amplifier::with_bandwidth(0.0, 16e6 / std::f64::consts::TAU, 16.0);
        assert!((amplifier.time_constant - 1e-6).abs() < 1e-12);
    }
}
