//! What the codes of a board's converters mean: phase currents and the supply; control step.

use crate::motor::phases::Phases;

/// Scales of a board's amplifiers and dividers, in what one code of a converter with 12 bits stands for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Analog {
    /// A, positive into the motor; negative where codes fall with such a current.
    pub amperes_per_code: f32,
    /// Code of a phase without current.
    pub current_zero: f32,
    /// V of the supply.
    pub volts_per_code: f32,
}

impl Analog {
    /// Phase currents, A, from the codes of the phases a, b and c.
    #[inline(always)]
    pub fn currents(&self, [a, b, c]: [u16; 3]) -> Phases {
        let current = |code: u16| (f32::from(code) - self.current_zero) * self.amperes_per_code;
        Phases { a: current(a), b: current(b), c: current(c) }
    }

    /// Voltage of the supply, V.
    #[inline(always)]
    pub fn supply(&self, code: u16) -> f32 {
        f32::from(code) * self.volts_per_code
    }
}
