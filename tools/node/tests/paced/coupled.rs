//! Two joints that share a drive: one hears the other's velocity, and its friction model chooses its parameter set by
//! it (paper 003, section II.C).

use crate::master::{FIRST, Line, MILLISECOND};
use friction_compensation::friction::regime::{Criterion, Measure, Selector};
use joint_firmware::joint::state_machine::State;
use node::SampleImage;

/// Compensation of the second joint while it is slower than its neighbour, and while it is faster, Nm.
const FOLLOWING: f64 = 0.25;
const LEADING: f64 = 0.5;
/// Half of the band within which nothing changes, rad/s.
const BAND: i32 = 1 << 16 >> 4;

/// Joint A, node 1, tells its velocity; joint B, node 2, listens.
fn coupled() -> Line {
    let mut line = Line::new(2);
    let listening = FIRST + 1;
    let coupled = Criterion { measure: Measure::Coupled, enter: BAND, leave: -BAND };
    // 20 ms.
    let selector = Selector { criteria: [Some(coupled), None], fade_time: 1_311 };
    let image = SampleImage { version: 1, levels: &[FOLLOWING, LEADING], selector, network: false, golden: 1 }.bytes();
    line.write(listening, 0x2210, 0, &image);
    for command in [1, 3] {
        line.write(listening, 0x2212, 1, &[command]);
    }
    line.write(listening, 0x2200, 3, &1f32.to_le_bytes());
    line.write(listening, 0x2200, 1, &[1]);
    // RPDO 4 takes A's TPDO 2.
    line.write(listening, 0x1403, 1, &(0x280 + u32::from(FIRST)).to_le_bytes());
    line.enable();
    line
}

/// Drives both, mrad/s, and says what B's compensation has become.
fn driven(line: &mut Line, a: i32, b: i32) -> f32 {
    for (joint, velocity) in line.driven.iter_mut().zip([a, b]) {
        *joint = Some((15, velocity));
    }
    line.wait(600 * MILLISECOND);
    for joint in 0..2 {
        assert_eq!(line.telemetry(joint).state, State::OperationEnabled, "{:04x?}", line.emergencies());
    }
    line.telemetry(1).compensated.torque
}

fn is(torque: f32, level: f64) -> bool {
    (f64::from(torque) - level).abs() < 1e-3
}

#[test]
fn the_set_follows_the_neighbours_velocity_with_the_band_of_the_selector() {
    let mut line = coupled();
    let torque = driven(&mut line, 600, 300);
    assert!(is(torque, FOLLOWING), "{torque} Nm");
    // Faster, but within the band: nothing changes.
    driven(&mut line, 330, 300);
    let torque = driven(&mut line, 300, 330);
    assert!(is(torque, FOLLOWING), "{torque} Nm");
    let torque = driven(&mut line, 200, 400);
    assert!(is(torque, LEADING), "{torque} Nm");
    // Slower, but within the band; the other direction counts as much.
    let torque = driven(&mut line, -430, 400);
    assert!(is(torque, LEADING), "{torque} Nm");
    let torque = driven(&mut line, -600, 400);
    assert!(is(torque, FOLLOWING), "{torque} Nm");
}

#[test]
fn a_neighbour_that_falls_silent_counts_as_standing_after_the_command_deadline() {
    let mut line = coupled();
    assert!(is(driven(&mut line, 600, 300), FOLLOWING));
    // A is stopped: no TPDO any more. B goes on.
    line.driven[0] = None;
    line.send(0, &[2, FIRST]);
    line.wait(50 * MILLISECOND);
    let torque = line.telemetry(1).compensated.torque;
    assert!(is(torque, FOLLOWING), "{torque} Nm: what was heard last still counts");
    // The command deadline is 0.1 s, the fade 20 ms.
    line.wait(90 * MILLISECOND);
    let torque = line.telemetry(1).compensated.torque;
    assert!(is(torque, LEADING), "{torque} Nm");
    assert_eq!(line.telemetry(1).state, State::OperationEnabled);
    // It is heard again.
    line.send(0, &[1, FIRST]);
    for controlword in [6, 7, 15] {
        line.driven[0] = Some((controlword, 0));
        line.wait(30 * MILLISECOND);
    }
    assert!(is(driven(&mut line, 600, 300), FOLLOWING));
}
