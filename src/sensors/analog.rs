//! Meaning of the codes of a board's converters: phase currents and the supply; control step.

use crate::motor::phases::Phases;

/// Highest code of a converter.
const HIGHEST_CODE: f32 = 4_095.0;

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

    /// Lowest and highest phase current, A, that tell of one: half a code inside of the converter's ends.
    pub const fn current_range(&self) -> (f32, f32) {
        let first = (0.5 - self.current_zero) * self.amperes_per_code;
        let last = (HIGHEST_CODE - 0.5 - self.current_zero) * self.amperes_per_code;
        if first < last { (first, last) } else { (last, first) }
    }

    /// Highest supply, V, that tells of one: half a code below the converter's end.
    pub const fn supply_end(&self) -> f32 {
        (HIGHEST_CODE - 0.5) * self.volts_per_code
    }

    /// Voltage of the supply, V.
    #[inline(always)]
    pub fn supply(&self, code: u16) -> f32 {
        f32::from(code) * self.volts_per_code
    }
}
