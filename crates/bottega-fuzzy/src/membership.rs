//! Membership functions.

/// The membership function of a term: the degree to which each number belongs to it.
#[derive(Clone, Debug, PartialEq)]
pub enum Membership {
    /// 1 at a single point, 0 elsewhere.
    Singleton(f64),
    /// Piecewise linear through points (x, y) with non-decreasing x and 0 ≤ y ≤ 1; constant outside of them. Two points
    /// with equal x make a step, whose value at x is that of the second.
    Linear(Vec<(f64, f64)>),
}

impl Membership {
    /// Returns the degree to which `x` belongs to the term, 0..=1.
    ///
    /// # Panics
    /// If the function is [`Membership::Linear`] without a point; the parser makes none such.
    pub fn degree(&self, x: f64) -> f64 {
        match self {
            Self::Singleton(at) => f64::from(u8::from(x == *at)),
            Self::Linear(points) => right_limit(points, x),
        }
    }

    /// Returns the least and the greatest x of its points.
    pub(crate) fn extent(&self) -> (f64, f64) {
        match self {
            Self::Singleton(at) => (*at, *at),
            Self::Linear(points) => (points[0].0, points[points.len() - 1].0),
        }
    }
}

/// Returns the limit from the right at `x`, which is also the value there.
pub(crate) fn right_limit(points: &[(f64, f64)], x: f64) -> f64 {
    between(points, points.partition_point(|point| point.0 <= x), x)
}

/// Returns the limit from the left at `x`.
pub(crate) fn left_limit(points: &[(f64, f64)], x: f64) -> f64 {
    between(points, points.partition_point(|point| point.0 < x), x)
}

/// Returns the value at `x`, between the point before `next` and the point `next`.
fn between(points: &[(f64, f64)], next: usize, x: f64) -> f64 {
    if next == 0 {
        return points[0].1;
    }
    if next == points.len() {
        return points[next - 1].1;
    }
    let ((x0, y0), (x1, y1)) = (points[next - 1], points[next]);
    // Interpolate so that the ends are exact and the result stays within y0..y1
    let t = ((x - x0) / (x1 - x0)).clamp(0.0, 1.0);
    y0 * (1.0 - t) + y1 * t
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_are_shoulders_and_equal_x_make_a_step() {
        let step = Membership::Linear(vec![(1.0, 0.2), (2.0, 0.4), (2.0, 1.0), (4.0, 0.0)]);
        let degrees = [-9.0, 1.5, 2.0, 3.0, 9.0, f64::INFINITY].map(|x| step.degree(x));
        for (degree, expected) in degrees.into_iter().zip([0.2, 0.3, 1.0, 0.5, 0.0, 0.0]) {
            assert!((degree - expected).abs() < 1e-12, "{degrees:?}");
        }
        let Membership::Linear(points) = &step else { unreachable!() };
        assert!((left_limit(points, 2.0) - 0.4).abs() < 1e-12);
        assert_eq!(Membership::Singleton(3.0).degree(3.0), 1.0);
        assert_eq!(Membership::Singleton(3.0).degree(3.1), 0.0);
    }
}
