//! Set-points of cyclic synchronous position and velocity between two that came (60C2h); the receive interrupt.
//!
//! It runs with every frame, and each millisecond besides: so fine are the steps. The control step knows nothing of it.
//! The first target of a mode counts at once, as all do where no period is set: there is nothing yet to interpolate
//! from.

use super::field::ProfileParameter;
use super::shared::Shared;
use crate::joint::{Command, Mode};

/// The way from one target to the next.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Interpolation {
    /// Mode, and the target that came last, rad or rad/s; none where the joint follows none.
    target: Option<(Mode, f32)>,
    /// Set-point in force when it came.
    from: f32,
    /// When it came, µs.
    begun: u32,
}

/// The target of a mode that interpolates.
fn target(command: &mut Command) -> Option<(Mode, &mut f32)> {
    match command.mode {
        Mode::Position => Some((Mode::Position, &mut command.position)),
        Mode::Velocity => Some((Mode::Velocity, &mut command.velocity)),
        _ => None,
    }
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
    /// A command came into force, `cyclic` where its mode is one of those. Times in µs, wrapping.
    pub(super) fn follow(&mut self, mut command: Command, cyclic: bool, now: u32, shared: &Shared) {
        let next = target(&mut command).map(|(mode, value)| (mode, *value)).filter(|_| cyclic);
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

    /// The command at this instant.
    pub(super) fn apply(&self, mut command: Command, now: u32, shared: &Shared) -> Command {
        if let (Some((mode, last)), Some((same, value))) = (self.target, target(&mut command))
            && mode == same
        {
            *value = self.between(last, now, period(shared));
        }
        command
    }

    fn between(&self, last: f32, now: u32, period: u32) -> f32 {
        let elapsed = now.wrapping_sub(self.begun);
        if elapsed >= period { last } else { self.from + (last - self.from) * (elapsed as f32 / period as f32) }
    }
}
