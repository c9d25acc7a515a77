//! Settings of the configuration over SDO, on the flashed programs: each at its lowest, its highest and just beyond
//! both, at the board's own highest and just beyond that, and as what is no number. What the board does not bear is
//! refused, and the configuration in use stays as it was; what is taken lies within the facts that docs/boards.md has
//! of the board.

use canopen_node::Access;
use emulator::board::{Drivetrain, MoteusR4, Wired as _};
use host_tests::emulated::Bench;
use host_tests::emulated::bench::program;
use host_tests::emulated::observed::Observed;
use host_tests::on_each_board;
use joint_firmware::default_configuration::BOARDS;
use joint_firmware::objects::field::Field;
use joint_firmware::objects::settings::Setting;
use joint_firmware::objects::table::{DataType, Object, Text, described};
use libtest_mimic::{Failed, Trial};

const NODE: u8 = 5;
/// Document in which the boards' facts stand.
const DOCUMENT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/boards.md");
/// Records of the configuration: motor to holding brake.
const RECORDS: std::ops::RangeInclusive<u16> = 0x2101..=0x2109;
/// Object 2100h: command and its numbers, result, refused setting, changed.
const CONFIGURATION: u16 = 0x2100;
const TAKE: u8 = 1;
const FORGET: u8 = 2;
const DONE: u32 = 0;
const REFUSED: u32 = 1;
/// Times that a configuration is offered, and between two, s: the control step may not have taken the one before.
const OFFERS: u32 = 20;
const TAKEN: f64 = 0.005;
/// Periods of the control step in one of the current loop's and the observer's bandwidth, at least.
const CURRENT_PERIODS: f64 = 18.0;
const OBSERVER_PERIODS: f64 = 10.0;
/// Longest voltage vector over the one that fits at any angle: 2 / sqrt 3.
const HEXAGON: f64 = 1.154_700_6;

/// The tests of this file, by name.
pub fn trials() -> Vec<Trial> {
    on_each_board!("takes_no_setting_that_it_does_not_bear", sweep).into()
}

/// Limits of a board, by the table of docs/boards.md.
#[derive(Debug)]
struct Facts {
    supply: f64,
    over_current: f64,
    current: f64,
    bridge_temperature: f64,
    command_deadline: f64,
    chopper: bool,
}

impl Facts {
    fn of(board: &str) -> Result<Self, Failed> {
        let document = std::fs::read_to_string(DOCUMENT)?;
        let limits = document.split_once("## Limits").ok_or("no limits")?.1;
        let column = 1 + BOARDS.iter().position(|(name, _)| *name == board).ok_or("no column")?;
        let fact = |name: &str| -> Result<f64, Failed> {
            let row = limits.lines().find(|line| line.starts_with(&format!("| {name}, ")));
            let cell = row.and_then(|row| row.trim_matches('|').split('|').nth(column)).ok_or(format!("no {name}"))?;
            Ok(cell.trim().parse()?)
        };
        Ok(Self {
            supply: fact("highest supply")?,
            over_current: fact("highest over-current limit")?,
            current: fact("largest current limit of a motor")?,
            bridge_temperature: fact("highest limit of the bridge's temperature")?,
            command_deadline: fact("longest command deadline")?,
            chopper: board == MoteusR4::NAME,
        })
    }

    /// Highest value of a setting, where the board has a say.
    const fn highest(&self, setting: Setting) -> Option<f64> {
        match setting {
            Setting::CurrentLimit => Some(self.current),
            Setting::OverCurrent => Some(self.over_current),
            Setting::LowestBusVoltage => Some(self.supply - 1.0),
            Setting::HighestBusVoltage => Some(self.supply),
            Setting::BridgeTemperature => Some(self.bridge_temperature),
            Setting::CommandDeadline => Some(self.command_deadline),
            _ => None,
        }
    }

    /// The first fact that a configuration, read as numbers, is beyond.
    fn broken(&self, of: impl Fn(Setting) -> f64, rate: f64) -> Option<String> {
        let within = [
            (Setting::CurrentLimit, 0.1, self.current),
            (Setting::OverCurrent, 1.049 * of(Setting::CurrentLimit), self.over_current),
            (Setting::LowestBusVoltage, 5.0, self.supply - 1.0),
            (Setting::HighestBusVoltage, of(Setting::LowestBusVoltage) + 1.0, self.supply),
            (Setting::RegenerationBand, 0.1, of(Setting::HighestBusVoltage) - of(Setting::LowestBusVoltage)),
            (Setting::ChopperVoltage, 0.0, if self.chopper { of(Setting::HighestBusVoltage) } else { 0.0 }),
            (Setting::ChopperShare, 0.000_999, 1.0),
            (Setting::LossCurrent, 0.0, of(Setting::CurrentLimit)),
            (Setting::FieldWeakeningCurrent, 0.0, of(Setting::CurrentLimit)),
            (Setting::BridgeTemperature, 40.0, self.bridge_temperature),
            (Setting::WindingTemperature, 60.0, 200.0),
            (Setting::CommandDeadline, 0.000_999, self.command_deadline),
            (Setting::CurrentBandwidth, 10.0, rate / CURRENT_PERIODS * 1.000_001),
            (Setting::ObserverBandwidth, 1.0, rate / OBSERVER_PERIODS * 1.000_001),
            (Setting::VoltageFraction, 0.099_999, HEXAGON),
            (Setting::PolePairs, 1.0, 64.0),
            (Setting::EncoderCounts, 16.0, 65_535.0),
        ];
        let broken = within.into_iter().find(|(setting, low, high)| !(*low..=*high).contains(&of(*setting)));
        broken.map(|(setting, low, high)| format!("{setting:?} is {}, {low} to {high} is borne", of(setting)))
    }
}

/// Objects of the configuration that can be written, with their settings.
fn settings() -> Vec<(Setting, &'static Object, &'static Text)> {
    let of = |(object, text): (&'static Object, &'static Text)| match object.field {
        Field::Setting(setting) if RECORDS.contains(&object.index) && object.access == Access::ReadWrite => {
            Some((setting, object, text))
        }
        _ => None,
    };
    described().filter_map(of).collect()
}

/// Numbers that a setting is written with, as its object carries them.
fn attempts(setting: Setting, object: &Object, text: &Text, facts: &Facts) -> Vec<u32> {
    let (low, high) = text.limits.unwrap_or((0.0, f64::from(u32::MAX)));
    let numbers = if object.data_type == DataType::F32 {
        let ends = [low, high].into_iter().chain(facts.highest(setting)).map(|end| end as f32);
        let around = ends.flat_map(|end| [end.next_down(), end, end.next_up()]);
        around.chain([f32::NAN, f32::INFINITY, f32::NEG_INFINITY]).map(f32::to_bits).collect()
    } else {
        let (low, high) = (low as u32, high as u32);
        vec![low.saturating_sub(1), low, high, high.saturating_add(1)]
    };
    let largest = if object.data_type == DataType::U8 { 255 } else { u32::MAX };
    numbers.into_iter().filter(|number| *number <= largest).collect()
}

/// A joint's configuration as its objects tell it.
type Read = Vec<(Setting, u32)>;

fn read<W: Observed>(bench: &mut Bench<W>) -> Result<Read, Failed> {
    settings()
        .into_iter()
        .map(|(setting, object, _)| Ok((setting, bench.number(NODE, object.index, object.sub_index)?)))
        .collect()
}

fn write<W: Observed>(bench: &mut Bench<W>, object: &Object, number: u32) -> bool {
    let bytes = number.to_le_bytes();
    let length = usize::from(object.data_type.bytes().unwrap_or(4));
    bench.download(NODE, object.index, object.sub_index, &bytes[..length]).is_ok()
}

/// Has what is staged taken; the result, which says the same as the answer.
fn take<W: Observed>(bench: &mut Bench<W>) -> Result<u32, Failed> {
    for _ in 0..OFFERS {
        let answered = bench.download(NODE, CONFIGURATION, 1, &[TAKE]).is_ok();
        let result = bench.number(NODE, CONFIGURATION, 2)?;
        if matches!((answered, result), (true, DONE) | (false, REFUSED)) {
            return Ok(result);
        }
        bench.run(TAKEN)?;
    }
    Err("the configuration is neither taken nor refused".into())
}

/// Forgets what is staged: what is read then is in use.
fn in_use<W: Observed>(bench: &mut Bench<W>) -> Result<Read, Failed> {
    bench.download(NODE, CONFIGURATION, 1, &[FORGET])?;
    read(bench)
}

fn sweep<W: Observed>(board: fn(Drivetrain) -> W) -> Result<(), Failed> {
    let mut bench = Bench::new(board, &program(W::NAME, env!("CARGO_TARGET_TMPDIR"))?)?;
    bench.run(0.2)?;
    bench.give_node_id(NODE)?;
    bench.run(0.2)?;
    let facts = Facts::of(W::NAME)?;
    let rate = f64::from(bench.number(NODE, 0x2108, 16)?);
    let first = read(&mut bench)?;
    let (mut taken, mut refused) = (0, 0);
    let mut bad = Vec::new();
    for (setting, object, text) in settings() {
        let before = first.iter().find(|(of, _)| *of == setting).map(|(_, number)| *number).ok_or("not read")?;
        for number in attempts(setting, object, text, &facts) {
            let shown = if object.data_type == DataType::F32 { f32::from_bits(number) as f64 } else { number.into() };
            let done = write(&mut bench, object, number) && take(&mut bench)? == DONE;
            // By the library on the host: what the program decides has to be the same.
            let mut wanted = W::CONFIGURATION.joint;
            let possible = setting.set(&mut wanted, number) && wanted.verify(&W::CONFIGURATION.bridge).is_ok();
            if done != possible {
                bad.push(format!("{setting:?} = {shown:e}: taken: {done}, possible: {possible}"));
            }
            let now = in_use(&mut bench)?;
            let expected: Read = match done {
                true => first.iter().map(|(of, old)| (*of, if *of == setting { number } else { *old })).collect(),
                false => first.clone(),
            };
            if now != expected {
                let differ: Vec<_> = now.iter().zip(&expected).filter(|(now, expected)| now != expected).collect();
                bad.push(format!("{setting:?} = {shown:e}, taken: {done}: in use is {differ:x?}"));
            }
            let of = |wanted: Setting| {
                let number = now.iter().find(|(of, _)| *of == wanted).map_or(0, |(_, number)| *number);
                let whole = settings().iter().any(|(of, object, _)| *of == wanted && object.data_type != DataType::F32);
                if whole { number.into() } else { f32::from_bits(number).into() }
            };
            bad.extend(facts.broken(of, rate).map(|broken| format!("{setting:?} = {shown:e}: {broken}")));
            (taken, refused) = (taken + u32::from(done), refused + u32::from(!done));
            if done && !(write(&mut bench, object, before) && take(&mut bench)? == DONE) {
                return Err(format!("{setting:?} = {shown:e}: what was in use before is not taken again").into());
            }
        }
    }
    println!("| {} | {} settings | {taken} taken | {refused} refused |", W::NAME, settings().len());
    if taken < 50 || refused < 50 {
        bad.push(format!("{taken} taken, {refused} refused"));
    }
    if bad.is_empty() { Ok(()) } else { Err(bad.join("\n").into()) }
}
