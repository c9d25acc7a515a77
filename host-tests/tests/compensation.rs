//! Compensation is bounded, falls back by itself, and switched off it is not there.

use friction_compensation::compensation::{Acting, Compensation, Output, Reason, Request, Settings, SettingsError};
use friction_compensation::friction::maxwell_slip::Bent;
use friction_compensation::friction::physical::Terms;
use friction_compensation::friction::regime::{Criterion, Measure, Selector};
use friction_compensation::friction::state::{JointState, SIGNALS, Signal};
use friction_compensation::friction::{FrictionModel, FrictionParameters, ParameterSet};
use friction_compensation::quantity::{Torque, Velocity};
use host_tests::parameters::{bits, extreme, frictionless, q16, range, tame, tame_network};
use host_tests::states::{signals, within};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const RATE: u32 = 20_000;
const REQUESTS: [Request; 4] = [Request::Off, Request::Physical, Request::PhysicalAndNetwork, Request::NetworkInShadow];

/// Settings that limit nothing.
fn unlimited(request: Request) -> Settings {
    Settings::new(request, 1 << 16, Torque::MAX, Torque::MAX, 1).expect("valid")
}

/// Settings of any permitted size, with their clamp and slew limit, Q16.16.
fn any_settings(random: &mut ChaCha8Rng, request: Request) -> (Settings, i32, i32) {
    let (gain, clamp) = (random.random_range(0..=1 << 16), bits(random).saturating_abs());
    let slew = bits(random).saturating_abs().max(RATE as i32);
    let settings = Settings::new(request, gain, Torque::from_bits(clamp), Torque::from_bits(slew), RATE);
    (settings.expect("valid"), clamp, slew)
}

fn state(signals: [i32; SIGNALS]) -> JointState {
    JointState::from_signals(signals)
}

fn any_state(random: &mut ChaCha8Rng, parameters: &FrictionParameters) -> JointState {
    JointState { coupled_velocity: Velocity::from_bits(bits(random)), ..state(signals(random, parameters)) }
}

/// Torques of a loop around a joint of random load: a proportional and derivative law plus whatever `compensation` adds
/// in each state.
fn closed_loop(seed: u64, mut compensation: impl FnMut(&JointState) -> Torque) -> Vec<i32> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let (mut position, mut velocity) = (0i32, 0i32);
    (0..5000)
        .map(|step| {
            let target = if step / 500 % 2 == 0 { q16(1.0) } else { q16(-1.0) };
            let command = (target - position).saturating_mul(20).saturating_sub(velocity.saturating_mul(2));
            let signals = [position, velocity, command, command, q16(30.0), command / 2];
            let torque = Torque::from_bits(command).saturating_add(compensation(&state(signals))).to_bits();
            velocity =
                velocity.saturating_add(torque / 1000 + random.random_range(-300..300)).clamp(-q16(8.0), q16(8.0));
            position = position.saturating_add(velocity / 2000);
            torque
        })
        .collect()
}

#[test]
fn switched_off_or_without_a_model_the_loop_computes_the_bits_of_one_that_never_had_it() {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let mut effective = 0;
    for seed in 0..20 {
        let parameters = tame(&mut random);
        let model = FrictionModel::new(&parameters, RATE);
        let never = closed_loop(seed, |_| Torque::ZERO);
        let on = unlimited(Request::PhysicalAndNetwork);
        let mut object = Compensation::default();
        let with = closed_loop(seed, |state| object.step(Some(&model), &on, state).torque);
        effective += usize::from(with != never);
        // The same object, with everything that it remembers.
        let off = unlimited(Request::Off);
        let switched_off = closed_loop(seed, |state| {
            let output = object.step(Some(&model), &off, state);
            assert_eq!(output, Output { reason: Reason::Off, ..Output::default() });
            output.torque
        });
        assert_eq!(switched_off, never);
        object.step(Some(&model), &on, &any_state(&mut random, &parameters));
        let without_model = closed_loop(seed, |state| {
            let output = object.step(None, &on, state);
            assert_eq!((output.reason, output.acting), (Reason::NoModel, Acting::Nothing));
            output.torque
        });
        assert_eq!(without_model, never);
        // And what was on before leaves no trace when it is switched on again.
        let mut fresh = Compensation::default();
        let again = closed_loop(seed, |state| object.step(Some(&model), &on, state).torque);
        assert_eq!(again, closed_loop(seed, |state| fresh.step(Some(&model), &on, state).torque));
    }
    assert!(effective > 10, "compensation acts in {effective} of 20 loops when it is on");
}

#[test]
fn the_parts_make_the_full_model_and_pre_sliding_is_that_of_all_sets() {
    let mut random = ChaCha8Rng::seed_from_u64(7);
    let (mut networks, mut slides) = (0, 0);
    for _ in 0..200 {
        let parameters = tame(&mut random);
        let model = FrictionModel::new(&parameters, RATE);
        for request in [Request::Physical, Request::PhysicalAndNetwork, Request::NetworkInShadow] {
            let (mut compensation, mut bent) = (Compensation::default(), Bent::default());
            for _ in 0..20 {
                let state = any_state(&mut random, &parameters);
                let output = compensation.step(Some(&model), &unlimited(request), &state);
                let [parts] = output.parts;
                assert_eq!(parts.physical.saturating_add(parts.network), output.shadow, "{parts:?}");
                let acts = if request == Request::PhysicalAndNetwork { output.shadow } else { parts.physical };
                assert_eq!(output.torque, acts, "{request:?} {parts:?}");
                assert_eq!(parts.pre_sliding.to_bits(), model.common(&mut bent, &state).pre_sliding);
                networks += usize::from(parts.network != Torque::ZERO);
                slides += usize::from(parts.pre_sliding != Torque::ZERO);
            }
        }
    }
    assert!(networks > 1_000 && slides > 1_000, "{networks} with network, {slides} with pre-sliding");
}

#[test]
fn the_torque_is_never_beyond_the_clamp_and_never_faster_than_the_slew_limit() {
    let mut random = ChaCha8Rng::seed_from_u64(2);
    let (mut clamped, mut slewed) = (0, 0);
    for _ in 0..1500 {
        let parameters = if random.random_bool(0.7) { tame(&mut random) } else { extreme(&mut random) };
        let model = FrictionModel::new(&parameters, RATE);
        for request in REQUESTS {
            let (settings, clamp, slew) = any_settings(&mut random, request);
            let mut compensation = Compensation::default();
            let mut last = 0;
            let mut moved = 0i64;
            for _ in 0..150 {
                let output = compensation.step(Some(&model), &settings, &any_state(&mut random, &parameters));
                let torque = output.torque.to_bits();
                assert!(torque.saturating_abs() <= clamp, "{output:?} beyond {clamp}");
                assert!(output.shadow.to_bits().saturating_abs() <= clamp, "{output:?} beyond {clamp}");
                let change = (torque as i64 - last as i64).abs();
                assert!(change * RATE as i64 <= slew as i64, "{last} to {torque} with {slew} a second");
                moved += change;
                clamped += usize::from(torque.saturating_abs() == clamp && clamp > 0);
                slewed += usize::from(output.limited && change > 0 && torque.saturating_abs() < clamp);
                last = torque;
            }
            assert!(moved * RATE as i64 <= slew as i64 * 150);
        }
    }
    assert!(clamped > 1000 && slewed > 1000, "{clamped} {slewed}");
}

#[test]
fn a_lowered_clamp_is_reached_at_the_slew_rate() {
    let mut parameters = frictionless();
    parameters.sets[0].physical.terms = Terms::CONSTANT;
    parameters.sets[0].physical.coefficients.constant = q16(5.0);
    let model = FrictionModel::new(&parameters, 1000);
    let settings = |clamp: f64| {
        let clamp = Torque::from_bits(q16(clamp));
        Settings::new(Request::Physical, 1 << 16, clamp, Torque::from_bits(q16(100.0)), 1000).expect("valid")
    };
    let mut compensation = Compensation::default();
    let mut torque = |clamp: f64, steps: usize| {
        let outputs = (0..steps).map(|_| compensation.step(Some(&model), &settings(clamp), &state([0; SIGNALS])));
        outputs.last().expect("at least one step").torque.to_bits()
    };
    assert_eq!(torque(8.0, 60), q16(5.0));
    let per_step = q16(100.0) / 1000;
    assert_eq!(torque(2.0, 1), q16(5.0) - per_step);
    assert_eq!(torque(2.0, 30), q16(2.0));
}

#[test]
fn a_gain_of_zero_gives_nothing_a_gain_of_one_is_exact_and_between_none_adds() {
    let mut random = ChaCha8Rng::seed_from_u64(3);
    for _ in 0..300 {
        let parameters = tame(&mut random);
        let model = FrictionModel::new(&parameters, RATE);
        for _ in 0..40 {
            let state = state(parameters.domain.ranges.map(|range| within(&mut random, range)));
            let first_step = |gain: u32| {
                let settings = Settings::new(Request::PhysicalAndNetwork, gain, Torque::MAX, Torque::MAX, 1);
                Compensation::default().step(Some(&model), &settings.expect("valid"), &state).torque.to_bits()
            };
            let exact = model.step(&state, &mut Default::default()).total().to_bits();
            assert_eq!(first_step(0), 0);
            assert_eq!(first_step(1 << 16), exact);
            let gain = random.random_range(0..1 << 16);
            let part = first_step(gain);
            assert!(
                part.unsigned_abs() <= exact.unsigned_abs() && part as i64 * exact as i64 >= 0,
                "{part} of {exact}"
            );
            assert!((part as f64 - exact as f64 * gain as f64 / 65536.0).abs() <= 1.0, "{part} of {exact} at {gain}");
        }
    }
}

#[test]
fn beyond_the_trained_box_the_network_then_the_physical_model_fade_to_nothing_without_a_step() {
    let mut random = ChaCha8Rng::seed_from_u64(4);
    for _ in 0..200 {
        let mut parameters = tame(&mut random);
        parameters.selector = Selector::default();
        parameters.sets[1..].fill(ParameterSet::default());
        let mut margin = random.random_range(0.05..1.0);
        let signal = Signal::ALL[random.random_range(0..SIGNALS)];
        if random.random_bool(0.3) {
            // A very wide range with a wide margin: thousands of units, as accelerations have.
            parameters.domain.ranges[signal as usize] = range(-8000.0, 8000.0);
            margin = 1.0;
        }
        parameters.domain.margin = q16(margin) as u32;
        let model = FrictionModel::new(&parameters, RATE);
        let settings = unlimited(Request::PhysicalAndNetwork);
        let range = parameters.domain.ranges[signal as usize];
        let width = (range.half_width() as f64 * parameters.domain.margin as f64 / 65536.0).floor();
        // No fade towards the cold.
        let outwards = if random.random() || signal == Signal::Temperature { 1.0 } else { -1.0 };
        let edge = if outwards > 0.0 { range.high } else { range.low };
        let inside = parameters.domain.ranges.map(|range| within(&mut random, range));
        for step in -50..=450 {
            let distance = width * step as f64 / 200.0;
            let mut signals = inside;
            signals[signal as usize] = (edge as f64 + outwards * distance) as i32;
            let output = Compensation::default().step(Some(&model), &settings, &state(signals));
            let common = model.common(&mut Bent::default(), &state(signals));
            let estimate = model.evaluate_with(0, &state(signals), &common);
            let (physical, network) = (estimate.physical.to_f64() * 65536.0, estimate.network.to_f64() * 65536.0);
            let has_network = parameters.sets[0].network.is_some();
            let outside = (signals[signal as usize] as f64 - edge as f64) * outwards;
            let (reason, acting) = match () {
                () if outside <= 0.0 && has_network => (Reason::AsRequested, Acting::PhysicalAndNetwork),
                () if outside <= 0.0 => (Reason::NoNetwork, Acting::Physical),
                () if outside < width && has_network => (Reason::OutsideTrainedBox(signal), Acting::PhysicalAndNetwork),
                () if outside <= width && has_network => (Reason::OutsideTrainedBox(signal), Acting::Physical),
                () if outside <= width => (Reason::NoNetwork, Acting::Physical),
                () if outside < 2.0 * width => (Reason::FarOutsideTrainedBox(signal), Acting::Physical),
                () => (Reason::FarOutsideTrainedBox(signal), Acting::Nothing),
            };
            assert_eq!((output.reason, output.acting), (reason, acting), "{outside} beyond, margin {width}");
            if acting == Acting::Nothing {
                assert_eq!(output.torque, Torque::ZERO);
            }
            let network_weight = (1.0 - outside.max(0.0) / width).max(0.0);
            let physical_weight = (2.0 - outside.max(width) / width).max(0.0);
            let expected = physical * physical_weight + network * network_weight;
            let torque = output.torque.to_bits();
            assert!((torque as f64 - expected).abs() <= 3.0 + 1e-6 * expected.abs(), "{torque}, not {expected}");
        }
    }
}

#[test]
fn a_network_in_shadow_changes_no_bit_and_shows_what_it_would_do() {
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let mut differs = 0;
    for _ in 0..400 {
        let parameters = tame(&mut random);
        let model = FrictionModel::new(&parameters, RATE);
        let (gain, clamp) = (random.random_range(0..=1 << 16), Torque::from_bits(q16(random.random_range(0.0..5.0))));
        let settings =
            |request: Request, slew: Torque, rate: u32| Settings::new(request, gain, clamp, slew, rate).expect("valid");
        let slew = Torque::from_bits(q16(random.random_range(1.0..1000.0)));
        let [mut physical, mut shadow, mut full] = [Compensation::default(); 3];
        for _ in 0..60 {
            let state = any_state(&mut random, &parameters);
            let physical = physical.step(Some(&model), &settings(Request::Physical, slew, RATE), &state);
            let shadow = shadow.step(Some(&model), &settings(Request::NetworkInShadow, slew, RATE), &state);
            // With no slew limit to speak of.
            let full = full.step(Some(&model), &settings(Request::PhysicalAndNetwork, Torque::MAX, 1), &state);
            assert_eq!(shadow, physical);
            assert_eq!(shadow.shadow, full.torque);
            assert_ne!(shadow.acting, Acting::PhysicalAndNetwork);
            differs += usize::from(shadow.shadow != shadow.torque);
        }
    }
    assert!(differs > 1000, "{differs}");
}

#[test]
fn without_a_network_the_physical_model_acts_and_says_why() {
    let mut random = ChaCha8Rng::seed_from_u64(6);
    for _ in 0..200 {
        let mut parameters = tame(&mut random);
        parameters.sets.iter_mut().for_each(|set| set.network = None);
        let model = FrictionModel::new(&parameters, RATE);
        let [mut physical, mut full] = [Compensation::default(); 2];
        for _ in 0..50 {
            let state = state(parameters.domain.ranges.map(|range| within(&mut random, range)));
            let physical = physical.step(Some(&model), &unlimited(Request::Physical), &state);
            let full = full.step(Some(&model), &unlimited(Request::PhysicalAndNetwork), &state);
            assert_eq!((physical.acting, physical.reason), (Acting::Physical, Reason::AsRequested));
            assert_eq!(full, Output { reason: Reason::NoNetwork, ..physical });
        }
    }
}

#[test]
fn a_change_of_regime_makes_no_step_also_from_a_set_with_a_network_to_one_without() {
    let mut random = ChaCha8Rng::seed_from_u64(7);
    for with_network in [false, true] {
        let mut parameters = frictionless();
        parameters.domain.ranges[Signal::Velocity as usize] = range(-10.0, 10.0);
        let criterion = Criterion { measure: Measure::Speed, enter: q16(1.0), leave: q16(0.9) };
        parameters.selector = Selector { criteria: [Some(criterion), None], fade_time: q16(0.1) as u32 };
        for (set, constant) in parameters.sets.iter_mut().zip([2.0, -1.0]) {
            set.physical.terms = Terms::CONSTANT;
            set.physical.coefficients.constant = q16(constant);
        }
        if with_network {
            // A network whose output is its bias: 1.5 Nm in every state.
            let mut network = tame_network(&mut random);
            network.output.weights = [0, 0, 0, 0, 0, 1 << 13];
            (network.output.fraction, network.scale) = (13, q16(1.5));
            parameters.sets[0].network = Some(network);
        }
        let model = FrictionModel::new(&parameters, 1000);
        let mut compensation = Compensation::default();
        let settings = unlimited(Request::PhysicalAndNetwork);
        let mut step =
            |velocity: f64| compensation.step(Some(&model), &settings, &state([0, q16(velocity), 0, 0, 0, 0]));
        let low = step(0.5);
        let total = if with_network { 3.5 } else { 2.0 };
        assert!((low.torque.to_f64() - total).abs() < 1e-3, "{low:?}");
        let mut last = low.torque.to_f64();
        for n in 0..1000 {
            // Fast, then slow before the cross-fade has ended, then fast for good.
            let output = step(if (40..70).contains(&n) || n > 300 { 0.5 } else { 2.0 });
            let torque = output.torque.to_f64();
            assert!((torque - last).abs() <= (total + 1.0) / 100.0 * 1.02 + 1e-4, "{n}: {last} to {torque}");
            last = torque;
            if n == 10 && with_network {
                assert_eq!((output.acting, output.reason), (Acting::PhysicalAndNetwork, Reason::AsRequested));
            }
            if n == 299 {
                assert_eq!(output.torque.to_bits(), q16(-1.0), "the new set alone, exactly");
                assert_eq!((output.acting, output.reason), (Acting::Physical, Reason::NoNetwork));
            }
        }
        assert_eq!(last, low.torque.to_f64());
    }
}

#[test]
fn settings_out_of_range_are_refused_with_value_and_limit() {
    let nm = |value: f64| Torque::from_bits(q16(value));
    let refused = |gain: u32, clamp: f64, slew: f64, rate: u32| {
        Settings::new(Request::Physical, gain, nm(clamp), nm(slew), rate).expect_err("out of range")
    };
    let gain = refused(65_537, 1.0, 1.0, RATE);
    assert_eq!(gain, SettingsError::Gain(65_537));
    assert_eq!(gain.to_string(), "compensation gain is 65537/65536, must be 0 to 65536");
    let clamp = refused(65_536, -0.5, 1.0, RATE);
    assert_eq!(clamp, SettingsError::Clamp(nm(-0.5)));
    assert_eq!(clamp.to_string(), "compensation clamp is -0.5 Nm, must not be negative");
    let slew = refused(0, 0.0, 0.25, 1 << 15);
    assert_eq!(slew, SettingsError::Slew { slew: nm(0.25), least: nm(0.5) });
    let text = "compensation slew limit is 0.25 Nm a second, must be at least 0.5 Nm at this rate of evaluations";
    assert_eq!(slew.to_string(), text);
    assert_eq!(refused(0, 0.0, 1.0, 0).to_string(), "rate of evaluations is 0 Hz, must be positive");
    assert!(Settings::new(Request::Physical, 0, Torque::ZERO, nm(0.5), 1 << 15).is_ok());
}
