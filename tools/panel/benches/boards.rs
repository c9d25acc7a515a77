//! Both boards' own programs behind the page, in a browser, from a new board to one with an image; real time.
//!
//! `cargo bench -p panel --bench boards` builds the programs, runs each on an emulated board with the reference motor,
//! and goes the page's way by its buttons: node id, what is missing, commissioning, configuration, motions, learning,
//! the life of an image, the image taken back. It fails where a part does not end as it should. Where the machine was
//! late a part is done again.

#![allow(dead_code, reason = "hands and browser are those of the tests, which use more of them")]

#[path = "../tests/panel/hands.rs"]
mod hands;
#[path = "../tests/panel/program.rs"]
mod program;
#[path = "../tests/panel/served.rs"]
mod served;
#[path = "../tests/panel/webdriver.rs"]
mod webdriver;

use clap::FromArgMatches;
use hands::{commission, hold, jog, retrain, set, told};
use host_tests::bare_metal::{BOARDS, build};
use jointctl::commands::{Arguments, arguments, run};
use node::SampleImage;
use plant::ActuatorParameters;
use program::Program;
use serde_json::json;
use std::process::Command;
use std::time::{Duration, Instant};
use webdriver::Browser;

/// Board of a child of this program.
const BOARD: &str = "PANEL_BOARD";
/// Time that a client may take: a board that is translated has other things to do.
const PATIENCE: Duration = Duration::from_secs(3);

fn main() {
    // Cargo passes `--bench`; tests, which pass nothing, have no minutes for it.
    if !std::env::args().any(|argument| argument == "--bench") {
        return;
    }
    if let Ok(board) = std::env::var(BOARD) {
        return from_unboxing(&board);
    }
    for board in BOARDS {
        // A program of its own: with it ends the board.
        let own = std::env::current_exe().unwrap();
        let ended = Command::new(own).arg("--bench").env(BOARD, board.name).status().unwrap();
        assert!(ended.success(), "{}: {ended}", board.name);
    }
}

/// A latest value of a signal, in the page.
fn latest(signal: &str) -> String {
    format!("panel.latest('{signal}-actual-value')")
}

fn from_unboxing(board: &str) {
    let elf = build(board, env!("CARGO_TARGET_TMPDIR")).unwrap();
    let bus = format!("udp:239.74.163.2:{}", bus::free_port().unwrap());
    let elf = elf.to_string_lossy().into_owned();
    let line = ["jointctl", "sim", "--elf", &elf, "--board", board, "--bus", &bus].map(str::to_owned);
    std::thread::spawn(move || {
        let parsed = Arguments::from_arg_matches(&arguments().get_matches_from(line)).unwrap();
        panic!("the board ended: {:?}", run(parsed));
    });
    let began = Instant::now();
    let part = |what: &str| println!("{board} {:6.1} s  {what}", began.elapsed().as_secs_f64());

    // What happens most often is translated first: until then answers come late.
    std::thread::sleep(Duration::from_secs(5));
    let program = Program::within(PATIENCE, &bus, &[]);
    let browser = Browser::begin();
    browser.window(1280, 1000, "light");
    browser.open(program.address);
    browser.until("!document.querySelector('#moves').disabled");
    let named = "document.title === 'Joint 5'";
    browser.click("#address");
    browser.until(named);
    part("it has a node id, and is watched");

    browser.click("#load-checklist");
    browser.until("document.querySelector('#checklist tr:nth-child(5)') !== null");
    browser.click("#load-scan");
    browser.until(&told("joints", "5 (this page)"));
    browser.picture(&format!("panel-{board}-missing.png"));
    part("what it misses is listed");

    let reference = ActuatorParameters::reference();
    let plan = [
        ("current", 8.0),
        ("current-limit", 12.0),
        ("gear", reference.joint.motor.gear_ratio),
        ("torque-constant", reference.joint.motor.torque_constant),
        ("travel", 1.0),
    ];
    commission(&browser, &plan, true, reference.windings.pole_pairs);
    part("it is commissioned");

    browser.click("#load-objects");
    set(&browser, "find", "value = 'position-margin'");
    set(&browser, "find", "dispatchEvent(new Event('input'))");
    let field = "document.querySelector('#objects input')";
    browser.until(&format!("{field} !== null"));
    browser.value(&format!("void ({field}.value = '0.25')"));
    browser.value(&format!("void {field}.dispatchEvent(new Event('input'))"));
    browser.click("#set");
    browser.until(&told("log", "position-margin is 0.25 "));
    browser.click("#store");
    browser.until(&format!("{} || {}", told("stored", "as stored 20"), told("stored", "not told")));
    part("its configuration is set and stored");

    let stands = format!("!panel.isHeld() && Math.abs({}) < 0.05", latest("velocity"));
    let moves = |button: &str, moved: &str| {
        hold(&browser, button, moved);
        browser.mouse(button, "pointerUp");
        browser.until(&stands);
        browser.until("document.querySelector('#state').textContent.startsWith('disabled')");
    };
    browser.until(&format!("Number.isFinite({})", latest("velocity")));
    jog(&browser, "0.2", &format!("{} > 0.1", latest("velocity")));
    browser.mouse("#jog-forward", "pointerUp");
    browser.until(&stands);
    moves("#sine", &format!("Math.abs({}) > 0.1", latest("velocity")));
    // A spring of the page's default is weaker than the friction of this joint.
    for (name, value) in [("offset", 0.2), ("stiffness", 200.0), ("damping", 4.0)] {
        set(&browser, &format!("impedance-{name}"), &format!("value = '{value}'"));
    }
    for (button, distance) in [("#steps", 0.05), ("#impedance", 0.02)] {
        let before = browser.value(&latest("position")).as_f64().unwrap();
        moves(button, &format!("Math.abs({} - {before}) > {distance}", latest("position")));
    }
    browser.picture(&format!("panel-{board}-moved.png"));
    part("it has moved in four ways, and stands");

    retrain(&browser, 1);
    part("it has learned");

    let use_image = |version: u32, steps: &[(&str, &str)]| {
        let image = std::env::temp_dir().join(format!("panel-{}-{version}.img", std::process::id()));
        std::fs::write(&image, SampleImage::constant(version, 0.01)).unwrap();
        browser.choose("#image", &image);
        for (button, life) in steps {
            browser.click(button);
            browser.until(&told("images", life));
        }
        std::fs::remove_file(image).unwrap();
    };
    use_image(2, &[("#shadow", "in shadow"), ("#trial", "on trial"), ("#discard", "nothing staged")]);
    use_image(2, &[("#commit", "version 2, ")]);
    use_image(3, &[("#commit", "version 3, ")]);
    part("an image was in shadow, on trial, discarded; two were committed");

    browser.click("#roll-back");
    let rows = "[...document.querySelectorAll('#images tr')].map((row) => row.textContent)";
    browser.until(&format!("{rows}.some((row) => row.startsWith('in useversion 2, '))"));
    assert_eq!(browser.value("panel.problems"), json!([]));
    part("its image is taken back");
}
