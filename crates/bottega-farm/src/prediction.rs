//! Measures of how well predicted numbers agree with measured ones.

/// Agreement of predicted with measured numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prediction {
    /// Spearman's rank correlation, −1..=1: agreement of the order by size. 1 is perfect.
    pub rank_correlation: f64,
    /// R²: the share of the variance of the measured numbers that the prediction explains, after scaling it to the same
    /// sum. At most 1; below 0 if the mean predicts better.
    pub r_squared: f64,
}

impl Prediction {
    /// Compares numbers pair by pair. Returns the agreement; `None` for fewer than three pairs, for numbers that are
    /// not finite, and if all predicted or all measured numbers are equal or the predicted ones add up to 0.
    ///
    /// # Panics
    /// If the lengths differ.
    pub fn of(predicted: &[f64], measured: &[f64]) -> Option<Self> {
        assert_eq!(predicted.len(), measured.len(), "pairs of numbers");
        let finite = predicted.iter().chain(measured).all(|value| value.is_finite());
        if predicted.len() < 3 || !finite {
            return None;
        }
        let rank_correlation = correlation(&ranks(predicted), &ranks(measured))?;
        let scale = measured.iter().sum::<f64>() / predicted.iter().sum::<f64>();
        let mean = measured.iter().sum::<f64>() / measured.len() as f64;
        let left: f64 = predicted.iter().zip(measured).map(|(p, m)| (m - scale * p).powi(2)).sum();
        let variance: f64 = measured.iter().map(|m| (m - mean).powi(2)).sum();
        let r_squared = 1.0 - left / variance;
        r_squared.is_finite().then_some(Self { rank_correlation, r_squared })
    }
}

/// Returns the rank of each number, from 1; equal numbers share the mean of their ranks.
fn ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    let mut ranks = vec![0.0; values.len()];
    let mut first = 0;
    while first < order.len() {
        let is_equal = |&&i: &&usize| values[i] == values[order[first]];
        let count = order[first..].iter().take_while(is_equal).count();
        let shared = first as f64 + 0.5 * (count as f64 + 1.0);
        order[first..first + count].iter().for_each(|&i| ranks[i] = shared);
        first += count;
    }
    ranks
}

/// Returns Pearson's correlation; `None` if one side is constant.
fn correlation(a: &[f64], b: &[f64]) -> Option<f64> {
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let (mean_a, mean_b) = (mean(a), mean(b));
    let product = |x: &[f64], mean_x: f64, y: &[f64], mean_y: f64| {
        x.iter().zip(y).map(|(x, y)| (x - mean_x) * (y - mean_y)).sum::<f64>()
    };
    let varied = product(a, mean_a, a, mean_a) * product(b, mean_b, b, mean_b);
    (varied > 0.0).then(|| product(a, mean_a, b, mean_b) / varied.sqrt())
}

/// Agreement of T_est before profiling with the measured times.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Forecast {
    /// Number of zones compared.
    pub zones: usize,
    /// Spearman's rank correlation, −1..=1; `None` if undefined.
    pub rank_correlation: Option<f64>,
    /// Median of |T_est − T| ∕ T.
    pub median_error: f64,
    /// The sum of T_est over the sum of T.
    pub total_ratio: f64,
}

impl Forecast {
    /// Compares pairs of T_est and T, both in seconds, without those that are not finite or have T ≤ 0. Returns the
    /// agreement; `None`: no pair is left.
    pub fn of(pairs: &[(f64, f64)]) -> Option<Self> {
        let is_sound = |(expected, taken): &&(f64, f64)| expected.is_finite() && taken.is_finite() && *taken > 0.0;
        let (expected, taken): (Vec<f64>, Vec<f64>) = pairs.iter().filter(is_sound).copied().unzip();
        let mut errors: Vec<f64> = expected.iter().zip(&taken).map(|(e, t)| (e - t).abs() / t).collect();
        errors.sort_unstable_by(f64::total_cmp);
        let median_error = *errors.get(errors.len() / 2)?;
        Some(Self {
            zones: taken.len(),
            rank_correlation: Prediction::of(&expected, &taken).map(|it| it.rank_correlation),
            median_error,
            total_ratio: expected.iter().sum::<f64>() / taken.iter().sum::<f64>(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_forecast_is_rated_by_ranks_and_by_its_median_error() {
        let forecast = Forecast::of(&[(1.0, 2.0), (2.0, 4.0), (3.0, 6.0), (9.0, 0.0), (8.0, 8.0)]).unwrap();
        assert_eq!((forecast.zones, forecast.rank_correlation, forecast.median_error), (4, Some(1.0), 0.5));
        assert_eq!(forecast.total_ratio, 14.0 / 20.0);
        assert_eq!(Forecast::of(&[(1.0, 0.0)]), None);
    }

    #[test]
    fn a_prediction_in_other_units_is_perfect() {
        let measured = [3.0, 1.0, 2.0, 7.0];
        let predicted = measured.map(|value| 40.0 * value);
        let found = Prediction::of(&predicted, &measured).unwrap();
        assert!((found.rank_correlation - 1.0).abs() < 1e-12 && (found.r_squared - 1.0).abs() < 1e-12);
    }

    #[test]
    fn ranks_do_not_see_how_far_apart_values_are_and_ties_share_theirs() {
        let found = Prediction::of(&[1.0, 2.0, 3.0], &[1.0, 2.0, 1e6]).unwrap();
        assert!((found.rank_correlation - 1.0).abs() < 1e-12 && found.r_squared < 0.9);
        assert_eq!(ranks(&[5.0, 1.0, 5.0, 9.0]), [2.5, 1.0, 2.5, 4.0]);
        // The textbook's example: 1 − 6 Σd² / (n (n² − 1)) with Σd² = 4, n = 4.
        let swapped = Prediction::of(&[2.0, 1.0, 4.0, 3.0], &[1.0, 2.0, 3.0, 4.0]).unwrap();
        assert!((swapped.rank_correlation - 0.6).abs() < 1e-12);
    }

    #[test]
    fn of_what_does_not_vary_nothing_can_be_said() {
        assert_eq!(Prediction::of(&[1.0, 1.0, 1.0], &[1.0, 2.0, 3.0]), None);
        assert_eq!(Prediction::of(&[1.0, 2.0], &[1.0, 2.0]), None);
        assert_eq!(Prediction::of(&[1.0, 2.0, f64::NAN], &[1.0, 2.0, 3.0]), None);
    }
}
