//! The drive's state machine (CiA 402-2, "Power drive system finite state automaton"); control step.
//!
//! What the network asks for comes as the controlword, what the drive is comes out as the statusword; the bridge switches only in
//! [`State::OperationEnabled`], [`State::QuickStopActive`] and while a fault reaction brakes.

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
    /// The joint brakes to a stop, then nothing may move.
    QuickStopActive = 5,
    /// A fault happened; the joint brakes, if the fault permits that.
    FaultReactionActive = 6,
    /// A fault happened; nothing may move until it is acknowledged.
    Fault = 7,
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

    const fn has(self, bits: u16) -> bool {
        self.0 & bits == bits
    }

    /// "Enable operation".
    pub const fn enables_operation(self) -> bool {
        self.has(0x0f) && self.commands()
    }

    /// Not a fault reset, with which nothing else counts: every command of the profile has bit 7 clear.
    const fn commands(self) -> bool {
        !self.has(1 << 7)
    }

    const fn enables_voltage(self) -> bool {
        self.has(1 << 1)
    }

    const fn asks_quick_stop(self) -> bool {
        self.enables_voltage() && !self.has(1 << 2)
    }

    /// "Shutdown", "switch on" or "enable operation": voltage and no quick stop.
    const fn keeps_running(self) -> bool {
        self.has(1 << 1 | 1 << 2)
    }
}

/// What the machine is told in a control step besides the controlword.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Events {
    /// The start is complete.
    pub started: bool,
    /// A fault is present: new, or one that has not gone.
    pub fault: bool,
    /// Braking, of a quick stop or of a fault reaction, is over or not permitted.
    pub stopped: bool,
}

/// The state machine, from one control step to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StateMachine {
    state: State,
    /// Fault reset was set in the last controlword.
    reset: bool,
}

impl StateMachine {
    /// Where it is.
    pub const fn state(&self) -> State {
        self.state
    }

    /// One control step; the state from now on. A fault has precedence over whatever is asked; one transition a step.
    #[inline(always)]
    pub fn step(&mut self, word: Controlword, events: Events) -> State {
        use State::*;
        let reset = word.has(1 << 7) && !self.reset;
        self.reset = word.has(1 << 7);
        let faulty = events.fault && !matches!(self.state, FaultReactionActive | Fault);
        self.state = match self.state {
            // A joint that was not moving has nothing to react with.
            NotReadyToSwitchOn | SwitchOnDisabled | ReadyToSwitchOn | SwitchedOn if faulty => Fault,
            _ if faulty => FaultReactionActive,
            NotReadyToSwitchOn if events.started => SwitchOnDisabled,
            SwitchOnDisabled if word.commands() && word.keeps_running() && !word.has(1) => ReadyToSwitchOn,
            ReadyToSwitchOn if !word.keeps_running() => SwitchOnDisabled,
            ReadyToSwitchOn if word.commands() && word.has(1) => SwitchedOn,
            SwitchedOn | OperationEnabled if !word.enables_voltage() => SwitchOnDisabled,
            SwitchedOn if word.asks_quick_stop() => SwitchOnDisabled,
            SwitchedOn | OperationEnabled if word.keeps_running() && !word.has(1) => ReadyToSwitchOn,
            SwitchedOn if word.enables_operation() => OperationEnabled,
            OperationEnabled if word.asks_quick_stop() => QuickStopActive,
            OperationEnabled if !word.has(1 << 3) => SwitchedOn,
            QuickStopActive if !word.enables_voltage() || events.stopped => SwitchOnDisabled,
            FaultReactionActive if events.stopped => Fault,
            Fault if reset && !events.fault => SwitchOnDisabled,
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
            _ => Self::Fault,
        }
    }

    /// Whether the bridge switches.
    pub const fn switches(self) -> bool {
        matches!(self, Self::OperationEnabled | Self::QuickStopActive | Self::FaultReactionActive)
    }

    /// The statusword's bits that tell the state (object 6041h, mask 006Fh), quick stop bit included.
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
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use State::*;
    use proptest::prelude::*;

    const QUIET: Events = Events { started: true, fault: false, stopped: false };

    fn enabled() -> StateMachine {
        let mut machine = StateMachine::default();
        machine.step(Controlword(0), QUIET);
        for word in [Controlword::SHUTDOWN, Controlword::SWITCH_ON, Controlword::ENABLE_OPERATION] {
            machine.step(word, QUIET);
        }
        assert_eq!(machine.state(), OperationEnabled);
        machine
    }

    #[test]
    fn nothing_is_enabled_before_the_start_is_complete() {
        let mut machine = StateMachine::default();
        for _ in 0..10 {
            assert_eq!(machine.step(Controlword::ENABLE_OPERATION, Events::default()), NotReadyToSwitchOn);
        }
    }

    #[test]
    fn a_drive_that_starts_with_operation_enabled_in_the_controlword_stays_off() {
        let mut machine = StateMachine::default();
        for _ in 0..10 {
            machine.step(Controlword::ENABLE_OPERATION, QUIET);
        }
        assert_eq!(machine.state(), SwitchOnDisabled);
    }

    #[test]
    fn operation_is_left_by_each_way_that_the_profile_names() {
        for (word, state) in [
            (Controlword::SHUTDOWN, ReadyToSwitchOn),
            (Controlword::SWITCH_ON, SwitchedOn),
            (Controlword::DISABLE_VOLTAGE, SwitchOnDisabled),
            (Controlword::QUICK_STOP, QuickStopActive),
            (Controlword::ENABLE_OPERATION, OperationEnabled),
        ] {
            assert_eq!(enabled().step(word, QUIET), state, "{word:?}");
        }
    }

    /// A machine in each state that the controlword leads to.
    fn in_state(state: State) -> StateMachine {
        let mut machine = enabled();
        match state {
            SwitchOnDisabled => machine.step(Controlword::DISABLE_VOLTAGE, QUIET),
            ReadyToSwitchOn => machine.step(Controlword::SHUTDOWN, QUIET),
            SwitchedOn => machine.step(Controlword::SWITCH_ON, QUIET),
            QuickStopActive => machine.step(Controlword::QUICK_STOP, QUIET),
            FaultReactionActive => machine.step(Controlword::ENABLE_OPERATION, Events { fault: true, ..QUIET }),
            Fault => {
                machine.step(Controlword::ENABLE_OPERATION, Events { fault: true, ..QUIET });
                machine.step(Controlword::ENABLE_OPERATION, Events { fault: true, stopped: true, ..QUIET })
            }
            _ => OperationEnabled,
        };
        assert_eq!(machine.state(), state);
        machine
    }

    #[test]
    fn every_command_leads_from_every_state_to_the_one_that_the_profile_names() {
        // Columns: shutdown, switch on, enable operation, disable voltage, quick stop, fault reset.
        let table = [
            (
                SwitchOnDisabled,
                [
                    ReadyToSwitchOn,
                    SwitchOnDisabled,
                    SwitchOnDisabled,
                    SwitchOnDisabled,
                    SwitchOnDisabled,
                    SwitchOnDisabled,
                ],
            ),
            (
                ReadyToSwitchOn,
                [ReadyToSwitchOn, SwitchedOn, SwitchedOn, SwitchOnDisabled, SwitchOnDisabled, SwitchOnDisabled],
            ),
            (
                SwitchedOn,
                [ReadyToSwitchOn, SwitchedOn, OperationEnabled, SwitchOnDisabled, SwitchOnDisabled, SwitchOnDisabled],
            ),
            (
                OperationEnabled,
                [ReadyToSwitchOn, SwitchedOn, OperationEnabled, SwitchOnDisabled, QuickStopActive, SwitchOnDisabled],
            ),
            (
                QuickStopActive,
                [
                    QuickStopActive,
                    QuickStopActive,
                    QuickStopActive,
                    SwitchOnDisabled,
                    QuickStopActive,
                    SwitchOnDisabled,
                ],
            ),
            (FaultReactionActive, [FaultReactionActive; 6]),
            (Fault, [Fault, Fault, Fault, Fault, Fault, SwitchOnDisabled]),
        ];
        let words = [
            Controlword::SHUTDOWN,
            Controlword::SWITCH_ON,
            Controlword::ENABLE_OPERATION,
            Controlword::DISABLE_VOLTAGE,
            Controlword::QUICK_STOP,
            Controlword::FAULT_RESET,
        ];
        for (from, to) in table {
            for (word, to) in words.into_iter().zip(to) {
                assert_eq!(in_state(from).step(word, QUIET), to, "{word:?} in {from:?}");
            }
        }
    }

    #[test]
    fn nothing_is_switched_on_by_a_word_that_also_resets_faults() {
        for (state, command) in [
            (SwitchOnDisabled, Controlword::SHUTDOWN),
            (ReadyToSwitchOn, Controlword::SWITCH_ON),
            (SwitchedOn, Controlword::ENABLE_OPERATION),
        ] {
            let mut machine = in_state(state);
            let word = Controlword(command.0 | Controlword::FAULT_RESET.0);
            assert_eq!((machine.step(word, QUIET), machine.step(word, QUIET)), (state, state));
        }
    }

    #[test]
    fn the_statusword_tells_every_state_by_the_masks_of_the_profile() {
        // Bits 0 to 3 and 6; where the profile leaves the quick stop's bit 5 open, it does not count.
        for (state, mask, value) in [
            (NotReadyToSwitchOn, 0x4f, 0x00),
            (SwitchOnDisabled, 0x4f, 0x40),
            (ReadyToSwitchOn, 0x6f, 0x21),
            (SwitchedOn, 0x6f, 0x23),
            (OperationEnabled, 0x6f, 0x27),
            (QuickStopActive, 0x6f, 0x07),
            (FaultReactionActive, 0x4f, 0x0f),
            (Fault, 0x4f, 0x08),
        ] {
            assert_eq!(state.statusword() & mask, value, "{state:?}");
        }
    }

    #[test]
    fn a_quick_stop_ends_in_switch_on_disabled_when_the_joint_stands() {
        let mut machine = enabled();
        machine.step(Controlword::QUICK_STOP, QUIET);
        assert_eq!(machine.step(Controlword::ENABLE_OPERATION, QUIET), QuickStopActive);
        assert_eq!(machine.step(Controlword::QUICK_STOP, Events { stopped: true, ..QUIET }), SwitchOnDisabled);
    }

    #[test]
    fn a_fault_is_left_only_by_a_rising_reset_once_its_cause_is_gone() {
        let mut machine = enabled();
        let fault = Events { fault: true, ..QUIET };
        assert_eq!(machine.step(Controlword::ENABLE_OPERATION, fault), FaultReactionActive);
        assert_eq!(machine.step(Controlword::ENABLE_OPERATION, Events { stopped: true, ..fault }), Fault);
        assert_eq!(machine.step(Controlword::FAULT_RESET, fault), Fault);
        assert_eq!(machine.step(Controlword::FAULT_RESET, QUIET), Fault, "the bit was set already");
        assert_eq!(machine.step(Controlword(0), QUIET), Fault);
        assert_eq!(machine.step(Controlword::FAULT_RESET, QUIET), SwitchOnDisabled);
    }

    proptest! {
        #[test]
        fn whatever_is_asked_a_fault_ends_operation_in_the_same_step(words: [u16; 20], last: u16) {
            let mut machine = StateMachine::default();
            for word in words {
                machine.step(Controlword(word), QUIET);
            }
            let state = machine.step(Controlword(last), Events { fault: true, ..QUIET });
            prop_assert!(matches!(state, Fault | FaultReactionActive));
        }
    }
}
