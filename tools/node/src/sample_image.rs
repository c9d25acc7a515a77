//! Images with constant friction, for tests, benchmarks and hostile buses: what acts can be told from the torque alone.

use friction_compensation::friction::common::CommonTerms;
use friction_compensation::friction::domain::{Domain, Range};
use friction_compensation::friction::network::{MIN_FRACTION, NetworkParameters, Neuron};
use friction_compensation::friction::physical::{Coefficients, PhysicalParameters, Terms};
use friction_compensation::friction::regime::{MAX_SETS, Selector};
use friction_compensation::friction::state::{JointState, SIGNALS};
use friction_compensation::friction::{FrictionModel, FrictionParameters, ParameterSet};
use friction_compensation::parameters::certificate::Limits;
use friction_compensation::parameters::image::{Effort, GoldenVector, Image, MAX_GOLDEN, MAX_LENGTH, Target};

/// Properties that vary.
#[derive(Clone, Copy, Debug)]
pub struct SampleImage<'a> {
    /// Image version.
    pub version: u32,
    /// Friction of each parameter set, Nm, -2 to 2.
    pub levels: &'a [f64],
    /// Selector of the set that applies.
    pub selector: Selector,
    /// Each set has a network, which says nothing.
    pub network: bool,
    /// Golden vectors, 1 to 8: 36 bytes each.
    pub golden: usize,
}

impl SampleImage<'_> {
    /// The smallest: one set.
    #[must_use]
    pub fn constant(version: u32, level: f64) -> Vec<u8> {
        let levels = &[level];
        SampleImage { version, levels, selector: Selector::default(), network: false, golden: 1 }.bytes()
    }

    /// The image's bytes.
    ///
    /// # Panics
    /// Panics if a property that varies is out of its range.
    #[must_use]
    pub fn bytes(&self) -> Vec<u8> {
        let neuron = Neuron { weights: [0; _], fraction: MIN_FRACTION };
        let silent = NetworkParameters { first: [[0; _]; _], hidden: [[neuron; _]; 2], output: neuron, scale: 0 };
        let mut sets = [ParameterSet::default(); MAX_SETS];
        for (set, level) in sets.iter_mut().zip(self.levels) {
            // Full scale of a constant: see the image's layout.
            let constant = |i| if i == 0 { (level * 65_536.0) as i32 } else { 0 };
            let coefficients = Coefficients::from_array(std::array::from_fn(constant));
            let physical = PhysicalParameters { terms: Terms::ALL, coefficients };
            *set = ParameterSet { physical, network: self.network.then_some(silent) };
        }
        let range = Range { low: -(100 << 16), high: 100 << 16 };
        let domain = Domain { ranges: [range; SIGNALS], margin: 0, reference_temperature: 0 };
        let friction = FrictionParameters { domain, selector: self.selector, common: CommonTerms::NONE, sets };
        let model = FrictionModel::new(&friction, 20_000);
        let golden = (0..self.golden.min(MAX_GOLDEN)).map(|number| {
            let signals = [7 + number as i32; SIGNALS];
            GoldenVector { set: 0, signals, expected: model.evaluate(0, &JointState::from_signals(signals)) }
        });
        let image = Image {
            version: self.version,
            target: Target::default(),
            created: 0,
            effort: Effort::NewtonMetre,
            data_hash: [0; 16],
            golden: golden.collect(),
            friction,
            limits: Limits { output: 2 << 16, torque_gain: 1 << 15, velocity_slope: 1 << 24 },
        };
        let mut buffer = [0; MAX_LENGTH];
        let length = image.encode(&mut buffer).expect("a valid image");
        buffer[..length].to_vec()
    }
}
