//! Parts between motor, supply and pins, and what they make of currents, voltages and temperatures; pure functions of
//! the schematics.

/// Resistance of a divider's lower part over both.
pub fn divided(volts: f64, upper: f64, lower: f64) -> f64 {
    volts * lower / (upper + lower)
}

/// Resistance of two resistors side by side, Ohm.
pub fn parallel(one: f64, other: f64) -> f64 {
    1.0 / (1.0 / one + 1.0 / other)
}

/// Voltage of a node that resistors pull to several voltages (Millman's theorem); (V, Ohm) each.
pub fn node(branches: &[(f64, f64)]) -> f64 {
    let conductance: f64 = branches.iter().map(|(_, resistance)| 1.0 / resistance).sum();
    branches.iter().map(|(volts, resistance)| volts / resistance).sum::<f64>() / conductance
}

/// A thermistor with a negative temperature coefficient, by its data sheet's beta.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ntc {
    /// Resistance at 25 °C, Ohm.
    pub nominal: f64,
    /// Beta, K.
    pub beta: f64,
}

impl Ntc {
    /// Resistance at a temperature, °C; without end where there is none.
    pub fn resistance(&self, temperature: f64) -> f64 {
        if temperature.is_nan() {
            return f64::INFINITY;
        }
        self.nominal * (self.beta * (1.0 / (temperature + 273.15) - 1.0 / 298.15)).exp()
    }

    /// Resistance of the node between it and a resistor to ground, Ohm.
    pub fn source(&self, temperature: f64, lower: f64) -> f64 {
        parallel(self.resistance(temperature), lower)
    }

    /// Voltage behind it, with a resistor from there to ground.
    pub fn voltage(&self, temperature: f64, supply: f64, lower: f64) -> f64 {
        supply * lower / (self.resistance(temperature) + lower)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_node_without_a_shunt_s_voltage_is_the_divider_of_its_resistors() {
        let divider = divided(3.3, 22_000.0, parallel(1_500.0, 2_200.0));
        assert!((node(&[(3.3, 22_000.0), (0.0, 1_500.0), (0.0, 2_200.0)]) - divider).abs() < 1e-12);
    }

    #[test]
    fn a_thermistor_has_its_nominal_resistance_at_25_degrees_and_a_missing_one_reads_as_ground() {
        let ntc = Ntc { nominal: 10_000.0, beta: 3_425.0 };
        assert!((ntc.resistance(25.0) - 10_000.0).abs() < 1e-9);
        assert!(ntc.resistance(60.0) < 4_000.0);
        assert_eq!(ntc.voltage(f64::NAN, 3.3, 4_700.0), 0.0);
    }
}
