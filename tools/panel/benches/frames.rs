//! Frames a second that the page draws, all of its plots in view, in Chromium without a graphics card.
//!
//! `cargo bench -p panel --bench frames` has the page of a virtual joint at 1,000 samples a second draw for 20 s while
//! the joint moves, joint, server and browser on this machine, and fails below 30 frames a second.

#![allow(dead_code, reason = "browser and joints are those of the tests, which use more of them")]

#[path = "../tests/panel/hands.rs"]
mod hands;
#[path = "../tests/panel/program.rs"]
mod program;
#[path = "../tests/panel/served.rs"]
mod served;
#[path = "../tests/panel/webdriver.rs"]
mod webdriver;

use hands::jog;
use program::Program;
use served::{Joints, NODE};
use std::time::Duration;
use webdriver::Browser;

/// Frames a second that are wanted, and plots among which.
const WANTED: f64 = 30.0;
const PLOTS: u64 = 6;
/// Time over which they are counted.
const TIME: Duration = Duration::from_secs(20);

fn main() {
    // Cargo passes `--bench`; tests, which pass nothing, have no minutes for it.
    if !std::env::args().any(|argument| argument == "--bench") {
        return;
    }
    let bus = format!("udp:239.74.163.9:{}", bus::free_port().unwrap());
    let _joints = Joints::on(&bus, &[NODE]);
    let program = Program::with(&bus, &["--rate", "1000"]);
    let browser = Browser::begin();
    browser.window(1280, 3200, "light");
    browser.open(program.address);
    browser.until("panel.plots.count() > 100");
    let plots = browser.value("document.querySelectorAll('figure.plot').length").as_u64().unwrap();
    // A slow jog that lasts longer than the count does.
    jog(&browser, "0.05", "Math.abs(panel.latest('velocity-actual-value')) > 0.02");
    let now = || ["panel.plots.drawn()", "performance.now() / 1e3"].map(|what| browser.value(what).as_f64().unwrap());
    let before = now();
    std::thread::sleep(TIME);
    let after = now();
    browser.mouse("#jog-forward", "pointerUp");
    let rate = (after[0] - before[0]) / (after[1] - before[1]);
    println!("{plots} plots, 1000 samples a second: {rate:.1} frames a second");
    assert!(plots >= PLOTS && rate >= WANTED, "fewer than {PLOTS} plots or {WANTED} frames a second");
}
