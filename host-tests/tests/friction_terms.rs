//! The physical model is the design's equation, term by term, within 0.05 % of each term's full scale; a term that is
//! switched off contributes nothing.

use friction_compensation::friction::domain::Domain;
use friction_compensation::friction::physical::{Coefficients, Dimension, Physical, PhysicalParameters, Terms};
use friction_compensation::friction::state::{SIGNALS, Signal};
use host_tests::parameters::{bits, full_scale, tame_domain, tame_physical};
use host_tests::states::within;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::{E, PI};

/// The stored coefficients in SI, by name.
struct Si([f64; Coefficients::COUNT]);

impl Si {
    fn of(domain: &Domain, coefficients: &Coefficients) -> Self {
        let mut si = coefficients.to_array().map(|stored| stored as f64 / 65536.0);
        for (value, Dimension { per, .. }) in si.iter_mut().zip(Coefficients::DIMENSIONS) {
            *value /= per.map_or(1.0, |(signal, power)| full_scale(domain, signal).powi(power as i32));
        }
        Self(si)
    }

    fn get(&self, name: &str) -> f64 {
        self.0[Coefficients::NAMES.iter().position(|other| *other == name).expect("a coefficient's name")]
    }
}

/// The design's equation, section "Friction".
fn equation(terms: Terms, si: &Si, domain: &Domain, signals: &[i32; SIGNALS]) -> f64 {
    let signal = |signal: Signal| signals[signal as usize] as f64 / 65536.0;
    let (q, v, tau) = (signal(Signal::Position), signal(Signal::Velocity), signal(Signal::TheoreticalTorque));
    let (a, th) =
        (signal(Signal::Acceleration), signal(Signal::Temperature) - domain.reference_temperature as f64 / 65536.0);
    let on = |term: Terms, value: f64| if terms.contains(term) { value } else { 0.0 };
    let c = |name: &str| si.get(name);
    let direction = if v < 0.0 { "negative" } else { "positive" };
    let directional = |name: &str| c(&format!("{name}_{direction}"));
    let edge = (v * c("coulomb_slope")).tanh();

    let mut torque = on(Terms::CONSTANT, c("constant"));
    torque += on(Terms::POSITION, c("position") * q);
    torque += on(Terms::TEMPERATURE, c("temperature") * th);
    torque += on(Terms::LOAD, c("load") * tau);
    let viscous_factor = 1.0 + on(Terms::VISCOUS_TEMPERATURE, c("viscous_temperature") * th);
    torque += on(Terms::VISCOUS, c("viscous") * viscous_factor * v);
    torque += on(Terms::VISCOUS_ASYMMETRY, c("viscous_asymmetry") * v.abs());
    torque += on(Terms::QUADRATIC, c("quadratic") * v * v.abs());
    let coulomb_factor = 1.0
        + on(Terms::COULOMB_TEMPERATURE, c("coulomb_temperature") * th)
        + on(Terms::COULOMB_LOAD, c("coulomb_load") * tau.abs());
    let coulomb = on(Terms::COULOMB, directional("coulomb"));
    // One direction's weakening passes into the other's along with the Coulomb edge.
    let [forward, backward] = ["positive", "negative"].map(|direction| c(&format!("weakening_{direction}")));
    let amount = 0.5 * (forward + backward) + 0.5 * (forward - backward) * edge;
    let bell = 1.0 - (v * c("weakening_slope")).tanh().powi(2);
    let weakening = 1.0 + on(Terms::VELOCITY_WEAKENING, amount * bell);
    torque += coulomb * coulomb_factor * weakening * edge;
    let u = v * c("stribeck_slope");
    torque += on(Terms::STRIBECK, (2.0 * E).sqrt() * (directional("breakaway") - coulomb) * (-u * u).exp() * u);
    let sign = (c("hysteresis_acceleration_slope") * a).clamp(-1.0, 1.0);
    let argument = c("hysteresis_velocity_slope") * v + c("hysteresis_width") * sign;
    torque += on(Terms::HYSTERESIS, c("hysteresis") * argument.atan());
    for j in 1..=5 {
        let multiple = (2 * j - 1) as f64;
        let [positive, negative] = ["positive", "negative"].map(|direction| c(&format!("harmonic_{direction}_{j}")));
        // One direction's amplitude passes into the other's along with the Coulomb edge.
        let amplitude = 0.5 * (positive + negative) + 0.5 * (positive - negative) * edge;
        let sine = (multiple * c("harmonic_frequency") * q).sin();
        torque += on(Terms::HARMONICS, amplitude * 4.0 * sine / (PI * multiple));
    }
    torque + on(Terms::ROTOR_INERTIA, c("rotor_inertia") * a)
}

/// A term and what it cannot do without.
fn with_base(term: Terms) -> Terms {
    match term {
        Terms::VISCOUS_TEMPERATURE => term.union(Terms::VISCOUS),
        Terms::COULOMB_TEMPERATURE | Terms::COULOMB_LOAD | Terms::VELOCITY_WEAKENING => term.union(Terms::COULOMB),
        _ => term,
    }
}

/// Largest error and full scale over random states in the box.
fn error(random: &mut ChaCha8Rng, domain: &Domain, parameters: &PhysicalParameters, states: usize) -> (f64, f64) {
    let model = Physical::new(parameters, domain);
    let si = Si::of(domain, &parameters.coefficients);
    let (mut worst, mut full_scale) = (0.0f64, 0.0f64);
    for _ in 0..states {
        let mut signals = domain.ranges.map(|range| within(random, range));
        if random.random_bool(0.3) {
            signals[Signal::Velocity as usize] /= 64; // near standstill
        }
        let want = equation(parameters.terms, &si, domain, &signals);
        full_scale = full_scale.max(want.abs());
        worst = worst.max((model.evaluate(&signals).to_f64() - want).abs());
    }
    (worst, full_scale)
}

#[test]
fn each_term_alone_and_all_together_follow_their_formula() {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let single = (0..Terms::COUNT).map(|bit| (Terms::NAMES[bit], with_base(Terms(1 << bit))));
    let combinations = [
        ("all", Terms::ALL),
        ("coulomb and stribeck", Terms::COULOMB.union(Terms::STRIBECK)),
        ("harmonics and coulomb", Terms::HARMONICS.union(Terms::COULOMB)),
    ];
    for (name, terms) in single.chain(combinations) {
        let mut worst = 0.0f64;
        for _ in 0..60 {
            let domain = tame_domain(&mut random);
            let mut parameters = PhysicalParameters { terms, ..tame_physical(&mut random, &domain) };
            // Torques of a large joint: a small joint's are met by the steps of Q16.16 before the formula's error
            // shows.
            let mut array = parameters.coefficients.to_array();
            for (stored, Dimension { torque, .. }) in array.iter_mut().zip(Coefficients::DIMENSIONS) {
                *stored = if torque { stored.saturating_mul(100) } else { *stored };
            }
            parameters.coefficients = Coefficients::from_array(array);
            let (error, full_scale) = error(&mut random, &domain, &parameters, 1500);
            worst = worst.max(error / full_scale);
        }
        println!("{name}: {:.4} % of full scale", 100.0 * worst);
        assert!(worst <= 0.0005, "{name}: {worst}");
    }
}

/// Coefficients that no other term looks at.
fn own_coefficients(term: Terms) -> &'static [&'static str] {
    match term {
        Terms::CONSTANT => &["constant"],
        Terms::POSITION => &["position"],
        Terms::TEMPERATURE => &["temperature"],
        Terms::LOAD => &["load"],
        Terms::VISCOUS => &["viscous"],
        Terms::VISCOUS_TEMPERATURE => &["viscous_temperature"],
        Terms::QUADRATIC => &["quadratic"],
        Terms::COULOMB => &["coulomb_positive", "coulomb_negative"],
        Terms::COULOMB_TEMPERATURE => &["coulomb_temperature"],
        Terms::COULOMB_LOAD => &["coulomb_load"],
        Terms::STRIBECK => &["breakaway_positive", "breakaway_negative", "stribeck_slope"],
        Terms::HYSTERESIS => {
            &["hysteresis", "hysteresis_velocity_slope", "hysteresis_width", "hysteresis_acceleration_slope"]
        }
        Terms::HARMONICS => &[
            "harmonic_frequency",
            "harmonic_positive_1",
            "harmonic_positive_2",
            "harmonic_positive_3",
            "harmonic_positive_4",
            "harmonic_positive_5",
            "harmonic_negative_1",
            "harmonic_negative_2",
            "harmonic_negative_3",
            "harmonic_negative_4",
            "harmonic_negative_5",
        ],
        Terms::VISCOUS_ASYMMETRY => &["viscous_asymmetry"],
        Terms::VELOCITY_WEAKENING => &["weakening_positive", "weakening_negative", "weakening_slope"],
        _ => &["rotor_inertia"],
    }
}

#[test]
fn a_term_that_is_switched_off_contributes_nothing() {
    let mut random = ChaCha8Rng::seed_from_u64(2);
    for bit in 0..Terms::COUNT {
        let term = Terms(1 << bit);
        let mut matters = false;
        for _ in 0..20 {
            let domain = tame_domain(&mut random);
            let with = PhysicalParameters { terms: Terms::ALL, ..tame_physical(&mut random, &domain) };
            let without = PhysicalParameters { terms: Terms(Terms::ALL.0 & !term.0), ..with };
            let mut scrambled = without;
            let mut array = scrambled.coefficients.to_array();
            for (value, name) in array.iter_mut().zip(Coefficients::NAMES) {
                if own_coefficients(term).contains(&name) {
                    *value = bits(&mut random);
                }
            }
            scrambled.coefficients = Coefficients::from_array(array);
            let [with, without, scrambled] = [with, without, scrambled].map(|model| Physical::new(&model, &domain));
            for _ in 0..200 {
                let signals = domain.ranges.map(|range| within(&mut random, range));
                assert_eq!(without.evaluate(&signals), scrambled.evaluate(&signals), "{}", Terms::NAMES[bit]);
                matters |= with.evaluate(&signals) != without.evaluate(&signals);
            }
        }
        assert!(matters, "{} does nothing even when it is on", Terms::NAMES[bit]);
    }
}

#[test]
fn without_terms_friction_is_exactly_zero_in_every_state() {
    let mut random = ChaCha8Rng::seed_from_u64(3);
    for _ in 0..2000 {
        let domain = tame_domain(&mut random);
        let coefficients = Coefficients::from_array(core::array::from_fn(|_| bits(&mut random)));
        let model = Physical::new(&PhysicalParameters { terms: Terms(0), coefficients }, &domain);
        let signals = core::array::from_fn(|_| bits(&mut random));
        assert_eq!(model.evaluate(&signals).to_bits(), 0);
    }
}
