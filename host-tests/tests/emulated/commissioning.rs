//! `jointctl commission` on the flashed programs: from a new board to a turning motor, with random motors and encoders.

use emulator::board::{BG431BEsc1, Drivetrain, Encoder, MoteusR4, Wired};
use emulator::program::Program;
use host_tests::emulated::Bench;
use host_tests::emulated::bench::{SUPPLY, program};
use host_tests::emulated::commissioned::OnBoard;
use host_tests::samples::count;
use joint_firmware::joint::state_machine::State;
use joint_firmware::objects::settings::Setting;
use jointctl::commission::bench::Motion;
use jointctl::commission::joint::Joint;
use jointctl::commission::{Bench as _, Found, Plan, Stopped, commission, find_index};
use jointctl::remote::condition;
use libtest_mimic::{Failed, Trial};
use plant::ActuatorParameters;
use plant::actuator::windings::PhaseOrder;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::{PI, TAU};
use std::sync::OnceLock;

/// Random motors on each board: in the test command, and in all.
const MOTORS: (u64, u64) = (4, 20);
/// Random motors that lose their power.
const RESTARTED: u64 = 3;
/// Velocity of a motor that turns again, turns of the rotor per second, for how long, s, and how far off its mean may
/// be.
const SPEED: f64 = 0.5;
const TURNING: f64 = 0.5;
const RIGHT: f64 = 0.3;
/// Period of set-points, s.
const PERIOD: f64 = 0.01;
/// Position that may be off after the index was met again, turns of the rotor.
const OFF: f64 = 0.01;
/// The joint's node id.
pub const NODE: u8 = 5;
/// Tolerance of a winding's values, and of the electrical zero, degrees.
const WINDING: f64 = 0.05;
const ZERO: f64 = 3.0;
/// Counts a turn of incremental encoders.
const COUNTS: [u32; 5] = [2_000, 4_000, 4_096, 8_192, 10_000];
/// The boards' names.
pub const MOTEUS: &str = "moteus-r4";
pub const ESC1: &str = "b-g431b-esc1";

/// The tests of this file, by name.
pub fn trials() -> Vec<Trial> {
    let mut trials = Vec::new();
    for motor in 0..RESTARTED {
        let name = format!("b_g431b_esc1_turns_again_by_its_index_after_a_loss_of_power_{motor}");
        trials.push(Trial::test(name, move || turns_again(1_100 + motor)));
    }
    for motor in 0..count(MOTORS.0, MOTORS.1) {
        let name = format!("moteus_r4_is_commissioned_with_random_motor_{motor:02}");
        trials.push(Trial::test(name, move || is_commissioned(MOTEUS, MoteusR4::new, motor)));
        let name = format!("b_g431b_esc1_is_commissioned_with_random_motor_{motor:02}");
        trials.push(Trial::test(name, move || is_commissioned(ESC1, BG431BEsc1::new, 1_000 + motor)));
    }
    trials
}

/// A board's program, built once.
pub fn built(board: &'static str) -> Result<&'static Program, Failed> {
    static PROGRAMS: [OnceLock<Result<Program, String>>; 2] = [const { OnceLock::new() }; 2];
    let build = || program(board, env!("CARGO_TARGET_TMPDIR")).map_err(|e| e.message().unwrap_or_default().to_owned());
    let built = PROGRAMS[usize::from(board == ESC1)].get_or_init(build);
    Ok(built.as_ref().map_err(Clone::clone)?)
}

/// A motor, its encoder, and what its data sheet says.
pub struct Motor {
    /// Parameters as they are.
    pub parameters: ActuatorParameters,
    encoder: Encoder,
    /// Plan as its data sheet has it.
    pub plan: Plan,
}

impl Motor {
    /// A motor of a seed.
    pub fn random(seed: u64, incremental: bool) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut draw = |low: f64, high: f64| random.random_range(low..high);
        let mut parameters = ActuatorParameters::reference().without_payload();
        parameters.bus.source_voltage = SUPPLY;
        let current = draw(5.0, 10.0);
        let limit = 1.5 * current;
        let resistance = 0.05 * 8.0_f64.powf(draw(0.0, 1.0));
        let constant = draw(0.03, 0.12);
        let gear = draw(6.0, 60.0);
        let pole_pairs = draw(4.0, 22.0).floor();
        {
            let motor = &mut parameters.joint.motor;
            (motor.resistance, motor.torque_constant, motor.gear_ratio) = (1.5 * resistance, constant, gear);
            (motor.current_limit, motor.rotor_inertia) = (limit, draw(4e-5, 1.5e-4));
            parameters.joint.load.inertia = gear * gear * motor.rotor_inertia * draw(0.2, 1.0);
        }
        let torque = constant * current * gear;
        let friction = &mut parameters.joint.friction;
        // The reference's friction, for a joint of another strength.
        let scale = draw(0.02, 0.08) * torque / friction.coulomb.forward;
        for part in [&mut friction.coulomb, &mut friction.breakaway, &mut friction.viscous] {
            part.forward *= scale;
            part.backward *= scale;
        }
        friction.bristle_stiffness *= scale;
        friction.bristle_damping *= scale;
        for ripple in &mut friction.ripple {
            ripple.amplitude *= scale;
        }
        let windings = &mut parameters.windings;
        windings.pole_pairs = pole_pairs as usize;
        windings.inductance_d = (resistance * draw(3e-4, 2e-3)).max(4e-5);
        windings.inductance_q = windings.inductance_d * draw(1.0, 1.4);
        windings.electrical_zero = draw(-PI, PI);
        windings.phase_order = if draw(0.0, 1.0) < 0.5 { PhaseOrder::Forward } else { PhaseOrder::Exchanged };
        windings.cogging.amplitude = constant * limit * draw(0.001, 0.01);
        windings.cogging.periods_per_turn = pole_pairs * if draw(0.0, 1.0) < 0.5 { 6.0 } else { 12.0 };
        let sensor = &mut parameters.sensors.encoder;
        (sensor.eccentricity, sensor.eccentricity_phase) = (draw(0.001, 0.006), draw(-PI, PI));
        let counts = if incremental { COUNTS[(draw(0.0, 5.0)) as usize] } else { 16_384 };
        let encoder = Encoder { counts, reversed: draw(0.0, 1.0) < 0.5, offset: draw(0.0, 1.0) };
        let plan = Plan {
            current_limit: Some(limit),
            counts: incremental.then_some(counts),
            pole_pairs: Some(pole_pairs as u32),
            torque_constant: Some(constant),
            gear: Some(gear),
            ..Plan::new(current)
        };
        Self { parameters, encoder, plan }
    }

    /// A new board with this motor, and a node id.
    pub fn board<W: Wired>(&self, board: fn(Drivetrain) -> W, program: &Program) -> Result<Bench<W>, Failed> {
        let mut bench = Bench::with_encoder(board, &self.parameters, self.encoder, program)?;
        bench.run(0.2)?;
        bench.give_node_id(NODE)?;
        Ok(bench)
    }

    /// The joint's forward is the plant's (1), or backward (-1): a field that turns forward turns the rotor so.
    fn sign(&self) -> f64 {
        if self.parameters.windings.phase_order == PhaseOrder::Exchanged { -1.0 } else { 1.0 }
    }

    /// Direction and electrical zero as they are, turns.
    fn truth(&self) -> (bool, f64) {
        let windings = &self.parameters.windings;
        let phases = self.sign();
        let direction = if self.encoder.reversed { -phases } else { phases };
        let pole_pairs = windings.pole_pairs as f64;
        // An incremental encoder counts the edges that it has passed: on average it reads half a count less, and the
        // joint goes by what it reads.
        let less = self.plan.counts.map_or(0.0, |counts| 0.5 / f64::from(counts));
        let reading = self.encoder.offset - less;
        (direction < 0.0, direction * pole_pairs * reading - phases * windings.electrical_zero / TAU)
    }

    /// Defects of what was found, and how far it is off.
    fn judge(&self, found: &Found) -> Result<String, String> {
        let ActuatorParameters { joint, windings, inverter, .. } = &self.parameters;
        let resistance = joint.motor.resistance / 1.5 + inverter.on_resistance;
        let off = |found: f64, exact: f64| 100.0 * (found / exact - 1.0);
        let (reversed, zero) = self.truth();
        let alignment = &found.alignment;
        let turns = alignment.zero.value - zero;
        let zero = 360.0 * (turns - turns.round());
        let parts = [
            off(found.resistance.resistance.value, resistance),
            off(found.inductance.d.value, windings.inductance_d),
            off(found.inductance.q.value, windings.inductance_q),
        ];
        let by_emf = alignment.torque_constant();
        let (constant, uncertain) = (off(by_emf.value, joint.motor.torque_constant), 100.0 * by_emf.relative());
        let [r, d, q] = parts;
        let told = format!(
            "R {r:+.2} %, L_d {d:+.2} %, L_q {q:+.2} %, zero {zero:+.2} deg, K_t {constant:+.1} % of {uncertain:.0}, {} pole pairs",
            alignment.pole_pairs
        );
        let right = parts.iter().all(|part| part.abs() <= 100.0 * WINDING)
            && zero.abs() <= ZERO
            && (by_emf.value - joint.motor.torque_constant).abs() <= by_emf.error
            && (alignment.pole_pairs as usize, alignment.reversed) == (windings.pole_pairs, reversed);
        if right { Ok(told) } else { Err(told) }
    }
}

fn is_commissioned<W: Wired>(board: &'static str, wired: fn(Drivetrain) -> W, seed: u64) -> Result<(), Failed> {
    let motor = Motor::random(seed, board == ESC1);
    let bench = motor.board(wired, built(board)?)?;
    let (on_board, mut telling) = OnBoard::new(bench, NODE);
    let mut joint = Joint::new(on_board);
    let begun = joint.objects().bench.emulation.now();
    let found = commission(&mut joint, &motor.plan, &mut telling);
    let told = telling.told.join("\n");
    let bench = &mut joint.objects().bench;
    let seconds = (bench.emulation.now().0 - begun.0) as f64 * 1e-12;
    if bench.board().drivetrain().is_switching() {
        return Err(format!("the bridge is on afterwards:\n{told}").into());
    }
    let log = bench.log();
    let found = found.map_err(|failure| format!("{failure}\n{told}\n{log}"))?;
    let judged = motor.judge(&found).map_err(|wrong| format!("{wrong}\n{told}"))?;
    println!("| {board} | {seed} | {judged} | {seconds:.1} s |");
    if (board == ESC1) != found.index.is_some() {
        return Err(format!("the encoder's index: {:?}\n{told}", found.index).into());
    }
    if found.turned.is_none() {
        return Err("the motor was not turned".into());
    }
    let condition = joint.condition().map_err(|stopped| stopped.to_string())?;
    if !condition.faults.is_empty() {
        return Err(format!("a fault is left: {}\n{told}", condition.faults).into());
    }
    // The results outlast a loss of power.
    joint.objects().bench.restart(NODE)?;
    for (setting, wanted) in &found.settings {
        let kept = joint.setting(*setting).map_err(|stopped| stopped.to_string())?;
        if (kept - wanted).abs() > 1e-6 * wanted.abs() + 1e-9 {
            return Err(format!("{setting:?} is {kept} after a loss of power, {wanted} was taken").into());
        }
    }
    Ok(())
}

/// A joint of the B-G431B-ESC1 that is commissioned loses its power: it is not ready before its encoder's index has
/// been met once more, as `jointctl commission --index-only` has it, and turns then by what is in its flash.
fn turns_again(seed: u64) -> Result<(), Failed> {
    let motor = Motor::random(seed, true);
    let bench = motor.board(BG431BEsc1::new, built(ESC1)?)?;
    let (on_board, mut telling) = OnBoard::new(bench, NODE);
    let mut joint = Joint::new(on_board);
    let stopped = |stopped: Stopped| stopped.to_string();
    commission(&mut joint, &motor.plan, &mut telling)
        .map_err(|failure| format!("{failure}\n{}", telling.told.join("\n")))?;
    let gear = joint.setting(Setting::GearRatio).map_err(stopped)?;
    // Difference of the link's position and the one that the joint tells: it stays, but for whole turns of the rotor.
    let between = |joint: &mut Joint<OnBoard<'_, BG431BEsc1>>| -> Result<f64, String> {
        let [position, ..] = joint.motion().map_err(stopped)?;
        let link = joint.objects().bench.board().drivetrain().actuator().state().joint.position;
        Ok(gear * (position - motor.sign() * link) / TAU)
    };
    let before = between(&mut joint)?;

    joint.objects().bench.restart(NODE)?;
    joint.pass(0.5).map_err(stopped)?;
    let lost = joint.condition().map_err(stopped)?;
    if (lost.state.as_str(), lost.faults.as_str()) != (condition::name(State::NotReadyToSwitchOn), "") {
        return Err(format!("after the loss of power it is {} ({})", lost.state, lost.faults).into());
    }
    if joint.begin_motion(Motion::Velocity).is_ok() {
        return Err("it is enabled without its index".into());
    }
    let index = find_index(&mut joint, &motor.plan, &mut telling)
        .map_err(|failure| format!("{failure}\n{}", telling.told.join("\n")))?;
    if index.turns == 0.0 {
        return Err("the index was known before".into());
    }
    joint.pass(0.1).map_err(stopped)?;
    let found = joint.condition().map_err(stopped)?;
    if (found.state.as_str(), found.faults.as_str()) != (condition::name(State::SwitchOnDisabled), "") {
        return Err(format!("with its index it is {} ({})", found.state, found.faults).into());
    }
    let off = between(&mut joint)? - before;
    if (off - off.round()).abs() > OFF {
        return Err(format!("the joint's position is off by {off} turns of the rotor").into());
    }

    for way in [1.0, -1.0] {
        let wanted = way * TAU * SPEED / gear;
        joint.begin_motion(Motion::Velocity).map_err(stopped)?;
        let mut follow = |seconds: f64| -> Result<f64, Failed> {
            let link = |joint: &mut Joint<OnBoard<'_, BG431BEsc1>>| {
                let bench = &mut joint.objects().bench;
                let now = bench.emulation.now().seconds();
                (now, motor.sign() * bench.board().drivetrain().actuator().state().joint.position)
            };
            let (from, begun) = link(&mut joint);
            for _ in 0..(seconds / PERIOD) as u32 {
                joint.move_to(wanted).map_err(stopped)?;
                joint.pass(PERIOD).map_err(stopped)?;
                // It is enabled still.
                joint.motion().map_err(stopped)?;
            }
            let (to, ended) = link(&mut joint);
            Ok((ended - begun) / (to - from))
        };
        follow(TURNING)?;
        let velocity = follow(TURNING)?;
        println!("| {ESC1} | {seed} | {:.3} turns | {velocity:+.4} rad/s, wanted {wanted:+.4} |", index.turns);
        if (velocity / wanted - 1.0).abs() > RIGHT {
            return Err(format!("it turns at {velocity} rad/s, {wanted} was wanted").into());
        }
        joint.off().map_err(stopped)?;
    }
    Ok(())
}
