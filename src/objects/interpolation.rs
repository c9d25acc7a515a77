//! Set-points of cyclic synchronous position and velocity between two that came (60C2h); the receive interrupt.
//!
//! It runs with every frame, and each millisecond besides: so fine are the steps. The control step knows nothing of it.
//! The first target of a mode counts at once, as all do where no period is set: there is nothing yet to interpolate
//! from.

use super::field::ProfileParameter;
use super::shared::Shared;
use crate::joint::{Command, Mode};

/// A target of one of these modes, rad or rad/s.
pub(super) type Target = (Mode, f32);

/// The way from one target to the next.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Interpolation {
    /// Mode, and the target that came last, rad or rad/s; none where the joint follows none.
    target: Option<Target>,
    /// Set-point in force when it came.
    from: f32,
    /// Time at which it came, µs.
    begun: u32,
}

/// 60C2h, µs; 0: none.
fn period(shared: &Shared) -> u32 {
    let micro = match shared.parameter(ProfileParameter::InterpolationExponent) as i8 {
        0 => 1_000_000,
        -1 => 100_000,
        -2 => 10_000,
        -3 => 1_000,
        -4 => 100,
        -5 => 10,
        _ => 1,
    };
    shared.parameter(ProfileParameter::InterpolationTime).saturating_mul(micro)
}

impl Interpolation {
    /// A target came into force, or none of these modes. Times in µs, wrapping.
    pub(super) fn follow(&mut self, next: Option<Target>, now: u32, shared: &Shared) {
        match (self.target, next) {
            // One that is repeated does not begin anew.
            (Some(before), Some(next)) if before == next => return,
            (Some((mode, last)), Some((same, _))) if mode == same => {
                (self.from, self.begun) = (self.between(last, now, period(shared)), now);
            }
            (_, Some((_, value))) => (self.from, self.begun) = (value, now),
            (_, None) => {}
        }
        self.target = next;
    }

    /// Ends what is over: of a target that stays for longer than the time takes to wrap nothing begins anew.
    pub(super) fn settle(&mut self, now: u32, shared: &Shared) {
        if let Some((_, last)) = self.target
            && now.wrapping_sub(self.begun) >= period(shared)
        {
            self.from = last;
        }
    }

    /// Makes a command the one of this instant.
    pub(super) fn apply(&self, command: &mut Command, now: u32, shared: &Shared) {
        let Some((mode, last)) = self.target.filter(|(mode, _)| *mode == command.mode) else { return };
        let value = if mode == Mode::Position { &mut command.position } else { &mut command.velocity };
        *value = self.between(last, now, period(shared));
    }

    fn between(&self, last: f32, now: u32, period: u32) -> f32 {
        let elapsed = now.wrapping_sub(self.begun);
        if elapsed >= period { last } else { self.from + (last - self.from) * (elapsed as f32 / period as f32) }
    }
}
