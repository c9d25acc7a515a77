//! Thermistors on a resistive divider; a task below the control interrupt, because of the logarithm.
//!
//! Beta equation: 1/T = 1/298.15 K + ln(R/R25)/B. Error of the arithmetic below 0.01 K from -30 to 150 °C; that of the
//! parts is larger by far. micromath's logarithm was tried first: 5.8 K.

/// 0 °C in kelvin.
const ICE: f32 = 273.15;
/// Readings closer to a rail than this are a wire that is open or shorted.
const RAIL: f32 = 0.005;

/// An NTC from the reference voltage to the converter's pin, and a resistor from there to ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thermistor {
    /// Resistance at 25 °C, Ohm.
    pub nominal: f32,
    /// Beta, K.
    pub beta: f32,
    /// Resistor to ground, Ohm.
    pub divider: f32,
}

impl Thermistor {
    /// Temperature in °C from the reading as a fraction of the reference voltage; NaN where the wire is open or
    /// shorted.
    pub fn temperature(&self, fraction: f32) -> f32 {
        if !(RAIL..=1.0 - RAIL).contains(&fraction) {
            return f32::NAN;
        }
        let resistance = self.divider * (1.0 - fraction) / fraction;
        1.0 / (1.0 / (ICE + 25.0) + logarithm(resistance / self.nominal) / self.beta) - ICE
    }
}

/// Natural logarithm of a positive, normal number: exponent, then the series of artanh over sqrt(1/2) to sqrt(2).
fn logarithm(x: f32) -> f32 {
    let bits = x.to_bits() as i32;
    let exponent = (bits - core::f32::consts::FRAC_1_SQRT_2.to_bits() as i32) >> 23;
    let mantissa = f32::from_bits((bits - (exponent << 23)) as u32);
    let t = (mantissa - 1.0) / (mantissa + 1.0);
    let square = t * t;
    let series = 1.0 + square * (1.0 / 3.0 + square * (1.0 / 5.0 + square * (1.0 / 7.0 + square / 9.0)));
    exponent as f32 * core::f32::consts::LN_2 + 2.0 * t * series
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The bridge's NTC of the first board.
    const NTC: Thermistor = Thermistor { nominal: 10_000.0, beta: 3425.0, divider: 4_700.0 };

    #[test]
    fn the_nominal_resistance_is_25_degrees() {
        let fraction = NTC.divider / (NTC.divider + NTC.nominal);
        assert!((NTC.temperature(fraction) - 25.0).abs() < 0.01);
    }

    #[test]
    fn over_the_whole_range_the_error_is_below_a_hundredth_of_a_kelvin() {
        let mut worst = 0f64;
        for tenth in -300..1500 {
            let celsius = f64::from(tenth) / 10.0;
            let ratio = (f64::from(NTC.beta) * (1.0 / (celsius + 273.15) - 1.0 / 298.15)).exp();
            let resistance = f64::from(NTC.nominal) * ratio;
            let fraction = f64::from(NTC.divider) / (f64::from(NTC.divider) + resistance);
            worst = worst.max((f64::from(NTC.temperature(fraction as f32)) - celsius).abs());
        }
        println!("largest error {worst} K");
        assert!(worst < 0.01, "{worst} K");
    }

    #[test]
    fn the_logarithm_is_exact_to_the_rounding_of_single_precision() {
        let mut worst = 0f64;
        for step in -20_000..=20_000 {
            let x = (f64::from(step) / 2_000.0).exp() as f32;
            let exact = f64::from(x).ln();
            worst = worst.max((f64::from(logarithm(x)) - exact).abs() / exact.abs().max(1.0));
        }
        assert!(worst < 2e-7, "{worst}");
    }

    #[test]
    fn an_open_and_a_shorted_wire_are_no_temperature() {
        for fraction in [0.0, 0.004, 0.996, 1.0, -1.0, 2.0, f32::NAN] {
            assert!(NTC.temperature(fraction).is_nan(), "{fraction}");
        }
    }
}
