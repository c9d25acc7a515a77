//! Bounds of the network: torque, slopes over measured torque and velocity, for every input in the box.

use super::interval::Interval;
use super::{bisect, slopes, tanh_at};
use crate::dsp::smmul;
use crate::friction::domain::Domain;
use crate::friction::network::{
    INPUTS, InputScale, Inputs, MIN_FRACTION, NEURONS, NetworkParameters, Neuron, output_scale, to_torque,
};
use crate::friction::state::Signal;

/// Bounds of the network in the whole box.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Bounds {
    /// Q16.16.
    pub(super) torque: Interval,
    /// d(network) / d(measured torque), Q16.16.
    pub(super) torque_gain: Interval,
    /// d(network) / d(velocity), 1/256 Nm s/rad.
    pub(super) velocity_slope: Interval,
    /// Deviation of the fixed-point network from the piecewise linear one whose slopes are bounded, Q16.16.
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

/// The bias' input, Q15.
const ONE: i64 = 0x7fff;

#[inline(never)]
pub(super) fn bounds(parameters: &NetworkParameters, domain: &Domain, depth: u32) -> Result<Bounds, Overflow> {
    let root = Cell { inputs: Inputs::new(domain).intervals() };
    check_sums(&root, parameters)?;
    let torque = torque_bounds(root, parameters, depth);
    let (torque_gain, velocity_slope) = slopes_over_signals(&root, parameters, domain);
    Ok(Bounds { torque, torque_gain, velocity_slope, resolution: resolution(parameters) })
}

// Functions of their own, so that their stacks are not taken side by side.

/// Slopes over measured torque and velocity.
#[inline(never)]
fn slopes_over_signals(root: &Cell, parameters: &NetworkParameters, domain: &Domain) -> (Interval, Interval) {
    let tanh_slopes = tanh_slopes(root, parameters);
    let slope = |signal: Signal, fraction_bits: u32| {
        let over_input = slopes::over_input(parameters, &tanh_slopes, signal as usize);
        per_signal(over_input, parameters.scale, domain.ranges[signal as usize].half_width(), fraction_bits)
    };
    (slope(Signal::MeasuredTorque, 16), slope(Signal::Velocity, 8))
}

#[inline(never)]
fn torque_bounds(root: Cell, parameters: &NetworkParameters, depth: u32) -> Interval {
    let scale = output_scale(parameters.scale);
    bisect(
        root,
        depth,
        &|cell| output(cell, parameters).map(|sum| to_torque(sum as i32, scale) as i64),
        &|a, b| a.union(b),
        &|found, new| found.contains(*new),
        &|cell| split(cell, parameters),
    )
}

/// Slopes of the three hidden layers.
#[inline(never)]
fn tanh_slopes(root: &Cell, parameters: &NetworkParameters) -> [[Interval; NEURONS]; 3] {
    let [second, third] = &parameters.hidden;
    let mut slopes = [[Interval::ZERO; NEURONS]; 3];
    let mut sums = first_sums(root, parameters);
    for (place, next) in slopes.iter_mut().zip([Some(second), Some(third), None]) {
        *place = sums;
        place.iter_mut().for_each(|sum| *sum = slopes::of_tanh(*sum));
        if let Some(neurons) = next {
            activate(&mut sums);
            sums = hidden_sums(neurons, &sums);
        }
    }
    slopes
}

/// Slope over a scaled input (Q20) times the output's scale (Q16.16), divided by the input's half width (Q16.16).
#[inline(never)]
fn per_signal(slope: Interval, scale: i32, half_width: u32, fraction_bits: u32) -> Interval {
    let Some(divisor) = core::num::NonZeroU64::new(half_width as u64) else {
        return Interval::ZERO; // an input without a range has no influence
    };
    let torque = slope.times(Interval::point(scale as i64)).shift_right(slopes::FRACTION_BITS - fraction_bits);
    // Outwards: one more than the truncated quotient, and for the input's gain, which is short by less than 2^-28.
    let divide = |value: i64| {
        let quotient = value.unsigned_abs() / divisor;
        ((quotient + (quotient >> 27) + 1).min(i64::MAX as u64)) as i64
    };
    // Zero belongs to it, for beyond the range the input is clamped; what has no bound keeps none.
    Interval {
        low: match torque.low {
            i64::MIN => i64::MIN,
            low if low < 0 => -divide(low),
            _ => 0,
        },
        high: match torque.high {
            i64::MAX => i64::MAX,
            high if high > 0 => divide(high),
            _ => 0,
        },
    }
}

/// Sums of a layer: monotone in every input, so the ends of the inputs bound them exactly.
#[inline(never)]
fn first_sums(cell: &Cell, parameters: &NetworkParameters) -> [Interval; NEURONS] {
    parameters.first.map(|weights| {
        let mut sum = Interval::point(weights[INPUTS] as i64);
        for (weight, (low, high)) in weights.iter().zip(cell.inputs) {
            let (a, b) = (smmul(*weight, low) as i64, smmul(*weight, high) as i64);
            sum = sum.add_here(Interval { low: a.min(b), high: a.max(b) });
        }
        sum
    })
}

/// A neuron's 32-bit sum, before its shift to Q25.
#[inline(never)]
fn raw_sum(neuron: &Neuron, activations: &[Interval; NEURONS]) -> Interval {
    let mut sum = Interval::point(neuron.weights[NEURONS] as i64 * ONE);
    for (weight, activation) in neuron.weights.iter().zip(activations) {
        sum = sum.add_here(activation.scaled(*weight));
    }
    sum
}

/// The sum in Q25 as the control step shifts it.
#[inline(never)]
fn shifted(neuron: &Neuron, raw: Interval) -> Interval {
    let shift = neuron.fraction.saturating_sub(MIN_FRACTION) as u32;
    raw.map(|sum| sum >> shift.min(31))
}

/// Activations in Q15 in place of sums in Q25 that fit 32 bits.
#[inline(never)]
fn activate(sums: &mut [Interval; NEURONS]) {
    sums.iter_mut().for_each(|sum| *sum = sum.map(|end| tanh_at(end) >> 16));
}

#[inline(never)]
fn check_sums(root: &Cell, parameters: &NetworkParameters) -> Result<(), Overflow> {
    let check = |layer: usize, neuron: usize, sum: Interval| {
        let fits = Interval { low: i32::MIN as i64, high: i32::MAX as i64 };
        let bound = sum.low.saturating_abs().max(sum.high.saturating_abs());
        if fits.contains(sum) { Ok(sum) } else { Err(Overflow { layer, neuron, bound }) }
    };
    let mut active = first_sums(root, parameters);
    for (j, sum) in active.iter().enumerate() {
        check(0, j, *sum)?;
    }
    activate(&mut active);
    for (layer, neurons) in parameters.hidden.iter().enumerate() {
        let mut sums = [Interval::ZERO; NEURONS];
        for (j, (neuron, place)) in neurons.iter().zip(&mut sums).enumerate() {
            *place = shifted(neuron, check(layer + 1, j, raw_sum(neuron, &active))?);
        }
        activate(&mut sums);
        active = sums;
    }
    check(3, 0, raw_sum(&parameters.output, &active)).map(|_| ())
}

/// The output's sum in one cell, Q25. One layer at a time: what all of them give takes a quarter of a kilobyte of
/// stack.
#[inline(never)]
fn output(cell: &Cell, parameters: &NetworkParameters) -> Interval {
    let mut active = first_sums(cell, parameters);
    activate(&mut active);
    for neurons in &parameters.hidden {
        active = hidden_sums(neurons, &active);
        activate(&mut active);
    }
    shifted(&parameters.output, raw_sum(&parameters.output, &active))
}

#[inline(never)]
fn hidden_sums(neurons: &[Neuron; NEURONS], activations: &[Interval; NEURONS]) -> [Interval; NEURONS] {
    neurons.each_ref().map(|neuron| shifted(neuron, raw_sum(neuron, activations)))
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
    // the one input that differs is cut by at most four units of Q31, times a weight below 2^5. An activation is cut to
    // Q15.
    const SUM: i64 = (6 << 6) + (1 << 14) + (4 << 5);
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
    let output = spread(&parameters.output, error).saturating_add(1 + (1 << 6));
    let torque = (output >> 8).saturating_add(1).saturating_mul((parameters.scale as i64).abs()) >> 23;
    torque.saturating_add(2).min(u32::MAX as i64) as u32
}

impl Inputs {
    /// The scaled inputs that the box can give, Q31.
    fn intervals(&self) -> [(i32, i32); INPUTS] {
        self.scales().each_ref().map(InputScale::interval)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slope_on_one_side_of_zero_is_bounded_by_zero_on_the_other() {
        let per_unit = |low, high| per_signal(Interval { low, high }, 1 << 16, 1 << 16, 16);
        assert_eq!(per_unit(0, 0), Interval::ZERO);
        let one = 1 << slopes::FRACTION_BITS;
        // Outwards by one unit of Q16.16.
        assert_eq!(per_unit(-one, -1), Interval { low: -(1 << 16) - 1, high: 0 });
        assert_eq!(per_unit(1, one), Interval { low: 0, high: (1 << 16) + 1 });
    }

    #[test]
    fn a_network_is_short_by_what_its_roundings_cut_and_the_bound_is_hardly_more() {
        let mut parameters = NetworkParameters { scale: 128 << 16, ..NetworkParameters::default() };
        assert!(resolution(&parameters) <= 4, "nothing but its last roundings: {}", resolution(&parameters));
        // The output is one activation of the last layer: cut to Q15, of a sum that a fraction of 12 bits cuts by
        // 2^-17.
        parameters.output.weights[0] = 1 << 14;
        parameters.output.fraction = 14;
        let cut = (1.0 / 32_768.0 + 1.0 / 131_072.0) * parameters.scale as f64;
        let bound = resolution(&parameters) as f64;
        assert!(cut <= bound && bound <= 1.02 * cut, "{bound} units for {cut}");
    }
}
