//! The drive's state machine (CiA 402-2, "Power drive system finite state automaton"); control step.
//!
//! Requests of the network come as the controlword, the state of the drive comes out as the statusword; the bridge
//! switches only in [`State::OperationEnabled`], [`State::QuickStopActive`], while a fault reaction brakes, and in
//! [`State::OpenLoop`].
//!
//! [`State::OpenLoop`] is not of the profile: it takes the place of "operation enabled" in
//! [`Mode::OpenLoop`](super::Mode::OpenLoop), in which a voltage turns the motor and nothing can brake it. Whatever
//! leaves it switches the bridge off in the same step.

use super::stop_options::StopConfiguration;

/// Control steps for which a fault reset waits for the gate driver: a task clears it, and configures it anew where it
/// has to. 100 ms at 40 kHz.
pub const RESET_STEPS: u16 = 4_000;

/// States of the power drive system.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum State {
    /// Starting: offsets of the current sensors are measured, the encoder has to answer.
    #[default]
    NotReadyToSwitchOn = 0,
    /// Started; nothing may move.
    SwitchOnDisabled = 1,
    /// Waits for "switch on".
    ReadyToSwitchOn = 2,
    /// Switched on, without torque.
    SwitchedOn = 3,
    /// The joint follows its commands.
    OperationEnabled = 4,
    /// The joint brakes to a stop; then nothing may move, or it holds.
    QuickStopActive = 5,
    /// A fault happened; the joint brakes, if the fault permits that.
    FaultReactionActive = 6,
    /// A fault happened; nothing may move until it is acknowledged.
    Fault = 7,
    /// The motor is under a commanded voltage.
    OpenLoop = 8,
}

/// The controlword, object 6040h.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Controlword(
    /// Bits as on the network.
    pub u16,
);

impl Controlword {
    /// Shutdown: towards "ready to switch on".
    pub const SHUTDOWN: Self = Self(0x06);
    /// Switch on.
    pub const SWITCH_ON: Self = Self(0x07);
    /// Enable operation.
    pub const ENABLE_OPERATION: Self = Self(0x0f);
    /// Disable voltage: the bridge is off at once.
    pub const DISABLE_VOLTAGE: Self = Self(0x00);
    /// Quick stop.
    pub const QUICK_STOP: Self = Self(0x02);
    /// Fault reset, on its rising edge.
    pub const FAULT_RESET: Self = Self(0x80);
    /// Halt, beside another command.
    pub const HALT: Self = Self(1 << 8);

    const fn has(self, bits: u16) -> bool {
        self.0 & bits == bits
    }

    /// Asks a joint in operation to leave it, by "shutdown" or "disable operation".
    #[inline(always)]
    pub const fn ends_operation(self) -> bool {
        self.has(0x06) && self.0 & 0x0f != 0x0f
    }

    /// "Enable operation".
    pub const fn enables_operation(self) -> bool {
        self.has(0x0f) && self.commands()
    }

    /// Permits operation, whether or not bit 7 is set: a joint in operation stays in it.
    pub const fn permits_operation(self) -> bool {
        self.has(0x0f)
    }

    /// Returns `true` if the fault reset rises behind the word `last`.
    pub const fn begins_reset(self, last: Self) -> bool {
        self.0 & !last.0 & Self::FAULT_RESET.0 != 0
    }

    /// Halt: the joint stops and holds where it came to a stop, in whatever mode.
    pub const fn halts(self) -> bool {
        self.has(Self::HALT.0)
    }

    /// "New set-point" of profile position mode, and "homing operation start".
    pub const fn is_new_set_point(self) -> bool {
        self.has(1 << 4)
    }

    /// "Change set immediately" of profile position mode.
    pub const fn changes_at_once(self) -> bool {
        self.has(1 << 5)
    }

    /// The position of profile position mode counts from the one before.
    pub const fn is_relative(self) -> bool {
        self.has(1 << 6)
    }

    /// Fault reset where it is set, and "disable voltage".
    pub const fn reset_alone(self) -> Self {
        Self(self.0 & Self::FAULT_RESET.0)
    }

    /// Returns `true` if this is not a fault reset, with which nothing else counts: every command of the profile has
    /// bit 7 clear.
    const fn commands(self) -> bool {
        !self.has(1 << 7)
    }

    const fn enables_voltage(self) -> bool {
        self.has(1 << 1)
    }

    /// Farthest transition that the command permits the machine, whether or not bit 7 is set.
    #[inline(always)]
    const fn permits(self) -> Permits {
        if !self.enables_voltage() {
            Permits::Nothing
        } else if !self.has(1 << 2) {
            Permits::QuickStop
        } else if !self.has(1) {
            Permits::Ready
        } else if !self.has(1 << 3) {
            Permits::SwitchedOn
        } else {
            Permits::Operation
        }
    }
}

/// Farthest transition that a command permits the machine.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd)]
#[repr(u8)]
enum Permits {
    Nothing,
    QuickStop,
    Ready,
    SwitchedOn,
    Operation,
}

/// Inputs of the machine in a control step besides the controlword.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Events<'a> {
    /// The start is complete, and what the mode needs is known.
    pub started: bool,
    /// The mode is [`Mode::OpenLoop`](super::Mode::OpenLoop).
    pub open_loop: bool,
    /// A fault is present: new, or one that has not gone.
    pub fault: bool,
    /// The gate driver is at fault, and nothing else: a fault reset waits until it has been cleared.
    pub driver_alone: bool,
    /// Braking is over or not permitted.
    pub stopped: bool,
    /// No command came for longer than a joint permits that then makes a quick stop.
    pub late: bool,
    /// Configuration of the joint's stops.
    pub stops: &'a StopConfiguration,
}

/// The state machine, from one control step to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StateMachine {
    state: State,
    /// Fault reset was set in the last controlword.
    reset: bool,
    /// Control steps for which a fault reset still waits for the gate driver.
    waits: u16,
    /// `true` if since the quick stop somebody has asked for something else than operation: a master that was silent
    /// must not go on as if it had not been.
    heard: bool,
}

impl StateMachine {
    /// Returns `true` while a fault reset waits for the gate driver.
    #[inline(always)]
    pub const fn waits_for_driver(&self) -> bool {
        self.waits > 0
    }

    /// State of the machine.
    pub const fn state(&self) -> State {
        self.state
    }

    /// Ends a fault reaction that must not brake, in the step that begins it.
    #[inline(always)]
    pub fn end_reaction(&mut self) -> State {
        if self.state == State::FaultReactionActive {
            self.state = State::Fault;
        }
        self.state
    }

    /// A control step in which nothing asks for another state than "operation enabled": most of those in which the
    /// bridge switches, the longest among them. False where [`step`](Self::step) has to look; it never contradicts it.
    #[inline(always)]
    pub fn stays_enabled(&mut self, word: Controlword, fault: bool, open_loop: bool) -> bool {
        const ENABLED: u16 = Controlword::ENABLE_OPERATION.0;
        const COUNTS: u16 = ENABLED | Controlword::FAULT_RESET.0;
        let stays = self.state == State::OperationEnabled && word.0 & COUNTS == ENABLED && !(fault | open_loop);
        if stays {
            self.reset = false;
        }
        stays
    }

    /// One control step; the state from now on. A fault has precedence over whatever is asked; one transition a step.
    #[inline(always)]
    pub fn step(&mut self, word: Controlword, events: Events) -> State {
        use State::*;
        let reset = word.has(1 << 7) && !self.reset;
        self.reset = word.has(1 << 7);
        let asked = reset || self.waits > 0;
        self.waits = match (self.state, events.driver_alone) {
            (Fault, true) if reset => RESET_STEPS,
            (Fault, true) => self.waits.saturating_sub(1),
            _ => 0,
        };
        let faulty = events.fault && !matches!(self.state, FaultReactionActive | Fault);
        let (permits, commands) = (word.permits(), word.commands());
        let enables = permits == Permits::Operation && commands;
        let stops = events.stops;
        let (stopped, quick) = (events.stopped, permits == Permits::QuickStop || events.open_loop || events.late);
        let goes_on = stops.holds() && self.heard && enables && !events.open_loop;
        self.heard = self.state == QuickStopActive && (self.heard || !enables);
        self.state = match self.state {
            // A joint that was not moving has nothing to react with.
            NotReadyToSwitchOn | SwitchOnDisabled | ReadyToSwitchOn | SwitchedOn | OpenLoop if faulty => Fault,
            _ if faulty => FaultReactionActive,
            NotReadyToSwitchOn if events.started => SwitchOnDisabled,
            // Another mode needs more than the one before.
            SwitchOnDisabled | ReadyToSwitchOn | SwitchedOn if !events.started => NotReadyToSwitchOn,
            SwitchOnDisabled if permits == Permits::Ready && commands => ReadyToSwitchOn,
            ReadyToSwitchOn | SwitchedOn | OpenLoop if permits as u8 <= Permits::QuickStop as u8 => SwitchOnDisabled,
            OperationEnabled | QuickStopActive if permits == Permits::Nothing => SwitchOnDisabled,
            OperationEnabled if quick && stops.quick_stop == 0 => SwitchOnDisabled,
            OperationEnabled if quick => QuickStopActive,
            SwitchedOn | OpenLoop if permits == Permits::Ready => ReadyToSwitchOn,
            OperationEnabled if permits == Permits::Ready && (stopped || stops.shutdown == 0) => ReadyToSwitchOn,
            ReadyToSwitchOn if permits as u8 >= Permits::SwitchedOn as u8 && commands => SwitchedOn,
            // Not "switched on": the controlword that applied the voltage would enable the other mode.
            OpenLoop if !events.open_loop => SwitchOnDisabled,
            SwitchedOn if enables && events.open_loop => OpenLoop,
            SwitchedOn if enables => OperationEnabled,
            OpenLoop if !enables => SwitchedOn,
            OperationEnabled if permits == Permits::SwitchedOn && (stopped || stops.disable_operation == 0) => {
                SwitchedOn
            }
            QuickStopActive if stopped => SwitchOnDisabled,
            QuickStopActive if goes_on => OperationEnabled,
            FaultReactionActive if stopped => Fault,
            Fault if asked && !events.fault => SwitchOnDisabled,
            state => state,
        };
        self.state
    }
}

impl State {
    /// The state with this number; the last one where there is none.
    pub(super) const fn at(number: u32) -> Self {
        match number {
            0 => Self::NotReadyToSwitchOn,
            1 => Self::SwitchOnDisabled,
            2 => Self::ReadyToSwitchOn,
            3 => Self::SwitchedOn,
            4 => Self::OperationEnabled,
            5 => Self::QuickStopActive,
            6 => Self::FaultReactionActive,
            8 => Self::OpenLoop,
            _ => Self::Fault,
        }
    }

    /// Returns `true` if the current loop makes a torque.
    pub const fn makes_torque(self) -> bool {
        matches!(self, Self::OperationEnabled | Self::QuickStopActive | Self::FaultReactionActive)
    }

    /// The statusword's bits that tell the state (object 6041h, mask 006Fh), quick stop bit included. The open loop is
    /// "operation enabled" with the manufacturer's bit 14.
    pub const fn statusword(self) -> u16 {
        match self {
            Self::NotReadyToSwitchOn => 0x00,
            Self::SwitchOnDisabled => 0x40,
            Self::ReadyToSwitchOn => 0x21,
            Self::SwitchedOn => 0x23,
            Self::OperationEnabled => 0x27,
            Self::QuickStopActive => 0x07,
            Self::FaultReactionActive => 0x0f,
            Self::Fault => 0x08,
            Self::OpenLoop => 0x4027,
        }
    }
}

#[cfg(test)]
mod tests;
