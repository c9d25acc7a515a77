//! Resistance: the slope of voltage over current at several currents along phase A.
//!
//! Dead time and transistors take a voltage that does not depend on the current once every phase current is beyond the
//! range where dead-time compensation fades; it is the intercept of the straight line and drops out of its slope. The
//! current is first brought to its highest, which turns the rotor into line with phase A, where no back-EMF can arise;
//! the levels are measured downwards from there.

use super::bench::{Bench, Frame, Window};
use super::drive::Drive;
use super::estimate::{Estimate, line, turns_between};
use super::failure::Failure;

/// Resistances of motors, Ω: those that a configuration takes.
const PLAUSIBLE: [f64; 2] = [1e-3, 100.0];
/// Levels, as parts of the highest current.
const LEVELS: [f64; 5] = [1.0, 0.875, 0.75, 0.625, 0.5];
/// Windows at each.
const WINDOWS: usize = 4;
/// First voltage, V, and the factor by which it rises while there is little current.
const FIRST: f64 = 0.02;
const RISE: f64 = 1.5;
/// Steps until the current flows at most, and how near it has to come, as a part of it.
const MOST_STEPS: usize = 60;
const NEAR: f64 = 0.05;
/// Largest standard error, as a part of the resistance.
const LARGEST_ERROR: f64 = 0.05;
/// Largest current across the field at rest, as a part of the one along it; an open phase B or C has 1/sqrt(3).
const LARGEST_ASIDE: f64 = 0.1;
const OPEN_PHASE: [f64; 2] = [0.45, 0.70];
/// The rotor is at rest when its encoder has moved by less than this between two looks, mechanical turns: more than a
/// count of 1,000.
const REST: f64 = 0.0011;
/// Time between two looks at the rotor, and the longest time that it may take to come to rest, s.
const LOOK: f64 = 0.025;
const LONGEST: f64 = 4.0;
/// Along phase A the whole current flows through A and half of it through B and through C: what is lost there over what
/// one leg loses.
const ALONG_A: f64 = 4.0 / 3.0;

/// Resistance of the winding along phase A.
#[derive(Clone, Debug, PartialEq)]
pub struct Resistance {
    /// Ω at the winding's present temperature; leads and transistors included.
    pub resistance: Estimate,
    /// Voltage that a leg loses whatever the current, V, beyond what the joint makes up for.
    pub lost: Estimate,
    /// Points of current, A, and voltage, V.
    pub points: Vec<(f64, f64)>,
    /// Mean temperature of the winding, °C; NaN where it is not known.
    pub temperature: f64,
}

impl Resistance {
    /// Values that the joint has: resistance at 25 °C, for a winding at `temperature`; losses of the legs unknown.
    pub fn configured(at_25: f64, temperature: f64) -> Self {
        let exactly = |value| Estimate { value, error: 0.0 };
        let resistance = exactly(at_25 * copper(temperature));
        Self { resistance, lost: exactly(0.0), points: Vec::new(), temperature }
    }

    /// The voltage along the field that drives a current, V.
    pub fn voltage(&self, current: f64) -> f64 {
        self.resistance.value * current + ALONG_A * self.lost.value.max(0.0)
    }

    /// Ω at 25 °C: copper's rise of 0.393 % per kelvin; as measured where the temperature is not known.
    pub fn at_25(&self) -> Estimate {
        self.resistance.scaled(1.0 / copper(self.temperature))
    }
}

/// Resistance of copper at a temperature, as a part of that at 25 °C.
fn copper(temperature: f64) -> f64 {
    let coefficient = f64::from(joint_firmware::motor::thermal::COPPER_COEFFICIENT);
    if temperature.is_finite() { 1.0 + coefficient * (temperature - 25.0).clamp(-100.0, 150.0) } else { 1.0 }
}

/// Measures it with currents up to `current`, A, and at most `highest`, V.
pub(super) fn measure<B: Bench>(
    drive: &mut Drive<'_, B>,
    current: f64,
    highest: f64,
    temperature: f64,
) -> Result<Resistance, Failure> {
    let full = raise(drive, current, highest)?;
    rest(drive)?;
    let mut points = Vec::new();
    for level in LEVELS {
        drive.set(Frame { voltage: level * full, ..Frame::default() })?;
        // The current's own time constant, which nobody knows yet.
        settled(drive, current)?;
        for window in drive.fresh(WINDOWS, false)? {
            let [along, across] = window.current;
            aside(along, across)?;
            points.push((along, window.voltage[0]));
        }
    }
    let (resistance, intercept) = line(&points);
    if !(PLAUSIBLE[0]..=PLAUSIBLE[1]).contains(&resistance.value) {
        return Err(Failure::ResistanceImplausible { resistance: resistance.value, limits: PLAUSIBLE });
    }
    let error = resistance.relative();
    if error > LARGEST_ERROR || error.is_nan() {
        return Err(Failure::ResistanceUnclear { error, limit: LARGEST_ERROR });
    }
    Ok(Resistance { resistance, lost: intercept.scaled(1.0 / ALONG_A), points, temperature })
}

/// Raises the voltage until the current flows; that voltage.
fn raise<B: Bench>(drive: &mut Drive<'_, B>, wanted: f64, highest: f64) -> Result<f64, Failure> {
    let (mut voltage, mut before): (f64, Option<(f64, f64)>) = (FIRST, None);
    let mut current = 0.0;
    for _ in 0..MOST_STEPS {
        drive.set(Frame { voltage, ..Frame::default() })?;
        if current > 0.3 * wanted {
            settled(drive, wanted)?;
        }
        let [along, across] = mean_current(&drive.fresh(2, false)?);
        if along < -0.1 * wanted {
            return Err(Failure::WrongSign { current: along, voltage });
        }
        current = along.hypot(across);
        if current > 0.5 * wanted {
            aside_when_resting(drive, along, across)?;
        }
        if (current / wanted - 1.0).abs() < NEAR {
            return Ok(voltage);
        }
        if voltage >= highest && current < wanted {
            break;
        }
        // By the slope of the last two points; dead time lets the first currents say little.
        let step = match before.replace((voltage, current)) {
            Some((volts, amperes)) if amperes > 0.05 * wanted && current != amperes => {
                (voltage - volts) / (current - amperes) * (wanted - current)
            }
            _ if current > 0.1 * wanted => 0.5 * voltage * (wanted / current - 1.0),
            _ => voltage,
        };
        let next = voltage + if step.is_finite() { step } else { voltage };
        voltage = next.clamp(voltage / RISE, RISE * voltage).min(highest);
    }
    Err(if current < 0.05 * wanted {
        Failure::NoCurrent { current, voltage }
    } else {
        Failure::CurrentNotReached { current, wanted, voltage }
    })
}

/// Mean current along and across the field, A.
pub(super) fn mean_current(windows: &[Window]) -> [f64; 2] {
    let mean = |axis: usize| windows.iter().map(|window| window.current[axis]).sum::<f64>() / windows.len() as f64;
    [mean(0), mean(1)]
}

/// Waits until two windows in a row have the same current.
fn settled<B: Bench>(drive: &mut Drive<'_, B>, scale: f64) -> Result<(), Failure> {
    let mut last = drive.fresh(1, false)?;
    for _ in 0..20 {
        let next = drive.fresh(1, false)?;
        let change = |axis: usize| match (last.first(), next.first()) {
            (Some(last), Some(next)) => (next.current[axis] - last.current[axis]).abs(),
            _ => f64::INFINITY,
        };
        if change(0).max(change(1)) < 0.01 * scale {
            return Ok(());
        }
        last = next;
    }
    // A current that does not settle shows in the line's residuals.
    Ok(())
}

/// Waits until the rotor stands still in line with the field.
pub(super) fn rest<B: Bench>(drive: &mut Drive<'_, B>) -> Result<(), Failure> {
    let (mut still, mut waited, mut turns) = (0, 0.0, 0.0);
    let mut last = drive.look(false)?.encoder;
    while waited < LONGEST {
        drive.wait(LOOK)?;
        waited += LOOK;
        let encoder = drive.look(false)?.encoder;
        turns = turns_between(last, encoder);
        last = encoder;
        still = if turns.abs() < REST { still + 1 } else { 0 };
        if still == 4 {
            return Ok(());
        }
    }
    Err(Failure::RotorMoves { turns, limit: REST, seconds: LONGEST })
}

/// A rotor on its way into line makes a current across the field too.
fn aside_when_resting<B: Bench>(drive: &mut Drive<'_, B>, along: f64, across: f64) -> Result<(), Failure> {
    if aside(along, across).is_ok() {
        return Ok(());
    }
    rest(drive)?;
    let windows = drive.fresh(1, false)?;
    windows.iter().try_for_each(|window| aside(window.current[0], window.current[1]))
}

fn aside(along: f64, across: f64) -> Result<(), Failure> {
    let ratio = across / along;
    if ratio.abs() <= LARGEST_ASIDE {
        return Ok(());
    }
    Err(if (OPEN_PHASE[0]..=OPEN_PHASE[1]).contains(&ratio.abs()) {
        // Without B the current of A comes back through C, whose direction lies to the negative side: beta = -i_c /
        // sqrt(3).
        Failure::PhaseOpen { phase: if ratio > 0.0 { 'B' } else { 'C' }, ratio }
    } else {
        Failure::CurrentAside { ratio, limit: LARGEST_ASIDE }
    })
}
