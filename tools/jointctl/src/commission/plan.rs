//! Plan of a commissioning: what a user says of a joint before it, and what of it is a number that cannot be.

use super::failure::Failure;
use serde::Deserialize;

/// Known values of the joint, and how it is to be commissioned. What is absent stays as the joint has it.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Plan {
    /// Current that the rotor is held and turned with, A: enough to overcome friction and load with ease.
    pub current: f64,
    /// Largest current of the motor, A.
    pub current_limit: Option<f64>,
    /// Pole pairs by the data sheet.
    pub pole_pairs: Option<u32>,
    /// Counts a turn of an incremental encoder: four times its lines.
    pub counts: Option<u32>,
    /// Torque at the rotor by q current, Nm/A. Absent on a new joint: the one by back-EMF.
    pub torque_constant: Option<f64>,
    /// Rotor revolutions per revolution of the joint.
    pub gear: Option<f64>,
    /// Position, rad, that the joint has now.
    pub zero: Option<f64>,
    /// Turns of the rotor to each side that the joint is free to make.
    pub travel: f64,
    /// Torque of a load, Nm, that the joint holds still at the end, to check the torque constant by.
    pub load: Option<f64>,
    /// Inertia at the joint, kg m^2, the rotor's included, to check the torque constant by.
    pub inertia: Option<f64>,
    /// The motor is turned with the new configuration at the end.
    pub turn: bool,
    /// A fault whose cause is gone is acknowledged first.
    pub acknowledge: bool,
}

impl Plan {
    /// Plan with a current, A, and nothing else known.
    pub const fn new(current: f64) -> Self {
        Self {
            current,
            current_limit: None,
            pole_pairs: None,
            counts: None,
            torque_constant: None,
            gear: None,
            zero: None,
            travel: 1.0,
            load: None,
            inertia: None,
            turn: true,
            acknowledge: false,
        }
    }

    /// Refuses numbers that cannot be, before anything is asked of the joint.
    ///
    /// # Errors
    /// The first, with its limits.
    pub fn check(&self) -> Result<(), Failure> {
        let whole = |number: Option<u32>| number.map(f64::from);
        for (what, value, limits, unit) in [
            ("--current", Some(self.current), [0.1, 200.0], "A"),
            ("--current-limit", self.current_limit, [0.1, 200.0], "A"),
            ("--pole-pairs", whole(self.pole_pairs), [1.0, 64.0], ""),
            ("--counts", whole(self.counts), [16.0, 65_535.0], ""),
            ("--torque-constant", self.torque_constant, [0.001, 5.0], "Nm/A"),
            ("the magnitude of --gear", self.gear.map(f64::abs), [1.0, 500.0], ""),
            ("--zero", self.zero, [-1000.0, 1000.0], "rad"),
            ("--travel", Some(self.travel), [0.05, 1.0], "turns of the rotor"),
            ("the magnitude of --load", self.load.map(f64::abs), [0.001, 2000.0], "Nm"),
            ("--inertia", self.inertia, [1e-7, 1000.0], "kg m^2"),
        ] {
            match value {
                Some(value) if !(limits[0]..=limits[1]).contains(&value) => {
                    return Err(Failure::Range { what, value, limits, unit });
                }
                _ => {}
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_is_refused_just_beyond_its_limit_by_the_name_of_its_option() {
        let plan = Plan::new(8.0);
        assert_eq!(plan.check(), Ok(()));
        for (good, bad, name) in [
            (Plan { counts: Some(16), ..plan }, Plan { counts: Some(15), ..plan }, "--counts"),
            (Plan { counts: Some(65_535), ..plan }, Plan { counts: Some(65_536), ..plan }, "--counts"),
            (Plan { pole_pairs: Some(64), ..plan }, Plan { pole_pairs: Some(65), ..plan }, "--pole-pairs"),
            (Plan { gear: Some(-1.0), ..plan }, Plan { gear: Some(-0.99), ..plan }, "--gear"),
            (Plan { travel: 0.05, ..plan }, Plan { travel: 0.049, ..plan }, "--travel"),
            (Plan { inertia: Some(1e-7), ..plan }, Plan { inertia: Some(0.9e-7), ..plan }, "--inertia"),
            (Plan { inertia: Some(1000.0), ..plan }, Plan { inertia: Some(1000.1), ..plan }, "--inertia"),
            (Plan { current: 0.1, ..plan }, Plan { current: f64::NAN, ..plan }, "--current"),
        ] {
            assert_eq!(good.check(), Ok(()), "{good:?}");
            let message = bad.check().unwrap_err().to_string();
            assert!(message.contains(name), "{message}");
        }
    }
}
