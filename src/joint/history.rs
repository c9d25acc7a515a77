//! The last steps before a fault, kept for whoever asks what happened; control step writes, task reads.

use super::fault::Faults;
use super::state_machine::State;
use crate::motor::transform::Dq;

/// Steps that are kept.
pub const LENGTH: usize = 64;

/// One control step as the history keeps it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Snapshot {
    /// State after the step.
    pub state: State,
    /// Faults present in the step.
    pub faults: Faults,
    /// Position, rad, and velocity, rad/s, of the joint.
    pub position: f32,
    /// rad/s.
    pub velocity: f32,
    /// Torque before compensation, Nm.
    pub commanded_torque: f32,
    /// Torque that compensation added, Nm.
    pub compensation_torque: f32,
    /// Measured current, A.
    pub current: Dq,
    /// Supply, V.
    pub bus_voltage: f32,
}

/// A ring of the last [`LENGTH`] steps that stands still from a fault on, until it is released.
#[derive(Clone, Copy, Debug)]
pub struct History {
    ring: [Snapshot; LENGTH],
    /// Where the next step goes.
    next: usize,
    frozen: bool,
}

impl Default for History {
    fn default() -> Self {
        // A constant: made step by step, the ring would lie on the stack of whoever makes a joint.
        const EMPTY: History = History { ring: [Snapshot::NONE; LENGTH], next: 0, frozen: false };
        EMPTY
    }
}

impl Snapshot {
    /// Before the first step.
    const NONE: Self = Self {
        state: State::NotReadyToSwitchOn,
        faults: Faults::NONE,
        position: 0.0,
        velocity: 0.0,
        commanded_torque: 0.0,
        compensation_torque: 0.0,
        current: Dq { d: 0.0, q: 0.0 },
        bus_voltage: 0.0,
    };
}

impl History {
    /// Notes a step. The first one with a fault is the last that is noted.
    #[inline(always)]
    pub fn note(&mut self, snapshot: Snapshot) {
        if self.frozen {
            return;
        }
        self.frozen = !snapshot.faults.is_empty();
        if let Some(place) = self.ring.get_mut(self.next) {
            *place = snapshot;
        }
        self.next = (self.next + 1) % LENGTH;
    }

    /// Goes on noting: the fault has been acknowledged.
    pub fn release(&mut self) {
        self.frozen = false;
    }

    /// Whether a fault stopped it.
    pub const fn is_frozen(&self) -> bool {
        self.frozen
    }

    /// The steps, oldest first; the last one is the newest, or the one with the fault.
    pub fn iter(&self) -> impl Iterator<Item = &Snapshot> {
        let (newer, older) = self.ring.split_at_checked(self.next).unwrap_or((&self.ring, &[]));
        older.iter().chain(newer)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::joint::fault::Fault;

    #[test]
    fn the_step_with_the_fault_is_the_last_and_stays_until_released() {
        let mut history = History::default();
        let mut faults = Faults::NONE;
        faults.set(Fault::OverSpeed, true);
        for n in 0..100 {
            let faults = if n >= 70 { faults } else { Faults::NONE };
            history.note(Snapshot { position: n as f32, faults, ..Snapshot::default() });
        }
        let positions: Vec<f32> = history.iter().map(|snapshot| snapshot.position).collect();
        assert_eq!(positions, (7..=70).map(|n| n as f32).collect::<Vec<_>>());
        history.release();
        history.note(Snapshot { position: -1.0, ..Snapshot::default() });
        assert_eq!(history.iter().last().unwrap().position, -1.0);
    }
}
