//! Compensation in the loop on a random joint that is not our model: excited without compensation, recorded and fitted
//! as a user would, then moved with and without the image that came out.

use crate::commission::{Commissioned, commission};
use crate::driving::{self, COMMAND_STEPS, follow};
use crate::variant::{DEFAULT, Variant};
use friction_compensation::compensation::{Reason, Request};
use friction_compensation::friction::FrictionModel;
use identification::metrics::relative_floor;
use joint_firmware::joint::state_machine::{Controlword, State};
use joint_firmware::joint::{Demand, Telemetry};
use plant::VirtualJoint;
use plant::actuator::{ActuatorParameters, ActuatorState};
use plant::excitation::{Trajectory, slow_reversals};
use plant::friction::REFERENCE_TEMPERATURE;
use plant::friction_factors::FrictionFactors;
use plant::virtual_joint::{Setup, VirtualJointError};
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;

/// Errors along one trajectory.
#[derive(Clone, Copy, Debug)]
pub struct Errors {
    /// Mean of |friction - compensation| / |motor torque|, %, where the motor torque is at least a tenth of its RMS
    /// (001 eq. 11).
    pub torque: f64,
    /// RMS of the position error, rad, where the encoder is.
    pub tracking: f64,
    /// Shares of the steps in which a layer held compensation back.
    pub shares: Shares,
}

/// Shares of the control steps, %.
#[derive(Clone, Copy, Debug, Default)]
pub struct Shares {
    /// Clamp or slew limit changed the torque.
    pub limited: f64,
    /// A signal lay outside the trained box.
    pub outside: f64,
    /// The fade at standstill or the guard took something away.
    pub withheld: f64,
}

impl Shares {
    fn count(&mut self, telemetry: &Telemetry) {
        let compensated = &telemetry.compensated;
        let outside =
            matches!(compensated.output.reason, Reason::OutsideTrainedBox(_) | Reason::FarOutsideTrainedBox(_));
        self.limited += f64::from(u8::from(compensated.output.limited));
        self.outside += f64::from(u8::from(outside));
        self.withheld += f64::from(u8::from(compensated.permitted < 1.0));
    }

    fn of(self, steps: usize) -> Self {
        let percent = |count: f64| 100.0 * count / steps as f64;
        Self { limited: percent(self.limited), outside: percent(self.outside), withheld: percent(self.withheld) }
    }
}

/// A random joint, commissioned.
pub struct RandomJoint {
    /// Seed.
    pub seed: u64,
    /// The actuator.
    pub parameters: ActuatorParameters,
    /// Its configuration, compensation off.
    pub off: Setup,
    /// Findings of its owner.
    pub found: Commissioned,
    moves: Trajectory,
    reversals: Trajectory,
}

/// Torque that arrives for each that the configuration believes in.
pub fn delivered(parameters: &ActuatorParameters, setup: &Setup, state: &ActuatorState) -> f64 {
    let fall = parameters.windings.flux_fall * (state.joint.heat.housing - REFERENCE_TEMPERATURE);
    parameters.joint.motor.torque_constant * (1.0 - fall) / f64::from(setup.configuration.motor.torque_constant)
}

/// Friction that is left in torque mode, % of its RMS while the joint moves.
#[derive(Clone, Copy, Debug)]
pub struct InTorqueMode {
    /// The command holds gravity, a hand leads the joint.
    pub guided: f64,
    /// The same with the uncertainty that the fit states.
    pub guided_known: f64,
    /// A controller holds gravity and moves the joint, 1,000 times a second, and tells which is which.
    pub moved: f64,
    /// The same without telling.
    pub moved_untold: f64,
}

/// Time for which a joint in service moves at least before it is judged, s.
const SERVICE: f64 = 20.0;
/// Time for which a hand touches it then, s.
const TOUCH: f64 = 8.0;
/// Warmth of a joint above its ambient at the beginning, K.
const WARMTH: f64 = 10.0;
/// The same of one whose board is reset, K.
const RESTARTED: f64 = 25.0;
/// Bandwidth of a hand, and at most of a controller around torque mode, rad/s.
const LEADING: f64 = 25.0;
/// Time for which the joint is led, s; the first tenth is not counted.
const LED: f64 = 10.0;

/// A joint's errors with one kind of compensation.
#[derive(Clone, Copy, Debug)]
pub struct Moved {
    /// Over moves.
    pub moves: Errors,
    /// Over slow reversals.
    pub reversals: Errors,
}

impl RandomJoint {
    /// Draws, excites, records and fits joint number `seed`.
    ///
    /// # Errors
    /// Refusals of plant, firmware or fit, and a fault on the way.
    pub fn commissioned(seed: u64) -> Result<Self, String> {
        let parameters = ActuatorParameters::randomised(seed).aligned();
        Self::of(seed, parameters, Setup::of(&parameters))
    }

    /// The same with the [judging](ActuatorParameters::judging) joint of this number, configured by its data sheet.
    ///
    /// # Errors
    /// Refusals of plant, firmware or fit, and a fault on the way.
    pub fn judging(seed: u64) -> Result<Self, String> {
        let parameters = ActuatorParameters::judging(seed).aligned();
        Self::of(seed, parameters, Setup::by_data_sheet(&parameters, seed))
    }

    fn of(seed: u64, parameters: ActuatorParameters, off: Setup) -> Result<Self, String> {
        let found = commission(&parameters, &off, seed)?;
        let limits = &parameters.joint.limits;
        let acceleration = parameters.joint.usable_acceleration().min(20.0);
        let moves = driving::moves(&parameters, 0.0)?;
        let reversals = Trajectory::new(slow_reversals(0.01 * limits.speed, 1.0, acceleration, 6));
        let reversals = reversals.map_err(|error| error.to_string())?;
        Ok(Self { seed, parameters, off, found, moves, reversals })
    }

    /// Moves without compensation.
    ///
    /// # Errors
    /// A fault on the way.
    pub fn without(&self) -> Result<Moved, String> {
        self.run(&self.off, &DEFAULT, None)
    }

    /// Moves with it.
    ///
    /// # Errors
    /// A fault on the way.
    pub fn with(&self, variant: &Variant) -> Result<Moved, String> {
        let on = self.off.compensating(Request::PhysicalAndNetwork);
        self.run(&on, variant, Some(&self.found.model))
    }

    /// Torque errors of moves that begin with the whole joint at this temperature, °C, in a room at the ambient one;
    /// without compensation and with it, %.
    ///
    /// # Errors
    /// A fault on the way.
    pub fn begun_at(&self, variant: &Variant, temperature: f64) -> Result<[f64; 2], String> {
        self.without_and_with(variant, &self.moves, temperature - self.parameters.joint.thermal.ambient)
    }

    /// Torque errors of moves of a joint that is 25 K warmer than the ambient while its board, reset, believes it to be
    /// at the ambient temperature; without compensation and with it, %.
    ///
    /// # Errors
    /// A fault on the way.
    pub fn restarted_warm(&self, variant: &Variant) -> Result<[f64; 2], String> {
        let on = self.off.compensating(Request::PhysicalAndNetwork);
        let torque = |setup, model: Option<&FrictionModel>| {
            let joint = variant.enabled(&self.parameters, setup, model.cloned(), RESTARTED, 99);
            let joint = joint.map_err(|error| format!("joint {}, restarted: {error}", self.seed))?;
            let mut joint = joint.believing(self.parameters.joint.thermal.ambient);
            Ok::<_, String>(self.followed(&mut joint, variant, &self.moves)?.torque)
        };
        Ok([torque(&self.off, None)?, torque(&on, Some(&self.found.model))?])
    }

    /// Torque errors along a motion of its own, without compensation and with it, %.
    ///
    /// # Errors
    /// A fault on the way.
    pub fn along(&self, trajectory: &Trajectory) -> Result<[f64; 2], String> {
        self.without_and_with(&DEFAULT, trajectory, WARMTH)
    }

    fn without_and_with(&self, variant: &Variant, trajectory: &Trajectory, warmth: f64) -> Result<[f64; 2], String> {
        let on = self.off.compensating(Request::PhysicalAndNetwork);
        let torque = |setup, model| Ok::<_, String>(self.errors(setup, variant, model, trajectory, warmth)?.torque);
        Ok([torque(&self.off, None)?, torque(&on, Some(&self.found.model))?])
    }

    /// Errors of moves with friction that is no more what the image was made for, after 20 s of such moves.
    ///
    /// # Errors
    /// A fault on the way.
    pub fn in_service(&self, variant: &Variant, factors: &FrictionFactors) -> Result<Moved, String> {
        let failed = |error: String| format!("joint {}, {}, in service: {error}", self.seed, variant.name);
        let mut parameters = self.parameters;
        let friction = parameters.joint.friction.scaled(factors);
        parameters.joint.friction = friction.map_err(|error| failed(error.to_string()))?;
        let on = self.off.compensating(Request::PhysicalAndNetwork);
        let joint = variant.enabled(&parameters, &on, Some(self.found.model.clone()), WARMTH, 99);
        let mut joint = joint.map_err(|error| failed(error.to_string()))?;
        let service = driving::moves(&parameters, SERVICE)?;
        follow(&mut joint, &service, |_, _, _| ()).map_err(|state| failed(format!("ended in {state:?}")))?;
        let mut errors = |trajectory| self.followed(&mut joint, variant, trajectory);
        Ok(Moved { moves: errors(&self.moves)?, reversals: errors(&self.reversals)? })
    }

    /// Change by a hand of what adaptation adds, root of the mean square as a part of Coulomb friction, %: after 20 s
    /// the joint moves on, and for 8 s a torque as large as Coulomb friction acts on the link, forward, or against the
    /// motion.
    ///
    /// # Errors
    /// A fault on the way.
    pub fn touched(&self, variant: &Variant, against: bool) -> Result<f64, String> {
        let failed = |error: String| format!("joint {}, {}, touched: {error}", self.seed, variant.name);
        let on = self.off.compensating(Request::PhysicalAndNetwork);
        let joint = variant.enabled(&self.parameters, &on, Some(self.found.model.clone()), WARMTH, 99);
        let mut joint = joint.map_err(|error| failed(error.to_string()))?;
        let service = driving::moves(&self.parameters, SERVICE)?;
        follow(&mut joint, &service, |_, _, _| ()).map_err(|state| failed(format!("ended in {state:?}")))?;
        let frozen = joint.adaptation().factors;
        let coulomb = self.parameters.joint.friction.coulomb.forward;
        let slow = 0.02 * self.parameters.joint.limits.speed;
        let steps = (service.duration() / joint.period()) as u64;
        let (mut squares, mut count) = (0.0f64, 0.0);
        for n in 0..steps {
            let velocity = joint.actuator().state().joint.velocity;
            let hand = if against { -(velocity / slow).clamp(-1.0, 1.0) } else { 1.0 };
            let holds = (steps / 4..steps / 4 + (TOUCH / joint.period()) as u64).contains(&n);
            let demand = driving::demand(&joint, &service, n);
            let telemetry = joint.step(&demand, if holds { coulomb * hand } else { 0.0 });
            if telemetry.state != State::OperationEnabled {
                return Err(failed(format!("ended in {:?}", telemetry.state)));
            }
            let now = joint.adaptation().factors;
            let image = f64::from(telemetry.compensated.output.torque.to_bits()) / 65_536.0;
            let viscous = f64::from(now.viscous - frozen.viscous) * f64::from(telemetry.motion.velocity);
            squares += (f64::from(now.factor - frozen.factor) * image + viscous).powi(2);
            count += 1.0;
        }
        Ok(100.0 * (squares / count).sqrt() / coulomb)
    }

    /// Moves in torque mode, to and fro over half of the travel at up to half of the speed limit.
    ///
    /// # Errors
    /// A fault on the way.
    pub fn in_torque_mode(&self, variant: &Variant) -> Result<InTorqueMode, String> {
        let default = self.off.configuration.compensation.uncertainty;
        let left = |by_hand, told| self.led(variant, by_hand, told, default);
        Ok(InTorqueMode {
            guided: left(true, true)?,
            guided_known: self.led(variant, true, true, self.found.uncertainty.unwrap_or(default))?,
            moved: left(false, true)?,
            moved_untold: left(false, false)?,
        })
    }

    /// Friction that is left, % of its RMS, while a hand or the command leads the joint; the command tells its push or
    /// not.
    fn led(&self, variant: &Variant, by_hand: bool, told: bool, uncertainty: f32) -> Result<f64, String> {
        let failed = |error: String| format!("joint {}, {}, torque mode: {error}", self.seed, variant.name);
        let mut setup = self.off.compensating(Request::PhysicalAndNetwork);
        setup.configuration.compensation.uncertainty = uncertainty;
        let joint = variant.enabled(&self.parameters, &setup, Some(self.found.model.clone()), WARMTH, 99);
        let mut joint = joint.map_err(|error| failed(error.to_string()))?;
        let (plant, limits) = (&self.parameters.joint, &self.parameters.joint.limits);
        let amplitude = 0.25 * limits.travel;
        let fastest = (0.3 * plant.usable_acceleration().min(20.0) / amplitude).sqrt();
        let omega = fastest.min(0.5 * limits.speed / amplitude);
        // A command is no stiffer than what the joint was tuned to.
        let tuned = 0.5 * f64::from(setup.configuration.gains.damping) / plant.inertia();
        let bandwidth = if by_hand { LEADING } else { LEADING.min(tuned) };
        let mut demand = Demand { controlword: Controlword::ENABLE_OPERATION, ..Demand::default() };
        let (mut hand, mut left, mut all) = (0.0, 0.0, 0.0);
        for n in 0..(LED / joint.period()) as u64 {
            let time = n as f64 * joint.period();
            if n % COMMAND_STEPS == 0 {
                // A hand is on the link; a command knows what the encoder shows.
                let now = joint.actuator().state().joint;
                let (at, moving) =
                    if by_hand { (now.link_position, now.link_velocity) } else { (now.position, now.velocity) };
                let (sin, cos) = (omega * time).sin_cos();
                let position = amplitude * (1.0 - cos) - at;
                let velocity = amplitude * omega * sin - moving;
                let acceleration = amplitude * omega * omega * cos;
                let leading = plant.inertia() * (acceleration + bandwidth * (bandwidth * position + 2.0 * velocity));
                let gravity = plant.load.gravity_torque(now.position);
                let by_command = if by_hand { 0.0 } else { leading };
                hand = leading - by_command;
                demand.command.torque = (gravity + by_command) as f32;
                demand.command.push = if told { by_command as f32 } else { 0.0 };
                demand.sequence += 1;
            }
            let telemetry = joint.step(&demand, hand);
            if telemetry.state != State::OperationEnabled {
                return Err(failed(format!("ended in {:?}: {:?}", telemetry.state, telemetry.faults)));
            }
            let now = joint.actuator().state().joint;
            if time > 0.1 * LED && now.velocity.abs() > 0.02 * limits.speed {
                let added = f64::from(telemetry.compensated.torque)
                    * delivered(&self.parameters, &self.off, joint.actuator().state());
                left += (now.friction_torque - added).powi(2);
                all += now.friction_torque.powi(2);
            }
        }
        Ok(100.0 * (left / all).sqrt())
    }

    fn run(&self, setup: &Setup, variant: &Variant, model: Option<&FrictionModel>) -> Result<Moved, String> {
        let errors = |trajectory| self.errors(setup, variant, model, trajectory, WARMTH);
        Ok(Moved { moves: errors(&self.moves)?, reversals: errors(&self.reversals)? })
    }

    /// Follows the trajectory, at first `warmth` (K) above the ambient temperature.
    fn errors(
        &self,
        setup: &Setup,
        variant: &Variant,
        model: Option<&FrictionModel>,
        trajectory: &Trajectory,
        warmth: f64,
    ) -> Result<Errors, String> {
        let failed = |error: VirtualJointError| format!("joint {}, {}: {error}", self.seed, variant.name);
        let joint = variant.enabled(&self.parameters, setup, model.cloned(), warmth, 99);
        self.followed(&mut joint.map_err(failed)?, variant, trajectory)
    }

    /// Errors of a joint that follows the trajectory.
    fn followed(&self, joint: &mut VirtualJoint, variant: &Variant, trajectory: &Trajectory) -> Result<Errors, String> {
        let failed = |error: String| format!("joint {}, {}: {error}", self.seed, variant.name);
        let mut torques: Vec<(f64, f64)> = Vec::new();
        let (mut squares, mut shares) = (0.0, Shares::default());
        let outcome = follow(joint, trajectory, |time, telemetry, state| {
            let added = f64::from(telemetry.compensated.torque) * delivered(&self.parameters, &self.off, state);
            torques.push((state.joint.motor_torque, state.joint.friction_torque - added));
            squares += (trajectory.at(time).position - state.joint.position).powi(2);
            shares.count(telemetry);
        });
        outcome.map_err(|state| {
            failed(format!("ended in {state:?}: {:?}", joint.joint().latched_faults().iter().collect::<Vec<_>>()))
        })?;
        let motor: Vec<f64> = torques.iter().map(|(motor, _)| *motor).collect();
        let floor = relative_floor(&motor, 0.1);
        let counted: Vec<f64> = torques
            .iter()
            .filter(|(motor, _)| motor.abs() >= floor)
            .map(|(motor, left)| (left / motor).abs())
            .collect();
        Ok(Errors {
            torque: 100.0 * counted.iter().sum::<f64>() / counted.len() as f64,
            tracking: (squares / torques.len() as f64).sqrt(),
            shares: shares.of(torques.len()),
        })
    }
}

/// The median; mean of the middle two of an even number.
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let n = values.len();
    0.5 * (values[(n - 1) / 2] + values[n / 2])
}

/// `work` for every seed on all cores, in the order of the seeds.
pub fn for_seeds<T: Send>(seeds: std::ops::Range<u64>, work: impl Fn(u64) -> T + Sync) -> Vec<T> {
    let threads = thread::available_parallelism().map_or(1, usize::from);
    let next = AtomicU64::new(seeds.start);
    let worker = || {
        let mut done = Vec::new();
        loop {
            let seed = next.fetch_add(1, Ordering::Relaxed);
            if seed >= seeds.end {
                return done;
            }
            done.push((seed, work(seed)));
        }
    };
    let mut all: Vec<(u64, T)> = thread::scope(|scope| {
        let workers: Vec<_> = (0..threads).map(|_| scope.spawn(worker)).collect();
        workers.into_iter().flat_map(|worker| worker.join().unwrap_or_default()).collect()
    });
    all.sort_by_key(|(seed, _)| *seed);
    assert_eq!(all.len() as u64, seeds.end - seeds.start, "a worker panicked");
    all.into_iter().map(|(_, result)| result).collect()
}
