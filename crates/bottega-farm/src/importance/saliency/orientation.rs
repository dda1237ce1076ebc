//! Local orientation by Gabor filters.

use std::f64::consts::{FRAC_1_SQRT_2, PI};

use super::plane::Plane;

/// Radius of a filter, in pixels.
const REACH: i64 = 4;
/// Wavelength, in pixels: that of the thinnest bars a level can show.
const WAVE: f64 = 4.0;
/// Standard deviation of the Gaussian window, in pixels.
const WINDOW: f64 = 1.6;
/// Width of a filter, in taps.
const SIDE: usize = 2 * REACH as usize + 1;

/// A Gabor filter pair: a cosine and a sine in a Gaussian window, both with zero response to a constant.
struct GaborPair {
    even: [f32; SIDE * SIDE],
    odd: [f32; SIDE * SIDE],
}

/// Gabor filters at 0°, 45°, 90° and 135°.
pub(super) struct Orientations([GaborPair; Orientations::COUNT]);

impl Orientations {
    /// Number of orientations.
    pub(super) const COUNT: usize = 4;

    /// Makes the Gabor filters of all orientations.
    pub(super) fn new() -> Self {
        // Directions of the waves; exact, so that only `exp` and `cos` of small numbers round.
        let directions = [(1.0, 0.0), (FRAC_1_SQRT_2, FRAC_1_SQRT_2), (0.0, 1.0), (-FRAC_1_SQRT_2, FRAC_1_SQRT_2)];
        Self(directions.map(|(dx, dy)| pair(dx, dy)))
    }

    /// Returns the strength of one orientation at every pixel: the root of the summed squares of both responses, which
    /// does not depend on the phase of an edge or bar.
    pub(super) fn strength(&self, plane: &Plane, orientation: usize) -> Plane {
        let GaborPair { even, odd } = &self.0[orientation];
        let (width, height) = plane.size();
        // Pad by the filter's radius, so that rows are slices
        let side = i64::from(width) + 2 * REACH;
        let rows = (-REACH..i64::from(height) + REACH).flat_map(|y| (0..side).map(move |x| (x - REACH, y)));
        let rimmed: Vec<f32> = rows.map(|(x, y)| plane.at(x, y)).collect();
        let (width, side) = (width as usize, side as usize);
        let mut strength = Plane::zero(plane.size());
        let (mut a, mut b) = (vec![0.0; width], vec![0.0; width]);
        for (y, answer) in strength.values.chunks_exact_mut(width).enumerate() {
            a.fill(0.0);
            b.fill(0.0);
            for (i, (even, odd)) in even.iter().zip(odd).enumerate() {
                let values = &rimmed[(y + i / SIDE) * side + i % SIDE..][..width];
                for ((a, b), value) in a.iter_mut().zip(&mut b).zip(values) {
                    *a += even * value;
                    *b += odd * value;
                }
            }
            answer.iter_mut().zip(&a).zip(&b).for_each(|((answer, a), b)| *answer = (a * a + b * b).sqrt());
        }
        strength
    }
}

fn pair(dx: f64, dy: f64) -> GaborPair {
    let taps = |wave: fn(f64) -> f64| -> Vec<f64> {
        let tap = |i: usize| {
            let (x, y) = ((i % SIDE) as f64 - REACH as f64, (i / SIDE) as f64 - REACH as f64);
            (-(x * x + y * y) / (2.0 * WINDOW * WINDOW)).exp() * wave(2.0 * PI / WAVE * (x * dx + y * dy))
        };
        (0..SIDE * SIDE).map(tap).collect()
    };
    let window = taps(|_| 1.0);
    let even = taps(f64::cos);
    // Subtract the cosine's response to a constant, in the shape of the window
    let share = even.iter().sum::<f64>() / window.iter().sum::<f64>();
    let even: Vec<f64> = even.iter().zip(&window).map(|(even, window)| even - share * window).collect();
    let odd = taps(f64::sin);
    let in_bounds = |taps: &[f64]| {
        let size: f64 = taps.iter().map(|tap| tap.abs()).sum();
        std::array::from_fn(|i| (taps[i] / size) as f32)
    };
    GaborPair { even: in_bounds(&even), odd: in_bounds(&odd) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stripes_excite_the_filter_across_them_most() {
        let orientations = Orientations::new();
        let stripe = |phase: i64| if phase.rem_euclid(4) < 2 { 1.0 } else { 0.0 };
        let across: [fn(i64, i64) -> i64; 2] = [|x, _| x, |_, y| y];
        for (wanted, coordinate) in [0, 2].into_iter().zip(across) {
            let values = (0..32 * 32).map(|i| stripe(coordinate(i % 32, i / 32))).collect();
            let plane = Plane::new(32, 32, values);
            let strengths: Vec<f32> = (0..4).map(|angle| orientations.strength(&plane, angle).at(16, 16)).collect();
            for (angle, &strength) in strengths.iter().enumerate().filter(|&(angle, _)| angle != wanted) {
                assert!(strengths[wanted] > 2.0 * strength, "{wanted}: {angle} in {strengths:?}");
            }
        }
    }

    #[test]
    fn what_is_even_has_no_orientation() {
        let plane = Plane::new(12, 12, vec![0.7; 144]);
        for angle in 0..Orientations::COUNT {
            assert!(Orientations::new().strength(&plane, angle).values.iter().all(|value| *value < 1e-6));
        }
    }
}
