//! Ownership of a board: its first key by who is at it, and what only its owner may change. On the moteus, which has no
//! button, sessions by the chip's random numbers; on the B-G431B-ESC1 the button.

use emulator::board::{BG431BEsc1, Drivetrain, MoteusR4, Wired};
use friction_compensation::parameters::authentication::{Challenge, Key, Purpose};
use host_tests::emulated::Bench;
use host_tests::emulated::bench::program;
use joint_firmware::objects::ownership::FORGET;
use libtest_mimic::{Failed, Trial};
use std::collections::BTreeSet;

const NODE: u8 = 5;
const TORQUE_LIMIT: (u16, u8) = (0x2103, 1);

/// The tests of this file, by name.
pub fn trials() -> Vec<Trial> {
    vec![
        Trial::test("moteus_r4_belongs_to_who_has_its_key", sessions),
        Trial::test("b_g431b_esc1_belongs_to_who_presses_its_button", button),
    ]
}

fn key() -> Result<Key, Failed> {
    Ok(Key::new(std::array::from_fn(|i| i as u8 + 1))?)
}

fn expect<T: PartialEq + std::fmt::Debug>(what: &str, found: T, expected: T) -> Result<(), Failed> {
    if found == expected { Ok(()) } else { Err(format!("{what}: {found:?} instead of {expected:?}").into()) }
}

fn new<W: Wired>(name: &str, board: impl FnOnce(Drivetrain) -> W) -> Result<Bench<W>, Failed> {
    let mut bench = Bench::new(board, &program(name, env!("CARGO_TARGET_TMPDIR"))?)?;
    bench.run(0.3)?;
    bench.give_node_id(NODE)?;
    Ok(bench)
}

fn limits<W: Wired>(bench: &mut Bench<W>) -> Result<(), Failed> {
    let before = bench.upload(NODE, TORQUE_LIMIT.0, TORQUE_LIMIT.1)?;
    bench.download(NODE, TORQUE_LIMIT.0, TORQUE_LIMIT.1, &before)
}

fn give<W: Wired>(bench: &mut Bench<W>) -> Result<(), Failed> {
    bench.download(NODE, 0x2215, 6, &key()?.to_bytes())
}

fn owner<W: Wired>(bench: &mut Bench<W>) -> Result<u32, Failed> {
    bench.number(NODE, 0x2215, 2)
}

fn challenge<W: Wired>(bench: &mut Bench<W>) -> Result<Challenge, Failed> {
    let random = bench.upload(NODE, 0x2215, 5)?;
    let random = random.try_into().map_err(|bytes: Vec<u8>| format!("{} bytes", bytes.len()))?;
    Ok(Challenge { product: bench.number(NODE, 0x1018, 2)?, serial: bench.number(NODE, 0x1018, 4)?, random })
}

fn respond<W: Wired>(bench: &mut Bench<W>, purpose: Purpose) -> Result<Vec<u8>, Failed> {
    let response = key()?.respond(purpose, &challenge(bench)?, &[]).to_vec();
    bench.download(NODE, 0x2215, 7, &response)?;
    Ok(response)
}

fn sessions() -> Result<(), Failed> {
    let mut bench = new("moteus-r4", MoteusR4::new)?;
    limits(&mut bench)?;
    expect("somebody is at a board whose supply has just come", bench.number(NODE, 0x2215, 9)?, 1)?;
    give(&mut bench)?;
    expect("the owner", owner(&mut bench)?, key()?.id())?;
    let mut responses = Vec::new();
    for power_ups in 0..2 {
        expect("a setting without a session", limits(&mut bench).is_ok(), false)?;
        let mut challenges = BTreeSet::new();
        for _ in 0..3 {
            challenges.insert(challenge(&mut bench)?.random);
            responses.push(respond(&mut bench, Purpose::Session)?);
            limits(&mut bench)?;
            bench.download(NODE, 0x2215, 8, &[0; 4])?;
            expect("a setting after the session", limits(&mut bench).is_ok(), false)?;
        }
        expect("challenges that differ", challenges.len(), 3)?;
        // Those of the power-up before, too.
        for response in &responses {
            let replayed = bench.download(NODE, 0x2215, 7, response).is_ok();
            expect("a response that is replayed", replayed, false)?;
        }
        expect("power-ups with the same owner", owner(&mut bench)?, key()?.id()).map_err(|_| power_ups.to_string())?;
        bench.restart(NODE)?;
    }
    respond(&mut bench, Purpose::TakeBack)?;
    expect("the owner, taken back", owner(&mut bench)?, 0)?;
    limits(&mut bench)?;
    bench.restart(NODE)?;
    expect("the same after a loss of power", owner(&mut bench)?, 0)?;
    // A master that runs the node is no person, and a reset over the bus no power-up.
    bench.exchange(0, &[1, NODE], 0.01)?;
    expect("a key while a master runs it", give(&mut bench).is_ok(), false)?;
    bench.exchange(0, &[0x81, NODE], 0.5)?;
    expect("somebody is there after a reset over the bus", bench.number(NODE, 0x2215, 9)?, 0)?;
    expect("a key after it", give(&mut bench).is_ok(), false)
}

fn button() -> Result<(), Failed> {
    let mut bench = new("b-g431b-esc1", BG431BEsc1::new)?;
    expect("a key without the button", give(&mut bench).is_ok(), false)?;
    bench.board().inputs().button = true;
    give(&mut bench)?;
    limits(&mut bench)?;
    bench.board().inputs().button = false;
    expect("the owner", owner(&mut bench)?, key()?.id())?;
    expect("a setting without the button", limits(&mut bench).is_ok(), false)?;
    expect("another key", give(&mut bench).is_ok(), false)?;
    expect("a challenge", challenge(&mut bench).is_ok(), false)?;
    expect("taken back without it", bench.download(NODE, 0x2215, 10, &FORGET.to_le_bytes()).is_ok(), false)?;
    bench.restart(NODE)?;
    expect("the owner after a loss of power", owner(&mut bench)?, key()?.id())?;
    bench.board().inputs().button = true;
    bench.download(NODE, 0x2215, 10, &FORGET.to_le_bytes())?;
    bench.board().inputs().button = false;
    expect("the owner, taken back", owner(&mut bench)?, 0)?;
    limits(&mut bench)
}
