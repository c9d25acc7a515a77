//! The layers between a friction estimate and the torque that is added, each of which can be taken away to see what it
//! does.

use crate::driving::enabled;
use friction_compensation::compensation::Request;
use friction_compensation::friction::FrictionModel;
use joint_firmware::joint::active::Active;
use joint_firmware::joint::configuration::{AdaptationRequest, Configuration, VelocitySource};
use plant::VirtualJoint;
use plant::actuator::ActuatorParameters;
use plant::virtual_joint::{Setup, VirtualJointError};

/// Largest slew limit that a configuration may have, Nm/s.
const FASTEST_SLEW: f32 = 30e3;

/// A compensation that differs from the default in one layer.
#[derive(Clone, Copy)]
pub struct Variant {
    /// Name of the difference.
    pub name: &'static str,
    /// Change of the configuration of joint and bridge.
    pub configure: fn(&mut Setup),
    /// Change of what the configuration does not offer.
    pub prepare: fn(&mut Active),
}

/// Configuration of [`Setup::of`], physical model and network.
pub const DEFAULT: Variant = Variant { name: "all layers", configure: |_| {}, prepare: |_| {} };

/// The default with adaptation.
pub const ADAPTIVE: Variant = Variant {
    name: "adaptation",
    configure: |s| s.configuration.compensation.adaptation = AdaptationRequest::On,
    ..DEFAULT
};

/// The default and everything that can be taken away from it.
pub const ALL: [Variant; 9] = [
    DEFAULT,
    Variant { name: "velocity always the measured one", configure: |s| measured(&mut s.configuration), ..DEFAULT },
    Variant { name: "no network", configure: |s| s.configuration.compensation.request = Request::Physical, ..DEFAULT },
    Variant { name: "gain 1 for 0.98", configure: |s| s.configuration.compensation.gain = 1.0, ..DEFAULT },
    Variant {
        name: "no clamp",
        configure: |s| s.configuration.compensation.clamp = s.configuration.limits.torque,
        ..DEFAULT
    },
    Variant { name: "no slew limit", configure: |s| s.configuration.compensation.slew = FASTEST_SLEW, ..DEFAULT },
    Variant {
        name: "no fade at standstill",
        prepare: |active| active.compensation.inverse_standstill = f32::INFINITY,
        ..DEFAULT
    },
    Variant {
        name: "energy guard may take all",
        configure: |s| s.configuration.compensation.uncertainty = 1.0,
        ..DEFAULT
    },
    Variant {
        name: "no energy guard",
        // No motion counts as speeding up.
        prepare: |active| active.compensation.standstill = f32::INFINITY,
        ..DEFAULT
    },
];

/// Friction for the measured velocity in every mode.
pub fn measured(configuration: &mut Configuration) {
    configuration.compensation.velocity_source = VelocitySource::Measured;
}

impl Variant {
    /// A joint with this compensation and `model`, switched on, at rest and `warmth` (K) above the ambient temperature.
    ///
    /// # Errors
    /// Refusals of plant or firmware.
    pub fn enabled(
        &self,
        parameters: &ActuatorParameters,
        setup: &Setup,
        model: Option<FrictionModel>,
        warmth: f64,
        seed: u64,
    ) -> Result<VirtualJoint, VirtualJointError> {
        let mut setup = *setup;
        (self.configure)(&mut setup);
        let mut joint = enabled(parameters, &setup, warmth, seed)?;
        joint.set_friction(model);
        let mut active = joint.active().clone();
        (self.prepare)(&mut active);
        joint.set_active(active);
        Ok(joint)
    }
}
