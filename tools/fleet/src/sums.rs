//! Sums of one joint and day: what a linear model, its errors and a look at the motion need; host.

use crate::windows::{Recorded, UNKNOWNS, Window};

/// Entries of the upper triangle of A'A.
pub const TRIANGLE: usize = UNKNOWNS * (UNKNOWNS + 1) / 2;
/// Upper ends of the bins of |velocity|, rad/s; the last bin has none.
pub const SPEEDS: [f64; 7] = [0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0];
/// Upper ends of the bins of |residual| of the day's own model, as a part of the torque's RMS; the last bin has none.
pub const RESIDUALS: [f64; 7] = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0];

/// Sums over the windows of one joint and day. Adding two is adding every number; the order decides the last bits.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sums {
    /// Windows.
    pub windows: f64,
    /// Time of all rows, s.
    pub seconds: f64,
    /// Upper triangle of A'A, row by row.
    pub products: [f64; TRIANGLE],
    /// A'torque.
    pub with_torque: [f64; UNKNOWNS],
    /// Sum of squares of the torque.
    pub torque_squares: f64,
    /// Sum of temperature times time, °C s; NaN where there is none.
    pub temperature: f64,
    /// Windows by |velocity|.
    pub speeds: [f64; SPEEDS.len() + 1],
    /// Windows by |residual| of the day's own model.
    pub residuals: [f64; RESIDUALS.len() + 1],
}

impl Sums {
    /// The sums of recordings, one after the other; `solve` gives the day's own model for the residuals.
    pub fn of(recorded: &[Recorded], solve: impl Fn(&Sums) -> Option<[f64; UNKNOWNS]>) -> Self {
        let mut sums = Self::default();
        for recorded in recorded {
            sums.seconds += recorded.seconds;
            sums.temperature += recorded.temperature * recorded.seconds;
            recorded.windows.iter().for_each(|window| sums.add_window(window));
        }
        if let Some(model) = solve(&sums) {
            let rms = (sums.torque_squares / sums.windows).sqrt();
            for window in recorded.iter().flat_map(|recorded| &recorded.windows) {
                let predicted: f64 = window.row.iter().zip(model).map(|(factor, value)| factor * value).sum();
                sums.residuals[bin(&RESIDUALS, (window.torque - predicted).abs() / rms)] += 1.0;
            }
        }
        sums
    }

    fn add_window(&mut self, window: &Window) {
        self.windows += 1.0;
        let mut products = self.products.iter_mut();
        for (i, left) in window.row.iter().enumerate() {
            window.row[i..].iter().zip(&mut products).for_each(|(right, sum)| *sum += left * right);
        }
        self.with_torque.iter_mut().zip(window.row).for_each(|(sum, factor)| *sum += factor * window.torque);
        self.torque_squares += window.torque * window.torque;
        self.speeds[bin(&SPEEDS, window.row[UNKNOWNS - 1].abs())] += 1.0;
    }

    /// Adds the sums of another day.
    pub fn add(&mut self, other: &Self) {
        self.numbers_mut().zip(other.numbers()).for_each(|(sum, value)| *sum += value);
    }

    /// All numbers, in a fixed order.
    pub fn numbers(&self) -> impl Iterator<Item = f64> + '_ {
        let single = [self.windows, self.seconds, self.torque_squares, self.temperature];
        let several = self.products.iter().chain(&self.with_torque).chain(&self.speeds).chain(&self.residuals);
        single.into_iter().chain(several.copied())
    }

    /// The same, to be written.
    pub fn numbers_mut(&mut self) -> impl Iterator<Item = &mut f64> {
        let single = [&mut self.windows, &mut self.seconds, &mut self.torque_squares, &mut self.temperature];
        let several = self.products.iter_mut().chain(&mut self.with_torque);
        single.into_iter().chain(several).chain(&mut self.speeds).chain(&mut self.residuals)
    }

    /// Names of the numbers, in the same order.
    pub fn names() -> Vec<String> {
        let mut names: Vec<String> =
            ["windows", "seconds", "torque_squares", "temperature_seconds"].map(str::to_owned).into();
        for i in 0..UNKNOWNS {
            names.extend((i..UNKNOWNS).map(|j| format!("product_{i}_{j}")));
        }
        names.extend((0..UNKNOWNS).map(|i| format!("with_torque_{i}")));
        names.extend((0..=SPEEDS.len()).map(|i| format!("speed_bin_{i}")));
        names.extend((0..=RESIDUALS.len()).map(|i| format!("residual_bin_{i}")));
        names
    }

    /// Mean temperature, °C; NaN where there is none.
    pub fn mean_temperature(&self) -> f64 {
        self.temperature / self.seconds
    }
}

/// The bin of a value; the upper end belongs to the bin.
fn bin(ends: &[f64], value: f64) -> usize {
    ends.iter().position(|end| value <= *end).unwrap_or(ends.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_has_a_name_of_its_own_and_is_added() {
        let names = Sums::names();
        assert_eq!(names.iter().collect::<std::collections::BTreeSet<_>>().len(), names.len());
        let mut sums = Sums::default();
        assert_eq!(sums.numbers().count(), names.len());
        sums.numbers_mut().enumerate().for_each(|(i, number)| *number = i as f64);
        let other = sums.clone();
        sums.add(&other);
        assert!(sums.numbers().enumerate().all(|(i, number)| number == 2.0 * i as f64));
    }

    #[test]
    fn a_value_at_the_end_of_a_bin_is_in_it_and_one_above_in_the_next() {
        assert_eq!([0.0, 0.05, 0.050001, 5.0, 5.1].map(|value| bin(&SPEEDS, value)), [0, 0, 1, 6, 7]);
    }
}
