//! Set-points of the cyclic modes and of impedance mode beyond a limit: clipped, and shown by bit 11 of the statusword;
//! simulated time.

mod driven;
mod master;

use driven::{ENABLE, position, set32, status, word};
use joint_firmware::joint::{Command as Asked, Mode};
use joint_firmware::objects::impedance_frame;
use master::Master;

const LIMITED: i64 = 1 << 11;
/// The target is followed.
const TAKEN: i64 = 1 << 12;

fn enabled(mode: i8) -> Master {
    driven::enabled(Master::new(), mode)
}

#[test]
fn a_position_beyond_the_range_is_shown_in_cyclic_position_mode_just_above_it_alone() {
    let mut master = enabled(8);
    let [lowest, highest] = [1, 2].map(|sub_index| master.number(0x607D, sub_index) as i32);
    for offset in [0, 200_000] {
        set32(&mut master, 0x60B0, offset);
        for (target, shown) in
            [(highest - 10, 0), (highest + 10, LIMITED), (lowest + 10, 0), (lowest - 10, LIMITED), (i32::MAX, LIMITED)]
        {
            set32(&mut master, 0x607A, target.saturating_sub(offset));
            master.wait(3);
            assert_eq!(status(&mut master) & LIMITED, shown, "{target} µrad, offset {offset}");
        }
    }
    // It goes no farther than to the limit.
    for _ in 0..1_000 {
        set32(&mut master, 0x607A, highest + 300_000);
        master.wait(10);
    }
    let short = 1e-6 * f64::from(highest - position(&mut master));
    assert!(short.abs() < 0.02 && status(&mut master) & LIMITED != 0, "{short} rad from the limit");
}

#[test]
fn a_torque_beyond_the_limit_or_6072h_is_shown_in_cyclic_torque_mode_just_above_it_alone() {
    let mut master = enabled(10);
    // Largest torque, target and offset, permille.
    for (most, target, offset, shown) in [
        (1_000u16, 1_000i16, 0i16, 0),
        (1_000, 1_001, 0, LIMITED),
        (1_000, -1_000, 0, 0),
        (1_000, -1_001, 0, LIMITED),
        (2_000, 1_001, 0, LIMITED),
        (300, 300, 0, 0),
        (300, 301, 0, LIMITED),
        (300, -301, 0, LIMITED),
        (300, 250, 50, 0),
        (300, 250, 51, LIMITED),
        (300, i16::MIN, 0, LIMITED),
    ] {
        master.download(0x6072, 0, &most.to_le_bytes()).unwrap();
        master.download(0x60B2, 0, &offset.to_le_bytes()).unwrap();
        master.download(0x6071, 0, &target.to_le_bytes()).unwrap();
        master.wait(2);
        let bits = status(&mut master) & (LIMITED | TAKEN);
        assert_eq!(bits, shown | TAKEN, "{target} and {offset} of {most} permille");
    }
}

#[test]
fn an_impedance_command_beyond_a_limit_is_shown_where_its_gains_count_it() {
    let mut master = enabled(-1);
    let highest = 1e-6 * master.number(0x607D, 2) as f32;
    let speed = 1e-3 * master.number(0x607F, 0) as f32;
    let rated = 1e-3 * master.number(0x6076, 0) as f32;
    let ranges = [2.0 * highest, 2.0 * speed, 1_000.0, 100.0, 2.0 * rated];
    word(&mut master, 0);
    master.wait(100);
    for (sub_index, range) in (1..).zip(ranges) {
        master.download(0x2012, sub_index, &range.to_le_bytes()).unwrap();
    }
    for step in [0x06, 0x07, ENABLE] {
        word(&mut master, step);
        master.wait(5);
    }
    let shown = |master: &mut Master, command: Asked| {
        let frame = impedance_frame(&Asked { mode: Mode::Impedance, ..command }, ranges);
        master.download(0x2011, 1, &frame.to_le_bytes()).unwrap();
        master.wait(2);
        assert_ne!(status(master) & TAKEN, 0, "{command:?}");
        status(master) & LIMITED != 0
    };
    let none = Asked::NOTHING;
    for (factor, expected) in [(0.998, false), (1.002, true)] {
        let [position, velocity, torque] = [highest, speed, rated].map(|limit| factor * limit);
        for command in [
            Asked { position, stiffness: 5.0, ..none },
            Asked { velocity, damping: 1.0, ..none },
            Asked { velocity: -velocity, damping: 1.0, ..none },
            Asked { torque, ..none },
            Asked { torque: -torque, ..none },
        ] {
            assert_eq!(shown(&mut master, command), expected, "{command:?}");
            let nothing = Asked { stiffness: 0.0, damping: 0.0, ..command };
            assert_eq!(shown(&mut master, nothing), expected && command.torque != 0.0, "{nothing:?}");
        }
    }
    master.download(0x6072, 0, &300u16.to_le_bytes()).unwrap();
    for (part, expected) in [(0.298, false), (0.302, true)] {
        assert_eq!(shown(&mut master, Asked { torque: part * rated, ..none }), expected, "{part}");
    }
}
