//! Commissioning: from a board that knows nothing of its motor to a motor that turns.
//!
//! The joint only applies voltages and samples currents ([`mod@bench`]); everything is computed here, without I/O and
//! without a clock. In this order:
//!
//!  - `checks`: state, supply, temperatures, limits; nothing flows
//!  - [`resistance`]: the slope of voltage over current, at several currents; the rotor turns into line
//!  - [`inductance`]: the answer to an alternating voltage, along the magnet and across it
//!  - [`alignment`]: a first short sweep, then a turn of the rotor there and back, then with less current: pole pairs,
//!    direction, electrical zero, flux linkage; before the second the [`index`] of an incremental encoder
//!  - `settings`: what the joint gets of it; position zero
//!  - [`turning`]: the motor turns with it; [`load`], [`inertia`]: the torque constant against a known load, or inertia
//!
//! [`commission`] leads through them, [`joint`] is the joint on a bus by its objects, [`page`] what is written. The
//! bridge is off before every question, and after every error.

pub mod alignment;
pub mod bench;
mod checks;
mod drive;
pub mod estimate;
pub mod failure;
pub mod index;
pub mod inductance;
pub mod inertia;
pub mod joint;
pub mod load;
pub mod page;
pub mod plan;
pub mod resistance;
mod settings;
mod sweep;
#[cfg(test)]
mod tests;
pub mod turning;

pub use alignment::Alignment;
pub use bench::{Bench, Stopped};
pub use checks::Checked;
pub use failure::Failure;
pub use index::Index;
pub use inductance::Inductance;
pub use inertia::Inertia;
pub use load::Load;
pub use plan::Plan;
pub use resistance::Resistance;
pub use turning::Turned;

use alignment::Known;
use drive::powered;
use joint_firmware::objects::settings::Setting;

/// Times that a part is repeated for a joint that missed this program's frames.
const LATE: usize = 3;

/// Stage of a commissioning.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Stage {
    /// Checks while nothing flows.
    Checks,
    /// Voltage over current.
    Resistance,
    /// An alternating voltage.
    Inductance,
    /// A few electrical turns.
    FirstSweep,
    /// Turning until the encoder's index is met.
    Index,
    /// A turn of the rotor, and a few electrical turns with less current.
    Alignment,
    /// The joint takes what was found.
    Settings,
    /// The motor turns with it.
    Turning,
    /// The joint holds a load.
    Load,
    /// The joint swings an inertia.
    Inertia,
}

impl Stage {
    /// Stages under current, in their order.
    pub const UNDER_CURRENT: [Self; 5] =
        [Self::Resistance, Self::Inductance, Self::FirstSweep, Self::Index, Self::Alignment];

    /// Words for it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Checks => "checks",
            Self::Resistance => "resistance",
            Self::Inductance => "inductances",
            Self::FirstSweep => "first sweep",
            Self::Index => "encoder's index",
            Self::Alignment => "pole pairs, direction, electrical zero",
            Self::Settings => "settings",
            Self::Turning => "turning with the new settings",
            Self::Load => "known load",
            Self::Inertia => "known inertia",
        }
    }
}

/// Guide of a person through it.
pub trait Guide {
    /// A stage begins; under current where it is one of [`Stage::UNDER_CURRENT`].
    fn stage(&mut self, stage: Stage);
    /// Tells that something was found.
    fn found(&mut self, text: &str);
    /// Returns `true` to go on; only ever asked while the bridge is off.
    fn agrees(&mut self, question: &str) -> bool;
}

/// Results of a commissioning.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// The joint before.
    pub checked: Checked,
    /// Its motor was the program's placeholder.
    pub new: bool,
    /// A, in use from now on.
    pub current_limit: f64,
    /// A, in use from now on.
    pub over_current: f64,
    /// Winding.
    pub resistance: Resistance,
    /// Winding.
    pub inductance: Inductance,
    /// Encounter with the encoder's index; none where it needs none or had met it.
    pub index: Option<Index>,
    /// Encoder and magnet.
    pub alignment: Alignment,
    /// Settings that the joint took, in the unit of each object.
    pub settings: Vec<(Setting, f64)>,
    /// Motion of the motor with it.
    pub turned: Option<Turned>,
    /// Measurement of a known load.
    pub load: Option<Load>,
    /// Measurement of a known inertia.
    pub inertia: Option<Inertia>,
}

/// Commissions a joint. What the joint had before is back where this fails before the new settings are complete.
///
/// # Errors
/// [`Failure`]; the bridge is off.
pub fn commission<B: Bench>(bench: &mut B, plan: &Plan, guide: &mut impl Guide) -> Result<Found, Failure> {
    plan.check()?;
    guide.stage(Stage::Checks);
    let checked = checks::check(bench, plan.acknowledge)?;
    let limit = plan.current_limit.unwrap_or(checked.current_limit);
    checks::current(plan.current, limit)?;
    let question = format!(
        "The motor gets up to {:.1} A. Its rotor will turn into line by up to half an electrical turn: is it free to, and the \
         supply's current limit low?",
        plan.current
    );
    agreed(guide, &question)?;
    let before = prepare(bench, plan, limit)?;
    let found = measure(bench, plan, guide, checked, limit).and_then(|found| take(bench, plan, guide, found, &before));
    let mut found = match found {
        Ok(found) => found,
        Err(failure) => {
            // If this fails too, the first failure is the one that says why.
            let _ = bench.off();
            let _ = bench.set(&before);
            return Err(failure);
        }
    };
    if plan.turn {
        agreed(
            guide,
            "The motor will turn by up to half a turn there and back with what was found. Is the joint free to?",
        )?;
        guide.stage(Stage::Turning);
        let turned = turning::turn(bench)?;
        let [there, back] = turned.velocity;
        guide.found(&format!("{there:+.3} rad/s there and {back:+.3} rad/s back, wanted {:.3} rad/s", turned.wanted));
        found.turned = Some(turned);
    }
    if let Some(known) = plan.load {
        agreed(
            guide,
            "The joint will hold the load where it is, and move by 0.05 rad to both sides of it. Is it in place?",
        )?;
        guide.stage(Stage::Load);
        let load = load::hold(bench, known)?;
        guide.found(&format!(
            "{:.4} Nm measured of {known:.4} Nm, friction {:.4} Nm: both agree with a torque constant of {:.5} Nm/A",
            load.measured.value, load.measured.error, load.torque_constant
        ));
        found.load = Some(load);
    }
    if let Some(known) = plan.inertia {
        agreed(
            guide,
            "The joint will swing by up to three quarters of a turn of the rotor to each side, ten times. Is it free to, and balanced?",
        )?;
        guide.stage(Stage::Inertia);
        let inertia = inertia::swing(bench, known)?;
        guide.found(&format!(
            "{:.5} kg m^2 measured of {known:.5}, standard error {:.5}: both agree with a torque constant of {:.5} Nm/A",
            inertia.measured.value, inertia.measured.error, inertia.torque_constant
        ));
        found.inertia = Some(inertia);
    }
    Ok(found)
}

/// Finds the index of a joint's incremental encoder with the constants that it has stored; how far the rotor turned for
/// it, none where it needs or has it.
///
/// # Errors
/// [`Failure`]; the bridge is off.
pub fn find_index<B: Bench>(bench: &mut B, plan: &Plan, guide: &mut impl Guide) -> Result<Index, Failure> {
    plan.check()?;
    guide.stage(Stage::Checks);
    let checked = checks::check(bench, plan.acknowledge)?;
    checks::current(plan.current, checked.current_limit)?;
    agreed(
        guide,
        "The rotor will turn by up to 1.1 turns there, or back, until its encoder meets the index. Is the joint free to?",
    )?;
    let pole_pairs = bench.setting(Setting::PolePairs)?;
    let resistance = Resistance::configured(bench.setting(Setting::Resistance)?, checked.condition.winding);
    let flux = bench.setting(Setting::TorqueConstant)? / (1.5 * pole_pairs);
    let speed = alignment::speed(&resistance, plan.current, flux, pole_pairs, rotor_speed(bench)?);
    guide.stage(Stage::Index);
    let index = punctually(bench, |bench| {
        powered(bench, |drive| {
            let voltage = resistance.voltage(plan.current);
            drive.set(bench::Frame { voltage, ..bench::Frame::default() })?;
            resistance::rest(drive)?;
            index::find(drive, voltage, speed, pole_pairs, plan.travel)
        })
    })?;
    guide.found(&told(&index));
    Ok(index)
}

/// Sets what was known before for the time of the measurement; returns the settings that it replaces.
fn prepare<B: Bench>(bench: &mut B, plan: &Plan, limit: f64) -> Result<Vec<(Setting, f64)>, Failure> {
    if let Some(counts) = plan.counts
        && bench.setting(Setting::EncoderCounts)? != f64::from(counts)
    {
        bench.set(&[(Setting::EncoderCounts, f64::from(counts))])?;
        // It counts by them from its next start on.
        bench.store(true)?;
    }
    let gear = plan.gear.map_or_else(|| bench.setting(Setting::GearRatio), Ok)?;
    let fastest = bench.setting(Setting::VelocityLimit)?;
    let over_current = bench.setting(Setting::OverCurrent)?;
    let wanted = [
        (Setting::CurrentLimit, limit),
        (Setting::OverCurrent, over_current.max(settings::OVER_CURRENT * limit)),
        (Setting::GearRatio, gear),
        (Setting::VelocityLimit, fastest.max((settings::ROTOR_SPEED / gear.abs()).min(200.0))),
    ];
    let mut before = Vec::with_capacity(wanted.len());
    for (setting, _) in wanted {
        before.push((setting, bench.setting(setting)?));
    }
    bench.set(&wanted)?;
    Ok(before)
}

/// Measures everything under current.
fn measure<B: Bench>(
    bench: &mut B,
    plan: &Plan,
    guide: &mut impl Guide,
    checked: Checked,
    limit: f64,
) -> Result<Found, Failure> {
    let (current, highest, rate) = (plan.current, checked.highest_voltage, checked.rate);
    let new = settings::is_new(bench)?;
    let over_current = bench.setting(Setting::OverCurrent)?;
    let rotor_speed = rotor_speed(bench)?;
    // A program that knows nothing of the motor knows nothing of its temperature either.
    let winding = if new { f64::NAN } else { checked.condition.winding };
    let (resistance, inductance) = punctually(bench, |bench| {
        powered(bench, |drive| {
            guide.stage(Stage::Resistance);
            let resistance = resistance::measure(drive, current, highest, winding)?;
            guide.found(&format!(
                "{:.5} Ω (standard error {:.1} %), {:.5} Ω at 25 °C; a leg loses {:.3} V",
                resistance.resistance.value,
                100.0 * resistance.resistance.relative(),
                resistance.at_25().value,
                resistance.lost.value
            ));
            guide.stage(Stage::Inductance);
            let inductance = inductance::measure(drive, &resistance, current, highest, rate)?;
            let told = |axis: &str, henry: &estimate::Estimate| {
                format!("{axis} {:.2} µH (standard error {:.1} %)", 1e6 * henry.value, 100.0 * henry.relative())
            };
            guide.found(&format!("{}, {}", told("d", &inductance.d), told("q", &inductance.q)));
            Ok::<_, Failure>((resistance, inductance))
        })
    })?;
    let question = format!(
        "The rotor will turn, slowly: by up to {:.1} turns there and back. Is the joint free to?",
        plan.travel + 0.2
    );
    agreed(guide, &question)?;
    let known = Known {
        resistance: &resistance,
        inductance: &inductance,
        current,
        pole_pairs: plan.pole_pairs,
        travel: plan.travel,
        rotor_speed,
    };
    let (index, alignment) = punctually(bench, |bench| {
        powered(bench, |drive| {
            guide.stage(Stage::FirstSweep);
            let voltage = resistance.voltage(current);
            drive.set(bench::Frame { voltage, ..bench::Frame::default() })?;
            resistance::rest(drive)?;
            let before = drive.look(false)?.referenced;
            let first = alignment::first(drive, &known)?;
            guide.found(&format!("about {:.1} electrical turns in a turn of the rotor", first.ratio));
            let mut index = None;
            if !before {
                guide.stage(Stage::Index);
                let met = index::find(drive, voltage, first.speed, first.ratio, plan.travel)?;
                guide.found(&told(&met));
                index = Some(met);
            }
            guide.stage(Stage::Alignment);
            Ok::<_, Failure>((index, alignment::measure(drive, &known, &first)?))
        })
    })?;
    guide.found(&format!(
        "{} pole pairs ({:.3} measured), encoder {}; electrical zero {:.2}° (standard error {:.2}°), {:+.2}° with less current; lag {:.1}°",
        alignment.pole_pairs,
        alignment.ratio,
        if alignment.reversed { "counts down" } else { "counts up" },
        360.0 * alignment.zero.value,
        360.0 * alignment.zero.error,
        360.0 * alignment.difference,
        360.0 * alignment.lag
    ));
    let constant = alignment.torque_constant();
    let taken = match settings::torque_constant_is_measured(plan, new) {
        true => {
            ": taken, because none was given. Beyond 30 % the joint reports 7122h falsely: enter the data sheet's, or check it by --load or --inertia"
        }
        false => "",
    };
    guide.found(&format!(
        "torque constant by back-EMF {:.5} Nm/A, uncertain by {:.0} %{taken}",
        constant.value,
        100.0 * constant.relative()
    ));
    Ok(Found {
        checked,
        new,
        current_limit: limit,
        over_current,
        resistance,
        inductance,
        index,
        alignment,
        settings: Vec::new(),
        turned: None,
        load: None,
        inertia: None,
    })
}

/// The joint takes what was found, with its position zero, and stores it.
fn take<B: Bench>(
    bench: &mut B,
    plan: &Plan,
    guide: &mut impl Guide,
    mut found: Found,
    before: &[(Setting, f64)],
) -> Result<Found, Failure> {
    agreed(guide, "Nothing of this is in the joint yet. Shall it take and store it?")?;
    guide.stage(Stage::Settings);
    let fastest =
        before.iter().find(|(setting, _)| *setting == Setting::VelocityLimit).map_or(200.0, |(_, value)| *value);
    let gear = bench.setting(Setting::GearRatio)?;
    let mut settings = settings::of(plan, &found, gear, fastest);
    bench.set(&settings)?;
    // A new joint is where it is: its encoder stands anywhere.
    if let Some(wanted) = plan.zero.or(found.new.then_some(0.0)) {
        // By the new gear; what the joint tells takes a moment to follow.
        bench.pass(0.05)?;
        let [position, ..] = bench.motion()?;
        let zero = (Setting::JointZero, bench.setting(Setting::JointZero)? + wanted - position);
        bench.set(&[zero])?;
        settings.push(zero);
        guide.found(&format!("the joint was at {position:.4} rad and is at {wanted:.4} rad from now on"));
    }
    bench.store(false)?;
    guide.found("taken and stored");
    found.settings = settings;
    Ok(found)
}

/// Fastest that the joint lets its rotor turn, rad/s, with a margin.
fn rotor_speed<B: Bench>(bench: &mut B) -> Result<f64, Failure> {
    Ok(0.5 * bench.setting(Setting::VelocityLimit)? * bench.setting(Setting::GearRatio)?.abs())
}

/// Repeats what the joint ended because it missed this program's frames.
fn punctually<B: Bench, T>(bench: &mut B, mut part: impl FnMut(&mut B) -> Result<T, Failure>) -> Result<T, Failure> {
    for _ in 1..LATE {
        match part(bench) {
            Err(Failure::Stopped(Stopped::Late)) => bench.acknowledge()?,
            done => return done,
        }
    }
    part(bench)
}

fn agreed(guide: &mut impl Guide, question: &str) -> Result<(), Failure> {
    if guide.agrees(question) { Ok(()) } else { Err(Failure::Declined) }
}

fn told(index: &Index) -> String {
    match index {
        Index { turns: 0.0, .. } => "the encoder knows its zero".into(),
        Index { turns, back: false } => format!("index met after {turns:.3} turns of the rotor"),
        Index { turns, back: true } => {
            format!("index met on the way back, {turns:.3} turns of the rotor from where it began")
        }
    }
}
