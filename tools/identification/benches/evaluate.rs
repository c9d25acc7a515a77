//! Samples a second that one core evaluates with the firmware's arithmetic, physical model and network together, at 1x,
//! 10x and 100x the number of samples: the cost is linear.

use divan::Bencher;
use divan::counter::ItemsCount;
use friction_compensation::friction::common::CommonTerms;
use friction_compensation::friction::domain::{Domain, Range};
use friction_compensation::friction::network::{NetworkParameters, Neuron};
use friction_compensation::friction::physical::{Coefficients, PhysicalParameters, Terms};
use friction_compensation::friction::regime::Selector;
use friction_compensation::friction::state::{JointState, SIGNALS};
use friction_compensation::friction::{FrictionModel, FrictionParameters, ParameterSet};

fn main() {
    divan::main();
}

/// Every term, and a network with no weight zero.
fn parameters() -> FrictionParameters {
    let range = Range { low: -(8 << 16), high: 8 << 16 };
    let neuron = Neuron { weights: [3000, -7000, 5000, 900, -4000, 1500], fraction: 13 };
    let network = NetworkParameters {
        first: [[9 << 24, 20 << 26, -(7 << 24), 3 << 24, 5 << 24, 1 << 22]; 5],
        hidden: [[neuron; 5]; 2],
        output: neuron,
        scale: 2 << 16,
    };
    let coefficients = Coefficients::from_array(std::array::from_fn(|i| 4000 + 997 * i as i32));
    let set = ParameterSet { physical: PhysicalParameters { terms: Terms::ALL, coefficients }, network: Some(network) };
    FrictionParameters {
        domain: Domain { ranges: [range; SIGNALS], margin: 1 << 15, reference_temperature: 0 },
        selector: Selector::default(),
        common: CommonTerms::NONE,
        sets: [set, ParameterSet::default(), ParameterSet::default(), ParameterSet::default()],
    }
}

#[divan::bench(args = [10_000, 100_000, 1_000_000])]
fn physical_and_network(bencher: Bencher, samples: u32) {
    let model = FrictionModel::new(&parameters(), 1);
    let state = |n: u32| {
        JointState::from_signals(std::array::from_fn(|i| {
            (n.wrapping_mul(2_654_435_761).rotate_left(5 * i as u32) >> 12) as i32 - (1 << 19)
        }))
    };
    let states: Vec<JointState> = (0..samples).map(state).collect();
    bencher.counter(ItemsCount::new(samples)).bench_local(|| {
        states.iter().fold(0, |sum: i32, state| sum.wrapping_add(model.evaluate(0, state).total().to_bits()))
    });
}
