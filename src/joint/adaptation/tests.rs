//! A joint that moves to and fro, and friction, gravity, inertia and hands that are known.

use super::super::motion_law::Wanted;
use super::*;
use friction_compensation::compensation::Output;
use friction_compensation::quantity::Torque;

const SETTINGS: Settings = Settings {
    request: AdaptationRequest::On,
    gain: 0.8,
    for_reference: true,
    uncertain: 0.6,
    standstill: 0.01,
    torque_limit: 20.0,
    velocity_limit: 4.0,
    acceleration: 30.0,
};

/// Ground truth of a joint that moves to and fro, once in 2 s and 1.5 rad/s at the fastest.
#[derive(Clone, Copy)]
struct Truth {
    factor: f64,
    viscous: f64,
    /// Torque on the link beside gravity, Nm, at a time, s, and a velocity, rad/s.
    external: fn(f64, f64) -> f64,
}

const IMAGE: Truth = Truth { factor: 1.0, viscous: 0.0, external: |_, _| 0.0 };

/// Image's friction, Nm.
fn friction(velocity: f64) -> f64 {
    2.0 * (velocity / 0.05).tanh() + 0.3 * velocity
}

/// The look at a time, s.
fn look(truth: &Truth, time: f64) -> Telemetry {
    let omega = core::f64::consts::PI;
    let (sin, cos) = (omega * time).sin_cos();
    let (position, velocity, acceleration) = (1.5 / omega * sin, 1.5 * cos, -1.5 * omega * sin);
    let given = truth.factor * friction(velocity) + truth.viscous * velocity + (truth.external)(time, velocity);
    let torque = given + 0.4 * acceleration + 3.0 * position.sin() + 0.2 * position.cos();
    let mut telemetry = Telemetry::NOTHING;
    telemetry.state = State::OperationEnabled;
    telemetry.motion.position = position as f32;
    telemetry.motion.velocity = velocity as f32;
    telemetry.mean_torque = torque as f32;
    telemetry.wanted = Wanted { velocity: Some(velocity as f32), ..Wanted::default() };
    let image = f64::from(SETTINGS.gain) * friction(velocity);
    telemetry.compensated.output = Output {
        torque: Torque::from_bits((image * 65_536.0) as i32),
        acting: Acting::Physical,
        reason: Reason::NoNetwork,
        ..Output::NOTHING
    };
    telemetry
}

/// Moves on from a time, s, for another, and returns what acts in the end.
fn moved(adaptation: &mut Adaptation, truth: &Truth, from: u32, seconds: u32) -> Factors {
    let looks = from * 1_000..(from + seconds) * 1_000;
    looks.fold(Factors::IMAGE, |_, n| adaptation.look(&SETTINGS, &look(truth, f64::from(n) * 1e-3)))
}

#[test]
fn friction_is_learned_and_gravity_inertia_and_a_steady_push_are_not_taken_for_it() {
    let truths = [(1.0, 0.0), (0.7, 0.0), (1.3, 0.2), (0.4, 0.0), (2.0, -0.1)];
    for (factor, viscous) in truths {
        for external in [|_, _| 0.0, |_, _| 1.5] as [fn(f64, f64) -> f64; 2] {
            let mut adaptation = Adaptation::NOTHING;
            let found = moved(&mut adaptation, &Truth { factor, viscous, external }, 0, 20);
            let off = [found.factor - factor as f32, found.viscous - viscous as f32].map(f32::abs);
            assert!(off[0] < 0.03 && off[1] < 0.05, "{factor}, {viscous}: {found:?}");
            assert!(adaptation.report(&SETTINGS).deviation < 0.1);
        }
    }
}

#[test]
fn what_acts_stays_in_its_box() {
    for (factor, expected) in [(0.1, 0.25), (0.2, 0.25), (0.3, 0.3), (2.4, 2.4), (2.6, 2.5), (4.0, 2.5)] {
        let found = moved(&mut Adaptation::default(), &Truth { factor, ..IMAGE }, 0, 30);
        assert!((found.factor - expected).abs() < 0.03, "{factor}: {found:?}");
    }
    let mut adaptation = Adaptation::NOTHING;
    let found = moved(&mut adaptation, &Truth { viscous: 6.0, ..IMAGE }, 0, 30);
    assert_eq!(found.viscous, adaptation.viscous_bound(&SETTINGS));
}

#[test]
fn the_image_acts_until_something_is_learned_and_where_adaptation_is_off_or_in_shadow() {
    let truth = Truth { factor: 0.5, ..IMAGE };
    for request in [AdaptationRequest::Off, AdaptationRequest::Shadow] {
        let settings = Settings { request, ..SETTINGS };
        let mut adaptation = Adaptation::NOTHING;
        for n in 0..20_000 {
            let acts = adaptation.look(&settings, &look(&truth, f64::from(n) * 1e-3));
            assert_eq!(acts, Factors::IMAGE);
        }
        let learned = adaptation.report(&settings).factors.factor;
        let expected = if request == AdaptationRequest::Off { 1.0 } else { 0.5 };
        assert!((learned - expected).abs() < 0.03, "{learned}");
    }
    let mut adaptation = Adaptation::NOTHING;
    moved(&mut adaptation, &truth, 0, 20);
    adaptation.look(&Settings { request: AdaptationRequest::Off, ..SETTINGS }, &look(&truth, 0.0));
    assert_eq!(adaptation, Adaptation::NOTHING, "off forgets");
}

#[test]
fn nothing_is_learned_from_a_joint_that_its_command_does_not_move() {
    let learning = |change: fn(&mut Telemetry)| {
        let mut telemetry = look(&IMAGE, 0.0);
        change(&mut telemetry);
        let mut adaptation = Adaptation::NOTHING;
        for _ in 0..100 {
            adaptation.look(&SETTINGS, &telemetry);
        }
        assert_eq!(adaptation.rows > 0, adaptation.learning == Learning::Learns);
        adaptation.learning
    };
    type Change = fn(&mut Telemetry);
    let changes: [(Change, Learning); 16] = [
        (|_| (), Learning::Learns),
        (|t| t.wanted.velocity = None, Learning::NotPushed),
        (|t| (t.wanted.velocity, t.wanted.push) = (None, 0.1), Learning::Learns),
        (|t| (t.wanted.velocity, t.wanted.push) = (None, -0.1), Learning::NotPushed),
        (|t| t.wanted.velocity = Some(0.0), Learning::NotPushed),
        (|t| t.wanted.velocity = Some(-1.0), Learning::NotPushed),
        (|t| t.wanted.velocity = Some(0.019), Learning::NotPushed),
        (|t| t.wanted.velocity = Some(0.021), Learning::Learns),
        (|t| t.motion.velocity = 0.019, Learning::Standstill),
        (|t| t.motion.velocity = 0.021, Learning::Learns),
        (|t| t.mean_torque = 18.9, Learning::Learns),
        (|t| t.mean_torque = -19.1, Learning::Limited),
        (|t| t.compensated.output.limited = true, Learning::Limited),
        (|t| t.compensated.output.acting = Acting::Nothing, Learning::NothingActs),
        (|t| t.state = State::QuickStopActive, Learning::NotEnabled),
        (
            |t| {
                t.compensated.output.reason =
                    Reason::OutsideTrainedBox(friction_compensation::friction::state::Signal::Velocity)
            },
            Learning::OutsideTrainedBox,
        ),
    ];
    for (n, (change, expected)) in changes.into_iter().enumerate() {
        assert_eq!(learning(change), expected, "change {n}");
    }
}

#[test]
fn a_hand_on_a_joint_that_knows_its_friction_changes_nothing_and_a_lasting_change_is_learned() {
    let mut adaptation = Adaptation::NOTHING;
    let before = moved(&mut adaptation, &IMAGE, 0, 20);
    // Against the motion, as friction is; for 4 s.
    let hand = Truth { external: |_, velocity| 1.5 * velocity.signum(), ..IMAGE };
    let during = moved(&mut adaptation, &hand, 20, 4);
    assert_eq!(adaptation.learning, Learning::Touched);
    assert_eq!(before, during);
    let after = moved(&mut adaptation, &IMAGE, 24, 4);
    assert_eq!(adaptation.learning, Learning::Learns);
    assert!((after.factor - 1.0).abs() < 0.02, "{after:?}");
    let changed = Truth { factor: 0.3, ..IMAGE };
    let early = moved(&mut adaptation, &changed, 28, 8);
    assert!((early.factor - 1.0).abs() < 0.02, "{early:?}");
    let late = moved(&mut adaptation, &changed, 36, 20);
    assert!((late.factor - 0.3).abs() < 0.05, "{late:?}");
}

#[test]
fn a_row_is_a_touched_joints_from_four_standard_deviations_on() {
    let mut adaptation = Adaptation::NOTHING;
    moved(&mut adaptation, &IMAGE, 0, 20);
    let deviation = square_root(adaptation.noise);
    for (left, touched) in [(3.9, false), (4.1, true)] {
        assert_eq!(adaptation.clone().is_touched(left * deviation), touched, "{left}");
    }
    // Not before it knows its friction.
    assert!(!Adaptation::default().is_touched(1e3));
    let mut twice = adaptation;
    twice.deviation = 1.01 * KNOWN.1;
    assert!(!twice.is_touched(1e3));
}

#[test]
fn what_is_not_a_number_leaves_nothing_behind() {
    for (value, n) in [f32::NAN, f32::INFINITY, 1e30].into_iter().flat_map(|value| (0..3).map(move |n| (value, n))) {
        let mut adaptation = Adaptation::NOTHING;
        for row in 0..2_000 {
            let mut telemetry = look(&IMAGE, f64::from(row) * 1e-3);
            if row == 500 {
                match n {
                    0 => telemetry.mean_torque = value,
                    1 => telemetry.motion.position = value,
                    _ => telemetry.motion.velocity = value,
                }
            }
            let acts = adaptation.look(&SETTINGS, &telemetry);
            assert!(acts.factor >= FACTOR.0 && acts.factor <= FACTOR.1 && acts.viscous.is_finite());
        }
        let found = moved(&mut adaptation, &IMAGE, 2, 60);
        assert!((found.factor - 1.0).abs() < 0.05, "{value} as signal {n}: {found:?}");
    }
}

#[test]
fn an_image_misfits_from_a_fifth_and_two_deviations_on() {
    for (off, misfits) in [(0.299, false), (0.301, true), (-0.299, false), (-0.301, true)] {
        let factors = Factors { factor: 1.0 + off, viscous: 0.0 };
        assert_eq!(Report { factors, deviation: 0.05, learning: Learning::Learns }.misfits(), misfits, "{off}");
    }
    assert!(!Report::default().misfits());
}

#[test]
fn the_weights_fall_to_a_third_within_the_memory() {
    assert!((f64::from(FORGETTING) - f64::from(-ROW / MEMORY).exp()).abs() < 1e-7);
}

#[test]
fn what_was_learned_beyond_the_image_goes_as_the_energy_guard_takes_the_uncertain_part() {
    let learned = |factor, viscous| Factors { factor, viscous };
    let mut telemetry = Telemetry::NOTHING;
    let mut guarded = |velocity: f32, permitted: f32, reference: Option<f32>, settings: &Settings, factors: Factors| {
        telemetry.motion.velocity = velocity;
        telemetry.compensated.permitted = permitted;
        telemetry.wanted.velocity = reference;
        factors.guarded(settings, &telemetry)
    };
    let near = |found: Factors, factor: f32, viscous: f32| {
        let off = [found.factor - factor, found.viscous - viscous].map(f32::abs);
        assert!(off.iter().all(|off| *off < 1e-6), "{found:?} for {factor}, {viscous}");
    };
    for direction in [1.0, -1.0] {
        // The guard takes 0.6 at the most; at half of the standstill velocity half of the compensation is there.
        for (velocity, permitted, left) in [
            (1.0, 1.0, 1.0),
            (1.0, 0.7, 0.5),
            (1.0, 0.4, 0.0),
            (1.0, 0.1, 0.0),
            (0.005, 0.5, 1.0),
            (0.005, 0.35, 0.5),
            (0.0, 0.0, 1.0),
        ] {
            let found = guarded(direction * velocity, permitted, None, &SETTINGS, learned(1.8, 0.2));
            near(found, 1.0 + 0.8 * left, 0.2 * left);
        }
        near(guarded(direction, 0.4, None, &SETTINGS, learned(0.5, -0.2)), 0.5, -0.2);
        near(guarded(direction, 0.4, None, &SETTINGS, learned(1.8, -0.2)), 1.0, -0.2);
        // A feedforward is not guarded, and one of the measured velocity is.
        assert_eq!(guarded(direction, 0.4, Some(direction), &SETTINGS, learned(1.8, 0.2)), learned(1.8, 0.2));
        let measured = Settings { for_reference: false, ..SETTINGS };
        near(guarded(direction, 0.4, Some(direction), &measured, learned(1.8, 0.2)), 1.0, 0.0);
        // Nothing is uncertain: nothing is withheld.
        let certain = Settings { uncertain: 0.0, ..SETTINGS };
        assert_eq!(guarded(direction, 1.0, None, &certain, learned(1.8, 0.2)), learned(1.8, 0.2));
    }
    assert_eq!(guarded(f32::NAN, f32::NAN, None, &SETTINGS, Factors::IMAGE), Factors::IMAGE);
}
