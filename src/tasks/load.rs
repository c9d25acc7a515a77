//! Feedforward of the load and external torque, between the task of the bus, which knows the configuration, and the
//! receive interrupt, which makes the control step's commands.

use crate::board::can;
use core::cell::Cell;
use critical_section::Mutex;
use joint_firmware::joint::adaptation::Factors;
use joint_firmware::joint::configuration::LOADS;
use joint_firmware::joint::external_torque::{self, ExternalTorque, Report};
use joint_firmware::joint::load::LoadGains;
use joint_firmware::joint::load_feedforward::LoadFeedforward;
use joint_firmware::joint::{Active, Telemetry};

/// Gains and settings that were prepared last.
static PREPARED: Mutex<Cell<(LoadGains, external_torque::Settings)>> =
    Mutex::new(Cell::new((LoadGains::NONE, external_torque::Settings::NONE)));

/// Puts what is prepared into effect from now on.
pub fn prepared(active: &Active) {
    if LOADS {
        let settings = external_torque::Settings::of(active);
        critical_section::with(|section| PREPARED.borrow(section).set((*active.load(), settings)));
    }
}

/// Feedforward and observer; no byte of them where a program has no room.
pub struct Bearing {
    parts: [(LoadFeedforward, ExternalTorque); LOADS as usize],
}

impl Bearing {
    /// State before the first look.
    pub const NOTHING: Self = Self { parts: [(LoadFeedforward::NOTHING, ExternalTorque::NOTHING); LOADS as usize] };

    /// Every millisecond: from a control step to what the next commands carry; `factors` of the image's friction act.
    pub fn look(&mut self, telemetry: &Telemetry, factors: &Factors) -> [Report; LOADS as usize] {
        self.parts.each_mut().map(|(feedforward, external)| {
            let (gains, settings) = critical_section::with(|section| PREPARED.borrow(section).get());
            can::bear(feedforward.look(&gains, telemetry));
            let before = external.report().collisions;
            let report = external.look(&settings, telemetry, factors);
            if report.collisions != before {
                can::collide(report.reaction);
            }
            report
        })
    }
}
