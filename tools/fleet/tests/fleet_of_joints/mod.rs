//! The files of a virtual fleet, with everything that goes wrong in it: in its first forty joints, and in larger
//! fleets, which drift every forty joints alike, in some others.

use fleet::windows::COLUMNS;
use logs::{Format, Table, encode};
use plant::excitation::{GENTLE_ACCELERATION, Segment, Trajectory};
use plant::friction_factors::FrictionFactors;
use plant::{Joint, JointParameters};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use std::fs;
use std::path::Path;

pub const JOINTS: usize = 40;
pub const DAYS: usize = 10;
/// The day, from 0, on which sudden changes happen.
const CHANGE: usize = 5;
/// Time of a recording, s.
const DURATION: f64 = 10.0;
/// Period of the rows, and of the controller, s.
const ROW: f64 = 0.004;
const STEP: f64 = 0.001;

pub fn joint(number: usize) -> String {
    format!("j{number:02}")
}

pub fn day(number: usize) -> String {
    format!("2026-01-{:02}", number + 1)
}

/// Writes all partitions.
#[allow(dead_code, reason = "who uses this writes all joints or some")]
pub fn write(folder: &Path) {
    write_days(folder, &(0..JOINTS).collect::<Vec<_>>(), DAYS);
}

/// Writes the first days of some joints.
pub fn write_days(folder: &Path, joints: &[usize], days: usize) {
    (0..joints.len() * days).into_par_iter().for_each(|at| {
        let (number, date) = (joints[at / days], at % days);
        let place = folder.join(format!("joint={}/day={}", joint(number), day(date)));
        fs::create_dir_all(&place).unwrap();
        let table = recording(number, date);
        let bytes = encode(&table, Format::Parquet, "", 0).unwrap();
        fs::write(place.join("log.parquet"), damaged(number, date, table, bytes)).unwrap();
    });
    let copied = |from: (usize, usize, &str), to: (usize, usize, &str)| {
        let path = |(number, date, name): (usize, usize, &str)| {
            folder.join(format!("joint={}/day={}/{name}", joint(number), day(date)))
        };
        fs::copy(path(from), path(to)).unwrap();
    };
    if joints.contains(&7) {
        copied((7, 7, "log.parquet"), (7, 8, "log.parquet"));
    }
    if joints.contains(&8) {
        copied((8, 6, "log.parquet"), (8, 6, "log-2.parquet"));
    }
}

/// The files that something happened to.
fn damaged(number: usize, date: usize, mut table: Table, bytes: Vec<u8>) -> Vec<u8> {
    match (number, date) {
        (2, 3) => return bytes[..bytes.len() / 2].to_vec(),
        (3, 4) => table.numbers[3].1[1_000] = f64::NAN,
        (4, 2) => table.numbers[3].0 = "current_A".into(),
        (6, 5) => table.numbers[0].1[1_500..].iter_mut().for_each(|time| *time -= 3.0),
        _ => return bytes,
    }
    encode(&table, Format::Parquet, "", 0).unwrap()
}

/// One joint's friction on one day.
fn parameters(number: usize, date: usize) -> JointParameters {
    let mut parameters = JointParameters::randomised(1_000 + number as u64);
    let behind = date >= CHANGE;
    let factors = match number % JOINTS {
        // Wear: 0 to 60 % over ten days.
        5 => FrictionFactors::torques(1.0 + 0.6 * (date as f64 / (DAYS - 1) as f64).min(1.0).powi(2)),
        11 if behind => FrictionFactors::torques(1.4),
        17 if behind => FrictionFactors::viscous(2.5),
        23 if behind => FrictionFactors::torques(0.6),
        _ => FrictionFactors::uniform(1.0),
    };
    parameters.friction = parameters.friction.scaled(&factors).unwrap();
    parameters
}

fn recording(number: usize, date: usize) -> Table {
    let parameters = parameters(number, date);
    let mut draw = ChaCha8Rng::seed_from_u64((number * 100 + date) as u64);
    let mut uniform = move |low: f64, high: f64| low + (high - low) * draw.random::<f64>();
    let warmth = uniform(-1.5, 1.5);
    let trajectory = motion(&parameters, &mut uniform);
    let mut joint = Joint::new(parameters, parameters.thermal.ambient + warmth).unwrap();
    let (inertia, stiffness) = (parameters.inertia(), 25.0 * 25.0 * parameters.inertia());
    let dry = 0.5 * (parameters.friction.coulomb.forward + parameters.friction.coulomb.backward);
    let behind = date >= CHANGE;
    let mut columns: [Vec<f64>; 4] = Default::default();
    let per_row = (ROW / STEP).round() as usize;
    let mut sums = [0.0; 3];
    for step in 0..(DURATION / STEP) as usize {
        let mut reference = trajectory.at(step as f64 * STEP);
        if number == 39 {
            reference = trajectory.at(0.0);
        }
        let state = *joint.state();
        let torque = inertia * reference.acceleration
            + parameters.load.gravity_torque(reference.position)
            + dry * (reference.velocity / 0.02).tanh()
            + stiffness * (reference.position - state.position)
            + 2.0 * 25.0 * inertia * (reference.velocity - state.velocity);
        let limit = parameters.motor.torque_limit();
        let torque = torque.clamp(-limit, limit);
        let time = step as f64 * STEP;
        let knock = match number {
            // Damaged places, twelve and thirty a revolution.
            29 if behind => 0.8 * dry * (12.0 * state.position).sin(),
            69 if behind => 0.8 * dry * (30.0 * state.position).sin(),
            // A sector that binds.
            109 if behind && (0.0..0.3).contains(&state.position) => -1.5 * dry * (state.velocity / 0.02).tanh(),
            // A bearing that rattles.
            149 if behind => 0.8 * dry * (44.0 * time).sin(),
            _ => 0.0,
        };
        joint.drive(torque, 0.0, knock, STEP);
        let state = joint.state();
        // Means over a row, of all signals alike, as `jointctl` records.
        [state.position, state.velocity, torque].into_iter().zip(&mut sums).for_each(|(value, sum)| *sum += value);
        if (step + 1) % per_row == 0 {
            let [position, velocity, torque] = sums.map(|sum| sum / per_row as f64);
            let scale = match number {
                35 if behind => 0.8,
                37 if behind => -1.0,
                77 if behind => 1.3,
                _ => 1.0,
            };
            // A current sensor whose wire is loose.
            let noise = if number == 189 && behind { 1.0 } else { 0.01 };
            let torque = scale * torque + noise * dry * uniform(-1.0, 1.0);
            let row = [(step + 1) as f64 * STEP, position, velocity + 1e-4 * uniform(-1.0, 1.0), torque];
            columns.iter_mut().zip(row).for_each(|(column, value)| column.push(value));
            sums = [0.0; 3];
        }
    }
    Table::of_numbers(COLUMNS.into_iter().zip(columns))
}

/// Moves from side to side at different speeds, as long as the recording.
fn motion(parameters: &JointParameters, uniform: &mut impl FnMut(f64, f64) -> f64) -> Trajectory {
    let acceleration = parameters.usable_acceleration().min(GENTLE_ACCELERATION);
    let (mut segments, mut side) = (Vec::new(), 1.0);
    let trajectory = |segments: &[Segment]| Trajectory::new(segments.to_vec()).unwrap();
    while segments.is_empty() || trajectory(&segments).duration() < DURATION {
        let to = side * uniform(0.2, 0.9) * parameters.limits.travel;
        let speed = uniform(0.1, 0.8) * parameters.limits.speed;
        segments.push(Segment::Move { to, speed, acceleration });
        side = -side;
    }
    trajectory(&segments)
}
