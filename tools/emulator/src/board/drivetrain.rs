//! Bridge, motor and joint behind the pins: the plant, moved on as the chip's PWM counter turns.
//!
//! The plant averages over a PWM period, from one top of the counter to the next. What each high side is on for in it
//! comes from the compare values in force on the way down and on the way up. The converters sample just before the top;
//! what is sampled there is the state at the end of the period, so the period ends a little early then, with the rest
//! of it as the counter will go. While no PWM runs the plant moves in periods of its own.
//!
//! A shunt carries its phase's current while the leg's low side conducts; the amplifiers follow that
//! ([`Drivetrain::phase_current`]).

use super::amplifier::Amplifier;
use super::encoder::Encoder;
use crate::chip::time::Instant;
use crate::chip::wiring::{Gate, Pwm};
use plant::actuator::{Actuator, ActuatorParameters, DriveSample};

/// Period while no PWM runs, ps.
const IDLE: u64 = 50_000_000;
/// Part of the way up, before the top, in which the period is over for whoever samples.
const EARLY: f64 = 0.05;
/// Shortest period that the plant is given, ps; what is less goes with the next one.
const SHORTEST: u64 = 1_000_000;

/// Settling of an amplifier to its phase's current by the time when a sample of it was held.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settling {
    /// Time for which the low side had conducted, s.
    conducting: f64,
    amplifier: Amplifier,
}

impl Settling {
    /// Part of the current that the output showed so long (s) before the sample was held, 0 to 1.
    pub fn followed(&self, before: f64) -> f64 {
        self.amplifier.followed(self.conducting - before)
    }
}

/// The plant, and how far it has moved.
#[derive(Clone, Debug)]
pub struct Drivetrain {
    actuator: Actuator,
    encoder: Encoder,
    /// Instant up to which the actuator has moved.
    moved: Instant,
    /// Sample that the sensors show of that.
    sample: DriveSample,
    pwm: Option<(Instant, Pwm)>,
    /// Instant since which the timer has asked for each low side; none where it asks for the high side.
    low_since: [Option<Instant>; 3],
    /// The sample whose low side had conducted for the shortest time while the bridge switched.
    least_settled: Option<Settling>,
    /// Time for which each high side was on since `moved`, ps.
    on: [f64; 3],
    /// The bridge follows its inputs.
    enabled: bool,
    /// Dead time that the actuator has been given, s; none before it was given any.
    dead_time: Option<f64>,
    /// `true` if it switched since `moved`, if only for a part of it.
    switched: bool,
    /// Instant at which it last ceased to switch.
    off_since: Option<Instant>,
    /// Outputs of the holding brake and of the brake chopper.
    outputs: (bool, bool),
    /// Torque on the link from outside, Nm.
    pub external_torque: f64,
}

impl Drivetrain {
    /// An actuator at rest, with the bridge off. Delays, steps of duty and resolutions of the plant's own sensors and
    /// timer are taken away, because chip and board have theirs. The encoder's geometry is for the board: what a
    /// [`sample`](Self::sample) shows of it is the rotor's own angle.
    ///
    /// # Errors
    /// Refusals of the plant.
    pub fn new(mut parameters: ActuatorParameters, temperature: f64, seed: u64) -> Result<Self, plant::ParameterError> {
        parameters.validate()?;
        let encoder = Encoder::take(&mut parameters);
        parameters.inverter.duty_delay = 0;
        parameters.inverter.duty_steps = 0;
        parameters.sensors.currents.delay = 0;
        parameters.sensors.currents.resolution = 0.0;
        parameters.sensors.bus.resolution = 0.0;
        parameters.sensors.encoder.delay = 0;
        parameters.sensors.winding.resolution = 0.0;
        parameters.sensors.bridge.resolution = 0.0;
        let mut actuator = Actuator::new(parameters, temperature, seed)?;
        let sample = actuator.measure();
        Ok(Self {
            actuator,
            encoder,
            moved: Instant(0),
            sample,
            pwm: None,
            low_since: [Some(Instant(0)); 3],
            least_settled: None,
            on: [0.0; 3],
            enabled: false,
            dead_time: None,
            switched: false,
            off_since: None,
            outputs: (false, false),
            external_torque: 0.0,
        })
    }

    /// The actuator: faults, load, state.
    pub const fn actuator(&self) -> &Actuator {
        &self.actuator
    }

    /// The actuator, to change.
    pub const fn actuator_mut(&mut self) -> &mut Actuator {
        &mut self.actuator
    }

    /// The output of the holding brake, with a pull-down: whether it is to open.
    pub fn set_brake(&mut self, open: bool) {
        self.outputs.0 = open;
        self.actuator.set_outputs(self.outputs.0, self.outputs.1);
    }

    /// The output of the brake chopper, with a pull-down: whether it conducts.
    pub fn set_chopper(&mut self, conducts: bool) {
        self.outputs.1 = conducts;
        self.actuator.set_outputs(self.outputs.0, self.outputs.1);
    }

    /// Both outputs.
    pub const fn outputs(&self) -> (bool, bool) {
        self.outputs
    }

    /// Encoder of the actuator as its parameters describe it.
    pub const fn encoder(&self) -> Encoder {
        self.encoder
    }

    /// Returns `true` if the bridge switches: the timer drives the gates of all legs, and they reach the transistors.
    pub fn is_switching(&self) -> bool {
        self.enabled && self.pwm.is_some_and(|(_, pwm)| pwm.running && is_switching(&pwm))
    }

    /// Instant at which the bridge last ceased to switch; none where it does, or never did.
    pub fn off_since(&self) -> Option<Instant> {
        self.off_since.filter(|_| !self.is_switching())
    }

    fn change(&mut self, at: Instant, change: impl FnOnce(&mut Self)) {
        self.pass(at);
        let before = self.is_switching();
        change(self);
        if before && !self.is_switching() {
            self.off_since = Some(at);
        }
    }

    /// Sets whether the bridge follows its inputs from now on: an enable line, a gate driver.
    pub fn enable(&mut self, at: Instant, enabled: bool) {
        self.change(at, |drivetrain| drivetrain.enabled = enabled);
    }

    /// Both switches of a leg are off for so long at each edge from now on, s; the plant takes 5 us at most.
    pub fn set_dead_time(&mut self, seconds: f64) {
        let seconds = seconds.clamp(0.0, 5e-6);
        if self.dead_time != Some(seconds) && self.actuator.set_dead_time(seconds).is_ok() {
            self.dead_time = Some(seconds);
        }
    }

    /// The timer's outputs from now on.
    pub fn pwm(&mut self, at: Instant, pwm: &Pwm) {
        self.change(at, |drivetrain| {
            drivetrain.pwm = Some((at, *pwm));
            drivetrain.follow_low_sides(at, at);
        });
        if pwm.running && pwm.count >= pwm.top {
            self.period(at);
        }
    }

    /// Sample that the sensors show at an instant.
    pub fn sample(&mut self, at: Instant) -> &DriveSample {
        match self.pwm {
            Some((since, pwm)) if pwm.running => {
                let top = since.0.saturating_add(ticks(&pwm, f64::from(pwm.top - pwm.count.min(pwm.top))) as u64);
                let way = ticks(&pwm, f64::from(pwm.top));
                if pwm.up && top >= at.0 && (top - at.0) as f64 <= EARLY * way && top > self.moved.0 {
                    self.pass(Instant(top));
                    self.period(Instant(top));
                }
            }
            _ => self.pass(at),
        }
        &self.sample
    }

    /// Current that an amplifier at a phase's low-side shunt shows at an instant, A. Where the bridge does not switch,
    /// that is whatever current there is.
    pub fn phase_current(&mut self, at: Instant, phase: usize, amplifier: &Amplifier) -> f64 {
        let current = self.sample(at).phase_currents[phase];
        if !self.is_switching() {
            return current;
        }
        let settling = Settling { conducting: self.conducting(at, phase), amplifier: *amplifier };
        if self.least_settled.is_none_or(|least| settling.conducting < least.conducting) {
            self.least_settled = Some(settling);
        }
        current * settling.followed(0.0)
    }

    /// Time for which a phase's low side has conducted, s; 0 where it does not, or both switches of the leg are off.
    pub fn conducting(&self, at: Instant, phase: usize) -> f64 {
        let Some(since) = self.low_since[phase] else { return 0.0 };
        let is_high = self.pwm.is_some_and(|(from, pwm)| {
            let passed = at.0.saturating_sub(from.0) as f64 / ticks(&pwm, 1.0);
            let count = f64::from(pwm.count);
            let count = if pwm.up { count + passed } else { count - passed };
            pwm.running && is_active(&pwm, phase, count)
        });
        let low = at.0.saturating_sub(since.0) as f64 * 1e-12;
        if is_high { 0.0 } else { (low - self.dead_time.unwrap_or(0.0)).max(0.0) }
    }

    /// The sample, while the bridge switched since the last call, whose low side had conducted for the shortest time;
    /// none where it did not switch.
    pub fn take_least_settled(&mut self) -> Option<Settling> {
        self.least_settled.take()
    }

    /// Follows the low sides that the timer asks for at an instant, to which it has counted; where one was asked for
    /// since `from`, from when on.
    fn follow_low_sides(&mut self, from: Instant, until: Instant) {
        let Some((_, pwm)) = self.pwm else { return };
        for phase in 0..self.low_since.len() {
            let low = !is_active(&pwm, phase, f64::from(pwm.count));
            let beyond = f64::from(pwm.count.abs_diff(pwm.legs[phase].compare));
            let began = Instant(until.0.saturating_sub(ticks(&pwm, beyond) as u64).max(from.0));
            self.low_since[phase] = low.then(|| self.low_since[phase].unwrap_or(began));
        }
    }

    /// Switches that are on between the last instant and this one.
    fn pass(&mut self, until: Instant) {
        let Some((since, pwm)) = self.pwm.filter(|(_, pwm)| pwm.running) else {
            // Whole periods of rest.
            while until.0 >= self.moved.0.saturating_add(IDLE) {
                self.advance(IDLE);
            }
            return;
        };
        if until <= since {
            return;
        }
        let passed = (until.0 - since.0) as f64 / ticks(&pwm, 1.0);
        let (begin, top) = (f64::from(pwm.count), f64::from(pwm.top));
        let (low, high, count) = match pwm.up {
            true => (begin, (begin + passed).min(top), (begin + passed).min(top)),
            false => ((begin - passed).max(0.0), begin, (begin - passed).max(0.0)),
        };
        let switching = self.enabled && is_switching(&pwm);
        self.switched |= switching;
        for (on, leg) in self.on.iter_mut().zip(&pwm.legs) {
            let below = (f64::from(leg.compare).clamp(low, high) - low).max(0.0);
            let active = if leg.active_below { below } else { high - low - below };
            *on += ticks(&pwm, active);
        }
        let turned = Pwm { count: count.round() as u32, ..pwm };
        self.pwm = Some((until, turned));
        self.follow_low_sides(since, until);
    }

    /// The actuator moves on up to an instant, at which the counter is at its top.
    fn period(&mut self, at: Instant) {
        let length = at.0.saturating_sub(self.moved.0);
        if length >= SHORTEST {
            self.advance(length);
        }
    }

    fn advance(&mut self, length: u64) {
        // The plant takes periods of a millisecond at most.
        let parts = length.div_ceil(IDLE);
        let seconds = length as f64 * 1e-12 / parts as f64;
        let duties = self.on.map(|on| on / length as f64);
        for _ in 0..parts {
            self.actuator.advance(self.switched, duties, self.external_torque, seconds);
        }
        self.moved.0 += length;
        self.sample = self.actuator.measure();
        (self.on, self.switched) = ([0.0; 3], false);
    }
}

/// Counts of the timer in ps.
fn ticks(pwm: &Pwm, counts: f64) -> f64 {
    counts * pwm.tick as f64 * CYCLE
}

/// A cycle of the core while PWM runs, ps: both boards' programs run it at 170 MHz.
pub(super) const CYCLE: f64 = 1e12 / 170e6;

/// Returns `true` if a leg's reference is active at a count: the high side is asked for.
fn is_active(pwm: &Pwm, phase: usize, count: f64) -> bool {
    let leg = &pwm.legs[phase];
    (count < f64::from(leg.compare)) == leg.active_below
}

/// Returns `true` if the timer drives the gates of all legs.
fn is_switching(pwm: &Pwm) -> bool {
    pwm.legs.iter().all(|leg| matches!(leg.high, Gate::Switching { .. }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chip::wiring::{Leg, TimerName};
    use plant::ActuatorParameters;

    const TOP: u32 = 2_125;
    const DEAD_TIME: f64 = 200e-9;

    /// Three periods of a counter to 2,125 at 170 MHz with these compare values; the drivetrain at the last top.
    fn at_the_top(compares: [u32; 3]) -> (Drivetrain, Instant) {
        let mut drivetrain = Drivetrain::new(ActuatorParameters::reference().aligned(), 25.0, 1).unwrap();
        drivetrain.enable(Instant(0), true);
        drivetrain.set_dead_time(DEAD_TIME);
        let legs = compares.map(|compare| Leg {
            compare,
            active_below: true,
            high: Gate::Switching { inverted: false },
            low: Gate::Released,
        });
        let timer = TimerName::Tim2;
        let mut at = 0.0;
        for turn in 0..6 {
            let up = turn % 2 == 0;
            let count = if up { 0 } else { TOP };
            let pwm = Pwm { timer, running: true, count, up, top: TOP, tick: 1, dead_time: 0, legs };
            drivetrain.pwm(Instant(at as u64), &pwm);
            at += f64::from(TOP) * CYCLE;
        }
        (drivetrain, Instant((at - f64::from(TOP) * CYCLE) as u64))
    }

    #[test]
    fn a_low_side_conducts_from_its_dead_time_after_the_compare_value_up_to_the_compare_value() {
        let (drivetrain, top) = at_the_top([0, 1_000, 1_870]);
        let counts = |counts: f64| counts * CYCLE * 1e-12;
        let conducting = |after: f64, phase| drivetrain.conducting(Instant(top.0 + (after * CYCLE) as u64), phase);
        assert!(conducting(0.0, 0) > counts(4_000.0), "duty 0: for ever");
        assert!((conducting(0.0, 1) - (counts(1_125.0) - DEAD_TIME)).abs() < 1e-11);
        assert!((conducting(60.0, 2) - (counts(255.0 + 60.0) - DEAD_TIME)).abs() < 1e-11);
        assert!(conducting(254.0, 2) > 0.0 && conducting(256.0, 2) == 0.0);
    }

    /// The currents are sampled from 13 cycles after the trigger, a count before the top, for 12.5 clocks of four
    /// cycles.
    #[test]
    fn at_the_duties_that_were_permitted_once_the_amplifiers_had_not_settled_and_at_those_of_now_they_have() {
        let [_, _, moteus, _] = super::super::moteus_r4::STEP_RESPONSE;
        let esc1 = super::super::b_g431b_esc1::STEP_RESPONSE;
        for (amplifier, rate, dead_time, then, now) in [
            (moteus, 40e3, 200e-9, 0.9, 0.8635),
            (moteus, 40e3, 50e-9, 0.9, 0.8755),
            (esc1, 20e3, 800e-9, 0.95, 0.8958),
        ] {
            let followed = |duty: f64| {
                let begun = (1.0 - duty) / 2.0 / rate + (13.0 - 1.0) / 170e6;
                amplifier.followed(begun - dead_time)
            };
            assert!(followed(now) > 0.99, "{} at {now}", followed(now));
            assert!(followed(then) < 0.98, "{} at {then}", followed(then));
        }
    }

    #[test]
    fn a_leg_that_has_just_switched_shows_too_little_and_a_bridge_that_is_off_everything() {
        let amplifier = Amplifier::settling(500e-9, 1_000e-9);
        let (mut drivetrain, top) = at_the_top([0, 1_000, 1_870]);
        let held = Instant(top.0 + (60.0 * CYCLE) as u64);
        let sampled = drivetrain.sample(held).phase_currents;
        assert_eq!(drivetrain.phase_current(held, 0, &amplifier), sampled[0]);
        assert_eq!(drivetrain.take_least_settled().unwrap().followed(0.0), 1.0);
        let expected = amplifier.followed((255.0 + 60.0) * CYCLE * 1e-12 - DEAD_TIME);
        let shown = drivetrain.phase_current(held, 2, &amplifier);
        assert!((shown / sampled[2] - expected).abs() < 1e-4 && (0.9..0.999).contains(&expected), "{expected}");
        assert_eq!(drivetrain.phase_current(held, 0, &amplifier), sampled[0]);
        let least = drivetrain.take_least_settled().unwrap();
        assert!((least.followed(0.0) - expected).abs() < 1e-4);
        let before = amplifier.followed((255.0 + 60.0 - 50.0) * CYCLE * 1e-12 - DEAD_TIME);
        assert!((least.followed(50.0 * CYCLE * 1e-12) - before).abs() < 1e-4 && before < expected - 0.01);
        drivetrain.enable(held, false);
        assert_eq!(drivetrain.phase_current(held, 2, &amplifier), sampled[2]);
        assert_eq!(drivetrain.take_least_settled(), None);
    }
}
