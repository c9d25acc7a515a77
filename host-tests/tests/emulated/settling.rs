//! Currents at the greatest duty, with the flashed programs in motion: the amplifiers have settled to within 1 % when
//! the converters begin to sample, and hardly more. Sampled as early after a low side's edge as the greatest duties of
//! 0.9 and 0.95 had it, which both boards once permitted, they have not.

use emulator::board::{BG431BEsc1, Drivetrain, MoteusR4};
use emulator::bus::{Bus as _, Width};
use emulator::chip::time::Instant;
use host_tests::emulated::bench::{actuator, program};
use host_tests::emulated::motion::{Moving, acting_image};
use host_tests::emulated::observed::Observed;
use libtest_mimic::{Failed, Trial};
use plant::actuator::Fault;

/// Time for which a converter samples a current, s: 12.5 clocks of 42.5 MHz (docs/boards.md).
const SAMPLED: f64 = 12.5 / 42.5e6;
/// Clock of the timers, Hz.
const TIMER: f64 = 170e6;

/// The tests of this file, by name.
pub fn trials() -> Vec<Trial> {
    vec![
        Trial::test("moteus_r4_samples_settled_currents_at_its_greatest_duty_and_would_not_at_0_9", || {
            settled(MoteusR4::new, 0.9, TIM2_CCR4)
        }),
        Trial::test("b_g431b_esc1_samples_settled_currents_at_its_greatest_duty_and_would_not_at_0_95", || {
            settled(BG431BEsc1::new, 0.95, TIM1_CCR4)
        }),
    ]
}

/// Compare values that start the conversions (RM0440, chapters 28 and 29).
const TIM1_CCR4: u32 = 0x4001_2C40;
const TIM2_CCR4: u32 = 0x4000_0040;

/// Parts of a current that its amplifier shows when the converter begins to sample it, and when the sample is held.
#[derive(Debug)]
struct Shown {
    begun: f64,
    held: f64,
}

impl Shown {
    /// Within 1 % from the beginning on: the settling time that the boards' configurations take from the vendors. At
    /// any smaller duty more is shown:
    /// hardly more says that the greatest was met, and that it is no smaller than it need be.
    fn is_settled(&self) -> bool {
        (0.99..0.995).contains(&self.begun) && (0.995..0.999).contains(&self.held)
    }
}

fn settled<W: Observed + Clone>(board: fn(Drivetrain) -> W, once: f64, trigger: u32) -> Result<(), Failed> {
    let program = program(W::NAME, env!("CARGO_TARGET_TMPDIR"))?;
    let start = Moving::start(board, &actuator(), &program, &acting_image::<W>())?;
    let now = at_the_greatest_duty(start.clone())?;
    println!("{}: {now:.4?}", W::NAME);
    if !now.is_settled() {
        return Err(format!("{now:?}").into());
    }
    // The conversions start earlier by as much as the low side would have begun to conduct later.
    let mut early = start;
    let bridge = &W::CONFIGURATION.bridge;
    let top = TIMER / (2.0 * f64::from(bridge.rate));
    let sooner = (top * (once - f64::from(bridge.duty.1))).round() as u32;
    let emulation = &mut early.bench.emulation;
    let at = emulation.cpu.now();
    let before = emulation.cpu.bus.read(at, trigger, Width::Word).map_err(|refusal| format!("{refusal:?}"))?;
    expect_before_the_top(before, top)?;
    emulation.cpu.bus.write(at, trigger, Width::Word, before - sooner).map_err(|refusal| format!("{refusal:?}"))?;
    let then = at_the_greatest_duty(early)?;
    println!("{} at a greatest duty of {once}: {then:.4?}", W::NAME);
    match then.begun < 0.98 && !then.is_settled() {
        true => Ok(()),
        false => Err(format!("{sooner} counts earlier: {then:?}").into()),
    }
}

/// The conversions start a count before the counter's top.
fn expect_before_the_top(compare: u32, top: f64) -> Result<(), Failed> {
    if f64::from(compare) == top - 1.0 { Ok(()) } else { Err(format!("started at {compare} of {top}").into()) }
}

/// The joint moves faster than the supply permits, until the duties have met their limit.
fn at_the_greatest_duty<W: Observed>(mut moving: Moving<W>) -> Result<Shown, Failed> {
    let supply = f64::from(moving.configuration.limits.bus_voltage.0) + 0.5;
    moving.bench.board().drivetrain().take_least_settled();
    moving.amplitude = f64::from(moving.configuration.limits.velocity);
    moving.bench.board().drivetrain().actuator_mut().inject(Fault::SourceVoltage(supply))?;
    moving.until_off(Instant(0), 1.0)?;
    let least = moving.bench.board().drivetrain().take_least_settled();
    let least = least.ok_or_else(|| format!("nothing was sampled:\n{}", moving.bench.log()))?;
    println!("EMCYs: {:x?}", moving.emergencies());
    Ok(Shown { begun: least.followed(SAMPLED), held: least.followed(0.0) })
}
