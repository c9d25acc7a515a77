//! The feedforward of the load on the flashed programs: the moteus r4 bears what it is told, and the B-G431B-ESC1 has
//! no such object.

use emulator::board::{BG431BEsc1, Drivetrain, MoteusR4};
use host_tests::emulated::bench::{actuator, program};
use host_tests::emulated::motion::{Moving, NODE};
use host_tests::emulated::observed::Observed;
use libtest_mimic::{Failed, Trial};
use node::SampleImage;

/// Object of the load.
const LOAD: u16 = 0x2202;
/// Torque that is borne, Nm.
const TORQUE: f32 = 1.0;
/// Largest departure of the residual torque from it, Nm: friction at rest may take a part.
const NEAR: f32 = 0.3;

/// The tests of this file, by name.
pub fn trials() -> Vec<Trial> {
    vec![
        Trial::test("moteus_r4_bears_the_load_that_it_is_told", bears),
        Trial::test("b_g431b_esc1_has_no_load_to_be_told", has_none),
    ]
}

/// At rest in velocity mode, without a load, which is what the controller then has to hold against.
fn at_rest<W: Observed>(board: impl FnOnce(Drivetrain) -> W) -> Result<Moving<W>, Failed> {
    let program = program(W::NAME, env!("CARGO_TARGET_TMPDIR"))?;
    let mut moving = Moving::start(board, &actuator(), &program, &SampleImage::constant(1, 0.0))?;
    moving.amplitude = 0.0;
    moving.run(0.5)?;
    Ok(moving)
}

/// Measured torque less all that is known of it, Nm: object 2020h:2.
fn residual<W: Observed>(moving: &mut Moving<W>) -> Result<f32, Failed> {
    Ok(1e-3 * f32::from(moving.bench.number(NODE, 0x2020, 2)? as i16))
}

fn bears() -> Result<(), Failed> {
    let mut moving = at_rest(MoteusR4::new)?;
    let position = 1e-6 * moving.bench.number(NODE, 0x6064, 0)? as i32 as f32;
    let before = residual(&mut moving)?;
    // Level, where it stands.
    for (sub_index, value) in [(4, position - core::f32::consts::FRAC_PI_2), (3, TORQUE)] {
        moving.bench.download(NODE, LOAD, sub_index, &value.to_le_bytes())?;
    }
    moving.run(0.1)?;
    let off = residual(&mut moving)? - before;
    moving.bench.download(NODE, LOAD, 1, &[2])?;
    moving.run(0.5)?;
    let on = residual(&mut moving)? - before;
    println!("residual torque: {off} Nm off, {on} Nm on");
    if off.abs() > NEAR || (on + TORQUE).abs() > NEAR {
        return Err(format!("residual torque {off} Nm off, {on} Nm with a feedforward of {TORQUE} Nm").into());
    }
    Ok(())
}

fn has_none() -> Result<(), Failed> {
    let mut moving = at_rest(BG431BEsc1::new)?;
    for sub_index in 0..=6 {
        if moving.bench.number(NODE, LOAD, sub_index).is_ok() {
            return Err(format!("2202h:{sub_index} is there").into());
        }
    }
    Ok(())
}
