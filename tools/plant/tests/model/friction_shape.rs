//! Laws in which friction departs from the firmware's model.

use plant::JointParameters;
use plant::friction::{Bristles, FrictionParameters, Surroundings};
use plant::friction_shape::{FrictionShape, Rest};

const STEP: f64 = 5e-5;

fn with(shape: FrictionShape) -> FrictionParameters {
    let plain = JointParameters::reference().with_plain_friction().friction;
    FrictionParameters { shape: Some(shape), ..plain }
}

/// Friction after `seconds` at a velocity, Nm.
fn dragged(bristles: &mut Bristles, friction: &FrictionParameters, velocity: f64, seconds: f64) -> f64 {
    let mut torque = 0.0;
    for _ in 0..(seconds / STEP) as usize {
        torque = bristles.drag(friction, velocity, &Surroundings::default(), STEP);
    }
    torque
}

#[test]
fn the_models_own_laws_are_a_shape_like_any_other() {
    let own = JointParameters::reference().friction;
    let shaped = FrictionParameters { shape: Some(FrictionShape::MODEL), ..own };
    let around = Surroundings { position: 0.4, gear_torque: -7.0, temperature: 40.0, relief: 1.0 };
    for velocity in [-2.0, -0.05, 0.0, 0.01, 0.3] {
        let [own, shaped] = [own, shaped].map(|friction| friction.dry_level(velocity, &around));
        assert!((own - shaped).abs() < 1e-12 * own, "{own} and {shaped} at {velocity}");
    }
    assert_eq!(own.viscous_coefficient(0.3, 40.0), shaped.viscous_coefficient(0.3, 40.0));
}

#[test]
fn exponents_and_skew_act_as_their_equations_say() {
    let around = |gear_torque| Surroundings { gear_torque, ..Surroundings::default() };
    // At the Stribeck velocity every exponent leaves a part of 1/e, at four times it e^-(4^a).
    let half = with(FrictionShape { stribeck: 0.5, ..FrictionShape::MODEL });
    for (velocity, exponent) in [(0.06, 1.0f64), (0.24, 2.0)] {
        let expected = 3.0 + 1.2 * (-exponent).exp();
        assert!((half.dry_level(velocity, &around(0.0)) - expected).abs() < 1e-9);
    }
    let viscous = with(FrictionShape { viscous: 0.5, viscous_speed: 4.0, ..FrictionShape::MODEL });
    assert!((viscous.viscous_coefficient(-1.0, 25.0) - 1.2 * 0.26f64.powf(-0.5)).abs() < 1e-9);
    let loaded = FrictionParameters {
        gear_loss: 0.1,
        ..with(FrictionShape { load: 0.5, load_torque: 4.0, ..FrictionShape::MODEL })
    };
    // 0.1 x 4 x sqrt(16 / 4) = 0.8 Nm.
    assert!((loaded.dry_level(5.0, &around(-16.0)) - 3.8).abs() < 1e-9);
    let mut rippled = with(FrictionShape { ripple_skew: 0.7, ..FrictionShape::MODEL });
    (rippled.ripple[0].amplitude, rippled.ripple[0].periods_per_revolution, rippled.ripple[0].phase) = (0.1, 1.0, 0.0);
    let at = |position| rippled.dry_level(5.0, &Surroundings { position, ..Surroundings::default() }) / 3.0 - 1.0;
    let phase = 0.5f64;
    assert!((at(phase) - 0.1 * (phase + 0.7 * phase.sin()).sin()).abs() < 1e-9);
}

#[test]
fn the_level_answers_to_the_speed_of_a_lag_before() {
    // Bristles that are bent in no time.
    let stiff = |shape| FrictionParameters { bristle_stiffness: 1e6, bristle_damping: 0.0, ..with(shape) };
    let lagged = stiff(FrictionShape { lag: 0.02, ..FrictionShape::MODEL });
    let mut bristles = Bristles::default();
    dragged(&mut bristles, &lagged, 0.5, 0.5);
    // From a speed at which dry friction is 3 Nm to one at which it is nearly 4.2: at first it stays.
    let soon = dragged(&mut bristles, &lagged, 0.005, 0.005);
    let late = dragged(&mut bristles, &lagged, 0.005, 0.3);
    assert!(soon < 3.2 && late > 4.1, "{soon} Nm after 5 ms, {late} Nm after 0.3 s");
    let mut prompt = Bristles::default();
    let plain = stiff(FrictionShape::MODEL);
    dragged(&mut prompt, &plain, 0.5, 0.5);
    assert!(dragged(&mut prompt, &plain, 0.005, 0.005) > 4.0);
}

#[test]
fn rest_raises_friction_and_a_way_of_motion_undoes_it() {
    let aging = Rest { rise: 0.2, time: 1.0, way: 0.01 };
    let film = Rest { rise: 0.5, time: 2.0, way: 0.5 };
    let resting = with(FrictionShape { aging, film, ..FrictionShape::MODEL });
    let after = |rest: f64, way: f64| {
        let mut bristles = Bristles::default();
        dragged(&mut bristles, &resting, 0.0, rest);
        dragged(&mut bristles, &resting, 1.0, way)
    };
    let rested = after(0.0, 3.0);
    // In steady motion a fifth of the film's rise stays, 0.5 rad / (0.5 rad + 2 s x 1 rad/s); what rest adds to it
    // falls at 1 / (2 s) + 1 rad/s / 0.5 rad. Aging is gone by then.
    let film_left = 0.5 * 1.2 * 0.8 * (-2.5 * 0.06f64).exp();
    let left = after(20.0, 0.06) - rested;
    assert!((left - film_left).abs() < 0.01, "{left} Nm, expected {film_left} Nm");
    // Dry friction of 3 Nm by 0.2 x (1 - e^-1) after a time constant, a fifth of the way on.
    let film = Rest::NONE;
    let dry = with(FrictionShape { aging, film, ..FrictionShape::MODEL });
    let mut bristles = Bristles::default();
    dragged(&mut bristles, &dry, 0.0, 1.0);
    let raised = dragged(&mut bristles, &dry, 1.0, 0.005) - 1.2 - 3.0;
    let expected = 3.0 * 0.2 * (1.0 - (-1.0f64).exp()) * (-0.5f64).exp();
    assert!((raised - expected).abs() < 0.1 * expected, "{raised} Nm, expected {expected} Nm");
    let gone = dragged(&mut bristles, &dry, 1.0, 0.2) - 1.2 - 3.0;
    assert!(gone < 0.02 * expected + 0.006, "{gone} Nm are left");
}

#[test]
fn running_in_takes_its_part_of_the_dry_friction_with_the_way() {
    let fresh = with(FrictionShape { run_in: 0.2, run_in_way: 5.0, ..FrictionShape::MODEL });
    let mut bristles = Bristles::default();
    let first = dragged(&mut bristles, &fresh, 1.0, 0.05);
    let after = dragged(&mut bristles, &fresh, 1.0, 4.95);
    assert!((first - 4.2).abs() < 0.05, "{first}");
    let expected = 1.2 + 3.0 * (1.0 - 0.2 * (1.0 - (-1.0f64).exp()));
    assert!((after - expected).abs() < 0.01, "{after} Nm, expected {expected} Nm");
}

#[test]
fn it_is_passive_whatever_it_remembers() {
    for seed in 0..40 {
        let friction = plant::ActuatorParameters::judging(seed).joint.friction;
        let mut bristles = Bristles::default();
        let (mut work, mut least) = (0.0, 0.0f64);
        for n in 0..40_000 {
            let time = f64::from(n) * STEP;
            // Fast, slow, reversals and rests.
            let velocity = (3.0 * time).sin().powi(3) + 0.02 * (170.0 * time).sin();
            let velocity = if time % 0.7 < 0.2 { 0.0 } else { velocity };
            let around = Surroundings { gear_torque: 5.0 * (7.0 * time).sin(), ..Surroundings::default() };
            work += bristles.drag(&friction, velocity, &around, STEP) * velocity * STEP;
            least = least.min(work - bristles.energy(&friction));
        }
        assert!(least > -1e-9, "friction {seed} gave {least} J");
        assert!(work > 0.0);
    }
}

#[test]
fn shapes_out_of_range_are_refused_by_name() {
    let refused = |change: fn(&mut FrictionShape)| {
        let mut shape = FrictionShape::MODEL;
        change(&mut shape);
        with(shape).validate().err().map_or_else(String::new, |error| error.to_string())
    };
    assert_eq!(refused(|s| s.stribeck = 0.3), "");
    assert_eq!(refused(|s| s.lag = 0.2), "");
    assert_eq!(refused(|s| s.aging.rise = 2.0), "");
    for (change, name) in [
        ((|s| s.stribeck = 0.29) as fn(&mut FrictionShape), "friction.shape.stribeck"),
        (|s| s.viscous = 2.1, "friction.shape.viscous"),
        (|s| s.load = f64::NAN, "friction.shape.load"),
        (|s| s.ripple_skew = 0.91, "friction.shape.ripple_skew"),
        (|s| s.lag = 0.21, "friction.shape.lag"),
        (|s| s.aging.rise = 2.1, "friction.shape.aging.rise"),
        (|s| s.film.way = 0.0, "friction.shape.film.way"),
        (|s| s.run_in = 1.01, "friction.shape.run_in"),
    ] {
        assert!(refused(change).starts_with(name), "{name}: {}", refused(change));
    }
}
