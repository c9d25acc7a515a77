//! State and faults of a joint: from the numbers of its objects, and in words; host.

use joint_firmware::joint::fault::Fault;
use joint_firmware::joint::state_machine::State;

const STATES: [State; 9] = [
    State::NotReadyToSwitchOn,
    State::SwitchOnDisabled,
    State::ReadyToSwitchOn,
    State::SwitchedOn,
    State::OperationEnabled,
    State::QuickStopActive,
    State::FaultReactionActive,
    State::Fault,
    State::OpenLoop,
];

/// The profile's words for a state.
pub fn name(state: State) -> &'static str {
    match state {
        State::NotReadyToSwitchOn => "not ready to switch on",
        State::SwitchOnDisabled => "disabled (switch on disabled)",
        State::ReadyToSwitchOn => "ready to switch on",
        State::SwitchedOn => "switched on",
        State::OperationEnabled => "enabled (operation enabled)",
        State::QuickStopActive => "braking (quick stop active)",
        State::FaultReactionActive => "braking because of a fault",
        State::Fault => "in a fault",
        State::OpenLoop => "under an open-loop voltage",
    }
}

/// Faults in words, with the code that 603Fh has for each.
pub fn list(faults: &[Fault]) -> String {
    let words = |fault: &Fault| format!("{fault} ({:04X}h)", fault.error_code());
    faults.iter().map(words).collect::<Vec<_>>().join(", ")
}

/// The state in a statusword, object 6041h.
pub fn state_of(statusword: u16) -> State {
    let tells = |state: &State| match state {
        // These say nothing about quick stop.
        State::NotReadyToSwitchOn | State::SwitchOnDisabled | State::FaultReactionActive | State::Fault => {
            statusword & 0x4F == state.statusword() & 0x4F
        }
        _ => statusword & 0x406F == state.statusword(),
    };
    STATES.into_iter().find(tells).unwrap_or_default()
}

/// The state with this number in the steps before a fault.
pub fn state_at(number: u32) -> Option<State> {
    STATES.into_iter().find(|state| *state as u32 == number)
}

/// The faults in object 2021h:4: bit n - 1 for fault n.
pub fn faults_of(bits: u16) -> Vec<Fault> {
    Fault::ALL.into_iter().filter(|fault| bits >> (*fault as u32 - 1) & 1 != 0).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_state_is_told_by_its_statusword_whatever_the_other_bits_are() {
        for state in STATES {
            for others in [0, 0x0210, 0xBF90] {
                assert_eq!(state_of(state.statusword() | others), state);
            }
        }
    }

    #[test]
    fn a_bit_stands_for_each_fault_in_the_order_of_the_documentation() {
        assert_eq!(faults_of(0), []);
        assert_eq!(faults_of(0x2001), [Fault::OverCurrent, Fault::StaleCommand]);
        assert_eq!(faults_of(u16::MAX), Fault::ALL);
        assert_eq!(list(&faults_of(0x2000)), "command deadline missed (8100h)");
    }
}
