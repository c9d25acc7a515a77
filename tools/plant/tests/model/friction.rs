//! Every effect of the bristle friction shows its signature when the velocity is prescribed.

use plant::JointParameters;
use plant::friction::{Bristles, FrictionParameters, Surroundings};

const STEP: f64 = 1e-4;

fn plain() -> FrictionParameters {
    JointParameters::reference().with_plain_friction().friction
}

/// Friction torque (Nm) after `angle` (rad) at a constant velocity (rad/s): far beyond the bristles' deflection.
fn steady(friction: &FrictionParameters, velocity: f64, surroundings: &Surroundings) -> f64 {
    let mut bristles = Bristles::default();
    let steps = (0.05 / velocity.abs() / STEP).ceil() as usize;
    (0..steps).map(|_| bristles.drag(friction, velocity, surroundings, STEP)).last().unwrap()
}

fn assert_near(actual: f64, expected: f64, relative: f64) {
    assert!((actual - expected).abs() <= relative * expected.abs(), "{actual} is not {expected} within {relative}");
}

#[test]
fn friction_falls_with_speed_up_to_the_stribeck_velocity_and_rises_beyond() {
    let friction = plain();
    let at = |ratio: f64| steady(&friction, ratio * friction.stribeck_velocity, &Surroundings::default());
    assert!(at(0.5) < at(0.1) - 0.1);
    assert!(at(1.0) < at(0.5) - 0.1);
    assert!(at(20.0) > at(3.0) + 0.1);
}

#[test]
fn steady_friction_is_the_stribeck_curve_plus_viscous_friction() {
    let friction = plain();
    assert_near(steady(&friction, 0.001, &Surroundings::default()), 4.2, 0.002);
    assert_near(steady(&friction, 0.06, &Surroundings::default()), 3.0 + 1.2 / std::f64::consts::E + 0.072, 1e-6);
    assert_near(steady(&friction, 1.0, &Surroundings::default()), 3.0 + 1.2, 1e-6);
    assert_near(steady(&friction, 4.0, &Surroundings::default()), 3.0 + 4.8, 1e-6);
}

#[test]
fn each_direction_has_its_own_coulomb_breakaway_and_viscous_friction() {
    let friction =
        FrictionParameters { ripple: plain().ripple, gear_loss: 0.0, ..JointParameters::reference().friction };
    let at = |velocity| steady(&friction, velocity, &Surroundings::default());
    assert_near(at(1e-3), 4.2, 0.002);
    assert_near(at(-1e-3), -3.5, 0.002);
    assert_near(at(0.5), 3.0 + 0.6, 1e-6);
    assert_near(at(-0.5), -(2.5 + 0.5), 1e-6);
    assert_near(at(3.0) - at(1.0), 2.0 * 1.2, 1e-6);
    assert_near(at(-3.0) - at(-1.0), -2.0, 1e-6);
}

#[test]
fn before_sliding_the_joint_is_a_spring_of_the_bristles_stiffness() {
    let friction = plain();
    let mut bristles = Bristles::default();
    let velocity = 1e-4;
    let mut torque = 0.0;
    // 0.02 mrad, a fiftieth of the way to breakaway.
    for _ in 0..2000 {
        torque = bristles.drag(&friction, velocity, &Surroundings::default(), STEP);
    }
    assert_near(torque, 4000.0 * 2e-5, 0.05);
    assert_near(bristles.deflection(), 2e-5, 0.05);
    // It comes back on its own track once released: no sliding has happened.
    for _ in 0..2000 {
        torque = bristles.drag(&friction, -velocity, &Surroundings::default(), STEP);
    }
    assert!(torque.abs() < 0.01, "{torque} Nm are left of a spring that was released");
}

/// Work (J) lost in one cycle of a triangular displacement of `amplitude` (rad) at `speed` (rad/s).
fn lost_in_a_cycle(friction: &FrictionParameters, amplitude: f64, speed: f64) -> f64 {
    let mut bristles = Bristles::default();
    let quarter = (amplitude / speed / STEP).round() as usize;
    let mut work = 0.0;
    for cycle in 0..3 {
        for step in 0..4 * quarter {
            let velocity = if (quarter..3 * quarter).contains(&step) { -speed } else { speed };
            let torque = bristles.drag(friction, velocity, &Surroundings::default(), STEP);
            if cycle == 2 {
                work += torque * velocity * STEP;
            }
        }
    }
    work
}

#[test]
fn pre_sliding_motion_makes_a_hysteresis_loop_that_does_not_depend_on_the_speed() {
    let friction = FrictionParameters { bristle_damping: 0.0, ..plain() };
    // 0.2 mrad of the 1.05 mrad to breakaway: the elastic energy at the turning points is 80 microjoule.
    let slow = lost_in_a_cycle(&friction, 2e-4, 5e-4);
    let fast = lost_in_a_cycle(&friction, 2e-4, 1e-3);
    assert!(slow > 5e-6 && slow < 80e-6, "{slow} J lost in a cycle");
    assert_near(fast, slow, 0.02);
    // The loop opens faster than the amplitude squared, as bristles begin to slip.
    let wide = lost_in_a_cycle(&friction, 4e-4, 1e-3);
    assert!(wide > 5.0 * fast, "{wide} J against {fast} J");
}

#[test]
fn friction_lags_behind_a_changing_speed_and_more_so_the_faster_it_changes() {
    let friction = plain();
    // Unidirectional, through the Stribeck region, as in section III-C of the paper.
    let gap = |frequency: f64| {
        let mut bristles = Bristles::default();
        let period = std::f64::consts::TAU / frequency;
        let steps = (period / STEP) as usize;
        let (mut rising, mut falling) = (0.0, 0.0);
        for step in 0..3 * steps {
            let phase = frequency * step as f64 * STEP;
            let velocity = 0.06 - 0.05 * phase.cos();
            let torque = bristles.drag(&friction, velocity, &Surroundings::default(), STEP);
            if step == 2 * steps + steps / 4 {
                rising = torque;
            }
            if step == 2 * steps + 3 * steps / 4 {
                falling = torque;
            }
        }
        rising - falling
    };
    let (slow, fast) = (gap(1.0), gap(10.0));
    assert!(slow > 0.002, "{slow} Nm between rising and falling speed");
    assert!(fast > 4.0 * slow, "{fast} Nm at ten times the frequency, {slow} Nm before");
}

#[test]
fn a_loaded_gear_has_more_dry_friction_whatever_the_sign_of_the_load() {
    let friction = FrictionParameters { gear_loss: 0.05, ..plain() };
    let at = |velocity, gear_torque| steady(&friction, velocity, &Surroundings { gear_torque, ..Default::default() });
    // Nm for each transmitted Nm, on the Coulomb level and in proportion at breakaway.
    assert_near(at(1.0, 20.0) - at(1.0, 0.0), 0.05 * 20.0, 1e-6);
    assert_near(at(1.0, -20.0) - at(1.0, 0.0), 0.05 * 20.0, 1e-6);
    assert_near(at(1e-3, 20.0) - at(1e-3, 0.0), 0.05 * 20.0 * 4.2 / 3.0, 0.01);
}

#[test]
fn a_relieved_joint_has_less_dry_friction_load_included_and_all_of_its_viscous_friction() {
    let friction = FrictionParameters { gear_loss: 0.05, ..plain() };
    let at = |velocity, relief| {
        steady(&friction, velocity, &Surroundings { gear_torque: 20.0, relief, ..Default::default() })
    };
    let viscous = friction.viscous.forward;
    for velocity in [1e-3, 1.0] {
        assert_near(at(velocity, 0.4) - viscous * velocity, 0.4 * (at(velocity, 1.0) - viscous * velocity), 1e-3);
    }
}

#[test]
fn warmth_thins_the_grease_and_lowers_the_dry_friction_a_little() {
    let reference = JointParameters::reference().friction;
    let friction =
        FrictionParameters { viscous_thinning: reference.viscous_thinning, coulomb_thinning: 0.002, ..plain() };
    let at = |velocity, temperature| steady(&friction, velocity, &Surroundings { temperature, ..Default::default() });
    let viscous = |temperature| (at(4.0, temperature) - at(1.0, temperature)) / 3.0;
    let dry = |temperature| at(1.0, temperature) - viscous(temperature);
    assert_near(viscous(45.0) / viscous(25.0), (-0.015_f64 * 20.0).exp(), 1e-6);
    assert_near(dry(45.0) / dry(25.0), (-0.002_f64 * 20.0).exp(), 1e-6);
    assert!(viscous(5.0) > viscous(25.0) && dry(5.0) > dry(25.0));
}

#[test]
fn dry_friction_ripples_with_the_gears_position_and_repeats_every_period() {
    let friction = FrictionParameters { ripple: JointParameters::reference().friction.ripple, ..plain() };
    let mut bristles = Bristles::default();
    let velocity = 0.5;
    let sample = |bristles: &mut Bristles, position: f64| {
        let surroundings = Surroundings { position, ..Default::default() };
        bristles.drag(&friction, velocity, &surroundings, STEP) - 1.2 * velocity
    };
    let mut turn = Vec::new();
    for step in 0..=251_328 {
        // Two revolutions; the first one slides the bristles in.
        let torque = sample(&mut bristles, step as f64 * velocity * STEP);
        if step >= 125_664 {
            turn.push(torque);
        }
    }
    let harmonic = |order: f64| {
        let (mut sine, mut cosine) = (0.0, 0.0);
        for (step, torque) in turn.iter().enumerate() {
            let angle = order * std::f64::consts::TAU * step as f64 / turn.len() as f64;
            sine += torque * angle.sin();
            cosine += torque * angle.cos();
        }
        sine.hypot(cosine) * 2.0 / turn.len() as f64
    };
    assert_near(harmonic(4.0), 3.0 * 0.08, 0.02);
    assert_near(harmonic(50.0), 3.0 * 0.05, 0.05);
    assert!(harmonic(7.0) < 0.003);
}

#[test]
fn friction_never_gives_back_more_energy_than_the_bristles_hold() {
    // Bristle damping far above what a constant sigma1 could carry, so that its fading is needed.
    let mut friction = JointParameters::reference().friction;
    friction.bristle_damping = 2000.0;
    friction.viscous.forward = 0.0;
    friction.viscous.backward = 0.0;
    let mut state = 1_u64;
    let mut random = || {
        // A linear congruential sequence is enough to shake a joint.
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64 * 2.0 - 1.0
    };
    for speed in [1e-3, 0.05, 1.0, 20.0] {
        let mut bristles = Bristles::default();
        let (mut work, mut velocity, mut position) = (0.0, 0.0, 0.0);
        for _ in 0..100_000 {
            velocity += 0.2 * (speed * random() - velocity);
            position += velocity * STEP;
            let surroundings = Surroundings {
                position,
                gear_torque: 40.0 * random(),
                temperature: 25.0 + 30.0 * random(),
                relief: 0.55 + 0.45 * random(),
            };
            let stored = bristles.energy(&friction);
            let done = bristles.drag(&friction, velocity, &surroundings, STEP) * velocity * STEP;
            work += done;
            let lost = done - (bristles.energy(&friction) - stored);
            assert!(lost >= -1e-12 * (1.0 + done.abs()), "{lost} J lost in a step at about {speed} rad/s");
            assert!(work >= -1e-9, "{work} J taken since rest at about {speed} rad/s");
        }
        assert!(work > 0.0);
    }
}

#[test]
fn bristles_a_thousand_times_stiffer_than_the_step_resolves_still_settle() {
    let friction = FrictionParameters { bristle_stiffness: 1e7, ..plain() };
    assert_near(steady(&friction, 10.0, &Surroundings::default()), 3.0 + 12.0, 1e-6);
    let mut bristles = Bristles::default();
    for step in 0..1000 {
        let velocity = if step % 2 == 0 { 10.0 } else { -10.0 };
        let torque = bristles.drag(&friction, velocity, &Surroundings::default(), STEP);
        assert!(torque.abs() < 20.0, "{torque} Nm at {velocity} rad/s");
    }
}
