//! Compensation in the loop: the torque that was asked for arrives, slow reversals track, and nothing moves by itself.

mod commission;

use commission::{commission, enabled, follow};
use joint_firmware::compensation::Request;
use joint_firmware::friction::FrictionModel;
use plant::actuator::ActuatorParameters;
use plant::excitation::{Segment, Trajectory, slow_reversals};
use plant::virtual_joint::Setup;

/// Errors along one trajectory.
#[derive(Clone, Copy, Debug)]
struct Outcome {
    /// Mean |arrived - asked| / |asked|, %; the torque that was asked for and what of it moved the link.
    torque: f64,
    /// RMS of the position error, rad.
    tracking: f64,
}

fn outcome(
    parameters: &ActuatorParameters,
    setup: &Setup,
    model: Option<FrictionModel>,
    trajectory: &Trajectory,
) -> Result<Outcome, String> {
    let mut joint = enabled(parameters, setup, 10.0, 99).map_err(|error| error.to_string())?;
    joint.set_friction(model);
    let mut pairs: Vec<(f64, f64)> = Vec::new();
    let mut squares = 0.0;
    let mut count = 0u32;
    follow(&mut joint, trajectory, |time, telemetry, state| {
        let error = state.joint.friction_torque - f64::from(telemetry.compensated.torque);
        pairs.push((state.joint.motor_torque, error));
        if std::env::var_os("DEBUG").is_some() && count % 400 == 0 {
            println!(
                "{time:.3} q {:.4} v {:.4} ref {:.4} motor {:.3} friction {:.3} comp {:.3} {:?} wanted {:.3} e {:.5}",
                state.joint.position,
                state.joint.velocity,
                trajectory.at(time).velocity,
                state.joint.motor_torque,
                state.joint.friction_torque,
                telemetry.compensated.torque,
                telemetry.compensated.output.reason,
                telemetry.wanted.torque,
                trajectory.at(time).position - state.joint.position
            );
        }
        squares += (trajectory.at(time).position - state.joint.position).powi(2);
        count += 1;
    })
    .map_err(|state| format!("ended in {state:?}: {:?}", joint.joint().latched_faults().iter().collect::<Vec<_>>()))?;
    let asked: Vec<f64> = pairs.iter().map(|(motor, _)| *motor).collect();
    let floor = jointctl::metrics::relative_floor(&asked, 0.1);
    let relative: Vec<f64> =
        pairs.iter().filter(|(motor, _)| motor.abs() >= floor).map(|(motor, error)| (error / motor).abs()).collect();
    Ok(Outcome {
        torque: 100.0 * relative.iter().sum::<f64>() / relative.len() as f64,
        tracking: (squares / f64::from(count)).sqrt(),
    })
}

#[test]
fn twenty_random_joints() {
    let seeds: Vec<u64> =
        std::env::var("SEEDS").map_or((1..=20).collect(), |s| s.split(',').map(|s| s.parse().unwrap()).collect());
    for seed in seeds {
        let parameters = ActuatorParameters::randomised(seed).aligned();
        let off = Setup::of(&parameters);
        let start = std::time::Instant::now();
        let commissioned = match commission(&parameters, &off, seed) {
            Ok(c) => c,
            Err(e) => {
                println!("{seed}: {e}");
                continue;
            }
        };
        let limits = &parameters.joint.limits;
        let acceleration = parameters.joint.usable_acceleration().min(20.0);
        let mut segments = vec![];
        for (speed, to) in [(0.5, 0.6), (0.5, -0.6), (0.2, 0.3), (0.7, -0.3), (0.05, 0.0)] {
            segments.push(Segment::Move {
                to: to * limits.travel,
                speed: speed * limits.speed,
                acceleration: 0.5 * acceleration,
            });
        }
        let moves = Trajectory::new(segments).unwrap();
        let slow = Trajectory::new(slow_reversals(0.01 * limits.speed, 1.0, acceleration, 6)).unwrap();
        let on = off.compensating(Request::PhysicalAndNetwork);
        let fitted = start.elapsed();
        print!("{seed}: offline {:.1} %, network {}, ", commissioned.offline.unwrap_or(f64::NAN), commissioned.network);
        for (name, trajectory) in [("moves", &moves), ("slow", &slow)] {
            let before = outcome(&parameters, &off, None, trajectory);
            let after = outcome(&parameters, &on, Some(commissioned.model.clone()), trajectory);
            match (before, after) {
                (Ok(b), Ok(a)) => print!(
                    "{name}: torque {:.1} -> {:.1} %, tracking {:.5} -> {:.5} ({:.1}x); ",
                    b.torque,
                    a.torque,
                    b.tracking,
                    a.tracking,
                    b.tracking / a.tracking
                ),
                (b, a) => print!("{name}: {b:?} {a:?}; "),
            }
        }
        println!(" {fitted:?} {:?}", start.elapsed());
    }
}
