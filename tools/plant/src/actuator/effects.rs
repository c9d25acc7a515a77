//! Every effect of the actuator by name, so that each can be switched off on its own.

use super::parameters::ActuatorParameters;
use serde::{Deserialize, Serialize};

/// One thing that makes the actuator differ from an ideal one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Effect {
    /// Breakaway torque above the Coulomb torque.
    Stribeck,
    /// Viscous friction.
    ViscousFriction,
    /// Different friction forward and backward; without, both are as forward.
    Asymmetry,
    /// Friction that falls with temperature.
    FrictionTemperature,
    /// Friction that grows with the torque that the gear transmits.
    GearLoss,
    /// Friction that varies over position.
    FrictionRipple,
    /// The payload and its gravity.
    Payload,
    /// Winding resistance that rises with temperature.
    ResistanceRise,
    /// L_q different from L_d; without, both are L_d.
    Saliency,
    /// Cogging torque.
    Cogging,
    /// Dead time.
    DeadTime,
    /// Duties in whole steps of the timer.
    DutyQuantisation,
    /// Duties that act a period late.
    DutyDelay,
    /// A bus that gives way: without, the source takes current back and has hardly any resistance.
    BusImpedance,
    /// Offsets of the current sensors.
    CurrentOffset,
    /// Gain errors of the current sensors.
    CurrentGain,
    /// Noise of the current sensors.
    CurrentNoise,
    /// Currents in whole counts.
    CurrentQuantisation,
    /// Late currents.
    CurrentDelay,
    /// Encoder noise.
    EncoderNoise,
    /// Encoder angles in whole counts; without, the finest encoder.
    EncoderQuantisation,
    /// Encoder error once per turn.
    EncoderEccentricity,
    /// Late encoder angles.
    EncoderDelay,
    /// Gain error, noise and counts of the bus voltage.
    BusSensorError,
    /// Slow thermistors in whole counts.
    ThermistorError,
}

impl Effect {
    /// All effects.
    pub const ALL: [Self; 25] = [
        Self::Stribeck,
        Self::ViscousFriction,
        Self::Asymmetry,
        Self::FrictionTemperature,
        Self::GearLoss,
        Self::FrictionRipple,
        Self::Payload,
        Self::ResistanceRise,
        Self::Saliency,
        Self::Cogging,
        Self::DeadTime,
        Self::DutyQuantisation,
        Self::DutyDelay,
        Self::BusImpedance,
        Self::CurrentOffset,
        Self::CurrentGain,
        Self::CurrentNoise,
        Self::CurrentQuantisation,
        Self::CurrentDelay,
        Self::EncoderNoise,
        Self::EncoderQuantisation,
        Self::EncoderEccentricity,
        Self::EncoderDelay,
        Self::BusSensorError,
        Self::ThermistorError,
    ];
}

impl ActuatorParameters {
    /// The same actuator without `effect`; everything else stays as it is.
    #[must_use]
    pub fn without(mut self, effect: Effect) -> Self {
        let friction = &mut self.joint.friction;
        let currents = &mut self.sensors.currents;
        let encoder = &mut self.sensors.encoder;
        match effect {
            Effect::Stribeck => friction.breakaway = friction.coulomb,
            Effect::ViscousFriction => (friction.viscous.forward, friction.viscous.backward) = (0.0, 0.0),
            Effect::Asymmetry => {
                friction.coulomb.backward = friction.coulomb.forward;
                friction.breakaway.backward = friction.breakaway.forward;
                friction.viscous.backward = friction.viscous.forward;
            }
            Effect::FrictionTemperature => (friction.viscous_thinning, friction.coulomb_thinning) = (0.0, 0.0),
            Effect::GearLoss => friction.gear_loss = 0.0,
            Effect::FrictionRipple => friction.ripple.iter_mut().for_each(|ripple| ripple.amplitude = 0.0),
            Effect::Payload => self.joint.load.mass = 0.0,
            Effect::ResistanceRise => self.windings.resistance_rise = 0.0,
            Effect::Saliency => self.windings.inductance_q = self.windings.inductance_d,
            Effect::Cogging => self.windings.cogging.amplitude = 0.0,
            Effect::DeadTime => self.inverter.dead_time = 0.0,
            Effect::DutyQuantisation => self.inverter.duty_steps = 0,
            Effect::DutyDelay => self.inverter.duty_delay = 0,
            Effect::BusImpedance => (self.bus.source_resistance, self.bus.takes_back) = (1e-4, true),
            Effect::CurrentOffset => currents.offset = [0.0; 3],
            Effect::CurrentGain => currents.gain_error = [0.0; 3],
            Effect::CurrentNoise => currents.noise = 0.0,
            Effect::CurrentQuantisation => currents.resolution = 0.0,
            Effect::CurrentDelay => currents.delay = 0,
            Effect::EncoderNoise => encoder.noise = 0.0,
            Effect::EncoderQuantisation => encoder.counts_per_turn = 1 << 26,
            Effect::EncoderEccentricity => encoder.eccentricity = 0.0,
            Effect::EncoderDelay => encoder.delay = 0,
            Effect::BusSensorError => {
                let bus = &mut self.sensors.bus;
                (bus.gain_error, bus.noise, bus.resolution) = (0.0, 0.0, 0.0);
            }
            Effect::ThermistorError => {
                for thermistor in [&mut self.sensors.winding, &mut self.sensors.bridge] {
                    (thermistor.lag, thermistor.resolution) = (0.0, 0.0);
                }
            }
        }
        self
    }

    /// The same actuator without any effect: Coulomb friction on its bristles, a constant motor, a stiff bus, perfect
    /// sensors. A base on which one effect at a time is added.
    #[must_use]
    pub fn ideal(self) -> Self {
        Effect::ALL.into_iter().fold(self, Self::without)
    }

    /// The ideal actuator with nothing but `effect`, as strong as it is here.
    #[must_use]
    pub fn with_only(self, effect: Effect) -> Self {
        Effect::ALL.into_iter().filter(|other| *other != effect).fold(self, Self::without)
    }
}
