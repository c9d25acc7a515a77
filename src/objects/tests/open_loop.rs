//! Objects 2107h and 2108h: a voltage is commanded, and a window of means is read.

use super::*;
use crate::joint::Mode;
use crate::joint::state_machine::State;
use crate::motor::open_loop::Frame;
use crate::motor::transform::Dq;

const DEVICE_STATE: u32 = 0x0800_0022;

fn window(number: u32) -> Window {
    let value = number as f32;
    let pair = |at: f32| Dq { d: value + at, q: value + at + 0.25 };
    Window {
        number,
        current: pair(0.0),
        voltage: pair(10.0),
        in_phase: pair(20.0),
        quadrature: pair(30.0),
        alternating: pair(40.0),
        bus_voltage: 24.0,
        encoder: 0x1234_5678,
        field: 0x9abc_def0,
        referenced: true,
    }
}

#[test]
fn a_frame_is_taken_whole_in_its_mode_and_each_one_renews_the_deadline() {
    let mut node = Node::operational();
    let frame = Frame { voltage: 1_500, speed: -200, along: 30, across: 40 };
    node.download(0x6060, 0, &[0xFE]).unwrap();
    assert_eq!(node.upload(0x6061, 0), Ok(vec![0xFE]));
    node.download(0x2107, 1, &frame.to_bits().to_le_bytes()).unwrap();
    let first = node.image.demand();
    assert_eq!((first.command.mode, first.command.open_loop), (Mode::OpenLoop, frame));
    assert_eq!(node.upload(0x2107, 1), Ok(frame.to_bits().to_le_bytes().to_vec()));
    node.download(0x2107, 1, &frame.to_bits().to_le_bytes()).unwrap();
    assert_ne!(node.image.demand().sequence, first.sequence);
    // In every other mode it means nothing.
    for mode in [8, 9, 10, 0xFF] {
        node.download(0x6060, 0, &[mode]).unwrap();
        assert_eq!(node.image.demand().command.open_loop, Frame::default(), "{mode}");
    }
}

#[test]
fn outside_operational_no_voltage_is_asked_for() {
    let mut node = Node::operational();
    let frame = Frame { voltage: 1_500, ..Frame::default() };
    node.download(0x6060, 0, &[0xFE]).unwrap();
    node.download(0x2107, 1, &frame.to_bits().to_le_bytes()).unwrap();
    node.receive(0, &[0x80, NODE]);
    assert_eq!(node.image.demand().command, crate::joint::Command::default());
    assert_eq!(node.download(0x2107, 1, &frame.to_bits().to_le_bytes()), Err(DEVICE_STATE));
    node.receive(0, &[1, NODE]);
    assert_eq!(node.image.demand().command.open_loop, Frame::default());
}

#[test]
fn the_number_holds_the_window_that_the_rest_is_read_of() {
    let mut node = Node::operational();
    assert_eq!(node.number(0x2108, 1), 0);
    for sub_index in (2..=11).chain([14]) {
        assert_eq!(node.real(0x2108, sub_index), 0.0, "before the first window, sub-index {sub_index}");
    }
    node.objects.program().window = window(7);
    assert_eq!(node.real(0x2108, 2), 0.0, "nothing before the number is read");
    assert_eq!(node.number(0x2108, 1), 7);
    node.objects.program().window = window(8);
    let reals: Vec<f32> = (2..=11).map(|sub_index| node.real(0x2108, sub_index)).collect();
    let expected = [7.0, 7.25, 17.0, 17.25, 27.0, 37.0, 27.25, 37.25, 47.0, 47.25];
    assert_eq!(reals, expected);
    assert_eq!((node.number(0x2108, 12), node.number(0x2108, 13)), (0x1234_5678, 0x9abc_def0));
    assert_eq!((node.real(0x2108, 14), node.number(0x2108, 15)), (24.0, 1));
    assert_eq!((node.number(0x2108, 16), node.number(0x2101, 11)), (20_000, 1));
    assert_eq!((node.number(0x2108, 1), node.real(0x2108, 2)), (8, 8.0));
}

#[test]
fn while_it_applies_nothing_is_configured_or_stored() {
    let mut node = Node::with(None, true);
    node.observed.telemetry.state = State::OpenLoop;
    node.task();
    assert_eq!(node.download(0x2100, 1, &[1]), Err(DEVICE_STATE));
    assert_eq!(node.download(0x1010, 1, b"save"), Err(DEVICE_STATE));
    assert_eq!(node.number(0x6041, 0) & 0x406F, 0x4027);
}
