//! The same joint on the host beside the one on an emulated board: given what the board's control step was given, it
//! must come to the same bits, step by step.
//!
//! Inputs are read where the control interrupt will read them, before its first instruction: the converters' codes, the
//! words that tasks leave for it, the newest demand. What the step came to is read before the first instruction of the
//! next one. Nothing in the program is there for it: variables are found by the debug information, as a debugger would.
//!
//! As the plant is moved by the compare values alone, and is the same program on both sides, equal duties in every step
//! make an equal closed loop.

use super::observed::{Memory, Observed, Reading};
use emulator::emulation::Emulation;
use emulator::variables::{Variable, VariableError, Variables};
use friction_compensation::compensation::Output;
use joint_firmware::default_configuration::BoardConfiguration;
use joint_firmware::joint::adaptation::Factors;
use joint_firmware::joint::state_machine::Controlword;
use joint_firmware::joint::{
    Active, Bridge, BridgeState, Command, Coupled, Demand, Joint, Measurements, Mode, Slow, Telemetry,
};
use joint_firmware::motor::modulation::compare_value;
use libtest_mimic::Failed;
use std::collections::BTreeMap;

/// Inputs of a step.
struct Given {
    demand: Demand,
    slow: Slow,
    measured: Measurements,
    encoder: Reading,
    stopped: bool,
    /// The board has what the joint cannot start without.
    started: bool,
    mean_square_wanted: bool,
    /// Place of the parameters before the step.
    place: Option<u64>,
}

/// Summary of the steps so far.
#[derive(Clone, Debug, Default)]
pub struct Seen {
    /// Steps that were compared.
    pub steps: u64,
    /// Steps in which the bridge switched.
    pub switching: u64,
    /// Steps with a fault.
    pub faults: u64,
    /// Steps in which the bridge switched, by which model acted and why.
    pub compensation: BTreeMap<String, u64>,
}

/// A joint on the host.
pub struct Twin<'v> {
    variables: Fields<'v>,
    joint: Joint,
    /// Configuration that the board is going to be offered, until it is taken.
    coming: Option<Active>,
    active: Option<Active>,
    /// The encoder's last good angle.
    angle: u32,
    given: Option<Given>,
    seen: Seen,
}

impl<'v> Twin<'v> {
    /// A twin of a joint that has not started; `coming` is what it will be offered.
    ///
    /// # Errors
    /// A variable that the program does not have.
    pub fn new<W: Observed>(variables: &'v Variables, coming: Active) -> Result<Self, Failed> {
        Ok(Self {
            variables: Fields::of::<W>(variables)?,
            joint: Joint::new(),
            coming: Some(coming),
            active: None,
            angle: 0,
            given: None,
            seen: Seen::default(),
        })
    }

    /// Summary of what was compared.
    pub const fn seen(&self) -> &Seen {
        &self.seen
    }

    /// Compares, before the first instruction of a control interrupt, the step before, and reads what this one is
    /// given.
    ///
    /// # Errors
    /// A difference.
    pub fn look<W: Observed>(&mut self, emulation: &mut Emulation<W>) -> Result<(), Failed> {
        let now = emulation.cpu.now();
        let memory = &mut Memory::new(&mut emulation.cpu.bus, now);
        let coming = self.read(memory)?;
        if let Some(given) = self.given.replace(coming) {
            self.compare(given, memory).map_err(|error| {
                format!("control step {}: {}", self.seen.steps, error.message().unwrap_or_default())
            })?;
        }
        Ok(())
    }

    fn read<W: Observed>(&self, memory: &mut Memory<'_, W>) -> Result<Given, Failed> {
        let fields = &self.variables;
        let [a, b, c, supply] = {
            let mut codes = [0; 4];
            for (code, address) in codes.iter_mut().zip(W::CODES) {
                *code = memory.word(address)? as u16;
            }
            codes
        };
        let gate = fields.gate.as_ref().map_or(Ok(READY), |gate| memory.bits(gate))?;
        let bridge_fault = W::bridge_fault(memory)? || gate != READY;
        let stopped = memory.bits(&fields.stopped)? != 0;
        let analog = &W::CONFIGURATION.analog;
        let measured = Measurements {
            phase_currents: analog.currents([a, b, c]),
            bus_voltage: analog.supply(supply),
            // Filled in after the step: see `compare`.
            encoder: 0,
            encoder_valid: false,
            encoder_referenced: false,
            winding_temperature: match &fields.winding_temperature {
                Some(variable) => memory.real(variable)?,
                None => f32::NAN,
            },
            bridge_temperature: memory.real(&fields.bridge_temperature)?,
            bridge_fault: bridge_fault || stopped,
            overrun: memory.bits(&fields.overrun)? != 0,
        };
        let [factor, viscous] = match &fields.factors {
            Some([factor, viscous]) => [memory.real(factor)?, memory.real(viscous)?],
            None => [Factors::IMAGE.factor, Factors::IMAGE.viscous],
        };
        let slow = Slow {
            derating: memory.real(&fields.derating)?,
            gear_temperature: memory.real(&fields.gear_temperature)?,
            factors: Factors { factor, viscous },
        };
        Ok(Given {
            demand: fields.demand(memory)?,
            slow,
            measured,
            encoder: W::encoder(memory, &fields.encoder)?,
            stopped,
            started: gate != STARTING,
            mean_square_wanted: memory.bits(&fields.mean_square_wanted)? != 0,
            place: fields.place(memory)?,
        })
    }

    fn compare<W: Observed>(&mut self, mut given: Given, memory: &mut Memory<'_, W>) -> Result<(), Failed> {
        // The supply is converted after the currents: the step may have read the code of before or of now.
        let supply = memory.real(&self.variables.bus_voltage)?;
        let codes = [given.measured.bus_voltage, self.given.as_ref().map_or(f32::NAN, |now| now.measured.bus_voltage)];
        if self.active.is_some() && given.started && !codes.contains(&supply) {
            return Err(format!("the step measured a supply of {supply} V, the converter {codes:?} V").into());
        }
        given.measured.bus_voltage = supply;
        let encoder = W::encoder_taken(memory, &self.variables.encoder, given.encoder)?;
        // If the encoder did not answer, its last good angle stands in.
        self.angle = encoder.angle.unwrap_or(self.angle);
        given.measured.encoder = self.angle;
        given.measured.encoder_valid = encoder.angle.is_some();
        given.measured.encoder_referenced = encoder.referenced;
        if self.variables.place(memory)? != given.place {
            self.active = Some(self.coming.take().ok_or("parameters that were not expected")?);
        }
        let wanted = match &self.active {
            Some(active) if given.started => {
                self.joint.control_step(active, &given.demand, &given.slow, &given.measured)
            }
            _ => Bridge::OFF,
        };
        let bridge = if given.stopped { Bridge::OFF } else { wanted };
        let BoardConfiguration { bridge: board, .. } = W::CONFIGURATION;
        let top = (TIMER_HZ / (2.0 * board.rate)) as u16;
        let duties = [bridge.duties.a, bridge.duties.b, bridge.duties.c];
        for (phase, duty) in duties.into_iter().enumerate() {
            let held = memory.bits(&self.variables.held[phase])?;
            let expected = u64::from(compare_value(duty, top, board.duty.1));
            if held != expected {
                return Err(format!("compare value {phase} is {held} on the board, {expected} on the host").into());
            }
        }
        let switching = memory.bits(&self.variables.switching)? != 0;
        if switching != (bridge.state == BridgeState::Switching) {
            return Err(format!("the bridge switches on the board: {switching}, on the host: {bridge:?}").into());
        }
        let telemetry = self.joint.telemetry();
        let numbers = numbers(&telemetry);
        for (variable, (name, expected)) in self.variables.numbers.iter().zip(numbers) {
            let bits = memory.bits(variable)?;
            if bits != u64::from(expected) {
                let (board, host) = (f32::from_bits(bits as u32), f32::from_bits(expected));
                return Err(format!("{name} is {board} ({bits:#x}) on the board, {host} ({expected:#x}) here").into());
            }
        }
        let state = memory.variant(&self.variables.state)?.0;
        if state != format!("{:?}", telemetry.state) {
            return Err(format!("{state} on the board, {:?} on the host", telemetry.state).into());
        }
        if given.mean_square_wanted {
            let expected = self.joint.take_mean_square_current();
            let board = memory.real(&self.variables.mean_square_current)?;
            if board.to_bits() != expected.to_bits() {
                return Err(format!("mean square current {board} A2 on the board, {expected} on the host").into());
            }
        }
        self.note(&telemetry, switching);
        Ok(())
    }

    fn note(&mut self, telemetry: &Telemetry, switching: bool) {
        let seen = &mut self.seen;
        seen.steps += 1;
        seen.switching += u64::from(switching);
        seen.faults += u64::from(!telemetry.faults.is_empty());
        if switching {
            let Output { acting, reason, .. } = telemetry.compensated.output;
            *seen.compensation.entry(format!("{acting:?} {reason:?}")).or_default() += 1;
        }
    }
}

/// States of [`Observed::GATE`].
const STARTING: u64 = 0;
const READY: u64 = 1;

/// Clock of the boards' timers, Hz.
const TIMER_HZ: f32 = 170e6;

/// Numbers of the telemetry that are compared, by their paths in the joint, as bits.
fn numbers(telemetry: &Telemetry) -> [(&'static str, u32); 12] {
    let Telemetry { motion, wanted, compensated, reference, current, .. } = telemetry;
    [
        ("found.motion.position", motion.position.to_bits()),
        ("found.motion.velocity", motion.velocity.to_bits()),
        ("found.motion.acceleration", motion.acceleration.to_bits()),
        ("motion_loop.wanted.torque", wanted.torque.to_bits()),
        ("motion_loop.compensated.torque", compensated.torque.to_bits()),
        ("motion_loop.compensated.permitted", compensated.permitted.to_bits()),
        ("motion_loop.compensated.output.shadow", compensated.output.shadow.to_bits() as u32),
        ("found.reference.d", reference.d.to_bits()),
        ("found.reference.q", reference.q.to_bits()),
        ("found.current.d", current.d.to_bits()),
        ("found.current.q", current.q.to_bits()),
        ("found.measured_torque", telemetry.measured_torque.to_bits()),
    ]
}

/// The program's variables that are read in every step.
struct Fields<'v> {
    stopped: Variable<'v>,
    overrun: Variable<'v>,
    gate: Option<Variable<'v>>,
    encoder: Vec<Variable<'v>>,
    bridge_temperature: Variable<'v>,
    /// None without a sensor there: the compiler has seen that it is never written.
    winding_temperature: Option<Variable<'v>>,
    derating: Variable<'v>,
    gear_temperature: Variable<'v>,
    /// None in a program that does not adapt.
    factors: Option<[Variable<'v>; 2]>,
    mean_square_wanted: Variable<'v>,
    mean_square_current: Variable<'v>,
    switching: Variable<'v>,
    held: [Variable<'v>; 3],
    /// Place of the newest demand, unless there is a fresher one, and that.
    taken: Variable<'v>,
    between: Variable<'v>,
    demands: [Demanded<'v>; 3],
    place: Variable<'v>,
    state: Variable<'v>,
    bus_voltage: Variable<'v>,
    numbers: Vec<Variable<'v>>,
}

/// A [`Demand`] in the program's memory.
struct Demanded<'v> {
    controlword: Variable<'v>,
    mode: Variable<'v>,
    /// Position, velocity, torque, push, stiffness, damping.
    command: [Variable<'v>; 6],
    sequence: Variable<'v>,
    coupled_velocity: Variable<'v>,
    coupled_sequence: Variable<'v>,
}

impl<'v> Demanded<'v> {
    fn of(variables: &'v Variables, place: usize) -> Result<Self, VariableError> {
        let part = |name: &str| variables.get(&format!("control::DEMAND.places.{place}.{name}"));
        Ok(Self {
            controlword: part("controlword")?,
            mode: part("command.mode")?,
            command: [
                part("command.position")?,
                part("command.velocity")?,
                part("command.torque")?,
                part("command.push")?,
                part("command.stiffness")?,
                part("command.damping")?,
            ],
            sequence: part("sequence")?,
            coupled_velocity: part("coupled.velocity")?,
            coupled_sequence: part("coupled.sequence")?,
        })
    }

    fn read<W: Observed>(&self, memory: &mut Memory<'_, W>) -> Result<Demand, Failed> {
        let mode = match memory.variant(&self.mode)?.0 {
            "Torque" => Mode::Torque,
            "Velocity" => Mode::Velocity,
            "Position" => Mode::Position,
            "Impedance" => Mode::Impedance,
            "Hold" => Mode::Hold,
            other => return Err(format!("mode {other}").into()),
        };
        let mut numbers = [0.0; 6];
        for (number, variable) in numbers.iter_mut().zip(&self.command) {
            *number = memory.real(variable)?;
        }
        let [position, velocity, torque, push, stiffness, damping] = numbers;
        Ok(Demand {
            controlword: Controlword(memory.bits(&self.controlword)? as u16),
            command: Command { mode, position, velocity, torque, push, stiffness, damping, ..Command::NOTHING },
            sequence: memory.bits(&self.sequence)? as u32,
            coupled: Coupled {
                velocity: memory.real(&self.coupled_velocity)?,
                sequence: memory.bits(&self.coupled_sequence)? as u32,
            },
        })
    }
}

/// Flag of `exchange::Newest`: what lies between has not been taken yet.
const FRESH: u64 = 1 << 7;

impl<'v> Fields<'v> {
    fn of<W: Observed>(variables: &'v Variables) -> Result<Self, VariableError> {
        let word = |name: &str| variables.get(&format!("control::WORDS.{name}"));
        let control = |name: &str| variables.get(&format!("control::CONTROL.{name}"));
        let held = |phase: usize| variables.get(&format!("pwm::HELD.{phase}"));
        let telemetry = numbers(&Telemetry::default());
        let telemetry = telemetry.iter().map(|(name, _)| control(&format!("joint.{name}")));
        Ok(Self {
            stopped: word("stopped")?,
            overrun: control("overrun")?,
            gate: W::GATE.map(|name| variables.get(name)).transpose()?,
            encoder: W::ENCODER.iter().map(|name| control(name)).collect::<Result<_, _>>()?,
            bridge_temperature: word("bridge_temperature")?,
            winding_temperature: W::WINDING_SENSOR.then(|| word("winding_temperature")).transpose()?,
            derating: word("derating")?,
            gear_temperature: word("gear_temperature")?,
            factors: W::ADAPTS.then(|| Ok::<_, VariableError>([word("factor")?, word("viscous")?])).transpose()?,
            mean_square_wanted: word("mean_square_wanted")?,
            mean_square_current: word("mean_square_current")?,
            switching: word("switching")?,
            held: [held(0)?, held(1)?, held(2)?],
            taken: control("ends.demand.taker.own")?,
            between: variables.get("control::DEMAND.sides.between")?,
            demands: [Demanded::of(variables, 0)?, Demanded::of(variables, 1)?, Demanded::of(variables, 2)?],
            place: control("ends.active.user.own")?,
            state: control("joint.machine.state")?,
            bus_voltage: control("joint.found.bus_voltage")?,
            numbers: telemetry.collect::<Result<_, _>>()?,
        })
    }

    /// The newest demand, as the step will take it.
    fn demand<W: Observed>(&self, memory: &mut Memory<'_, W>) -> Result<Demand, Failed> {
        let between = memory.bits(&self.between)?;
        let place = if between & FRESH != 0 { between & !FRESH } else { memory.bits(&self.taken)? };
        self.demands.get(place as usize).ok_or("a demand in no place")?.read(memory)
    }

    /// The place that the parameters in use lie in.
    fn place<W: Observed>(&self, memory: &mut Memory<'_, W>) -> Result<Option<u64>, Failed> {
        Ok(match memory.variant(&self.place)? {
            ("Some", Some(content)) => Some(memory.bits(&content)?),
            _ => None,
        })
    }
}
