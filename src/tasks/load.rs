//! Feedforward of the load, between the task of the bus, which knows the configuration, and the receive interrupt,
//! which makes the control step's commands.

use crate::board::can;
use core::cell::Cell;
use critical_section::Mutex;
use joint_firmware::joint::load_feedforward::{LOADS, LoadFeedforward, LoadGains};
use joint_firmware::joint::{Active, Telemetry};

/// What was prepared last.
static GAINS: Mutex<Cell<LoadGains>> = Mutex::new(Cell::new(LoadGains::NONE));

/// What is prepared counts for the feedforward from now on.
pub fn prepared(active: &Active) {
    if LOADS {
        critical_section::with(|section| GAINS.borrow(section).set(*active.load()));
    }
}

/// The feedforward; no byte of it where a program has no room for it.
pub struct Bearing {
    feedforward: [LoadFeedforward; LOADS as usize],
}

impl Bearing {
    /// Before the first look.
    pub const NOTHING: Self = Self { feedforward: [LoadFeedforward::NOTHING; LOADS as usize] };

    /// Every millisecond: from a control step to what the next commands carry.
    pub fn look(&mut self, telemetry: &Telemetry) {
        let Some(feedforward) = self.feedforward.first_mut() else { return };
        let gains = critical_section::with(|section| GAINS.borrow(section).get());
        can::bear(feedforward.look(&gains, telemetry));
    }
}
