//! Devices at the board's outputs: a holding brake on the rotor and a resistor that a brake chopper connects.
//!
//! The brake is a grip that holds the link where it closed; it closes and opens some time after its output says so.

use crate::contact::Contact;

/// Fitted devices; none by itself.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Accessories {
    /// Times in which the brake opens and closes, s; none: no brake.
    pub brake: Option<(f64, f64)>,
    /// Conductance of the chopper's resistor, 1/ohm; 0: none.
    pub chopper: f64,
}

/// The same in operation.
#[derive(Clone, Copy, Debug, Default)]
pub struct Fitted {
    accessories: Accessories,
    /// Outputs: the brake is to open, the chopper conducts.
    open: bool,
    conducts: bool,
    /// Time since the brake's output changed, s.
    since: f64,
    grip: Option<Contact>,
    /// Energy that the resistor has burnt, J.
    burnt: f64,
}

impl Fitted {
    /// Newly fitted: the brake is closed at a position, rad, of a joint with an inertia, kg m².
    pub fn new(accessories: Accessories, position: f64, inertia: f64) -> Self {
        let grip = accessories.brake.map(|_| Contact::blocking(position, inertia));
        Self { accessories, grip, ..Self::default() }
    }

    /// Sets what the outputs say from now on.
    pub fn set(&mut self, open: bool, conducts: bool) {
        if open != self.open {
            self.since = 0.0;
        }
        (self.open, self.conducts) = (open, conducts);
    }

    /// Conductance across the supply, 1/ohm.
    pub fn conductance(&self) -> f64 {
        if self.conducts { self.accessories.chopper } else { 0.0 }
    }

    /// A period, s, at a supply, V, and where the link is, rad.
    pub fn advance(&mut self, voltage: f64, position: f64, inertia: f64, period: f64) {
        self.burnt += self.conductance() * voltage * voltage * period;
        let Some((opens, closes)) = self.accessories.brake else { return };
        self.since += period;
        if self.open && self.since >= opens {
            self.grip = None;
        } else if !self.open && self.since >= closes && self.grip.is_none() {
            self.grip = Some(Contact::blocking(position, inertia));
        }
    }

    /// Contact that holds the link.
    pub fn grip(&self) -> Option<Contact> {
        self.grip
    }

    /// Heat that the resistor has made, J.
    pub fn burnt(&self) -> f64 {
        self.burnt
    }
}
