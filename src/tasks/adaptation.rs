//! Adaptation of the joint's friction, between the task of the bus, which knows the configuration, and the control
//! step, which uses the factors.

use crate::board::control;
use core::cell::Cell;
use critical_section::Mutex;
use joint_firmware::joint::adaptation::{ADAPTS, Adaptation, Factors, Report, Settings};
use joint_firmware::joint::{Active, Telemetry};

/// Settings that were prepared last, and the number of friction models before.
static SETTINGS: Mutex<Cell<(Settings, u32)>> = Mutex::new(Cell::new((Settings::OFF, 0)));

/// Puts what is prepared into effect for adaptation from now on; with a model that nothing has been learned for, or
/// with the one before.
pub fn prepared(active: &Active, new_model: bool) {
    if ADAPTS {
        let settings = Settings::of(active);
        critical_section::with(|section| {
            let place = SETTINGS.borrow(section);
            place.set((settings, place.get().1.wrapping_add(new_model.into())));
        });
    }
}

/// The estimate; no byte of it where a program has no room for it.
pub struct Adapting {
    estimate: [Adaptation; ADAPTS as usize],
    model: u32,
    in_service: Factors,
}

impl Adapting {
    /// Initial state: nothing learned.
    pub const NOTHING: Self =
        Self { estimate: [Adaptation::NOTHING; ADAPTS as usize], model: 0, in_service: Factors::IMAGE };

    /// Every millisecond: learns from a control step, and has the next ones use what was learned.
    pub fn look(&mut self, telemetry: &Telemetry) -> Report {
        let Some(estimate) = self.estimate.first_mut() else { return Report::default() };
        let (settings, model) = critical_section::with(|section| SETTINGS.borrow(section).get());
        if self.model != model {
            (self.model, *estimate) = (model, Adaptation::NOTHING);
        }
        self.in_service = estimate.look(&settings, telemetry);
        control::set_factors(&self.in_service.guarded(&settings, telemetry));
        estimate.report(&settings)
    }

    /// Corrections in service.
    pub fn in_service(&self) -> Factors {
        self.in_service
    }
}
