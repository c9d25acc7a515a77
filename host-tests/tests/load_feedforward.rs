//! The feedforward of the load on random joints with a payload: what it takes off the position error and off the torque
//! that the controller has to find, and how much of that is left where inertia and payload are wrong by 30 %.
//! docs/load.md has the figures.

use host_tests::borne::{Errors, configured, moved};
use host_tests::in_the_loop::{for_seeds, median};
use joint_firmware::joint::Mode;
use joint_firmware::joint::configuration::LoadConfiguration;
use plant::actuator::ActuatorParameters;

/// Seeds of the random joints.
const SEEDS: std::ops::Range<u64> = 1..21;

/// A row of the table in docs/load.md, and a tenth of it: position error and torque error with a configuration that is
/// right or wrong by a factor, % of those without feedforward, median and worst.
struct Row {
    mode: Mode,
    factor: f64,
    position: (f64, f64),
    torque: (f64, f64),
}

const fn row(mode: Mode, factor: f64, position: (f64, f64), torque: (f64, f64)) -> Row {
    Row { mode, factor, position, torque }
}

const TABLE: [Row; 6] = [
    row(Mode::Impedance, 1.0, (11.9, 20.7), (8.2, 18.9)),
    row(Mode::Impedance, 0.7, (34.9, 39.8), (33.9, 37.6)),
    row(Mode::Impedance, 1.3, (35.6, 42.2), (33.9, 37.7)),
    row(Mode::Position, 1.0, (8.6, 15.3), (11.2, 22.7)),
    row(Mode::Position, 0.7, (34.0, 37.9), (34.8, 39.5)),
    row(Mode::Position, 1.3, (34.7, 38.8), (34.7, 39.3)),
];

/// Median and worst.
fn both(values: Vec<f64>) -> (f64, f64) {
    let worst = values.iter().fold(0.0f64, |worst, value| worst.max(*value));
    (median(values), worst)
}

#[test]
fn a_load_that_is_known_is_a_tenth_of_the_error_and_one_that_is_wrong_by_30_percent_a_third() {
    for mode in [Mode::Impedance, Mode::Position] {
        let moved = |load: &(dyn Fn(&ActuatorParameters) -> LoadConfiguration + Sync)| -> Vec<Errors> {
            for_seeds(SEEDS, |seed| moved(seed, mode, load)).into_iter().map(Result::unwrap).collect()
        };
        let without = moved(&|_| LoadConfiguration::NONE);
        assert!(without.iter().all(|errors| errors.torque == 100.0), "{mode:?}: {without:?}");
        for Row { factor, position, torque, .. } in TABLE.iter().filter(|row| row.mode == mode) {
            let with = moved(&|parameters| configured(parameters, *factor));
            let ratios = with.iter().zip(&without).map(|(with, without)| 100.0 * with.position / without.position);
            let found = (both(ratios.collect()), both(with.iter().map(|errors| errors.torque).collect()));
            println!("{mode:?}, load times {factor}: position and torque error [%], median and worst: {found:.1?}");
            let ((middle, worst), (torque_middle, torque_worst)) = found;
            assert!(middle <= position.0 && worst <= position.1, "{mode:?} {factor}: position {found:?} %");
            assert!(torque_middle <= torque.0 && torque_worst <= torque.1, "{mode:?} {factor}: torque {found:?} %");
        }
    }
}
