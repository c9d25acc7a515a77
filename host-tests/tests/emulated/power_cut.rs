//! The flashed program on the emulated board survives a loss of power at every operation of its flash: while it stores
//! an image that came over the bus, its configuration, and its first key. The test command tries the marks at both ends
//! of a store and each fourth of the operations between them; `JOINT_SAMPLES=all` tries all.
//!
//! After each: it starts, reads back the old content or the new one, whole, over the bus; the same after another start;
//! it is able to move; and it can store again. The words that were being written read as every kind of [`Torn`] word.
//! Cases that are not tried everywhere, because they take long, are drawn by a fixed seed, and counted.

use emulator::board::MoteusR4;
use emulator::chip::flash::Torn;
use friction_compensation::compensation::Request;
use friction_compensation::friction::regime::Selector;
use friction_compensation::parameters::authentication::Key;
use host_tests::emulated::Bench;
use host_tests::emulated::bench::{actuator, program};
use host_tests::emulated::kept::{Kept, configuration};
use host_tests::emulated::master::Heard;
use host_tests::emulated::power::Writing;
use host_tests::samples::every;
use libtest_mimic::{Failed, Trial};
use node::SampleImage;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;

const NODE: u8 = 5;
/// Exception of the non-maskable interrupt.
const NMI: u16 = 2;
/// One case of so many is followed by another store, and one by a second loss of power.
const FOLLOWED: u32 = 8;
/// Operations at the start and at the end of a store that are all followed: the marks.
const MARKS: u64 = 5;
/// Share of the operations between them, one of so many, that is tried in the test command; all where all samples are
/// asked for.
const PART: u64 = 4;
/// Longest time from a request to its last operation, s.
const LONGEST: f64 = 0.4;

/// The tests of this file, by name.
pub fn trials() -> Vec<Trial> {
    vec![
        Trial::test("an_image_is_the_old_one_or_the_new_one", || survives(&Content::IMAGE)),
        Trial::test("a_signed_image_comes_after_its_floor_or_not_at_all", || survives(&Content::SIGNED)),
        Trial::test("a_configuration_is_the_old_one_or_the_new_one", || survives(&Content::CONFIGURATION)),
        Trial::test("the_first_key_is_there_or_not", || survives(&Content::KEY)),
    ]
}

type Board = Bench<MoteusR4>;
/// Objects that are read back of a content, one by one.
type Read = Vec<Vec<u8>>;

/// Content that the program keeps.
struct Content {
    name: &'static str,
    /// Number of contents stored before the one that is cut short.
    before: u32,
    /// Brings content number so and so up to the last request, which makes the program write it and is not sent.
    request: fn(&mut Board, u32) -> Result<Heard, Failed>,
    read: fn(&mut Board) -> Result<Read, Failed>,
    /// Number of the first objects, which are kept before the others in a store of their own.
    first: usize,
}

/// A request of 8 bytes to the node's SDO server.
fn request(bytes: [u8; 8]) -> Heard {
    (0x600 + u16::from(NODE), bytes.to_vec())
}

fn u32_of(bytes: &[u8]) -> u32 {
    bytes.iter().rev().fold(0, |word, byte| word << 8 | u32::from(*byte))
}

/// Settings by object, of which content number n has values of its own.
const SETTINGS: [(u16, u8, f32, f32); 8] = [
    (0x2101, 1, 0.1, 0.01),
    (0x2103, 9, 90.0, 0.5),
    (0x2104, 3, 200.0, 3.0),
    (0x2104, 6, 20.0, 0.5),
    (0x2104, 8, 0.5, 0.01),
    (0x2106, 5, 20.0, 0.5),
    (0x2200, 3, 0.5, 0.01),
    (0x2200, 10, 0.02, 0.001),
];

impl Content {
    const IMAGE: Self = Self {
        name: "image",
        before: 2,
        request: |bench, number| {
            stage(bench, number, &[])?;
            bench.download(NODE, 0x2212, 1, &[1])?;
            // Verified: commit.
            match bench.upload(NODE, 0x2212, 2)?.as_slice() {
                [2] => Ok(request([0x2F, 0x12, 0x22, 1, 3, 0, 0, 0])),
                state => Err(format!("the image's state is {state:?}").into()),
            }
        },
        read: |bench| {
            let [version, slot] = [bench.upload(NODE, 0x2213, 1)?, bench.upload(NODE, 0x2213, 4)?];
            let image = bench.upload_in_blocks(NODE, 0x2211, 0)?;
            if image != sample(u32_of(&version)) {
                return Err(format!("image {} is not what was stored as that: {image:x?}", u32_of(&version)).into());
            }
            Ok(vec![version, slot, image])
        },
        first: 0,
    };

    /// An owned joint's: the version floor, then the image.
    const SIGNED: Self = Self {
        name: "signed image",
        before: 1,
        request: |bench, number| {
            let key = Key::new(std::array::from_fn(|i| i as u8 + 1))?;
            if bench.upload(NODE, 0x2215, 1)? == [0] {
                bench.download(NODE, 0x2215, 6, &key.to_bytes())?;
            }
            stage(bench, number, &key.sign(&sample(number)))?;
            bench.download(NODE, 0x2212, 1, &[1])?;
            Ok(request([0x2F, 0x12, 0x22, 1, 3, 0, 0, 0]))
        },
        read: |bench| {
            let floor = bench.upload(NODE, 0x2215, 3)?;
            let image = (Self::IMAGE.read)(bench)?;
            Ok([vec![floor], image].concat())
        },
        first: 1,
    };

    const CONFIGURATION: Self = Self {
        name: "configuration",
        before: 2,
        request: |bench, number| {
            for (index, sub_index, first, step) in SETTINGS {
                let value = first + step * number as f32;
                bench.download(NODE, index, sub_index, &value.to_le_bytes())?;
            }
            // Staged settings come into use, and are stored.
            bench.download(NODE, 0x2100, 1, &[1])?;
            match bench.upload(NODE, 0x2100, 2)?.as_slice() {
                [0] => {}
                result => return Err(format!("2100h:2 is {result:?}").into()),
            }
            bench.run(0.001)?;
            Ok(request([0x23, 0x10, 0x10, 1, b's', b'a', b'v', b'e']))
        },
        read: |bench| SETTINGS.iter().map(|(index, sub_index, ..)| bench.upload(NODE, *index, *sub_index)).collect(),
        first: 0,
    };

    const KEY: Self = Self {
        name: "key",
        before: 0,
        request: |bench, number| {
            if bench.upload(NODE, 0x2215, 1)? == [1] {
                // A key comes once. What else lies beside it is how often a tag was wrong.
                stage(bench, number, &[number as u8; 32])?;
                return Ok(request([0x2F, 0x12, 0x22, 1, 1, 0, 0, 0]));
            }
            let server = 0x600 + u16::from(NODE);
            let byte = |place: u32| (31 * place + number) as u8;
            // 32 bytes in segments of 7, of which the last has 4 and ends the key.
            bench.exchange(server, &[0x21, 0x15, 0x22, 6, 32, 0, 0, 0], 0.002)?;
            for segment in 0..5u32 {
                let data: [u8; 7] = std::array::from_fn(|place| byte(7 * segment + place as u32));
                let toggle = (segment as u8 & 1) << 4;
                let last = segment == 4;
                let mut frame = vec![if last { toggle | 3 << 1 | 1 } else { toggle }];
                frame.extend(data.iter().enumerate().map(|(place, byte)| if last && place > 3 { 0 } else { *byte }));
                if last {
                    return Ok((server, frame));
                }
                bench.exchange(server, &frame, 0.002)?;
            }
            Err("a key has five segments".into())
        },
        read: |bench| (1..=4).map(|sub_index| bench.upload(NODE, 0x2215, sub_index)).collect(),
        first: 0,
    };
}

impl Content {
    /// Contents that a loss of power on the way from one to another may leave.
    fn permitted(&self, old: &Read, new: &Read) -> [Read; 3] {
        let between = new.iter().take(self.first).chain(old.iter().skip(self.first)).cloned().collect();
        [old.clone(), between, new.clone()]
    }
}

/// Image number so and so, of a typical length.
fn sample(number: u32) -> Vec<u8> {
    let level = 0.01 * f64::from(number);
    SampleImage { version: number, levels: &[level], selector: Selector::default(), network: true, golden: 2 }.bytes()
}

/// Uploads an image with what lies behind it.
fn stage(bench: &mut Board, number: u32, tag: &[u8]) -> Result<(), Failed> {
    let mut bytes = sample(number);
    bytes.extend(tag);
    bench.download(NODE, 0x2210, 0, &bytes)
}

/// Counts of what was tried, and what came of it.
#[derive(Debug, Default)]
struct Tally {
    /// Cases with one loss of power, and with a second one, in a start or in the store that followed.
    cuts: u64,
    second_cuts: u64,
    /// Starts, by what was found.
    old: u64,
    new: u64,
    /// Stores afterwards.
    stores: u64,
    /// Non-maskable interrupts that the program returned from, and cases with some, by kind of torn word.
    interrupts: BTreeMap<String, (u64, u64)>,
    bad: Vec<String>,
}

/// A case under way.
struct Case<'a> {
    content: &'a Content,
    bench: Board,
    torn: Torn,
    tally: &'a mut Tally,
    interrupts: u64,
}

impl Case<'_> {
    /// Starts after a loss of power; what is there has to be one of `permitted`.
    fn start(&mut self, permitted: &[Read]) -> Result<Read, Failed> {
        self.bench.restart(NODE)?;
        self.find(permitted)
    }

    /// Content that is there, which has to be one of `permitted`, with the joint able to move.
    fn find(&mut self, permitted: &[Read]) -> Result<Read, Failed> {
        let found = (self.content.read)(&mut self.bench)?;
        let fault = self.bench.upload(NODE, 0x603F, 0)?;
        self.note()?;
        if !permitted.contains(&found) {
            return Err(format!("found {found:x?} instead of one of {permitted:x?}").into());
        }
        if fault != [0, 0] {
            return Err(format!("the joint starts with fault {fault:x?}").into());
        }
        Ok(found)
    }

    /// Counts the handler's decisions: each that was not to go on has reset the chip.
    fn note(&mut self) -> Result<(), Failed> {
        let core = &mut self.bench.emulation.cpu;
        self.interrupts += core.exception_times().get(&NMI).map_or(0, |times| times.count);
        core.clear_exception_times();
        match self.bench.emulation.resets() {
            [] => Ok(()),
            resets => Err(format!("the chip was reset: {resets:?}").into()),
        }
    }

    /// Stores another content and finds it after the next start.
    fn store(&mut self, number: u32) -> Result<(), Failed> {
        let before = (self.content.read)(&mut self.bench)?;
        let request = (self.content.request)(&mut self.bench, number)?;
        self.bench.exchange(request.0, &request.1, 0.0)?;
        self.bench.written()?;
        let stored = (self.content.read)(&mut self.bench)?;
        self.tally.stores += 1;
        match stored == before {
            true => Err("what is stored afterwards changes nothing".into()),
            false => self.start(&[stored]).map(drop),
        }
    }

    /// A second loss of power, in one of the starts that follow the first one or in the store after them.
    fn lose_power_again(&mut self, permitted: &[Read], random: &mut ChaCha8Rng) -> Result<(), Failed> {
        self.tally.second_cuts += 1;
        // A start has six operations at most, and none where nothing is to be decided.
        let operation = random.random_range(1..=4);
        self.bench.power_up();
        if !self.bench.cut(operation, self.torn, 0.02)? {
            self.bench.booted(NODE)?;
            let found = self.find(permitted)?;
            let request = (self.content.request)(&mut self.bench, 20)?;
            self.bench.exchange(request.0, &request.1, 0.0)?;
            // By all that is known before it is stored, it changes what is there.
            let mut whole = self.bench.clone();
            let operations = whole.written()?;
            let next = (self.content.read)(&mut whole)?;
            if !self.bench.cut(random.random_range(1..=operations), self.torn, LONGEST)? {
                return Err("the power did not go a second time".into());
            }
            let found = self.start(&self.content.permitted(&found, &next))?;
            return self.start(&[found]).map(drop);
        }
        let found = self.start(permitted)?;
        self.start(&[found]).map(drop)
    }
}

fn survives(content: &Content) -> Result<(), Failed> {
    let program = program("moteus-r4", env!("CARGO_TARGET_TMPDIR"))?;
    let actuator = actuator();
    let configuration = configuration::<MoteusR4>(&actuator, NODE, Request::PhysicalAndNetwork);
    let mut bench = Bench::with(MoteusR4::new, &actuator, &program)?;
    Kept { configuration: &configuration, image: &sample(1) }.write(&mut bench.emulation, &program)?;
    bench.booted(NODE)?;
    for number in 2..2 + content.before {
        let request = (content.request)(&mut bench, number)?;
        bench.exchange(request.0, &request.1, 0.0)?;
        bench.written()?;
    }
    let old = (content.read)(&mut bench)?;
    let request = (content.request)(&mut bench, 8)?;
    let writing = Writing::of(&bench, &request)?;
    let new = {
        let mut whole = bench.clone();
        whole.exchange(request.0, &request.1, 0.0)?;
        whole.written()?;
        whole.restart(NODE)?;
        (content.read)(&mut whole)?
    };
    let operations = writing.operations();
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let mut tally = Tally::default();
    writing.each(|operation, bench| {
        let mark = operation <= MARKS || operation + MARKS > operations;
        if !mark && !every() && operation % PART != 0 {
            return Ok(());
        }
        for torn in Torn::ALL {
            let mut case = Case { content, bench: bench.clone(), torn, tally: &mut tally, interrupts: 0 };
            case.bench.emulation.cpu.bus.seed(random.random());
            let outcome = judge(&mut case, &old, &new, mark, &mut random);
            let interrupts = case.interrupts;
            let (count, cases) = tally.interrupts.entry(format!("{torn:?}")).or_default();
            *count += interrupts;
            *cases += u64::from(interrupts > 0);
            if let Err(error) = outcome {
                let error = error.message().unwrap_or("failed");
                tally.bad.push(format!("operation {operation} of {operations}, {torn:?}: {error}"));
            }
        }
        Ok(())
    })?;
    report(content, operations, &tally)
}

fn judge(case: &mut Case, old: &Read, new: &Read, mark: bool, random: &mut ChaCha8Rng) -> Result<(), Failed> {
    case.tally.cuts += 1;
    case.bench.emulation.cpu.clear_exception_times();
    if !case.bench.cut(1, case.torn, LONGEST)? {
        return Err("the power did not go".into());
    }
    let followed = mark || random.random_ratio(1, FOLLOWED);
    let before = followed.then(|| case.bench.clone());
    let permitted = case.content.permitted(old, new);
    let found = case.start(&permitted)?;
    case.tally.old += u64::from(found == *old);
    case.tally.new += u64::from(found == *new);
    case.start(&[found])?;
    if random.random_ratio(1, FOLLOWED) {
        case.store(9)?;
    }
    if let Some(before) = before {
        case.bench = before;
        case.lose_power_again(&permitted, random)?;
    }
    Ok(())
}

fn report(content: &Content, operations: u64, tally: &Tally) -> Result<(), Failed> {
    let Tally { cuts, second_cuts, old, new, stores, interrupts, bad } = tally;
    println!(
        "{}: {operations} operations of the flash x {} kinds of torn words, {cuts} losses of power ({old} starts with the old content, {new} \
         with the new), {second_cuts} of them with a second one, {stores} followed by another store; {} bad",
        content.name,
        Torn::ALL.len(),
        bad.len()
    );
    for (torn, (count, cases)) in interrupts {
        println!(
            "{}: torn words as {torn}: {count} non-maskable interrupts in {cases} cases, each resumed",
            content.name
        );
    }
    bad.iter().take(12).for_each(|case| println!("{}: bad: {case}", content.name));
    let taken: u64 = interrupts.values().map(|(count, _)| count).sum();
    match bad.as_slice() {
        [] if *old == 0 || *new == 0 || taken == 0 || *stores == 0 => {
            Err("one of the outcomes, the error correction's interrupt or the next store never happened".into())
        }
        [] => Ok(()),
        [first, ..] => Err(format!("{} bad cases, the first: {first}", bad.len()).into()),
    }
}
