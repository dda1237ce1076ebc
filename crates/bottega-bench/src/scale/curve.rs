//! A quantity over sizes, and the fit of a power law to it.

use serde::Serialize;

/// One measured size.
#[derive(Clone, Copy, Debug, Serialize)]
pub(super) struct Point {
    pub(super) size: u64,
    pub(super) value: f64,
}

/// A quantity measured over sizes, with the law that it should follow.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Curve {
    pub(super) axis: &'static str,
    /// The quantity measured, with its unit.
    pub(super) quantity: &'static str,
    /// The expected law, readable.
    pub(super) law: &'static str,
    /// The exponents of the size that agree with the law.
    pub(super) expected: [f64; 2],
    /// The exponent fitted to the larger half of the points; `None`: fewer than two.
    pub(super) exponent: Option<f64>,
    pub(super) points: Vec<Point>,
}

impl Curve {
    /// Fits the exponent to the points.
    pub(super) fn fit(&mut self) {
        self.exponent = exponent(&self.points);
    }
}

/// Returns the exponent p of the law value = a · sizeᵖ by least squares in logarithms, over the larger half of the sizes:
/// constant costs dominate the smaller ones. `None`: fewer than two sizes.
fn exponent(points: &[Point]) -> Option<f64> {
    let half = (points.len() / 2).min(points.len().saturating_sub(3));
    let logs: Vec<[f64; 2]> = points[half..]
        .iter()
        .filter(|point| point.size > 0 && point.value > 0.0)
        .map(|point| [(point.size as f64).ln(), point.value.ln()])
        .collect();
    let count = logs.len() as f64;
    let mean = |axis: usize| logs.iter().map(|log| log[axis]).sum::<f64>() / count;
    let (x, y) = (mean(0), mean(1));
    let spread: f64 = logs.iter().map(|log| (log[0] - x).powi(2)).sum();
    let common: f64 = logs.iter().map(|log| (log[0] - x) * (log[1] - y)).sum();
    (logs.len() > 1 && spread > 0.0).then(|| common / spread)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_exponent_of_a_power_is_found_and_a_constant_part_is_passed_over() {
        let points = |law: fn(f64) -> f64| -> Vec<Point> {
            (0..10).map(|i| 1_u64 << (2 * i)).map(|size| Point { size, value: law(size as f64) }).collect()
        };
        assert!((exponent(&points(|x| 3.0 * x * x)).unwrap() - 2.0).abs() < 1e-9);
        assert!((exponent(&points(|x| 50.0 + x)).unwrap() - 1.0).abs() < 0.05);
        assert!(exponent(&points(|_| 7.0)).unwrap().abs() < 1e-9);
        assert_eq!(exponent(&points(|x| x)[..1]), None);
    }
}
