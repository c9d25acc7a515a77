//! The proof that an image cannot overflow, exceed its bound or destabilise the loop; task or host.
//!
//! Computed from the image alone, by interval arithmetic on the same integers that the control step uses: every
//! operation there is monotone in each operand, so evaluating it at the ends of an interval bounds it exactly,
//! rounding and saturation included. The box of signals is bisected where that tightens a bound; the work is limited
//! ([`MAX_DEPTH`]), so that a board can do it in a background task.
//!
//! Certified, for every parameter set and every state whatsoever (signals are clamped to the box):
//! - no sum wraps, in the network or in the physical model;
//! - |friction|, |network| never exceed the stated torques;
//! - the slope of the network over measured torque, which closes a loop around the compensation, and the slope of
//!   friction over velocity, which is negative damping, stay within the stated intervals; these contain zero, the slope
//!   where a signal is clamped or a torque saturates. The fixed-point model is a fine staircase: between two states
//!   that differ in that signal alone it moves by at most slope times distance plus twice the
//!   [resolution](Certificate::resolution).
//!
//! Pre-sliding elements have a state, whatever which: their torque is bounded, and the slope over velocity contains
//! what one evaluation bends, a thousand times a second or more often. Over the position they are a spring of the sum
//! of level times stiffness.
//!
//! Not certified: what the [fade](crate::friction::domain::Fade) beyond the trained box and the cross-fade between sets
//! add to these slopes. The compensation limits both by its slew rate.

mod interval;
mod network;
mod physical;
mod slopes;

use crate::friction::common::CommonTerms;
use crate::friction::domain::Domain;
use crate::friction::smooth::tanh;
use crate::friction::state::Signal;
use crate::friction::{FrictionParameters, ParameterSet};
use crate::quantity::Torque;
use interval::Interval;

/// Depth of bisection of the box: at most 2^MAX_DEPTH cells for each part of all sets together.
pub const MAX_DEPTH: u32 = 8;

/// Depth of bisection of the box of one of `sets` sets, so that more sets do not take more work.
const fn depth(sets: usize) -> u32 {
    match sets {
        0 | 1 => MAX_DEPTH,
        2 => MAX_DEPTH - 1,
        _ => MAX_DEPTH - 2,
    }
}

/// Limits that an image may not exceed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Limits {
    /// |friction|, Q16.16 of the effort's unit.
    pub output: u32,
    /// |d(network) / d(measured torque)|, Q16.16.
    pub torque_gain: u32,
    /// |d(friction) / d(velocity)|, 1/256 Nm s/rad.
    pub velocity_slope: u32,
}

/// Proved bounds of an image: the largest over its parameter sets.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Certificate {
    /// |friction| is at most this, Q16.16.
    pub output: u32,
    /// |network| is at most this, Q16.16.
    pub network: u32,
    /// |d(network) / d(measured torque)| is at most this, Q16.16; `u32::MAX`: nothing is proved.
    pub torque_gain: u32,
    /// d(friction) / d(velocity) is at least this, 1/256 Nm s/rad; never positive; `i64::MIN`: nothing is proved.
    pub velocity_slope_low: i64,
    /// d(friction) / d(velocity) is at most this, 1/256 Nm s/rad; never negative; `i64::MAX`: nothing is proved.
    pub velocity_slope_high: i64,
    /// The fixed-point staircase departs from the smooth model that the slopes are of by at most this, Q16.16.
    pub resolution: u32,
}

/// Reason for which an image must not be used. Numbers are in the units of [`Limits`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// A neuron's sum can leave 32 bits.
    NetworkOverflow {
        /// Parameter set.
        set: usize,
        /// Layer, 0 to 3.
        layer: usize,
        /// Neuron in the layer.
        neuron: usize,
        /// Largest magnitude that the sum can reach.
        bound: i64,
    },
    /// The physical model's sum can leave the range of Q16.16.
    PhysicalOverflow {
        /// Parameter set.
        set: usize,
    },
    /// Friction can exceed its limit.
    Output {
        /// Proved bound.
        bound: u32,
        /// Limit of the image.
        limit: u32,
    },
    /// The loop through the measured torque can exceed its limit.
    TorqueGain {
        /// Proved bound.
        bound: u32,
        /// Limit of the image.
        limit: u32,
    },
    /// The slope over velocity can exceed its limit.
    VelocitySlope {
        /// Proved bound.
        bound: i64,
        /// Limit of the image.
        limit: u32,
    },
}

impl core::fmt::Display for Refusal {
    fn fmt(&self, f: &mut core::fmt::Formatter) -> core::fmt::Result {
        match *self {
            Self::NetworkOverflow { set, layer, neuron, bound } => write!(
                f,
                "network can overflow: the sum of neuron {neuron} in layer {layer} of set {set} reaches {bound}, limit {}",
                i32::MAX
            ),
            Self::PhysicalOverflow { set } => {
                write!(f, "physical model can overflow: set {set} can leave +-32768, the range of Q16.16")
            }
            Self::Output { bound, limit } => {
                let [bound, limit] = [bound, limit].map(Decimal::of_q16);
                write!(f, "friction can reach {bound}, limit {limit} Nm")
            }
            Self::TorqueGain { bound, limit } => {
                let [bound, limit] = [bound, limit].map(Decimal::of_q16);
                write!(f, "d(network)/d(measured torque) can reach {bound}, limit {limit}")
            }
            Self::VelocitySlope { bound, limit } => {
                let [bound, limit] = [bound, limit as i64].map(Decimal::of_q8);
                write!(f, "d(friction)/d(velocity) can reach {bound}, limit {limit} Nm s/rad")
            }
        }
    }
}

impl core::error::Error for Refusal {}

/// A binary fraction, printed without floating point, cut to so many places that two that differ look different.
struct Decimal {
    value: i64,
    fraction_bits: u32,
    places: u32,
}

impl Decimal {
    fn of_q16(bits: u32) -> Self {
        Self { value: bits as i64, fraction_bits: 16, places: 5 }
    }

    fn of_q8(bits: i64) -> Self {
        Self { value: bits, fraction_bits: 8, places: 3 }
    }
}

impl core::fmt::Display for Decimal {
    fn fmt(&self, f: &mut core::fmt::Formatter) -> core::fmt::Result {
        let &Self { value, fraction_bits, places } = self;
        let magnitude = value.unsigned_abs();
        let whole = magnitude >> fraction_bits;
        let fraction = ((magnitude - (whole << fraction_bits)) * 10u64.pow(places)) >> fraction_bits;
        let sign = if value < 0 { "-" } else { "" };
        write!(f, "{sign}{whole}.{fraction:0width$}", width = places as usize)
    }
}

/// Computes what can be proved of `parameters`, whatever their limits; an error where a sum could wrap.
pub fn prove(parameters: &FrictionParameters) -> Result<Certificate, Refusal> {
    let FrictionParameters { domain, selector, common, sets } = parameters;
    let mut proved = None;
    for (index, set) in sets.iter().enumerate().take(selector.sets()) {
        prove_set(domain, common, set, index, selector.sets(), &mut proved)?;
    }
    Ok(proved.unwrap_or_default())
}

/// Adds what can be proved of the set `index` of `sets` to what has been of those before.
#[inline(never)]
pub(crate) fn prove_set(
    domain: &Domain,
    common: &CommonTerms,
    set: &ParameterSet,
    index: usize,
    sets: usize,
    proved: &mut Option<Certificate>,
) -> Result<(), Refusal> {
    let depth = depth(sets);
    let velocity_shift = domain.shifts()[Signal::Velocity as usize];
    let physical =
        physical::bounds(&set.physical, common, domain, depth).ok_or(Refusal::PhysicalOverflow { set: index })?;
    let network = match &set.network {
        Some(network) => network::bounds(network, domain, depth).map_err(|sum| Refusal::NetworkOverflow {
            set: index,
            layer: sum.layer,
            neuron: sum.neuron,
            bound: sum.bound,
        })?,
        None => network::Bounds::default(),
    };
    let slope = physical.slope.per_unit(velocity_shift).add(network.velocity_slope).add(physical.bending);
    let this = Certificate {
        output: physical.torque.add(network.torque).magnitude(),
        network: network.torque.magnitude(),
        torque_gain: network.torque_gain.magnitude(),
        velocity_slope_low: slope.low,
        velocity_slope_high: slope.high,
        resolution: physical.resolution.saturating_add(network.resolution),
    };
    *proved = Some(proved.map_or(this, |before| before.worst(&this)));
    Ok(())
}

/// Computes the certificate of `parameters` and holds it against `limits`.
pub fn certify(parameters: &FrictionParameters, limits: &Limits) -> Result<Certificate, Refusal> {
    let proved = prove(parameters)?;
    proved.hold(limits)?;
    Ok(proved)
}

impl Certificate {
    /// Holds what is proved against `limits`.
    #[inline(never)]
    pub(crate) fn hold(&self, limits: &Limits) -> Result<(), Refusal> {
        if self.output > limits.output {
            return Err(Refusal::Output { bound: self.output, limit: limits.output });
        }
        if self.torque_gain > limits.torque_gain || self.torque_gain == u32::MAX {
            return Err(Refusal::TorqueGain { bound: self.torque_gain, limit: limits.torque_gain });
        }
        for bound in [self.velocity_slope_low, self.velocity_slope_high] {
            if bound.unsigned_abs() > limits.velocity_slope as u64 {
                return Err(Refusal::VelocitySlope { bound, limit: limits.velocity_slope });
            }
        }
        Ok(())
    }

    fn worst(&self, other: &Self) -> Self {
        Self {
            output: self.output.max(other.output),
            network: self.network.max(other.network),
            torque_gain: self.torque_gain.max(other.torque_gain),
            velocity_slope_low: self.velocity_slope_low.min(other.velocity_slope_low),
            velocity_slope_high: self.velocity_slope_high.max(other.velocity_slope_high),
            resolution: self.resolution.max(other.resolution),
        }
    }

    /// Bound of |friction| as a torque.
    pub const fn output_torque(&self) -> Torque {
        Torque::from_bits(if self.output > i32::MAX as u32 { i32::MAX } else { self.output as i32 })
    }
}

/// The table of the control step, whose look-up is inlined there; here it is linked once.
#[inline(never)]
fn tanh_at(argument: i64) -> i64 {
    tanh(argument as i32) as i64
}

/// A bisection of a range of cells, `deepest` times (at most [`MAX_DEPTH`]): keeps splitting while a cell can still
/// raise the largest bound found.
///
/// `bound` returns what holds in a cell, `covers` says whether the second adds nothing to the first, `split` halves a
/// cell.
fn bisect<Cell: Copy, Bound: Copy>(
    root: Cell,
    deepest: u32,
    bound: &impl Fn(&Cell) -> Bound,
    merge: &impl Fn(Bound, Bound) -> Bound,
    covers: &impl Fn(&Bound, &Bound) -> bool,
    split: &impl Fn(&Cell) -> Option<(Cell, Cell)>,
) -> Bound {
    // A depth-first walk needs one waiting cell a level.
    let mut waiting: heapless::Vec<(Cell, u32), { MAX_DEPTH as usize + 1 }> = heapless::Vec::new();
    let mut found: Option<Bound> = None;
    let mut next = Some((root, 0));
    while let Some((cell, depth)) = next {
        let here = bound(&cell);
        let covered = found.as_ref().is_some_and(|found| covers(found, &here));
        let halves = if covered || depth >= deepest { None } else { split(&cell) };
        next = match halves {
            Some((first, second)) => {
                // One slot a level suffices, so this push cannot fail; if it did, the cell counts whole.
                if waiting.push((second, depth + 1)).is_err() {
                    found = Some(found.map_or(here, |found| merge(found, here)));
                }
                Some((first, depth + 1))
            }
            None => {
                if !covered {
                    found = Some(found.map_or(here, |found| merge(found, here)));
                }
                waiting.pop()
            }
        };
    }
    found.unwrap_or_else(|| bound(&root))
}

impl Interval {
    /// A slope over a signal's full scale (Q16.16) as a slope over its unit, 1/256; rounded outwards.
    fn per_unit(self, shift: u32) -> Self {
        // Full scale is 2^(15 - shift) units: divide by it, and by 2^8 for the change from Q16 to Q8.
        let right = 8 + 15 - shift as i32;
        if right >= 0 { self.shift_right(right as u32) } else { self.shift_left(right.unsigned_abs()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bisection_comes_down_to_the_finest_cells_and_visits_each_of_them() {
        let visited = core::cell::Cell::new(0u32);
        let widest = bisect(
            (0u32, 1u32 << MAX_DEPTH),
            MAX_DEPTH,
            &|(low, high)| {
                visited.set(visited.get() + 1);
                high - low
            },
            &|a, b| a.max(b),
            &|_, _| false,
            &|&(low, high)| {
                let middle = (low + high) / 2;
                Some(((low, middle), (middle, high)))
            },
        );
        // A waiting cell that found no place would have counted whole.
        assert_eq!((widest, visited.get()), (1, (2 << MAX_DEPTH) - 1));
    }

    #[test]
    fn a_refusal_tells_a_bound_from_a_limit_one_unit_below_and_keeps_its_sign() {
        let output = Refusal::Output { bound: 65_537, limit: 65_536 }.to_string();
        assert_eq!(output, "friction can reach 1.00001, limit 1.00000 Nm");
        let slope = Refusal::VelocitySlope { bound: -129, limit: 128 }.to_string();
        assert_eq!(slope, "d(friction)/d(velocity) can reach -0.503, limit 0.500 Nm s/rad");
        assert_eq!(Decimal::of_q8(i64::MIN).to_string(), "-36028797018963968.000");
    }
}
