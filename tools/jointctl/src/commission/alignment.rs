//! Pole pairs, direction, electrical zero, lag and flux linkage, from sweeps.
//!
//! Friction makes the rotor lag behind the field, and its back-EMF makes the current lag behind the voltage, one way
//! there and the other way back: in the mean of both it drops out, and half the difference is the lag. Cogging repeats
//! with the electrical turn and drops out of the mean over whole turns; an encoder that sits eccentrically repeats with
//! the rotor's turn, which is why a whole one is swept where the joint is free to.
//!
//! The back-EMF E = v - R i - j w L i lies a quarter of a turn ahead of the magnet, and its magnitude is w psi: so a
//! sweep shows the flux linkage as well, and with it the torque constant 3/2 p psi (D. W. Novotny, T. A. Lipo, "Vector
//! Control and Dynamics of AC Drives", 1996, ch. 2).

use super::bench::Bench;
use super::drive::Drive;
use super::estimate::{Estimate, wrapped};
use super::failure::Failure;
use super::inductance::Inductance;
use super::resistance::{Resistance, rest};
use super::sweep::{Sweep, Swept, Way, sweep};
use std::f64::consts::TAU;

/// Most pole pairs that are looked for.
pub(super) const MOST_POLE_PAIRS: u32 = 64;
/// Largest lag, electrical turns: beyond 60 degrees the rotor is about to slip.
const LARGEST_LAG: f64 = 1.0 / 6.0;
/// Part of the current with which the zero is looked for again. Where the rotor lies beside the field, it differs then
/// by 10 to 30 degrees unless psi is less than a quarter of (L_q - L_d) I.
const LESS_CURRENT: f64 = 0.6;
/// Largest difference of the zeros, electrical turns: 8 degrees, which cost 1 % of the torque.
const LARGEST_DIFFERENCE: f64 = 8.0 / 360.0;
/// Largest deviation of the measured ratio of turns from a whole number.
const LARGEST_FRACTION: f64 = 0.2;
/// Field's speed and turns of the first sweep, which finds the pole pairs, and the most turns of the last.
const FIRST_SPEED: f64 = 2.0;
const FIRST_TURNS: u32 = 2;
const LAST_TURNS: u32 = 3;
/// Back-EMF of a sweep as a part of the holding voltage, and the field's speeds, electrical turns/s.
const EMF: f64 = 0.25;
const SPEEDS: [f64; 2] = [0.5, 10.0];
/// Least samples of an electrical turn, and the most of one between two: when the field is turned round, more than half
/// cannot be told from less.
const SAMPLES: f64 = 10.0;
const WIDEST: f64 = 0.4;
/// Times that a sweep is begun anew because the encoder has met its index.
const ATTEMPTS: usize = 3;

/// Alignment of the encoder on the motor, and what the sweeps showed of the magnet.
#[derive(Clone, Debug, PartialEq)]
pub struct Alignment {
    /// Pairs of poles.
    pub pole_pairs: u32,
    /// Electrical turns in a turn of the encoder, as measured.
    pub ratio: f64,
    /// The encoder counts down while the field turns forward.
    pub reversed: bool,
    /// Reading of `direction * pole pairs * encoder` where the d axis lies on phase A, electrical turns, 0 to 1. Its
    /// error is the scatter of the electrical turns, with what an eccentric encoder adds.
    pub zero: Estimate,
    /// Lag of the rotor behind the field, electrical turns.
    pub lag: f64,
    /// Flux linkage of the magnet, peak, Vs. Its error is no standard error: it is what may be hidden by what the legs
    /// lose, see `hidden`.
    pub flux: Estimate,
    /// Difference of the zero with less current, electrical turns.
    pub difference: f64,
    /// Electrical turns that were evaluated each way, and their speed, turns/s.
    pub swept: (u32, f64),
    /// Mechanical turns that were made each way.
    pub turned: f64,
    /// Deviation of each electrical turn's zero from their mean, electrical turns.
    pub scatter: Vec<f64>,
}

impl Alignment {
    /// Torque at the rotor by q current, Nm/A.
    pub fn torque_constant(&self) -> Estimate {
        self.flux.scaled(1.5 * f64::from(self.pole_pairs))
    }
}

/// The first look at a motor that nothing is known of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct First {
    /// Electrical turns in a turn of the encoder.
    pub ratio: f64,
    /// The field's speed for what follows, electrical turns/s.
    pub speed: f64,
}

/// Quantities that the sweeps go by.
pub(super) struct Known<'k> {
    pub resistance: &'k Resistance,
    pub inductance: &'k Inductance,
    /// A.
    pub current: f64,
    /// Number of pole pairs by the data sheet.
    pub pole_pairs: Option<u32>,
    /// Mechanical turns that the joint is free to make.
    pub travel: f64,
    /// Fastest that the rotor may turn, rad/s.
    pub rotor_speed: f64,
}

/// Sweeps a few turns: about how many pole pairs, and how fast the field may turn.
pub(super) fn first<B: Bench>(drive: &mut Drive<'_, B>, known: &Known<'_>) -> Result<First, Failure> {
    let voltage = known.resistance.voltage(known.current);
    let sweep = whole(drive, voltage, FIRST_SPEED, FIRST_TURNS)?;
    let ratio = ratio(&sweep)?;
    let flux = flux(&sweep, FIRST_SPEED, known, 0.0).value;
    // A slow bus gives few samples of a fast field.
    let by_samples = FIRST_SPEED / (SAMPLES * sweep.spacing()).max(sweep.widest() / WIDEST);
    let speed = speed(known.resistance, known.current, flux, ratio, known.rotor_speed);
    Ok(First { ratio, speed: speed.min(by_samples).max(SPEEDS[0]) })
}

/// Speed of the field, electrical turns/s, at which the back-EMF of a flux linkage, Vs, takes little of the voltage
/// that drives a current, A, and the rotor is no faster than so many rad/s.
pub(super) fn speed(resistance: &Resistance, current: f64, flux: f64, pole_pairs: f64, rotor: f64) -> f64 {
    let by_emf = EMF * resistance.resistance.value * current / (TAU * flux.max(1e-6));
    by_emf.min(rotor / TAU * pole_pairs).clamp(SPEEDS[0], SPEEDS[1])
}

/// Sweeps a turn of the rotor, as far as it is free to, there and back, and once more with less current.
pub(super) fn measure<B: Bench>(
    drive: &mut Drive<'_, B>,
    known: &Known<'_>,
    first: &First,
) -> Result<Alignment, Failure> {
    let free = (known.travel * first.ratio).round() as u32;
    let turns = free.clamp(FIRST_TURNS, MOST_POLE_PAIRS);
    let speed = first.speed;
    let full = whole(drive, known.resistance.voltage(known.current), speed, turns)?;
    let ratio = ratio(&full)?;
    let pole_pairs = ratio.round();
    if (ratio - pole_pairs).abs() > LARGEST_FRACTION || !(1.0..=f64::from(MOST_POLE_PAIRS)).contains(&pole_pairs) {
        return Err(Failure::PolePairsUnclear { ratio, limit: LARGEST_FRACTION });
    }
    let pole_pairs = pole_pairs as u32;
    if let Some(expected) = known.pole_pairs
        && expected != pole_pairs
    {
        return Err(Failure::PolePairs { counted: pole_pairs, expected });
    }
    let turned = full.turned();
    let seat = Seat { pole_pairs, reversed: turned[0] < 0.0 };
    let zeros = seat.zeros(&full, full.turns);
    let lag = zeros.iter().map(|(_, lag)| lag).sum::<f64>() / zeros.len() as f64;
    if lag.abs() > LARGEST_LAG {
        return Err(Failure::LagTooLarge { lag, limit: LARGEST_LAG });
    }
    let few = full.turns.min(LAST_TURNS);
    let less = whole(drive, known.resistance.voltage(LESS_CURRENT * known.current), LESS_CURRENT * speed, few)?;
    // Over the same turns, where encoder and cogging are the same.
    let difference = wrapped(mean_angle(&seat.zeros(&less, few)) - mean_angle(&seat.zeros(&full, few)));
    if difference.abs() > LARGEST_DIFFERENCE {
        return Err(Failure::RotorBesideField { turns: difference, limit: LARGEST_DIFFERENCE });
    }
    let mean = mean_angle(&zeros);
    let scatter = zeros.iter().map(|(zero, _)| wrapped(zero - mean)).collect::<Vec<_>>();
    Ok(Alignment {
        pole_pairs,
        ratio,
        reversed: seat.reversed,
        zero: Estimate { value: mean.rem_euclid(1.0), error: Estimate::mean(&scatter).error },
        lag,
        flux: flux(&full, speed, known, lag),
        difference,
        swept: (full.turns, speed),
        turned: 0.5 * (turned[0].abs() + turned[1].abs()),
        scatter,
    })
}

/// A sweep in which the encoder's angle does not jump.
fn whole<B: Bench>(drive: &mut Drive<'_, B>, voltage: f64, speed: f64, turns: u32) -> Result<Sweep, Failure> {
    for _ in 0..ATTEMPTS {
        if let Swept::Whole(sweep) = sweep(drive, voltage, speed, turns)? {
            return Ok(sweep);
        }
        rest(drive)?;
    }
    Err(Failure::PolePairsUnclear { ratio: f64::NAN, limit: LARGEST_FRACTION })
}

/// Electrical turns in a turn of the encoder, where the rotor followed there and back.
fn ratio(sweep: &Sweep) -> Result<f64, Failure> {
    let [forward, backward] = sweep.turned();
    let field = f64::from(sweep.turns);
    let least = 0.5 * field / f64::from(MOST_POLE_PAIRS);
    if forward.abs() < least || forward.is_nan() {
        return Err(Failure::RotorDidNotMove { turns: forward, least, field });
    }
    if (forward - backward).abs() > 0.1 * forward.abs() {
        return Err(Failure::RotorSlipped { forward, backward });
    }
    Ok(2.0 * field / (forward + backward).abs())
}

/// Alignment of the encoder on the motor but for its zero.
struct Seat {
    pole_pairs: u32,
    reversed: bool,
}

impl Seat {
    /// Zero and lag of each electrical turn, electrical turns.
    fn zeros(&self, sweep: &Sweep, turns: u32) -> Vec<(f64, f64)> {
        let sign = if self.reversed { -1.0 } else { 1.0 };
        let per_turn = sign * f64::from(self.pole_pairs);
        let exact = |angle: u32| f64::from(angle) / 4_294_967_296.0;
        // The multiple of a fraction of a turn is exact but for whole turns.
        let start = per_turn * exact(sweep.encoder) - exact(sweep.field);
        let turn = |from: f64| {
            let [there, back] = sweep.means(from, from + 1.0).map(|encoder| per_turn * encoder - (from + 0.5));
            // The rotor is where the field is, less the lag there and plus it back.
            (start + 0.5 * (there + back), 0.5 * (back - there))
        };
        sweep.starts().take(turns as usize).map(turn).collect()
    }
}

/// Mean of angles that lie near each other, turns.
fn mean_angle(zeros: &[(f64, f64)]) -> f64 {
    let reference = zeros.first().map_or(0.0, |(zero, _)| *zero);
    reference + zeros.iter().map(|(zero, _)| wrapped(zero - reference)).sum::<f64>() / zeros.len() as f64
}

/// Back-EMF, V, that may be hidden by what a leg loses, V by the line of the resistance. Near zero current a board
/// makes up for its dead time in part only, and (inferred) a turning current crosses zero late: that has the speed's
/// sign, as the back-EMF has, so the mean of both ways keeps it. With a sixteenth of the dead time it does not show. In
/// volts it hardly depends on the motor: on 20 random ones the back-EMF was -3 to +31 mV off on the emulated
/// B-G431B-ESC1, whose legs lose 26 mV, and -19 to +3 mV on the moteus r4, with up to 5 mV.
fn hidden(lost: f64) -> f64 {
    0.8 * lost + 0.022
}

/// Flux linkage of the magnet by the back-EMF, Vs, of a rotor that lags by so many electrical turns.
fn flux(sweep: &Sweep, speed: f64, known: &Known<'_>, lag: f64) -> Estimate {
    /// A turning current loses on an average a little less to dead time than one along a phase: 4/pi against 4/3.
    const LOST: f64 = 4.0 / std::f64::consts::PI;
    let ohms = known.resistance.resistance.value;
    let lost = LOST * known.resistance.lost.value.max(0.0);
    let henry = 0.5 * (known.inductance.d.value + known.inductance.q.value);
    let emf = |way: &Way, speed: f64| {
        let omega = TAU * speed;
        let samples = sweep.evaluated(way).collect::<Vec<_>>();
        let mean = |of: &dyn Fn(&super::sweep::Sample) -> f64| {
            samples.iter().map(|sample| of(sample)).sum::<f64>() / samples.len() as f64
        };
        let current = [mean(&|s| s.current[0]), mean(&|s| s.current[1])];
        let across = mean(&|s| s.voltage[1]);
        let magnitude = current[0].hypot(current[1]).max(1e-9);
        across - ohms * current[1] - lost * current[1] / magnitude - omega * henry * current[0]
    };
    // Only what lies across the field: it has the speed's sign, so that what is wrong with both ways alike drops out.
    let scale = 1.0 / (TAU * speed * (TAU * lag).cos());
    let (there, back) = (emf(&sweep.forward, speed), emf(&sweep.backward, -speed));
    let apart = 0.5 * (there + back).abs();
    Estimate {
        value: 0.5 * (there - back) * scale,
        error: (apart + hidden(known.resistance.lost.value.max(0.0))) * scale,
    }
}
