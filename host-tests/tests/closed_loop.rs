//! Compensation in the loop, on random joints that are not our model: each is excited without compensation, recorded as a user would,
//! fitted, and moved with the image that came out. The torque that friction would have taken arrives, and slow reversals track.

mod commission;

use commission::{Commissioned, commission};
use host_tests::driving::{enabled, follow};
use joint_firmware::compensation::Request;
use joint_firmware::friction::FrictionModel;
use jointctl::metrics::relative_floor;
use plant::actuator::ActuatorParameters;
use plant::excitation::{Segment, Trajectory, slow_reversals};
use plant::virtual_joint::Setup;
use std::thread;

/// Seeds of the random joints.
const SEEDS: std::ops::RangeInclusive<u64> = 1..=20;
/// Largest relative torque error with compensation, median and worst, %.
const TORQUE_ERROR: (f64, f64) = (12.0, 20.0);
/// Least factor by which the position error of slow reversals falls, median.
const TRACKING_GAIN: f64 = 3.0;

/// Errors along one trajectory.
#[derive(Clone, Copy, Debug)]
struct Errors {
    /// Mean of |friction - compensation| / |motor torque|, %, where the motor torque is at least a tenth of its RMS (001 eq. 11).
    torque: f64,
    /// RMS of the position error, rad.
    tracking: f64,
}

/// Follows the trajectory 10 K above the ambient temperature.
fn errors(
    parameters: &ActuatorParameters,
    setup: &Setup,
    model: Option<FrictionModel>,
    trajectory: &Trajectory,
) -> Result<Errors, String> {
    let mut joint = enabled(parameters, setup, 10.0, 99).map_err(|error| error.to_string())?;
    joint.set_friction(model);
    let mut torques: Vec<(f64, f64)> = Vec::new();
    let mut squares = 0.0;
    let outcome = follow(&mut joint, trajectory, |time, telemetry, state| {
        let left = state.joint.friction_torque - f64::from(telemetry.compensated.torque);
        torques.push((state.joint.motor_torque, left));
        squares += (trajectory.at(time).position - state.joint.position).powi(2);
    });
    outcome.map_err(|state| {
        format!("ended in {state:?}: {:?}", joint.joint().latched_faults().iter().collect::<Vec<_>>())
    })?;
    let motor: Vec<f64> = torques.iter().map(|(motor, _)| *motor).collect();
    let floor = relative_floor(&motor, 0.1);
    let counted: Vec<f64> =
        torques.iter().filter(|(motor, _)| motor.abs() >= floor).map(|(motor, left)| (left / motor).abs()).collect();
    Ok(Errors {
        torque: 100.0 * counted.iter().sum::<f64>() / counted.len() as f64,
        tracking: (squares / torques.len() as f64).sqrt(),
    })
}

/// One joint without and with compensation.
#[derive(Clone, Copy, Debug)]
struct Row {
    seed: u64,
    network: bool,
    moves: [Errors; 2],
    reversals: [Errors; 2],
}

impl Row {
    fn tracking_gain(&self) -> f64 {
        self.reversals[0].tracking / self.reversals[1].tracking
    }
}

fn row(seed: u64) -> Result<Row, String> {
    let parameters = ActuatorParameters::randomised(seed).aligned();
    let off = Setup::of(&parameters);
    let on = off.compensating(Request::PhysicalAndNetwork);
    let Commissioned { model, network } = commission(&parameters, &off, seed)?;

    let limits = &parameters.joint.limits;
    let acceleration = parameters.joint.usable_acceleration().min(20.0);
    // Shares of speed limit and travel.
    let moves = [(0.5, 0.6), (0.5, -0.6), (0.2, 0.3), (0.7, -0.3), (0.05, 0.0)].map(|(speed, to)| Segment::Move {
        to: to * limits.travel,
        speed: speed * limits.speed,
        acceleration: 0.5 * acceleration,
    });
    let moves = Trajectory::new(moves.to_vec()).map_err(|error| error.to_string())?;
    let reversals = Trajectory::new(slow_reversals(0.01 * limits.speed, 1.0, acceleration, 6));
    let reversals = reversals.map_err(|error| error.to_string())?;
    let both = |trajectory: &Trajectory| {
        Ok::<_, String>([
            errors(&parameters, &off, None, trajectory)?,
            errors(&parameters, &on, Some(model.clone()), trajectory)?,
        ])
    };
    Ok(Row { seed, network, moves: both(&moves)?, reversals: both(&reversals)? })
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let n = values.len();
    0.5 * (values[(n - 1) / 2] + values[n / 2])
}

#[test]
fn the_torque_that_friction_takes_is_given_back_and_slow_reversals_track() {
    let threads = thread::available_parallelism().map_or(1, usize::from) as u64;
    let mut rows: Vec<Row> = thread::scope(|scope| {
        let workers: Vec<_> = (0..threads)
            .map(|n| {
                let seeds = SEEDS.filter(move |seed| seed % threads == n);
                scope.spawn(move || {
                    seeds.map(|seed| row(seed).map_err(|e| format!("joint {seed}: {e}"))).collect::<Vec<_>>()
                })
            })
            .collect();
        workers.into_iter().flat_map(|worker| worker.join().unwrap()).map(Result::unwrap).collect()
    });
    rows.sort_by_key(|row| row.seed);

    println!("joint  network  moves: torque error [%]   slow reversals: RMS position error [mrad]");
    for row in &rows {
        let [before, after] = row.moves;
        let [slow_before, slow_after] = row.reversals;
        println!(
            "{:5}  {:7}  {:10.1} -> {:4.1}         {:10.3} -> {:6.3}  ({:.1}x)",
            row.seed,
            if row.network { "yes" } else { "no" },
            before.torque,
            after.torque,
            1e3 * slow_before.tracking,
            1e3 * slow_after.tracking,
            row.tracking_gain()
        );
    }
    let torque: Vec<f64> = rows.iter().map(|row| row.moves[1].torque).collect();
    let worst = torque.iter().fold(0.0f64, |worst, error| worst.max(*error));
    let before = median(rows.iter().map(|row| row.moves[0].torque).collect());
    let (error, gain) = (median(torque), median(rows.iter().map(Row::tracking_gain).collect()));
    println!(
        "torque error: median {before:.1} -> {error:.1} %, worst {worst:.1} %; slow reversals {gain:.1}x better (median)"
    );
    assert!(error <= TORQUE_ERROR.0 && worst <= TORQUE_ERROR.1, "torque error {error} % median, {worst} % worst");
    assert!(gain >= TRACKING_GAIN, "tracking {gain}x");
}
