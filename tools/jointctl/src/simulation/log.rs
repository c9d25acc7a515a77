//! Record of a simulated run: what the joint knows, and what is true; host.
//!
//! The table is written with the name and unit of each column in its header. Columns that begin with `true_` are not
//! measured by anything: a fit may use the others only.

use std::fmt::Write;

/// One sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Row {
    /// Time since the motion started, s.
    pub time: f64,
    /// Reference position of the joint, rad.
    pub reference_position: f64,
    /// Reference velocity of the joint, rad/s.
    pub reference_velocity: f64,
    /// Position as the joint knows it, rad.
    pub position: f64,
    /// Velocity as the joint knows it, rad/s.
    pub velocity: f64,
    /// Torque that was asked for, before compensation, Nm.
    pub commanded_torque: f64,
    /// Torque that compensation added, Nm.
    pub compensation_torque: f64,
    /// Torque of the measured current at the joint, Nm.
    pub measured_torque: f64,
    /// A signal lay outside the image's trained box: network or model were faded out.
    pub faded: bool,
    /// Measured current along d, A.
    pub current_d: f64,
    /// Measured current along q, A.
    pub current_q: f64,
    /// Supply, V.
    pub bus_voltage: f64,
    /// Winding's sensor, °C; not a number where there is none.
    pub winding_temperature: f64,
    /// Temperature of the gear as the joint's thermal model has it, °C.
    pub gear_temperature: f64,
    /// Position, rad.
    pub true_position: f64,
    /// Velocity, rad/s.
    pub true_velocity: f64,
    /// Motor torque at the link before friction, Nm.
    pub true_motor_torque: f64,
    /// Friction torque, Nm.
    pub true_friction_torque: f64,
    /// Torque of gravity and contact that the motor has to hold, Nm.
    pub true_load_torque: f64,
    /// Temperature of the gear, °C.
    pub true_gear_temperature: f64,
}

impl Row {
    /// Torque that arrives at the link, Nm: what the motor gives less what friction takes.
    #[must_use]
    pub fn arriving_torque(&self) -> f64 {
        self.true_motor_torque - self.true_friction_torque
    }

    /// Distance from where the joint should be, rad.
    #[must_use]
    pub fn position_error(&self) -> f64 {
        self.reference_position - self.true_position
    }
}

/// Name, decimals and value of a column.
type Column = (&'static str, usize, fn(&Row) -> f64);

/// The columns in the order of the table.
const COLUMNS: [Column; 20] = [
    ("time_s", 5, |r| r.time),
    ("reference_position_rad", 6, |r| r.reference_position),
    ("reference_velocity_rad_s", 5, |r| r.reference_velocity),
    ("position_rad", 6, |r| r.position),
    ("velocity_rad_s", 5, |r| r.velocity),
    ("commanded_torque_Nm", 4, |r| r.commanded_torque),
    ("compensation_torque_Nm", 4, |r| r.compensation_torque),
    ("measured_torque_Nm", 4, |r| r.measured_torque),
    ("faded", 0, |r| f64::from(u8::from(r.faded))),
    ("current_d_A", 4, |r| r.current_d),
    ("current_q_A", 4, |r| r.current_q),
    ("bus_voltage_V", 3, |r| r.bus_voltage),
    ("winding_temperature_C", 2, |r| r.winding_temperature),
    ("gear_temperature_C", 2, |r| r.gear_temperature),
    ("true_position_rad", 7, |r| r.true_position),
    ("true_velocity_rad_s", 6, |r| r.true_velocity),
    ("true_motor_torque_Nm", 4, |r| r.true_motor_torque),
    ("true_friction_torque_Nm", 4, |r| r.true_friction_torque),
    ("true_load_torque_Nm", 4, |r| r.true_load_torque),
    ("true_gear_temperature_C", 3, |r| r.true_gear_temperature),
];

/// The samples of one run, in time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Log {
    /// The samples.
    pub rows: Vec<Row>,
}

/// Several logs as one table of comma-separated values; the first column says which part a row belongs to. What is not
/// a number is left empty.
#[must_use]
pub fn csv<'a>(parts: impl IntoIterator<Item = (&'a str, &'a Log)>) -> String {
    let mut text = String::from("part");
    for (name, ..) in COLUMNS {
        text.push(',');
        text.push_str(name);
    }
    text.push('\n');
    for (part, log) in parts {
        for row in &log.rows {
            text.push_str(part);
            for (_, decimals, value) in COLUMNS {
                let value = value(row);
                // Writing to a string cannot fail.
                let _ = if value.is_finite() { write!(text, ",{value:.decimals$}") } else { write!(text, ",") };
            }
            text.push('\n');
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_has_a_value_under_each_name_and_nothing_for_a_missing_sensor() {
        let row = Row { time: 0.004, position: -1.25, winding_temperature: f64::NAN, ..Row::default() };
        let text = csv([("cold", &Log { rows: vec![row] })]);
        let lines: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
        assert_eq!((lines.len(), lines[0].len(), lines[1].len()), (2, COLUMNS.len() + 1, COLUMNS.len() + 1));
        let value = |name| lines[1][lines[0].iter().position(|found| *found == name).unwrap()];
        assert_eq!((value("part"), value("time_s"), value("position_rad")), ("cold", "0.00400", "-1.250000"));
        assert_eq!(value("winding_temperature_C"), "");
    }
}
