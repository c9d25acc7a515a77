//! Profile position, profile velocity and homing (CiA 402-2), as a master sees them that sends each set-point once;
//! simulated time.

mod driven;
mod master;

use bus::Frame;
use bus::client::Command;
use driven::{ENABLE, position, set32, status, word};
use joint_firmware::joint::state_machine::State;
use master::{ID, Master};
use plant::ActuatorParameters;

const NEW: u16 = 1 << 4;
const AT_ONCE: u16 = 1 << 5;
const RELATIVE: u16 = 1 << 6;
const HALT: u16 = 1 << 8;
const REACHED: i64 = 1 << 10;
const LIMITED: i64 = 1 << 11;
const TAKEN: i64 = 1 << 12;
const ERROR: i64 = 1 << 13;
/// µrad around a target that the joint is said to have reached.
const WINDOW: f64 = 0.01;

const PROFILE_POSITION: i8 = 1;
const PROFILE_VELOCITY: i8 = 3;
const HOMING: i8 = 6;
const VELOCITY: i8 = 9;

fn enabled_as(parameters: ActuatorParameters, mode: i8) -> Master {
    driven::enabled(Master::of(parameters), mode)
}

fn enabled(mode: i8) -> Master {
    enabled_as(ActuatorParameters::reference().aligned().without_payload(), mode)
}

fn speed(master: &Master) -> f64 {
    master.node.joint().actuator().state().joint.velocity
}

/// A set-point with its hand-shake: given, taken, let go of.
fn give(master: &mut Master, target: i32, how: u16) {
    set32(master, 0x607A, target);
    word(master, ENABLE | NEW | how);
    assert_ne!(status(master) & TAKEN, 0, "taken at once");
    word(master, ENABLE);
}

/// Milliseconds until the target is reached, and the greatest speed on the way, rad/s.
fn arrival(master: &mut Master, at_most: u64) -> (u64, f64) {
    let mut fastest = 0.0f64;
    for time in 0..at_most {
        if status(master) & REACHED != 0 {
            return (time, fastest);
        }
        master.wait(1);
        fastest = fastest.max(speed(master).abs());
    }
    panic!("not reached in {at_most} ms: {} µrad, {:#06x}", position(master), status(master));
}

fn is_near(master: &mut Master, target: i32) {
    let off = 1e-6 * f64::from(position(master) - target);
    assert!(off.abs() <= 1.1 * WINDOW, "{off} rad from {target} µrad");
}

#[test]
fn a_set_point_is_taken_followed_along_its_profile_and_reached_without_being_renewed() {
    for (velocity, acceleration, deceleration) in [(500, 2_000, 2_000), (1_000, 4_000, 1_000), (300, 500, 4_000)] {
        let mut master = enabled(PROFILE_POSITION);
        for (index, value) in [(0x6081, velocity), (0x6083, acceleration), (0x6084, deceleration)] {
            set32(&mut master, index, value);
        }
        assert_eq!(status(&mut master) & (REACHED | TAKEN), 0, "nothing is asked for yet");
        let begun = position(&mut master);
        give(&mut master, begun + 1_000_000, 0);
        assert_eq!(status(&mut master) & (REACHED | TAKEN), 0, "on its way, and free for the next one");
        let (time, fastest) = arrival(&mut master, 10_000);
        is_near(&mut master, begun + 1_000_000);
        assert_eq!(master.state(), State::OperationEnabled, "nobody renewed anything");
        // Way, speed and ramps of a trapezoid.
        let [v, a, d] = [velocity, acceleration, deceleration].map(|milli| 1e-3 * f64::from(milli));
        // The trapezoid ends where it is within the window.
        let trapezoid = 1.0 / v + 0.5 * v / a + 0.5 * v / d - (2.0 * WINDOW / d).sqrt();
        let took = 1e-3 * time as f64;
        assert!((0.97 * trapezoid..1.03 * trapezoid + 0.1).contains(&took), "{took} s, not {trapezoid} s");
        assert!((0.9 * v..1.15 * v).contains(&fastest), "{fastest} rad/s, not {v}");
        master.wait(1_000);
        assert_ne!(status(&mut master) & REACHED, 0);
    }
}

#[test]
fn a_second_set_point_waits_and_a_third_is_not_taken() {
    let mut master = enabled(PROFILE_POSITION);
    let begun = position(&mut master);
    give(&mut master, begun + 300_000, 0);
    set32(&mut master, 0x607A, begun - 100_000);
    word(&mut master, ENABLE | NEW);
    word(&mut master, ENABLE);
    assert_ne!(status(&mut master) & TAKEN, 0, "one waits: there is no place");
    set32(&mut master, 0x607A, begun + 900_000);
    word(&mut master, ENABLE | NEW);
    word(&mut master, ENABLE);
    let mut farthest = i32::MIN;
    for _ in 0..4_000 {
        master.wait(1);
        farthest = farthest.max(position(&mut master) - begun);
        if status(&mut master) & (REACHED | TAKEN) == REACHED {
            break;
        }
    }
    assert!((290_000..330_000).contains(&farthest), "the first one was reached, not the third: {farthest} µrad");
    is_near(&mut master, begun - 100_000);
}

#[test]
fn what_was_said_of_the_target_before_does_not_count_for_the_next_one() {
    let mut master = enabled(PROFILE_POSITION);
    let begun = position(&mut master);
    give(&mut master, begun, 0);
    arrival(&mut master, 1_000);
    // Two more, one behind the other, before the task has looked again: it still says that the joint is where it was to
    // go.
    for (word, target) in [(ENABLE | NEW, 300_000), (ENABLE, 0), (ENABLE | NEW, -100_000), (ENABLE, 0)] {
        let data = [&word.to_le_bytes()[..], &[0, 0], &(begun + target).to_le_bytes()].concat();
        master.node.receive(&Frame::new(0x200 + u16::from(ID), &data).unwrap());
    }
    let mut farthest = 0;
    for _ in 0..5_000 {
        master.wait(1);
        farthest = farthest.max(position(&mut master) - begun);
    }
    assert!(farthest > 280_000, "the first of them was left out: {farthest} µrad");
    is_near(&mut master, begun - 100_000);
}

#[test]
fn a_set_point_at_once_replaces_the_one_before_and_the_one_that_waits() {
    let mut master = enabled(PROFILE_POSITION);
    let begun = position(&mut master);
    set32(&mut master, 0x6081, 400);
    give(&mut master, begun + 800_000, 0);
    set32(&mut master, 0x607A, begun + 900_000);
    word(&mut master, ENABLE | NEW);
    word(&mut master, ENABLE);
    master.wait(500);
    give(&mut master, begun - 200_000, AT_ONCE);
    assert_eq!(status(&mut master) & TAKEN, 0, "none waits any more");
    let mut farthest = 0;
    while status(&mut master) & REACHED == 0 {
        master.wait(1);
        farthest = farthest.max(position(&mut master) - begun);
    }
    assert!(farthest < 400_000, "{farthest} µrad");
    is_near(&mut master, begun - 200_000);
}

#[test]
fn relative_set_points_count_from_the_one_before_and_the_first_from_where_the_joint_is() {
    let mut master = enabled(PROFILE_POSITION);
    let begun = position(&mut master);
    give(&mut master, 150_000, RELATIVE);
    // Behind the one before.
    set32(&mut master, 0x607A, -50_000);
    word(&mut master, ENABLE | NEW | RELATIVE);
    word(&mut master, ENABLE);
    while status(&mut master) & TAKEN != 0 {
        master.wait(1);
    }
    arrival(&mut master, 5_000);
    is_near(&mut master, begun + 100_000);
    give(&mut master, 100_000, RELATIVE | AT_ONCE);
    arrival(&mut master, 5_000);
    is_near(&mut master, begun + 200_000);
}

#[test]
fn the_edge_counts_and_what_enables_the_joint_is_none() {
    let mut master = Master::new();
    master.command(Command::Start);
    master.download(0x6060, 0, &[1]).unwrap();
    let begun = position(&mut master);
    set32(&mut master, 0x607A, begun + 500_000);
    for step in [0x06, 0x07, ENABLE | NEW, ENABLE | NEW] {
        word(&mut master, step);
        master.wait(300);
    }
    assert_eq!(master.state(), State::OperationEnabled);
    assert!((position(&mut master) - begun).abs() < 1_000);
    assert_eq!(status(&mut master) & (REACHED | TAKEN), 0);
    // Another mode and back: what was asked for counts no more.
    word(&mut master, ENABLE);
    give(&mut master, begun + 100_000, 0);
    for mode in [0, 1] {
        master.download(0x6060, 0, &[mode]).unwrap();
    }
    let there = position(&mut master);
    master.wait(1_000);
    assert!((position(&mut master) - there).abs() < 20_000, "it stays where the mode was changed");
}

#[test]
fn halt_stops_the_joint_on_its_way_and_its_release_goes_on() {
    let mut master = enabled(PROFILE_POSITION);
    let begun = position(&mut master);
    set32(&mut master, 0x6081, 500);
    give(&mut master, begun + 600_000, 0);
    master.wait(400);
    word(&mut master, ENABLE | HALT);
    master.wait(600);
    let halted = position(&mut master);
    assert_ne!(status(&mut master) & REACHED, 0, "it stands");
    master.wait(1_000);
    assert!((position(&mut master) - halted).abs() < 1_000 && halted < begun + 500_000);
    word(&mut master, ENABLE);
    assert_eq!(status(&mut master) & REACHED, 0);
    arrival(&mut master, 5_000);
    is_near(&mut master, begun + 600_000);
}

#[test]
fn a_master_whose_heartbeat_is_lost_stops_the_joint_on_its_way() {
    for lost in [false, true] {
        let mut master = enabled(PROFILE_POSITION);
        let begun = position(&mut master);
        set32(&mut master, 0x6081, 500);
        // The master is node 126, and beats at least every 200 ms.
        master.download(0x1016, 1, &(0x007E_0000u32 | 200).to_le_bytes()).unwrap();
        master.send(0x77E, &[5]);
        give(&mut master, begun + 1_000_000, 0);
        for _ in 0..40 {
            master.wait(100);
            if !lost {
                master.send(0x77E, &[5]);
            }
        }
        let way = position(&mut master) - begun;
        if lost {
            assert!((20_000..400_000).contains(&way), "{way} µrad");
            assert!(speed(&master).abs() < 1e-3 && master.state() != State::OperationEnabled);
        } else {
            is_near(&mut master, begun + 1_000_000);
        }
    }
}

#[test]
fn a_target_beyond_a_limit_is_clipped_and_shown() {
    let mut master = enabled(PROFILE_POSITION);
    let highest = master.number(0x607D, 2) as i32;
    give(&mut master, highest + 200_000, 0);
    master.wait(15_000);
    let short = 1e-6 * f64::from(highest - position(&mut master));
    assert!(short.abs() < 2.0 * WINDOW, "{short} rad from the limit");
    assert_eq!(status(&mut master) & (REACHED | LIMITED), REACHED | LIMITED);
    give(&mut master, highest - 200_000, 0);
    arrival(&mut master, 5_000);
    assert_eq!(status(&mut master) & LIMITED, 0);
}

#[test]
fn a_following_error_is_shown_from_its_window_and_after_its_time_on() {
    // A load that the joint cannot bear with the torque that it is permitted.
    let mut master = enabled_as(ActuatorParameters::reference().aligned(), PROFILE_POSITION);
    master.download(0x6066, 0, &200u16.to_le_bytes()).unwrap();
    let begun = position(&mut master);
    give(&mut master, begun + 400_000, 0);
    arrival(&mut master, 5_000);
    let missing = (master.number(0x60F4, 0) as i32).unsigned_abs();
    for (window, shown) in [(missing + 20_000, false), (0, true)] {
        master.download(0x6065, 0, &window.to_le_bytes()).unwrap();
        master.wait(150);
        assert_eq!(status(&mut master) & ERROR, 0, "not yet");
        master.wait(100);
        assert_eq!(status(&mut master) & ERROR != 0, shown, "{window} µrad of {missing}");
    }
    assert_eq!(master.state(), State::OperationEnabled, "it is no fault");
}

#[test]
fn a_profile_velocity_is_reached_along_its_ramp_and_has_to_be_renewed() {
    let mut master = enabled(PROFILE_VELOCITY);
    set32(&mut master, 0x6083, 1_000);
    set32(&mut master, 0x6084, 2_000);
    let drive = |master: &mut Master, velocity: i32, milliseconds: u64| {
        for _ in 0..milliseconds / 10 {
            let data = [&ENABLE.to_le_bytes()[..], &[3], &velocity.to_le_bytes()].concat();
            master.send(0x300 + u16::from(ID), &data);
            master.wait(10);
        }
    };
    drive(&mut master, 0, 100);
    assert_eq!(status(&mut master) & (TAKEN | REACHED), TAKEN | REACHED, "it stands, as it should");
    drive(&mut master, 600, 300);
    assert!((speed(&master) - 0.3).abs() < 0.08, "{} rad/s after 0.3 s at 1 rad/s²", speed(&master));
    assert_eq!(status(&mut master) & (TAKEN | REACHED), 0);
    drive(&mut master, 600, 700);
    assert!((speed(&master) - 0.6).abs() < 0.05, "{} rad/s", speed(&master));
    assert_eq!(status(&mut master) & (TAKEN | REACHED), REACHED);
    // Slower by the other ramp.
    drive(&mut master, 0, 150);
    assert!((speed(&master) - 0.3).abs() < 0.08, "{} rad/s after 0.15 s at 2 rad/s²", speed(&master));
    drive(&mut master, 0, 500);
    assert_eq!(status(&mut master) & (TAKEN | REACHED), TAKEN | REACHED);
    master.wait(90);
    assert_eq!(master.state(), State::OperationEnabled);
    master.wait(200);
    assert_eq!(master.state(), State::Fault, "a velocity that nobody renews is late");
}

#[test]
fn a_velocity_beyond_the_limit_is_clipped_and_shown_in_both_modes_just_above_it_alone() {
    for (mode, offset) in [(PROFILE_VELOCITY, 0), (VELOCITY, 0), (VELOCITY, 200)] {
        let mut master = enabled(mode);
        let limit = master.number(0x607F, 0) as i32;
        set32(&mut master, 0x60B1, offset);
        for (beyond, shown) in [(-1, 0), (1, LIMITED)] {
            for _ in 0..3 {
                let data =
                    [&ENABLE.to_le_bytes()[..], &[mode as u8], &(limit - offset + beyond).to_le_bytes()].concat();
                master.send(0x300 + u16::from(ID), &data);
                master.wait(5);
            }
            assert_eq!(status(&mut master) & LIMITED, shown, "mode {mode}, offset {offset}, {beyond} mrad/s beyond");
        }
    }
}

#[test]
fn the_demand_is_where_the_joint_is_unless_a_position_is_asked_for() {
    for mode in [0, 1, 3, 6, 8, 9, 10, -1] {
        let mut master = enabled(mode);
        for _ in 0..30 {
            master.node.advance(1);
            let (demand, error) = (master.number(0x6062, 0) as i32, master.number(0x60F4, 0) as i32);
            assert!((demand - position(&mut master)).abs() < 300 && error.abs() < 300, "mode {mode}: {demand} {error}");
        }
        word(&mut master, 0);
        master.wait(200);
        assert_eq!(master.number(0x60F4, 0) as i32, 0);
    }
}

/// Homes by a method; the bits of the statusword at the end.
fn home(master: &mut Master, method: i8, offset: i32) -> i64 {
    word(master, ENABLE);
    master.download(0x6098, 0, &method.to_le_bytes()).unwrap();
    set32(master, 0x607C, offset);
    master.wait(300);
    assert_eq!(status(master) & (REACHED | TAKEN | ERROR) & !TAKEN & !ERROR, REACHED, "nothing under way");
    word(master, ENABLE | NEW);
    for _ in 0..20_000 {
        master.wait(1);
        let bits = status(master) & (REACHED | TAKEN | ERROR);
        if bits & (TAKEN | ERROR) != 0 && bits & REACHED != 0 {
            return bits;
        }
    }
    panic!("homing by {method} does not end");
}

#[test]
fn homing_where_the_joint_is_moves_nothing_and_calls_it_the_home_offset() {
    // With a load that it has to bear all the while.
    let mut master = enabled_as(ActuatorParameters::reference().aligned(), HOMING);
    master.wait(500);
    for (method, offset) in [(35, 0), (37, 250_000), (37, -1_000_000), (0, 7)] {
        let before = (position(&mut master), master.node.joint().actuator().state().joint.position);
        assert_eq!(home(&mut master, method, offset), REACHED | TAKEN);
        let expected = if method == 0 { before.0 } else { offset };
        assert!((position(&mut master) - expected).abs() < 300, "{} µrad, not {expected}", position(&mut master));
        let moved = master.node.joint().actuator().state().joint.position - before.1;
        assert!(moved.abs() < 3e-4, "{moved} rad by method {method}");
    }
    // It goes by the new zero from here on.
    master.download(0x6060, 0, &[1]).unwrap();
    word(&mut master, ENABLE);
    give(&mut master, -900_000, 0);
    arrival(&mut master, 5_000);
    is_near(&mut master, -900_000);
}

#[test]
fn homing_to_an_index_goes_to_the_next_one_below_or_above() {
    let parameters = ActuatorParameters::reference().aligned().without_payload();
    let turn = std::f64::consts::TAU / parameters.joint.motor.gear_ratio.abs();
    let mut master = enabled_as(parameters, HOMING);
    let truth = |master: &Master| master.node.joint().actuator().state().joint.position;
    let mut last = None;
    for (method, direction) in [(34, 1.0), (33, -1.0), (33, -1.0), (34, 1.0)] {
        // From somewhere between two of them.
        master.download(0x6060, 0, &[1]).unwrap();
        word(&mut master, ENABLE);
        give(&mut master, (0.4e6 * turn) as i32, RELATIVE);
        arrival(&mut master, 5_000);
        word(&mut master, ENABLE);
        master.download(0x6060, 0, &[6]).unwrap();
        let begun = truth(&master);
        assert_eq!(home(&mut master, method, 100_000), REACHED | TAKEN);
        // The index has the home offset, wherever the joint has come to a stop beside it.
        let index = truth(&master) - 1e-6 * f64::from(position(&mut master) - 100_000);
        let way = direction * (index - begun);
        assert!(way > 0.0 && way < 1.01 * turn, "{way} rad of {turn}");
        assert!((truth(&master) - index).abs() < 1.1 * WINDOW, "{} rad from it", truth(&master) - index);
        if let Some(last) = last.replace(index) {
            let turns: f64 = (index - last) / turn;
            assert!((turns - turns.round()).abs() < 0.01, "an index is {turns} turns from another one");
        }
    }
}

#[test]
fn a_zero_that_would_leave_the_joint_beyond_its_limits_is_refused_and_changes_nothing() {
    let mut master = enabled(HOMING);
    let highest = master.number(0x607D, 2) as i32;
    let before = (position(&mut master), master.upload(0x2102, 2));
    for (offset, bits) in [(highest + 1_000, REACHED | ERROR), (highest - 1_000, REACHED | TAKEN)] {
        assert_eq!(home(&mut master, 37, offset), bits);
        if bits & ERROR != 0 {
            assert!((position(&mut master) - before.0).abs() < 300);
            assert_eq!(master.upload(0x2102, 2), before.1);
        }
    }
    assert_eq!(master.state(), State::OperationEnabled);
}

#[test]
fn homing_begins_with_the_edge_of_its_start_and_what_enables_the_joint_or_changes_the_mode_is_none() {
    for (mode, words) in [(HOMING, [0x06, 0x07, ENABLE | NEW]), (VELOCITY, [0x06, 0x07, ENABLE])] {
        let mut master = Master::new();
        master.command(Command::Start);
        master.download(0x6098, 0, &[37]).unwrap();
        set32(&mut master, 0x607C, 250_000);
        master.download(0x6060, 0, &mode.to_le_bytes()).unwrap();
        for step in words {
            word(&mut master, step);
            master.wait(20);
        }
        // Into the mode with the bit set.
        word(&mut master, ENABLE | NEW);
        master.download(0x6060, 0, &HOMING.to_le_bytes()).unwrap();
        let zero = master.upload(0x2102, 2);
        master.wait(500);
        assert_eq!(master.state(), State::OperationEnabled);
        assert_eq!(status(&mut master) & (REACHED | TAKEN | ERROR), REACHED, "from mode {mode}: not begun");
        assert_eq!(master.upload(0x2102, 2), zero);
        word(&mut master, ENABLE);
        master.wait(5);
        word(&mut master, ENABLE | NEW);
        master.wait(100);
        assert_eq!(status(&mut master) & (REACHED | TAKEN | ERROR), REACHED | TAKEN, "from mode {mode}");
        assert_ne!(master.upload(0x2102, 2), zero);
    }
}

#[test]
fn homing_ends_where_its_start_is_taken_back_or_operation_ends() {
    for end in [ENABLE, 0x06, 0x02] {
        let mut master = enabled(HOMING);
        let before = master.upload(0x2102, 2);
        set32(&mut master, 0x609A, 200);
        master.download(0x6098, 0, &[34]).unwrap();
        master.wait(5);
        word(&mut master, ENABLE | NEW);
        master.wait(60);
        assert_eq!(status(&mut master) & (TAKEN | ERROR | REACHED), 0, "under way");
        word(&mut master, end);
        master.wait(1_000);
        assert!(speed(&master).abs() < 1e-3);
        assert_eq!(status(&mut master) & (TAKEN | ERROR), 0);
        assert_eq!(master.upload(0x2102, 2), before);
    }
}

#[test]
fn a_zero_that_was_found_is_stored_with_the_configuration() {
    let mut master = enabled(HOMING);
    assert_eq!(home(&mut master, 37, 300_000), REACHED | TAKEN);
    let zero = master.upload(0x2102, 2);
    word(&mut master, 0);
    master.wait(100);
    master.download(0x1010, 1, b"save").unwrap();
    let mut again = Master::powered(master.node.storage());
    assert_eq!(again.upload(0x2102, 2), zero);
}

#[test]
fn the_largest_torque_holds_in_every_mode_and_stays_through_a_transition() {
    let mut master = enabled(PROFILE_VELOCITY);
    for (permille, clipped) in [(50u16, true), (1_000, false)] {
        master.download(0x6072, 0, &permille.to_le_bytes()).unwrap();
        for command in [Command::EnterPreOperational, Command::Start] {
            master.command(command);
        }
        assert_eq!(master.number(0x6072, 0), i64::from(permille));
        for step in [0x06, 0x07, ENABLE] {
            word(&mut master, step);
            master.wait(5);
        }
        let mut largest = 0;
        for _ in 0..40 {
            let data = [&ENABLE.to_le_bytes()[..], &[3], &1_500i32.to_le_bytes()].concat();
            master.send(0x300 + u16::from(ID), &data);
            master.wait(5);
            largest = largest.max((master.number(0x6074, 0) as i16).abs());
        }
        assert_eq!(largest <= 51, clipped, "{largest} permille of {permille}");
        word(&mut master, 0);
        master.wait(200);
    }
}

#[test]
fn a_value_that_would_never_let_the_joint_stop_is_refused() {
    let mut master = Master::new();
    for (index, sub_index) in [(0x6083, 0), (0x6084, 0), (0x609A, 0), (0x6099, 1), (0x6099, 2)] {
        assert!(master.download(index, sub_index, &0u32.to_le_bytes()).is_err(), "{index:04x}h:{sub_index}");
        master.download(index, sub_index, &1u32.to_le_bytes()).unwrap();
    }
    for method in [-1i8, 1, 17, 32, 36, 38] {
        assert!(master.download(0x6098, 0, &method.to_le_bytes()).is_err(), "method {method}");
    }
}

#[test]
fn a_start_of_homing_takes_back_at_once_what_was_said_of_the_one_before() {
    let mut master = enabled(HOMING);
    assert_eq!(home(&mut master, 37, 0), REACHED | TAKEN);
    // Word of TPDO 1, with no time for the task between: it knows of the homing before alone.
    let told = |master: &mut Master, word: u16| {
        master.listen();
        master.heard.clear();
        let data = [&word.to_le_bytes()[..], &[0; 6]].concat();
        for (id, data) in [(0x200 + u16::from(ID), &data[..]), (0x080, &[])] {
            master.node.receive(&Frame::new(id, data).unwrap());
        }
        master.listen();
        let tpdo = master.heard.iter().find(|frame| frame.id() == 0x180 + u16::from(ID)).unwrap();
        i64::from(u16::from_le_bytes([tpdo.data()[0], tpdo.data()[1]])) & (REACHED | TAKEN | ERROR)
    };
    assert_eq!(told(&mut master, ENABLE | NEW), REACHED | TAKEN, "homing goes on being done");
    word(&mut master, ENABLE);
    master.wait(5);
    assert_eq!(told(&mut master, ENABLE | NEW), 0, "another one begins");
}
