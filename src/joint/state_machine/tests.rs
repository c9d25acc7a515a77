use super::*;
use State::*;
use proptest::prelude::*;

const QUIET: Events<'static> = Events {
    started: true,
    open_loop: false,
    fault: false,
    driver_alone: false,
    stopped: false,
    late: false,
    stops: &StopConfiguration::DEFAULT,
};

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
        assert_eq!(machine.step(Controlword::ENABLE_OPERATION, Events { started: false, ..QUIET }), NotReadyToSwitchOn);
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
            [ReadyToSwitchOn, SwitchOnDisabled, SwitchOnDisabled, SwitchOnDisabled, SwitchOnDisabled, SwitchOnDisabled],
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
            [QuickStopActive, QuickStopActive, QuickStopActive, SwitchOnDisabled, QuickStopActive, SwitchOnDisabled],
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

/// States of the machine from "operation enabled" with an option, before and after the joint has stopped.
fn with(change: fn(&mut StopConfiguration), word: Controlword, late: bool) -> [State; 2] {
    let mut stops = StopConfiguration::DEFAULT;
    change(&mut stops);
    assert!(stops.is_possible());
    let mut machine = enabled();
    [false, true].map(|stopped| machine.step(word, Events { stops: &stops, stopped, late, ..QUIET }))
}

#[test]
fn operation_is_left_as_the_option_codes_say() {
    use Controlword as C;
    let ended = [
        (C::QUICK_STOP, (|s| s.quick_stop = 0) as fn(&mut StopConfiguration), [SwitchOnDisabled, SwitchOnDisabled]),
        (C::QUICK_STOP, |s| s.quick_stop = 1, [QuickStopActive, SwitchOnDisabled]),
        (C::QUICK_STOP, |s| s.quick_stop = 2, [QuickStopActive, SwitchOnDisabled]),
        (C::SHUTDOWN, |s| s.shutdown = 0, [ReadyToSwitchOn, ReadyToSwitchOn]),
        (C::SHUTDOWN, |s| s.shutdown = 1, [OperationEnabled, ReadyToSwitchOn]),
        (C::SWITCH_ON, |s| s.disable_operation = 0, [SwitchedOn, SwitchedOn]),
        (C::SWITCH_ON, |s| s.disable_operation = 1, [OperationEnabled, SwitchedOn]),
        // Each option is for its own command.
        (C::SHUTDOWN, |s| s.disable_operation = 1, [ReadyToSwitchOn, ReadyToSwitchOn]),
        (C::SWITCH_ON, |s| s.shutdown = 1, [SwitchedOn, SwitchedOn]),
        (C::DISABLE_VOLTAGE, |s| (s.shutdown, s.disable_operation) = (1, 1), [SwitchOnDisabled, SwitchOnDisabled]),
    ];
    for (word, change, states) in ended {
        assert_eq!(with(change, word, false), states, "{word:?}");
    }
    assert_eq!(with(|_| {}, C::ENABLE_OPERATION, true), [QuickStopActive, SwitchOnDisabled]);
    assert_eq!(with(|s| s.quick_stop = 0, C::ENABLE_OPERATION, true)[0], SwitchOnDisabled);
}

/// Transition 16 of the profile.
#[test]
fn a_joint_that_holds_after_a_quick_stop_goes_on_when_operation_is_enabled_anew() {
    let stops = StopConfiguration { quick_stop: 6, ..StopConfiguration::DEFAULT };
    let events = Events { stops: &stops, ..QUIET };
    for word in [Controlword::SHUTDOWN, Controlword::SWITCH_ON, Controlword::QUICK_STOP] {
        let mut machine = enabled();
        machine.step(Controlword::QUICK_STOP, events);
        assert_eq!(machine.step(word, events), QuickStopActive, "{word:?}");
        assert_eq!(machine.step(Controlword::ENABLE_OPERATION, events), OperationEnabled, "{word:?}");
    }
    let mut late = enabled();
    assert_eq!(late.step(Controlword::ENABLE_OPERATION, Events { late: true, ..events }), QuickStopActive);
    assert_eq!(late.step(Controlword::ENABLE_OPERATION, events), QuickStopActive, "nobody asked for anything else");
    assert_eq!(late.step(Controlword(0x8F), events), QuickStopActive);
    assert_eq!(late.step(Controlword::ENABLE_OPERATION, events), OperationEnabled);
    let mut off = enabled();
    off.step(Controlword::QUICK_STOP, events);
    assert_eq!(off.step(Controlword::DISABLE_VOLTAGE, events), SwitchOnDisabled);
    // Without the option nothing leads back.
    let mut machine = enabled();
    machine.step(Controlword::QUICK_STOP, QUIET);
    assert_eq!(machine.step(Controlword::ENABLE_OPERATION, QUIET), QuickStopActive);
}

const OPEN_LOOP: Events<'static> = Events { open_loop: true, ..QUIET };

fn in_open_loop() -> StateMachine {
    let mut machine = StateMachine::default();
    for word in [Controlword(0), Controlword::SHUTDOWN, Controlword::SWITCH_ON, Controlword::ENABLE_OPERATION] {
        machine.step(word, OPEN_LOOP);
    }
    assert_eq!(machine.state(), OpenLoop);
    machine
}

#[test]
fn the_open_loop_is_left_by_everything_but_its_own_command_and_brakes_for_nothing() {
    for (word, state) in [
        (Controlword::SHUTDOWN, ReadyToSwitchOn),
        (Controlword::SWITCH_ON, SwitchedOn),
        (Controlword::DISABLE_VOLTAGE, SwitchOnDisabled),
        (Controlword::QUICK_STOP, SwitchOnDisabled),
        (Controlword::FAULT_RESET, SwitchOnDisabled),
        (Controlword(0x8f), SwitchedOn),
        (Controlword::ENABLE_OPERATION, OpenLoop),
    ] {
        assert_eq!(in_open_loop().step(word, OPEN_LOOP), state, "{word:?}");
    }
    // Another mode, a fault.
    let mut machine = in_open_loop();
    for _ in 0..3 {
        assert_eq!(machine.step(Controlword::ENABLE_OPERATION, QUIET), SwitchOnDisabled);
    }
    let faulty = Events { fault: true, ..OPEN_LOOP };
    assert_eq!(in_open_loop().step(Controlword::ENABLE_OPERATION, faulty), Fault);
}

#[test]
fn a_moving_joint_brakes_before_it_is_under_an_open_loop_voltage() {
    let mut machine = enabled();
    assert_eq!(machine.step(Controlword::ENABLE_OPERATION, OPEN_LOOP), QuickStopActive);
    let stopped = Events { stopped: true, ..OPEN_LOOP };
    assert_eq!(machine.step(Controlword::ENABLE_OPERATION, stopped), SwitchOnDisabled);
}

#[test]
fn a_mode_that_needs_more_than_is_known_is_not_ready() {
    let unknown = Events { started: false, ..QUIET };
    for state in [SwitchOnDisabled, ReadyToSwitchOn, SwitchedOn] {
        assert_eq!(in_state(state).step(Controlword::ENABLE_OPERATION, unknown), NotReadyToSwitchOn, "{state:?}");
    }
    let mut machine = in_open_loop();
    assert_eq!(machine.step(Controlword::ENABLE_OPERATION, unknown), SwitchOnDisabled);
    assert_eq!(machine.step(Controlword::ENABLE_OPERATION, unknown), NotReadyToSwitchOn);
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
fn staying_enabled_is_what_a_whole_step_would_do() {
    let states = [SwitchOnDisabled, ReadyToSwitchOn, SwitchedOn, OperationEnabled, QuickStopActive];
    for state in states.into_iter().chain([FaultReactionActive, Fault]) {
        for before in [0x0f, 0x8f] {
            let mut machine = in_state(state);
            machine.step(Controlword(before), QUIET);
            for word in 0..=0xff {
                for (fault, open_loop) in [(false, false), (true, false), (false, true), (true, true)] {
                    let (mut one, mut other) = (machine, machine);
                    let stays = one.stays_enabled(Controlword(word), fault, open_loop);
                    other.step(Controlword(word), Events { fault, open_loop, ..QUIET });
                    assert!(!stays || one == other, "{word:#x} in {machine:?}: {one:?}, not {other:?}");
                    let plain = machine.state == OperationEnabled && word & 0x8f == 0x0f && !fault && !open_loop;
                    assert_eq!(stays, plain, "{word:#x} in {machine:?}");
                }
            }
        }
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

#[test]
fn a_reset_of_the_gate_driver_alone_waits_until_it_is_cleared_and_not_longer_than_its_time() {
    let driver = Events { fault: true, driver_alone: true, ..QUIET };
    let faulty = in_state(Fault);
    for (steps, ends) in [(RESET_STEPS, SwitchOnDisabled), (RESET_STEPS + 1, Fault)] {
        let mut machine = faulty;
        assert_eq!(machine.step(Controlword::FAULT_RESET, driver), Fault);
        for _ in 1..steps {
            assert!(machine.waits_for_driver());
            assert_eq!(machine.step(Controlword(0), driver), Fault);
        }
        assert_eq!(machine.step(Controlword(0), QUIET), ends, "{steps}");
        assert!(!machine.waits_for_driver());
    }
}

#[test]
fn another_fault_beside_the_gate_driver_s_ends_the_wait() {
    let driver = Events { fault: true, driver_alone: true, ..QUIET };
    let mut machine = in_state(Fault);
    machine.step(Controlword::FAULT_RESET, driver);
    machine.step(Controlword(0), Events { driver_alone: false, ..driver });
    assert!(!machine.waits_for_driver());
    assert_eq!(machine.step(Controlword(0), QUIET), Fault);
}

#[test]
fn a_reset_before_the_fault_waits_for_nothing() {
    let mut machine = enabled();
    machine.step(Controlword::FAULT_RESET, QUIET);
    let driver = Events { fault: true, driver_alone: true, stopped: true, ..QUIET };
    machine.step(Controlword::FAULT_RESET, driver);
    assert_eq!(machine.step(Controlword::FAULT_RESET, driver), Fault);
    assert!(!machine.waits_for_driver());
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
