//! Differentiation of evenly spaced signals; host.

/// Central difference (x[i+1] - x[i-1]) / (2 T), one-sided at both ends; zeros where there are fewer than two values.
///
/// `period` T in s. It is the derivative of the EMPS benchmark's protocol: no phase lag, and a gain of sin(w T) / (w
/// T).
pub fn central_difference(values: &[f64], period: f64) -> Vec<f64> {
    let last = values.len().saturating_sub(1);
    (0..values.len())
        .map(|i| {
            let (before, after) = (i.saturating_sub(1), (i + 1).min(last));
            match after - before {
                0 => 0.0,
                steps => (values[after] - values[before]) / (steps as f64 * period),
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_derivative_of_a_parabola_is_exact_inside_and_one_sided_at_the_ends() {
        let x: Vec<f64> = (0..5).map(|i| (0.1 * f64::from(i)).powi(2)).collect();
        let expected = [0.1, 0.2, 0.4, 0.6, 0.7];
        for (v, e) in central_difference(&x, 0.1).iter().zip(expected) {
            assert!((v - e).abs() < 1e-12, "{v} {e}");
        }
    }

    #[test]
    fn the_gain_on_a_sine_is_that_of_the_formula() {
        let (w, period) = (20.0, 0.01);
        let x: Vec<f64> = (0..400).map(|i| (w * period * f64::from(i)).sin()).collect();
        let v = central_difference(&x, period);
        let gain = (w * period).sin() / (w * period);
        for (i, v) in v.iter().enumerate().take(399).skip(1) {
            assert!((v - gain * w * (w * period * i as f64).cos()).abs() < 1e-9);
        }
    }

    #[test]
    fn too_few_values_have_no_slope() {
        assert_eq!(central_difference(&[], 0.1), Vec::<f64>::new());
        assert_eq!(central_difference(&[3.0], 0.1), vec![0.0]);
    }
}
