//! Numbers as people read them: four significant digits, no exponent where none is needed; host.

/// Placeholder of a number that does not exist.
pub const NONE: &str = "–";

/// `value` with `digits` significant digits, as a decimal between 1e-4 and 1e7, else with an exponent.
pub fn significant(value: f64, digits: usize) -> String {
    if !value.is_finite() {
        return NONE.to_owned();
    }
    if value == 0.0 {
        return "0".to_owned();
    }
    let fraction = digits.saturating_sub(1);
    let scientific = format!("{value:.fraction$e}");
    // The exponent after rounding: 9.9996 has become 1.000e1.
    let exponent: i32 = scientific.split_once('e').and_then(|(_, e)| e.parse().ok()).unwrap_or(0);
    if !(-4..7).contains(&exponent) {
        return scientific;
    }
    let decimals = (fraction as i32 - exponent).max(0) as usize;
    format!("{value:.decimals$}")
}

/// Four significant digits, or a dash.
pub fn optional(value: Option<f64>) -> String {
    value.map_or_else(|| NONE.to_owned(), |value| significant(value, 4))
}

/// A value and its standard error with the same decimals, such that the error has two significant digits.
pub fn with_error(value: f64, error: Option<f64>) -> (String, String) {
    let Some(error) = error.filter(|error| error.is_finite() && *error > 0.0 && value.is_finite()) else {
        return (significant(value, 4), NONE.to_owned());
    };
    let decimals = 1.0 - error.log10().floor();
    if !(0.0..=9.0).contains(&decimals) {
        return (significant(value, 5), significant(error, 2));
    }
    let decimals = decimals as usize;
    (format!("{value:.decimals$}"), format!("{error:.decimals$}"))
}

/// A percentage with one decimal (two below 10, none above 1000), without the sign %, or a dash.
pub fn percent(value: Option<f64>) -> String {
    match value {
        Some(value) if value.is_finite() => {
            let decimals = match value.abs() {
                size if size < 10.0 => 2,
                size if size < 1000.0 => 1,
                _ => 0,
            };
            format!("{value:.decimals$}")
        }
        _ => NONE.to_owned(),
    }
}

/// A count with a thin space between thousands.
pub fn count(value: u64) -> String {
    let digits = value.to_string();
    let mut grouped = String::new();
    for (place, digit) in digits.chars().enumerate() {
        if place > 0 && (digits.len() - place).is_multiple_of(3) {
            grouped.push('\u{2009}');
        }
        grouped.push(digit);
    }
    grouped
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_the_digits_that_matter_and_exponents_only_when_needed() {
        let four = |value| significant(value, 4);
        assert_eq!(four(1234.56), "1235");
        assert_eq!(four(1_234_567.0), "1234567");
        assert_eq!(four(0.159), "0.1590");
        assert_eq!(four(-0.000123456), "-0.0001235");
        assert_eq!(four(9.99996), "10.00");
        assert_eq!(four(1.23456e-9), "1.235e-9");
        assert_eq!(four(0.0), "0");
        assert_eq!(four(f64::NAN), NONE);
    }

    #[test]
    fn a_value_has_the_decimals_that_its_error_leaves() {
        let text = |value, error| with_error(value, error);
        assert_eq!(text(1.097_312, Some(0.004_13)), ("1.0973".into(), "0.0041".into()));
        assert_eq!(text(-1234.5, Some(3.21)), ("-1234.5".into(), "3.2".into()));
        assert_eq!(text(1.5e-9, Some(2e-12)), ("1.5000e-9".into(), "2.0e-12".into()));
        assert_eq!(text(0.25, None), ("0.2500".into(), NONE.into()));
        assert_eq!(text(0.25, Some(f64::INFINITY)), ("0.2500".into(), NONE.into()));
    }

    #[test]
    fn percentages_and_counts_are_readable() {
        assert_eq!(
            (percent(Some(87.128)), percent(Some(1.415)), percent(Some(12345.6))),
            ("87.1".into(), "1.42".into(), "12346".into())
        );
        assert_eq!((percent(None), percent(Some(f64::INFINITY))), (NONE.into(), NONE.into()));
        assert_eq!(
            (count(0), count(999), count(1_234_567)),
            ("0".into(), "999".into(), "1\u{2009}234\u{2009}567".into())
        );
    }
}
