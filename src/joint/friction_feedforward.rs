//! Friction compensation in the joint: which state the model sees, what holds it back near standstill, and the energy
//! guard; control step.
//!
//! Two things keep compensation from moving a joint by itself. Where the command has a velocity, friction is computed
//! for that velocity: a pure feedforward, which no error of the model can turn into an instability, and zero while
//! nothing is asked for. A model with pre-sliding has friction at a velocity of zero, too, where motion turns back:
//! there the feedforward fades over [`RELEASE`] instead of at once. Where there is none (torque mode), friction is
//! computed for the measured velocity, and that is a positive feedback. It is held by the fade near standstill and by
//! the guard: while the joint speeds up although its command does not push it that way, the compensation backs off
//! within milliseconds, and it comes back only while the command pushes (docs/energy-guard.md).
//!
//! The guard takes no more than what is uncertain. Let friction be at least `1 - u` of gain times the model at every
//! velocity, with the uncertainty `u` of the configuration. Then the rest, `1 - u` of the compensation, never gives
//! more power than friction takes at the same instant: joint and compensation together are passive, and no hand, spring
//! or gravity that leads them is answered by motion of their own. The guard decides about the part `u` alone, where
//! friction may or may not be there. With `u` = 1 it decides about all, and so it does near standstill, where the delay
//! of the sensors lets compensation act after the joint has turned back: until the mean velocity is five times the
//! standstill velocity, and in part until it is ten times.

use super::active::{Active, AdaptationGains, CompensationGains, JointMotion};
use super::adaptation::{ADAPTS, Factors};
use super::configuration::VelocitySource;
use super::motion_law::Wanted;
use crate::motor::number::{greater, lesser, limited, magnitude, or_zero, within};
use friction_compensation::compensation::{Acting, Compensation, Output, Reason};
use friction_compensation::friction::FrictionModel;
use friction_compensation::friction::state::JointState;
use friction_compensation::quantity::{Acceleration, Position, Temperature, Torque, Velocity};

/// Time over which the reference's acceleration is taken, s: several commands of a bus at 1 kHz.
const DERIVATIVE: f32 = 0.004;
/// Time in which compensation fades at rest where pre-sliding has friction there, s.
pub const RELEASE: f32 = 1.0;
/// Growth of the speed against its mean, as a fraction, from which the joint counts as speeding up.
const GROWTH: f32 = 0.01;

/// Compensation until the next round.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Compensated {
    /// Torque to add, Nm.
    pub torque: f32,
    /// Output of the model, with the reason for it.
    pub output: Output,
    /// Part that standstill and guard let through, 0 to 1.
    pub permitted: f32,
}

impl Compensated {
    /// No compensation.
    pub const NOTHING: Self = Self { torque: 0.0, output: Output::NOTHING, permitted: 0.0 };
}

impl Default for Compensated {
    fn default() -> Self {
        Self::NOTHING
    }
}

/// Variables that friction depends on besides this joint's motion and torque.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surroundings {
    /// Temperature of the gear, °C.
    pub temperature: f32,
    /// Velocity of the joint that shares the drive, rad/s.
    pub coupled_velocity: f32,
}

/// Compensation, from one round of the motion loop to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrictionFeedforward {
    compensation: Compensation,
    /// Share of the uncertain part that the guard has taken away, 0 to 1.
    withheld: f32,
    /// Slow mean of the speed, rad/s.
    speed: f32,
    /// Slow mean of the velocity, rad/s.
    drift: f32,
    /// Part that the fade at standstill let through in the round before, 0 to 1.
    moving: f32,
    /// Torque that adaptation adds to the image's, Nm.
    adapted: f32,
    /// Reference velocity, rad/s, as a first-order lag follows it; what it lacks is its acceleration.
    reference: Option<f32>,
}

/// The command's velocity, where friction is computed for that, rad/s.
#[inline(always)]
fn reference(active: &Active, wanted: &Wanted) -> Option<f32> {
    match active.compensation.source {
        VelocitySource::Reference => wanted.velocity,
        VelocitySource::Measured => None,
    }
}

/// Conversion to Q16.16; held at the ends of the range, zero for what is not a number.
fn q16(value: f32) -> i32 {
    (value * 65536.0) as i32
}

impl FrictionFeedforward {
    /// Forgets the past.
    #[inline(never)]
    pub fn reset(&mut self) {
        self.compensation.reset();
        (self.withheld, self.speed, self.drift, self.moving) = (0.0, 0.0, 0.0, 0.0);
        (self.adapted, self.reference) = (0.0, None);
    }

    /// First stage of a round: the state that friction is computed for, and its regime. `measured_torque` is the torque
    /// of the measured current, Nm.
    #[inline(always)]
    pub fn begin(
        &mut self,
        active: &Active,
        motion: &JointMotion,
        wanted: &Wanted,
        measured_torque: f32,
        surroundings: &Surroundings,
    ) {
        let gains = &active.compensation;
        let reference = reference(active, wanted);
        let velocity = reference.unwrap_or(motion.velocity);
        let acceleration = self.acceleration(gains.period, reference, motion);
        let state = JointState {
            position: Position::from_bits(q16(motion.position)),
            velocity: Velocity::from_bits(q16(velocity)),
            acceleration: Acceleration::from_bits(q16(acceleration)),
            theoretical_torque: Torque::from_bits(q16(wanted.torque)),
            measured_torque: Torque::from_bits(q16(measured_torque)),
            temperature: Temperature::from_bits(q16(surroundings.temperature)),
            coupled_velocity: Velocity::from_bits(q16(surroundings.coupled_velocity)),
        };
        self.compensation.begin(active.friction.as_ref(), &gains.settings, &state);
    }

    /// Second stage: friction by the network; and what adaptation adds, by the torque of the round before, because this
    /// step has room for it.
    #[inline(always)]
    pub fn network(
        &mut self,
        active: &Active,
        motion: &JointMotion,
        wanted: &Wanted,
        last: &Output,
        factors: &Factors,
    ) {
        if ADAPTS {
            let velocity = reference(active, wanted).unwrap_or(motion.velocity);
            self.adapt(&active.adaptation, velocity, last, factors);
        }
        self.compensation.network(active.friction.as_ref());
    }

    /// Third stage: friction by the physical model.
    #[inline(always)]
    pub fn physical_model(&mut self, active: &Active) {
        self.compensation.physical_model(active.friction.as_ref());
    }

    /// Last stage: the torque to add until the next round's.
    #[inline(always)]
    pub fn compensate(&mut self, active: &Active, motion: &JointMotion, wanted: &Wanted) -> Compensated {
        let gains = &active.compensation;
        let output = self.compensation.finish(active.friction.as_ref(), &gains.settings);
        let reference = reference(active, wanted);
        let velocity = reference.unwrap_or(motion.velocity);
        let mut standstill = within(magnitude(velocity) * gains.inverse_standstill, 0.0, 1.0);
        let guarded = match reference {
            Some(_) => {
                if active.friction.as_ref().is_some_and(FrictionModel::pre_slides) {
                    standstill = greater(standstill, self.moving - gains.period * (1.0 / RELEASE));
                }
                self.moving = standstill;
                1.0
            }
            None => self.guard(gains, velocity, wanted),
        };
        let permitted = or_zero(standstill * guarded);
        // If nothing is added, not even the sign of a zero changes.
        let image = output.torque.to_bits() as f32 * (1.0 / 65536.0);
        let torque = match ADAPTS {
            true => (image + self.adapted) * permitted,
            false => image * permitted,
        };
        Compensated { torque, output, permitted }
    }

    /// Computes the torque that adaptation adds to the image's: within clamp and slew limit, and nothing of its own
    /// where the image fades.
    #[inline(always)]
    fn adapt(&mut self, gains: &AdaptationGains, velocity: f32, output: &Output, factors: &Factors) {
        let image = output.torque.to_bits() as f32 * (1.0 / 65536.0);
        let whole =
            matches!(output.reason, Reason::AsRequested | Reason::NoNetwork) && output.acting != Acting::Nothing;
        let viscous = if whole { factors.viscous * velocity } else { 0.0 };
        // Exactly the image's where nothing was learned: it lies within the clamp.
        let wanted = limited(image * factors.factor + viscous, gains.clamp);
        self.adapted += limited(wanted - image - self.adapted, gains.slew);
    }

    /// Acceleration for the model, rad/s²: the reference's, where there is one. The measured one is mostly noise, and a
    /// sign of noise switches the friction of a hysteresis back and forth.
    fn acceleration(&mut self, period: f32, reference: Option<f32>, motion: &JointMotion) -> f32 {
        let Some(velocity) = reference else {
            self.reference = None;
            return motion.acceleration;
        };
        let lagging = self.reference.unwrap_or(velocity);
        let acceleration = (velocity - lagging) * (1.0 / DERIVATIVE);
        self.reference = Some(or_zero(lagging + acceleration * period));
        acceleration
    }

    /// Part of the compensation that the energy guard lets through, 0 to 1. The command pushes towards the velocity
    /// that it asks for, or in torque mode by its torque without the offset. A spring's torque does not count:
    /// around a held position it pushes back and forth, and too much compensation makes it hunt. Nor does what
    /// holds gravity: it works on every way up, also where the joint swings by itself.
    #[inline(never)]
    fn guard(&mut self, gains: &CompensationGains, velocity: f32, wanted: &Wanted) -> f32 {
        let speed = magnitude(velocity);
        let growing = speed > (1.0 + GROWTH) * self.speed && speed > gains.standstill;
        self.speed += gains.guard.mean * (or_zero(speed) - self.speed);
        self.drift = or_zero(self.drift + gains.guard.drift * (velocity - self.drift));
        let moves = lesser(greater(magnitude(self.drift) * gains.guard.moves - 1.0, 0.0), 1.0);
        // In torque mode the push may be a spring's, on which the joint hunts: it counts where the joint moves.
        let moves_or_asked = moves > 0.0 || wanted.velocity.is_some();
        let pushed = wanted.velocity.unwrap_or(wanted.push) * velocity > 0.0;
        if growing && !pushed {
            self.withheld = lesser(self.withheld + gains.guard.back_off, 1.0);
        } else if pushed && moves_or_asked {
            self.withheld = greater(self.withheld - gains.guard.recovery, 0.0);
        } else if !moves_or_asked {
            self.withheld = lesser(self.withheld + gains.guard.recovery, 1.0);
        }
        1.0 - self.withheld * (1.0 - gains.certain * moves)
    }

    /// Share of the uncertain part that the guard withholds, 0 to 1.
    pub fn withheld(&self) -> f32 {
        self.withheld
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::joint::configuration::AdaptationRequest;
    use friction_compensation::compensation::Request;
    use friction_compensation::friction::common::CommonTerms;
    use friction_compensation::friction::domain::{Domain, Range};
    use friction_compensation::friction::maxwell_slip::MaxwellElement;
    use friction_compensation::friction::physical::{Coefficients, PhysicalParameters, Terms};
    use friction_compensation::friction::regime::Selector;
    use friction_compensation::friction::state::SIGNALS;
    use friction_compensation::friction::{FrictionModel, FrictionParameters, ParameterSet};

    /// Below it compensation fades, rad/s.
    const STANDSTILL: f32 = 0.1;
    /// Offset of the models that have one, Nm.
    const OFFSET: f32 = 0.25;

    /// A joint with friction of a constant (Nm) and a viscous part (Nm s/rad).
    fn active(source: VelocitySource, constant: f32, viscous: f32) -> Active {
        active_with(source, constant, viscous, CommonTerms::NONE)
    }

    /// The same with common terms.
    fn active_with(source: VelocitySource, constant: f32, viscous: f32, common: CommonTerms) -> Active {
        let mut board = crate::default_configuration::B_G431B_ESC1;
        let joint = &mut board.joint;
        (joint.limits.torque, joint.limits.damping) = (2.0, 2.0);
        let compensation = &mut joint.compensation;
        (compensation.request, compensation.adaptation) = (Request::Physical, AdaptationRequest::On);
        (compensation.gain, compensation.clamp, compensation.slew) = (1.0, 2.0, 32e3);
        (compensation.velocity_source, compensation.standstill_velocity) = (source, STANDSTILL);
        compensation.uncertainty = 1.0;
        let range = Range { low: q16(-100.0), high: q16(100.0) };
        let domain = Domain { ranges: [range; SIGNALS], margin: 1 << 13, reference_temperature: q16(25.0) };
        // Full scale of a signal in such a range is 128.
        let coefficients =
            Coefficients { constant: q16(constant), viscous: q16(128.0 * viscous), ..Coefficients::default() };
        let physical = PhysicalParameters { terms: Terms::CONSTANT.union(Terms::VISCOUS), coefficients };
        let mut sets = [ParameterSet::default(); 4];
        sets[0].physical = physical;
        let friction = FrictionParameters { domain, selector: Selector::default(), common, sets };
        let model = FrictionModel::new(&friction, board.bridge.motion_rate());
        joint.prepare(&board.bridge).unwrap().with_friction(Some(model))
    }

    /// A round at a velocity, rad/s, with a command's torque, Nm, and velocity, rad/s.
    fn round(
        feedforward: &mut FrictionFeedforward,
        active: &Active,
        velocity: f32,
        torque: f32,
        reference: Option<f32>,
    ) -> Compensated {
        adapted_round(feedforward, active, velocity, torque, reference, &Factors::IMAGE)
    }

    /// The same with what was learned.
    fn adapted_round(
        feedforward: &mut FrictionFeedforward,
        active: &Active,
        velocity: f32,
        torque: f32,
        reference: Option<f32>,
        factors: &Factors,
    ) -> Compensated {
        let motion = JointMotion { velocity, ..JointMotion::default() };
        let wanted = Wanted { torque, velocity: reference, push: torque };
        let surroundings = Surroundings { temperature: 25.0, coupled_velocity: 0.0 };
        let stages = |feedforward: &mut FrictionFeedforward, last: &Output| {
            feedforward.begin(active, &motion, &wanted, 0.0, &surroundings);
            feedforward.network(active, &motion, &wanted, last, factors);
            feedforward.physical_model(active);
            feedforward.compensate(active, &motion, &wanted)
        };
        // Last output as if the round before had been like this one.
        let last = stages(&mut feedforward.clone(), &Output::NOTHING).output;
        stages(feedforward, &last)
    }

    /// A joint that has moved at a velocity, rad/s, for 0.5 s, with a command that pushes it.
    fn pushed(active: &Active, velocity: f32) -> FrictionFeedforward {
        let mut feedforward = FrictionFeedforward::default();
        (0..2_000).for_each(|_| _ = round(&mut feedforward, active, velocity, velocity, None));
        assert_eq!(feedforward.withheld(), 0.0);
        feedforward
    }

    #[test]
    fn a_model_with_an_offset_pushes_no_joint_at_rest_and_a_slow_one_in_proportion() {
        for (source, reference) in [
            (VelocitySource::Reference, true),
            (VelocitySource::Reference, false),
            (VelocitySource::Measured, true),
            (VelocitySource::Measured, false),
        ] {
            let active = active(source, OFFSET, 0.0);
            // In torque mode a round so near to standstill is the first in which the guard takes something.
            let left = if reference { 1.0 } else { 1.0 - active.compensation.guard.recovery };
            for (part, expected) in [(0.0, 0.0), (0.25, 0.25), (0.5, 0.5), (0.999, 0.999), (1.0, 1.0), (1.001, 1.0)] {
                for velocity in [part * STANDSTILL, -part * STANDSTILL] {
                    let mut feedforward = FrictionFeedforward::default();
                    let expected = left * expected;
                    let found = round(&mut feedforward, &active, velocity, velocity, reference.then_some(velocity));
                    let whole = found.output.torque.to_bits() as f32 / 65536.0;
                    assert!((whole - OFFSET).abs() < 1e-4, "{whole} Nm");
                    assert!((found.permitted - expected).abs() < 1e-6, "{source:?} {velocity}: {}", found.permitted);
                    assert!((found.torque - expected * OFFSET).abs() < 1e-4, "{source:?} {velocity}: {}", found.torque);
                }
            }
        }
    }

    #[test]
    fn a_reference_at_rest_adds_nothing_however_the_joint_moves() {
        let active = active(VelocitySource::Reference, OFFSET, 0.0);
        let mut feedforward = FrictionFeedforward::default();
        for velocity in [-5.0, 0.0, 0.5 * STANDSTILL, 5.0] {
            assert_eq!(round(&mut feedforward, &active, velocity, 0.0, Some(0.0)).torque, 0.0, "{velocity} rad/s");
        }
    }

    #[test]
    fn pre_sliding_friction_is_compensated_where_motion_turns_back_and_is_gone_after_a_second_of_rest() {
        let mut common = CommonTerms::NONE;
        common.elements[0] = MaxwellElement { stiffness: q16(100.0), level: q16(OFFSET) };
        let active = active_with(VelocitySource::Reference, 0.0, 0.0, common);
        let period = active.compensation.period;
        let mut feedforward = FrictionFeedforward::default();
        let mut turn = |velocity: f32, time: f32| {
            let rounds = (time / period).round() as usize;
            (0..rounds).map(|_| round(&mut feedforward, &active, velocity, 0.0, Some(velocity)).torque).last().unwrap()
        };
        let near = |torque: f32, want: f32| assert!((torque - want).abs() < 2e-3, "{torque} Nm, {want} Nm");
        near(turn(STANDSTILL, 0.5), OFFSET);
        near(turn(0.0, 0.25 * RELEASE), 0.75 * OFFSET);
        // The element is bent back over twice its 10 mrad.
        near(turn(-STANDSTILL, 0.1), 0.0);
        near(turn(-STANDSTILL, 0.1), -OFFSET);
        near(turn(0.0, 0.99 * RELEASE), -0.01 * OFFSET);
        assert_eq!(turn(0.0, 0.02 * RELEASE), 0.0);
    }

    #[test]
    fn the_guard_answers_to_a_speed_that_grows_by_a_factor_of_e_in_less_than_a_second() {
        let active = active(VelocitySource::Measured, 0.0, 0.01);
        let period = active.compensation.period;
        for direction in [1.0, -1.0] {
            // Growth of the speed, 1/s; behind its mean over 10 ms it is 1 % ahead where that is 1.
            for (growth, command, withholds) in
                [(0.97, 0.0, false), (1.03, 0.0, true), (1.03, -direction, true), (1.03, direction, false)]
            {
                let mut feedforward = pushed(&active, direction);
                for n in 0..2_000 {
                    let velocity = direction * (growth * period * n as f32).exp();
                    round(&mut feedforward, &active, velocity, command, None);
                }
                assert_eq!(feedforward.withheld() > 0.0, withholds, "{growth}/s, command {command}");
            }
        }
    }

    #[test]
    fn the_guard_takes_compensation_away_in_5_ms_and_gives_it_back_in_100() {
        let active = active(VelocitySource::Measured, 0.0, 0.01);
        let period = active.compensation.period;
        let mut feedforward = pushed(&active, 1.0);
        let mut velocity = 2.0;
        let away = (1..1_000).find(|_| {
            velocity *= 1.01;
            round(&mut feedforward, &active, velocity, 0.0, None).permitted == 0.0
        });
        let back = (1..1_000).find(|_| round(&mut feedforward, &active, velocity, 1.0, None).permitted == 1.0);
        for (rounds, time) in [(away.unwrap(), 0.005), (back.unwrap(), 0.1)] {
            assert!((rounds as f32 * period / time - 1.0).abs() < 0.06, "{rounds} rounds for {time} s");
        }
    }

    /// Speed, rad/s, of a joint that was let go at a velocity, with a viscous friction (Nm s/rad) and a model of more
    /// of it, after 3 s.
    fn let_go(active: &Active, friction: f32, mut velocity: f32) -> f32 {
        // Without the guard it would run away with a time constant of 0.3 s: inertia over what the model has too much.
        let inertia = 0.3 * 0.3 * friction;
        let mut feedforward = pushed(active, velocity);
        let period = active.compensation.period;
        for _ in 0..(3.0 / period) as u32 {
            let torque = round(&mut feedforward, active, velocity, 0.0, None).torque;
            velocity += (torque - friction * velocity) / inertia * period;
        }
        velocity
    }

    /// Part of a compensation with the uncertainty that the guard lets through, once a speed has grown to this one (in
    /// standstill velocities) without a push.
    fn left_by_the_guard(uncertainty: f32, speed: f32) -> f32 {
        let mut active = active(VelocitySource::Measured, 0.0, 0.01);
        active.compensation.certain = 1.0 - uncertainty;
        let mut feedforward = pushed(&active, 1.0);
        let mut permitted = f32::NAN;
        for n in 0..2_000u16 {
            let grown = lesser(0.5 + f32::from(n) / 1_000.0, 1.0);
            permitted = round(&mut feedforward, &active, grown * speed * STANDSTILL, 0.0, None).permitted;
        }
        permitted
    }

    #[test]
    fn the_guard_takes_what_is_uncertain_and_no_more_where_the_joint_moves() {
        for uncertainty in [0.0, 0.35, 1.0] {
            assert_eq!(left_by_the_guard(uncertainty, 12.0), 1.0 - uncertainty);
            let between = left_by_the_guard(uncertainty, 7.5);
            assert!((between - 0.5 * (1.0 - uncertainty)).abs() < 1e-3, "{uncertainty}: {between}");
            assert!(left_by_the_guard(uncertainty, 5.1) > 0.0 || uncertainty == 1.0);
            assert_eq!(left_by_the_guard(uncertainty, 4.9), 0.0);
        }
    }

    #[test]
    fn a_push_counts_in_torque_mode_where_the_joint_moves_and_a_velocity_that_is_asked_for_always() {
        let active = active(VelocitySource::Measured, 0.0, 0.01);
        for (part, asked, withheld) in [(4.9, false, 1.0), (5.1, false, 0.0), (4.9, true, 0.0)] {
            let mut feedforward = FrictionFeedforward { withheld: 0.5, ..FrictionFeedforward::default() };
            let velocity = part * STANDSTILL;
            for _ in 0..4_000 {
                round(&mut feedforward, &active, velocity, velocity, asked.then_some(velocity));
            }
            assert_eq!(feedforward.withheld(), withheld, "{part} times the standstill velocity, asked for: {asked}");
        }
    }

    #[test]
    fn where_nothing_was_learned_the_images_torque_has_its_bits() {
        let active = active(VelocitySource::Reference, 0.1, 0.7);
        let mut feedforward = FrictionFeedforward::default();
        for n in -500..500i16 {
            let velocity = 0.01 * f32::from(n);
            let found = round(&mut feedforward, &active, velocity, 0.0, Some(velocity));
            let image = found.output.torque.to_bits() as f32 * (1.0 / 65536.0) * found.permitted;
            assert_eq!(found.torque.to_bits(), image.to_bits(), "{velocity}");
        }
    }

    #[test]
    fn what_was_learned_acts_within_clamp_and_slew_limit_and_fades_with_the_image() {
        let settled = |active: &Active, velocity: f32, factors: Factors| {
            let mut feedforward = FrictionFeedforward::default();
            let mut torque = round(&mut feedforward, active, velocity, 0.0, Some(velocity)).torque;
            for _ in 0..10_000 {
                let now = adapted_round(&mut feedforward, active, velocity, 0.0, Some(velocity), &factors).torque;
                let change = (now - torque).abs();
                assert!(change <= 1.001 * active.adaptation.slew, "{change} Nm in a round");
                torque = now;
            }
            torque
        };
        let mut slow = active(VelocitySource::Reference, 0.0, 0.5);
        slow.adaptation.slew = 1e-3;
        // The image says 0.5 Nm at 1 rad/s; the clamp is 2 Nm.
        for (factor, viscous, expected) in
            [(1.0, 0.0, 0.5), (0.4, 0.0, 0.2), (2.0, 0.0, 1.0), (1.0, -0.2, 0.3), (2.5, 0.7, 1.95), (2.5, 0.8, 2.0)]
        {
            for sign in [1.0, -1.0] {
                let found = settled(&slow, sign, Factors { factor, viscous });
                assert!((found - sign * expected).abs() < 1e-3, "{factor}, {viscous}: {found} Nm for {expected}");
            }
        }
        // Far outside the trained box, 100 rad/s and a margin, nothing acts, whatever was learned.
        assert_eq!(settled(&slow, 150.0, Factors { factor: 2.0, viscous: 1.0 }), 0.0);
    }

    #[test]
    fn what_holds_gravity_is_no_push() {
        for (push, withheld) in [(0.0, true), (-0.1, true), (0.1, false)] {
            let active = active(VelocitySource::Measured, 0.0, 0.01);
            let mut feedforward = pushed(&active, 1.0);
            for n in 0..100u8 {
                let velocity = 1.0 + 0.01 * f32::from(n);
                let motion = JointMotion { velocity, ..JointMotion::default() };
                feedforward.compensate(&active, &motion, &Wanted { torque: 1.0, velocity: None, push });
            }
            assert_eq!(feedforward.withheld() > 0.5, withheld, "push {push}: {}", feedforward.withheld());
        }
    }

    #[test]
    fn what_is_certain_gives_less_than_friction_takes_up_to_the_stated_uncertainty() {
        // A model of half as much again, all of what the guard may take gone: 1.5 (1 - u) of friction comes back.
        for (uncertainty, slows) in [(0.34, true), (0.32, false)] {
            let mut active = active(VelocitySource::Measured, 0.0, 1.5 * 0.05);
            active.compensation.certain = 1.0 - uncertainty;
            let velocity = let_go(&active, 0.05, 4.0);
            assert_eq!(velocity < 4.0, slows, "uncertainty {uncertainty}: {velocity} rad/s");
        }
    }

    #[test]
    fn a_joint_whose_friction_is_30_percent_less_than_its_models_does_not_run_away() {
        let active = active(VelocitySource::Measured, 0.0, 1.3 * 0.05);
        let velocity = let_go(&active, 0.05, 1.0);
        assert!((0.0..0.5).contains(&velocity), "{velocity} rad/s");
    }
}
