//! The motion loop: from a command to the torque that the current loop is to make, a round of it in
//! [`MOTION_STEPS`](super::configuration::MOTION_STEPS) control steps; control step.
//!
//! A position, a velocity and friction change in milliseconds, and a control step has to be short: each does one stage
//! of a round, and torques are held until the next round comes by. A new state of the joint begins a round: a quick
//! stop waits for nothing.

use super::active::{Active, JointMotion};
use super::adaptation::Factors;
use super::command::{Command, Demand, Mode, PROFILES};
use super::friction_feedforward::{Compensated, FrictionFeedforward, Surroundings};
use super::motion_law::{MotionLaw, Wanted};
use super::state_machine::State;

/// The stages of a round, in their order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Stage {
    /// Motion law: from the command to a torque.
    #[default]
    Law,
    /// The regime of friction; and what the current loop did since the round before is checked (see
    /// [`super::monitor`]).
    Regime,
    /// Friction by the network.
    Network,
    /// Friction by the physical model.
    PhysicalModel,
    /// The torque against friction, for the round to come.
    Compensation,
}

/// Command, motion law and friction, from one control step to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MotionLoop {
    state: State,
    stage: Stage,
    law: MotionLaw,
    friction: FrictionFeedforward,
    wanted: Wanted,
    compensated: Compensated,
    /// Rounds for which an enabled joint still holds where it is, because its brake opens.
    release: u32,
    /// `true` while it holds where it is instead of following the command.
    held: bool,
}

/// State of the joint as a round sees it.
pub struct Seen<'a> {
    /// The joint's motion.
    pub motion: &'a JointMotion,
    /// Part of the torque limit that is permitted, 0 to 1.
    pub derating: f32,
    /// Torque of the measured current, Nm.
    pub measured_torque: f32,
    /// Other variables that friction depends on.
    pub surroundings: Surroundings,
    /// Corrections in service to the friction of the image.
    pub factors: &'a Factors,
}

impl MotionLoop {
    /// One control step: the torque that the joint is to make from here on, Nm; zero where the bridge is off.
    #[inline(always)]
    pub fn step<const COMPENSATION: bool>(
        &mut self,
        active: &Active,
        state: State,
        demand: &Demand,
        seen: &Seen,
    ) -> f32 {
        let begins = state != self.state;
        if begins {
            self.begin(active, state);
            if PROFILES {
                self.law.begin_at(seen.motion);
            }
        }
        if !state.makes_torque() {
            return 0.0;
        }
        let enabled = state == State::OperationEnabled;
        // Nobody waits for the first torque of an enabled joint, and the step of a new state has enough to do; a
        // brake's comes at once.
        if !(begins && enabled) {
            self.stage::<COMPENSATION>(active, demand, seen);
        }
        match self.compensated.torque {
            0.0 => self.wanted.torque,
            compensation => self.law.bounds().hold(self.wanted.torque + compensation),
        }
    }

    /// A round begins in a new state: compensation only while operation is enabled, torque only while the bridge
    /// switches.
    #[inline(never)]
    fn begin(&mut self, active: &Active, state: State) {
        if !self.state.makes_torque() {
            self.open_brake(active);
        }
        (self.state, self.stage, self.held) = (state, Stage::default(), self.release > 0);
        self.friction.reset();
        self.compensated = Compensated::NOTHING;
        if !state.makes_torque() {
            self.law.reset();
            self.wanted = Wanted::default();
        }
    }

    /// The brake opens from here on: the joint holds where it is meanwhile.
    pub fn open_brake(&mut self, active: &Active) {
        self.release = active.stops.release_rounds;
    }

    /// Returns `true` while an enabled joint holds where it is, because its brake opens or because it is to stop.
    #[inline(always)]
    pub fn is_held(&self) -> bool {
        self.held
    }

    /// The round's torque while operation is enabled.
    #[inline(always)]
    fn follow(&mut self, active: &Active, demand: &Demand, seen: &Seen) -> Wanted {
        let mut command = &demand.command;
        let hold;
        self.held = self.release > 0 || demand.controlword.ends_operation();
        if self.held {
            self.release = self.release.saturating_sub(1);
            // The part of the torque that pushes nowhere goes on bearing a load.
            hold = Command { mode: Mode::Hold, torque: command.torque - command.push, ..Command::NOTHING };
            command = &hold;
        }
        self.law.step(active, command, seen.motion, seen.derating)
    }

    /// One stage, and which one is next.
    #[inline(always)]
    fn stage<const COMPENSATION: bool>(&mut self, active: &Active, demand: &Demand, seen: &Seen) {
        let enabled = self.state == State::OperationEnabled;
        let Seen { motion, measured_torque, surroundings, factors, .. } = seen;
        let compensates = COMPENSATION && enabled;
        self.stage = match self.stage {
            Stage::Law => {
                let gains = &active.motion;
                if PROFILES && self.law.counts_anew(active) {
                    self.friction.reset();
                }
                self.wanted = match self.state {
                    State::OperationEnabled => self.follow(active, demand, seen),
                    State::QuickStopActive => self.law.brake(active, motion, gains.quick_stop_step),
                    _ => self.law.brake(active, motion, gains.fault_step),
                };
                Stage::Regime
            }
            Stage::Regime => {
                if compensates {
                    self.friction.begin(active, motion, &self.wanted, *measured_torque, surroundings);
                }
                Stage::Network
            }
            Stage::Network => {
                if compensates {
                    self.friction.network(active, motion, &self.wanted, &self.compensated.output, factors);
                }
                Stage::PhysicalModel
            }
            Stage::PhysicalModel => {
                if compensates {
                    self.friction.physical_model(active);
                }
                Stage::Compensation
            }
            Stage::Compensation => {
                if compensates {
                    self.compensated = self.friction.compensate(active, motion, &self.wanted);
                }
                Stage::Law
            }
        };
    }

    /// The stage that the next control step does, unless it begins a round.
    #[inline(always)]
    pub fn due(&self) -> Stage {
        self.stage
    }

    /// Torque, velocity and push that the command wants.
    #[inline(always)]
    pub fn wanted(&self) -> &Wanted {
        &self.wanted
    }

    /// Position that the command asks for at this instant, rad; in modes without one the joint's own. With [`PROFILES`]
    /// alone.
    #[inline(always)]
    pub fn position(&self) -> f32 {
        self.law.position()
    }

    /// Compensation that is added.
    #[inline(always)]
    pub fn compensated(&self) -> &Compensated {
        &self.compensated
    }

    /// Returns `true` if braking's ramp has come to its end.
    #[inline(always)]
    pub fn ramp_is_over(&self) -> bool {
        self.law.ramp_is_over()
    }
}

#[cfg(test)]
mod tests {
    use super::super::configuration::MOTION_STEPS;
    use super::super::state_machine::Controlword;
    use super::*;

    fn enabling(command: Command) -> Demand {
        Demand { controlword: Controlword::ENABLE_OPERATION, command, ..Demand::default() }
    }

    fn active() -> Active {
        let board = crate::default_configuration::B_G431B_ESC1;
        board.joint.prepare(&board.bridge).unwrap()
    }

    fn step(motion_loop: &mut MotionLoop, active: &Active, state: State, torque: f32) -> f32 {
        let surroundings = Surroundings { temperature: 25.0, coupled_velocity: 0.0 };
        let motion = JointMotion::default();
        let seen =
            Seen { motion: &motion, derating: 1.0, measured_torque: 0.0, surroundings, factors: &Factors::IMAGE };
        motion_loop.step::<false>(active, state, &enabling(Command { torque, ..Command::default() }), &seen)
    }

    #[test]
    fn a_new_state_waits_for_no_round_to_end() {
        let active = active();
        for before in 0..2 * MOTION_STEPS {
            for state in [State::QuickStopActive, State::FaultReactionActive, State::SwitchedOn, State::Fault] {
                let mut motion_loop = MotionLoop::default();
                assert_eq!(step(&mut motion_loop, &active, State::OperationEnabled, 0.02), 0.0);
                (0..=before).for_each(|_| {
                    assert_eq!(step(&mut motion_loop, &active, State::OperationEnabled, 0.02), 0.02);
                });
                assert_eq!(step(&mut motion_loop, &active, state, 0.02), 0.0, "{state:?} after {before} steps");
                assert_eq!(step(&mut motion_loop, &active, State::OperationEnabled, 0.01), 0.0);
                assert_eq!(step(&mut motion_loop, &active, State::OperationEnabled, 0.01), 0.01);
            }
        }
    }

    #[test]
    fn a_joint_whose_bridge_is_off_wants_no_torque_and_forgets_what_its_integral_held() {
        let active = active();
        let surroundings = Surroundings { temperature: 25.0, coupled_velocity: 0.0 };
        let motion = JointMotion { velocity: 0.3, ..JointMotion::default() };
        let seen =
            Seen { motion: &motion, derating: 1.0, measured_torque: 0.0, surroundings, factors: &Factors::IMAGE };
        let command = enabling(Command { mode: Mode::Velocity, velocity: 0.31, ..Command::default() });
        let mut motion_loop = MotionLoop::default();
        let mut step = |state| (motion_loop.step::<false>(&active, state, &command, &seen), *motion_loop.wanted());
        assert_eq!(step(State::OperationEnabled).0, 0.0, "the step in which it is enabled");
        let (first, _) = step(State::OperationEnabled);
        let (last, _) = (1..1000).map(|_| step(State::OperationEnabled)).last().unwrap();
        assert!(last > 1.1 * first && first > 0.0, "the integral adds to the torque: {first} Nm, then {last} Nm");
        for _ in 0..2 * MOTION_STEPS {
            // Turned by hand.
            assert_eq!(step(State::SwitchedOn), (0.0, Wanted::default()));
        }
        assert_eq!(step(State::OperationEnabled).0, 0.0);
        assert_eq!(step(State::OperationEnabled).0, first);
    }

    #[test]
    fn a_set_point_counts_from_the_next_round_on() {
        let active = active();
        let mut motion_loop = MotionLoop::default();
        let mut torque = |wanted| step(&mut motion_loop, &active, State::OperationEnabled, wanted);
        torque(0.02);
        assert_eq!(torque(0.02), 0.02);
        (1..MOTION_STEPS).for_each(|n| assert_eq!(torque(0.01), 0.02, "step {n}"));
        assert_eq!(torque(0.01), 0.01);
    }

    #[test]
    fn compensation_pushes_through_no_limit() {
        let mut active = active();
        active.limits.position = (-10.0, 10.0);
        let limits = active.limits;
        let half = limits.position.1 + 0.5 * limits.position_margin;
        for (position, velocity) in [(half, 0.0), (0.0, limits.velocity)] {
            let motion = JointMotion { position, velocity, acceleration: 0.0 };
            let surroundings = Surroundings { temperature: 25.0, coupled_velocity: 0.0 };
            let seen =
                Seen { motion: &motion, derating: 1.0, measured_torque: 0.0, surroundings, factors: &Factors::IMAGE };
            let mut motion_loop = MotionLoop::default();
            let mut torque = || {
                let command = enabling(Command { torque: limits.torque, ..Command::default() });
                let torque = motion_loop.step::<false>(&active, State::OperationEnabled, &command, &seen);
                motion_loop.compensated.torque = 0.5 * limits.torque;
                torque
            };
            let (without, with) = (torque(), torque());
            assert!(without.abs() < 1e-6 && with.abs() < 1e-6, "{position} rad, {velocity} rad/s: {without} {with}");
        }
    }
}
