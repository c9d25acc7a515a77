//! Bounds of the network: torque, slopes over measured torque and velocity, for every input in the box.

use super::interval::Interval;
use super::{MAX_DEPTH, bisect};
use crate::dsp::smmul;
use crate::friction::domain::Domain;
use crate::friction::network::{
    INPUTS, InputScale, MIN_FRACTION, NEURONS, Network, NetworkParameters, Neuron, to_torque,
};
use crate::friction::smooth::{TANH, tanh};
use crate::friction::state::Signal;

/// What holds of the network in the whole box.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Bounds {
    /// Q16.16.
    pub(super) torque: Interval,
    /// d(network) / d(measured torque), Q16.16.
    pub(super) torque_gain: Interval,
    /// d(network) / d(velocity), 1/256 Nm s/rad.
    pub(super) velocity_slope: Interval,
    /// How far the fixed-point network departs from the piecewise linear one whose slopes are bounded, Q16.16.
    pub(super) resolution: u32,
}

/// A neuron whose sum can leave 32 bits.
pub(super) struct Overflow {
    pub(super) layer: usize,
    pub(super) neuron: usize,
    pub(super) bound: i64,
}

/// A box of scaled inputs, Q31.
#[derive(Clone, Copy)]
struct Cell {
    inputs: [(i32, i32); INPUTS],
}

/// What holds in one cell; slopes are over scaled inputs, in units of the network's output, Q20.
#[derive(Clone, Copy)]
struct CellBounds {
    torque: Interval,
    slopes: [Interval; SLOPES],
}

/// Inputs whose slopes are bounded.
const SLOPE_INPUTS: [usize; SLOPES] = [Signal::MeasuredTorque as usize, Signal::Velocity as usize];
const SLOPES: usize = 2;
/// Fraction bits of slopes.
const SLOPE_BITS: u32 = 20;
/// The bias' input, Q15.
const ONE: i64 = 0x7fff;

pub(super) fn bounds(network: &Network, parameters: &NetworkParameters, domain: &Domain) -> Result<Bounds, Overflow> {
    let root = Cell { inputs: network.input_intervals() };
    check_sums(&root, parameters)?;
    let found = bisect(
        root,
        &|cell| cell_bounds(cell, parameters),
        &|a, b| CellBounds {
            torque: a.torque.union(b.torque),
            slopes: [a.slopes[0].union(b.slopes[0]), a.slopes[1].union(b.slopes[1])],
        },
        &|found, new| {
            found.torque.contains(new.torque)
                && found.slopes[0].contains(new.slopes[0])
                && found.slopes[1].contains(new.slopes[1])
        },
        &|cell| split(cell, parameters),
    );
    let slope = |which: usize, fraction_bits: u32| {
        let half_width = domain.ranges[SLOPE_INPUTS[which]].half_width();
        per_signal(found.slopes[which], parameters.scale, half_width, fraction_bits)
    };
    Ok(Bounds {
        torque: found.torque,
        torque_gain: slope(0, 16),
        velocity_slope: slope(1, 8),
        resolution: resolution(parameters),
    })
}

/// Slope over a scaled input (Q20) times the output's scale (Q16.16), divided by the input's half width (Q16.16).
fn per_signal(slope: Interval, scale: i32, half_width: u32, fraction_bits: u32) -> Interval {
    let Some(divisor) = core::num::NonZeroU64::new(half_width as u64) else {
        return Interval::ZERO; // an input without a range has no influence
    };
    let torque = slope.times(Interval::point(scale as i64)).shift_right(SLOPE_BITS - fraction_bits);
    // Outwards: one more than the truncated quotient, and for the input's gain, which is short by less than 2^-28.
    let divide = |value: i64| {
        let quotient = value.unsigned_abs() / divisor;
        ((quotient + (quotient >> 27) + 1).min(i64::MAX as u64)) as i64
    };
    Interval {
        low: if torque.low < 0 { -divide(torque.low) } else { 0 },
        high: if torque.high > 0 { divide(torque.high) } else { 0 },
    }
}

/// Sums of a layer: monotone in every input, so the ends of the inputs bound them exactly.
fn first_sums(cell: &Cell, parameters: &NetworkParameters) -> [Interval; NEURONS] {
    parameters.first.map(|weights| {
        let mut sum = Interval::point(weights[INPUTS] as i64);
        for (weight, (low, high)) in weights.iter().zip(cell.inputs) {
            sum = sum.add(Interval::between(smmul(*weight, low) as i64, smmul(*weight, high) as i64));
        }
        sum
    })
}

/// A neuron's 32-bit sum, before its shift to Q25.
fn raw_sum(neuron: &Neuron, activations: &[Interval; NEURONS]) -> Interval {
    let mut sum = Interval::point(neuron.weights[NEURONS] as i64 * ONE);
    for (weight, activation) in neuron.weights.iter().zip(activations) {
        sum = sum.add(activation.times(Interval::point(*weight as i64)));
    }
    sum
}

/// The sum in Q25 as the control step shifts it.
fn shifted(neuron: &Neuron, raw: Interval) -> Interval {
    let shift = neuron.fraction.saturating_sub(MIN_FRACTION) as u32;
    raw.map(|sum| sum >> shift.min(31))
}

/// Activations in Q15 for sums in Q25 that fit 32 bits.
fn activations(sums: [Interval; NEURONS]) -> [Interval; NEURONS] {
    sums.map(|sum| sum.map(|end| (tanh(end as i32) >> 16) as i64))
}

fn check_sums(root: &Cell, parameters: &NetworkParameters) -> Result<(), Overflow> {
    let check = |layer: usize, neuron: usize, sum: Interval| {
        let fits = Interval { low: i32::MIN as i64, high: i32::MAX as i64 };
        let bound = sum.low.saturating_abs().max(sum.high.saturating_abs());
        if fits.contains(sum) { Ok(sum) } else { Err(Overflow { layer, neuron, bound }) }
    };
    let sums = first_sums(root, parameters);
    for (j, sum) in sums.iter().enumerate() {
        check(0, j, *sum)?;
    }
    let mut active = activations(sums);
    for (layer, neurons) in parameters.hidden.iter().enumerate() {
        let mut sums = [Interval::ZERO; NEURONS];
        for (j, (neuron, place)) in neurons.iter().zip(&mut sums).enumerate() {
            *place = shifted(neuron, check(layer + 1, j, raw_sum(neuron, &active))?);
        }
        active = activations(sums);
    }
    check(3, 0, raw_sum(&parameters.output, &active)).map(|_| ())
}

fn cell_bounds(cell: &Cell, parameters: &NetworkParameters) -> CellBounds {
    let sums = first_sums(cell, parameters);
    let mut active = activations(sums);
    let derivatives = sums.map(tanh_slopes);
    let mut slopes = SLOPE_INPUTS.map(|input| {
        let mut layer = [Interval::ZERO; NEURONS];
        for ((place, weights), derivative) in layer.iter_mut().zip(&parameters.first).zip(&derivatives) {
            // Weight Q26 times table slope Q14.
            *place = derivative.times(Interval::point(weights[input] as i64)).shift_right(26 + 14 - SLOPE_BITS);
        }
        layer
    });
    for neurons in &parameters.hidden {
        let mut sums = [Interval::ZERO; NEURONS];
        for (neuron, place) in neurons.iter().zip(&mut sums) {
            *place = shifted(neuron, raw_sum(neuron, &active));
        }
        let derivatives = sums.map(tanh_slopes);
        slopes = slopes.map(|before| {
            let mut layer = [Interval::ZERO; NEURONS];
            for ((place, neuron), derivative) in layer.iter_mut().zip(neurons).zip(&derivatives) {
                *place = weighted(neuron, &before).times(*derivative).shift_right(14);
            }
            layer
        });
        active = activations(sums);
    }
    let output = shifted(&parameters.output, raw_sum(&parameters.output, &active));
    CellBounds {
        torque: output.map(|sum| to_torque(sum as i32, parameters.scale) as i64),
        slopes: slopes.map(|layer| weighted(&parameters.output, &layer)),
    }
}

/// Weighted sum of slopes.
fn weighted(neuron: &Neuron, slopes: &[Interval; NEURONS]) -> Interval {
    let mut sum = Interval::ZERO;
    for (weight, slope) in neuron.weights.iter().zip(slopes) {
        sum = sum.add(slope.times(Interval::point(*weight as i64)));
    }
    sum.shift_right(neuron.fraction as u32)
}

/// Slopes of the tanh table, Q14, over an interval of arguments in Q25.
///
/// The slope falls with the distance from zero, up to the rounding of the knots: one unit of Q15 on either side of a step.
fn tanh_slopes(sum: Interval) -> Interval {
    const ROUNDING: i64 = 32;
    let step = |end: i64| (end >> 20).clamp(-256, 255);
    let (low, high) = (step(sum.low), step(sum.high));
    let slope = |step: i64| TANH[(step + 256) as usize & 511] as i16 as i64;
    let steepest = if low > 0 {
        slope(low)
    } else if high < 0 {
        slope(high)
    } else {
        slope(0).max(slope(-1))
    };
    let flattest = slope(low).min(slope(high));
    Interval { low: (flattest - ROUNDING).max(0), high: (steepest + ROUNDING).min(16384) }
}

/// Halves the cell along the input that moves the first layer most; nothing when no input moves it.
fn split(cell: &Cell, parameters: &NetworkParameters) -> Option<(Cell, Cell)> {
    let mut widest = None;
    for (i, (low, high)) in cell.inputs.iter().enumerate() {
        let width = *high as i64 - *low as i64;
        let weight: i64 = parameters.first.iter().map(|weights| (weights[i] as i64).abs() >> 16).sum();
        let effect = (width >> 16) * weight;
        if effect > 0 && widest.is_none_or(|(_, most)| effect > most) {
            widest = Some((i, effect));
        }
    }
    let (input, _) = widest?;
    let (mut first, mut second) = (*cell, *cell);
    let (low, high) = *cell.inputs.get(input)?;
    let middle = ((low as i64 + high as i64) >> 1) as i32;
    first.inputs.get_mut(input)?.1 = middle;
    second.inputs.get_mut(input)?.0 = middle;
    Some((first, second))
}

/// Worst departure of the fixed-point network from exact arithmetic on the same weights and tables, Q16.16.
fn resolution(parameters: &NetworkParameters) -> u32 {
    // In units of 2^-31. Layer 0: a sum is short by at most six units of Q25 and by the fraction's 12 bits (2^-17);
    // the scaled input by 2^-28 times the weights (below 2^6). An activation is cut to Q15.
    const SUM: i64 = (6 << 6) + (1 << 14) + (1 << 9);
    const CUT: i64 = 1 << 16;
    let spread = |neuron: &Neuron, error: [i64; NEURONS]| {
        let mut sum = 0i64;
        for (weight, error) in neuron.weights.iter().zip(error) {
            sum = sum.saturating_add((*weight as i64).abs().saturating_mul(error));
        }
        sum >> neuron.fraction.min(62)
    };
    let mut error = [SUM + CUT; NEURONS];
    for neurons in &parameters.hidden {
        let mut next = [0; NEURONS];
        for (place, neuron) in next.iter_mut().zip(neurons) {
            *place = spread(neuron, error).saturating_add(1 + SUM + CUT);
        }
        error = next;
    }
    let output = spread(&parameters.output, error).saturating_add(1 << 6);
    let torque = (output >> 8).saturating_add(1).saturating_mul((parameters.scale as i64).abs()) >> 23;
    torque.saturating_add(2).min(u32::MAX as i64) as u32
}

const _: () = assert!(MAX_DEPTH < 16);

impl Network {
    /// The scaled inputs that the box can give, Q31.
    fn input_intervals(&self) -> [(i32, i32); INPUTS] {
        self.inputs().each_ref().map(InputScale::interval)
    }
}
