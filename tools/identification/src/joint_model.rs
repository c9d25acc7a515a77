//! The friction of a joint as f64 and as the firmware's integers, evaluated over recorded samples; host.
//!
//! Every judged number of an image comes from [`fixed_point`], which calls the code that the board runs.
//! [`FloatFriction`] is its twin in f64: what was trained, or what an image says without the rounding of its
//! arithmetic.

use crate::friction_model::{FrictionModel, JointState as FloatState};
use crate::network::Network;
use crate::quantize::QuantizeError;
use crate::rigid::{LAGS, RigidParameters, RigidState};
use crate::samples::Samples;
use friction_compensation::compensation::{Compensation, Request, Settings};
use friction_compensation::friction::common::CommonTorques;
use friction_compensation::friction::maxwell_slip::{Bent as FirmwareBent, LOWEST_RATE};
use friction_compensation::friction::regime::Selector;
use friction_compensation::friction::state::JointState;
use friction_compensation::friction::{FrictionModel as FirmwareModel, FrictionParameters};
use friction_compensation::quantity::{Acceleration, OutOfRange, Position, Temperature, Torque, Velocity};
use rayon::prelude::*;

/// A recorded sample that the firmware's quantities cannot hold.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{signal} of sample {index}: {source}")]
pub struct StateError {
    /// Name of the signal.
    pub signal: &'static str,
    /// Index of the sample.
    pub index: usize,
    /// The value and its limits.
    pub source: OutOfRange,
}

/// Friction in f64: for each regime a physical model and perhaps a network.
#[derive(Clone, Debug)]
pub struct FloatFriction {
    /// Parameter sets, in the order of the selector.
    pub sets: Vec<(FrictionModel, Option<Network>)>,
}

impl FloatFriction {
    /// The friction that an image's parameters stand for, without the rounding of the firmware's arithmetic.
    pub fn of_image(parameters: &FrictionParameters) -> Result<Self, QuantizeError> {
        let sets = parameters.sets.iter().take(parameters.selector.sets()).map(|set| {
            let mut physical = crate::quantize::physical::dequantize(&set.physical, &parameters.domain);
            crate::quantize::common::dequantize(&parameters.common, &mut physical);
            let network = set.network.as_ref();
            let network = network.map(|n| crate::quantize::network::dequantize(n, &parameters.domain)).transpose()?;
            Ok((physical, network))
        });
        Ok(Self { sets: sets.collect::<Result<_, QuantizeError>>()? })
    }

    /// Physical friction and the network's share of one sample, by parameter set `set`.
    pub fn parts(&self, set: usize, samples: &Samples, index: usize) -> (f64, f64) {
        let Some((physical, network)) = self.sets.get(set) else { return (0.0, 0.0) };
        let inputs = network_inputs(samples, index);
        let network = network.as_ref().map_or(0.0, |network| network.evaluate(&inputs));
        (physical.friction(&float_state(samples, index)), network)
    }
}

/// The state of one sample in f64.
pub fn float_state(samples: &Samples, index: usize) -> FloatState {
    FloatState {
        position: samples.position[index],
        velocity: samples.velocity[index],
        acceleration: samples.acceleration[index],
        load: load(samples, index),
        temperature: samples.temperature[index],
        bent: samples.bent.get(index).copied().unwrap_or_default(),
        following: samples.partner.as_ref().is_some_and(|partner| partner.leads[index]),
    }
}

/// The inputs of a network for one sample: position, velocity, theoretical torque, measured torque, temperature.
pub fn network_inputs(samples: &Samples, index: usize) -> [f64; 5] {
    let (position, velocity) = (samples.position[index], samples.velocity[index]);
    [position, velocity, load(samples, index), samples.effort[index], samples.temperature[index]]
}

/// The theoretical torque, zero before the rigid part is identified.
fn load(samples: &Samples, index: usize) -> f64 {
    samples.load.get(index).copied().unwrap_or(0.0)
}

/// State of the rigid part in one sample; mass and length are 0 where there are no such columns.
pub fn rigid_state(samples: &Samples, index: usize) -> RigidState {
    let extra = |name: &str| samples.extra.get(name).map_or(0.0, |column| column[index]);
    let now = samples.acceleration[index];
    RigidState {
        position: samples.position[index],
        acceleration: now,
        mass: extra("mass"),
        length: extra("length"),
        lagged: LAGS.map(|lag| samples.acceleration[samples.shifted(index, -lag)] - now),
        given: extra("rigid"),
    }
}

/// The rigid part of the effort of every sample.
pub fn rigid_efforts(rigid: &RigidParameters, samples: &Samples) -> Vec<f64> {
    (0..samples.len()).map(|i| rigid.effort(&rigid_state(samples, i))).collect()
}

/// The state of every sample as the firmware's quantities.
pub fn firmware_states(samples: &Samples) -> Result<Vec<JointState>, StateError> {
    let state = |index: usize| {
        let located = |signal: &'static str| move |source| StateError { signal, index, source };
        Ok(JointState {
            position: Position::from_f64(samples.position[index]).map_err(located("position"))?,
            velocity: Velocity::from_f64(samples.velocity[index]).map_err(located("velocity"))?,
            acceleration: Acceleration::from_f64(samples.acceleration[index]).map_err(located("acceleration"))?,
            theoretical_torque: Torque::from_f64(load(samples, index)).map_err(located("theoretical torque"))?,
            measured_torque: Torque::from_f64(samples.effort[index]).map_err(located("effort"))?,
            temperature: Temperature::from_f64(samples.temperature[index]).map_err(located("temperature"))?,
            coupled_velocity: match &samples.partner {
                Some(partner) => Velocity::from_f64(partner.velocity[index]).map_err(located("partner's velocity"))?,
                None => Velocity::ZERO,
            },
        })
    };
    (0..samples.len()).into_par_iter().map(state).collect()
}

/// The parameter set that applies to each sample; every run begins anew.
pub fn regimes(selector: &Selector, states: &[JointState], samples: &Samples) -> Vec<usize> {
    let mut set = 0;
    let mut sets = Vec::with_capacity(states.len());
    for (i, state) in states.iter().enumerate() {
        let previous = if i > 0 && samples.run[i] == samples.run[i - 1] { set } else { 0 };
        set = selector.select(state, previous);
        sets.push(set);
    }
    sets
}

/// Steps of the firmware for one sample: as many as it takes to reach [`LOWEST_RATE`]. Between samples velocity is
/// held, which bends an element as far as one long step does.
struct Steps {
    /// Steps a second.
    rate: u32,
    /// Steps for one sample, at least 1.
    of_a_sample: u32,
}

impl Steps {
    fn of(samples: &Samples) -> Self {
        let sampled = (1.0 / samples.period()).clamp(f64::MIN_POSITIVE, f64::from(LOWEST_RATE) * 1e3);
        let of_a_sample = (f64::from(LOWEST_RATE) / sampled).ceil().clamp(1.0, f64::from(LOWEST_RATE));
        Self { rate: (sampled * of_a_sample).round() as u32, of_a_sample: of_a_sample as u32 }
    }

    /// The result of the last of a sample's steps.
    fn step<T>(&self, mut step: impl FnMut() -> T) -> T {
        (1..self.of_a_sample).for_each(|_| _ = step());
        step()
    }
}

/// Physical friction and the network's share of every sample, computed by the firmware. Every run begins anew.
pub fn fixed_point(
    parameters: &FrictionParameters,
    states: &[JointState],
    sets: &[usize],
    samples: &Samples,
) -> Vec<(f64, f64)> {
    let steps = Steps::of(samples);
    let model = FirmwareModel::new(parameters, steps.rate);
    let mut bent = FirmwareBent::default();
    let common: Vec<CommonTorques> = (0..states.len())
        .map(|i| {
            if i > 0 && samples.run[i] != samples.run[i - 1] {
                bent = FirmwareBent::default();
            }
            steps.step(|| model.common(&mut bent, &states[i]))
        })
        .collect();
    let evaluate = |((state, set), common): ((&JointState, &usize), &CommonTorques)| {
        let estimate = model.evaluate_with(*set, state, common);
        (estimate.physical.to_f64(), estimate.network.to_f64())
    };
    states.par_iter().zip(sets).zip(&common).with_min_len(4096).map(evaluate).collect()
}

/// Compensation torque of every sample, computed step by step as in the control loop: regimes with cross-fade, fades
/// outside the trained box; full gain, no clamp, no slew limit. Every run begins anew.
pub fn replay(parameters: &FrictionParameters, states: &[JointState], samples: &Samples) -> Vec<f64> {
    let steps = Steps::of(samples);
    let model = FirmwareModel::new(parameters, steps.rate);
    // The widest settings are always in range.
    let Ok(settings) = Settings::new(Request::PhysicalAndNetwork, 1 << 16, Torque::MAX, Torque::MAX, 1) else {
        return vec![0.0; states.len()];
    };
    let mut compensation = Compensation::default();
    let mut torques = Vec::with_capacity(states.len());
    for (i, state) in states.iter().enumerate() {
        if i > 0 && samples.run[i] != samples.run[i - 1] {
            compensation = Compensation::default();
        }
        torques.push(steps.step(|| compensation.step(Some(&model), &settings, state)).torque.to_f64());
    }
    torques
}

#[cfg(test)]
mod tests {
    use super::*;

    fn steps(period: f64) -> (u32, u32) {
        let steps = Steps::of(&Samples { time: vec![0.0, period], ..Samples::default() });
        (steps.of_a_sample, steps.rate)
    }

    #[test]
    fn a_sample_takes_as_many_steps_as_make_a_thousand_a_second() {
        assert_eq!(steps(1.0 / 1_001.0), (1, 1_001));
        assert_eq!(steps(0.001), (1, 1_000));
        assert_eq!(steps(1.0 / 999.0), (2, 1_998));
        assert_eq!(steps(0.01), (10, 1_000));
        assert_eq!(steps(10.0), (1_000, 100), "no more than a thousand, however slow the recording");
    }
}
