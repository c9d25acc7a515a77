//! Judgement of a joint: where it was against where it should have been, and the torque that arrived against the torque
//! that was asked for; host.
//!
//! Torque that did not arrive is the command before compensation less what the motor gives and friction leaves. It is
//! judged as everywhere ([`mod@identification::torque_error`]): below 20 Hz, as a share of the friction. Beside it
//! stands equation 11 of the mobile-robot paper (001), |what did not arrive| / |motor torque|, without samples below a
//! tenth of the motor torque's RMS.

use super::log::Log;
use identification::metrics::{Metrics, MetricsError, RELATIVE_FLOOR, metrics, relative_floor};
use identification::torque_error::{Lost, torque_error};

/// Errors over some runs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Judgement {
    /// RMS distance from the reference, rad. None where no sample was to follow one.
    pub position_rms: Option<f64>,
    /// Largest distance from the reference, rad.
    pub position_max: Option<f64>,
    /// Torque error, % of the friction. None without samples.
    pub torque_error: Option<f64>,
    /// The same while the joint was to move.
    pub torque_error_in_motion: Option<f64>,
    /// Torque that arrived against the motor torque, for equation 11. None without samples.
    pub torque: Option<Metrics>,
    /// Share of the samples in motion for which the image was faded out, %.
    pub faded: f64,
}

/// Judges runs together. A run with `tracks` false has a reference that cannot be reached, because something is in its
/// way. The joint was to move where the reference is faster than `standstill` (rad/s).
///
/// # Errors
/// A torque that is not a number.
pub fn judge<'a>(runs: impl IntoIterator<Item = (bool, &'a Log)>, standstill: f64) -> Result<Judgement, MetricsError> {
    let (mut errors, mut motor, mut given) = (Vec::new(), Vec::new(), Vec::new());
    let (mut all, mut moving) = (Vec::new(), Vec::new());
    let (mut faded, mut moves) = (0usize, 0usize);
    for (tracks, log) in runs {
        let rows = &log.rows;
        if tracks {
            errors.extend(rows.iter().map(super::Row::position_error));
        }
        let lost: Vec<f64> = rows.iter().map(|row| row.commanded_torque - row.arriving_torque()).collect();
        motor.extend(rows.iter().map(|row| row.true_motor_torque));
        given.extend(rows.iter().zip(&lost).map(|(row, lost)| row.true_motor_torque - lost));
        let in_motion: Vec<bool> = rows.iter().map(|row| row.reference_velocity.abs() > standstill).collect();
        moves += in_motion.iter().filter(|moves| **moves).count();
        faded += rows.iter().zip(&in_motion).filter(|(row, moves)| **moves && row.faded).count();
        let elapsed = rows.last().map_or(0.0, |last| last.time - rows[0].time);
        let one = Lost {
            period: elapsed / rows.len().saturating_sub(1).max(1) as f64,
            lost,
            friction: rows.iter().map(|row| row.true_friction_torque).collect(),
            counts: vec![true; rows.len()],
        };
        moving.push(Lost { counts: in_motion, ..one.clone() });
        all.push(one);
    }
    let floor = relative_floor(&motor, RELATIVE_FLOOR);
    let followed = !errors.is_empty();
    let squares: f64 = errors.iter().map(|error| error * error).sum();
    Ok(Judgement {
        position_rms: followed.then(|| (squares / errors.len() as f64).sqrt()),
        position_max: followed.then(|| errors.iter().fold(0.0, |largest: f64, error| largest.max(error.abs()))),
        torque: metrics(&motor, &given, floor)?,
        torque_error: torque_error(&all),
        torque_error_in_motion: torque_error(&moving),
        faded: 100.0 * faded as f64 / moves.max(1) as f64,
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
        // 5 / 10 and 1 / 4 of the motor torque; all of the friction is lost.
        let relative = judged.torque.as_ref().unwrap().relative_torque_error.unwrap();
        assert!((relative - 37.5).abs() < 1e-12, "{judged:?}");
        assert_eq!((judged.torque_error, judged.torque_error_in_motion), (Some(100.0), Some(100.0)));
        assert_eq!(judged.faded, 0.0);
    }

    #[test]
    fn what_compensation_gives_is_not_lost_and_fading_is_counted_in_motion_only() {
        let compensated = |moves: f64, faded| Row { faded, ..row((1.0, moves), 1.0, 10.0, 14.0, 5.0) };
        let rows = vec![compensated(1.0, true), compensated(1.0, false), compensated(0.0, true)];
        let judged = judge([(true, &Log { rows })], 0.01).unwrap();
        assert!((judged.torque_error.unwrap() - 20.0).abs() < 1e-9, "{judged:?}");
        assert_eq!(judged.faded, 50.0);
    }

    #[test]
    fn small_torques_count_in_no_quotient_and_a_wall_in_no_distance() {
        let rows = vec![row((1.0, 1.0), 0.0, 10.0, 10.0, 1.0), row((1.0, 1.0), 0.0, 0.01, 0.01, 1.0)];
        let judged = judge([(false, &Log { rows })], 0.01).unwrap();
        assert_eq!((judged.position_rms, judged.position_max), (None, None));
        let torque = judged.torque.unwrap();
        assert_eq!((torque.samples, torque.relative_excluded), (2, 1));
        assert!((torque.relative_torque_error.unwrap() - 10.0).abs() < 1e-12, "{torque:?}");
    }

    #[test]
    fn nothing_recorded_is_no_error_and_not_a_number_is_refused() {
        assert_eq!(judge([(true, &Log::default())], 0.01), Ok(Judgement::default()));
        assert!(judge([(true, &Log { rows: vec![row((0.0, 0.0), 0.0, f64::NAN, 0.0, 0.0)] })], 0.01).is_err());
    }
}
