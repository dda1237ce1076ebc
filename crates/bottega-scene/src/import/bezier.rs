//! Cubic Bézier curves, and their division into straight pieces.

use std::ops::{Add, Mul};

use glam::DVec4;

/// A cubic Bézier segment: its control points, with a radius or 0 as fourth component.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct BezierSegment(pub(crate) [DVec4; 4]);

impl BezierSegment {
    /// Returns the length of the control polygon, which the curve does not exceed.
    pub(crate) fn control_length(&self) -> f64 {
        let [a, b, c, d] = self.0;
        (b - a).length() + (c - b).length() + (d - c).length()
    }

    /// Returns the number of pieces, equal in the parameter, whose chords deviate from the curve by at most
    /// `tolerance`: a chord deviates from a cubic by at most an eighth of its greatest second derivative (de Boor).
    ///
    /// - `max`: greatest number.
    pub(crate) fn pieces(&self, tolerance: f64, max: f64) -> u32 {
        let [a, b, c, d] = self.0;
        let bend = (a - b * 2.0 + c).length().max((b - c * 2.0 + d).length());
        (0.75 * bend / tolerance.max(f64::MIN_POSITIVE)).sqrt().ceil().clamp(1.0, max) as u32
    }

    /// Returns the point at a parameter in [0, 1].
    pub(crate) fn point(&self, t: f64) -> DVec4 {
        let ([a, b, c, d], s) = (self.0, 1.0 - t);
        a * (s * s * s) + b * (3.0 * s * s * t) + c * (3.0 * s * t * t) + d * (t * t * t)
    }

    /// Returns a third of the derivative at a parameter in [0, 1].
    pub(crate) fn third_of_slope(&self, t: f64) -> DVec4 {
        let ([a, b, c, d], s) = (self.0, 1.0 - t);
        (b - a) * (s * s) + (c - b) * (2.0 * s * t) + (d - c) * (t * t)
    }
}

/// Iterates over the parameters of the ends of a segment's pieces. Segments share their ends, so only the first one
/// has the parameter 0.
pub(crate) fn parameters(is_first: bool, pieces: u32) -> impl Iterator<Item = f64> {
    (u32::from(!is_first)..=pieces).map(move |piece| f64::from(piece) / f64::from(pieces))
}

/// Returns the Bézier control points of a segment of a uniform cubic B-spline.
pub(crate) fn bezier_of_bspline<V: Copy + Add<Output = V> + Mul<f64, Output = V>>([a, b, c, d]: [V; 4]) -> [V; 4] {
    let (third, sixth) = (1.0 / 3.0, 1.0 / 6.0);
    [(a + b * 4.0 + c) * sixth, (b * 2.0 + c) * third, (b + c * 2.0) * third, (b + c * 4.0 + d) * sixth]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// de Boor's rule for the uniform cubic B-spline, in its power form, beside the Bernstein form.
    #[test]
    fn a_segment_is_the_same_in_both_bases() {
        let points = [
            DVec4::new(0.0, 1.0, 0.2, 0.1),
            DVec4::new(1.0, -2.0, 0.5, 0.3),
            DVec4::new(2.5, 0.3, 1.0, 0.2),
            DVec4::new(3.0, 4.0, -1.0, 0.05),
        ];
        let bezier = bezier_of_bspline(points);
        for step in 0..=8 {
            let t = f64::from(step) / 8.0;
            let s = 1.0 - t;
            let (t2, t3) = (t * t, t * t * t);
            let spline = [s * s * s, 3.0 * t3 - 6.0 * t2 + 4.0, -3.0 * t3 + 3.0 * t2 + 3.0 * t + 1.0, t3];
            let bernstein = [s * s * s, 3.0 * s * s * t, 3.0 * s * t2, t3];
            let sum = |weights: [f64; 4], points: [DVec4; 4]| -> DVec4 {
                weights.into_iter().zip(points).map(|(weight, point)| point * weight).sum()
            };
            assert!((sum(spline, points) / 6.0 - sum(bernstein, bezier)).length() < 1e-12);
        }
    }
}
