//! The currents at the greatest duty, with the flashed programs in motion: the amplifiers have settled to within 1 % when they are sampled, and hardly more.

use emulator::board::{BG431BEsc1, Drivetrain, MoteusR4, Wired};
use emulator::chip::time::Instant;
use host_tests::emulated::bench::{actuator, program};
use host_tests::emulated::motion::{Moving, acting_image};
use host_tests::emulated::observed::Observed;
use libtest_mimic::{Failed, Trial};
use plant::actuator::Fault;

/// The tests of this file, by name.
pub fn trials() -> Vec<Trial> {
    vec![
        Trial::test("moteus_r4_samples_settled_currents_at_its_greatest_duty", || {
            settled(MoteusR4::NAME, MoteusR4::new)
        }),
        Trial::test("b_g431b_esc1_samples_settled_currents_at_its_greatest_duty", || {
            settled("b-g431b-esc1", BG431BEsc1::new)
        }),
    ]
}

/// The joint moves faster than the supply permits, until the duties have met their limit.
fn settled<W: Observed>(name: &str, board: fn(Drivetrain) -> W) -> Result<(), Failed> {
    let program = program(name, env!("CARGO_TARGET_TMPDIR"))?;
    let mut moving = Moving::start(board, &actuator(), &program, &acting_image::<W>())?;
    let supply = f64::from(moving.configuration.limits.bus_voltage.0) + 0.5;
    moving.bench.board().drivetrain().take_least_followed();
    moving.amplitude = f64::from(moving.configuration.limits.velocity);
    moving.bench.board().drivetrain().actuator_mut().inject(Fault::SourceVoltage(supply))?;
    moving.until_off(Instant(0), 1.0)?;
    let least = moving.bench.board().drivetrain().take_least_followed();
    let log = moving.bench.log();
    println!("{name}: at least {:.3} % of each current is sampled; {:x?}", 100.0 * least, moving.emergencies());
    // At any smaller duty more is sampled: the greatest was met.
    match least {
        0.99..0.999 => Ok(()),
        _ => Err(format!("{least} of a current was sampled:\n{log}").into()),
    }
}
