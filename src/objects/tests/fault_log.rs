//! The log of faults: what reaches it, how fast, and how it is read.

use super::*;
use crate::joint::fault::{Fault, Faults};
use crate::objects::fault_log::decode;
use friction_compensation::parameters::fault_log::LOGGED;

const MINUTE: u64 = 60_000;

impl Node {
    /// Time goes on, to so many milliseconds after the start, with these faults latched.
    fn fails_at(&mut self, now: u64, faults: &[Fault]) {
        let mut latched = Faults::NONE;
        faults.iter().for_each(|fault| latched.set(*fault, true));
        self.observed.latched = latched;
        self.now = now as u32 * 1_000;
        let observed = self.observed;
        self.objects.poll(now, &observed);
    }

    fn codes(&mut self) -> Vec<(u16, u32)> {
        self.objects.program().logged.iter().map(|fault| (fault.code, fault.time)).collect()
    }
}

#[test]
fn each_fault_is_logged_once_as_long_as_it_lasts_and_again_when_it_comes_back() {
    let mut node = Node::new();
    for now in 1_000..1_100 {
        node.fails_at(now, &[Fault::OverVoltage]);
    }
    assert_eq!(node.codes(), [(0x3210, 1)]);
    node.fails_at(1_100, &[]);
    node.fails_at(2_500, &[Fault::OverVoltage]);
    assert_eq!(node.codes(), [(0x3210, 2), (0x3210, 1)]);
    assert_eq!(node.number(0x2305, 2), 0);
}

#[test]
fn a_storm_of_faults_is_logged_at_two_and_one_more_a_minute_and_the_rest_is_counted() {
    let mut node = Node::new();
    // One each 20 ms for half an hour.
    let end = 30 * MINUTE;
    let mut came = 0u32;
    for now in (0..end).step_by(10) {
        let fails = now % 20 == 0;
        came += u32::from(fails);
        node.fails_at(now, if fails { &[Fault::UnderVoltage] } else { &[] });
        let most = 2 + now / MINUTE;
        assert!(node.objects.program().logged.len() as u64 <= most, "{now} ms");
    }
    let logged = node.objects.program().logged.len() as u32;
    assert_eq!(logged, 2 + 29);
    // Eight wait; the number that is shown stays at its highest.
    assert!(came - logged - 8 > u32::from(u16::MAX));
    assert_eq!(node.number(0x2305, 2), u64::from(u16::MAX));
    // Those that wait are written, and a joint that is quiet for long may log no more than eight at a time.
    let quiet = end + 30 * MINUTE;
    for now in (end..quiet).step_by(1_000) {
        node.fails_at(now, &[]);
    }
    assert_eq!(node.objects.program().logged.len() as u32, logged + 8);
    for fault in 0..40 {
        node.fails_at(quiet + 2 * fault, &[Fault::OverSpeed]);
        node.fails_at(quiet + 2 * fault + 1, &[]);
    }
    assert_eq!(node.objects.program().logged.len() as u32, logged + 8 + 8);
}

#[test]
fn a_reset_that_is_no_power_up_gives_nothing_and_a_stop_of_the_program_is_logged_after_a_minute() {
    let stop = Record::new(Cause::Panic, 0, 12);
    let reset = LastReset { causes: 1 << 3, stop: Some(stop.after(None)) };
    let mut node = Node::started(None, false, reset);
    node.fails_at(MINUTE - 1, &[]);
    assert_eq!(node.codes(), []);
    node.fails_at(MINUTE, &[]);
    assert_eq!(node.codes(), [(0x6100, 0)]);
    node.fails_at(2 * MINUTE, &[]);
    assert_eq!(node.objects.program().counted, 0);
}

#[test]
fn a_power_up_is_counted_once_after_ten_seconds() {
    let mut node = Node::new();
    node.fails_at(9_999, &[]);
    assert_eq!(node.objects.program().counted, 0);
    for now in 10_000..10_100 {
        node.fails_at(now, &[]);
    }
    assert_eq!(node.objects.program().counted, 1);
}

#[test]
fn what_the_flash_refuses_is_counted() {
    let mut node = Node::new();
    node.objects.program().logs = false;
    node.fails_at(1_000, &[Fault::OverCurrent]);
    assert_eq!((node.number(0x2305, 2), node.upload(0x2305, 3)), (1, Ok(Vec::new())));
}

#[test]
fn the_log_is_read_over_the_bus_the_newest_fault_first() {
    let mut node = Node::new();
    assert_eq!((node.upload(0x2305, 3), node.number(0x2305, 1)), (Ok(Vec::new()), 7));
    let kept: Vec<_> = (0..LOGGED as u32)
        .map(|n| LoggedFault { code: 0x2310 + n as u16, fault: n as u8, power_up: 0x0102_0304 * n, time: 70_000 * n })
        .collect();
    node.objects.program().logged.clone_from(&kept);
    let bytes = node.upload(0x2305, 3).unwrap();
    assert_eq!(bytes.len(), 12 * LOGGED);
    assert_eq!(bytes[12..24], [0x11, 0x23, 1, 0, 4, 3, 2, 1, 0x70, 0x11, 1, 0]);
    assert_eq!(decode(&bytes).collect::<Vec<_>>(), kept);
}
