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

use bus::Frame;
use joint_firmware::joint::state_machine::State;
use node::{Options, Served, SlotImages, VirtualNode, serve};
use page::Page;
use plant::ActuatorParameters;
use plant::virtual_joint::Setup;
use program::Program;
use serde_json::json;
use served::{NODE, PATIENCE};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use tungstenite::Message;

const MS: Duration = Duration::from_millis(1);
/// Speed of the motion, towards the middle of the joint's range, and that from which on it moves, rad/s.
const SPEED: [f64; 2] = [0.6, 0.5];
/// Velocity at which a joint stands, rad/s.
const STANDS: f64 = 0.02;
/// Instants lie within this time of a motion.
const WITHIN: f64 = 0.5;
/// The joint's command deadline.
const DEADLINE: Duration = Duration::from_millis(100);
/// Time that the server may take to brake the joint once it knows.
const REACTION: Duration = DEADLINE;

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

/// State and velocity of a joint, as it lives.
#[derive(Clone, Copy, Debug)]
struct Seen {
    state: State,
    position: f64,
    velocity: f64,
}

/// A joint that is watched from within.
struct Watched {
    node: VirtualNode,
    seen: Arc<Mutex<Seen>>,
}

impl Served for Watched {
    fn now(&self) -> Duration {
        Served::now(&self.node)
    }

    fn live_until(&mut self, instant: Duration) -> Result<(), String> {
        self.node.live_until(instant)?;
        let telemetry = self.node.joint().joint().telemetry();
        let [position, velocity] = [telemetry.motion.position, telemetry.motion.velocity].map(f64::from);
        *self.seen.lock().unwrap() = Seen { state: telemetry.state, position, velocity };
        Ok(())
    }

    fn receive(&mut self, frame: &Frame) {
        Served::receive(&mut self.node, frame);
    }

    fn take_frame(&mut self) -> Option<Frame> {
        Served::take_frame(&mut self.node)
    }
}

/// Waits for a state of the joint; the time that it took.
fn until(seen: &Mutex<Seen>, is: impl Fn(Seen) -> bool) -> Duration {
    let began = Instant::now();
    while !is(*seen.lock().unwrap()) {
        assert!(began.elapsed() < PATIENCE, "{:?}", seen.lock().unwrap());
        std::thread::sleep(MS / 2);
    }
    began.elapsed()
}

fn follows(seen: Seen) -> bool {
    seen.state == State::OperationEnabled
}

fn moves(seen: Seen) -> bool {
    follows(seen) && seen.velocity.abs() > SPEED[1]
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
    let instants = std::env::var("PANEL_INSTANTS").ok().and_then(|text| text.parse().ok()).unwrap_or(100usize);
    let bus = format!("udp:239.74.163.9:{}", bus::free_port().unwrap());
    let parameters = ActuatorParameters::reference().aligned().without_payload();
    let mut setup = Setup::of(&parameters);
    setup.configuration.limits.command_deadline = DEADLINE.as_secs_f32();
    let options = Options { node_id: NODE, serial: 12, seed: 1 };
    let mut node = VirtualNode::new(parameters, &setup, &options, SlotImages::empty().unwrap()).unwrap();
    node.advance(4_000);
    let seen = Arc::new(Mutex::new(Seen { state: State::NotReadyToSwitchOn, position: 0.0, velocity: 0.0 }));
    let mut watched = Watched { node, seen: Arc::clone(&seen) };
    let transport = bus::open(&bus).unwrap();
    let ended = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| serve(&mut watched, &*transport, &ended).unwrap());
        let end = End(&ended);
        let worst = measure(&bus, instants, &seen);
        drop(end);
        println!("{:<26}{:>10}{:>16}{:>16}{:>16}", "way", "instants", "safe, ms", "permitted, ms", "stands, ms");
        let mut failed = false;
        for (way, times) in Way::ALL.into_iter().zip(worst) {
            let [safe, stands] = times.iter().fold([Duration::ZERO; 2], |[a, b], [c, d]| [a.max(*c), b.max(*d)]);
            let ms = |time: Duration| format!("{:.1}", 1e3 * time.as_secs_f64());
            let permitted = way.permitted();
            println!("{:<26}{:>10}{:>16}{:>16}{:>16}", way.name(), times.len(), ms(safe), ms(permitted), ms(stands));
            failed |= safe > permitted;
        }
        assert!(!failed, "a joint followed its set-points for longer than it may");
    });
}

/// Ends the joint's life, whatever happens.
struct End<'e>(&'e AtomicBool);

impl Drop for End<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
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
        // Fractions of the golden ratio lie evenly, wherever one ends.
        let wait = WITHIN * (0.618_033_988_749_895 * instant as f64).fract();
        let began = Instant::now();
        while began.elapsed().as_secs_f64() < wait {
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
