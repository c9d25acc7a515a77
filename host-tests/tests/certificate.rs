//! The certificate is sound and says something: what it proves of an image holds for every state that random draws and
//! a search against it come up with, and is not far above the worst of them.

use friction_compensation::friction::common::CommonTorques;
use friction_compensation::friction::domain::Range;
use friction_compensation::friction::maxwell_slip::Bent;
use friction_compensation::friction::network::{MAX_SCALE, NetworkParameters, Neuron};
use friction_compensation::friction::physical::Terms;
use friction_compensation::friction::state::{JointState, SIGNALS, Signal};
use friction_compensation::friction::{Estimate, FrictionModel, FrictionParameters};
use friction_compensation::parameters::certificate::{Certificate, Limits, Refusal, certify, prove};
use host_tests::parameters::{extreme, frictionless, range, tame};
use host_tests::states::signals;
use host_tests::wide;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// The worst that was found as a part of what is proved; 1 meets the bound.
#[derive(Clone, Copy, Debug, Default)]
struct Tightness {
    output: f64,
    network: f64,
    torque_gain: f64,
    velocity_slope: f64,
}

/// Aim of a search.
#[derive(Clone, Copy, Debug)]
enum Quest {
    Output,
    Network,
    Rise(Signal),
    Fall(Signal),
}

/// Proved parameters, and what was found of them.
struct Subject<'a> {
    parameters: &'a FrictionParameters,
    model: FrictionModel,
    certificate: Certificate,
    /// Bending of the pre-sliding elements before an evaluation.
    bent: Bent,
    inputs: usize,
    worst: Tightness,
}

impl<'a> Subject<'a> {
    fn new(parameters: &'a FrictionParameters, certificate: Certificate) -> Self {
        // The slowest rate that the certificate speaks of.
        let model = FrictionModel::new(parameters, 1_000);
        Self { parameters, model, certificate, bent: Bent::default(), inputs: 0, worst: Tightness::default() }
    }

    fn estimate(&mut self, set: usize, signals: &[i32; SIGNALS]) -> Estimate {
        self.inputs += 1;
        let state = JointState::from_signals(*signals);
        self.model.evaluate_with(set, &state, &self.common(&state))
    }

    /// Torques of the common terms, from the same bending every time.
    fn common(&self, state: &JointState) -> CommonTorques {
        self.model.common(&mut { self.bent }, state)
    }

    /// |friction| and |network| stay within their bounds, and nothing wraps. The magnitudes.
    fn check_torque(&mut self, set: usize, signals: &[i32; SIGNALS]) -> (u32, u32) {
        let estimate = self.estimate(set, signals);
        let Estimate { physical, network } = estimate;
        let context = || format!("set {set}, {signals:?}: {:?} {:?}", self.certificate, self.parameters);
        let wide = wide::evaluate(self.parameters, set, signals, &self.common(&JointState::from_signals(*signals)));
        assert_eq!((physical.to_bits() as i128, network.to_bits() as i128), wide, "wrapped: {}", context());
        let [total, network] = [estimate.total(), network].map(|torque| torque.to_bits().unsigned_abs());
        assert!(total <= self.certificate.output, "friction {total}: {}", context());
        assert!(network <= self.certificate.network, "network {network}: {}", context());
        self.worst.output = self.worst.output.max(total as f64 / self.certificate.output as f64);
        self.worst.network = self.worst.network.max(network as f64 / self.certificate.network as f64);
        (total, network)
    }

    /// Between two states that differ in one signal, torque moves by at most slope times distance and twice the
    /// resolution. By how much it rises towards the higher value of the signal.
    fn check_slope(&mut self, set: usize, signals: &[i32; SIGNALS], signal: Signal, step: i32) -> i64 {
        let index = signal as usize;
        let mut other = *signals;
        other[index] = other[index].saturating_add(step);
        let (from, to) = if step < 0 { (&other, signals) } else { (signals, &other) };
        let distance = to[index].abs_diff(from[index]) as i128;
        let (before, after) = (self.estimate(set, from), self.estimate(set, to));
        let certificate = &self.certificate;
        let ((before, after), (low, high), fraction_bits) = match signal {
            Signal::MeasuredTorque => {
                let gain = if certificate.torque_gain == u32::MAX { i64::MAX } else { certificate.torque_gain as i64 };
                ((before.network, after.network), (-gain, gain), 16)
            }
            _ => {
                let slopes = (certificate.velocity_slope_low, certificate.velocity_slope_high);
                ((before.total(), after.total()), slopes, 8)
            }
        };
        let rise = after.to_bits() as i64 - before.to_bits() as i64;
        let (moved, slack) = ((rise as i128) << fraction_bits, (2 * certificate.resolution as i128) << fraction_bits);
        let (least, most) = (low as i128 * distance, high as i128 * distance);
        assert!(
            least - slack <= moved && moved <= most + slack,
            "{signal:?} by {distance}: torque rises by {rise}, set {set}, {signals:?}: {certificate:?} {:?}",
            self.parameters
        );
        // Over a short distance the staircase's steps hide the slope.
        if distance as u32 >= self.parameters.domain.ranges[index].half_width() / 256 {
            let part = moved as f64 / if rise < 0 { least as f64 } else { most as f64 };
            match signal {
                Signal::MeasuredTorque => self.worst.torque_gain = self.worst.torque_gain.max(part),
                _ => self.worst.velocity_slope = self.worst.velocity_slope.max(part),
            }
        }
        rise
    }

    /// Slopes over measured torque and velocity from one state, each over a distance of any size.
    fn check_slopes(&mut self, random: &mut ChaCha8Rng, set: usize, signals: &[i32; SIGNALS]) {
        for signal in [Signal::MeasuredTorque, Signal::Velocity] {
            let half_width = self.parameters.domain.ranges[signal as usize].half_width() as f64;
            let step = match random.random_range(0..4) {
                0 => random.random_range(1..300),
                1 => (half_width * random.random_range(0.001..0.03)) as i32,
                2 => (half_width * random.random_range(0.1..2.0)) as i32,
                _ => random.random::<i32>() >> random.random_range(0..31),
            };
            self.check_slope(set, signals, signal, if random.random() { step } else { step.saturating_neg() });
        }
    }

    /// Searches a set for the state that comes nearest to a bound: from the best of 100 random ones by changes of one
    /// signal that are kept when they take nothing away. Every state on the way is checked.
    fn climb(&mut self, random: &mut ChaCha8Rng, set: usize, quest: Quest) {
        self.bent = random.random();
        let domain = self.parameters.domain;
        let mut best = (i64::MIN, [0; SIGNALS]);
        for step in 0..400 {
            let mut candidate = best.1;
            if step < 100 {
                candidate = signals(random, self.parameters);
            } else {
                let signal = random.random_range(0..SIGNALS);
                let half_width = domain.ranges[signal].half_width() as f64;
                let change = half_width * random.random_range(-1.0..1.0) * 2f64.powi(-random.random_range(0..12));
                let Range { low, high } = domain.ranges[signal].widened(domain.margin);
                candidate[signal] = candidate[signal].saturating_add(change as i32).clamp(low, high);
            }
            let value = match quest {
                Quest::Output => self.check_torque(set, &candidate).0 as i64,
                Quest::Network => self.check_torque(set, &candidate).1 as i64,
                Quest::Rise(signal) | Quest::Fall(signal) => {
                    let distance = (domain.ranges[signal as usize].half_width() / 256).max(1) as i32;
                    let rise = self.check_slope(set, &candidate, signal, distance);
                    if let Quest::Rise(_) = quest { rise } else { -rise }
                }
            };
            if value >= best.0 {
                best = (value, candidate);
            }
        }
    }
}

/// Draws parameters until `images` of them are proved, checks each with `inputs` random states and a climb to every
/// bound.
fn survey(
    name: &str,
    seed: u64,
    images: usize,
    inputs: usize,
    draw: fn(&mut ChaCha8Rng) -> FrictionParameters,
) -> Vec<Tightness> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let (mut refused, mut states) = (0, 0);
    let mut time = std::time::Duration::ZERO;
    let mut found = vec![];
    while found.len() < images {
        let parameters = draw(&mut random);
        let start = std::time::Instant::now();
        let proved = prove(&parameters);
        time += start.elapsed();
        let Ok(certificate) = proved else {
            refused += 1;
            continue;
        };
        let mut subject = Subject::new(&parameters, certificate);
        for _ in 0..inputs {
            let set = random.random_range(0..parameters.selector.sets());
            let signals = signals(&mut random, &parameters);
            subject.check_torque(set, &signals);
            subject.check_slopes(&mut random, set, &signals);
        }
        let slopes =
            [Signal::MeasuredTorque, Signal::Velocity].map(|signal| [Quest::Rise(signal), Quest::Fall(signal)]);
        for set in 0..parameters.selector.sets() {
            for quest in [Quest::Output, Quest::Network].into_iter().chain(slopes.into_iter().flatten()) {
                subject.climb(&mut random, set, quest);
            }
        }
        states += subject.inputs;
        found.push(subject.worst);
    }
    let time_each = time / (images + refused) as u32;
    println!("{name}: {images} images ({refused} more refused), {states} states; a proof takes {time_each:?}");
    found
}

/// Least, median and greatest.
fn spread(found: &[Tightness], part: fn(&Tightness) -> f64) -> [f64; 3] {
    let mut parts: Vec<f64> = found.iter().map(part).filter(|part| *part > 0.0).collect();
    parts.sort_by(f64::total_cmp);
    [parts[0], parts[parts.len() / 2], parts[parts.len() - 1]]
}

#[test]
fn bounds_of_ordinary_images_hold_and_lie_within_ten_times_the_worst_that_is_found() {
    let found = survey("ordinary", 1, 600, 1000, tame);
    for (name, [loosest, median, tightest], least_median) in [
        ("output", spread(&found, |t| t.output), 0.8),
        ("network", spread(&found, |t| t.network), 0.5),
        ("torque gain", spread(&found, |t| t.torque_gain), 0.35),
        ("velocity slope", spread(&found, |t| t.velocity_slope), 0.7),
    ] {
        println!("{name}: the worst found is {loosest:.2} to {tightest:.2} of the bound, median {median:.2}");
        assert!(loosest > 0.1 && median > least_median, "{name}: {loosest} {median}");
    }
}

#[test]
fn bounds_hold_for_whatever_an_image_can_hold() {
    survey("any bits", 2, 2500, 300, extreme);
}

/// A network that passes the measured torque on from neuron 0 to neuron 0, with the largest weights.
fn steepest_network() -> NetworkParameters {
    let mut network = NetworkParameters { scale: MAX_SCALE, ..Default::default() };
    let neuron = Neuron { weights: [31 << 10, 0, 0, 0, 0, 0], fraction: 10 };
    network.first[0][Signal::MeasuredTorque as usize] = i32::MAX;
    network.output = Neuron { fraction: 10, ..Default::default() };
    network.hidden = [[network.output; 5]; 2];
    (network.hidden[0][0], network.hidden[1][0], network.output) = (neuron, neuron, neuron);
    network
}

#[test]
fn a_slope_beyond_all_numbers_is_not_proved_to_be_a_small_one() {
    let mut parameters = frictionless();
    parameters.domain.ranges = [Range::ANY; SIGNALS];
    parameters.domain.ranges[Signal::MeasuredTorque as usize] = range(-1.0, 1.0);
    parameters.sets[0].network = Some(steepest_network());
    let proved = prove(&parameters).expect("nothing overflows");
    assert_eq!(proved.torque_gain, u32::MAX);
    let limits = Limits { output: u32::MAX, torque_gain: u32::MAX, velocity_slope: u32::MAX };
    assert!(matches!(certify(&parameters, &limits), Err(Refusal::TorqueGain { .. })));
}

#[test]
fn a_sum_that_leaves_64_bits_on_the_way_is_not_proved_to_be_small() {
    let mut parameters = frictionless();
    parameters.domain.ranges = [Range { low: i32::MAX, high: i32::MAX }; SIGNALS];
    let physical = &mut parameters.sets[0].physical;
    physical.terms = Terms::ALL;
    let c = &mut physical.coefficients;
    (c.constant, c.position, c.temperature) = (i32::MAX, i32::MAX, i32::MAX);
    (c.load, c.rotor_inertia) = (i32::MIN, i32::MIN);
    assert_eq!(prove(&parameters), Err(Refusal::PhysicalOverflow { set: 0 }));
}

/// Steps of one unit of velocity through the whole box and a little beyond.
fn check_staircase(parameters: &FrictionParameters) {
    let mut subject = Subject::new(parameters, prove(parameters).expect("nothing overflows"));
    for velocity in -66_000..66_000 {
        subject.check_slope(0, &[0, velocity, 0, 0, 1 << 16, 0], Signal::Velocity, 1);
    }
}

#[test]
fn the_staircase_of_a_coulomb_level_that_temperature_multiplies_is_within_the_resolution() {
    let mut parameters = frictionless();
    let physical = &mut parameters.sets[0].physical;
    physical.terms = Terms::COULOMB.union(Terms::COULOMB_TEMPERATURE);
    let c = &mut physical.coefficients;
    (c.coulomb_positive, c.coulomb_negative, c.coulomb_slope) = (1 << 16, 2 << 16, 1 << 14);
    c.coulomb_temperature = 1000 << 16;
    check_staircase(&parameters);
}

#[test]
fn the_staircase_of_the_hysteresis_is_within_the_resolution() {
    let mut parameters = frictionless();
    let physical = &mut parameters.sets[0].physical;
    physical.terms = Terms::HYSTERESIS;
    let c = &mut physical.coefficients;
    (c.hysteresis, c.hysteresis_velocity_slope) = (10_000 << 16, 1 << 10);
    check_staircase(&parameters);
}

/// Parameters with a network that does nothing but hold `neuron` as the first of a layer, fed with ones.
fn with_neuron(layer: usize, neuron: Neuron) -> FrictionParameters {
    let mut network = NetworkParameters::default();
    network.output.fraction = 10;
    network.hidden = [[network.output; 5]; 2];
    let one = Neuron { weights: [0, 0, 0, 0, 0, 9 << 10], fraction: 10 };
    match layer {
        0 => network.first[0] = [i32::MAX; 6],
        1 => network.first = [[0, 0, 0, 0, 0, 9 << 25]; 5],
        2 => network.hidden[0] = [one; 5],
        _ => network.hidden[1] = [one; 5],
    }
    match layer {
        0 => {}
        1 | 2 => network.hidden[layer - 1][0] = neuron,
        _ => network.output = neuron,
    }
    let mut parameters = frictionless();
    parameters.sets[0].network = Some(network);
    parameters
}

#[test]
fn an_image_whose_network_can_overflow_is_refused_with_the_neuron_its_sum_and_the_limit() {
    for layer in 0..4 {
        let sum = |weight: i16| prove(&with_neuron(layer, Neuron { weights: [weight; 6], fraction: 10 }));
        // Six weights times 32767, the largest activation; layer 0 has five weights of 32 in Q25 and a bias of 64.
        let reached = if layer == 0 { 5 * ((1 << 30) - 2) + (1i64 << 31) - 1 } else { 6 * 10_924 * 32_767 };
        let refusal = sum(10_924).expect_err("the sum does not fit");
        let Refusal::NetworkOverflow { set: 0, neuron: 0, bound, .. } = refusal else { panic!("{refusal}") };
        assert!((bound - reached).abs() < 64, "layer {layer}: {bound}, not {reached}");
        let text = format!(
            "network can overflow: the sum of neuron 0 in layer {layer} of set 0 reaches {bound}, limit 2147483647"
        );
        assert_eq!(refusal.to_string(), text);
        if layer > 0 {
            assert!(sum(10_922).is_ok(), "six times 10922 times 32767 is below 2^31");
        }
    }
}

#[test]
fn an_image_whose_physical_model_can_overflow_is_refused_with_the_set_and_the_limit() {
    let mut parameters = frictionless();
    let physical = &mut parameters.sets[0].physical;
    physical.terms = Terms::CONSTANT.union(Terms::POSITION);
    (physical.coefficients.constant, physical.coefficients.position) = (32_000 << 16, 2000 << 16);
    let refusal = prove(&parameters).expect_err("34000 Nm");
    assert_eq!(refusal.to_string(), "physical model can overflow: set 0 can leave +-32768, the range of Q16.16");
    parameters.sets[0].physical.coefficients.position = 500 << 16;
    assert!(prove(&parameters).is_ok());
}

/// Each limit, met exactly, with a function that takes one unit from it.
#[test]
fn a_limit_that_is_met_passes_and_one_unit_less_is_refused_with_both_numbers() {
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let mut seen = [0; 3];
    for _ in 0..60 {
        let parameters = tame(&mut random);
        let proved = prove(&parameters).expect("ordinary");
        let slope = proved.velocity_slope_low.unsigned_abs().max(proved.velocity_slope_high.unsigned_abs());
        let limits = Limits { output: proved.output, torque_gain: proved.torque_gain, velocity_slope: slope as u32 };
        assert_eq!(certify(&parameters, &limits), Ok(proved));
        let less = |limit: u32| limit.checked_sub(1);
        if let Some(output) = less(limits.output) {
            let refusal = certify(&parameters, &Limits { output, ..limits });
            assert_eq!(refusal, Err(Refusal::Output { bound: proved.output, limit: output }));
            seen[0] += 1;
        }
        if let Some(torque_gain) = less(limits.torque_gain) {
            let refusal = certify(&parameters, &Limits { torque_gain, ..limits });
            assert_eq!(refusal, Err(Refusal::TorqueGain { bound: proved.torque_gain, limit: torque_gain }));
            seen[1] += 1;
        }
        if let Some(velocity_slope) = less(limits.velocity_slope) {
            let refusal = certify(&parameters, &Limits { velocity_slope, ..limits });
            let Err(Refusal::VelocitySlope { bound, limit }) = refusal else { panic!("{refusal:?}") };
            assert_eq!((bound.unsigned_abs(), limit), (slope, velocity_slope));
            seen[2] += 1;
        }
    }
    assert!(seen.into_iter().all(|count| count > 30), "{seen:?}");
}

#[test]
fn a_refusal_names_what_can_be_reached_and_what_may_be() {
    let mut parameters = frictionless();
    parameters.domain.ranges[Signal::Velocity as usize] = range(-2.0, 1.9);
    let physical = &mut parameters.sets[0].physical;
    physical.terms = Terms::VISCOUS;
    physical.coefficients.viscous = -(8 << 16); // at a full scale of 4 rad/s
    let limits = Limits { output: 4 << 16, torque_gain: 0, velocity_slope: 2 << 8 };
    assert!(certify(&parameters, &limits).is_ok());
    let text = |limits: Limits| certify(&parameters, &limits).expect_err("beyond a limit").to_string();
    let output = text(Limits { output: (4 << 16) - 1, ..limits });
    assert_eq!(output, "friction can reach 4.00000, limit 3.99998 Nm");
    let slope = text(Limits { velocity_slope: (2 << 8) - 1, ..limits });
    assert_eq!(slope, "d(friction)/d(velocity) can reach -2.000, limit 1.996 Nm s/rad");
    parameters.sets[0].network = Some(NetworkParameters { scale: 1 << 10, ..steepest_network() });
    let limits = Limits { output: u32::MAX, torque_gain: 1 << 16, velocity_slope: u32::MAX };
    let gain = certify(&parameters, &limits).expect_err("beyond the limit").to_string();
    assert!(gain.starts_with("d(network)/d(measured torque) can reach 14895."), "{gain}");
    assert!(gain.ends_with(", limit 1.00000"), "{gain}");
}
