//! Ways in which a page ceases to hold its joint, at instants all over a motion, and when the joint is safe.
//!
//! `cargo bench -p panel --bench stops` ends motions at 100 instants, or `PANEL_INSTANTS`, by each way in turn,
//! and tells the longest time until the joint brakes or is off, and until it stands. It fails where a joint
//! follows its set-points for longer than its way permits. Joint and page are in this process, the server is the
//! program itself, the bus is UDP multicast on this machine; the joint's own state is what counts, not what it
//! says on the bus.

#![allow(dead_code, reason = "pages are those of the tests, which use more of them")]

#[path = "../tests/panel/page.rs"]
mod page;
#[path = "../tests/panel/program.rs"]
mod program;
#[path = "../tests/panel/served.rs"]
mod served;
mod watched;

use bus::Frame;
use joint_firmware::joint::state_machine::State;
use page::Page;
use program::Program;
use serde_json::json;
use served::{NODE, PATIENCE};
use std::sync::Mutex;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use tungstenite::Message;
use watched::{DEADLINE, MS, REACTION, SPEED, STANDS, Seen, follows, instants, moves, tell, until, wait, watched};

/// A way in which a page ceases to hold.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Way {
    LetGo,
    /// A laptop that sleeps: the connection stays.
    Silent,
    Cut,
    StopOfAnother,
    NoMessage,
    OtherMaster,
    ServerKilled,
}

impl Way {
    const ALL: [Self; 7] = [
        Self::LetGo,
        Self::Silent,
        Self::Cut,
        Self::StopOfAnother,
        Self::NoMessage,
        Self::OtherMaster,
        Self::ServerKilled,
    ];

    const fn name(self) -> &'static str {
        match self {
            Self::LetGo => "the button is let go",
            Self::Silent => "the page is silent",
            Self::Cut => "the connection is cut",
            Self::StopOfAnother => "STOP of another page",
            Self::NoMessage => "a message that is none",
            Self::OtherMaster => "another master sends, too",
            Self::ServerKilled => "the server is killed",
        }
    }

    /// Longest time until the joint no longer follows set-points.
    fn permitted(self) -> Duration {
        match self {
            Self::Silent => panel::hold::LIMIT + REACTION,
            Self::ServerKilled => DEADLINE + 10 * MS,
            _ => REACTION,
        }
    }
}

/// A page whose joint moves; it holds.
fn moving(program: &Program, seen: &Mutex<Seen>, acknowledge: bool) -> Page {
    let mut page = Page::open(program.address);
    page.commands();
    let began = Instant::now();
    while began.elapsed() < PATIENCE {
        let hold = page.press();
        let velocity = -SPEED[0].copysign(seen.lock().unwrap().position);
        let motion = json!({ "jog": { "velocity": velocity } });
        let id = page.tell(json!({ "move": { "hold": hold, "motion": motion, "reset": acknowledge } }));
        let asked = Instant::now();
        while asked.elapsed() < PATIENCE && !moves(*seen.lock().unwrap()) {
            page.look().unwrap();
            if page.seen.iter().any(|message| message["answer"] == json!(id) && message.get("error").is_some()) {
                break;
            }
        }
        if moves(*seen.lock().unwrap()) {
            return page;
        }
        page.let_go(true);
        page.seen.clear();
    }
    panic!("the joint does not move: {:?}", page.seen);
}

fn main() {
    // Cargo passes `--bench`; tests, which pass nothing, have no minutes for it.
    if !std::env::args().any(|argument| argument == "--bench") {
        return;
    }
    let worst = watched(|bus, seen| measure(bus, instants(), seen));
    let rows = Way::ALL.into_iter().zip(&worst).map(|(way, times)| (way.name(), way.permitted(), times.as_slice()));
    tell(rows);
}

/// Sends set-points of another master, which does not listen before, for half a second.
fn other_master(bus: &str) -> JoinHandle<()> {
    let transport = bus::open(bus).unwrap();
    // Controlword, mode and velocity of the page's own PDO.
    let frame = Frame::new(0x300 + u16::from(NODE), &[0x0F, 0, 9, 0, 0, 0, 0]).unwrap();
    transport.send(&frame).unwrap();
    std::thread::spawn(move || {
        for _ in 0..50 {
            std::thread::sleep(10 * MS);
            transport.send(&frame).unwrap();
        }
    })
}

/// For each way, the times of its instants until the joint follows no set-points, and until it stands.
fn measure(bus: &str, instants: usize, seen: &Mutex<Seen>) -> [Vec<[Duration; 2]>; 7] {
    let mut worst = [const { Vec::new() }; 7];
    let mut program = Program::begin(bus);
    for instant in 0..instants {
        let which = instant % Way::ALL.len();
        let way = Way::ALL[which];
        let mut page = moving(&program, seen, instant > 0);
        let mut other = Page::connect(program.address, "default");
        let (began, wait) = (Instant::now(), wait(instant));
        while began.elapsed() < wait {
            page.look().unwrap();
        }
        if !moves(*seen.lock().unwrap()) {
            panic!("the joint stands before {}: this machine is too busy for real time", way.name());
        }
        let mut sending = None;
        match way {
            Way::OtherMaster => sending = Some(other_master(bus)),
            Way::LetGo => page.let_go(true),
            Way::Silent => page.let_go(false),
            Way::Cut => drop(page),
            Way::StopOfAnother => {
                other.tell(json!("stop"));
            }
            Way::NoMessage => page.send(Message::text("{")),
            Way::ServerKilled => program.kill(),
        }
        let safe = until(seen, |seen| !follows(seen));
        let stands = safe + until(seen, |seen| seen.velocity.abs() < STANDS);
        worst[which].push([safe, stands]);
        if let Some(sending) = sending {
            sending.join().unwrap();
            assert!(!follows(*seen.lock().unwrap()), "the joint follows the other master");
        }
        if way == Way::ServerKilled {
            program = Program::begin(bus);
        }
        until(seen, |seen| matches!(seen.state, State::SwitchOnDisabled | State::Fault));
    }
    worst
}
