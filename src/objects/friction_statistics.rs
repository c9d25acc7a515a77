//! Statistics of compensation over time: departures from the range that friction was learned in, and the distance of
//! the full model from what acts; a task that looks at telemetry at an even rate.

use crate::joint::Telemetry;
use crate::motor::number::{or_zero, square_root};
use friction_compensation::compensation::{Output, Reason};

/// Looks over which the mean square is taken: about a second at 1 kHz.
const MEMORY: f32 = 1_000.0;

/// Statistics of one joint, since it was switched on.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrictionStatistics {
    violations: u16,
    outside: bool,
    /// Nm².
    mean_square: f32,
}

impl FrictionStatistics {
    /// Takes note of a control step; once a millisecond.
    pub fn note(&mut self, telemetry: &Telemetry) {
        let Output { torque, shadow, reason, .. } = telemetry.compensated.output;
        let outside = matches!(reason, Reason::OutsideTrainedBox(_) | Reason::FarOutsideTrainedBox(_));
        if outside && !self.outside {
            self.violations = self.violations.saturating_add(1);
        }
        self.outside = outside;
        let difference = (i64::from(shadow.to_bits()) - i64::from(torque.to_bits())) as f32 * (1.0 / 65_536.0);
        self.mean_square = or_zero(self.mean_square + (difference * difference - self.mean_square) / MEMORY);
    }

    /// Departures from the trained range; stays at the highest number.
    pub const fn violations(&self) -> u16 {
        self.violations
    }

    /// Root of the mean square of the full model's torque less what acted, Nm.
    pub fn shadow_rms(&self) -> f32 {
        square_root(self.mean_square)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use friction_compensation::friction::state::Signal;
    use friction_compensation::quantity::Torque;

    fn telemetry(reason: Reason, shadow: f32) -> Telemetry {
        let mut telemetry = Telemetry::default();
        telemetry.compensated.output =
            Output { shadow: Torque::from_bits((shadow * 65_536.0) as i32), reason, ..Output::default() };
        telemetry
    }

    #[test]
    fn a_departure_counts_once_however_long_it_lasts() {
        let mut statistics = FrictionStatistics::default();
        let away = Reason::OutsideTrainedBox(Signal::Velocity);
        for reason in [Reason::AsRequested, away, away, Reason::AsRequested, away] {
            statistics.note(&telemetry(reason, 0.0));
        }
        assert_eq!(statistics.violations(), 2);
    }

    #[test]
    fn a_constant_difference_is_its_own_mean() {
        let mut statistics = FrictionStatistics::default();
        for _ in 0..10_000 {
            statistics.note(&telemetry(Reason::AsRequested, -0.5));
        }
        assert!((statistics.shadow_rms() - 0.5).abs() < 1e-3, "{}", statistics.shadow_rms());
    }
}
