//! A joint on a bus that bears a load and rises until its master falls silent: it monitors the master's heartbeat
//! (1016h), and 1029h says what becomes of it without. All of it is asked for through the objects.

#[path = "../../../node/tests/master/mod.rs"]
mod master;

use crate::rig::reference;
use crate::stops::{ACCELERATION, FAR, LEVEL, SPEED, Stopped, TORQUE_GAIN};
use bus::client::Command as Nmt;
use canopen_node::NmtState;
use joint_firmware::joint::state_machine::State;
use joint_firmware::joint::{Command, Mode};
use joint_firmware::objects::{DEFAULT_RANGES, Operation, impedance_frame};
use master::Master;
use plant::actuator::Accessories;

/// Node id of the master, the distance of its heartbeats and the time without one after which it counts as lost, ms.
const MASTER: u16 = 1;
const DISTANCE: u64 = 10;
const LOST: u64 = 50;
const ENABLE: u16 = 0x0F;
const NEW: u16 = 1 << 4;
const AT_ONCE: u16 = 1 << 5;
/// Bit of the statusword for homing that has attained its index.
const ATTAINED: i64 = 1 << 12;
/// Distance from one index to where homing to the next one begins, rad.
const BESIDE: f64 = 0.01;

fn milli(value: f32) -> [u8; 4] {
    ((1e3 * value) as i32).to_le_bytes()
}

fn micro(value: f64) -> [u8; 4] {
    ((1e6 * value) as i32).to_le_bytes()
}

/// A master that is alive, and its joint.
pub struct Alive {
    master: Master,
    /// 1029h.
    behaviour: u8,
    time: u64,
}

impl Alive {
    /// A loaded arm, nearly level, that rises in a mode.
    pub fn rising(mode: Operation, behaviour: u8, quick_stop: u8, brake: Option<(f32, f32)>) -> Self {
        let master = Master::of(reference().with_payload(3.0, 0.3));
        let mut alive = Self { master, behaviour, time: 0 };
        if let Some((release, apply)) = brake {
            let brake = Some((release.into(), apply.into()));
            alive.master.node.fit(Accessories { brake, ..Accessories::default() });
            alive.set(0x2109, 1, &release.to_le_bytes());
            alive.set(0x2109, 2, &apply.to_le_bytes());
            alive.set(0x2100, 1, &[1]);
        }
        alive.set(0x605A, 0, &i16::from(quick_stop).to_le_bytes());
        alive.set(0x1016, 1, &(u32::from(MASTER) << 16 | LOST as u32).to_le_bytes());
        alive.set(0x1029, 1, &[behaviour]);
        alive.master.command(Nmt::Start);
        alive.choose(Operation::Position);
        for word in [6, 7, ENABLE] {
            alive.word(word);
            alive.live(1);
        }
        assert_eq!(alive.master.state(), State::OperationEnabled);
        alive.go(LEVEL.into());
        alive.rise(mode);
        let velocity = alive.velocity();
        match mode {
            Operation::None => assert!(velocity.abs() < 0.05, "{velocity} rad/s"),
            _ => assert!(velocity > 0.8 * f64::from(SPEED), "{mode:?}: {velocity} rad/s"),
        }
        alive
    }

    fn set(&mut self, index: u16, sub_index: u8, value: &[u8]) {
        self.master.download(index, sub_index, value).unwrap();
    }

    fn word(&mut self, word: u16) {
        self.set(0x6040, 0, &word.to_le_bytes());
    }

    fn choose(&mut self, mode: Operation) {
        self.set(0x6060, 0, &mode.number().to_le_bytes());
    }

    /// Goes to a position in cyclic synchronous position mode, rad.
    fn go(&mut self, position: f64) {
        for _ in 0..250 {
            self.set(0x607A, 0, &micro(position));
            self.live(10);
        }
    }

    fn rise(&mut self, mode: Operation) {
        let at = 1e-6 * self.master.number(0x6064, 0) as f64;
        let bears = self.master.node.joint().actuator().state().joint.load_torque as f32;
        match mode {
            Operation::Homing => {
                self.set(0x6098, 0, &[34]);
                self.set(0x6099, 1, &milli(SPEED));
                self.set(0x6099, 2, &milli(SPEED));
                self.set(0x609A, 0, &milli(ACCELERATION));
                self.home();
                while self.master.number(0x6041, 0) & ATTAINED == 0 {
                    self.live(1);
                }
                // The index is zero now.
                self.choose(Operation::Position);
                self.word(ENABLE);
                self.go(BESIDE);
                self.home();
            }
            Operation::ProfilePosition | Operation::ProfileVelocity => {
                for (index, value) in [(0x6081, SPEED), (0x6083, ACCELERATION), (0x6084, ACCELERATION)] {
                    self.set(index, 0, &milli(value));
                }
                self.choose(mode);
                self.word(ENABLE);
                if mode == Operation::ProfilePosition {
                    self.set(0x607A, 0, &micro(at + f64::from(FAR)));
                    self.word(ENABLE | NEW | AT_ONCE);
                }
            }
            _ => self.choose(mode),
        }
        let rated = 1e-3 * self.master.number(0x6076, 0) as f32;
        // An index is less than a turn of the rotor away.
        let time = if mode == Operation::Homing { 200 } else { 300 };
        for millisecond in 0..time {
            let goal = at + f64::from(SPEED) * 1e-3 * f64::from(millisecond);
            match mode {
                Operation::Position => self.set(0x607A, 0, &micro(goal + 0.1)),
                Operation::Velocity | Operation::ProfileVelocity => self.set(0x60FF, 0, &milli(SPEED)),
                Operation::Torque => {
                    let torque = bears + TORQUE_GAIN * (SPEED - self.velocity() as f32);
                    self.set(0x6071, 0, &((1e3 * torque / rated) as i16).to_le_bytes());
                }
                Operation::Impedance => {
                    let gains = self.master.node.configuration().gains;
                    let command = Command {
                        mode: Mode::Impedance,
                        position: goal as f32,
                        velocity: SPEED,
                        torque: bears,
                        stiffness: gains.stiffness,
                        damping: gains.damping,
                        ..Command::NOTHING
                    };
                    self.set(0x2011, 1, &impedance_frame(&command, DEFAULT_RANGES).to_le_bytes());
                }
                _ => {}
            }
            self.live(1);
        }
    }

    /// Begins homing to the next index above.
    fn home(&mut self) {
        self.choose(Operation::Homing);
        self.word(ENABLE);
        self.live(1);
        self.word(ENABLE | NEW);
        self.live(1);
    }

    /// Time passes, with heartbeats of the master.
    pub fn live(&mut self, milliseconds: u64) {
        for _ in 0..milliseconds {
            if self.time.is_multiple_of(DISTANCE) {
                self.master.send(0x700 + MASTER, &[5]);
            }
            self.time += 1;
            self.master.wait(1);
        }
    }

    fn position(&self) -> f64 {
        self.master.node.joint().actuator().state().joint.position
    }

    fn velocity(&self) -> f64 {
        self.master.node.joint().actuator().state().joint.velocity
    }

    /// Motion within two seconds from where the master falls silent on.
    pub fn lost(mut self) -> Stopped {
        let start = self.position();
        let (mut highest, mut lowest) = (start, f64::INFINITY);
        for _ in 0..2_000 {
            self.master.wait(1);
            let now = self.position();
            if now > highest {
                (highest, lowest) = (now, now);
            }
            lowest = lowest.min(now);
        }
        let (falls, state) = (self.velocity().abs() > 0.05, self.master.state());
        let nmt = if self.behaviour == 0 { NmtState::PreOperational } else { NmtState::Stopped };
        assert_eq!(self.master.node.state(), nmt);
        Stopped { way: highest - start, sank: highest - lowest, falls, state }
    }
}

/// Joint that goes on without a heartbeat for as long as its set-points are renewed.
#[test]
fn a_lost_heartbeat_stops_nothing_where_1029h_says_so() {
    for (behaviour, expected) in [(1, State::OperationEnabled), (0, State::SwitchOnDisabled)] {
        let mut alive = Alive::rising(Operation::Velocity, behaviour, 2, None);
        for _ in 0..50 {
            // Refused once the joint is not OPERATIONAL.
            let _ = alive.master.download(0x60FF, 0, &milli(SPEED));
            alive.master.wait(10);
        }
        assert!(alive.master.emergencies().contains(&0x8130), "1029h = {behaviour}");
        assert_eq!(alive.master.state(), expected, "1029h = {behaviour}");
        assert_eq!(alive.velocity() > 0.8 * f64::from(SPEED), behaviour == 1, "{} rad/s", alive.velocity());
    }
}

/// Heartbeat that comes just in time, and one that comes too late.
#[test]
fn a_heartbeat_counts_as_lost_after_the_time_of_1016h_and_not_before() {
    for (distance, expected) in [(LOST - 1, State::OperationEnabled), (LOST + 2, State::QuickStopActive)] {
        let mut alive = Alive::rising(Operation::None, 0, 6, None);
        for _ in 0..4 {
            alive.master.send(0x700 + MASTER, &[5]);
            alive.master.wait(distance);
        }
        assert_eq!(alive.master.state(), expected, "a heartbeat each {distance} ms");
    }
}
