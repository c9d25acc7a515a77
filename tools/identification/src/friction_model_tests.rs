//! Tests of the physical friction: the papers' formulas written out once more, derivatives, and limits.

use super::*;

/// All terms on, all parameters different and none trivial.
fn everything() -> FrictionModel {
    FrictionModel {
        terms: Terms::of(&Term::ALL),
        offset: 0.11,
        position_slope: -0.07,
        temperature_slope: 0.013,
        load_slope: 0.05,
        viscous: 0.9,
        viscous_temperature: -0.011,
        quadratic: -0.08,
        coulomb: Directional { positive: 1.3, negative: 1.1 },
        coulomb_temperature: -0.006,
        coulomb_load: 0.04,
        coulomb_slope: 25.0,
        breakaway: Directional { positive: 1.9, negative: 1.6 },
        stribeck_slope: 6.0,
        hysteresis: 0.21,
        hysteresis_velocity_slope: 3.0,
        hysteresis_width: 0.8,
        hysteresis_acceleration_slope: 0.7,
        harmonic_frequency: 2.2,
        harmonic_positive: [0.10, -0.04, 0.03, 0.02, -0.01],
        harmonic_negative: [0.07, 0.05, -0.02, 0.01, 0.03],
        rotor_inertia: 0.17,
        reference_temperature: 25.0,
        viscous_asymmetry: 0.06,
        weakening: Directional { positive: 0.4, negative: 0.7 },
        weakening_slope: 9.0,
        element_stiffness: [100.0, 20.0, 5.0, 1.0],
        element_level: [0.3, 0.2, 0.15, 0.1],
        ripples: [
            Ripple { frequency: 4.0, level_sine: 0.1, level_cosine: 0.05, torque_sine: -0.02, torque_cosine: 0.03 },
            Ripple { frequency: 50.0, level_sine: -0.04, level_cosine: 0.02, torque_sine: 0.06, torque_cosine: 0.01 },
        ],
        relief: 0.35,
    }
}

fn states() -> Vec<JointState> {
    [
        (0.4, 0.03, -2.0, 3.0, 31.0),
        (-1.1, -0.02, 0.6, -4.0, 22.0),
        (2.0, 1.4, 0.0, 0.5, 25.0),
        (0.3, -0.9, 5.0, 0.0, 40.0),
    ]
    .map(|(position, velocity, acceleration, load, temperature)| JointState {
        position,
        velocity,
        acceleration,
        load,
        temperature,
        bent: [1.0, 0.7, -0.4, 0.0],
        following: !(0.0..=1.0).contains(&load),
    })
    .to_vec()
}

#[test]
fn it_is_the_sum_that_the_design_writes() {
    let m = everything();
    for s in states() {
        let (q, v, a, tau, th) = (s.position, s.velocity, s.acceleration, s.load, s.temperature - 25.0);
        let (fc, fb) = if v < 0.0 { (1.1, 1.6) } else { (1.3, 1.9) };
        let d = (25.0 * v).tanh();
        let u = 6.0 * v;
        let harmonics: f64 = (1..=5)
            .map(|j| {
                let odd = (2 * j - 1) as f64;
                let b = m.harmonic_positive[j - 1] * (1.0 + d) / 2.0 + m.harmonic_negative[j - 1] * (1.0 - d) / 2.0;
                b * 4.0 * (odd * 2.2 * q).sin() / (PI * odd)
            })
            .sum();
        let ripple = |h: f64, a: f64, b: f64| a * (h * q).sin() + b * (h * q).cos();
        let p = if s.following { 0.65 } else { 1.0 };
        let level = p * fc + ripple(4.0, 0.1, 0.05) + ripple(50.0, -0.04, 0.02);
        let weakening = 1.0 + (0.4 * (1.0 + d) / 2.0 + 0.7 * (1.0 - d) / 2.0) * (1.0 - (9.0 * v).tanh().powi(2));
        let pre_sliding = 0.3 * 1.0 + 0.2 * 0.7 - 0.15 * 0.4;
        let by_hand = 0.11 - 0.07 * q + 0.013 * th + 0.05 * tau + 0.9 * (1.0 - 0.011 * th) * v - 0.08 * v * v.abs()
            + 0.06 * v.abs()
            + (1.0 - 0.006 * th + 0.04 * tau.abs()) * weakening * (level * d + pre_sliding)
            + ripple(4.0, -0.02, 0.03)
            + ripple(50.0, 0.06, 0.01)
            + p * (2.0 * 1f64.exp()).sqrt() * (fb - fc) * (-u * u).exp() * u
            + p * 0.21 * (3.0 * v + 0.8 * (0.7 * a).clamp(-1.0, 1.0)).atan()
            + harmonics
            + 0.17 * a;
        assert!((m.friction(&s) - by_hand).abs() < 1e-13, "{} {by_hand}", m.friction(&s));
    }
}

#[test]
fn every_derivative_agrees_with_a_central_difference() {
    let m = everything();
    for s in states() {
        let mut exact = [0.0; FrictionParameter::COUNT];
        m.friction_and_derivatives(&s, |p, d| exact[p.index()] = d);
        for p in FrictionParameter::all() {
            let step = 1e-5 * m.parameter(p).abs().max(0.1);
            let moved = |sign: f64| {
                let mut other = m.clone();
                *other.parameter_mut(p) += sign * step;
                other.friction(&s)
            };
            let difference = (moved(1.0) - moved(-1.0)) / (2.0 * step);
            assert!((difference - exact[p.index()]).abs() < 1e-7, "{p}: {difference} {}", exact[p.index()]);
        }
    }
}

#[test]
fn a_term_that_is_off_contributes_nothing_whatever_its_parameters() {
    let off = FrictionModel { terms: Terms::default(), ..everything() };
    assert!(states().iter().all(|s| off.friction(s) == 0.0));
}

#[test]
fn the_stribeck_peak_is_the_breakaway_friction_over_the_coulomb_friction() {
    let terms = Terms::of(&[Term::Coulomb, Term::Stribeck]);
    let m = FrictionModel { terms, coulomb_slope: 1e4, coulomb_load: 0.0, coulomb_temperature: 0.0, ..everything() };
    let top = JointState { velocity: 0.5f64.sqrt() / m.stribeck_slope, ..JointState::default() };
    assert!((m.friction(&top) - m.breakaway.positive).abs() < 1e-12);
}

#[test]
fn nothing_jumps_when_the_velocity_changes_sign() {
    let m = everything();
    for mut s in states() {
        // Rust 1.95 breaks off at a closure that makes a state from the rest of another one.
        let [above, below] = [1e-9, -1e-9].map(|velocity| {
            s.velocity = velocity;
            m.friction(&s)
        });
        assert!((above - below).abs() < 1e-6);
    }
}

#[test]
fn a_set_of_terms_is_written_as_their_names_and_read_back() {
    let m = FrictionModel { terms: Terms::of(&[Term::Viscous, Term::CoulombLoad]), ..everything() };
    let text = toml::to_string(&m).unwrap();
    assert!(text.contains(r#"terms = ["viscous", "coulomb-load"]"#), "{text}");
    assert_eq!(toml::from_str::<FrictionModel>(&text).unwrap(), m);
}
