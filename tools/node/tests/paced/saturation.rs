//! A bus without room: what is defined in `canopen_node::TransmitQueue` and docs/bus.md.

use crate::master::{FIRST, Line, MILLISECOND, US};
use bus::Frame;
use bus::pacing::Station;
use canopen_node::NmtState;
use joint_firmware::joint::state_machine::State;
use node::{PacedEvent, PacedNodes};
use std::time::Duration;

/// The longest frame: 8 bytes, as many stuff bits as there can be.
const FRAME: Duration = Duration::from_micros(135);

/// Flood by a node that sends without a pause, by an identifier that only NMT, SYNC and EMCYs come before.
struct Flood {
    station: Station,
}

impl Flood {
    const ID: u16 = 0x100;

    fn begin(line: &mut Line) -> Self {
        let station = line.nodes.add_station();
        Self { station }
    }

    /// Time passes at a load of 100 %.
    fn wait(&self, line: &mut Line, time: Duration) {
        let end = line.nodes.now() + time;
        while line.nodes.now() < end {
            while line.nodes.wire().waiting(self.station) < 3 {
                line.nodes.send(self.station, Frame::new(Self::ID, &[0; 8]).unwrap());
            }
            line.wait(100 * US);
        }
    }
}

/// Instants of a node's heartbeats.
fn heartbeats(line: &Line, node: u8) -> Vec<Duration> {
    let of = |id: u16| line.heard.iter().filter(move |heard| heard.frame.id() == id);
    of(0x700 + u16::from(node)).map(|heard| heard.ended).collect()
}

fn longest_pause(instants: &[Duration]) -> Duration {
    instants.windows(2).map(|pair| pair[1] - pair[0]).max().unwrap_or(Duration::MAX)
}

#[test]
fn nmt_stop_on_a_bus_of_100_percent_acts_within_one_frame_time() {
    let mut longest = (Duration::ZERO, Duration::ZERO);
    for offset in 0..20u32 {
        let mut line = Line::new(1);
        line.enable();
        line.driven[0] = Some((15, 500));
        line.wait(300 * MILLISECOND);
        let flood = Flood::begin(&mut line);
        flood.wait(&mut line, 20 * MILLISECOND + 7 * offset * US);
        line.nodes.reset_statistics();
        flood.wait(&mut line, 5 * MILLISECOND);
        assert!(line.nodes.wire().statistics().load(line.nodes.now()) > 0.99);
        assert_eq!(line.telemetry(0).state, State::OperationEnabled);

        let asked = line.nodes.now();
        line.heard.clear();
        line.send(0, &[2, FIRST]);
        let stopped = |nodes: &PacedNodes, event: &PacedEvent| {
            let node = nodes.node(0).unwrap();
            matches!(event, PacedEvent::Stepped(0)) && node.joint().joint().telemetry().state == State::QuickStopActive
        };
        assert!(line.wait_for(5 * MILLISECOND, stopped));
        assert_eq!(line.nodes.node(0).unwrap().state(), NmtState::Stopped);
        let stop = line.heard.iter().find(|heard| heard.frame.id() == 0).unwrap();
        // One frame that had begun, then the command; then at most the interrupt and a control step.
        assert!(stop.started - asked <= FRAME, "{:?}", stop.started - asked);
        let (waited, acted) = (stop.started - asked, line.nodes.now() - stop.ended);
        assert!(acted <= node::REACTION + 50 * US, "{acted:?}");
        longest = (longest.0.max(waited), longest.1.max(acted));
    }
    println!("NMT stop at 100 %: waits {:?} at most, acts {:?} at most after its last bit", longest.0, longest.1);
}

#[test]
fn joints_that_want_twice_the_bus_lose_tpdos_and_count_them_and_heartbeats_and_sdo_survive() {
    let mut line = Line::new(8);
    for node in FIRST..FIRST + 8 {
        line.write(node, 0x1017, 0, &100u16.to_le_bytes());
    }
    line.send(0, &[1, 0]);
    line.wait(200 * MILLISECOND);
    line.heard.clear();
    line.nodes.reset_statistics();
    let before: Vec<(u32, u32)> =
        (0..8).map(|joint| line.nodes.node(joint).unwrap()).map(|node| (node.overwritten(), node.unsent())).collect();
    // Two TPDOs of each joint after every SYNC, 1,000 times a second: 17 frames where there is room for 8.
    for _ in 0..2_000 {
        line.send(0x080, &[]);
        line.wait(MILLISECOND);
    }
    let load = line.nodes.wire().statistics().load(line.nodes.now());
    assert!(load > 0.85, "{load}");
    let (mut worst, mut all) = (Duration::ZERO, 0);
    for (joint, node) in (FIRST..FIRST + 8).enumerate() {
        let pause = longest_pause(&heartbeats(&line, node));
        worst = worst.max(pause);
        // Two for each SYNC, and two that come ten times a second: sent or counted.
        let of = |base: u16| line.heard.iter().filter(move |heard| heard.frame.id() == base + u16::from(node)).count();
        let sent = [0x180, 0x280, 0x380, 0x480].map(of).iter().sum::<usize>();
        let (overwritten, unsent) = before[joint];
        let now = line.nodes.node(joint).unwrap();
        let lost = (now.overwritten() - overwritten) as usize;
        assert!((sent + lost).abs_diff(2 * 2_000 + 2 * 20) <= 12, "joint {joint}: {sent} sent, {lost} overwritten");
        assert_eq!(now.unsent(), unsent);
        all += lost;
    }
    assert!(all > 8 * 1_500, "{all} overwritten");
    println!("8 joints, SYNC at 1 kHz: load {:.1} %, longest pause of a 100 ms heartbeat {worst:?}", 100.0 * load);
    assert!(worst < 250 * MILLISECOND, "{worst:?}");
    // Every SYNC came through, at once: nothing but EMCY and NMT is more urgent.
    assert_eq!(line.heard.iter().filter(|heard| heard.frame.id() == 0x080).count(), 2_000);
    // SDO goes on, too, while SYNCs do.
    let (mut answered, mut asked) = (None, Duration::ZERO);
    for tick in 0..500 {
        line.send(0x080, &[]);
        if tick == 0 {
            asked = line.nodes.now();
            line.send(0x600 + u16::from(FIRST), &[0x40, 0x00, 0x10, 0, 0, 0, 0, 0]);
        }
        line.wait(MILLISECOND);
        let answer =
            line.heard.iter().find(|heard| heard.frame.id() == 0x580 + u16::from(FIRST) && heard.ended > asked);
        answered = answered.or(answer.map(|heard| heard.ended - asked));
    }
    println!("SDO meanwhile answered after {:?}", answered.unwrap());
    assert!(answered.unwrap() < 250 * MILLISECOND);
}

#[test]
fn a_flood_that_no_joint_can_help_stops_the_joints_and_afterwards_everything_is_as_before() {
    let mut line = Line::new(2);
    for node in FIRST..FIRST + 2 {
        line.write(node, 0x1017, 0, &100u16.to_le_bytes());
    }
    line.enable();
    line.driven.fill(Some((15, 500)));
    line.wait(300 * MILLISECOND);
    line.heard.clear();
    // Set-points do not get through: the command deadline (0.1 s) ends, the joints brake by themselves.
    let flood = Flood::begin(&mut line);
    flood.wait(&mut line, 800 * MILLISECOND);
    for joint in 0..2 {
        assert_eq!(line.telemetry(joint).state, State::Fault);
        assert!(line.telemetry(joint).motion.velocity.abs() < 0.05);
        assert!(heartbeats(&line, FIRST + joint as u8).len() <= 1, "they have the lowest priority of all");
    }
    // Frames more urgent than the flood go through: the EMCYs say why.
    assert_eq!(line.emergencies(), [0x8100, 0x8100]);
    // The flood ends: heartbeats are there at once, nothing old comes after them, and the joints can be enabled again.
    line.heard.clear();
    line.wait(150 * MILLISECOND);
    for (joint, id) in (FIRST..FIRST + 2).enumerate() {
        let beats = heartbeats(&line, id);
        assert!((2..=3).contains(&beats.len()), "{beats:?}");
        assert_eq!(line.nodes.node(joint).unwrap().state(), NmtState::Operational);
    }
    for controlword in [0x80, 6, 7, 15] {
        line.driven.fill(Some((controlword, 0)));
        line.wait(30 * MILLISECOND);
    }
    for joint in 0..2 {
        assert_eq!(line.telemetry(joint).state, State::OperationEnabled, "{:04x?}", line.emergencies());
    }
}
