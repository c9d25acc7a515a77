//! Friction and its compensation on the board's core give the host's integers, all of them, for 128,000 states of
//! random certified images; for a million where all samples are asked for.
//!
//! The program `states` of the probe is compiled as each board's is and runs on the core of `tools/emulator`. Images,
//! states and evaluations are exchanged in the emulated memory. A state that differs is told with its image's seed; the
//! same seeds are drawn in every run.

#[path = "../../probe/src/evaluation.rs"]
mod evaluation;

use crate::Missing;
use evaluation::{BATCH, Evaluator, INPUTS, NAMES, OUTPUTS, RATE, SETTINGS, settings};
use friction_compensation::compensation::{Acting, Reason};
use friction_compensation::friction::physical::Terms;
use friction_compensation::friction::state::Signal;
use friction_compensation::friction::{FrictionModel, FrictionParameters};
use friction_compensation::parameters::image::Image;
use host_tests::bare_core::Core;
use host_tests::bare_metal::{BOARDS, Board};
use host_tests::certified::{drawn, random};
use host_tests::image_bytes::encoded;
use host_tests::parameters::q16;
use host_tests::samples::count;
use host_tests::states::coupled;
use libtest_mimic::{Failed, Trial};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeSet;
use std::sync::OnceLock;

/// Certified images: in the test command, 128,000 states of them, and in all, 1,024,000.
const IMAGES: (u64, u64) = (20, 160);
/// Batches of states for each of them, for each board's way of compiling.
const BATCHES: usize = 25;
/// Kinds of selectors: none, three criteria by themselves, nine pairs.
const SELECTORS: usize = 13;

pub fn trials(missing: &Missing) -> Vec<Trial> {
    let mut trials = vec![Trial::test("a_wrong_bit_is_told_with_image_and_state", wrong_bit)];
    for (number, board) in BOARDS.iter().enumerate() {
        let name = format!("friction_on_the_core_of_{}_has_the_host_s_bits", board.name);
        trials.push(Trial::test(name, move || same_bits(board, 1 + number as u64)).with_ignored_flag(missing.target));
    }
    trials
}

/// Certified images with their seeds, and how many were drawn for them: the first ones, but of those at the end only
/// the first of each kind of selector, so that every kind is among few images, too.
fn images() -> &'static (Vec<(u64, Image)>, u64) {
    static IMAGES_DRAWN: OnceLock<(Vec<(u64, Image)>, u64)> = OnceLock::new();
    IMAGES_DRAWN.get_or_init(|| {
        let wanted = count(IMAGES.0, IMAGES.1) as usize;
        let (mut images, mut selectors, mut seed) = (Vec::new(), BTreeSet::new(), 0);
        while images.len() < wanted {
            if let Ok(image) = drawn(seed) {
                let unseen = selectors.insert(selector(&image));
                if unseen || wanted - images.len() > SELECTORS - selectors.len() {
                    images.push((seed, image));
                }
            }
            seed += 1;
        }
        (images, seed)
    })
}

/// Criteria that choose an image's set of parameters.
fn selector(image: &Image) -> [u8; 2] {
    image.friction.selector.criteria.map(|criterion| criterion.map_or(0, |criterion| criterion.measure as u8))
}

/// States that are evaluated one after the other under the same settings.
struct Batch {
    settings: [i32; SETTINGS],
    states: Vec<[i32; INPUTS]>,
}

impl Batch {
    fn drawn(random: &mut ChaCha8Rng, friction: &FrictionParameters) -> Self {
        // Off and without a model, what is left of the torque fades out and nothing else happens.
        let request = [0, 1, 2, 2, 2, 2, 2, 2, 2, 3][random.random_range(0..10)];
        let has_model = i32::from(random.random_range(0..16) > 0);
        let gain = [0, 1, 65_536, 64_225, random.random_range(0..=65_536)][random.random_range(0..5)];
        let clamp = [0, i32::MAX, q16(20.0), random.random_range(0..=i32::MAX)][random.random_range(0..4)];
        let slew = [RATE as i32, i32::MAX, q16(3000.0), random.random_range(RATE as i32..=i32::MAX)];
        let slew = slew[random.random_range(0..4)];
        // In every other batch the regime is seldom another one, so that cross-fades end.
        let calm = random.random();
        let mut states: Vec<[i32; INPUTS]> = Vec::new();
        while states.len() < BATCH {
            let (signals, other) = coupled(random, friction);
            let set = random.random_range(0..friction.selector.sets() as i32);
            let [a, b, c, d, e, f] = signals;
            let mut state = [a, b, c, d, e, f, other, set];
            if let Some(last) = states.last()
                && calm
                && random.random_range(0..64) > 0
            {
                // Signals that criteria look at stay.
                for place in [Signal::Velocity as usize, Signal::Acceleration as usize, INPUTS - 2] {
                    state[place] = last[place];
                }
            }
            states.push(state);
        }
        Self { settings: [request, gain, clamp, slew, has_model], states }
    }
}

/// A joint on this machine.
struct Host<'a> {
    friction: &'a FrictionParameters,
    model: FrictionModel,
    evaluator: Evaluator,
}

impl<'a> Host<'a> {
    fn new(image: &'a Image) -> Self {
        let friction = &image.friction;
        Self { friction, model: FrictionModel::new(friction, RATE), evaluator: Evaluator::default() }
    }

    fn evaluate(&mut self, batch: &Batch) -> Result<Vec<[i32; OUTPUTS]>, Failed> {
        let settings = settings(&batch.settings)?;
        let has_model = batch.settings[SETTINGS - 1] != 0;
        let step = |state| self.evaluator.step(self.friction, &self.model, &settings, has_model, state);
        Ok(batch.states.iter().map(step).collect())
    }
}

fn begin(core: &mut Core, image: &Image) -> Result<(), Failed> {
    core.write_words("COUNT", [0])?;
    core.run_to((1, 0))?;
    let bytes = encoded(image);
    core.write("IMAGE", &bytes)?;
    core.write_words("LENGTH", [bytes.len() as i32])?;
    Ok(core.run_to((2, 1))?)
}

fn evaluate(core: &mut Core, batch: &Batch) -> Result<Vec<[i32; OUTPUTS]>, Failed> {
    core.write_words("SET_UP", batch.settings)?;
    core.write_words("STATES", batch.states.iter().copied().flatten())?;
    core.write_words("COUNT", [batch.states.len() as i32])?;
    core.run_to((3, 1))?;
    Ok(core.read_words("EVALUATIONS", OUTPUTS * batch.states.len())?.as_chunks().0.to_vec())
}

/// An error that says the first state in which the core's evaluations are not the host's.
fn compare(
    seed: u64,
    first: usize,
    batch: &Batch,
    core: &[[i32; OUTPUTS]],
    host: &[[i32; OUTPUTS]],
) -> Result<(), Failed> {
    if core.len() != host.len() {
        return Err(format!("image {seed}: {} evaluations of {}", core.len(), host.len()).into());
    }
    for (n, (core, host)) in core.iter().zip(host).enumerate() {
        let Some(place) = (0..OUTPUTS).find(|place| core[*place] != host[*place]) else { continue };
        let (name, have, want) = (NAMES[place], core[place], host[place]);
        let (state, settings) = (batch.states[n], batch.settings);
        let what = format!("image {seed}, state {}: {name} is {have} on the core, {want} on the host", first + n);
        let signals = Signal::ALL.map(Signal::name).join(", ");
        return Err(format!("{what}\nsettings {settings:?}\n{signals}, coupled velocity, set: {state:?}").into());
    }
    Ok(())
}

/// States that have occurred: a run in which something never does shows less than it says.
#[derive(Default)]
struct Seen {
    regimes: BTreeSet<i32>,
    outside: BTreeSet<i32>,
    acting: BTreeSet<i32>,
    reasons: BTreeSet<i32>,
    limited: BTreeSet<i32>,
    fading: u32,
    selectors: BTreeSet<[u8; 2]>,
    networks: BTreeSet<bool>,
    present: u32,
    absent: u32,
}

impl Seen {
    fn image(&mut self, image: &Image) {
        self.selectors.insert(selector(image));
        let FrictionParameters { selector, sets, .. } = &image.friction;
        for set in sets.iter().take(selector.sets()) {
            self.networks.insert(set.network.is_some());
            self.present |= set.physical.terms.0;
            self.absent |= !set.physical.terms.0 & Terms::ALL.0;
        }
    }

    fn evaluations(&mut self, evaluations: &[[i32; OUTPUTS]]) {
        for [regime, _, _, physical, network, outside, .., acting, reason, limited] in evaluations {
            self.regimes.insert(*regime);
            self.outside.insert(*outside);
            self.acting.insert(*acting);
            self.reasons.insert(*reason);
            self.limited.insert(*limited);
            self.fading += u32::from([physical, network].into_iter().any(|weight| !matches!(*weight, 0 | i32::MAX)));
        }
    }

    /// States that have not occurred.
    fn missing(&self) -> Vec<String> {
        let reasons = [Reason::Off, Reason::NoModel, Reason::AsRequested, Reason::NoNetwork].into_iter();
        let outside = Signal::ALL.into_iter().map(Reason::OutsideTrainedBox);
        let far_outside = Signal::ALL.into_iter().map(Reason::FarOutsideTrainedBox);
        let reasons = reasons.chain(outside).chain(far_outside);
        let acting = [Acting::Nothing, Acting::Physical, Acting::PhysicalAndNetwork];
        let mut missing: Vec<String> = Vec::new();
        let mut expect = |found: bool, what: String| {
            if !found {
                missing.push(what)
            }
        };
        reasons.for_each(|reason| expect(self.reasons.contains(&evaluation::reason(reason)), format!("{reason:?}")));
        acting
            .into_iter()
            .for_each(|acting| expect(self.acting.contains(&evaluation::acting(acting)), format!("{acting:?}")));
        (0..4).for_each(|regime| expect(self.regimes.contains(&regime), format!("regime {regime}")));
        (-1..6).for_each(|signal| expect(self.outside.contains(&signal), format!("signal {signal} outside")));
        expect(self.limited.len() == 2, "a torque that is limited, and one that is not".to_owned());
        expect(self.fading > 1000, format!("a thousand weights between none and all, {}", self.fading));
        expect(self.networks.len() == 2, "sets with and without a network".to_owned());
        expect(self.selectors.len() == SELECTORS, format!("{SELECTORS} kinds of selectors, {:?}", self.selectors));
        expect(
            self.present == Terms::ALL.0 && self.absent == Terms::ALL.0,
            "every term, present and absent".to_owned(),
        );
        missing
    }
}

fn same_bits(board: &Board, stream: u64) -> Result<(), Failed> {
    let (images, drawn) = images();
    let mut core = Core::start(&board.probe("states", None, &[], env!("CARGO_TARGET_TMPDIR"))?)?;
    let (mut seen, mut states) = (Seen::default(), 0);
    for (seed, image) in images {
        let mut random = random(*seed, stream);
        let mut host = Host::new(image);
        begin(&mut core, image)?;
        seen.image(image);
        for number in 0..BATCHES {
            let batch = Batch::drawn(&mut random, &image.friction);
            let expected = host.evaluate(&batch)?;
            compare(*seed, number * BATCH, &batch, &evaluate(&mut core, &batch)?, &expected)?;
            seen.evaluations(&expected);
            states += expected.len();
        }
    }
    println!(
        "{}: {states} states, {} certified images of {drawn} drawn, {} million instructions",
        board.name,
        images.len(),
        core.cpu.instructions() / 1_000_000
    );
    match &seen.missing()[..] {
        [] if states >= count(128_000, 1_024_000) as usize => Ok(()),
        missing => Err(format!("{states} states; never seen: {missing:?}").into()),
    }
}

fn wrong_bit() -> Result<(), Failed> {
    let (images, _) = images();
    let (seed, image) = images.first().ok_or("no image")?;
    let batch = Batch::drawn(&mut random(*seed, 1), &image.friction);
    let expected = Host::new(image).evaluate(&batch)?;
    compare(*seed, 0, &batch, &expected, &expected)?;
    for place in 0..OUTPUTS {
        for n in [0, BATCH - 1] {
            let mut wrong = expected.clone();
            wrong[n][place] ^= 1;
            let Err(told) = compare(*seed, 0, &batch, &wrong, &expected) else { return Err("not noticed".into()) };
            let told = told.message().unwrap_or_default();
            if !told.contains(&format!("image {seed}, state {n}: {}", NAMES[place])) {
                return Err(told.into());
            }
        }
    }
    Ok(())
}
