//! An image of a kibibyte goes to a joint that moves, by block at 1 Mbit/s, and acts: how long that takes, and that no
//! control step notices.

use crate::master::{FIRST, Line, MILLISECOND};
use bus::client::Object;
use bus::client::sdo::{Method, Settings, Transfer};
use friction_compensation::friction::regime::{Criterion, Measure, Selector};
use joint_firmware::joint::state_machine::State;
use node::{PacedEvent, SampleImage};
use std::time::Duration;

/// Time that a Cortex-M4 at 170 MHz needs to verify the most expensive image: at most 21 million instructions
/// (docs/cost.md, `host-tests/tests/on_the_core/library.rs`), one a cycle.
const VERIFICATION: Duration = Duration::from_millis(124);

/// Two parameter sets with networks: 1,036 bytes.
fn kibibyte() -> Vec<u8> {
    let fast = Criterion { measure: Measure::Speed, enter: 10 << 16, leave: 9 << 16 };
    let selector = Selector { criteria: [Some(fast), None], fade_time: 0 };
    SampleImage { version: 1, levels: &[0.5, 0.25], selector, network: true, golden: 2 }.bytes()
}

#[test]
fn a_kibibyte_takes_30_ms_by_block_and_acts_150_ms_after_its_last_byte_without_a_control_step_missed() {
    let image = kibibyte();
    assert!(image.len() >= 1_024);
    let mut line = Line::new(1);
    line.write(FIRST, 0x2200, 3, &1f32.to_le_bytes());
    line.write(FIRST, 0x2200, 1, &[2]);
    line.write(FIRST, 0x2212, 7, &60_000u32.to_le_bytes());
    line.enable();
    line.driven[0] = Some((15, 500));
    line.wait(600 * MILLISECOND);
    let (steps, began) = (line.nodes.node(0).unwrap().steps(), line.nodes.now());

    let object = Object { node: FIRST, index: 0x2210, sub_index: 0 };
    let (outcome, took) = line.transfer(FIRST, Transfer::download(object, &image, Method::Block, Settings::default()));
    outcome.unwrap();
    let last_byte = line.heard.iter().rev().filter(|heard| heard.frame.id() == 0x600 + u16::from(FIRST)).nth(1);
    let last_byte = last_byte.unwrap().ended;

    // Verified and tried in RAM, flash excluded. The task is busy for as long as verification takes; control steps go
    // on.
    line.nodes.node_mut(0).unwrap().occupy(VERIFICATION);
    line.write(FIRST, 0x2212, 1, &[1]);
    line.write(FIRST, 0x2212, 1, &[2]);
    let active = line.nodes.now() - last_byte;
    assert_eq!(line.number(FIRST, 0x2212, 2), 4);
    let acts = |nodes: &node::PacedNodes, _: &PacedEvent| {
        nodes.node(0).unwrap().joint().joint().telemetry().compensated.torque > 0.499
    };
    assert!(line.wait_for(500 * MILLISECOND, acts), "it ramps up within the slew limit");

    // A step every 50 us, to the last one; the joint moved as it was asked to, and nothing was lost.
    let elapsed = (line.nodes.now() - began).as_nanos() / 50_000;
    let done = line.nodes.node(0).unwrap().steps() - steps;
    assert!(u128::from(done).abs_diff(elapsed) <= 1, "{done} steps in {elapsed} periods");
    let telemetry = line.telemetry(0);
    assert_eq!(telemetry.state, State::OperationEnabled, "{:04x?}", line.emergencies());
    assert!((0.48..0.52).contains(&telemetry.motion.velocity), "{} rad/s", telemetry.motion.velocity);
    let node = line.nodes.node(0).unwrap();
    assert_eq!((node.dropped(), node.unsent(), node.overwritten()), (0, 0, 0));
    println!(
        "{} bytes by block: {took:?}; active {active:?} after the last byte, {VERIFICATION:?} of it verification",
        image.len()
    );
    assert!(took <= 30 * MILLISECOND, "{took:?}");
    assert!(active >= VERIFICATION && active <= 150 * MILLISECOND, "{active:?}");
}
