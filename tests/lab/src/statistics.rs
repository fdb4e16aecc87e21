//! Statistics of samples.

/// Arithmetic mean; not a number of none.
#[must_use]
pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Standard deviation of what the values are a sample of; not a number of less than two.
#[must_use]
pub fn deviation(values: &[f64]) -> f64 {
    let mean = mean(values);
    let squares: f64 = values.iter().map(|value| (value - mean) * (value - mean)).sum();
    (squares / (values.len() as f64 - 1.0)).sqrt()
}

#[must_use]
pub fn root_mean_square(values: &[f64]) -> f64 {
    mean(&values.iter().map(|value| value * value).collect::<Vec<_>>()).sqrt()
}

/// Between what bounds the mean of what these are a sample of lies, with 95 % confidence (Student's t).
#[must_use]
pub fn confidence_95(values: &[f64]) -> [f64; 2] {
    let reach = student_t_95(values.len() as f64 - 1.0) * deviation(values) / (values.len() as f64).sqrt();
    [-reach, reach].map(|reach| mean(values) + reach)
}

/// The 97.5 % quantile of Student's t (Abramowitz and Stegun 1964, 26.7.5): within 0.1 % from 8 degrees of freedom on.
fn student_t_95(freedom: f64) -> f64 {
    let z: f64 = 1.959_964;
    let [z3, z5, z7] = [3, 5, 7].map(|power| (1..power).fold(z, |product, _| product * z));
    z + (z3 + z) / (4.0 * freedom)
        + (5.0 * z5 + 16.0 * z3 + 3.0 * z) / (96.0 * freedom * freedom)
        + (3.0 * z7 + 19.0 * z5 + 17.0 * z3 - 15.0 * z) / (384.0 * freedom * freedom * freedom)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_answers() {
        let values = [2.0, 4.0, 4.0, 4.0, 5.0, 5.0, 7.0, 9.0];
        assert_eq!(mean(&values), 5.0);
        assert!((deviation(&values) - (32.0_f64 / 7.0).sqrt()).abs() < 1e-12);
        assert!((root_mean_square(&[3.0, 4.0]) - 12.5_f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn students_quantiles_are_those_of_the_tables() {
        for (freedom, quantile) in [(8.0, 2.306), (20.0, 2.086), (99.0, 1.984), (499.0, 1.965)] {
            let found = student_t_95(freedom);
            assert!((found / quantile - 1.0).abs() < 1e-3, "{freedom}: {found}");
        }
    }

    #[test]
    fn of_one_value_nothing_is_known() {
        assert!(confidence_95(&[1.0]).iter().all(|bound| bound.is_nan()));
    }
}
