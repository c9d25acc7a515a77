//! A joint with known load and Coulomb friction, pushed by known torques.

use super::super::motion_law::Wanted;
use super::*;
use crate::joint::JointMotion;
use friction_compensation::compensation::Output;
use friction_compensation::friction::state::Signal;
use friction_compensation::quantity::Torque;

const SETTINGS: Settings = Settings {
    load: Load { inertia: 0.5, gravity: 4.0, hanging: 0.0 },
    load_wrong: 0.1,
    gain: 0.5,
    clamp: 20.0,
    for_reference: false,
    dry: 1.0,
    standstill: 0.01,
    torque_limit: 40.0,
    threshold: 0.0,
    reaction: CollisionReaction::Off,
};

/// A joint of the settings' load with Coulomb friction of 1 Nm.
struct Moving {
    position: f64,
    velocity: f64,
    /// Parts of the true friction and load that the settings' model has.
    friction: f64,
    load: f64,
    observer: ExternalTorque,
    settings: Settings,
    output: Output,
    reference: Option<f32>,
}

impl Moving {
    fn new() -> Self {
        let output = Output { acting: Acting::Physical, reason: Reason::NoNetwork, ..Output::NOTHING };
        Self {
            position: 0.3,
            velocity: 1.0,
            friction: 1.0,
            load: 1.0,
            observer: ExternalTorque::NOTHING,
            settings: SETTINGS,
            output,
            reference: None,
        }
    }

    /// A millisecond with motor and external torque, Nm.
    fn step(&mut self, motor: f64, external: f64) -> Report {
        let (gravity, inertia) = (4.0 * self.position.sin() / self.load, 0.5 / self.load);
        self.velocity += 1e-3 * (motor + external - self.velocity.signum() - gravity) / inertia;
        self.position += 1e-3 * self.velocity;
        self.look(motor, self.friction * self.velocity.signum())
    }

    /// A look with a motor torque and the model's friction, Nm.
    fn look(&mut self, motor: f64, friction: f64) -> Report {
        let mut telemetry = Telemetry { state: State::OperationEnabled, ..Telemetry::NOTHING };
        let (position, velocity) = (self.position as f32, self.velocity as f32);
        telemetry.motion = JointMotion { position, velocity, acceleration: 0.0 };
        telemetry.wanted = Wanted { velocity: self.reference, ..Wanted::default() };
        telemetry.mean_torque = motor as f32;
        let torque = Torque::from_bits((0.5 * friction * 65_536.0) as i32);
        telemetry.compensated.output = Output { torque, ..self.output };
        self.observer.look(&self.settings, &telemetry, &Factors::IMAGE)
    }

    /// Milliseconds with an external torque, and a motor torque that holds the velocity at 1 rad/s.
    fn run(&mut self, milliseconds: u32, external: f64) -> Report {
        (0..milliseconds).fold(Report::default(), |_, _| {
            let gravity = 4.0 * self.position.sin() / self.load;
            self.step(1.0 + gravity + 2.0 * (1.0 - self.velocity) - external, external)
        })
    }
}

#[test]
fn an_external_torque_is_followed_through_10_ms_whatever_the_motion() {
    let mut moving = Moving::new();
    assert!(moving.run(200, 0.0).torque.abs() < 0.02);
    let early = moving.run(10, 3.0).torque / 3.0;
    assert!((0.6..0.68).contains(&early), "{early} of it after 10 ms");
    let report = moving.run(100, 3.0);
    assert!((report.torque - 3.0).abs() < 0.05 && report.uncertainty < 2.0, "{report:?}");
    assert!((moving.run(200, -2.0).torque + 2.0).abs() < 0.05);
}

/// Steady motion in which the torque is that of the test, and its bound in it, Nm.
fn bound(external: f64) -> f64 {
    f64::from({
        let mut moving = Moving::new();
        moving.run(300, 0.0);
        moving.run(400, external).uncertainty
    })
}

#[test]
fn a_collision_is_what_exceeds_uncertainty_and_threshold_and_counts_once() {
    // In the last 300 ms gravity rises by 0.9 Nm, and the bound by a tenth of that.
    let least = bound(3.0) - 0.12;
    for (beyond, collisions) in [(-0.05, 1), (0.2, 0)] {
        let mut moving = Moving::new();
        moving.settings.threshold = (3.0 - least + beyond) as f32;
        moving.run(300, 0.0);
        let report = moving.run(400, 3.0);
        assert_eq!(report.collisions, collisions, "{beyond} Nm beyond: {report:?}");
        let collided = if collisions == 0 { 0.0 } else { 3.0 };
        assert!((report.collided - collided).abs() < 0.1, "{report:?}");
    }
    let mut moving = Moving::new();
    moving.run(300, 0.0);
    for n in 0..3 {
        assert_eq!(moving.run(50, 5.0).collisions, n + 1);
        moving.run(400, 0.0);
    }
}

#[test]
fn a_collision_takes_three_looks_and_is_another_one_after_a_fifth_of_a_second() {
    let mut moving = Moving::new();
    moving.run(300, 0.0);
    let beyond = |report: &Report| report.torque.abs() > report.uncertainty;
    let (mut above, mut looks) = (0, 0);
    while above < 3 {
        let report = moving.run(1, 8.0);
        above += u32::from(beyond(&report));
        looks += 1;
        assert_eq!(report.collisions, u16::from(above == 3), "after {looks} looks, {above} of them beyond");
    }
    assert!(looks < 12, "{looks} ms");
    for (pause, collisions) in [(190, 1), (215, 2)] {
        // The torque falls below its bound, stays there, and rises above it again.
        while beyond(&moving.run(1, 0.0)) {}
        moving.run(pause - 8, 0.0);
        assert_eq!(moving.run(30, 8.0).collisions, collisions, "after {pause} ms");
    }
}

#[test]
fn nothing_is_a_collision_where_friction_or_load_are_not_known() {
    type Forget = fn(&mut Moving);
    let unknown: [(&str, Forget); 7] = [
        ("compensation is off", |m| (m.output.acting, m.output.reason) = (Acting::Nothing, Reason::Off)),
        ("no model", |m| (m.output.acting, m.output.reason) = (Acting::Nothing, Reason::NoModel)),
        ("outside", |m| m.output.reason = Reason::OutsideTrainedBox(Signal::Velocity)),
        ("far outside", |m| m.output.reason = Reason::FarOutsideTrainedBox(Signal::Velocity)),
        ("no gain", |m| m.settings.gain = 0.0),
        // The model's torque is 0.5 Nm.
        ("clamped", |m| m.settings.clamp = 0.5),
        ("no inertia", |m| m.settings.load.inertia = 0.0),
    ];
    for (name, forget) in unknown {
        let mut moving = Moving::new();
        forget(&mut moving);
        let report = moving.run(500, 30.0);
        assert_eq!((report.uncertainty, report.collisions), (40.0, 0), "{name}");
    }
    let mut moving = Moving::new();
    moving.settings.clamp = 0.51;
    assert_eq!(moving.run(500, 30.0).collisions, 1, "just below the clamp");
}

/// Largest part of the bound that the estimate reaches in motion, where model and load have these parts of the truth;
/// the bound is that of what is wrong alone, and of a load that may be wrong by 20 % of the truth.
fn reached(friction: f64, load: f64) -> f32 {
    let mut moving = Moving::new();
    (moving.friction, moving.load) = (friction, load);
    moving.settings.load_wrong = if load == 1.0 { 0.0 } else { 0.2 / 0.8 };
    let others = FLOOR * moving.settings.torque_limit + if friction == 1.0 { WRONG } else { 0.0 };
    moving.run(300, 0.0);
    (0..2_000).fold(0.0f32, |largest, n| {
        let swing = 3.0 * f64::from(n) * 2e-3;
        let report = moving.step(1.0 + 3.0 * swing.cos() + 4.0 * moving.position.sin() / load, 0.0);
        largest.max(if moving.velocity > 0.3 {
            report.torque.abs() / (report.uncertainty - others - NOISE * moving.observer.noise)
        } else {
            0.0
        })
    })
}

#[test]
fn friction_and_load_that_are_wrong_by_what_is_stated_are_no_contact_and_beyond_it_they_are() {
    for (friction, load) in [(0.71, 1.0), (1.29, 1.0), (1.0, 0.81), (1.0, 1.19), (0.71, 0.81), (1.29, 1.19)] {
        let reached = reached(friction, load);
        assert!(reached < 1.0, "friction times {friction}, load times {load}: {reached} of the bound");
    }
    for (friction, load) in [(0.69, 1.0), (1.0, 0.79), (0.69, 0.79)] {
        let reached = reached(friction, load);
        assert!(reached > 1.0, "friction times {friction}, load times {load}: {reached} of the bound");
    }
}

#[test]
fn near_standstill_and_against_the_reference_friction_is_anything_between_both_breakaways() {
    let mut moving = Moving::new();
    let fast = moving.run(500, 0.0).uncertainty;
    // At rest the model, for no velocity, says nothing; pushed against a wall it says the reference's.
    for (velocity, reference, friction) in
        [(0.0, None, 0.0), (0.0, Some(1.0), 1.0), (1.0, Some(0.0), 0.0), (1.0, Some(-1.0), -1.0)]
    {
        let mut moving = Moving::new();
        moving.settings.for_reference = reference.is_some();
        (moving.velocity, moving.reference) = (velocity, reference);
        let bound = f64::from(moving.look(0.0, friction).uncertainty);
        let standing = 1.0 / 0.7 + friction.abs() + 0.4 + 0.1 * 4.0 * 0.3f64.sin();
        assert!((standing - 0.01..standing + 0.2).contains(&bound), "{velocity} and {reference:?} rad/s: {bound} Nm");
        assert!(bound > f64::from(fast) + 0.5, "{fast} Nm in motion");
    }
    // It fades within some 50 ms of motion.
    moving.velocity = 0.0;
    let stands = moving.look(0.0, 0.0).uncertainty;
    moving.velocity = 1.0;
    let [soon, later] = [20, 200].map(|looks| moving.run(looks, 0.0).uncertainty);
    assert!(stands > soon && soon > fast + 0.2 && later < soon - 0.2, "{stands}, {soon}, {later} Nm");
}

#[test]
fn it_forgets_where_the_joint_is_off_but_for_its_collisions_and_bears_what_is_no_number() {
    let mut moving = Moving::new();
    moving.run(300, 0.0);
    moving.run(100, 8.0);
    let off = Telemetry { state: State::SwitchedOn, ..Telemetry::NOTHING };
    let report = moving.observer.look(&SETTINGS, &off, &Factors::IMAGE);
    assert_eq!((report.torque, report.uncertainty, report.collisions), (0.0, 40.0, 1));
    let mut wild = Telemetry { state: State::OperationEnabled, ..Telemetry::NOTHING };
    for (velocity, torque) in [(f32::NAN, f32::INFINITY), (f32::INFINITY, f32::NAN), (1e30, -1e30), (-1e38, 1e38)] {
        (wild.motion.velocity, wild.mean_torque) = (velocity, torque);
        for _ in 0..10 {
            let report = moving.observer.look(&SETTINGS, &wild, &Factors::IMAGE);
            assert!(report.torque.abs() <= 80.0 && report.uncertainty <= 40.0, "{report:?}");
        }
    }
    moving.observer.look(&SETTINGS, &off, &Factors::IMAGE);
    moving.velocity = 1.0;
    assert!(moving.run(300, 0.0).torque.abs() < 0.02);
}
