//! Bridge, motor and joint behind the pins: the plant, moved on as the chip's PWM counter turns.
//!
//! The plant averages over a PWM period, from one top of the counter to the next. What each high side is on for in it comes from the compare
//! values in force on the way down and on the way up. The converters sample just before the top; what is sampled there is the
//! state at the end of the period, so the period ends a little early then, with the rest of it as the counter will go. While no PWM
//! runs the plant moves in periods of its own.

use crate::chip::time::Instant;
use crate::chip::wiring::{Gate, Pwm};
use plant::actuator::{Actuator, ActuatorParameters, DriveSample};

/// Period while no PWM runs, ps.
const IDLE: u64 = 50_000_000;
/// Before the top by less than this part of the way up, the period is over for whoever samples.
const EARLY: f64 = 0.03;
/// Shortest period that the plant is given, ps; what is less goes with the next one.
const SHORTEST: u64 = 1_000_000;

/// The plant, and how far it has moved.
#[derive(Clone, Debug)]
pub struct Drivetrain {
    actuator: Actuator,
    /// Up to here the actuator has moved.
    moved: Instant,
    /// What the sensors show of that.
    sample: DriveSample,
    pwm: Option<(Instant, Pwm)>,
    /// Time for which each high side was on since `moved`, ps.
    on: [f64; 3],
    /// The bridge follows its inputs.
    enabled: bool,
    /// What the actuator has been given, s; none before it was given any.
    dead_time: Option<f64>,
    /// It switched since `moved`, if only for a part of it.
    switched: bool,
    /// When it last ceased to switch.
    off_since: Option<Instant>,
    /// Torque on the link from outside, Nm.
    pub external_torque: f64,
}

impl Drivetrain {
    /// An actuator at rest, with the bridge off. Delays, steps of duty and resolutions of the plant's own sensors and timer are taken
    /// away, because chip and board have theirs.
    ///
    /// # Errors
    /// What the plant refuses.
    pub fn new(mut parameters: ActuatorParameters, temperature: f64, seed: u64) -> Result<Self, plant::ParameterError> {
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
            moved: Instant(0),
            sample,
            pwm: None,
            on: [0.0; 3],
            enabled: false,
            dead_time: None,
            switched: false,
            off_since: None,
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

    /// Whether the bridge switches: the timer drives the gates of all legs, and they reach the transistors.
    pub fn is_switching(&self) -> bool {
        self.enabled && self.pwm.is_some_and(|(_, pwm)| pwm.running && is_switching(&pwm))
    }

    /// When the bridge last ceased to switch; none where it does, or never did.
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

    /// Whether the bridge follows its inputs from now on: an enable line, a gate driver.
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
        self.change(at, |drivetrain| drivetrain.pwm = Some((at, *pwm)));
        if pwm.running && pwm.count >= pwm.top {
            self.period(at);
        }
    }

    /// What the sensors show at an instant.
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

/// Whether the timer drives the gates of all legs.
fn is_switching(pwm: &Pwm) -> bool {
    pwm.legs.iter().all(|leg| matches!(leg.high, Gate::Switching { .. }))
}
