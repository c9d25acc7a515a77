//! Every limit that is a number, probed from both sides: just below it nothing shows, just above it the fault does,
//! within the time of docs/faults.md. One table of probes, which a new fault and a new limit have to be in.

use crate::probes::{Shows, probed, probes};
use joint_firmware::default_configuration::{B_G431B_ESC1, BOARDS, BoardConfiguration};
use joint_firmware::joint::fault::Fault;

#[test]
fn just_below_a_limit_nothing_shows_and_just_above_it_the_fault_does_within_its_time() {
    let probes = BOARDS.iter().flat_map(|(_, board)| probes(&probed(board)));
    let failed: Vec<String> = probes.filter_map(|probe| probe.run().err()).collect();
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}

/// Returns `true` if a fault begins where a number passes its limit. Exhaustive: a new fault has to be told here, and
/// then has to have a probe.
fn has_a_limit(fault: Fault) -> bool {
    match fault {
        Fault::Overrun | Fault::BridgeDriver => false,
        Fault::OverCurrent
        | Fault::CurrentSensor
        | Fault::CurrentNotFollowed
        | Fault::OverVoltage
        | Fault::UnderVoltage
        | Fault::EncoderLost
        | Fault::EncoderJump
        | Fault::EncoderImplausible
        | Fault::OverSpeed
        | Fault::PositionLimit
        | Fault::BridgeTemperature
        | Fault::WindingTemperature
        | Fault::TemperatureSensor
        | Fault::StaleCommand => true,
    }
}

#[test]
fn every_fault_with_a_limit_has_a_probe() {
    let probes = probes(&probed(&B_G431B_ESC1));
    for fault in Fault::ALL {
        let found = probes.iter().any(|probe| probe.shows == Shows::Fault(fault));
        assert_eq!(found, has_a_limit(fault), "{fault:?}");
    }
}

#[test]
fn every_limit_of_the_configuration_moves_a_probe() {
    let sides = |board: &BoardConfiguration, shows: Shows| -> Vec<(f64, f64)> {
        let probes = probes(board).into_iter().filter(|probe| probe.shows == shows);
        probes.map(|probe| (probe.below, probe.above)).collect()
    };
    for (name, shows, moved) in crate::probes::table::with_each_limit_moved(&B_G431B_ESC1) {
        assert!(sides(&moved, shows) != sides(&probed(&B_G431B_ESC1), shows), "no probe of {name} as {shows:?}");
    }
}
