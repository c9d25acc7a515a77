//! A small image for tests.

use joint_firmware::friction::domain::{Domain, Range};
use joint_firmware::friction::physical::{Coefficients, PhysicalParameters, Terms};
use joint_firmware::friction::regime::Selector;
use joint_firmware::friction::state::{JointState, SIGNALS};
use joint_firmware::friction::{FrictionModel, FrictionParameters, ParameterSet};
use joint_firmware::parameters::certificate::Limits;
use joint_firmware::parameters::image::{Effort, GoldenVector, Image, MAX_LENGTH, Target};

/// An image with a constant friction of `level` Nm.
pub fn image(version: u32, level: f64) -> Vec<u8> {
    // Full scale of a constant: see the image's layout.
    let coefficients =
        Coefficients::from_array(std::array::from_fn(|i| if i == 0 { (level * 65_536.0) as i32 } else { 0 }));
    let set = ParameterSet { physical: PhysicalParameters { terms: Terms::ALL, coefficients }, network: None };
    let range = Range { low: -(100 << 16), high: 100 << 16 };
    let friction = FrictionParameters {
        domain: Domain { ranges: [range; SIGNALS], margin: 0, reference_temperature: 0 },
        selector: Selector::default(),
        sets: [set, ParameterSet::default(), ParameterSet::default(), ParameterSet::default()],
    };
    let signals = [7; SIGNALS];
    let expected = FrictionModel::new(&friction, 20_000).evaluate(0, &JointState::from_signals(signals));
    let image = Image {
        version,
        target: Target::default(),
        created: 0,
        effort: Effort::NewtonMetre,
        data_hash: [0; 16],
        friction,
        limits: Limits { output: 2 << 16, torque_gain: 1 << 15, velocity_slope: 1 << 24 },
        golden: [GoldenVector { set: 0, signals, expected }].into_iter().collect(),
    };
    let mut buffer = [0; MAX_LENGTH];
    let length = image.encode(&mut buffer).unwrap();
    buffer[..length].to_vec()
}
