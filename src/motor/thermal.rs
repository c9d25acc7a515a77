//! Temperature of the winding, and the current that it still bears; slow task, 100 Hz or so.
//!
//! Two nodes: copper loss heats the winding, the winding heats the housing (stator iron and shell), the housing heats
//! the surroundings. Makers of small motors state just these four constants: two thermal resistances and two time
//! constants.
//!
//! ```text
//! C_w dT_w/dt = 3/2 R(T_w) (i_d^2 + i_q^2) - (T_w - T_h) / R_wh
//! C_h dT_h/dt = (T_w - T_h) / R_wh - (T_h - T_a) / R_ha
//! R(T)        = R_25 (1 + 0.00393 (T - 25 °C))                      copper
//! ```
//!
//! A sensor on the winding, where the board has one, pulls both nodes up towards it slowly: it corrects what the model
//! has too cold, start and surroundings first of all, and the model gives what the sensor is too slow for. The hotter
//! of the two counts. It never pulls them down: a sensor that sticks while the motor is cold looks just like good
//! cooling, and would take the protection away.

use super::number::{greater, lesser, or_zero, within};
use super::setting::{SettingError, in_range};
use super::transform::Dq;

/// Rise of copper's resistance with temperature, of its value at 25 °C, 1/K: 0.393 %.
pub const COPPER_COEFFICIENT: f32 = 0.003_93;
/// Temperature that resistances refer to, °C.
pub const REFERENCE_TEMPERATURE: f32 = 25.0;
/// A sensor reading outside of these, °C, is an open or shorted one and counts as none.
pub const PLAUSIBLE_SENSOR: (f32, f32) = (-40.0, 200.0);
/// Temperatures of the model are kept within these, °C.
const RANGE: (f32, f32) = (-60.0, 500.0);

/// Mean of the square of the current: what the control step hands to the slow task.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MeanSquareCurrent {
    sum: f32,
    count: u32,
}

impl MeanSquareCurrent {
    /// Adds a control step's current, A. A current that is not a number counts as zero; one beyond 10 kA as 10 kA.
    /// Control step.
    #[inline(always)]
    pub fn add(&mut self, current: Dq) {
        self.sum += lesser(or_zero(current.norm_squared()), 1e8);
        self.count = self.count.saturating_add(1);
    }

    /// The mean since the last time, A^2, and begins anew; 0 where nothing was added. Exact to 0.1 % for up to 10,000
    /// steps.
    pub fn take(&mut self) -> f32 {
        let mean = if self.count > 0 { self.sum / self.count as f32 } else { 0.0 };
        *self = Self::default();
        mean
    }
}

/// The motor's heat paths and limits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThermalSettings {
    /// Resistance of a phase at 25 °C, Ω; 0.001 to 100.
    pub resistance: f32,
    /// Heat capacity of the winding, J/K; 0.1 to 10,000.
    pub winding_capacity: f32,
    /// Heat capacity of stator and housing, J/K; 0.1 to 100,000.
    pub housing_capacity: f32,
    /// Thermal resistance from winding to housing, K/W; 0.01 to 100.
    pub winding_to_housing: f32,
    /// Thermal resistance from housing to surroundings, K/W; 0.01 to 100.
    pub housing_to_ambient: f32,
    /// Temperature of the surroundings, °C; -40 to 85.
    pub ambient: f32,
    /// Time in which the sensor corrects the model, s; 1 to 10,000 and at least ten periods. About three times the
    /// sensor's own time constant: shorter, and the sensor's lag passes for the winding's temperature.
    pub correction_time: f32,
    /// Derating begins here, °C; 30 to 180.
    pub warning: f32,
    /// No current from here on, °C; above the warning by 5 K at least, up to 200.
    pub limit: f32,
    /// Steps a second, Hz; 1 to 1000.
    pub rate: f32,
}

/// A temperature that small steps add up to: what a step loses by rounding is kept for the next (Kahan).
///
/// At 80 °C and 100 Hz plain single precision would lose every step below 4e-6 K, which is 0.1 W into 250 J/K.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Node {
    temperature: f32,
    lost: f32,
}

impl Node {
    const fn at(temperature: f32) -> Self {
        Self { temperature, lost: 0.0 }
    }

    fn add(&mut self, step: f32) {
        let step = step - self.lost;
        let sum = within(self.temperature + step, RANGE.0, RANGE.1);
        self.lost = within((sum - self.temperature) - step, -1.0, 1.0);
        self.temperature = sum;
    }
}

/// The winding's thermal model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WindingTemperature {
    settings: ThermalSettings,
    period: f32,
    winding: Node,
    housing: Node,
    sensor: Option<f32>,
}

impl WindingTemperature {
    /// Checks settings and starts with both nodes at a temperature, °C: the sensor's where there is one; else, as
    /// nobody knows how hot the motor was switched off, the warning's is the safe choice and the surroundings' the
    /// usual one. Refused where a heat path is too fast for the rate.
    pub fn new(settings: &ThermalSettings, start: f32) -> Result<Self, SettingError> {
        let s = settings;
        let rate = in_range!("thermal model's rate", "Hz", s.rate, 1.0, 1000.0)?;
        in_range!("phase resistance", "Ω", s.resistance, 1e-3, 100.0)?;
        in_range!("thermal resistance from winding to housing", "K/W", s.winding_to_housing, 0.01, 100.0)?;
        in_range!("thermal resistance from housing to ambient", "K/W", s.housing_to_ambient, 0.01, 100.0)?;
        // Explicit integration: each node's own time constant is to be ten periods at least.
        let winding = 10.0 / (rate * s.winding_to_housing);
        let housing = 10.0 / rate * (1.0 / s.winding_to_housing + 1.0 / s.housing_to_ambient);
        in_range!("winding's heat capacity", "J/K", s.winding_capacity, greater(winding, 0.1), 10e3)?;
        in_range!("housing's heat capacity", "J/K", s.housing_capacity, greater(housing, 0.1), 100e3)?;
        in_range!("ambient temperature", "°C", s.ambient, -40.0, 85.0)?;
        in_range!("sensor's correction time", "s", s.correction_time, greater(10.0 / rate, 1.0), 10e3)?;
        in_range!("warning temperature", "°C", s.warning, 30.0, 180.0)?;
        in_range!("limit temperature", "°C", s.limit, s.warning + 5.0, 200.0)?;
        let start = in_range!("start temperature", "°C", start, PLAUSIBLE_SENSOR.0, PLAUSIBLE_SENSOR.1)?;
        Ok(Self {
            settings: *settings,
            period: 1.0 / rate,
            winding: Node::at(start),
            housing: Node::at(start),
            sensor: None,
        })
    }

    /// The same model with both nodes at another temperature, °C; at the surroundings' where that is none that a sensor
    /// shows.
    pub fn starting_at(&self, start: f32) -> Self {
        let plausible = start >= PLAUSIBLE_SENSOR.0 && start <= PLAUSIBLE_SENSOR.1;
        let node = Node::at(if plausible { start } else { self.settings.ambient });
        Self { winding: node, housing: node, ..*self }
    }

    /// One step with the mean square of the current's vector since the last one, A^2, and the sensor's reading, °C, or
    /// NaN where there is none. A current that is not a number counts as zero.
    pub fn step(&mut self, mean_square_current: f32, sensor: f32) {
        let s = &self.settings;
        let square = within(or_zero(mean_square_current), 0.0, 1e8);
        let loss = 1.5 * self.resistance() * square;
        let into_housing = (self.winding.temperature - self.housing.temperature) / s.winding_to_housing;
        let into_ambient = (self.housing.temperature - s.ambient) / s.housing_to_ambient;

        let plausible = sensor >= PLAUSIBLE_SENSOR.0 && sensor <= PLAUSIBLE_SENSOR.1;
        self.sensor = plausible.then_some(sensor);
        let correction = match self.sensor {
            Some(sensor) => self.period / s.correction_time * greater(sensor - self.winding.temperature, 0.0),
            None => 0.0,
        };
        self.winding.add(self.period * (loss - into_housing) / s.winding_capacity + correction);
        self.housing.add(self.period * (into_housing - into_ambient) / s.housing_capacity + correction);
    }

    /// The winding's temperature, °C: of model and sensor the hotter.
    pub fn temperature(&self) -> f32 {
        match self.sensor {
            Some(sensor) => greater(sensor, self.winding.temperature),
            None => self.winding.temperature,
        }
    }

    /// The housing's temperature, °C, by the model.
    pub fn housing(&self) -> f32 {
        self.housing.temperature
    }

    /// Resistance of a phase at the winding's temperature by the model, Ω.
    pub fn resistance(&self) -> f32 {
        let rise = COPPER_COEFFICIENT * (self.winding.temperature - REFERENCE_TEMPERATURE);
        self.settings.resistance * greater(1.0 + rise, 0.1)
    }

    /// Part of the highest current that is permitted: 1 up to the warning, falling in a line to 0 at the limit.
    pub fn derating(&self) -> f32 {
        let Self { settings: ThermalSettings { warning, limit, .. }, .. } = self;
        within((limit - self.temperature()) / (limit - warning), 0.0, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const SETTINGS: ThermalSettings = ThermalSettings {
        resistance: 0.12,
        winding_capacity: 20.0,
        housing_capacity: 150.0,
        winding_to_housing: 1.2,
        housing_to_ambient: 2.5,
        ambient: 25.0,
        correction_time: 30.0,
        warning: 90.0,
        limit: 120.0,
        rate: 100.0,
    };

    fn after(seconds: usize, start: f32, square: f32, sensor: f32) -> WindingTemperature {
        let mut model = WindingTemperature::new(&SETTINGS, start).unwrap();
        for _ in 0..seconds * 100 {
            model.step(square, sensor);
        }
        model
    }

    #[test]
    fn the_end_temperature_is_the_loss_times_the_thermal_resistances() {
        // P = 3/2 R25 i^2 (1 + k dT) and dT = P (R_wh + R_ha): dT = p r / (1 - k p r).
        let model = after(4_000, 25.0, 60.0, f32::NAN);
        let cold = 1.5 * 0.12 * 60.0;
        let rise = cold * 3.7 / (1.0 - COPPER_COEFFICIENT * cold * 3.7);
        assert!((model.temperature() - 25.0 - rise).abs() < 0.2, "{} {rise}", model.temperature());
        assert!((model.housing() - 25.0 - rise * 2.5 / 3.7).abs() < 0.2, "{}", model.housing());
        assert!((model.resistance() - 0.12 * (1.0 + COPPER_COEFFICIENT * rise)).abs() < 1e-4);
    }

    #[test]
    fn a_short_overload_heats_the_winding_alone() {
        // 2 s at 40 A: nearly adiabatic, 288 W and rising with the resistance, into 20 J/K, less what the housing
        // takes.
        let model = after(2, 25.0, 1600.0, f32::NAN);
        assert!((25.0..31.0).contains(&(model.temperature() - 25.0)), "{}", model.temperature());
        assert!(model.housing() < 25.4, "{}", model.housing());
    }

    #[test]
    fn steps_smaller_than_the_resolution_still_add_up() {
        // 0.05 W: each step of the housing is a tenth of the resolution at 80 °C.
        let settings = ThermalSettings { ambient: 80.0, housing_capacity: 2000.0, ..SETTINGS };
        let mut model = WindingTemperature::new(&settings, 80.0).unwrap();
        for _ in 0..8_000 * 100 {
            model.step(0.05 / (1.5 * 0.12 * 1.216), f32::NAN);
        }
        let expected = 80.0 + 0.05 * 2.5 * (1.0 - (-8_000.0f32 / 5_000.0).exp());
        assert!((model.housing() - expected).abs() < 0.01, "{} {expected}", model.housing());
    }

    #[test]
    fn a_start_that_no_sensor_shows_is_the_surroundings() {
        let hot = WindingTemperature::new(&SETTINGS, 110.0).unwrap();
        let starts = [40.0, f32::NAN, -300.0].map(|start| hot.starting_at(start).housing());
        assert_eq!(starts, [40.0, SETTINGS.ambient, SETTINGS.ambient]);
        assert_eq!(hot.starting_at(40.0), WindingTemperature::new(&SETTINGS, 40.0).unwrap());
    }

    #[test]
    fn the_sensor_corrects_a_wrong_start_and_the_model_goes_on_without_it() {
        let model = after(300, 25.0, 0.0, 70.0);
        assert!(model.temperature() == 70.0 && model.winding.temperature > 60.0, "{model:?}");
        let wrong = after(300, 25.0, 0.0, f32::NAN);
        assert!((wrong.temperature() - 25.0).abs() < 0.1, "{wrong:?}");
        for broken in [-273.0, 1000.0, f32::INFINITY] {
            assert_eq!(after(10, 25.0, 0.0, broken), after(10, 25.0, 0.0, f32::NAN));
        }
    }

    #[test]
    fn a_sensor_that_sticks_cold_takes_no_protection_away() {
        for seconds in [10, 60, 600] {
            let (stuck, none) = (after(seconds, 25.0, 100.0, 25.0), after(seconds, 25.0, 100.0, f32::NAN));
            assert_eq!((stuck.temperature(), stuck.derating()), (none.temperature(), none.derating()));
        }
    }

    #[test]
    fn a_hot_sensor_counts_at_once() {
        let mut model = WindingTemperature::new(&SETTINGS, 25.0).unwrap();
        model.step(0.0, 110.0);
        assert_eq!(model.temperature(), 110.0);
        assert!((model.derating() - 1.0 / 3.0).abs() < 1e-6);
    }

    #[test]
    fn derating_falls_in_a_line_from_warning_to_limit() {
        for (temperature, factor) in [(25.0, 1.0), (90.0, 1.0), (105.0, 0.5), (120.0, 0.0), (160.0, 0.0)] {
            let model = WindingTemperature::new(&SETTINGS, temperature).unwrap();
            assert_eq!(model.derating(), factor, "{temperature} °C");
        }
    }

    #[test]
    fn derating_holds_the_winding_below_its_limit() {
        let mut model = WindingTemperature::new(&SETTINGS, 25.0).unwrap();
        let mut hottest = 0f32;
        for _ in 0..2_000 * 100 {
            let current = 30.0 * model.derating();
            model.step(current * current, f32::NAN);
            hottest = hottest.max(model.temperature());
        }
        assert!((90.0..120.0).contains(&hottest), "{hottest}");
    }

    #[test]
    fn the_mean_square_of_a_second_is_exact_to_a_thousandth() {
        let mut current = MeanSquareCurrent::default();
        for n in 0..10_000 {
            current.add(Dq { d: 0.0, q: if n % 2 == 0 { 3.0 } else { 17.0 } });
        }
        assert!((current.take() / 149.0 - 1.0).abs() < 1e-3);
        assert_eq!(current.take(), 0.0, "nothing was added since");
        current.add(Dq { d: f32::NAN, q: 1.0 });
        current.add(Dq { d: 0.0, q: 2.0 });
        assert_eq!(current.take(), 2.0);
    }

    proptest! {
        #[test]
        fn no_input_leaves_the_range_of_temperatures(bits in prop::collection::vec((any::<u32>(), any::<u32>()), 1..50)) {
            let mut model = WindingTemperature::new(&SETTINGS, 25.0).unwrap();
            for (square, sensor) in bits {
                model.step(f32::from_bits(square), f32::from_bits(sensor));
                prop_assert!((RANGE.0..=RANGE.1).contains(&model.temperature()), "{model:?}");
                prop_assert!((0.0..=1.0).contains(&model.derating()));
            }
            for _ in 0..100_000 {
                model.step(0.0, f32::NAN);
            }
            prop_assert!(model.temperature() < 75.0, "{model:?}");
        }
    }

    #[test]
    fn settings_out_of_range_are_refused_by_name() {
        let refused = |settings: ThermalSettings| WindingTemperature::new(&settings, 25.0).unwrap_err();
        assert_eq!(refused(ThermalSettings { resistance: 0.0, ..SETTINGS }).name, "phase resistance");
        assert_eq!(refused(ThermalSettings { limit: 91.0, ..SETTINGS }).name, "limit temperature");
        let fast = refused(ThermalSettings { winding_capacity: 1.0, winding_to_housing: 0.05, ..SETTINGS });
        assert_eq!((fast.name.text(), fast.low), ("winding's heat capacity", 2.0));
        assert!(WindingTemperature::new(&SETTINGS, f32::NAN).is_err());
    }
}
