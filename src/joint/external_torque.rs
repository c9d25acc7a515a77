//! External torque on the link, its uncertainty, and collisions; task, host.
//!
//! A momentum observer: a thousand times a second a task looks at a control step and computes
//!
//! ```text
//! r = K (J v - integral of (y - f - g + r) dt)
//! ```
//!
//! from the measured velocity `v`, the mean motor torque `y`, friction `f` as compensation's model has it and
//! adaptation corrects it, inertia `J` and gravity `g` of the configured [`Load`]. `r` follows the external torque as a
//! first-order lag of 1 / `K` = [`LAG`] does; no measured acceleration is needed.
//!
//! Source: A. De Luca, R. Mattone, Actuator failure detection and isolation using generalized momenta, ICRA 2003; as
//! estimate of external forces beside a friction model 003, section III-C.
//!
//! The uncertainty bounds the error of `r` where friction model and load differ from the truth by no more than a stated
//! part of it: [`FRICTION`], and the configured uncertainty of the load. It is the sum of
//!
//! - friction in motion: [`WRONG`] of it;
//! - friction near standstill, and where the joint moves against its reference: the truth is anything between both
//!   breakaways, whatever the model says for the reference. It fades with [`MEMORY`] once both move the same way,
//!   beyond twice the standstill velocity;
//! - the load's part of inertia times acceleration, which follows from the observer's own torques, and of gravity;
//! - noise, of a coarse encoder above all: [`NOISE`] times the mean change of `r` from look to look, over
//!   [`NOISE_TIME`];
//! - [`FLOOR`] of the torque limit: currents, cogging, ripple.
//!
//! The torque limit is the bound, and nothing is a collision, where nothing knows the friction (no model acts, its
//! trained range is left, the clamp holds it back) or no inertia is configured.
//!
//! A collision is an external torque beyond uncertainty and configured threshold together, in [`LOOKS`] looks one
//! behind the other; another one is counted after [`QUIET`] without.

use super::Telemetry;
use super::active::Active;
use super::adaptation::{Factors, image_torque};
use super::configuration::{CollisionReaction, VelocitySource};
use super::load::Load;
use super::load_feedforward::LOOK_RATE;
use super::state_machine::State;
use crate::motor::number::{greater, lesser, limited, magnitude, or_zero, within};
use friction_compensation::compensation::{Acting, Reason};

/// Time constant with which the estimate follows, s.
pub const LAG: f32 = 0.01;
/// Part of the true friction by which the model may be wrong.
pub const FRICTION: f32 = 0.3;
/// The same as a part of the model: a model that is 30 % too small lacks 43 % of itself.
pub const WRONG: f32 = FRICTION / (1.0 - FRICTION);
/// Part of the torque limit that may be wrong besides.
pub const FLOOR: f32 = 0.01;
/// Bound of the noise over the mean change of the estimate from look to look.
pub const NOISE: f32 = 2.0;
/// Time over which that mean is taken, s: a collision, which changes the estimate once, hardly counts.
pub const NOISE_TIME: f32 = 0.5;
/// Time in which the uncertainty of a standstill fades, s.
pub const MEMORY: f32 = 0.05;
/// Looks in which the torque has to be too large.
pub const LOOKS: u8 = 3;
/// Time after which the same contact is another one, s.
pub const QUIET: f32 = 0.2;

const PERIOD: f32 = 1.0 / LOOK_RATE;
/// Part of the clamp from which compensation is held back by it: its steps are of 2^-16 Nm.
const CLAMPED: f32 = 0.999;

/// The observer's parameters, of a joint as it is prepared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Inertia and gravity.
    pub load: Load,
    /// Part of the configured load that may be lacking or too much, as [`WRONG`].
    pub load_wrong: f32,
    /// Gain of the compensation.
    pub gain: f32,
    /// Its clamp, Nm.
    pub clamp: f32,
    /// Friction is computed for the reference velocity, where there is one.
    pub for_reference: bool,
    /// Dry friction of the model, Nm.
    pub dry: f32,
    /// rad/s.
    pub standstill: f32,
    /// Nm.
    pub torque_limit: f32,
    /// Part of a collision's torque beyond the uncertainty, Nm.
    pub threshold: f32,
    /// Reaction to a collision.
    pub reaction: CollisionReaction,
}

/// External torque at one instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Report {
    /// Nm; positive pushes the link forward.
    pub torque: f32,
    /// Bound of its error, Nm.
    pub uncertainty: f32,
    /// Collisions since the start; wraps.
    pub collisions: u16,
    /// Torque of the last one when it was found, Nm.
    pub collided: f32,
    /// Reaction to one.
    pub reaction: CollisionReaction,
}

impl Report {
    /// Report before the first look.
    pub const NOTHING: Self =
        Self { torque: 0.0, uncertainty: 0.0, collisions: 0, collided: 0.0, reaction: CollisionReaction::Off };
}

/// The observer, from one look to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExternalTorque {
    /// Momentum that the known torques and the estimate have given, Nm s; none while operation is not enabled.
    given: Option<f32>,
    /// Known torque as the estimate's lag follows it, Nm.
    known: f32,
    report: Report,
    /// Mean change of the estimate from look to look, Nm.
    noise: f32,
    /// Nearness to a standstill, 0 to 1.
    near: f32,
    /// Looks in which the torque has been too large.
    above: u8,
    /// Looks for which a collision is still the same.
    quiet: u16,
}

impl Settings {
    /// Settings before anything is prepared.
    pub const NONE: Self = Self {
        load: Load { inertia: 0.0, gravity: 0.0, hanging: 0.0 },
        load_wrong: 0.0,
        gain: 0.0,
        clamp: 0.0,
        for_reference: false,
        dry: 0.0,
        standstill: 1.0,
        torque_limit: 1.0,
        threshold: 0.0,
        reaction: CollisionReaction::Off,
    };

    /// Settings of a joint as it is prepared.
    pub fn of(active: &Active) -> Self {
        let load = active.load();
        Self {
            load: load.load,
            load_wrong: load.load_wrong,
            gain: active.adaptation.gain,
            clamp: active.adaptation.clamp,
            for_reference: active.compensation.source == VelocitySource::Reference,
            dry: active.friction.as_ref().map_or(0.0, |model| model.dry_friction().to_bits() as f32 * (1.0 / 65_536.0)),
            standstill: active.compensation.standstill,
            torque_limit: active.limits.torque,
            threshold: load.collision_threshold,
            reaction: load.collision_reaction,
        }
    }
}

impl ExternalTorque {
    /// Initial state: nothing seen yet.
    pub const NOTHING: Self =
        Self { given: None, known: 0.0, report: Report::NOTHING, noise: 0.0, near: 1.0, above: 0, quiet: 0 };

    /// Findings of the last look.
    pub fn report(&self) -> &Report {
        &self.report
    }

    /// A look at a control step, [`LOOK_RATE`] times a second; `factors` of the image's friction act.
    pub fn look(&mut self, settings: &Settings, telemetry: &Telemetry, factors: &Factors) -> Report {
        self.report.reaction = settings.reaction;
        if telemetry.state != State::OperationEnabled {
            let report = Report { torque: 0.0, uncertainty: settings.torque_limit, ..self.report };
            *self = Self { report, ..Self::NOTHING };
            return report;
        }
        let friction = friction(settings, telemetry, factors);
        let gravity = settings.load.gravity_torque(telemetry.motion.position);
        let velocity = or_zero(telemetry.motion.velocity);
        self.observe(settings, velocity, telemetry.mean_torque - friction.unwrap_or(0.0) - gravity);
        self.follow_standstill(settings, telemetry);
        let known = settings.load.inertia > 0.0;
        self.report.uncertainty = match friction.filter(|_| known) {
            Some(friction) => {
                let friction = self.friction_uncertainty(magnitude(friction), settings.dry * factors.factor);
                let load = settings.load_wrong * (magnitude(self.known + self.report.torque) + magnitude(gravity));
                let besides = NOISE * self.noise + FLOOR * settings.torque_limit;
                lesser(friction + load + besides, settings.torque_limit)
            }
            None => {
                self.near = 1.0;
                settings.torque_limit
            }
        };
        self.watch(settings, known && friction.is_some());
        self.report
    }

    /// One step of the observer with the known torque, Nm.
    fn observe(&mut self, settings: &Settings, velocity: f32, known: f32) {
        let momentum = settings.load.inertia * velocity;
        let known = limited(known, 4.0 * settings.torque_limit);
        let given = self.given.unwrap_or(momentum) + (known + self.report.torque) * PERIOD;
        self.given = Some(or_zero(given));
        let torque = limited((momentum - given) * (1.0 / LAG), 2.0 * settings.torque_limit);
        self.noise += (magnitude(torque - self.report.torque) - self.noise) * (PERIOD / NOISE_TIME);
        self.report.torque = torque;
        // Known torque and estimate together are inertia times acceleration, through the same lag.
        self.known += (known - self.known) * (PERIOD / LAG);
    }

    /// Nearness to a standstill: of the joint, of the velocity that friction is computed for, or of either to the
    /// other's direction.
    fn follow_standstill(&mut self, settings: &Settings, telemetry: &Telemetry) {
        let velocity = telemetry.motion.velocity;
        let computed = telemetry.wanted.velocity.filter(|_| settings.for_reference).unwrap_or(velocity);
        let slowest = if velocity * computed > 0.0 { lesser(magnitude(velocity), magnitude(computed)) } else { 0.0 };
        let near = within(2.0 - slowest / (2.0 * settings.standstill), 0.0, 1.0);
        self.near = greater(near, self.near * (1.0 - PERIOD / MEMORY));
    }

    /// Bound of friction's error, Nm, for the magnitudes of its estimate and of dry friction.
    fn friction_uncertainty(&self, estimate: f32, dry: f32) -> f32 {
        let (moving, standing) = (WRONG * estimate, (1.0 + WRONG) * dry + estimate);
        moving + self.near * greater(standing - moving, 0.0)
    }

    fn watch(&mut self, settings: &Settings, known: bool) {
        let Report { torque, uncertainty, .. } = self.report;
        let exceeds = known && magnitude(torque) > uncertainty + settings.threshold;
        self.above = if exceeds { self.above.saturating_add(1) } else { 0 };
        if self.above < LOOKS {
            self.quiet = self.quiet.saturating_sub(1);
            return;
        }
        if self.quiet == 0 {
            (self.report.collisions, self.report.collided) = (self.report.collisions.wrapping_add(1), torque);
        }
        self.quiet = (QUIET * LOOK_RATE) as u16;
    }
}

/// Friction that compensation knows of, Nm; none where nothing acts that knows it.
fn friction(settings: &Settings, telemetry: &Telemetry, factors: &Factors) -> Option<f32> {
    let output = &telemetry.compensated.output;
    let whole = matches!(output.reason, Reason::AsRequested | Reason::NoNetwork);
    let image = image_torque(telemetry);
    let held_back = magnitude(image) >= CLAMPED * settings.clamp;
    if !whole || held_back || output.acting == Acting::Nothing || settings.gain <= 0.0 {
        return None;
    }
    let velocity = telemetry.wanted.velocity.filter(|_| settings.for_reference);
    let viscous = factors.viscous * velocity.unwrap_or(telemetry.motion.velocity);
    Some(or_zero(factors.factor * image / settings.gain + viscous))
}

#[cfg(test)]
mod tests;
