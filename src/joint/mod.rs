//! One joint: measurements and demands in, bridge and duty cycles out.
//!
//! [`Joint::control_step`] runs once a PWM period in the board's highest-priority interrupt and, unchanged, on the host
//! against a virtual joint. Everything it needs comes in: it reads no clock, no register and no global. In the order of
//! a step:
//!
//!  - `signals`: what the board measures and what it is told;
//!  - `offsets`: the current sensors' offsets, from the first steps;
//!  - [`monitor`]: faults, and [`fault`]: what they lead to;
//!  - [`state_machine`]: whether the joint may move;
//!  - [`motion_loop`], slower than the rest, a stage a step: [`command`] and [`motion_law`], from a set-point to a
//!    torque, [`limit_law`], how much of it the limits permit, and [`friction_feedforward`], what friction will take of
//!    it;
//!  - [`stopping`]: how the joint stops, and its holding brake;
//!  - `regeneration`: how much of a braking current the supply bears, and [`chopper`]: what a resistor takes of it;
//!  - [`history`]: the last steps before a fault; `telemetry`: what tasks are told of a step.
//!
//! In place of the motion loop and the current loop, for commissioning: [`open_loop`](crate::motor::open_loop).
//!
//! Beside it, outside the interrupt: [`adaptation`] how friction has changed, [`load_feedforward`] the torque of the
//! configured load, [`external_torque`] what acts on the link from outside, [`configuration`] what the joint is,
//! [`board_limits`] what it may be on its board, [`active`] the same prepared for the step.

pub mod active;
pub mod adaptation;
pub mod board_limits;
pub mod chopper;
pub mod command;
pub mod configuration;
pub mod external_torque;
pub mod fault;
pub mod friction_feedforward;
pub mod history;
pub mod limit_gains;
pub mod limit_law;
pub mod limits;
pub mod load;
pub mod load_feedforward;
mod mean_torque;
pub mod monitor;
pub mod motion_law;
pub mod motion_loop;
mod offsets;
mod regeneration;
#[cfg(test)]
mod rig;
pub mod shadow;
mod signals;
pub mod state_machine;
pub mod stop_options;
pub mod stopping;
mod telemetry;

pub use active::{Active, JointMotion};
pub use board_limits::BoardLimits;
pub use command::{Command, CommandLimits, Coupled, Demand, Mode, PROFILES};
pub use offsets::OFFSET_STEPS;
pub use signals::{Bridge, BridgeState, Measurements, Outputs};
pub use telemetry::Telemetry;

use crate::motor::field_oriented::{FieldOriented, FieldOrientedInput};
use crate::motor::number::{greater, lesser, limited, or_zero, within};
use crate::motor::observer::Observer;
use crate::motor::open_loop::{OpenLoop, OpenLoopInput, OpenLoopOutput, Window};
use crate::motor::phases::Phases;
use crate::motor::thermal::MeanSquareCurrent;
use crate::motor::transform::Dq;
use active::DERATING;
use adaptation::{ADAPTS, Factors};
use chopper::{CHOPS, Chopper};
use fault::{Fault, Faults, Reaction};
use friction_feedforward::Surroundings;
use history::{History, Snapshot};
use mean_torque::MeanTorque;
use monitor::Monitor;
use motion_loop::{MotionLoop, Seen, Stage};
use offsets::Offsets;
use regeneration::Regeneration;
use state_machine::{Controlword, Events, State, StateMachine};
use stop_options::QUICK_STOP;
use stopping::Stopping;

/// Speed below which a braking joint counts as standing, as a part of the velocity limit.
pub(crate) const STANDING: f32 = 0.01;

/// Values that the slow task knows and the control step uses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slow {
    /// Part of current and torque limit that the winding's temperature permits, 0 to 1. That of the bridge is the
    /// control step's own.
    pub derating: f32,
    /// Temperature of the gear, °C: for friction.
    pub gear_temperature: f32,
    /// Corrections in service to the friction of the image.
    pub factors: Factors,
}

impl Default for Slow {
    fn default() -> Self {
        Self { derating: 1.0, gear_temperature: 25.0, factors: Factors::IMAGE }
    }
}

/// A joint, from one control step to the next. In this order, the history and what follows it last, for the same reason
/// as [`Active`].
#[derive(Clone, Debug, Default)]
#[repr(C)]
pub struct Joint {
    offsets: Offsets,
    observer: Observer,
    monitor: Monitor,
    machine: StateMachine,
    motion_loop: MotionLoop,
    regeneration: Regeneration,
    field_oriented: FieldOriented,
    /// The last valid reading of the encoder.
    encoder: u32,
    /// The encoder's zero is known.
    referenced: bool,
    open_loop: OpenLoop,
    sequence: u32,
    stale_steps: u32,
    coupled_sequence: u32,
    /// Steps since the coupled joint was heard.
    coupled_steps: u32,
    /// Faults since the last acknowledgement.
    latched: Faults,
    mean_square: MeanSquareCurrent,
    found: Found,
    history: History,
    stopping: Stopping,
    chopper: Chopper,
    mean_torque: MeanTorque,
}

/// Findings and actions of the last step, besides what other parts remember.
#[derive(Clone, Copy, Debug, Default)]
struct Found {
    faults: Faults,
    motion: JointMotion,
    measured_torque: f32,
    gear_temperature: f32,
    reference: Dq,
    current: Dq,
    bus_voltage: f32,
    outputs: Outputs,
}

impl Joint {
    /// A joint that starts: nothing moves before the offsets are known and somebody enables it.
    pub fn new() -> Self {
        Self::default()
    }

    /// One control step. Whatever the measurements are, not numbers included, the duties lie within the modulation's
    /// limits, and a fault of the kind [`Reaction::SwitchOff`] has the bridge off in the same step.
    #[inline]
    pub fn control_step(&mut self, active: &Active, demand: &Demand, slow: &Slow, measured: &Measurements) -> Bridge {
        self.step::<true>(active, demand, slow, measured)
    }

    /// The same step built without compensation: what [`Joint::control_step`] is compared with.
    #[doc(hidden)]
    pub fn control_step_without_compensation(
        &mut self,
        active: &Active,
        demand: &Demand,
        slow: &Slow,
        measured: &Measurements,
    ) -> Bridge {
        self.step::<false>(active, demand, slow, measured)
    }

    #[inline(always)]
    fn step<const COMPENSATION: bool>(
        &mut self,
        active: &Active,
        demand: &Demand,
        slow: &Slow,
        measured: &Measurements,
    ) -> Bridge {
        let currents = self.without_offsets(active, measured.phase_currents);
        let before = self.encoder;
        let sample = self.encoder_sample(active, measured);
        let way = self.encoder.wrapping_sub(before) as i32 as f32;
        let observation = self.observer.step(&active.observer, sample, 0.0);
        let motion = active.scales.joint(&observation.motion);

        let winding = within(slow.derating, 0.0, 1.0);
        let faults = self.watch(active, demand, winding, measured, currents, &observation, &motion);
        let open_loop = demand.command.mode == Mode::OpenLoop;
        let something = !faults.is_empty() | self.stopping.is_under_way();
        let (state, faults) = match self.machine.stays_enabled(demand.controlword, something, open_loop) {
            true => (State::OperationEnabled, Faults::NONE),
            false => self.decide(active, demand, faults, &motion),
        };
        if CHOPS {
            self.chopper.step(&active.chopper, measured.bus_voltage);
        }

        // No sensor is no number, and derates nothing.
        let bridge = (active.limits.bridge_temperature - measured.bridge_temperature) * (1.0 / DERATING);
        let derating = greater(lesser(bridge, winding), 0.0);
        let mut measured_torque = or_zero(self.found.current.q * active.scales.torque_per_current);
        let coupled_velocity = self.coupled(active, demand);
        let surroundings = Surroundings { temperature: slow.gear_temperature, coupled_velocity };
        let seen = Seen { motion: &motion, derating, measured_torque, surroundings, factors: &slow.factors };
        let torque = self.motion_loop.step::<COMPENSATION>(active, state, demand, &seen);

        let mut brake_open = false;
        let (bridge, reference, current) = if state.makes_torque() {
            // Hot parts bear the current of braking for as long as braking may take; a joint that coasts into somebody
            // is worse.
            let limit = match state {
                State::OperationEnabled => active.current_limit * derating,
                _ if self.stopping.bears() => active.current_limit * derating,
                _ => active.current_limit,
            };
            let wanted = limited(torque * active.scales.current_per_torque, limit);
            let speed = active.alignment.electrical_speed(observation.motion.velocity);
            let bus_voltage = measured.bus_voltage;
            let wanted = self.regeneration.step(active, wanted, speed, bus_voltage, derating);
            let gains = &active.field_oriented;
            let reference = self.field_oriented.reference(gains, wanted, speed, bus_voltage, limit);
            let input = FieldOrientedInput {
                phase_currents: currents,
                angle: active.alignment.electrical(observation.motion.angle()),
                speed,
                bus_voltage,
                reference,
            };
            let output = self.field_oriented.step(gains, &input);
            self.monitor.current_loop(reference, &output, way);
            self.mean_square.add(output.current);
            brake_open = !self.stopping.closes_brake();
            (Bridge { state: BridgeState::Switching, duties: output.duties }, reference, output.current)
        } else {
            match state {
                State::OpenLoop => {
                    let output = self.apply_open_loop(active, demand, derating, measured, currents);
                    self.mean_square.add(output.current);
                    measured_torque = output.torque;
                    (Bridge { state: BridgeState::Switching, duties: output.duties }, Dq::ZERO, output.current)
                }
                _ => {
                    self.mean_square.add(Dq::ZERO);
                    (Bridge::OFF, Dq::ZERO, Dq::ZERO)
                }
            }
        };

        if ADAPTS {
            self.mean_torque.add(active, measured_torque);
        }
        self.found = Found {
            faults,
            motion,
            measured_torque,
            gear_temperature: slow.gear_temperature,
            reference,
            current,
            bus_voltage: measured.bus_voltage,
            outputs: Outputs::new(brake_open, CHOPS && self.chopper.conducts()),
        };
        self.note(state);
        bridge
    }

    /// Findings and actions of the last step.
    pub fn telemetry(&self) -> Telemetry {
        let mut telemetry = Telemetry::NOTHING;
        self.report(&mut telemetry);
        telemetry
    }

    /// The same in its place: field by field, because all at once is made elsewhere and copied.
    #[inline(always)]
    pub fn report(&self, telemetry: &mut Telemetry) {
        let found = &self.found;
        telemetry.state = self.machine.state();
        telemetry.faults = found.faults;
        telemetry.motion = found.motion;
        telemetry.wanted = *self.motion_loop.wanted();
        if PROFILES {
            telemetry.position_demand = self.motion_loop.position();
        }
        telemetry.compensated = *self.motion_loop.compensated();
        telemetry.measured_torque = found.measured_torque;
        if ADAPTS {
            telemetry.mean_torque = self.mean_torque.mean();
        }
        telemetry.gear_temperature = found.gear_temperature;
        telemetry.reference = found.reference;
        telemetry.current = found.current;
        telemetry.bus_voltage = found.bus_voltage;
        telemetry.held = self.motion_loop.is_held();
        telemetry.outputs = found.outputs;
    }

    /// A period without a control step, because the board is not ready: its outputs are off.
    #[inline(always)]
    pub fn skip_step(&mut self) {
        self.found.outputs = Outputs::OFF;
    }

    /// States that the board's outputs are to take.
    #[inline(always)]
    pub fn outputs(&self) -> Outputs {
        self.found.outputs
    }

    /// The last step is one that tasks are told of: behind the network's stage, where the longest control interrupt
    /// bears it, and whenever the bridge is off. Nobody asks more often than once a round.
    #[inline(always)]
    pub fn is_to_be_told(&self) -> bool {
        self.motion_loop.due() == Stage::PhysicalModel || !self.machine.state().makes_torque()
    }

    /// Faults since the last acknowledgement.
    pub fn latched_faults(&self) -> Faults {
        self.latched
    }

    /// The last complete window of the open loop.
    pub fn window(&self) -> &Window {
        self.open_loop.window()
    }

    /// Returns `true` if the last step completed it.
    #[inline(always)]
    pub fn has_new_window(&self) -> bool {
        self.machine.state() == State::OpenLoop && self.open_loop.is_complete()
    }

    /// Returns `true` while a fault reset waits until the gate driver's fault has been cleared: the board is asked to
    /// clear it.
    #[inline(always)]
    pub fn waits_for_driver(&self) -> bool {
        self.machine.waits_for_driver()
    }

    /// The steps before the last fault.
    pub fn history(&self) -> &History {
        &self.history
    }

    /// Mean square of the current since the last call, A²: for the slow task's thermal model.
    pub fn take_mean_square_current(&mut self) -> f32 {
        self.mean_square.take()
    }

    /// A commanded voltage in place of the current loop. A function of its own, which may lie where code waits for the
    /// flash: on a board that has only one bank, nothing is written there while the bridge switches.
    #[inline(never)]
    fn apply_open_loop(
        &mut self,
        active: &Active,
        demand: &Demand,
        derating: f32,
        measured: &Measurements,
        phase_currents: Phases,
    ) -> OpenLoopOutput {
        let input = OpenLoopInput {
            phase_currents,
            current_limit: active.current_limit * derating,
            torque_per_current: active.scales.torque_per_current,
            bus_voltage: measured.bus_voltage,
            encoder: self.encoder,
            referenced: self.referenced,
        };
        let frame = &demand.command.open_loop;
        self.open_loop.step(&active.open_loop, &active.field_oriented.modulator, frame, &input)
    }

    #[inline(always)]
    fn without_offsets(&mut self, active: &Active, measured: Phases) -> Phases {
        if !self.machine.state().makes_torque() {
            self.rest(active, measured);
        }
        self.offsets.taken_from(measured)
    }

    /// Encoder sample for the observer. A few missing samples it bridges with its prediction; a lost encoder counts as
    /// standing where it was last seen, because a prediction that nothing corrects runs away.
    #[inline(always)]
    fn encoder_sample(&mut self, active: &Active, measured: &Measurements) -> Option<u32> {
        if measured.encoder_valid {
            self.encoder = measured.encoder;
        }
        if measured.encoder_referenced && !self.referenced {
            // The angle has another zero from here on; the joint has been off so far.
            self.referenced = true;
            self.observer.reset();
        }
        let lost = self.monitor.encoder_is_lost(measured.encoder_valid, active.bridged_steps);
        (measured.encoder_valid || lost).then_some(self.encoder)
    }

    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "everything that a step knows is watched")]
    fn watch(
        &mut self,
        active: &Active,
        demand: &Demand,
        winding: f32,
        measured: &Measurements,
        currents: Phases,
        observation: &crate::motor::observer::Observation,
        motion: &JointMotion,
    ) -> Faults {
        let state = self.machine.state();
        self.count_stale_steps(demand, state);
        if !self.offsets.are_known() {
            let mut faults = Faults::NONE;
            faults.set(Fault::CurrentSensor, self.offsets.are_refused());
            return faults;
        }
        let mut faults = self.monitor.measurements(active, measured, currents, observation);
        // The motion by an encoder that is lost or jumps counts for nothing.
        if !faults.contains(Fault::EncoderLost) && !faults.contains(Fault::EncoderJump) {
            let open_loop = demand.command.mode == Mode::OpenLoop;
            let moving = self.monitor.motion(active, motion, self.stale_steps, winding);
            faults = faults.union(match state {
                State::OpenLoop => self.open_loop_faults(active, moving),
                State::SwitchedOn if open_loop => Faults::NONE,
                State::OperationEnabled | State::QuickStopActive | State::FaultReactionActive => moving,
                // Refused before it gives torque.
                State::SwitchedOn if demand.controlword.enables_operation() => moving,
                // By hand the joint may be moved anywhere; but what caused a fault must be gone before its reset.
                State::Fault => moving.intersection(self.latched),
                _ => Faults::NONE,
            });
        }
        if self.motion_loop.due() == Stage::Regime {
            self.monitor.check_current_loop(active);
        }
        faults.union(self.monitor.found())
    }

    /// Faults of motion that count in the open loop, in which a shorter deadline holds.
    #[inline(never)]
    fn open_loop_faults(&self, active: &Active, moving: Faults) -> Faults {
        let mut faults = moving.intersection(Faults::OPEN_LOOP);
        faults.set(Fault::StaleCommand, self.stale_steps > active.open_loop.deadline_steps);
        faults
    }

    /// Counts the steps without a new set-point from "ready to switch on" on, but for a joint that holds, moves to an
    /// end or is to stop: nothing that could be late is asked of it. In "fault" a count that has led there stays until
    /// one comes.
    #[inline(always)]
    fn count_stale_steps(&mut self, demand: &Demand, state: State) {
        self.stale_steps = match state {
            _ if demand.sequence != self.sequence => 0,
            State::NotReadyToSwitchOn | State::SwitchOnDisabled => 0,
            State::Fault => self.stale_steps,
            _ if matches!(demand.command.mode, Mode::Hold | Mode::Profile) => 0,
            State::OperationEnabled if demand.controlword.ends_operation() => 0,
            State::QuickStopActive => 0,
            _ => self.stale_steps.saturating_add(1),
        };
        self.sequence = demand.sequence;
    }

    /// Velocity of the coupled joint, rad/s; zero once it has been silent for longer than the command deadline.
    #[inline(always)]
    fn coupled(&mut self, active: &Active, demand: &Demand) -> f32 {
        let heard = demand.coupled.sequence != self.coupled_sequence;
        self.coupled_sequence = demand.coupled.sequence;
        self.coupled_steps = if heard { 0 } else { self.coupled_steps.saturating_add(1) };
        if self.coupled_steps <= active.deadline_steps { demand.coupled.velocity } else { 0.0 }
    }

    /// The state from now on, where it may be another one, and the faults that count. A fault that must not be braked
    /// against goes straight through the reaction to "fault".
    #[inline(never)]
    fn decide(
        &mut self,
        active: &Active,
        demand: &Demand,
        mut faults: Faults,
        motion: &JointMotion,
    ) -> (State, Faults) {
        let before = self.machine.state();
        let stops = &active.stops.options;
        let open_loop = demand.command.mode == Mode::OpenLoop;
        let late = faults.contains(Fault::StaleCommand) && stops.late_command == QUICK_STOP && !open_loop;
        if late {
            faults = faults.without(Fault::StaleCommand);
        }
        let events = Events {
            // The open loop looks for the encoder's zero.
            started: self.offsets.are_known() && (self.referenced || open_loop),
            open_loop,
            fault: !faults.is_empty(),
            driver_alone: faults.is_only(Fault::BridgeDriver),
            stopped: self.has_stopped(active, demand.controlword, motion),
            late,
            stops,
        };
        let mut state = self.machine.step(demand.controlword, events);
        if state == State::OpenLoop && before != state {
            self.open_loop.begin();
        }
        let brakes = stops.fault_reaction != 0 && faults.union(self.latched).reaction() == Some(Reaction::Brake);
        if state == State::FaultReactionActive && !brakes {
            state = self.machine.end_reaction();
        }
        if !faults.is_empty() {
            self.latched = self.latched.union(faults);
        } else if before == State::Fault && state != State::Fault {
            self.latched = Faults::NONE;
            self.history.release();
        }
        (state, faults)
    }

    /// Returns `true` if braking is over. One that operation is enabled after, in the middle of it, may have closed the
    /// brake.
    #[inline(always)]
    fn has_stopped(&mut self, active: &Active, word: Controlword, motion: &JointMotion) -> bool {
        let closed = self.stopping.closes_brake();
        let over = self.motion_loop.ramp_is_over();
        let stopped = self.stopping.step(active, self.machine.state(), word, motion, over);
        if closed && !self.stopping.closes_brake() {
            self.motion_loop.open_brake(active);
        }
        stopped
    }

    #[inline(always)]
    fn note(&mut self, state: State) {
        let found = &self.found;
        self.history.note(Snapshot {
            state,
            faults: found.faults,
            position: found.motion.position,
            velocity: found.motion.velocity,
            commanded_torque: self.motion_loop.wanted().torque,
            compensation_torque: self.motion_loop.compensated().torque,
            current: found.current,
            bus_voltage: found.bus_voltage,
        });
    }
}

#[cfg(test)]
mod tests;
