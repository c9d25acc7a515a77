//! Both boards' own programs behind the page, from a new board to a joint that has learned; in real time.
//!
//! `cargo bench -p panel --bench boards` builds the programs, runs each on an emulated board with the reference motor
//! and goes the page's way: node id, what is missing, commissioning, configuration, moving, learning, the image taken
//! back. It fails where a part does not end as it should. Where the machine was late a part is done again.

#![allow(dead_code, reason = "pages are those of the tests, which use more of them")]

#[path = "../tests/panel/led.rs"]
mod led;
#[path = "../tests/panel/page.rs"]
mod page;
#[path = "../tests/panel/program.rs"]
mod program;
#[path = "../tests/panel/served.rs"]
mod served;

use clap::FromArgMatches;
use host_tests::bare_metal::{BOARDS, build};
use jointctl::commands::{Arguments, arguments, run};
use led::{Led, TIMES};
use page::Page;
use plant::ActuatorParameters;
use program::Program;
use serde_json::{Value, json};
use served::NODE;
use std::process::Command;
use std::time::Instant;

/// Board of a child of this program.
const BOARD: &str = "PANEL_BOARD";
const POSITION: &str = "position-actual-value";
const VELOCITY: &str = "velocity-actual-value";

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

/// Repeats a part for as long as the machine is late for it.
fn on_time(mut part: impl FnMut(bool) -> Result<Value, String>) -> Value {
    let mut done = part(false);
    for _ in 0..TIMES {
        let late = |error: &String| {
            ["not held any more", "frames", "deadline", "no sample", "did not come within", "no answer"]
                .iter()
                .any(|word| error.contains(word))
        };
        if !done.as_ref().is_err_and(late) {
            break;
        }
        done = part(true);
    }
    done.unwrap()
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
    let told = |what: &str| println!("{board} {:6.1} s  {what}", began.elapsed().as_secs_f64());

    let program = Program::begin(&bus);
    let mut page = Page::connect(program.address, "default");
    page.commands();
    let given = on_time(|_| page.answer(json!({ "address": { "first": NODE } })));
    assert_eq!(given[0]["node"], json!(NODE), "{given}");
    drop(page);
    let mut page = Page::open(program.address);
    page.commands();
    told("it has a node id, and is watched");

    let missing = page.answer(json!("checklist")).unwrap();
    assert!(missing.as_array().is_some_and(|rows| rows.len() >= 5), "{missing}");
    let joints = page.answer(json!("scan")).unwrap();
    assert_eq!(joints[0]["node"], json!(NODE), "{joints}");
    told("what it misses is listed");

    let motor = ActuatorParameters::reference().joint.motor;
    let found = on_time(|again| {
        let plan = json!({
            "current": 8.0, "current-limit": 12.0, "gear": motor.gear_ratio, "torque-constant": motor.torque_constant,
            "travel": 1.0, "turn": true, "acknowledge": again,
        });
        Led::begin(&mut page, "commission", json!({ "plan": plan, "index_only": false })).answer_all(None)
    });
    let pairs = ActuatorParameters::reference().windings.pole_pairs;
    let taken = found["settings"].as_array().unwrap().iter().find(|row| row["name"] == json!("pole-pairs")).unwrap();
    assert_eq!(taken["value"].as_f64(), Some(pairs as f64), "{found}");
    told("it is commissioned");

    let set = page.answer(json!({ "set": { "values": [["velocity-limit", "2"]] } })).unwrap();
    assert_eq!(set[0]["name"], json!("velocity-limit"), "{set}");
    page.answer(json!("store")).unwrap();
    let exported = page.answer(json!("export")).unwrap();
    let exported: toml::Table = exported.as_str().unwrap().parse().unwrap();
    assert_eq!(exported["limits"]["velocity"].as_float(), Some(2.0), "{exported}");
    told("its configuration is set, stored and exported");

    page.sees(POSITION, f64::is_finite);
    page.move_until(&json!({ "jog": { "velocity": 0.2 } }), VELOCITY, |velocity| velocity > 0.1);
    page.let_go(true);
    page.ended();
    page.sees(VELOCITY, |velocity| velocity.abs() < 0.05);
    told("it has moved, and stands");

    let wanted =
        |acknowledge| json!({ "excitation": 4.0, "validation": 2.5, "restarts": 0, "acknowledge": acknowledge });
    let learned =
        on_time(|again| Led::begin(&mut page, "retrain", json!({ "wanted": wanted(again) })).answer_all(None));
    told(&format!(
        "it has learned: {} -> {} Nm unexplained",
        learned["before"]["residual"], learned["after"]["residual"]
    ));
    let images = page.answer(json!("images")).unwrap();
    assert_eq!(images["active"]["version"], learned["version"], "{images}");
    told("its image is in use");
}
