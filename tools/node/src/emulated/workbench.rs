//! Workbench of an emulated board: obeys [commands](Command) in the board's own time, and answers each in one line.

use super::command::{Command, DriverFault, HELP};
use emulator::board::Wired;
use emulator::chip::time::Instant;
use emulator::cpu::End;
use emulator::emulation::Emulation;
use emulator::parts::drv8353::fault as status;
use plant::actuator::Fault;
use std::collections::VecDeque;

/// A hand looks and pushes anew after so long, ps.
const HAND: u64 = 1_000_000_000;
/// Speed at which it turns the link, rad/s.
const SPEED: f64 = 0.25;
/// Time within which it reaches that speed, s, with at most so many times the joint's largest torque.
const PUSH: f64 = 0.005;
const STRENGTH: f64 = 4.0;
/// Time for which the button is pressed, ps.
const PRESSED: u64 = 100_000_000_000;

/// A hand that turns the link.
#[derive(Clone, Copy, Debug)]
struct Hand {
    /// Position at which it began, and the distance that it goes, rad.
    from: f64,
    by: f64,
    /// Torque with which it pushes besides what the speed asks for, Nm.
    sustained: f64,
}

/// The bench.
#[derive(Debug, Default)]
pub struct Workbench {
    lines: VecDeque<String>,
    answers: Vec<String>,
    /// Time without power so far, ps.
    dark: u64,
    /// Lines wait until then, ps.
    resume: u64,
    load: f64,
    hand: Option<Hand>,
    /// The button is let go then, ps.
    pressed: Option<u64>,
}

impl Workbench {
    /// Bench with nothing to do.
    pub fn new() -> Self {
        Self::default()
    }

    /// A line to obey when those before it have been.
    pub fn tell(&mut self, line: &str) {
        self.lines.push_back(line.to_owned());
    }

    /// Answers since the last call, a line each.
    pub fn take_answers(&mut self) -> Vec<String> {
        std::mem::take(&mut self.answers)
    }

    /// Time since the beginning, with and without power, ps.
    fn time<W: Wired>(&self, emulation: &Emulation<W>) -> u64 {
        emulation.now().0 + self.dark
    }

    /// Runs the board up to an instant of its time, as [`Emulation::run_until`] does, and obeys what is due. Without
    /// power time passes all the same.
    pub fn run_until<W: Wired>(&mut self, emulation: &mut Emulation<W>, until: Instant) -> Option<End> {
        let target = self.time(emulation) + until.0.saturating_sub(emulation.now().0);
        loop {
            let now = self.time(emulation);
            self.obey(emulation, now);
            if now >= target {
                return None;
            }
            let mut next = target;
            if !self.lines.is_empty() {
                next = next.min(self.resume);
            }
            if let Some(pressed) = self.pressed {
                next = next.min(pressed);
            }
            if self.hand.is_some() {
                next = next.min(now + HAND);
            }
            let ended = emulation.run_until(Instant(next - self.dark));
            if !emulation.is_powered() {
                self.dark += next.saturating_sub(self.time(emulation));
            } else if ended.is_some() {
                return ended;
            }
        }
    }

    /// Carries out what is due.
    fn obey<W: Wired>(&mut self, emulation: &mut Emulation<W>, now: u64) {
        if self.pressed.is_some_and(|until| until <= now) {
            self.pressed = None;
            emulation.cpu.bus.wiring_mut().inputs().button = false;
        }
        while now >= self.resume {
            let Some(line) = self.lines.pop_front() else { break };
            let line = line.trim();
            if line.is_empty() || line.starts_with('#') {
                continue;
            }
            let done = match line.parse() {
                Ok(command) => self.done(command, emulation, now),
                Err(error) => Err(error.to_string()),
            };
            let answer = done.unwrap_or_else(|error| format!("error: {error}"));
            self.answers.push(format!("{:9.3} s  {answer}", now as f64 * 1e-12));
        }
        self.push(emulation);
    }

    /// Carries a command out; the answer, or why it cannot be.
    fn done<W: Wired>(&mut self, command: Command, emulation: &mut Emulation<W>, now: u64) -> Result<String, String> {
        let powered = emulation.is_powered();
        let board = emulation.cpu.bus.wiring_mut();
        let switched = |what: &str, on: bool| format!("{what} {}", if on { "on" } else { "off" });
        match command {
            Command::Help => {
                let commands = HELP.map(|(name, takes, what)| format!("{} ({what})", format!("{name} {takes}").trim()));
                Ok(commands.join(", "))
            }
            Command::Status => {
                let led = board.led();
                let drivetrain = board.drivetrain();
                let (state, switching) = (drivetrain.actuator().state(), drivetrain.is_switching());
                Ok(format!(
                    "link {:.4} rad, {:.4} rad/s; supply {:.2} V; {}; {}; {}",
                    state.joint.position,
                    state.joint.velocity,
                    state.bus_voltage,
                    switched("power", powered),
                    switched("bridge", switching),
                    switched("LED", led)
                ))
            }
            Command::Wait(seconds) => {
                self.resume = now + (seconds * 1e12) as u64;
                Ok(format!("waiting {seconds} s"))
            }
            Command::Supply(volts) => {
                let injected = board.drivetrain().actuator_mut().inject(Fault::SourceVoltage(volts));
                injected.map(|()| format!("supply {volts} V")).map_err(|error| error.to_string())
            }
            Command::Load(torque) => {
                self.load = torque;
                Ok(format!("load {torque} Nm"))
            }
            Command::Turn(by) => {
                let from = board.drivetrain().actuator().state().joint.position;
                self.hand = Some(Hand { from, by, sustained: 0.0 });
                Ok(format!("turning the link from {from:.4} to {:.4} rad", from + by))
            }
            Command::Button if !W::BUTTON => Err(format!("the {} has no button", W::NAME)),
            Command::Button => {
                board.inputs().button = true;
                self.pressed = Some(now + PRESSED);
                Ok("button pressed for 0.1 s".into())
            }
            Command::EncoderOpen(open) => {
                board.inputs().encoder_line = open.then_some(true);
                Ok(switched("encoder-open", open))
            }
            Command::ThermistorOpen(open) => {
                board.inputs().thermistor_open = open;
                Ok(switched("thermistor-open", open))
            }
            Command::DriverFault(fault) => {
                let missing = || format!("the {} has no gate driver that tells of its faults", W::NAME);
                let driver = board.gate_driver().ok_or_else(missing)?;
                driver.set_present(match fault {
                    Some(DriverFault::OverCurrent) => status::OVER_CURRENT,
                    Some(DriverFault::UnderVoltage) => status::UNDER_VOLTAGE,
                    Some(DriverFault::OverTemperature) => status::OVER_TEMPERATURE,
                    Some(DriverFault::GateDrive) => status::GATE_DRIVE,
                    _ => [0; 2],
                });
                driver.set_silent(fault == Some(DriverFault::Silent));
                if fault == Some(DriverFault::Forgot) {
                    driver.forget();
                }
                board.inputs().driver_fault = fault == Some(DriverFault::Line);
                Ok(format!("driver-fault {}", fault.map_or("off", DriverFault::word)))
            }
            Command::Power(on) => {
                match (powered, on) {
                    (true, false) => emulation.power_down(),
                    (false, true) => emulation.power_up(),
                    _ => return Err(format!("the power is {} already", if on { "on" } else { "off" })),
                }
                Ok(switched("power", on))
            }
        }
    }

    /// Torque from outside: the load's, and the hand's until the link is where it should be.
    fn push<W: Wired>(&mut self, emulation: &mut Emulation<W>) {
        let drivetrain = emulation.cpu.bus.wiring_mut().drivetrain();
        drivetrain.external_torque = self.load;
        let Some(hand) = &mut self.hand else { return };
        let actuator = drivetrain.actuator();
        let joint = &actuator.parameters().joint;
        let state = &actuator.state().joint;
        let (strongest, stiffness) = (STRENGTH * joint.motor.torque_limit(), joint.inertia() / PUSH);
        if (state.position - hand.from) * hand.by.signum() >= hand.by.abs() {
            self.hand = None;
            return;
        }
        // Friction takes what the speed's error alone does not give.
        let slow = SPEED.copysign(hand.by) - state.velocity;
        hand.sustained = (hand.sustained + 0.02 * stiffness * slow).clamp(-strongest, strongest);
        drivetrain.external_torque += (stiffness * slow + hand.sustained).clamp(-strongest, strongest);
    }
}
