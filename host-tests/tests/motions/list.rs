//! The motions that are left out, one after the other.

/// A motion that is left out of a recording, and judged on.
pub struct Motion {
    /// Description in `tools/jointctl/datasets`.
    pub data_set: &'static str,
    /// Its name in the table.
    pub name: String,
    /// The rule of the test set, as `[split]` of a description has it.
    pub rule: String,
}

/// All motions, in the order of the table.
pub fn all() -> Vec<Motion> {
    let mut all = Vec::new();
    let mut add = |data_set, name: String, rule: String| all.push(Motion { data_set, name, rule });
    let file = |name: &str| format!("files = [\"{name}\"]");
    let equal = |column: &str, value: &str| format!("where = [{{ column = \"{column}\", equals = {value} }}]");

    for (name, found) in
        [("motion without pulses", "emps_train.csv.gz"), ("motion with pulses", "emps_test_pulses.csv.gz")]
    {
        add("emps", name.to_owned(), file(found));
    }
    // One motion, repeated: all that can be left out is time.
    for joint in ["ur10e_joint1", "ur10e_joint2", "ur10e_joint3"] {
        for quarter in [0, 3] {
            let rule = format!("blocks = {{ length = 16.0, modulo = 4, index = [{quarter}] }}");
            add(joint, format!("16 s from {} s", 16 * quarter), rule);
        }
    }
    for joint in ["ur10e_fourier_joint4", "ur10e_fourier_joint6"] {
        for name in ["fourier_30s", "fourier_40s", "fourier_50s", "fourier_15harm_50s"] {
            add(joint, name.to_owned(), file(&format!("{name}.csv.gz")));
        }
    }
    for speed in ["0.1", "0.4", "0.7", "0.9", "1.1"] {
        add("iiwa_joint4", format!("{speed} rad/s"), equal("nominal_speed_rad_s", speed));
    }
    for kp in ["100", "200", "400", "800"] {
        add("xl330", format!("kp {kp}"), equal("kp", kp));
    }
    for trajectory in ["sin_sin", "up_and_down", "sin_time_square"] {
        add("xl330", trajectory.to_owned(), equal("trajectory", &format!("\"{trajectory}\"")));
    }
    for axis in [
        "kuka_kr300_axis1",
        "kuka_kr300_axis2",
        "kuka_kr300_axis3",
        "kuka_kr300_axis4",
        "kuka_kr300_axis5",
        "kuka_kr300_axis6",
    ] {
        for run in ["A", "B"] {
            add(axis, format!("run {run}"), file(&format!("run_{run}.csv.gz")));
        }
    }
    for (motor, runs) in [
        ("dm_motor1", &["0", "7", "9", "16"][..]),
        ("dm_motor2", &["1", "8", "10", "17"]),
        ("dm_motor5", &["4", "13", "20"]),
        ("dm_motor6", &["5", "14"]),
    ] {
        for run in runs {
            add(motor, format!("run {run}"), format!("runs = [{run}]"));
        }
    }
    // What is faster than half of the greatest speed.
    for (data_set, column, speed) in [
        ("ur10e_joint1", "qd1_rad_s", "0.49"),
        ("ur10e_joint2", "qd2_rad_s", "0.32"),
        ("ur10e_joint3", "qd3_rad_s", "0.49"),
        ("ur10e_fourier_joint4", "qd4_rad_s", "0.52"),
        ("ur10e_fourier_joint6", "qd6_rad_s", "0.71"),
        ("iiwa_joint4", "velocity_rad_s", "0.7"),
        ("xl330", "velocity_rad_s", "5.4"),
        ("kuka_kr300_axis1", "qd1_motor_rad_s", "0.22"),
        ("kuka_kr300_axis2", "qd2_motor_rad_s", "0.22"),
        ("kuka_kr300_axis3", "qd3_motor_rad_s", "0.21"),
        ("kuka_kr300_axis4", "qd4_motor_rad_s", "0.28"),
        ("kuka_kr300_axis5", "qd5_motor_rad_s", "0.26"),
        ("kuka_kr300_axis6", "qd6_motor_rad_s", "0.38"),
        ("dm_motor1", "velocity_rad_s", "3.7"),
        ("dm_motor2", "velocity_rad_s", "3.8"),
        ("dm_motor5", "velocity_rad_s", "3.9"),
        ("dm_motor6", "velocity_rad_s", "3.9"),
    ] {
        let rule = format!("where = [{{ column = \"{column}\", outside = [-{speed}, {speed}] }}]");
        add(data_set, format!("above {speed} rad/s"), rule);
    }
    all
}
