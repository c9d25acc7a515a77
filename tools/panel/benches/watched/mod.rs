//! A virtual joint on a bus of this machine that is watched from within, and what is measured of its stops.

use crate::served::{NODE, PATIENCE};
use bus::Frame;
use joint_firmware::joint::state_machine::State;
use node::{Options, Served, SlotImages, VirtualNode, serve};
use plant::ActuatorParameters;
use plant::virtual_joint::Setup;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

pub const MS: Duration = Duration::from_millis(1);
/// Speed of the motion, towards the middle of the joint's range, and that from which on it moves, rad/s.
pub const SPEED: [f64; 2] = [0.6, 0.5];
/// Velocity at which a joint stands, rad/s.
pub const STANDS: f64 = 0.02;
/// Instants lie within this time of a motion, s.
const WITHIN: f64 = 0.5;
/// The joint's command deadline.
pub const DEADLINE: Duration = Duration::from_millis(100);
/// Time that the server may take to brake the joint once it knows.
pub const REACTION: Duration = DEADLINE;

/// State and motion of a joint, as it lives.
#[derive(Clone, Copy, Debug)]
pub struct Seen {
    pub state: State,
    pub position: f64,
    pub velocity: f64,
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
pub fn until(seen: &Mutex<Seen>, is: impl Fn(Seen) -> bool) -> Duration {
    let began = Instant::now();
    while !is(*seen.lock().unwrap()) {
        assert!(began.elapsed() < PATIENCE, "{:?}", seen.lock().unwrap());
        std::thread::sleep(MS / 2);
    }
    began.elapsed()
}

pub fn follows(seen: Seen) -> bool {
    seen.state == State::OperationEnabled
}

pub fn moves(seen: Seen) -> bool {
    follows(seen) && seen.velocity.abs() > SPEED[1]
}

/// Number of instants: 100, or `PANEL_INSTANTS`.
pub fn instants() -> usize {
    std::env::var("PANEL_INSTANTS").ok().and_then(|text| text.parse().ok()).unwrap_or(100)
}

/// Time from the beginning of a motion to an instant. Fractions of the golden ratio lie evenly, wherever one ends.
pub fn wait(instant: usize) -> Duration {
    Duration::from_secs_f64(WITHIN * (0.618_033_988_749_895 * instant as f64).fract())
}

/// Has a joint live on a bus while `work` is done.
pub fn watched<T>(work: impl FnOnce(&str, &Mutex<Seen>) -> T) -> T {
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
        let _end = End(&ended);
        work(&bus, &seen)
    })
}

/// Ends the joint's life, whatever happens.
struct End<'e>(&'e AtomicBool);

impl Drop for End<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// Prints the longest times of each way, until the joint follows no set-points and until it stands; panics where the
/// first is longer than permitted.
pub fn tell<'t>(ways: impl Iterator<Item = (&'static str, Duration, &'t [[Duration; 2]])>) {
    println!("{:<26}{:>10}{:>16}{:>16}{:>16}", "way", "instants", "safe, ms", "permitted, ms", "stands, ms");
    let ms = |time: Duration| format!("{:.1}", 1e3 * time.as_secs_f64());
    let mut failed = false;
    for (name, permitted, times) in ways {
        let [safe, stands] = times.iter().fold([Duration::ZERO; 2], |[a, b], [c, d]| [a.max(*c), b.max(*d)]);
        println!("{name:<26}{:>10}{:>16}{:>16}{:>16}", times.len(), ms(safe), ms(permitted), ms(stands));
        failed |= safe > permitted;
    }
    assert!(!failed, "a joint followed its set-points for longer than it may");
}
