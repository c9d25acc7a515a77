//! How well a joint did: where it was against where it should have been, and the torque that arrived against the
//! torque that was asked for; host.
//!
//! The relative torque error is equation 11 of the mobile-robot paper (001), in the loop: |asked - arrived| / |asked|,
//! where "asked" is the command before compensation and "arrived" is what the motor gives less what friction takes. As
//! offline ([`crate::metrics`]), samples below a tenth of the RMS of what was asked count in no quotient.

use super::log::Log;
use crate::metrics::{Metrics, MetricsError, RELATIVE_FLOOR, metrics, relative_floor};

/// Errors over some runs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Judgement {
    /// RMS distance from the reference, rad. None where no sample was to follow one.
    pub position_rms: Option<f64>,
    /// Largest distance from the reference, rad.
    pub position_max: Option<f64>,
    /// Torque that arrived against torque that was asked for. None without samples.
    pub torque: Option<Metrics>,
    /// The same while the joint was to move.
    pub torque_in_motion: Option<Metrics>,
}

/// Judges runs together. A run with `tracks` false has a reference that cannot be reached, because something is in its
/// way. The joint was to move where the reference is faster than `standstill` (rad/s).
///
/// # Errors
/// A torque that is not a number.
pub fn judge<'a>(runs: impl IntoIterator<Item = (bool, &'a Log)>, standstill: f64) -> Result<Judgement, MetricsError> {
    let (mut errors, mut asked, mut arrived, mut moves) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for (tracks, log) in runs {
        for row in &log.rows {
            if tracks {
                errors.push(row.position_error());
            }
            asked.push(row.commanded_torque);
            arrived.push(row.arriving_torque());
            moves.push(row.reference_velocity.abs() > standstill);
        }
    }
    let floor = relative_floor(&asked, RELATIVE_FLOOR);
    let moving = |column: &[f64]| -> Vec<f64> {
        column.iter().zip(&moves).filter(|(_, moves)| **moves).map(|(value, _)| *value).collect()
    };
    let followed = !errors.is_empty();
    let squares: f64 = errors.iter().map(|error| error * error).sum();
    Ok(Judgement {
        position_rms: followed.then(|| (squares / errors.len() as f64).sqrt()),
        position_max: followed.then(|| errors.iter().fold(0.0, |largest: f64, error| largest.max(error.abs()))),
        torque: metrics(&asked, &arrived, floor)?,
        torque_in_motion: metrics(&moving(&asked), &moving(&arrived), floor)?,
    })
}

#[cfg(test)]
mod tests {
    use super::super::log::Row;
    use super::*;

    fn row(reference: (f64, f64), position: f64, asked: f64, motor: f64, friction: f64) -> Row {
        Row {
            reference_position: reference.0,
            reference_velocity: reference.1,
            true_position: position,
            commanded_torque: asked,
            true_motor_torque: motor,
            true_friction_torque: friction,
            ..Row::default()
        }
    }

    #[test]
    fn errors_are_those_computed_by_hand() {
        let rows = vec![row((1.0, 1.0), 1.03, 10.0, 10.0, 5.0), row((1.0, 0.0), 0.96, -4.0, -4.0, -1.0)];
        let judged = judge([(true, &Log { rows })], 0.01).unwrap();
        assert!((judged.position_rms.unwrap() - 0.125_f64.sqrt() / 10.0).abs() < 1e-12, "{judged:?}");
        assert!((judged.position_max.unwrap() - 0.04).abs() < 1e-12);
        let relative = |metrics: &Option<Metrics>| metrics.as_ref().unwrap().relative_torque_error.unwrap();
        // 5 / 10 and 1 / 4; only the first was to move.
        assert!((relative(&judged.torque) - 37.5).abs() < 1e-12, "{judged:?}");
        assert!((relative(&judged.torque_in_motion) - 50.0).abs() < 1e-12, "{judged:?}");
    }

    #[test]
    fn small_torques_count_in_no_quotient_and_a_wall_in_no_distance() {
        let rows = vec![row((1.0, 1.0), 0.0, 10.0, 10.0, 1.0), row((1.0, 1.0), 0.0, 0.01, 0.0, 1.0)];
        let judged = judge([(false, &Log { rows })], 0.01).unwrap();
        assert_eq!((judged.position_rms, judged.position_max), (None, None));
        let torque = judged.torque.unwrap();
        assert_eq!((torque.samples, torque.relative_excluded), (2, 1));
        assert!((torque.relative_torque_error.unwrap() - 10.0).abs() < 1e-12);
    }

    #[test]
    fn nothing_recorded_is_no_error_and_not_a_number_is_refused() {
        assert_eq!(judge([(true, &Log::default())], 0.01), Ok(Judgement::default()));
        assert!(judge([(true, &Log { rows: vec![row((0.0, 0.0), 0.0, f64::NAN, 0.0, 0.0)] })], 0.01).is_err());
    }
}
